//! Where the route runs across the lane.

use super::strip::Strip;
use super::things::Narrowing;
use crate::corridor::{Side, to_millimetres};
use sim::scenario::ReferencePath;

/// The line that bends least within limits, its ends on the axis: relaxation of the thin-plate energy.
///
/// `room` are the lowest and highest offsets from the axis, metres, at equal distances along it.
pub(super) fn smoothest_within(room: &[(f32, f32)]) -> Vec<f32> {
    const ROUNDS: usize = 400;
    let count = room.len();
    let mut way = vec![0.0; count];
    for k in 2..count - 2 {
        way[k] = 0.5 * (room[k].0 + room[k].1);
    }
    for _ in 0..ROUNDS {
        for k in 2..count - 2 {
            let flat = (4.0 * (way[k - 1] + way[k + 1]) - way[k - 2] - way[k + 2]) / 6.0;
            way[k] = flat.clamp(room[k].0, room[k].1);
        }
    }
    way
}

/// A smooth line along a strip, through what narrowings leave free: a car put back onto the route finds free ground,
/// whichever way it is headed.
pub(super) fn along(strip: &Strip, (from_m, to_m): (f32, f32), narrowings: &[Narrowing]) -> ReferencePath {
    /// Bends of the route smaller than this are drawn straight, metres.
    const FLAT_M: f32 = 2e-3;
    /// Points are so near that rounding with any radius this large joins them smoothly.
    const ROUNDING_M: f32 = 100.0;
    let pieces = (to_m - from_m).floor();
    let at_m: Vec<f32> = (0..=pieces as usize).map(|k| from_m + k as f32 * (to_m - from_m) / pieces).collect();
    let room: Vec<_> = at_m.iter().map(|&s_m| room_for_route(strip, narrowings, s_m)).collect();
    let way = smoothest_within(&room);
    let points: Vec<_> =
        at_m.iter().zip(way).map(|(&s_m, way_m)| strip.point(s_m, way_m + inward_m(strip, s_m))).collect();
    let is_kept = |k: &usize| {
        let is_end = *k == 0 || *k == points.len() - 1;
        is_end || (points[k - 1] + points[k + 1] - 2.0 * points[*k]).length() > FLAT_M
    };
    let points = (0..points.len()).filter(is_kept).map(|k| to_millimetres(points[k])).collect();
    ReferencePath { points, corner_radius_m: ROUNDING_M }
}

/// How far the rear axle runs on the inner side of a bend, metres, positive to the left, so that the nose, 3.8 m ahead of
/// it, is as far from the outer edge as the flank from the inner one.
fn inward_m(strip: &Strip, s_m: f32) -> f32 {
    const NOSE_M: f32 = 3.8;
    const SAMPLES: i32 = 8;
    let at_m = |k: i32| (s_m + NOSE_M * k as f32 / SAMPLES as f32).clamp(0.0, strip.length_m());
    let mean_per_m =
        (-SAMPLES..=SAMPLES).map(|k| strip.curvature_per_m(at_m(k))).sum::<f32>() / (2 * SAMPLES + 1) as f32;
    0.25 * NOSE_M * NOSE_M * mean_per_m
}

/// Lowest and highest `d` of the middle of the body, metres, such that it stands free in either direction of driving.
fn room_for_route(strip: &Strip, narrowings: &[Narrowing], s_m: f32) -> (f32, f32) {
    /// The body reaches 3.8 m ahead of the rear axle, and its corners farther aside the more the route slopes.
    const REACH_M: f32 = 2.5;
    /// Half the car's width and a margin for the slope of the route.
    const ASIDE_M: f32 = 1.1;
    let half_m = [s_m - REACH_M, s_m, s_m + REACH_M]
        .map(|s_m| strip.half_width_m(s_m))
        .into_iter()
        .fold(f32::INFINITY, f32::min);
    let limit_m = |side: Side| {
        narrowings
            .iter()
            .filter(|other| other.side == side && other.from_m - REACH_M < s_m && s_m < other.to_m + REACH_M)
            .map(|other| half_m - other.protrusion_m)
            .fold(half_m, f32::min)
            - ASIDE_M
    };
    let (low_m, high_m) = (-limit_m(Side::Right), limit_m(Side::Left));
    if low_m <= high_m { (low_m, high_m) } else { (0.5 * (low_m + high_m), 0.5 * (low_m + high_m)) }
}
