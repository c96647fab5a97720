//! The arcs and speeds that methods with a velocity search choose from.

use crate::context::PlannerContext;
use std::ops::RangeInclusive;

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

/// The best arc of a window, by index, and its best speed, m/s; among equals the straightest, which is nearest to the index
/// `straight`. The best speed of an arc comes with its rating.
pub(crate) fn best_arc(
    window: RangeInclusive<usize>,
    straight: usize,
    best_speed: impl Fn(usize) -> (f32, f32),
) -> (usize, f32) {
    let rated = window.map(|arc| (arc, best_speed(arc)));
    let best = rated.max_by(|&(a, (_, of_a)), &(b, (_, of_b))| {
        of_a.total_cmp(&of_b).then(b.abs_diff(straight).cmp(&a.abs_diff(straight)))
    });
    let (arc, (speed_mps, _)) = best.unwrap_or_else(|| (straight, best_speed(straight)));
    (arc, speed_mps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn among_equal_arcs_the_straightest_is_best() {
        // Of two that are equally straight, the one with the larger index: to the left.
        for (ratings, best) in [
            ([1.0, 3.0, 2.0, 0.0, 3.5], 4),
            ([2.0; 5], 2),
            ([3.0, 2.0, 1.0, 2.0, 3.0], 4),
            ([3.0, 3.0, 1.0, 1.0, 1.0], 1),
        ] {
            let best_speed = |arc: usize| (0.5 * arc as f32, ratings[arc]);
            assert_eq!(best_arc(0..=4, 2, best_speed), (best, 0.5 * best as f32), "{ratings:?}");
        }
        assert_eq!(best_arc(1..=3, 2, |arc| (1.0, if arc == 4 { 9.0 } else { 0.0 })).0, 2, "4 is not in the window");
    }
}
