//! Model predictive path integral control (Williams et al. 2017), with the structure and the constants of the controller of
//! that name in nav2, the navigation stack of ROS 2 (docs/methods.md 7.4). The paper did not run it: it is what a reader from
//! the field would put on this grid.
//!
//! Many sequences of controls, drawn around the last answer, are rolled out with the car's own model over the grid; each is
//! rated, and the next answer is their mean, weighted by exp(−cost/λ). Steering and speed are chosen together, so it can slow
//! down. nav2 follows a global path; here is none, and how far the way still goes (`WayField`) takes its place.

use crate::context::PlannerContext;
use crate::method::{Method, within};
use crate::search::{Dimension, Span, normal};
use crate::way_field::WayField;
use serde::{Deserialize, Serialize};
use sim::driver::{Decision, Policy};
use sim::geometry::{Pose, Vec2};
use sim::maths;
use sim::seed::{RootSeed, Stream};
use sim::sensing::Observation;
use sim::vectors::{FourPoints, f32x4};
use sim::vehicle::{self, VehicleCommand, VehicleSettings, VehicleState};
use std::sync::Arc;

/// Between two steps of a rollout, seconds (*chosen*: twice nav2's 0.05, with half as many steps).
const STEP_S: f32 = 0.1;
/// Between two draws of a sequence, seconds; what lies between is interpolated (*chosen*, instead of the filter that nav2
/// smooths its answer with).
const KNOT_S: f32 = 0.4;
/// Circles as wide as the body in a row along it: of the paper's car, corners stick out by 0.1 m at most.
const CIRCLES: usize = 6;
/// Speeds of the controller's law are tabulated at so many angles from 0 to full lock.
const LAW_ANGLES: usize = 33;
/// Largest product of pairs and horizon, seconds: draws and samples then take 1.6 MB each, as much as a map, and every car
/// that drives has its own samples.
const PAIR_SECONDS_MAX: f32 = 10_000.0;
/// A clearance costs no more than one of minus this many scales.
const SCALES_MAX: f32 = 3.0;

/// Parameters of the path integral control.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Pairs of sequences rolled out per decision, besides the last answer itself: 128 (*chosen*; nav2: 1000 sequences,
    /// which take four times as long).
    pub pairs: u32,
    /// How far ahead, seconds: 2.8 (*cited*: nav2, 56 steps of 0.05 s).
    pub horizon_s: f32,
    /// λ, how much cost makes a sequence count e times less: 0.3 (*cited*: nav2).
    pub temperature: f32,
    /// γ, price of steering and of being slower than the controller drives straight on, by which the mean does not run away
    /// with the draws: 0.015 (*cited*: nav2).
    pub gamma: f32,
    /// Standard deviation of the steering angles drawn, radians: 0.15 (*chosen*; nav2 draws yaw rates).
    pub steering_std_rad: f32,
    /// Standard deviation of the speeds drawn, m/s: 0.2 (*cited*: nav2).
    pub speed_std_mps: f32,
    /// Price of a metre that the way still goes from the bumper at the end (*chosen*).
    pub way_weight: f32,
    /// Price of a second with clearance 0 (*chosen*): the distance of the body's circles to the discs inscribed in occupied
    /// cells.
    pub obstacle_weight: f32,
    /// Clearance that lowers this price e times, metres (*chosen*).
    pub clearance_scale_m: f32,
    /// Price of a whole horizon beyond a collision (*chosen*): the sooner it comes, the more of it is due.
    pub collision_weight: f32,
    /// Price of a change of the angle asked for, per rad² and step (*chosen*).
    pub change_weight: f32,
    /// Added to half the body's width for the clearance, metres: −0.2 (*chosen*: the grid shows things larger than they are,
    /// by 0.24 m a side on average; docs/methods.md 1.1).
    pub margin_m: f32,
    /// The body is longer by this at the nose, metres: 0.5, the distance ahead at which the paper stops the car.
    pub nose_m: f32,
    /// Clearance from which on it is a collision, metres (*chosen*).
    pub collision_from_m: f32,
    /// The way goes on over cells at least this far from occupied ones, centre to centre, metres: 0.7, gaps of three cells
    /// (*chosen*).
    pub passable_from_m: f32,
    /// Root seed of the draws: 1. One set of draws serves every decision (*cited*: nav2, `regenerate_noises` off).
    pub seed: u32,
}

impl Method for Params {
    const NAME: &'static str = "mppi";
    const ABOUT: &'static str =
        "model predictive path integral control as in nav2: sampled steering and speed, rolled out over the grid";
    const SEARCH: &'static [Dimension<Self>] = &[
        Dimension {
            name: "temperature",
            span: Span::Log(0.03, 3.0),
            get: |p| p.temperature,
            set: |p, value| p.temperature = value,
        },
        Dimension {
            name: "way_weight",
            span: Span::Log(0.1, 10.0),
            get: |p| p.way_weight,
            set: |p, value| p.way_weight = value,
        },
        Dimension {
            name: "obstacle_weight",
            span: Span::Log(0.1, 30.0),
            get: |p| p.obstacle_weight,
            set: |p, value| p.obstacle_weight = value,
        },
        Dimension {
            name: "clearance_scale_m",
            span: Span::Linear(0.05, 0.6),
            get: |p| p.clearance_scale_m,
            set: |p, value| p.clearance_scale_m = value,
        },
        Dimension {
            name: "margin_m",
            span: Span::Linear(-0.5, 0.3),
            get: |p| p.margin_m,
            set: |p, value| p.margin_m = value,
        },
        Dimension {
            name: "change_weight",
            span: Span::Log(0.01, 300.0),
            get: |p| p.change_weight,
            set: |p, value| p.change_weight = value,
        },
    ];
    type Planner = PathIntegral;

    fn paper() -> Self {
        Self {
            pairs: 128,
            horizon_s: 2.8,
            temperature: 0.3,
            gamma: 0.015,
            steering_std_rad: 0.15,
            speed_std_mps: 0.2,
            way_weight: 1.0,
            obstacle_weight: 2.0,
            clearance_scale_m: 0.25,
            collision_weight: 20.0,
            change_weight: 1.0,
            margin_m: -0.2,
            nose_m: 0.5,
            collision_from_m: -0.2,
            passable_from_m: 0.7,
            seed: 1,
        }
    }

    fn check(&self) -> Result<(), String> {
        within("pairs", self.pairs as f32, 1.0, 1e5)?;
        within("horizon_s", self.horizon_s, 0.2, 20.0)?;
        within("pairs * horizon_s", self.pairs as f32 * self.horizon_s, 0.0, PAIR_SECONDS_MAX)?;
        within("temperature", self.temperature, 1e-3, 1e3)?;
        within("gamma", self.gamma, 0.0, 10.0)?;
        within("steering_std_rad", self.steering_std_rad, 1e-3, 1.0)?;
        within("speed_std_mps", self.speed_std_mps, 1e-3, 5.0)?;
        within("way_weight", self.way_weight, 0.0, 1e3)?;
        within("obstacle_weight", self.obstacle_weight, 0.0, 1e3)?;
        within("clearance_scale_m", self.clearance_scale_m, 0.01, 5.0)?;
        within("collision_weight", self.collision_weight, 0.0, 1e6)?;
        within("change_weight", self.change_weight, 0.0, 1e3)?;
        within("margin_m", self.margin_m, -0.9, 2.0)?;
        within("nose_m", self.nose_m, 0.0, 5.0)?;
        within("collision_from_m", self.collision_from_m, -2.0, 2.0)?;
        within("passable_from_m", self.passable_from_m, 0.1, 3.0)
    }

    fn planner(&self, context: &PlannerContext) -> PathIntegral {
        let steps = (self.horizon_s / STEP_S).round() as usize;
        let vehicle = &context.vehicle;
        let length_m = vehicle.length_m + self.nose_m;
        let circle = |i: usize| -vehicle.rear_overhang_m + length_m * (i as f32 + 0.5) / CIRCLES as f32;
        let law_mps = |i: usize| {
            let steering_rad = vehicle.steering_max_rad * i as f32 / (LAW_ANGLES - 1) as f32;
            context.speed_mps(context.curvature_per_m(steering_rad))
        };
        PathIntegral {
            tables: Arc::new(Tables {
                params: self.clone(),
                context: context.clone(),
                steps,
                noise: draw_noise(self, steps),
                circles_m: std::array::from_fn(circle),
                law_mps: std::array::from_fn(law_mps),
            }),
            field: Box::new(WayField::new(context)),
            controls: vec![Control::REST; steps],
            asked: vec![Control::REST; samples(self) * steps],
            costs: vec![0.0; samples(self)],
            car: VehicleState::at_rest(Pose::default()),
            command: Control::REST.into(),
        }
    }
}

/// What is asked for at a step.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Control {
    steering_rad: f32,
    speed_mps: f32,
}

impl Control {
    const REST: Self = Self { steering_rad: 0.0, speed_mps: 0.0 };
}

impl From<Control> for VehicleCommand {
    fn from(Control { steering_rad, speed_mps }: Control) -> Self {
        Self { steering_rad, speed_mps }
    }
}

/// Those of four samples.
#[derive(Debug, Clone, Copy)]
struct FourControls {
    steering_rad: f32x4,
    speed_mps: f32x4,
}

impl From<[Control; 4]> for FourControls {
    fn from(controls: [Control; 4]) -> Self {
        Self {
            steering_rad: controls.map(|control| control.steering_rad).into(),
            speed_mps: controls.map(|control| control.speed_mps).into(),
        }
    }
}

/// Four cars as far as they differ: [`VehicleState`] without a pose.
#[derive(Debug, Clone, Copy)]
struct FourCars {
    speed_mps: f32x4,
    steering_rad: f32x4,
    accel_mps2: f32x4,
    accel_demand_mps2: f32x4,
    speed_integral_mps2: f32x4,
}

impl FourCars {
    fn splat(car: &VehicleState) -> Self {
        Self {
            speed_mps: f32x4::splat(car.speed_mps),
            steering_rad: f32x4::splat(car.steering_rad),
            accel_mps2: f32x4::splat(car.accel_mps2),
            accel_demand_mps2: f32x4::splat(car.accel_demand_mps2),
            speed_integral_mps2: f32x4::splat(car.speed_integral_mps2),
        }
    }

    /// [`vehicle::step`] of [`STEP_S`], and how far each car comes, metres.
    #[inline]
    fn step(&mut self, vehicle: &VehicleSettings, asked: FourControls) -> f32x4 {
        let step_s = f32x4::splat(STEP_S);
        let error_mps = asked.speed_mps - self.speed_mps;
        let integral = self.speed_integral_mps2 + f32x4::splat(vehicle.speed_gain_i_per_s2) * error_mps * step_s;
        self.speed_integral_mps2 = within_four(integral, f32x4::ZERO, vehicle.integral_max_mps2);
        let wanted = f32x4::splat(vehicle.speed_gain_p_per_s) * error_mps + self.speed_integral_mps2;
        let wanted = wanted.fast_max(f32x4::splat(-vehicle.brake_max_mps2));
        let wanted = wanted.fast_min(f32x4::splat(vehicle.accel_max_mps2));
        self.accel_demand_mps2 = within_four(wanted, self.accel_demand_mps2, vehicle.jerk_max_mps3 * STEP_S);
        let share = f32x4::splat((STEP_S / vehicle.drivetrain_lag_s).min(1.0));
        self.accel_mps2 += (self.accel_demand_mps2 - self.accel_mps2) * share;
        let before_mps = self.speed_mps;
        self.speed_mps = (before_mps + self.accel_mps2 * step_s).fast_max(f32x4::ZERO);
        let turn_max_rad = vehicle.steering_rate_max_radps * STEP_S;
        self.steering_rad = within_four(asked.steering_rad, self.steering_rad, turn_max_rad);
        f32x4::splat(0.5) * (before_mps + self.speed_mps) * step_s
    }
}

/// Values no farther than a distance from others.
#[inline]
fn within_four(values: f32x4, others: f32x4, distance: f32) -> f32x4 {
    let distance = f32x4::splat(distance);
    values.fast_max(others - distance).fast_min(others + distance)
}

/// A function that knows no vectors, of each lane.
fn of_each(values: f32x4, function: impl Fn(f32) -> f32) -> f32x4 {
    values.to_array().map(function).into()
}

/// Sequences per decision.
fn samples(params: &Params) -> usize {
    2 * params.pairs as usize + 1
}

/// Draws for every sample and step, sample by sample. Of two neighbours one steers where the other does not, so that left and
/// right are treated alike; the first is undisturbed.
fn draw_noise(params: &Params, steps: usize) -> Vec<Control> {
    let mut rng = RootSeed(u64::from(params.seed)).rng(Stream::Rollouts, 0);
    let knots = (steps as f32 * STEP_S / KNOT_S).ceil() as usize + 1;
    let mut noise: Vec<Control> = Vec::with_capacity(samples(params) * steps);
    for sample in 0..samples(params) {
        if sample % 2 == 0 && sample > 0 {
            let last = noise.len() - steps;
            noise.extend_from_within(last..);
            noise[last + steps..].iter_mut().for_each(|control| control.steering_rad *= -1.0);
            continue;
        }
        let scale = if sample == 0 { 0.0 } else { 1.0 };
        let mut draw = |std: f32| -> Vec<f32> { (0..knots).map(|_| scale * std * normal(&mut rng)).collect() };
        let (steering_rad, speed_mps) = (draw(params.steering_std_rad), draw(params.speed_std_mps));
        noise.extend((0..steps).map(|step| {
            let place = step as f32 * STEP_S / KNOT_S;
            let (knot, share) = (place as usize, place.fract());
            let between = |values: &[f32]| values[knot] + share * (values[knot + 1] - values[knot]);
            Control { steering_rad: between(&steering_rad), speed_mps: between(&speed_mps) }
        }));
    }
    noise
}

/// What does not change from decision to decision.
#[derive(Debug)]
struct Tables {
    params: Params,
    context: PlannerContext,
    steps: usize,
    noise: Vec<Control>,
    /// Centres of the circles along the body, ahead of the rear axle, metres.
    circles_m: [f32; CIRCLES],
    /// What the controller drives at most, m/s, by angle.
    law_mps: [f32; LAW_ANGLES],
}

impl Tables {
    /// What the car can be asked for.
    fn clamped(&self, control: Control) -> Control {
        let limit_rad = self.context.vehicle.steering_max_rad;
        let steering_rad = control.steering_rad.clamp(-limit_rad, limit_rad);
        let place = steering_rad.abs() / limit_rad * (LAW_ANGLES - 1) as f32;
        let below = (place as usize).min(LAW_ANGLES - 2);
        let (low_mps, high_mps) = (self.law_mps[below], self.law_mps[below + 1]);
        let law_mps = low_mps + (place - below as f32) * (high_mps - low_mps);
        let slowest_mps = self.context.controller.speed_min_mps.min(law_mps);
        Control { steering_rad, speed_mps: control.speed_mps.clamp(slowest_mps, law_mps) }
    }

    /// What every sample asks for at every step, sample by sample.
    fn sample(&self, controls: &[Control], asked: &mut [Control]) {
        for (of_sample, noise) in asked.chunks_exact_mut(self.steps).zip(self.noise.chunks_exact(self.steps)) {
            for ((asked, mean), noise) in of_sample.iter_mut().zip(controls).zip(noise) {
                *asked = self.clamped(Control {
                    steering_rad: mean.steering_rad + noise.steering_rad,
                    speed_mps: mean.speed_mps + noise.speed_mps,
                });
            }
        }
    }

    /// S, the costs of four samples from where the wheels and the speed are.
    fn costs(
        &self,
        field: &WayField,
        controls: &[Control],
        asked: &[Control],
        samples: [usize; 4],
        start: &VehicleState,
    ) -> f32x4 {
        let Self { params, context: PlannerContext { vehicle, .. }, .. } = self;
        let half_m = f32x4::splat(0.5 * vehicle.width_m + params.margin_m);
        let of_samples =
            |values: &[Control], step| FourControls::from(samples.map(|sample| values[sample * self.steps + step]));
        let (mut position, mut ahead) = (FourPoints::splat(Vec2::ZERO), FourPoints::splat(Vec2::X));
        let mut cars = FourCars::splat(start);
        let (mut last_rad, mut cost) = (cars.steering_rad, f32x4::ZERO);
        // Samples without a collision; the others stay where they are, and cost no more.
        let mut running = cost.simd_eq(cost);
        for (step, &mean) in controls.iter().enumerate() {
            let asked = of_samples(asked, step);
            let travel_m = running & cars.step(vehicle, asked);
            let turn_rad = travel_m * of_each(cars.steering_rad, maths::tan) / f32x4::splat(vehicle.wheelbase_m);
            // Of a turn of a few degrees; |ahead| stays 1 to 1e-6 over a rollout.
            let cos = f32x4::splat(1.0) - f32x4::splat(0.5) * turn_rad * turn_rad;
            let sin = turn_rad - turn_rad * turn_rad * turn_rad / f32x4::splat(6.0);
            let before = ahead;
            ahead = FourPoints { x: cos * before.x - sin * before.y, y: sin * before.x + cos * before.y };
            position = position + (before + ahead) * (f32x4::splat(0.5) * travel_m);

            let of_circle = |&ahead_m: &f32| field.distance_m(position + ahead * f32x4::splat(ahead_m));
            let nearest_m = self.circles_m.iter().map(of_circle).fold(f32x4::splat(f32::INFINITY), f32x4::fast_min);
            let clearance_m = nearest_m - half_m;
            let scales = (-clearance_m / f32x4::splat(params.clearance_scale_m)).fast_min(f32x4::splat(SCALES_MAX));
            let change_rad = asked.steering_rad - last_rad;
            last_rad = asked.steering_rad;
            let near = f32x4::splat(params.obstacle_weight * STEP_S) * of_each(scales, maths::exp);
            cost += running & (near + f32x4::splat(params.change_weight) * change_rad * change_rad);
            cost += running & self.departures(mean, asked);
            let collides = running & clearance_m.simd_lt(f32x4::splat(params.collision_from_m));
            let share_left = (self.steps - step) as f32 / self.steps as f32;
            cost += collides & f32x4::splat(params.collision_weight * share_left);
            running &= !collides;
            if running.none() {
                break;
            }
        }
        let bumper = position + ahead * f32x4::splat(vehicle.front_m());
        cost + f32x4::splat(params.way_weight) * field.way_left_m(bumper)
    }

    /// γ·u·ε/σ² of a step, of four samples: what keeps the mean from running away with the draws. ε is what is left of a draw
    /// within what the car can be asked for; the steps from one draw to the next share it.
    fn departures(&self, mean: Control, asked: FourControls) -> f32x4 {
        let Params { gamma, steering_std_rad, speed_std_mps, .. } = self.params;
        let left = |asked: f32x4, mean: f32, std: f32| (asked - f32x4::splat(mean)) / f32x4::splat(std * std);
        let steering = left(asked.steering_rad, mean.steering_rad, steering_std_rad);
        let speed = left(asked.speed_mps, mean.speed_mps, speed_std_mps);
        // The speed that the controller would drive straight on costs nothing; in a bend its law is slower, and priced.
        let slower_mps = mean.speed_mps - self.law_mps[0];
        f32x4::splat(gamma * STEP_S / KNOT_S)
            * (f32x4::splat(mean.steering_rad) * steering + f32x4::splat(slower_mps) * speed)
    }
}

/// Path integral control at the wheel.
#[derive(Debug, Clone)]
pub struct PathIntegral {
    tables: Arc<Tables>,
    field: Box<WayField>,
    /// The last answer, by step: where the next draws begin.
    controls: Vec<Control>,
    /// What every sample asks for, by sample and step.
    asked: Vec<Control>,
    /// The cost of every sample.
    costs: Vec<f32>,
    /// How the car probably moves, which is not shown: as if what was asked for came without a dead time.
    car: VehicleState,
    /// What was asked for last.
    command: VehicleCommand,
}

impl PathIntegral {
    /// The last answer as it looks a control period later.
    fn shift(&mut self) {
        let share = self.tables.context.control_period_s / STEP_S;
        for step in 0..self.controls.len() {
            let place = step as f32 + share;
            let before = (place as usize).min(self.controls.len() - 1);
            let after = (before + 1).min(self.controls.len() - 1);
            let (from, to) = (self.controls[before], self.controls[after]);
            let share = place - before as f32;
            let between = |from: f32, to: f32| from + share.min(1.0) * (to - from);
            self.controls[step] = Control {
                steering_rad: between(from.steering_rad, to.steering_rad),
                speed_mps: between(from.speed_mps, to.speed_mps),
            };
        }
    }

    /// The mean of the samples, weighted by exp(−S/λ).
    fn average(&mut self) {
        let Self { tables, controls, asked, costs, .. } = self;
        let least = costs.iter().copied().fold(f32::INFINITY, f32::min);
        let mut sum = 0.0;
        for cost in costs.iter_mut() {
            *cost = maths::exp((least - *cost) / tables.params.temperature);
            sum += *cost;
        }
        controls.fill(Control::REST);
        for (of_sample, weight) in asked.chunks_exact(tables.steps).zip(costs) {
            for (mean, asked) in controls.iter_mut().zip(of_sample) {
                mean.steering_rad += *weight * asked.steering_rad;
                mean.speed_mps += *weight * asked.speed_mps;
            }
        }
        for mean in controls {
            *mean = Control { steering_rad: mean.steering_rad / sum, speed_mps: mean.speed_mps / sum };
        }
    }
}

impl Policy for PathIntegral {
    fn act(&mut self, observation: &Observation) -> Decision {
        self.field.read(&observation.grid, self.tables.params.passable_from_m);
        self.shift();
        let PlannerContext { vehicle, control_period_s, .. } = &self.tables.context;
        let moved = vehicle::step(vehicle, self.car, self.command, *control_period_s);
        // Where it is does not matter.
        self.car = VehicleState { pose: Pose::default(), position_rest_m: Vec2::ZERO, ..moved };
        let Self { tables, field, controls, asked, costs, car, .. } = self;
        tables.sample(controls, asked);
        let last = costs.len() - 1;
        for (four, costs) in costs.chunks_mut(4).enumerate() {
            let samples = std::array::from_fn(|lane| (4 * four + lane).min(last));
            let of_four = tables.costs(field, controls, asked, samples, car).to_array();
            costs.copy_from_slice(&of_four[..costs.len()]);
        }
        self.average();
        let Control { steering_rad, speed_mps } = self.controls[0];
        self.command = VehicleCommand { steering_rad, speed_mps };
        let context = &self.tables.context;
        context.steer_along_at(context.curvature_per_m(steering_rad), speed_mps)
    }

    fn reset(&mut self) {
        self.controls.fill(Control::REST);
        self.car = VehicleState::at_rest(Pose::default());
        self.command = Control::REST.into();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::context;
    use sim::sensing::OccupancyGrid;

    fn planner() -> PathIntegral {
        Params::paper().planner(&context())
    }

    /// After some decisions on the same grid.
    fn settled(planner: &mut PathIntegral, grid: OccupancyGrid) -> Decision {
        (0..60).map(|_| planner.act(&Observation { grid })).last().unwrap()
    }

    #[test]
    fn draws_are_mirrored_in_pairs_have_the_spread_asked_for_and_depend_on_the_seed() {
        let params = Params { pairs: 1000, ..Params::paper() };
        let (steps, noise) = (28, draw_noise(&params, 28));
        assert!(noise[..steps].iter().all(|control| *control == Control::REST), "the first is undisturbed");
        for (left, right) in noise[steps..2 * steps].iter().zip(&noise[2 * steps..3 * steps]) {
            assert_eq!((left.steering_rad, left.speed_mps), (-right.steering_rad, right.speed_mps));
        }
        // At a knot, where nothing is interpolated.
        let at_knot = noise.iter().skip(4).step_by(steps);
        let squared: f32 = at_knot.map(|control| control.steering_rad * control.steering_rad).sum();
        assert!(((squared / 2000.0).sqrt() - 0.15).abs() < 0.01, "{}", (squared / 2000.0).sqrt());
        assert_ne!(draw_noise(&Params { seed: 2, ..params.clone() }, 28), noise);
        assert_eq!(draw_noise(&params, 28), noise);
    }

    /// Each within its range, they were let through, and the samples of a few cars filled the memory.
    #[test]
    fn pairs_and_horizon_that_fill_the_memory_together_are_refused() {
        let check = |pairs, horizon_s| Params { pairs, horizon_s, ..Params::paper() }.check();
        let refusal = check(100_000, 20.0).unwrap_err();
        assert_eq!(refusal, "pairs * horizon_s = 2000000: choose 0 to 10000");
        assert_eq!((check(500, 20.0), check(3571, 2.8)), (Ok(()), Ok(())), "seven times what nav2 rolls out");
        assert!(check(501, 20.0).is_err());
    }

    #[test]
    fn open_ground_is_crossed_straight_and_fast() {
        let mut planner = planner();
        let decision = settled(&mut planner, OccupancyGrid::free());
        assert!(decision.look_ahead.left_m.abs() < 0.1, "{decision:?}");
        assert!(decision.speed_limit_mps.unwrap() > 1.7, "{decision:?}");
    }

    /// A wall with a gap on the left: it steers left. A dead end is met slower than open ground.
    #[test]
    fn a_block_is_passed_and_a_dead_end_is_met_slower() {
        let mut grid = OccupancyGrid::free();
        (14..18).for_each(|row| grid.occupy_row(row, !0 << 11));
        let mut planner = planner();
        assert!(settled(&mut planner, grid).look_ahead.curvature_per_m() > 0.02);
        planner.reset();
        let mut wall = OccupancyGrid::free();
        (0..23).for_each(|row| wall.occupy_row(row, u32::MAX));
        let decision = settled(&mut planner, wall);
        planner.reset();
        let open = settled(&mut planner, OccupancyGrid::free());
        assert!(decision.speed_limit_mps.unwrap() < open.speed_limit_mps.unwrap() - 0.1, "{decision:?} {open:?}");
    }

    /// On free ground with nothing drawn.
    #[test]
    fn a_rollout_is_the_car_that_asks_for_what_the_sample_says() {
        let mut planner = planner();
        planner.field.read(&OccupancyGrid::free(), 0.7);
        let fast = vec![Control { steering_rad: 0.0, speed_mps: 9.0 }; 28];
        let params = Params { obstacle_weight: 0.0, gamma: 0.0, ..Params::paper() };
        let PlannerContext { vehicle, .. } = context();
        let tables = params.planner(&context()).tables;
        tables.sample(&fast, &mut planner.asked);
        let at_rest = VehicleState::at_rest(Pose::default());
        let cost = tables.costs(&planner.field, &fast, &planner.asked, [0; 4], &at_rest).to_array()[0];
        // No faster than the controller's law.
        let asked = VehicleCommand { steering_rad: 0.0, speed_mps: 2.2 };
        let at_end = (0..28).fold(at_rest, |car, _| vehicle::step(&vehicle, car, asked, STEP_S)).pose.position();
        let expected = planner.field.way_left_m(FourPoints::splat(at_end + Vec2::new(3.8, 0.0))).to_array()[0];
        assert!((cost - expected).abs() < 1e-3, "{cost} and {expected}");
    }

    /// It stopped at once, and so the planner thought that it need not brake yet.
    #[test]
    fn four_cars_speed_up_brake_and_steer_as_the_car_does() {
        let PlannerContext { vehicle, .. } = context();
        let mut car = VehicleState { speed_mps: 1.0, ..VehicleState::at_rest(Pose::default()) };
        let mut four = FourCars::splat(&car);
        for (steering_rad, speed_mps) in [(0.2, 2.2), (-0.3, 0.5), (0.0, 2.0), (0.5, 0.0)] {
            let asked = Control { steering_rad, speed_mps };
            for _ in 0..12 {
                let before = car;
                car = vehicle::step(&vehicle, car, asked.into(), STEP_S);
                let travel_m = four.step(&vehicle, [asked; 4].into()).to_array()[3];
                let found = [four.speed_mps, four.steering_rad, four.accel_mps2].map(|lanes| lanes.to_array()[3]);
                let expected = [car.speed_mps, car.steering_rad, car.accel_mps2];
                assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} {expected:?}");
                assert!((travel_m - 0.5 * (before.speed_mps + car.speed_mps) * STEP_S).abs() < 1e-6);
            }
        }
        assert!(car.accel_mps2 < -1.0, "it brakes: {car:?}");
    }

    /// Also of those that hit something sooner or later than their neighbours.
    #[test]
    fn a_sample_costs_the_same_whatever_is_rolled_out_beside_it() {
        let mut planner = Params { collision_weight: 1e3, ..Params::paper() }.planner(&context());
        let mut grid = OccupancyGrid::free();
        (14..18).for_each(|row| grid.occupy_row(row, !0 << 11));
        planner.field.read(&grid, 0.7);
        let ahead = vec![Control { steering_rad: 0.0, speed_mps: 1.2 }; 28];
        let PathIntegral { tables, field, asked, .. } = &mut planner;
        tables.sample(&ahead, asked);
        let start = VehicleState { steering_rad: 0.1, speed_mps: 1.2, ..VehicleState::at_rest(Pose::default()) };
        let costs = |samples| tables.costs(field, &ahead, asked, samples, &start).to_array();
        let all = (0..200).step_by(4).flat_map(|first| {
            let samples = std::array::from_fn(|lane| first + lane);
            let beside = costs(samples);
            assert_eq!(beside, samples.map(|sample| costs([sample; 4])[0]));
            beside
        });
        let n_hit = all.filter(|cost| *cost > 30.0).count();
        assert!((20..180).contains(&n_hit), "{n_hit} of 200 hit the block");
    }

    #[test]
    fn what_is_forgotten_leaves_nothing_behind() {
        let (mut used, mut fresh) = (planner(), planner());
        let mut grid = OccupancyGrid::free();
        (8..14).for_each(|row| grid.occupy_row(row, !0 << 11));
        settled(&mut used, grid);
        used.reset();
        assert_eq!(used.act(&Observation { grid }), fresh.act(&Observation { grid }));
    }
}
