//! Curvature velocity method (paper, introduction; docs/methods.md 7.3; Simmons 1996). The paper did not run it.
//!
//! Obstacles are discs around occupied cells, grown by half the body width. Each disc blocks one interval of curvatures,
//! κ = 2(y ± r)/(x² + y² − r²), and over the whole interval the distance to it counts as constant: its chord less the
//! radius and the nose of the car. It maximises 0.1·v/v_max + 0.7·d/d_max + 0.2·(1 − |θ|/π) (weights *recalled*) over
//! the curvatures that the wheels can reach.
//!
//! Two readings ([`Speeds`]): the controller slows down with steering (paper), so that a curvature fixes its speed; or speeds
//! are searched together with the curvatures, as in 1996, none faster than d/T_impact while there is another.

use crate::context::{PlannerContext, WheelEstimate};
use crate::method::{Method, Reading, within};
use crate::search::{Dimension, Span};
use crate::speeds;
use serde::{Deserialize, Serialize};
use sim::driver::{Decision, Policy};
use sim::geometry::Vec2;
use sim::sensing::{GRID_CELLS, Observation, OccupancyGrid};
use std::sync::Arc;

/// Curvatures on each side of straight, evenly spaced: 161 in all.
const SIDE: usize = 80;
const CURVATURES: usize = 2 * SIDE + 1;

/// Parameters of the curvature velocity method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Weight of v/v_max: 0.1 (*recalled*).
    pub velocity_weight: f32,
    /// Weight of d/d_max: 0.7 (*recalled*).
    pub distance_weight: f32,
    /// Weight of the heading 1 − |θ|/π, θ = κ·v·T being the turn from straight ahead: 0.2 (*recalled*).
    pub heading_weight: f32,
    /// Distances beyond this count as this, metres: 3.0 (*recalled*).
    pub distance_max_m: f32,
    /// T, travel time at whose end the heading is compared, seconds: 1.0 (*chosen*).
    pub heading_after_s: f32,
    /// How long the wheels may turn to get to a curvature, seconds: 1.0 (*chosen*, as for the dynamic window).
    pub window_s: f32,
    /// Added to half the body width, metres: 0.15, the paper's safety distance (*chosen*).
    pub margin_m: f32,
    /// Which speeds an arc may be driven at: `by_law` (paper) or `{ searched = { impact_s = … } }` (1996).
    pub speeds: Speeds,
}

/// Which speeds an arc may be driven at.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Speeds {
    /// That of the controller's law for planners.
    ByLaw,
    /// Those up to it: a slower one where something would be met within `impact_s`, the slowest where it would be anyway.
    Searched {
        /// `T_impact`, shortest time to what is met, seconds: 2.0 (*chosen*, on a few validation lots; that there is such a
        /// bound is *recalled*).
        impact_s: f32,
    },
}

impl Params {
    /// The velocity search of 1996.
    fn simmons() -> Self {
        Self { speeds: Speeds::Searched { impact_s: 2.0 }, ..Self::paper() }
    }
}

impl Method for Params {
    const NAME: &'static str = "cvm";
    const ABOUT: &'static str = "curvature velocity method: discs block intervals of curvature; literature parameters";
    const SEARCH: &'static [Dimension<Self>] = &[
        Dimension {
            name: "velocity_weight",
            span: Span::Log(1e-3, 2.0),
            get: |p| p.velocity_weight,
            set: |p, value| p.velocity_weight = value,
        },
        Dimension {
            name: "heading_weight",
            span: Span::Log(0.01, 5.0),
            get: |p| p.heading_weight,
            set: |p, value| p.heading_weight = value,
        },
        Dimension {
            name: "distance_max_m",
            span: Span::Linear(1.0, 12.0),
            get: |p| p.distance_max_m,
            set: |p, value| p.distance_max_m = value,
        },
        Dimension {
            name: "heading_after_s",
            span: Span::Linear(0.5, 4.0),
            get: |p| p.heading_after_s,
            set: |p, value| p.heading_after_s = value,
        },
        Dimension {
            name: "window_s",
            span: Span::Linear(0.1, 2.0),
            get: |p| p.window_s,
            set: |p, value| p.window_s = value,
        },
        Dimension {
            name: "margin_m",
            span: Span::Linear(0.0, 0.8),
            get: |p| p.margin_m,
            set: |p, value| p.margin_m = value,
        },
    ];
    const READINGS: &'static [Reading<Self>] =
        &[Reading { name: "simmons", about: "speeds are searched too, as in 1996", params: Params::simmons }];
    type Planner = CurvatureVelocity;

    fn paper() -> Self {
        Self {
            velocity_weight: 0.1,
            distance_weight: 0.7,
            heading_weight: 0.2,
            distance_max_m: 3.0,
            heading_after_s: 1.0,
            window_s: 1.0,
            margin_m: 0.15,
            speeds: Speeds::ByLaw,
        }
    }

    fn check(&self) -> Result<(), String> {
        within("velocity_weight", self.velocity_weight, 0.0, 1e3)?;
        within("distance_weight", self.distance_weight, 0.0, 1e3)?;
        within("heading_weight", self.heading_weight, 0.0, 1e3)?;
        within("distance_max_m", self.distance_max_m, 0.5, 20.0)?;
        within("heading_after_s", self.heading_after_s, 0.1, 10.0)?;
        within("window_s", self.window_s, 0.05, 10.0)?;
        within("margin_m", self.margin_m, 0.0, 2.0)?;
        match self.speeds {
            Speeds::ByLaw => Ok(()),
            Speeds::Searched { impact_s } => within("speeds.searched.impact_s", impact_s, 0.0, 10.0),
        }
    }

    fn planner(&self, context: &PlannerContext) -> CurvatureVelocity {
        let curvature_max = context.vehicle.curvature_max_per_m();
        let rated = |curvature_per_m: f32, speed_mps: f32| {
            let turn_rad = (curvature_per_m * speed_mps * self.heading_after_s).abs();
            let heading = 1.0 - (turn_rad / std::f32::consts::PI).min(1.0);
            let worth =
                self.velocity_weight * speed_mps / context.controller.speed_max_mps + self.heading_weight * heading;
            Rated { speed_mps, worth }
        };
        let candidates = (-(SIDE as i32)..=SIDE as i32).map(|k| {
            let curvature_per_m = curvature_max * k as f32 / SIDE as f32;
            let speeds = match self.speeds {
                Speeds::ByLaw => vec![rated(curvature_per_m, context.speed_mps(curvature_per_m))],
                Speeds::Searched { .. } => speeds::up_to_law_mps(context, curvature_per_m)
                    .map(|speed_mps| rated(curvature_per_m, speed_mps))
                    .collect(),
            };
            Candidate { curvature_per_m, speeds }
        });
        let radius_m = 0.5 * context.vehicle.width_m + self.margin_m;
        let disc = |cell: usize| {
            let centre = context.geometry.cell_in_ego(cell / GRID_CELLS, cell % GRID_CELLS);
            Disc::new(centre, radius_m, context.vehicle.front_m(), curvature_max / SIDE as f32)
        };
        CurvatureVelocity {
            params: self.clone(),
            context: Arc::new(context.clone()),
            candidates: Arc::new(candidates.collect()),
            discs: Arc::new((0..GRID_CELLS * GRID_CELLS).map(disc).collect()),
            wheel: WheelEstimate::new(context),
        }
    }
}

/// A curvature, and the speeds it may be driven at, ascending.
#[derive(Debug, Clone)]
struct Candidate {
    curvature_per_m: f32,
    speeds: Vec<Rated>,
}

/// What a speed at a curvature is worth whatever the grid.
#[derive(Debug, Clone, Copy)]
struct Rated {
    speed_mps: f32,
    /// Velocity and heading, weighted.
    worth: f32,
}

/// What an occupied cell does to the curvatures.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Disc {
    /// First and last candidate it blocks; none if the first is larger.
    blocks: (usize, usize),
    /// Free travel before it, metres, at least 0.
    distance_m: f32,
}

impl Disc {
    fn new(centre: Vec2, radius_m: f32, front_m: f32, spacing_per_m: f32) -> Self {
        // The patch begins ahead of the bumper, so no disc of a sensible radius holds the axle.
        let power = (centre.length_squared() - radius_m * radius_m).max(f32::MIN_POSITIVE);
        let candidate = |left_m: f32| (2.0 * left_m / power / spacing_per_m).clamp(-1e6, 1e6);
        let (first, last) = (candidate(centre.y - radius_m).ceil(), candidate(centre.y + radius_m).floor());
        let (low, high) = (first.max(-(SIDE as f32)), last.min(SIDE as f32));
        let blocks = if low > high { (1, 0) } else { ((low + SIDE as f32) as usize, (high + SIDE as f32) as usize) };
        Self { blocks, distance_m: (centre.length() - radius_m - front_m).max(0.0) }
    }
}

/// The curvature velocity method at the wheel.
#[derive(Debug, Clone)]
pub struct CurvatureVelocity {
    params: Params,
    context: Arc<PlannerContext>,
    candidates: Arc<Vec<Candidate>>,
    /// The disc of every cell, row-major.
    discs: Arc<Vec<Disc>>,
    wheel: WheelEstimate,
}

impl CurvatureVelocity {
    /// Free travel along every candidate, metres; infinite where nothing is met.
    fn distances_m(&self, grid: &OccupancyGrid) -> [f32; CURVATURES] {
        let mut distances_m = [f32::INFINITY; CURVATURES];
        for row in 0..GRID_CELLS {
            let mut cells = grid.row(row);
            while cells != 0 {
                let Disc { blocks: (first, last), distance_m } =
                    self.discs[row * GRID_CELLS + cells.trailing_zeros() as usize];
                if first <= last {
                    for distance in &mut distances_m[first..=last] {
                        *distance = distance.min(distance_m);
                    }
                }
                cells &= cells - 1;
            }
        }
        distances_m
    }

    /// The best speed of a candidate, m/s, and what it is worth; speeds that would meet something too soon come last, by
    /// distance.
    fn best_speed(&self, candidate: usize, distance_m: f32) -> (f32, f32) {
        let far = self.params.distance_weight * (distance_m / self.params.distance_max_m).min(1.0);
        let objective = |rated: &Rated| match self.params.speeds {
            Speeds::Searched { impact_s } if rated.speed_mps * impact_s > distance_m => distance_m - 1e3,
            _ => rated.worth + far,
        };
        speeds::best_of(self.candidates[candidate].speeds.iter().map(|rated| (rated.speed_mps, objective(rated))))
    }
}

impl Policy for CurvatureVelocity {
    fn act(&mut self, observation: &Observation) -> Decision {
        let distances_m = self.distances_m(&observation.grid);
        let steering_rad = self.wheel.advance();
        let reach_rad = self.context.vehicle.steering_rate_max_radps * self.params.window_s;
        let limit_rad = self.context.vehicle.steering_max_rad;
        let index = |angle_rad: f32| {
            let curvature_per_m = self.context.curvature_per_m(angle_rad.clamp(-limit_rad, limit_rad));
            let share = (curvature_per_m / self.context.vehicle.curvature_max_per_m()).clamp(-1.0, 1.0);
            (SIDE as f32 * (1.0 + share)).round() as usize
        };
        let window = index(steering_rad - reach_rad)..=index(steering_rad + reach_rad);
        let (best, speed_mps) = speeds::best_arc(window, SIDE, |k| self.best_speed(k, distances_m[k]));
        let curvature_per_m = self.candidates[best].curvature_per_m;
        self.wheel.command_rad = self.context.steering_rad(curvature_per_m);
        match self.params.speeds {
            Speeds::ByLaw => self.context.steer_along(curvature_per_m),
            Speeds::Searched { .. } => self.context.steer_along_at(curvature_per_m, speed_mps),
        }
    }

    fn reset(&mut self) {
        self.wheel.reset();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{context, grid_with};

    /// A disc blocks exactly the arcs that come within its radius of its centre.
    #[test]
    fn a_disc_blocks_the_arcs_that_meet_it() {
        let (centre, radius_m, spacing) = (Vec2::new(7.0, 1.5), 1.08, 0.25 / SIDE as f32);
        let disc = Disc::new(centre, radius_m, 3.8, spacing);
        assert!((disc.distance_m - (7.158_91 - 1.08 - 3.8)).abs() < 1e-4);
        for k in 1..=SIDE {
            let turning_m = 1.0 / (k as f32 * spacing);
            let miss_m = (centre.distance(Vec2::new(0.0, turning_m)) - turning_m).abs();
            let blocks = (disc.blocks.0..=disc.blocks.1).contains(&(SIDE + k));
            assert_eq!(blocks, miss_m <= radius_m, "arc {k} passes at {miss_m} m");
        }
    }

    /// Cell (20, 12) lies 6.46 m ahead: d = 6.46 − 1.08 − 3.80 = 1.58. Straight on G = .1 + .7·1.58/3 + .2.
    #[test]
    fn the_objective_is_the_weighted_sum() {
        let planner = Params::paper().planner(&context());
        let distances_m = planner.distances_m(&grid_with(&[(20, 12)]));
        assert!((distances_m[SIDE] - 1.58).abs() < 1e-4);
        assert!((planner.best_speed(SIDE, distances_m[SIDE]).1 - (0.3 + 0.7 * 1.58 / 3.0)).abs() < 1e-5);
        assert_eq!(distances_m[2 * SIDE], f32::INFINITY, "full lock passes it");
        // Full lock: .5 m/s, turn .2507·.5 = .1254 rad.
        let full_lock = 0.1 * 0.5 / 2.2 + 0.2 * (1.0 - 0.125_36 / std::f32::consts::PI) + 0.7;
        assert!((planner.best_speed(2 * SIDE, f32::INFINITY).1 - full_lock).abs() < 1e-4);
    }

    /// It took the end of what it rates, 3 m, for an obstacle, and drove no faster than 1.5 m/s anywhere.
    #[test]
    fn where_nothing_is_met_the_speed_is_that_of_the_law() {
        let mut planner = Params::simmons().planner(&context());
        let decision = planner.act(&Observation { grid: OccupancyGrid::free() });
        assert_eq!(decision.speed_limit_mps, Some(context().speed_mps(0.0)));
    }

    /// A wall from X = 6.22 m on, across the patch: d = 6.46 − 1.08 − 3.80 = 1.58 m straight ahead, so 0.79 m/s at most for
    /// an impact no sooner than in two seconds, and little more on the arcs that meet it farther away.
    #[test]
    fn a_searched_speed_meets_nothing_too_soon() {
        let mut wall = OccupancyGrid::free();
        (0..=20).for_each(|row| wall.occupy_row(row, u32::MAX));
        let limit = |params: Params| params.planner(&context()).act(&Observation { grid: wall }).speed_limit_mps;
        assert_eq!(limit(Params::paper()), None);
        let searched = limit(Params::simmons()).unwrap();
        assert!((0.5..1.0).contains(&searched), "{searched} m/s");
        let late = Params { speeds: Speeds::Searched { impact_s: 10.0 }, ..Params::paper() };
        assert_eq!(limit(late), Some(0.5), "everything is met too soon");
    }

    #[test]
    fn a_free_lane_is_driven_straight_and_a_block_is_passed() {
        let mut planner = Params::paper().planner(&context());
        assert_eq!(planner.act(&Observation { grid: OccupancyGrid::free() }).look_ahead.left_m, 0.0);
        let mut grid = OccupancyGrid::free();
        for row in 18..22 {
            grid.occupy_row(row, !0 << 11);
        }
        assert!(planner.act(&Observation { grid }).look_ahead.curvature_per_m() > 0.01);
    }
}
