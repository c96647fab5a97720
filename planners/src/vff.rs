//! Virtual force field (paper, introduction; docs/methods.md 7.1; Borenstein and Koren): every occupied cell within an active
//! window pushes the car off, a target point draws it on, and the car steers along the sum. The paper did not run it.
//!
//! A cell at distance d from the front bumper pushes with F_cr·C/dⁿ (certainty C = 1: the grid is binary; the factor of
//! the original that makes up for the width of its robot is part of F_cr). The target draws with F_ct = 1 whatever its
//! distance. The steering is smoothed from tick to tick, as the original does against oscillation.

use crate::context::{PlannerContext, head_for};
use crate::goal::{Goal, LinesOfSight};
use crate::method::{Method, within};
use crate::search::{Dimension, Span};
use serde::{Deserialize, Serialize};
use sim::driver::{Decision, Policy};
use sim::geometry::Vec2;
use sim::maths;
use sim::sensing::{GRID_CELLS, Observation};
use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

/// Parameters of the virtual force field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Where the goal lies. Default straight ahead (*chosen*, as the paper did for the VVF).
    pub goal: Goal,
    /// Half the side of the active window around the front bumper, metres: 3.0 (*chosen*; the original's 33×33 cells of
    /// 0.1 m, *recalled*, scaled up from its 0.8 m robot to a car would be 3.8).
    pub window_m: f32,
    /// F_cr in m^n, F_ct being 1: 0.1 (*chosen*: a row of cells at 1 m then takes 0.4 of the target).
    pub repulsion_gain: f32,
    /// n: 2 (*recalled*).
    pub distance_power: f32,
    /// Share of the last bearing in the new one, 0…1: 0.5 (*chosen*; the original filters, its constant is unknown).
    pub smoothing: f32,
    /// The look-ahead point lies this far from the front bumper along the force, metres: 4.0 (*chosen*).
    pub look_ahead_m: f32,
}

impl Method for Params {
    const NAME: &'static str = "vff";
    const ABOUT: &'static str = "virtual force field: all near cells push, a target ahead draws; literature parameters";
    const SEARCH: &'static [Dimension<Self>] = &[
        Dimension {
            name: "window_m",
            span: Span::Linear(1.5, 8.0),
            get: |p| p.window_m,
            set: |p, value| p.window_m = value,
        },
        Dimension {
            name: "repulsion_gain",
            span: Span::Log(0.003, 3.0),
            get: |p| p.repulsion_gain,
            set: |p, value| p.repulsion_gain = value,
        },
        Dimension {
            name: "distance_power",
            span: Span::Linear(1.0, 3.0),
            get: |p| p.distance_power,
            set: |p, value| p.distance_power = value,
        },
        Dimension {
            name: "smoothing",
            span: Span::Linear(0.0, 0.9),
            get: |p| p.smoothing,
            set: |p, value| p.smoothing = value,
        },
        Dimension {
            name: "look_ahead_m",
            span: Span::Linear(1.0, 10.0),
            get: |p| p.look_ahead_m,
            set: |p, value| p.look_ahead_m = value,
        },
        Dimension {
            name: "goal",
            span: Span::Choice(2),
            get: |p| f32::from(u8::from(p.goal == Goal::FarthestVisible)),
            set: |p, index| p.goal = Goal::from_index(index),
        },
    ];
    type Planner = VirtualForceField;

    fn paper() -> Self {
        Self {
            goal: Goal::Ahead,
            window_m: 3.0,
            repulsion_gain: 0.1,
            distance_power: 2.0,
            smoothing: 0.5,
            look_ahead_m: 4.0,
        }
    }

    fn check(&self) -> Result<(), String> {
        within("window_m", self.window_m, 0.5, 20.0)?;
        within("repulsion_gain", self.repulsion_gain, 0.0, 1e4)?;
        within("distance_power", self.distance_power, 0.0, 6.0)?;
        within("smoothing", self.smoothing, 0.0, 0.99)?;
        within("look_ahead_m", self.look_ahead_m, 0.5, 20.0)
    }

    fn planner(&self, context: &PlannerContext) -> VirtualForceField {
        let bumper = context.bumper();
        let push = |index: usize| {
            let offset = bumper - context.geometry.cell_in_ego(index / GRID_CELLS, index % GRID_CELLS);
            let is_active = offset.abs().max_element() <= self.window_m;
            let strength =
                self.repulsion_gain / maths::pow(offset.length().max(context.geometry.cell_m()), self.distance_power);
            if is_active { strength * offset.normalize_or_zero() } else { Vec2::ZERO }
        };
        let pushes: Vec<Vec2> = (0..GRID_CELLS * GRID_CELLS).map(push).collect();
        let active_rows = (0..GRID_CELLS)
            .map(|row| {
                let cols = (0..GRID_CELLS).filter(|col| pushes[row * GRID_CELLS + col] != Vec2::ZERO);
                cols.fold(0, |mask, col| mask | 1 << col)
            })
            .collect();
        VirtualForceField {
            params: self.clone(),
            bumper,
            pushes: Arc::new(pushes),
            active_rows: Arc::new(active_rows),
            sight: Arc::new(LinesOfSight::new(context)),
            bearing_rad: 0.0,
        }
    }
}

/// The virtual force field at the wheel.
#[derive(Debug, Clone)]
pub struct VirtualForceField {
    params: Params,
    bumper: Vec2,
    /// What each cell pushes with when occupied, row-major.
    pushes: Arc<Vec<Vec2>>,
    /// Cells within the window; bit = column.
    active_rows: Arc<Vec<u32>>,
    sight: Arc<LinesOfSight>,
    /// The bearing of the last answer.
    bearing_rad: f32,
}

impl VirtualForceField {
    /// The sum of all forces.
    fn force(&self, observation: &Observation) -> Vec2 {
        let grid = &observation.grid;
        let mut force = (self.sight.goal(self.params.goal, grid) - self.bumper).normalize_or(Vec2::X);
        for (row, active) in self.active_rows.iter().enumerate() {
            let mut cells = grid.row(row) & active;
            // From both ends, so that the sum of a mirrored grid is the mirrored sum, to the bit.
            while cells != 0 {
                let (left, right) = (cells.ilog2(), cells.trailing_zeros());
                let push = |col: u32| self.pushes[row * GRID_CELLS + col as usize];
                force += if left == right { push(left) } else { push(left) + push(right) };
                cells &= !(1 << left | 1 << right);
            }
        }
        force
    }
}

impl Policy for VirtualForceField {
    fn act(&mut self, observation: &Observation) -> Decision {
        let force = self.force(observation);
        // A car cannot turn on the spot: backward forces steer as far as sideward ones.
        let wanted_rad = maths::angle_rad(force).clamp(-FRAC_PI_2, FRAC_PI_2);
        self.bearing_rad = wanted_rad + self.params.smoothing * (self.bearing_rad - wanted_rad);
        head_for(self.bumper + self.params.look_ahead_m * maths::unit(self.bearing_rad))
    }

    fn reset(&mut self) {
        self.bearing_rad = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{context, grid_with};
    use sim::sensing::OccupancyGrid;

    fn force(cells: &[(usize, usize)]) -> Vec2 {
        Params::paper().planner(&context()).force(&Observation { grid: grid_with(cells) })
    }

    /// Cell (22, 10) lies at X 5.50, Y 0.96: 1.70 m ahead of the bumper, 0.96 m left of it, d² = 3.8116. It pushes with
    /// 0.1/3.8116 along (−.8708, −.4917).
    #[test]
    fn forces_add_up() {
        let one = force(&[(22, 10)]);
        assert!(one.distance(Vec2::new(1.0 - 0.022_85, -0.012_90)) < 1e-4, "{one}");
        let two = force(&[(22, 10), (22, 14)]);
        assert!(two.distance(Vec2::new(1.0 - 0.045_69, 0.0)) < 1e-4, "{two}");
        assert_eq!(force(&[(10, 12)]), Vec2::X, "outside the window nothing pushes");
    }

    #[test]
    fn the_bearing_approaches_the_force_and_is_forgotten_on_reset() {
        let mut planner = Params { repulsion_gain: 50.0, ..Params::paper() }.planner(&context());
        let observation = Observation { grid: grid_with(&[(22, 9), (23, 9), (24, 9)]) };
        let first = planner.act(&observation).look_ahead;
        let second = planner.act(&observation).look_ahead;
        assert!(second.left_m < first.left_m && first.left_m < 0.0);
        planner.reset();
        assert_eq!(planner.act(&observation).look_ahead, first);
        let mut free = Params::paper().planner(&context());
        let straight = free.act(&Observation { grid: OccupancyGrid::free() }).look_ahead;
        assert!((straight.ahead_m - 7.8).abs() < 1e-5 && straight.left_m == 0.0);
    }
}
