//! What every kind of map gives.

use sim::geometry::Vec2;
use sim::scenario::Obstacle;

/// Of each island, and of each obstacle, its number in the file, from 1.
pub(super) type Numbers = [Vec<usize>; 2];

/// Drivable ground without a route, in the lot's frame.
pub(super) struct Ground {
    /// Outline of the drivable ground, metres.
    pub(super) boundary: Vec<Vec2>,
    /// Whether what is not drivable stands along the outline; otherwise the map merely ends there.
    pub(super) is_walled: bool,
    /// Outlines of what is not drivable within, metres.
    pub(super) islands: Vec<Vec<Vec2>>,
    /// What has the shape of a car.
    pub(super) obstacles: Vec<Obstacle>,
    /// None of what was drawn with pixels.
    pub(super) numbers: Numbers,
}
