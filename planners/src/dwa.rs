//! Dynamic window approach (paper, introduction; docs/methods.md 7.2; Fox, Burgard, Thrun 1997) for a car. The paper did not
//! run it.
//!
//! G = α·heading + β·dist + γ·velocity is maximised over the steering angles that can be reached within the window, each
//! term in 0…1. A speed is admissible on an arc if it can be braked away before what the body would meet on it:
//! v < √(2·dist·v̇_b) (≤ in 1997).
//!
//! Two readings ([`Speeds`]): the controller slows down with steering (paper), so that an angle fixes its speed and the
//! window has one dimension; or speeds are searched together with the angles, as in 1997.

use crate::context::{PlannerContext, WheelEstimate};
use crate::method::{Method, Reading, within};
use crate::search::{Dimension, Span};
use crate::speeds;
use serde::{Deserialize, Serialize};
use sim::driver::{Decision, Policy};
use sim::geometry::{Pose, Vec2};
use sim::sensing::{GRID_CELLS, Observation, OccupancyGrid};
use std::sync::Arc;

/// Steering angles on each side of straight, evenly spaced: 81 in all.
const SIDE: usize = 40;
/// Between two poses of the body along an arc, metres.
const STEP_M: f32 = 0.1;

/// Parameters of the dynamic window approach.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// α, weight of heading: 0.33, from clearance 100 : heading 50 : speed 0.01 (*cited*: authors' helper; Fox: 0.8,
    /// *recalled*, which presumes a goal to head for).
    pub heading_weight: f32,
    /// β, weight of dist: 0.67 (*cited*, as above; Fox: 0.1).
    pub distance_weight: f32,
    /// γ, weight of velocity: 0.0001 (*cited*, as above; Fox: 0.1).
    pub velocity_weight: f32,
    /// How long the wheels may turn to get to an angle of the window, seconds: 1.0 (*cited*: horizon of the authors'
    /// helper).
    pub window_s: f32,
    /// Travel time at whose end the heading is compared with straight ahead, seconds: 1.0 (*cited*, as above).
    pub heading_after_s: f32,
    /// Distances beyond this count as this, metres: 8.0 (*chosen*: two thirds of the patch).
    pub distance_max_m: f32,
    /// Widening of the body on all sides, metres: 0.15, the paper's safety distance (*chosen*; authors' helper: a band of
    /// ±1.0 m, which is 0.07).
    pub margin_m: f32,
    /// Braking v̇_b that makes a speed admissible, m/s²: 2.0, the service brake (*chosen*).
    pub brake_mps2: f32,
    /// Which speeds an arc may be driven at: `by_law` (paper) or `searched` (1997).
    pub speeds: Speeds,
}

/// Which speeds an arc may be driven at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Speeds {
    /// That of the controller's law for planners.
    ByLaw,
    /// Those up to it: a slower one where it is inadmissible, the slowest where all are.
    Searched,
}

impl Method for Params {
    const NAME: &'static str = "dwa";
    const ABOUT: &'static str =
        "dynamic window approach: heading, distance and speed over reachable arcs; literature parameters";
    const SEARCH: &'static [Dimension<Self>] = &[
        Dimension {
            name: "heading_weight",
            span: Span::Log(0.01, 3.0),
            get: |p| p.heading_weight,
            set: |p, value| p.heading_weight = value,
        },
        Dimension {
            name: "velocity_weight",
            span: Span::Log(1e-4, 1.0),
            get: |p| p.velocity_weight,
            set: |p, value| p.velocity_weight = value,
        },
        Dimension {
            name: "window_s",
            span: Span::Linear(0.1, 2.0),
            get: |p| p.window_s,
            set: |p, value| p.window_s = value,
        },
        Dimension {
            name: "heading_after_s",
            span: Span::Linear(0.5, 4.0),
            get: |p| p.heading_after_s,
            set: |p, value| p.heading_after_s = value,
        },
        Dimension {
            name: "distance_max_m",
            span: Span::Linear(2.0, 12.0),
            get: |p| p.distance_max_m,
            set: |p, value| p.distance_max_m = value,
        },
        Dimension {
            name: "margin_m",
            span: Span::Linear(0.0, 0.8),
            get: |p| p.margin_m,
            set: |p, value| p.margin_m = value,
        },
    ];
    const READINGS: &'static [Reading<Self>] =
        &[Reading { name: "fox", about: "speeds are searched too, as in 1997", params: Params::fox }];
    type Planner = DynamicWindow;

    fn paper() -> Self {
        Self {
            heading_weight: 0.33,
            distance_weight: 0.67,
            velocity_weight: 0.0001,
            window_s: 1.0,
            heading_after_s: 1.0,
            distance_max_m: 8.0,
            margin_m: 0.15,
            brake_mps2: 2.0,
            speeds: Speeds::ByLaw,
        }
    }

    fn check(&self) -> Result<(), String> {
        within("heading_weight", self.heading_weight, 0.0, 1e3)?;
        within("distance_weight", self.distance_weight, 0.0, 1e3)?;
        within("velocity_weight", self.velocity_weight, 0.0, 1e3)?;
        within("window_s", self.window_s, 0.05, 10.0)?;
        within("heading_after_s", self.heading_after_s, 0.1, 10.0)?;
        within("distance_max_m", self.distance_max_m, 0.5, 20.0)?;
        within("margin_m", self.margin_m, 0.0, 2.0)?;
        within("brake_mps2", self.brake_mps2, 0.1, 10.0)
    }

    fn planner(&self, context: &PlannerContext) -> DynamicWindow {
        let rated = |curvature_per_m: f32, speed_mps: f32| {
            let yaw_rad = (curvature_per_m * speed_mps * self.heading_after_s).abs();
            let heading = 1.0 - (yaw_rad / std::f32::consts::PI).min(1.0);
            let score =
                self.heading_weight * heading + self.velocity_weight * speed_mps / context.controller.speed_max_mps;
            Rated { speed_mps, score, stop_m: 0.5 * speed_mps * speed_mps / self.brake_mps2 }
        };
        let arcs: Vec<Candidate> = (-(SIDE as i32)..=SIDE as i32)
            .map(|k| {
                let steering_rad = context.vehicle.steering_max_rad * k as f32 / SIDE as f32;
                let curvature_per_m = context.curvature_per_m(steering_rad);
                let speeds = match self.speeds {
                    Speeds::ByLaw => vec![rated(curvature_per_m, context.speed_mps(curvature_per_m))],
                    Speeds::Searched => speeds::up_to_law_mps(context, curvature_per_m)
                        .map(|speed_mps| rated(curvature_per_m, speed_mps))
                        .collect(),
                };
                Candidate { curvature_per_m, speeds }
            })
            .collect();
        // As far as any speed can be braked away, too: what is met there makes it inadmissible.
        let reach_m = arcs
            .iter()
            .flat_map(|arc| &arc.speeds)
            .fold(self.distance_max_m, |reach_m, rated| reach_m.max(rated.stop_m));
        DynamicWindow {
            params: self.clone(),
            context: Arc::new(context.clone()),
            contact_m: Arc::new(contacts(context, &arcs, self.margin_m, reach_m)),
            arcs: Arc::new(arcs),
            wheel: WheelEstimate::new(context),
        }
    }
}

impl Params {
    /// The velocity search of 1997. Its weight of velocity is Fox's (*recalled*), for the authors' helper leaves speed all but
    /// without weight; the other two stay, for Fox's presume a goal to head for. Braking as gently as this (*chosen*, on a
    /// few validation lots) left 1 contact of 36, and as many near-collisions.
    fn fox() -> Self {
        Self { velocity_weight: 0.1, brake_mps2: 0.5, speeds: Speeds::Searched, ..Self::paper() }
    }
}

/// An arc, and the speeds it may be driven at, ascending.
#[derive(Debug, Clone)]
struct Candidate {
    curvature_per_m: f32,
    speeds: Vec<Rated>,
}

/// What a speed on an arc is worth whatever the grid.
#[derive(Debug, Clone, Copy)]
struct Rated {
    speed_mps: f32,
    /// Heading and velocity, weighted.
    score: f32,
    /// Way to brake from the speed, metres.
    stop_m: f32,
}

/// The dynamic window at the wheel.
#[derive(Debug, Clone)]
pub struct DynamicWindow {
    params: Params,
    context: Arc<PlannerContext>,
    arcs: Arc<Vec<Candidate>>,
    /// Travel until the body meets a cell (row-major), by arc, metres; infinite where that is farther than matters.
    contact_m: Arc<Vec<[f32; 2 * SIDE + 1]>>,
    wheel: WheelEstimate,
}

impl DynamicWindow {
    /// dist: free travel along each arc, metres; infinite where nothing is met.
    fn free_m(&self, grid: &OccupancyGrid) -> [f32; 2 * SIDE + 1] {
        let mut free_m = [f32::INFINITY; 2 * SIDE + 1];
        for row in 0..GRID_CELLS {
            let mut cells = grid.row(row);
            while cells != 0 {
                let contact_m = &self.contact_m[row * GRID_CELLS + cells.trailing_zeros() as usize];
                free_m.iter_mut().zip(contact_m).for_each(|(free_m, contact_m)| *free_m = free_m.min(*contact_m));
                cells &= cells - 1;
            }
        }
        free_m
    }

    /// G of a speed on an arc; inadmissible ones come after all admissible ones, by free travel.
    fn objective(&self, rated: &Rated, free_m: f32) -> f32 {
        if free_m <= rated.stop_m {
            return free_m - 1e3;
        }
        let distance_max_m = self.params.distance_max_m;
        rated.score + self.params.distance_weight * free_m.min(distance_max_m) / distance_max_m
    }

    /// The best speed of an arc, m/s, and its G.
    fn best_speed(&self, arc: usize, free_m: f32) -> (f32, f32) {
        let speeds = &self.arcs[arc].speeds;
        speeds::best_of(speeds.iter().map(|rated| (rated.speed_mps, self.objective(rated, free_m))))
    }
}

impl Policy for DynamicWindow {
    fn act(&mut self, observation: &Observation) -> Decision {
        let free_m = self.free_m(&observation.grid);
        let steering_rad = self.wheel.advance();
        let reach_rad = self.context.vehicle.steering_rate_max_radps * self.params.window_s;
        let index = |angle_rad: f32| {
            let share = (angle_rad / self.context.vehicle.steering_max_rad).clamp(-1.0, 1.0);
            (SIDE as f32 * (1.0 + share)).round() as usize
        };
        let window = index(steering_rad - reach_rad)..=index(steering_rad + reach_rad);
        let (best, speed_mps) = speeds::best_arc(window, SIDE, |k| self.best_speed(k, free_m[k]));
        let curvature_per_m = self.arcs[best].curvature_per_m;
        self.wheel.command_rad = self.context.steering_rad(curvature_per_m);
        match self.params.speeds {
            Speeds::ByLaw => self.context.steer_along(curvature_per_m),
            Speeds::Searched => self.context.steer_along_at(curvature_per_m, speed_mps),
        }
    }

    fn reset(&mut self) {
        self.wheel.reset();
    }
}

/// Travel until the body, widened by a margin, meets the centre of each cell, by arc; infinite beyond `reach_m`. The right
/// arcs are the mirror image of the left ones, to the bit.
fn contacts(context: &PlannerContext, arcs: &[Candidate], margin_m: f32, reach_m: f32) -> Vec<[f32; 2 * SIDE + 1]> {
    let (front_m, rear_m) = (context.vehicle.front_m() + margin_m, context.vehicle.rear_overhang_m + margin_m);
    let side_m = 0.5 * context.vehicle.width_m + margin_m;
    let mut contact_m = vec![[f32::INFINITY; 2 * SIDE + 1]; GRID_CELLS * GRID_CELLS];
    for k in SIDE..=2 * SIDE {
        // From far to near, so that the first contact is written last.
        for step in (0..=(reach_m / STEP_M) as u32).rev() {
            let travel_m = step as f32 * STEP_M;
            let world_from_body =
                Pose::default().advanced_along_arc(arcs[k].curvature_per_m, travel_m).world_from_ego();
            for (cell, of_cell) in contact_m.iter_mut().enumerate() {
                let centre = context.geometry.cell_in_ego(cell / GRID_CELLS, cell % GRID_CELLS);
                let Vec2 { x, y } = world_from_body.inverse_point(centre);
                if x <= front_m && x >= -rear_m && y.abs() <= side_m {
                    of_cell[k] = travel_m;
                }
            }
        }
    }
    for k in 0..SIDE {
        for cell in 0..contact_m.len() {
            let (row, col) = (cell / GRID_CELLS, cell % GRID_CELLS);
            contact_m[cell][k] = contact_m[row * GRID_CELLS + GRID_CELLS - 1 - col][2 * SIDE - k];
        }
    }
    contact_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{context, grid_with};
    use sim::maths;

    fn planner() -> DynamicWindow {
        Params::paper().planner(&context())
    }

    /// Cell (20, 12) lies at X 4.30 + 4.5·0.48 = 6.46 on the axis; the nose with margin starts at 3.95: 2.51 m of free
    /// travel, 2.6 on steps of 0.1. Cell (20, 10) at Y 0.96 is met too (half width 1.08), (20, 9) at Y 1.44 is not.
    #[test]
    fn distance_is_the_free_travel_of_the_body() {
        let planner = planner();
        let straight = |cells: &[(usize, usize)]| planner.free_m(&grid_with(cells))[SIDE];
        assert_eq!(straight(&[]), f32::INFINITY);
        assert!((straight(&[(20, 12)]) - 2.6).abs() < 1e-4);
        assert!((straight(&[(20, 10)]) - 2.6).abs() < 1e-4);
        assert_eq!(straight(&[(20, 9)]), f32::INFINITY);
        assert!((straight(&[(10, 12), (20, 12)]) - 2.6).abs() < 1e-4);
    }

    /// It took the end of what it rates for an obstacle: with 1 m, and 1.21 m to stop, no arc of an empty hall was admissible,
    /// and it drove at full lock, or as slowly as it can. What is met beyond that end still makes a speed inadmissible.
    #[test]
    fn where_nothing_is_met_it_drives_straight_and_fast_however_short_the_distances_that_count() {
        let free = Observation { grid: OccupancyGrid::free() };
        for params in [Params::paper(), Params::fox()] {
            let act = |distance_max_m: f32| {
                let mut planner = Params { distance_max_m, ..params.clone() }.planner(&context());
                // For longer than the wheels need to any angle.
                (0..60).map(|_| planner.act(&free)).last().unwrap()
            };
            assert_eq!(act(1.0).look_ahead.left_m, 0.0, "{:?}", params.speeds);
            assert_eq!(act(1.0), act(8.0), "{:?}", params.speeds);
        }
        let near_sighted = Params { distance_max_m: 0.5, ..Params::paper() }.planner(&context());
        let free_m = near_sighted.free_m(&grid_with(&[(23, 12)]))[SIDE];
        assert!((free_m - 1.1).abs() < 1e-4, "{free_m}");
        assert!(near_sighted.best_speed(SIDE, free_m).1 < -900.0, "it takes 1.21 m to stop");
    }

    /// At k = 0: 2.2 m/s, heading 1, so G = .33 + .67·dist/8 + .0001, and it takes 1.21 m to stop. At full lock: 0.5 m/s,
    /// .25 m⁻¹·.5 m = .1254 rad, heading 1 − .0399.
    #[test]
    fn the_objective_is_the_weighted_sum() {
        let planner = planner();
        let of = |k: usize, free_m| planner.best_speed(k, free_m).1;
        assert!((of(SIDE, 4.0) - (0.33 + 0.335 + 0.0001)).abs() < 1e-5);
        assert!((of(2 * SIDE, 8.0) - (0.33 * (1.0 - 0.0399) + 0.67 + 0.0001 * 0.5 / 2.2)).abs() < 1e-4);
        assert!((planner.arcs[SIDE].speeds[0].stop_m - 1.21).abs() < 1e-4);
        assert!(of(SIDE, 1.2) < -900.0 && of(SIDE, 1.2) > of(SIDE, 1.1), "inadmissible");
    }

    /// A wall across the patch from its lower edge on, and one two metres farther: 0.6 m and 2.6 m of free travel, so that
    /// at 0.5 m/s² 0.77 m/s can be braked away before the first, and 1.61 m/s before the second.
    #[test]
    fn a_searched_speed_can_be_braked_away_before_what_is_ahead() {
        let wall = |row: usize| {
            let mut grid = OccupancyGrid::free();
            (0..=row).for_each(|row| grid.occupy_row(row, u32::MAX));
            Observation { grid }
        };
        let speed_mps = |planner: &mut DynamicWindow, row| planner.act(&wall(row)).speed_limit_mps;
        let mut by_law = planner();
        assert_eq!(speed_mps(&mut by_law, 24), None);
        let mut searched = Params::fox().planner(&context());
        let [far, near] = [20, 24].map(|row| {
            searched.reset();
            speed_mps(&mut searched, row).unwrap()
        });
        assert!((1.3..1.62).contains(&far) && (0.5..0.78).contains(&near), "{far} and {near} m/s");
        let free_m = searched.free_m(&wall(24).grid)[SIDE];
        assert!(near * near / 2.0 / 0.5 < free_m, "{near} m/s in {free_m} m");
        // What nothing can be braked away from is met as slowly as the car drives.
        let blocked = Params { margin_m: 1.0, ..Params::fox() }.planner(&context()).act(&wall(24)).speed_limit_mps;
        assert_eq!(blocked, Some(0.5));
    }

    #[test]
    fn a_free_lane_is_driven_straight_and_the_window_limits_a_turn() {
        let mut planner = planner();
        let free = Observation { grid: OccupancyGrid::free() };
        assert_eq!(planner.act(&free).look_ahead.left_m, 0.0);
        let mut grid = OccupancyGrid::free();
        for row in 14..18 {
            grid.occupy_row(row, !0 << 13);
        }
        let curvature = planner.act(&Observation { grid }).look_ahead.curvature_per_m();
        assert!(curvature > 0.01, "{curvature}");
        // Half a second allows 9.9° from straight: 11 of the steps of 0.8875°.
        let mut narrow = Params { window_s: 0.5, heading_weight: 0.0, ..Params::paper() }.planner(&context());
        let steering = maths::atan(narrow.act(&Observation { grid }).look_ahead.curvature_per_m() * 2.845).to_degrees();
        assert!(steering > 0.0 && steering < 11.5 * 0.8875, "{steering}");
    }
}
