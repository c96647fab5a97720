use serde::{Deserialize, Serialize};

/// What counts as a way out. All chosen, on development lots.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SafetySettings {
    /// Free travel that a way out must have, metres.
    pub free_m: f32,
    /// For how long an answer is followed before a way out must begin, seconds.
    pub commit_s: f32,
    /// The body is widened by this on either side, metres.
    pub side_margin_m: f32,
    /// The body is lengthened by this at the nose, metres; a near-collision is an obstacle within 0.5 m of travel.
    pub nose_margin_m: f32,
    /// Travel at which the second steering command of a way out takes over, metres, increasing.
    pub branch_travels_m: [f32; 3],
    /// Speed of the slower ways out, m/s.
    pub slow_mps: f32,
    /// Braking that is counted on, m/s².
    pub brake_mps2: f32,
}

/// DEBUG
pub fn env(key: &str, default: f32) -> f32 {
    std::env::var(key).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

impl Default for SafetySettings {
    fn default() -> Self {
        Self {
            free_m: env("S_FREE", 5.0),
            commit_s: env("S_COMMIT", 0.3),
            side_margin_m: env("S_SIDE", 0.05),
            nose_margin_m: env("S_NOSE", 0.5),
            branch_travels_m: [0.7, 1.6, 3.0],
            slow_mps: env("S_SLOW", 0.5),
            brake_mps2: 1.0,
        }
    }
}
