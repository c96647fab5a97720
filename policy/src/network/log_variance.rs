//! The bounds of the predicted log-variance, and the soft clamp that keeps it inside them.

use sim::maths;

/// Bounds of log σ²: σ between 0.01 and 1 image fraction (docs/methods.md 4.2).
pub const LOG_VARIANCE_MIN: f32 = -9.2;
/// See [`LOG_VARIANCE_MIN`].
pub const LOG_VARIANCE_MAX: f32 = 0.0;

/// Keeps log σ² inside its bounds without a corner: `mid + half · tanh((raw − mid)/half)`.
///
/// Slope 1 at the middle (σ = 0.1), positive everywhere, so that a saturated value can still be learned away from.
pub fn soft_clamp_log_variance(raw: f32) -> f32 {
    CLAMP_MID + CLAMP_HALF * maths::tanh((raw - CLAMP_MID) / CLAMP_HALF)
}

/// Inverse of [`soft_clamp_log_variance`], for initial values.
pub(crate) fn soft_clamp_inverse(log_variance: f32) -> f32 {
    CLAMP_MID + CLAMP_HALF * libm::atanhf((log_variance - CLAMP_MID) / CLAMP_HALF)
}

const CLAMP_MID: f32 = 0.5 * (LOG_VARIANCE_MIN + LOG_VARIANCE_MAX);
const CLAMP_HALF: f32 = 0.5 * (LOG_VARIANCE_MAX - LOG_VARIANCE_MIN);
