//! What the tests of several planners drive in.

use crate::context::PlannerContext;
use sim::episode::EpisodeSettings;
use sim::sensing::OccupancyGrid;

/// The paper's car.
pub(crate) fn context() -> PlannerContext {
    PlannerContext::of(&EpisodeSettings::paper())
}

/// A grid with these cells (row, column) occupied.
pub(crate) fn grid_with(cells: &[(usize, usize)]) -> OccupancyGrid {
    let mut grid = OccupancyGrid::free();
    for &(row, col) in cells {
        grid.set_occupied(row, col);
    }
    grid
}
