//! The expert's rules on the noisy grid: what its algorithm comes to with the eyes of the network.
//!
//! Occupied cells are what is not drivable; ground outside the grid is unknown, and taken for free. There is no route, so that
//! nothing keeps it from turning back. The motion of the car is not measured either: it is taken to be what was commanded last.

use crate::context::Scene;
use crate::line_of_sight::LineOfSight;
use crate::{ExpertSettings, ScriptedExpert};
use sim::controller::{self, ControllerSettings};
use sim::distance_field::DistanceField;
use sim::driver::{Decision, Policy, Source};
use sim::episode::EpisodeSettings;
use sim::geometry::{Pose, Vec2};
use sim::seed::Rng;
use sim::sensing::{GRID_CELLS, Observation, OccupancyGrid};
use sim::vehicle::{VehicleCommand, VehicleState};

/// Obstacles are taken to be smaller than their cells on every side, metres (*chosen*: half of what a cell adds on average,
/// docs/methods.md 1.1).
const INSET_M: f32 = 0.12;

/// The expert's algorithm as a policy.
#[derive(Debug, Clone)]
pub struct GridExpert {
    expert: ScriptedExpert,
    controller: ControllerSettings,
    /// An empty grid: plans go on beyond it.
    open: DistanceField,
    /// The grid of this tick.
    field: DistanceField,
    /// What a grid can show, whatever is in it.
    sight: LineOfSight,
    /// The last command that was driven.
    last: VehicleCommand,
}

impl GridExpert {
    /// The expert for the vehicle, camera and controller of an episode. `hand` is the stream of its label jitter, as in
    /// [`ScriptedExpert::new`].
    pub fn new(settings: ExpertSettings, episode: &EpisodeSettings, hand: Rng) -> Self {
        let geometry = episode.sensing.geometry;
        let low = Vec2::new(geometry.near_edge_ahead_m, -0.5 * geometry.side_m);
        let open = DistanceField::of_open_ground(low, low + geometry.side_m);
        Self {
            expert: ScriptedExpert::new(settings, episode, hand),
            controller: episode.controller.clone(),
            field: open.clone(),
            open,
            sight: LineOfSight::of_patch(geometry),
            last: VehicleCommand::default(),
        }
    }

    fn look(&mut self, grid: &OccupancyGrid) {
        self.field.copy_from(&self.open);
        for Block { rows: [first_row, last_row], cols: [first_col, last_col] } in blocks(grid) {
            let geometry = self.expert.context.geometry();
            let reach = Vec2::splat(0.5 * geometry.cell_m() - INSET_M);
            // Row 0 is the farthest, column 0 the leftmost.
            let high = geometry.cell_in_ego(first_row, first_col) + reach;
            let low = geometry.cell_in_ego(last_row, last_col) - reach;
            self.field.carve_polygon(&[low, Vec2::new(high.x, low.y), high, Vec2::new(low.x, high.y)]);
        }
    }
}

impl Policy for GridExpert {
    fn act(&mut self, observation: &Observation) -> Decision {
        self.look(&observation.grid);
        let VehicleCommand { steering_rad, speed_mps } = self.last;
        // The patch lies where it lies in the ego frame.
        let vehicle = VehicleState { steering_rad, speed_mps, ..VehicleState::at_rest(Pose::default()) };
        let scene = Scene { field: &self.field, vehicle, route: None };
        let decision = self.expert.decide_in(&scene, &self.sight);
        let context = &self.expert.context;
        let command =
            |decision: &Decision| controller::pursue(&self.controller, &context.vehicle, context.geometry(), decision);
        // As fast as the expert, who is slow where its point is near.
        let speed_limit_mps = Some(command(&decision).speed_mps);
        let decision = Decision { source: Source::Planner, speed_limit_mps, ..decision };
        self.last = command(&decision);
        decision
    }

    fn reset(&mut self) {
        sim::driver::Driver::reset(&mut self.expert);
        self.last = VehicleCommand::default();
    }
}

/// A rectangle of occupied cells: first and last of each.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Block {
    rows: [usize; 2],
    cols: [usize; 2],
}

/// Rectangles that cover the occupied cells, each of them once: runs of a row, with the rows beneath that hold all of a run.
fn blocks(grid: &OccupancyGrid) -> impl Iterator<Item = Block> + '_ {
    let mut left: [u32; GRID_CELLS] = std::array::from_fn(|row| grid.row(row));
    let mut row = 0;
    std::iter::from_fn(move || {
        while row < GRID_CELLS && left[row] == 0 {
            row += 1;
        }
        let cells = *left.get(row)?;
        let first = cells.trailing_zeros();
        let len = (cells >> first).trailing_ones();
        let run = ((1_u32 << len) - 1) << first;
        let last_row = (row..GRID_CELLS).take_while(|&row| left[row] & run == run).last()?;
        left[row..=last_row].iter_mut().for_each(|cells| *cells &= !run);
        Some(Block { rows: [row, last_row], cols: [first as usize, (first + len - 1) as usize] })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use sim::sensing::GridGeometry;

    fn expert() -> GridExpert {
        use sim::seed::{RootSeed, Stream};
        GridExpert::new(ExpertSettings::half_points(), &EpisodeSettings::paper(), RootSeed(1).rng(Stream::Expert, 0))
    }

    proptest! {
        #[test]
        fn blocks_cover_the_occupied_cells_and_each_of_them_once(rows in prop::array::uniform25(0_u32..1 << GRID_CELLS)) {
            let mut grid = OccupancyGrid::free();
            rows.iter().enumerate().for_each(|(row, &mask)| grid.occupy_row(row, mask & rows[(row + 1) % GRID_CELLS]));
            let mut covered = OccupancyGrid::free();
            for Block { rows: [first_row, last_row], cols: [first_col, last_col] } in blocks(&grid) {
                for (row, col) in (first_row..=last_row).flat_map(|row| (first_col..=last_col).map(move |col| (row, col))) {
                    prop_assert!(!covered.is_occupied(row, col), "twice: {row}, {col}");
                    covered.set_occupied(row, col);
                }
            }
            prop_assert_eq!(covered, grid);
        }
    }

    #[test]
    fn cells_are_where_the_sensor_sees_them() {
        let mut grid = OccupancyGrid::free();
        grid.set_occupied(20, 3);
        let mut expert = expert();
        expert.look(&grid);
        let centre = GridGeometry::paper().cell_in_ego(20, 3);
        let inside_m = 0.5 * GridGeometry::paper().cell_m() - INSET_M;
        assert!((expert.field.at(centre) + inside_m).abs() < 0.08, "{}", expert.field.at(centre));
        for (ahead_m, left_m) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
            let beside = expert.field.at(centre + Vec2::new(ahead_m, left_m));
            assert!((beside - (1.0 - inside_m)).abs() < 0.08, "{ahead_m}, {left_m}: {beside}");
        }
        expert.look(&OccupancyGrid::free());
        assert!(expert.field.at(centre) > 2.9, "the grid before is forgotten");
    }

    /// Fourteen metres beside the car it ended, and plans with it.
    #[test]
    fn ground_beyond_the_grid_is_free_however_far_plans_reach() {
        let mut expert = expert();
        expert.look(&OccupancyGrid::occupied());
        for (ahead_m, left_m) in [(0.0, 14.0), (0.0, -30.0), (-9.0, 0.0), (-90.0, 90.0), (40.0, 0.0)] {
            assert_eq!(expert.field.at(Vec2::new(ahead_m, left_m)), sim::distance_field::CAP_M, "{ahead_m}, {left_m}");
        }
    }

    /// It took the speed of the expert's law for what is driven by the planners', and forecast another ramp.
    #[test]
    fn the_command_remembered_is_the_one_that_is_driven() {
        use sim::controller::SpeedLaw;
        let controller = ControllerSettings { planner_speed_law: SpeedLaw::Halved, ..ControllerSettings::paper() };
        let mut expert = GridExpert { controller: controller.clone(), ..expert() };
        let decision = expert.act(&Observation { grid: OccupancyGrid::free() });
        let context = &expert.expert.context;
        assert_eq!(expert.last, controller::pursue(&controller, &context.vehicle, context.geometry(), &decision));
    }

    /// Before a corner: straight on lies a pocket of ten metres, to the left a way that leaves the grid after six.
    #[test]
    fn a_way_that_leaves_the_grid_is_taken_rather_than_one_that_ends() {
        let cols = |cols: std::ops::Range<u32>| cols.map(|col| 1 << col).sum::<u32>();
        let mut grid = OccupancyGrid::free();
        for row in 0..GRID_CELLS {
            let free = match row {
                0..3 => 0,
                3..14 => cols(7..17),
                _ => cols(0..17),
            };
            grid.occupy_row(row, !free);
        }
        let curvature_per_m = |grid: &OccupancyGrid| {
            let mut expert = expert();
            (0..40).map(|_| expert.act(&Observation { grid: *grid }).look_ahead.curvature_per_m()).last().unwrap()
        };
        assert!(curvature_per_m(&grid) > 0.05, "left, not straight on: {}", curvature_per_m(&grid));
        assert!(curvature_per_m(&grid.mirrored()) < -0.05, "right: {}", curvature_per_m(&grid.mirrored()));
    }
}
