//! The speeds that methods with a velocity search choose from.

use crate::context::PlannerContext;

/// Speeds to each arc: evenly spaced, the slowest and that of the controller's law among them.
const SPEEDS: usize = 9;

/// The speeds an arc may be driven at, m/s, ascending: from the controller's slowest to what its law for planners drives the
/// arc with. A driver can ask for less than the law, not for more.
pub(crate) fn up_to_law_mps(context: &PlannerContext, curvature_per_m: f32) -> impl Iterator<Item = f32> + use<> {
    let (slowest_mps, by_law_mps) = (context.controller.speed_min_mps, context.speed_mps(curvature_per_m));
    let step_mps = (by_law_mps - slowest_mps) / (SPEEDS - 1) as f32;
    (0..SPEEDS).map(move |step| if step + 1 == SPEEDS { by_law_mps } else { slowest_mps + step as f32 * step_mps })
}

/// The best of some rated speeds, m/s, with its rating; among equals the slowest.
pub(crate) fn best_of(rated: impl Iterator<Item = (f32, f32)>) -> (f32, f32) {
    let better = |best: (f32, f32), next: (f32, f32)| if next.1 > best.1 { next } else { best };
    rated.fold((0.0, f32::NEG_INFINITY), better)
}
