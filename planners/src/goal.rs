//! The local goal of methods that need one.

use crate::context::PlannerContext;
use serde::{Deserialize, Serialize};
use sim::geometry::Vec2;
use sim::maths;
use sim::sensing::{GRID_CELLS, GridGeometry, OccupancyGrid};

/// Where a method that wants a goal is told to go. There is no global path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Goal {
    /// The middle of the far edge of the patch: "so that the vehicle could drive forward" (paper, of the velocity field).
    #[default]
    Ahead,
    /// The end of the longest free line of sight from the front bumper.
    FarthestVisible,
}

impl Goal {
    const OPTIONS: [Self; 2] = [Self::Ahead, Self::FarthestVisible];

    pub(crate) fn from_index(index: f32) -> Self {
        Self::OPTIONS[index as usize]
    }
}

/// Lines of sight from the front bumper, from 90° right to 90° left.
#[derive(Debug, Clone)]
pub(crate) struct LinesOfSight {
    /// Nearest to straight ahead first, so that the first of several equally long lines wins.
    rays: Vec<Ray>,
    ahead: Vec2,
}

#[derive(Debug, Clone)]
struct Ray {
    /// Steps of [`RAY_STEP_M`] from the bumper, the point there, and the row and column it lies in; what lies before the
    /// patch counts as free and is left out.
    points: Vec<(usize, Vec2, usize, usize)>,
}

/// Between two points of a line of sight, metres: half a cell.
const RAY_STEP_M: f32 = 0.24;
/// Lines of sight to each side: every 3°.
const RAYS_PER_SIDE: i32 = 30;

impl LinesOfSight {
    pub(crate) fn new(context: &PlannerContext) -> Self {
        let geometry = &context.geometry;
        let ray = |bearing_rad: f32| {
            let direction = maths::unit(bearing_rad);
            let points = (1..)
                .map(|step| (step, context.bumper() + step as f32 * RAY_STEP_M * direction))
                .skip_while(|(_, point)| point.x < geometry.near_edge_ahead_m && point.y.abs() <= 0.5 * geometry.side_m)
                .map_while(|(step, point)| cell_of(geometry, point).map(|(row, col)| (step, point, row, col)))
                .collect();
            Ray { points }
        };
        let bearings = (0..=RAYS_PER_SIDE).flat_map(|step| if step == 0 { vec![0] } else { vec![step, -step] });
        let per_step = std::f32::consts::FRAC_PI_2 / RAYS_PER_SIDE as f32;
        let rays = bearings.map(|step| ray(step as f32 * per_step)).collect();
        Self { rays, ahead: Vec2::new(geometry.far_edge_ahead_m(), 0.0) }
    }

    /// The goal in the ego frame.
    pub(crate) fn goal(&self, goal: Goal, grid: &OccupancyGrid) -> Vec2 {
        match goal {
            Goal::Ahead => self.ahead,
            Goal::FarthestVisible => {
                let (mut longest, mut end) = (0, self.ahead);
                for ray in &self.rays {
                    let free = ray.points.iter().take_while(|&&(.., row, col)| !grid.is_occupied(row, col));
                    if let Some(&(steps, point, ..)) = free.last()
                        && steps > longest
                    {
                        (longest, end) = (steps, point);
                    }
                }
                end
            }
        }
    }
}

/// Row and column of an ego point; `None` outside the patch.
fn cell_of(geometry: &GridGeometry, point: Vec2) -> Option<(usize, usize)> {
    geometry.contains(point).then(|| {
        let cell = |metres: f32| ((metres / geometry.cell_m()) as usize).min(GRID_CELLS - 1);
        (cell(geometry.far_edge_ahead_m() - point.x), cell(0.5 * geometry.side_m - point.y))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::context;

    /// The longest line was the one with most points in the patch, so that lines aside seemed up to 4 m shorter.
    #[test]
    fn lines_of_sight_are_as_long_as_they_are_from_the_bumper() {
        let sight = LinesOfSight::new(&context());
        let mut junction = OccupancyGrid::free();
        (0..16).for_each(|row| junction.occupy_row(row, u32::MAX));
        (16..22).for_each(|row| junction.occupy_row(row, !(0b11111 << 10)));
        // Straight ahead 4.8 m are free, to X 8.62; between the bumper and X 5.74 the left edge of the patch is 6.2 m away.
        let goal = sight.goal(Goal::FarthestVisible, &junction);
        assert!(goal.y > 5.5 && goal.x < 5.74, "{goal}");
    }

    #[test]
    fn the_farthest_visible_point_is_the_end_of_the_longest_free_line() {
        let sight = LinesOfSight::new(&context());
        let mut wall = OccupancyGrid::free();
        wall.occupy_row(10, u32::MAX);
        // Row 10 spans X 11.02…11.50. Straight ahead 7.2 m are free, at 45° the line leaves the patch after 8.5 m.
        let goal = sight.goal(Goal::FarthestVisible, &wall);
        assert!(goal.distance(context().bumper()) > 8.0 && goal.x < 11.1 && goal.y > 0.0, "{goal}");
        assert_eq!(sight.goal(Goal::Ahead, &wall), Vec2::new(16.3, 0.0));
        // Nothing is visible.
        assert_eq!(sight.goal(Goal::FarthestVisible, &OccupancyGrid::occupied()), Vec2::new(16.3, 0.0));
    }
}
