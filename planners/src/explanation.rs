//! What a planner weighed, for pictures: worked out again when asked for, so that it costs nothing otherwise.

use crate::context::PlannerContext;
use crate::nearest::{Nearest, nearest_occupied};
use sim::geometry::Vec2;
use sim::sensing::{GRID_CELLS, OccupancyGrid};

/// What a planner weighed. Points are in the ego frame, metres.
#[derive(Debug, Clone, PartialEq)]
pub enum Explanation {
    /// Candidate ways, of which one was chosen.
    Paths(Vec<CandidatePath>),
    /// A field that was followed.
    Field(Vec<FieldSample>),
}

/// A way that could have been chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct CandidatePath {
    /// Along the way, about a metre apart.
    pub points: Vec<Vec2>,
    /// Its cost: less is better.
    pub cost: f32,
    /// Whether it was chosen.
    pub is_chosen: bool,
}

/// A field at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldSample {
    /// Where.
    pub at: Vec2,
    /// Strength and direction, (ahead, left): of `apf` the metres of its attraction, of `vvf` a number.
    pub field: Vec2,
}

/// A field at every other free cell of the patch.
pub(crate) fn sample(
    grid: &OccupancyGrid,
    context: &PlannerContext,
    range_m: f32,
    field: impl Fn(Vec2, Option<Nearest>) -> Vec2,
) -> Vec<FieldSample> {
    let cells = (0..GRID_CELLS).step_by(2).flat_map(|row| (0..GRID_CELLS).step_by(2).map(move |col| (row, col)));
    let free = cells.filter(|&(row, col)| !grid.is_occupied(row, col));
    free.map(|(row, col)| {
        let at = context.geometry.cell_in_ego(row, col);
        FieldSample { at, field: field(at, nearest_occupied(grid, &context.geometry, at, range_m)) }
    })
    .collect()
}
