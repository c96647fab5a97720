//! What a planner weighed, for pictures: worked out again when asked for, so that it costs nothing otherwise.

use super::{Planner, PlannerContext, nearest_occupied};
use sim::geometry::Vec2;
use sim::sensing::{GRID_CELLS, Observation, OccupancyGrid};

/// What a planner weighed. Points are in the ego frame.
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
    /// Strength and direction.
    pub field: Vec2,
}

impl Planner {
    /// What was weighed in the last answer, which was to this observation; `None` for methods that do not say.
    pub fn explain(&self, observation: &Observation) -> Option<Explanation> {
        match self {
            Self::Tentacle(tentacles) => Some(Explanation::Paths(tentacles.weighed(&observation.grid))),
            Self::Vvf(field) => Some(Explanation::Field(field.sampled(&observation.grid))),
            Self::Apf(field) => Some(Explanation::Field(field.sampled(&observation.grid))),
            Self::Dwa(_) | Self::Cvm(_) | Self::Vff(_) => None,
        }
    }
}

/// A field at every other free cell of the patch.
pub(super) fn sample(
    grid: &OccupancyGrid,
    rig: &PlannerContext,
    range_m: f32,
    field: impl Fn(Vec2, Option<super::Nearest>) -> Vec2,
) -> Vec<FieldSample> {
    let cells = (0..GRID_CELLS).step_by(2).flat_map(|row| (0..GRID_CELLS).step_by(2).map(move |col| (row, col)));
    let free = cells.filter(|&(row, col)| !grid.is_occupied(row, col));
    free.map(|(row, col)| {
        let at = rig.geometry.cell_in_ego(row, col);
        FieldSample { at, field: field(at, nearest_occupied(grid, &rig.geometry, at, range_m)) }
    })
    .collect()
}
