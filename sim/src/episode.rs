//! The closed loop. Training data, evaluation and replay all come from this one.
//!
//! An [`Episode`] is stepped from outside — [`Episode::observe`], a decision, [`Episode::apply`] — so that one driver
//! ([`run`]) and a lock-step batch ([`crate::batch::run_lockstep`]) are two thin callers of the same tick.
//!
//! Stop–count–resume (paper, collision rate) is the state machine `Phase`:
//!
//! ```text
//!            swept body meets something            at rest
//!  Driving ────────────────────────────▶ Braking ──────────▶ put back on the path ─▶ Driving
//!     └───────────── no progress (stuck) ───────────────────▶ put back on the path ─▶ Driving
//! ```
//!
//! Where no place is left ahead on the path from which the car could drive on, it is `Blocked` instead, and the run ends.

use crate::collision::BodyBox;
use crate::controller::{self, ControllerSettings};
use crate::driver::{Decision, Driver, GroundTruth, Seat, Situation, Source};
use crate::frame::{Ending, Event, Frame, FrameSink};
use crate::geometry::Pose;
use crate::map::Map;
use crate::metrics::{EpisodeMetrics, MetricsAccumulator, MetricsSettings, SafeRing, Undecided};
use crate::seed::RootSeed;
use crate::sensing::noise::NoiseSettings;
use crate::sensing::{Observation, SensingSettings, Sensor};
use crate::vehicle::{self, VehicleCommand, VehicleSettings, VehicleState};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::sync::Arc;

/// Everything an episode needs besides a map and a seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EpisodeSettings {
    /// The car.
    pub vehicle: VehicleSettings,
    /// How a look-ahead point becomes a command.
    pub controller: ControllerSettings,
    /// Camera and bird's-eye view.
    pub sensing: SensingSettings,
    /// Perception errors.
    pub noise: NoiseSettings,
    /// What is measured.
    pub metrics: MetricsSettings,
    /// Physics step, milliseconds.
    pub physics_step_ms: u32,
    /// Control period, milliseconds; a multiple of the physics step (paper: 50 ms).
    pub control_period_ms: u32,
}

impl EpisodeSettings {
    /// The paper's set-up at noise level `paper`.
    pub fn paper() -> Self {
        Self {
            vehicle: VehicleSettings::hyundai_hg300(),
            controller: ControllerSettings::paper(),
            sensing: SensingSettings::paper(),
            noise: NoiseSettings::of(crate::scenario::NoiseLevel::Paper),
            metrics: MetricsSettings::paper(),
            physics_step_ms: 10,
            control_period_ms: 50,
        }
    }

    /// Control period, seconds.
    pub fn control_period_s(&self) -> f32 {
        self.control_period_ms as f32 * 1e-3
    }

    fn physics_step_s(&self) -> f32 {
        self.physics_step_ms as f32 * 1e-3
    }

    fn physics_steps(&self, seconds: f32) -> u32 {
        (seconds / self.physics_step_s()).round() as u32
    }
}

/// Result of a finished run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpisodeReport {
    /// How it ended.
    pub ending: Ending,
    /// What was measured.
    pub metrics: EpisodeMetrics,
    /// Near-collisions and stuck events in order, with the tick they happened at.
    pub events: Vec<(u32, Event)>,
}

/// The last time that a car got on: how far along the route, and at which physics step.
#[derive(Debug, Clone, Copy, Default)]
struct Advance {
    progress_m: f32,
    physics_step: u32,
}

/// How far back and ahead of its progress a car is looked for along the route, metres; farther ahead only where it drove so
/// far since, as in a long emergency stop.
const PROJECTED_M: f32 = 5.0;
/// How much farther along the route than it drove a car may be, metres: it cuts bends.
const CUT_M: f32 = 1.0;

/// State of stop–count–resume.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// The driver is in control.
    Driving,
    /// Counted; emergency braking until the car rests.
    Braking,
    /// Left where it stopped or got stuck: nothing that is left of the route is free.
    Blocked,
}

/// One run that can be stepped.
#[derive(Debug, Clone)]
pub struct Episode {
    settings: Arc<EpisodeSettings>,
    map: Arc<Map>,
    body: Arc<BodyBox>,
    ring: Arc<SafeRing>,
    undecided: Undecided,
    sensor: Sensor,
    vehicle: VehicleState,
    phase: Phase,
    /// Commands on their way to the actuators, with the physics step from which they hold.
    in_flight: VecDeque<(u32, VehicleCommand)>,
    command: VehicleCommand,
    physics_step: u32,
    tick: u32,
    progress_m: f32,
    /// The last time that progress was made.
    advance: Advance,
    /// No near-collision is counted before this physics step.
    counts_from_step: u32,
    touches: bool,
    /// Nothing is near enough to be met in this tick.
    is_clear: bool,
    observation: Observation,
    was_reset: bool,
    metrics: MetricsAccumulator,
    events: Vec<(u32, Event)>,
    ending: Option<Ending>,
}

impl Episode {
    /// A car at rest at the start of a map's route; all noise is drawn from `seed`.
    ///
    /// # Panics
    /// If the control period is no multiple of the physics step.
    pub fn new(settings: Arc<EpisodeSettings>, map: Arc<Map>, seed: RootSeed) -> Self {
        assert!(
            settings.physics_step_ms > 0 && settings.control_period_ms.is_multiple_of(settings.physics_step_ms),
            "the control period is a multiple of the physics step"
        );
        let body = Arc::new(BodyBox::new(&settings.vehicle));
        let pixel_m = settings.sensing.geometry.pixel_m();
        let ring = Arc::new(SafeRing::new(&settings.vehicle, &settings.metrics, pixel_m));
        Self::of_car(settings, map, seed, body, ring)
    }

    /// The same as [`Self::new`], but shares with this episode what depends on the settings only, if they are equal: many
    /// cars that are driven in turn then find it in the cache.
    #[must_use]
    pub fn another(&self, settings: &EpisodeSettings, map: Arc<Map>, seed: RootSeed) -> Self {
        if *settings != *self.settings {
            return Self::new(Arc::new(settings.clone()), map, seed);
        }
        Self::of_car(Arc::clone(&self.settings), map, seed, Arc::clone(&self.body), Arc::clone(&self.ring))
    }

    fn of_car(
        settings: Arc<EpisodeSettings>,
        map: Arc<Map>,
        seed: RootSeed,
        body: Arc<BodyBox>,
        ring: Arc<SafeRing>,
    ) -> Self {
        let sensor = Sensor::new(&map, settings.sensing.clone(), &settings.noise, seed);
        Self {
            body,
            undecided: ring.undecided(),
            ring,
            sensor,
            vehicle: VehicleState::at_rest(map.start()),
            phase: Phase::Driving,
            in_flight: VecDeque::with_capacity(4),
            command: VehicleCommand::default(),
            physics_step: 0,
            tick: 0,
            progress_m: 0.0,
            advance: Advance::default(),
            counts_from_step: 0,
            touches: false,
            is_clear: false,
            observation: Observation::default(),
            was_reset: true,
            metrics: MetricsAccumulator::new(map.path().length_m()),
            events: Vec::new(),
            ending: None,
            settings,
            map,
        }
    }

    /// A sensor like the one of this episode, with noise of its own.
    pub fn another_sensor(&self, seed: RootSeed) -> Sensor {
        Sensor::new(&self.map, self.settings.sensing.clone(), &self.settings.noise, seed)
    }

    /// An episode that starts from a state met in another one, to ask what would have happened from there. Commands that
    /// were still on their way to the actuators are not known: the car keeps its steering and speed until the first new
    /// command takes hold. `refractory_s` is what is left of the time after a resume in which nothing is counted.
    pub fn under_way(
        settings: Arc<EpisodeSettings>,
        map: Arc<Map>,
        seed: RootSeed,
        vehicle: VehicleState,
        progress_m: f32,
        refractory_s: f32,
    ) -> Self {
        let command = VehicleCommand { steering_rad: vehicle.steering_rad, speed_mps: vehicle.speed_mps };
        let new = Self::new(settings, map, seed);
        Self {
            vehicle,
            command,
            progress_m,
            advance: Advance { progress_m, physics_step: 0 },
            counts_from_step: new.settings.physics_steps(refractory_s),
            metrics: new.metrics.with_wheels_at(vehicle.steering_rad),
            ..new
        }
    }

    /// Takes an observation. Call once before each decision.
    pub fn observe(&mut self) {
        self.observation = self.sensor.observe(&self.map, self.vehicle.pose, self.tick);
    }

    /// What the driver is shown.
    pub fn situation(&self) -> Situation<'_> {
        let truth = GroundTruth { map: &self.map, vehicle: self.vehicle, progress_m: self.progress_m };
        Situation { observation: &self.observation, truth }
    }

    /// This episode as a seat of a lock-step batch.
    pub fn seat(&self, episode: usize) -> Seat<'_> {
        Seat { episode, was_reset: self.was_reset, situation: self.situation() }
    }

    /// Whether the car was put back on the path since the last decision.
    pub fn was_reset(&self) -> bool {
        self.was_reset
    }

    /// How the run ended, once it has.
    pub fn ending(&self) -> Option<Ending> {
        self.ending
    }

    /// The map driven on.
    pub fn map(&self) -> &Arc<Map> {
        &self.map
    }

    /// The settings driven with.
    pub fn settings(&self) -> &EpisodeSettings {
        &self.settings
    }

    /// The vehicle now.
    pub fn vehicle(&self) -> VehicleState {
        self.vehicle
    }

    /// The sensor, for pictures.
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// Number of decisions so far.
    pub fn tick(&self) -> u32 {
        self.tick
    }

    /// Progress along the reference path, metres.
    pub fn progress_m(&self) -> f32 {
        self.progress_m
    }

    /// Drives one control tick. After a near-collision the tick lasts until the car has braked to rest and stands on the
    /// path again.
    ///
    /// # Panics
    /// If the episode has ended, or the decision is not finite.
    pub fn apply(&mut self, decision: Decision) -> Frame {
        assert!(self.ending.is_none(), "the episode has ended");
        assert!(
            decision.is_finite(),
            "the decision is finite, not {decision:?} (tick {}, map {:?})",
            self.tick,
            self.map.scenario().name
        );
        let settings = &self.settings;
        let command =
            controller::pursue(&settings.controller, &settings.vehicle, &settings.sensing.geometry, &decision);
        self.drive(decision, command)
    }

    /// Drives one control tick as [`Self::apply`] does, but past the controller. The frame's decision is a point on the
    /// circle that the command steers; the vehicle obeys within its limits.
    ///
    /// # Panics
    /// If the episode has ended, or the command is not finite.
    pub fn apply_command(&mut self, command: VehicleCommand, source: Source) -> Frame {
        assert!(self.ending.is_none(), "the episode has ended");
        assert!(
            command.steering_rad.is_finite() && command.speed_mps.is_finite(),
            "the command is finite, not {command:?} (tick {}, map {:?})",
            self.tick,
            self.map.scenario().name
        );
        let look_ahead = controller::point_of(&self.settings.vehicle, command.steering_rad);
        self.drive(Decision { look_ahead, source, spread: None, speed_limit_mps: None }, command)
    }

    fn drive(&mut self, decision: Decision, command: VehicleCommand) -> Frame {
        let settings = Arc::clone(&self.settings);
        let holds_from = self.physics_step + settings.physics_steps(settings.vehicle.dead_time_s);
        self.in_flight.push_back((holds_from, command));
        self.was_reset = false;

        let distance = self.map.distance_field();
        let seen_from = self.vehicle;
        let mut frame = Frame {
            tick: self.tick,
            time_s: 0.0,
            vehicle: seen_from,
            observation: self.observation,
            decision,
            command,
            progress_m: self.progress_m,
            safe_ratio: self.ring.safe_ratio(distance, seen_from.pose, &mut self.undecided),
            clearance_m: self.body.clearance_m(distance, seen_from.pose),
            driven_m: 0.0,
            contacts: 0,
            event: Event::Drove,
        };
        self.is_clear = self.phase == Phase::Driving
            && self.body.stays_clear(
                distance,
                &settings.vehicle,
                &seen_from,
                settings.metrics.near_collision_m,
                settings.control_period_s(),
            );
        let steps_per_tick = settings.control_period_ms / settings.physics_step_ms;
        let mut steps = 0;
        while steps < steps_per_tick || self.phase == Phase::Braking {
            self.step_physics(&mut frame);
            steps += 1;
        }
        self.tick += 1;
        self.progress_m = self.projected_m(if self.was_reset { 0.0 } else { frame.driven_m });
        self.judge_progress(&mut frame);
        frame.time_s = self.physics_step as f32 * settings.physics_step_s();
        self.metrics.frame(&frame);
        if matches!(frame.event, Event::NearCollision { .. } | Event::Stuck { .. }) {
            self.events.push((frame.tick, frame.event));
        }
        self.ending = self.judge_ending(&frame);
        frame
    }

    /// What was measured so far.
    pub fn metrics(&self) -> EpisodeMetrics {
        self.metrics.metrics()
    }

    /// Near-collisions and stuck events so far, in order, with the tick they happened at.
    pub fn events(&self) -> &[(u32, Event)] {
        &self.events
    }

    /// The result; `None` while it is under way.
    pub fn report(&self) -> Option<EpisodeReport> {
        let ending = self.ending?;
        Some(EpisodeReport { ending, metrics: self.metrics(), events: self.events.clone() })
    }

    fn step_physics(&mut self, frame: &mut Frame) {
        let settings = &self.settings;
        let dt_s = settings.physics_step_s();
        let before = self.vehicle;
        match self.phase {
            Phase::Driving => {
                while self.in_flight.front().is_some_and(|&(step, _)| step <= self.physics_step) {
                    self.command = self.in_flight.pop_front().map_or(self.command, |(_, command)| command);
                }
                self.vehicle = vehicle::step(&settings.vehicle, before, self.command, dt_s);
            }
            Phase::Braking => self.vehicle = vehicle::step_emergency_stop(&settings.vehicle, before, dt_s),
            Phase::Blocked => {}
        }
        self.physics_step += 1;
        frame.driven_m += 0.5 * (before.speed_mps + self.vehicle.speed_mps) * dt_s;

        let (pose, set) = (self.vehicle.pose, settings.metrics.obstacle_set);
        let sweeps_into_something = !self.is_clear
            && self.body.sweep_hits(
                self.map.distance_field(),
                self.map.collision(),
                set,
                pose,
                self.vehicle.curvature_per_m(&settings.vehicle),
                settings.metrics.near_collision_m,
            );
        let touches = sweeps_into_something && self.map.collision().body_hits(&self.body, pose, set);
        frame.contacts += u32::from(touches && !self.touches);
        self.touches = touches;
        let counts = self.physics_step >= self.counts_from_step;
        match self.phase {
            Phase::Driving if sweeps_into_something && self.vehicle.speed_mps > 0.05 && counts => {
                frame.event = Event::NearCollision { at: pose, progress_m: self.projected_m(frame.driven_m) };
                self.phase = Phase::Braking;
            }
            Phase::Braking if self.vehicle.speed_mps == 0.0 => {
                frame.clearance_m = frame.clearance_m.min(self.body.clearance_m(self.map.distance_field(), pose));
                self.resume_on_path(frame.driven_m);
            }
            _ => {}
        }
    }

    /// Where the car is along the route, metres, after it drove so far since its progress was determined.
    fn projected_m(&self, driven_m: f32) -> f32 {
        let ahead_m = PROJECTED_M.max(driven_m + CUT_M);
        self.map.path().project_near_m(self.vehicle.pose.position(), self.progress_m, PROJECTED_M, ahead_m)
    }

    /// Puts the car at rest on the nearest point of what is left of the path from which it can drive, if there is one.
    fn resume_on_path(&mut self, driven_m: f32) {
        let path = self.map.path();
        let mut s_m = self.projected_m(driven_m);
        // At the finish it has arrived, whatever is there.
        while s_m < path.length_m() && !self.is_free_from(s_m) {
            s_m += 0.5;
            if s_m >= path.length_m() && !self.is_free_from(path.length_m()) {
                self.phase = Phase::Blocked;
                return;
            }
        }
        let s_m = s_m.min(path.length_m());
        self.vehicle = VehicleState::at_rest(path.pose_at(s_m));
        self.in_flight.clear();
        self.command = VehicleCommand::default();
        self.progress_m = s_m;
        self.advance = Advance { progress_m: s_m, physics_step: self.physics_step };
        self.counts_from_step = self.physics_step + self.settings.physics_steps(self.settings.metrics.refractory_s);
        self.touches = false;
        self.sensor.forget();
        self.was_reset = true;
        self.phase = Phase::Driving;
    }

    /// Whether the body is free when it follows the path for a few metres, and straight on for the near-collision range.
    fn is_free_from(&self, s_m: f32) -> bool {
        let (path, metrics) = (self.map.path(), &self.settings.metrics);
        let is_free = |pose: Pose| !self.map.collision().body_hits(&self.body, pose, metrics.obstacle_set);
        let start = path.pose_at(s_m);
        let steps = (metrics.resume_free_m / 0.25).ceil() as u32;
        (0..=steps).all(|i| is_free(path.pose_at(s_m + i as f32 * 0.25)))
            && is_free(start.advanced_along_arc(0.0, 0.5 * metrics.near_collision_m))
            && is_free(start.advanced_along_arc(0.0, metrics.near_collision_m))
    }

    /// Detects a stuck car and the finish.
    fn judge_progress(&mut self, frame: &mut Frame) {
        let Advance { progress_m: best_m, physics_step: since_step } = self.advance;
        let metrics = &self.settings.metrics;
        if self.progress_m >= best_m + metrics.stuck_progress_m {
            self.advance = Advance { progress_m: self.progress_m, physics_step: self.physics_step };
        } else if self.phase == Phase::Driving
            && self.physics_step - since_step >= self.settings.physics_steps(metrics.stuck_after_s)
        {
            frame.event = Event::Stuck { at: self.vehicle.pose, progress_m: self.progress_m };
            self.resume_on_path(0.0);
        }
        // The projection saturates at the end of the path.
        if self.progress_m >= self.map.path().length_m() - 1e-3 && frame.event == Event::Drove {
            frame.event = Event::ReachedEnd;
        }
    }

    fn judge_ending(&self, frame: &Frame) -> Option<Ending> {
        let metrics = &self.settings.metrics;
        if self.phase == Phase::Blocked {
            Some(Ending::Blocked)
        } else if self.progress_m >= self.map.path().length_m() - 1e-3 {
            Some(Ending::ReachedEnd)
        } else if self.events.len() >= metrics.events_max as usize {
            Some(Ending::TooManyEvents)
        } else if frame.time_s >= metrics.timeout_s {
            Some(Ending::TimedOut)
        } else {
            None
        }
    }
}

/// Drives an episode to its end with one driver.
pub fn run(mut episode: Episode, driver: &mut dyn Driver, sink: &mut dyn FrameSink) -> EpisodeReport {
    while episode.ending().is_none() {
        episode.observe();
        if episode.was_reset() {
            driver.reset();
        }
        let decision = driver.decide(&episode.situation());
        sink.frame(&episode.apply(decision));
    }
    episode.report().expect("it has ended")
}
