//! Fields: the repulsion they share, and the walk along one.

use crate::context::PlannerContext;
use crate::nearest::{Nearest, nearest_occupied};
use sim::geometry::Vec2;
use sim::sensing::OccupancyGrid;

/// Khatib's repulsion (1/ρ − 1/ρ₀)/ρ² at distance ρ, 0 beyond the range ρ₀: the slope of ½(1/ρ − 1/ρ₀)².
pub(crate) fn khatib_repulsion(distance_m: f32, range_m: f32) -> f32 {
    if distance_m >= range_m { 0.0 } else { (1.0 / distance_m - 1.0 / range_m) / (distance_m * distance_m) }
}

/// Half a cell: nearer than that, the grid says nothing about distances (docs/methods.md 7.1).
pub(crate) const DISTANCE_FLOOR_M: f32 = 0.24;
/// One step of the walk along a field, metres (docs/methods.md 7.1, *chosen*).
pub(crate) const WALK_STEP_M: f32 = 0.10;
/// A walk ends this far before an occupied cell, metres (docs/methods.md 7.1, *chosen*).
pub(crate) const WALK_STOPS_M: f32 = 0.2;
/// The look-ahead point that a walk ends with lies at least this far ahead of the rear axle, metres (docs/methods.md 7.1,
/// *chosen*).
pub(crate) const WALK_AHEAD_MIN_M: f32 = 2.3;
/// A field weaker than this has no direction: the walk goes forward (docs/methods.md 7.1, *chosen*).
pub(crate) const FIELD_MIN: f32 = 0.05;

/// "The look-ahead point is searched by descending along the gradient of the field's direction from the front of the
/// vehicle" (paper). Steps along the direction of `field(point, nearest occupied cell within range_m)` for `length_m`
/// at most; ends before it would leave the patch ahead or sideways, fall behind the rear axle or come too near to an
/// occupied cell. It may fall behind the bumper: a wall just ahead pushes it back and aside, and a walk that ended there
/// would answer "straight on", into the wall.
pub(crate) fn walk_along_field(
    grid: &OccupancyGrid,
    context: &PlannerContext,
    range_m: f32,
    length_m: f32,
    field: impl Fn(Vec2, Option<Nearest>) -> Vec2,
) -> Vec2 {
    let half_m = 0.5 * context.geometry.side_m;
    let mut point = context.bumper();
    for _ in 0..(length_m / WALK_STEP_M).round() as u32 {
        let force = field(point, nearest_occupied(grid, &context.geometry, point, range_m));
        let direction = if force.length() < FIELD_MIN { Vec2::X } else { force.normalize_or(Vec2::X) };
        let next = point + WALK_STEP_M * direction;
        let is_outside = next.x < 0.0 || next.x > context.geometry.far_edge_ahead_m() || next.y.abs() > half_m;
        if is_outside || nearest_occupied(grid, &context.geometry, next, WALK_STOPS_M).is_some() {
            break;
        }
        point = next;
    }
    point
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::context;

    /// The walk goes up to the wall and stops 0.2 m before it, whatever the field says.
    #[test]
    fn a_walk_ends_before_obstacles_and_at_the_edges() {
        let mut wall = OccupancyGrid::free();
        wall.occupy_row(20, u32::MAX); // X 6.22…6.70
        let end = walk_along_field(&wall, &context(), 2.3, 6.0, |_, _| Vec2::X);
        assert!((end.x - 6.0).abs() < 1e-3 && end.y == 0.0, "{end}");
        let sideways = walk_along_field(&OccupancyGrid::free(), &context(), 2.3, 20.0, |_, _| Vec2::Y);
        assert!((sideways.y - 6.0).abs() < 0.1 && sideways.x == context().bumper().x, "{sideways}");
        let back = walk_along_field(&OccupancyGrid::free(), &context(), 2.3, 6.0, |_, _| -Vec2::X);
        assert!(back.x >= 0.0 && back.x < 0.1 && back.y == 0.0, "not beyond the rear axle: {back}");
        let weak = walk_along_field(&OccupancyGrid::free(), &context(), 2.3, 1.0, |_, _| 0.04 * Vec2::Y);
        assert!((weak.x - context().bumper().x - 1.0).abs() < 1e-4 && weak.y == 0.0, "{weak}");
    }
}
