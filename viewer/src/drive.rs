//! A drive as shapes and signals, frame by frame.
//!
//! It only reads the frames of the closed loop. What a frame does not hold (the expert's answer beside the driver's, the
//! views behind the grid) is computed from the frame's state with copies of expert, network, planner and sensor, so that
//! a drive that is watched is the same drive.

use crate::colours::{self, Colour};
use crate::lot::{LINE_Z_M, outline, raised};
use crate::recording::Recording;
use crate::sensors::Sensors;
use crate::shapes::{self, Arrow, Block, Dot, Strip};
use experiment::settings::Settings;
use expert::{Inspection, Rule, ScriptedExpert};
use planners::Planner;
use planners::explanation::Explanation;
use policy::decision_rule::{DecisionRule, Evidence};
use policy::drivers::NetPolicy;
use policy::network::Prediction;
use rerun::{AsComponents, SeriesLines, StateChange, StateConfiguration, TextLog, TextLogLevel};
use sim::driver::{Decision, Driver as _, GroundTruth, LookAheadPoint, Policy as _, Situation, Source, Spread};
use sim::episode::{Episode, EpisodeSettings};
use sim::frame::{Event, Frame};
use sim::geometry::Vec2;
use sim::map::Map;
use sim::seed::Rng;
use std::f32::consts::TAU;
use std::sync::Arc;

/// Between two outlines of the swept path, metres.
const SWEPT_EVERY_M: f32 = 0.5;
/// Ticks from one picture to the next, candidates included: five a second.
const PICTURE_EVERY: u32 = 4;
/// Length of the arrow where a field is strongest, metres: the samples are as far apart.
const FIELD_M: f32 = 0.96;
/// Diameter and width of a wheel, metres.
const WHEEL_M: [f32; 2] = [0.66, 0.22];

/// The expert's rules.
const RULES: [(Rule, Colour); 4] = [
    (Rule::Far, colours::PLANNER),
    (Rule::Avoid, colours::RING),
    (Rule::Relaxed, colours::NOVICE),
    (Rule::LastResort, colours::FAILURE),
];

/// One drive being recorded.
pub(crate) struct Drive<'a> {
    recording: &'a Recording,
    root: String,
    map: Arc<Map>,
    episode: EpisodeSettings,
    rule: DecisionRule,
    /// A copy of the expert that watches.
    expert: ScriptedExpert,
    /// A copy of the network that watches while the expert drives.
    novice: Option<NetPolicy>,
    /// A copy of the planner that drives.
    planner: Option<Planner>,
    sensors: Sensors,
    time_s: f64,
    driver: Option<Source>,
    expert_rule: Option<Rule>,
    has_spread: bool,
    /// Colour of its signals and its trail among those of other drivers; `None` if it is alone.
    colour: Option<Colour>,
    /// Where the last outline of the swept path was drawn, and the path of the rear axle since.
    swept: Option<Vec2>,
    driven: Vec<Vec2>,
    failures: Vec<Dot>,
    was_reset: bool,
}

impl<'a> Drive<'a> {
    /// A drive that is about to begin. `root`: entity under which it is found; `hand`: the stream of the expert's jitter.
    pub(crate) fn new(recording: &'a Recording, root: &str, episode: &Episode, settings: &Settings, hand: Rng) -> Self {
        Self {
            recording,
            root: root.to_owned(),
            map: Arc::clone(episode.map()),
            episode: episode.settings().clone(),
            rule: settings.dagger.rule,
            expert: ScriptedExpert::new(settings.expert.clone(), &settings.episode, hand),
            novice: None,
            planner: None,
            sensors: Sensors::new(root, episode),
            time_s: 0.0,
            driver: None,
            expert_rule: None,
            has_spread: false,
            colour: None,
            swept: None,
            driven: Vec::new(),
            failures: Vec::new(),
            was_reset: true,
        }
    }

    /// Also shows what a network says while the expert drives.
    #[must_use]
    pub(crate) fn with_novice(self, novice: Option<NetPolicy>) -> Self {
        Self { novice, ..self }
    }

    /// Also shows what the planner that drives weighed.
    #[must_use]
    pub(crate) fn with_planner(self, planner: Option<Planner>) -> Self {
        Self { planner, ..self }
    }

    /// Tells its signals and its trail from those of other drivers in the same view.
    #[must_use]
    pub(crate) fn among_others(self, colour: Colour) -> Self {
        Self { colour: Some(colour), ..self }
    }

    /// Lets a frame pass that is not shown. Those who remember are asked all the same: what they say later follows from
    /// it.
    pub(crate) fn skip(&mut self, frame: &Frame) {
        self.ask_expert(frame, false);
        self.ask_novice(frame);
        self.ask_planner(frame, false);
        self.pass(frame);
    }

    /// Shows what does not change: the car, its ring, names and colours.
    pub(crate) fn show_static(&self) {
        let vehicle = &self.episode.vehicle;
        let block = |centre, size_m, colour| Block { centre, size_m, yaw_rad: 0.0, colour };
        let (rear_m, front_m) = (-vehicle.rear_overhang_m, vehicle.front_m());
        let from_to = |[from_m, to_m]: [f32; 2], width_m: f32, [low_m, high_m]: [f32; 2], colour| {
            let centre = [0.5 * (from_m + to_m), 0.0, 0.5 * (low_m + high_m)];
            block(centre, [to_m - from_m, width_m, high_m - low_m], colour)
        };
        let at = |share: f32| rear_m + share * vehicle.length_m;
        let body = [
            from_to([rear_m, front_m], vehicle.width_m, [0.3, 0.9], colours::CAR),
            from_to([at(0.14), at(0.68)], 0.86 * vehicle.width_m, [0.9, 1.35], colours::GLASS),
            from_to([at(0.22), at(0.56)], 0.8 * vehicle.width_m, [1.35, 1.42], colours::CAR),
        ];
        let half_track_m = 0.5 * vehicle.width_m - WHEEL_M[1];
        let wheel =
            |left_m: f32| block([0.0, left_m, 0.5 * WHEEL_M[0]], [WHEEL_M[0], WHEEL_M[1], WHEEL_M[0]], colours::TYRE);
        let bonnet = [[front_m - 0.9, 0.4], [front_m - 0.2, 0.0], [front_m - 0.9, -0.4]];
        let heading = bonnet.map(|[x, y]| [x, y, 0.95]).to_vec();
        self.log_static("car/body", &shapes::boxes(&body));
        self.log_static("car/heading", &shapes::strips(&[strip(heading, colours::TYRE)]));
        self.log_static("car/wheels/rear", &shapes::boxes(&[wheel(half_track_m), wheel(-half_track_m)]));
        for front in ["front_left", "front_right"] {
            self.log_static(&format!("car/wheels/{front}/tyre"), &shapes::boxes(&[wheel(0.0)]));
        }
        self.log_static("car/safe_ring", &shapes::strips(&[self.safe_ring()]));
        self.log_static("car/seen_patch", &shapes::strips(&[self.seen_patch()]));
        self.log_static("driver", &states(Source::ALL.map(|source| (source.name(), colours::of_source(source)))));
        self.log_static("expert_rule", &states(RULES.map(|(rule, colour)| (rule_name(rule), colour))));
        self.show_signals();
    }

    /// Shows a frame, when it was observed.
    pub(crate) fn frame(&mut self, frame: &Frame) {
        self.recording.at_tick(frame.tick, self.time_s);
        let is_picture = frame.tick.is_multiple_of(PICTURE_EVERY);
        self.car(frame);
        self.trace(frame);
        self.read_off(frame);
        let (expert, inspection) = self.ask_expert(frame, is_picture);
        self.compare(frame, expert);
        if let Some(inspection) = inspection {
            self.candidates(&inspection);
        }
        if let Some(explanation) = self.ask_planner(frame, is_picture) {
            self.weighed(&explanation);
        }
        if is_picture {
            self.sensors.show(&self.map, frame, self.recording);
        }
        self.happened(frame);
        self.pass(frame);
    }

    /// What the next frame has to know of this one.
    fn pass(&mut self, frame: &Frame) {
        self.was_reset = matches!(frame.event, Event::NearCollision { .. } | Event::Stuck { .. });
        self.time_s = f64::from(frame.time_s);
    }

    fn log(&self, entity: &str, shape: &impl AsComponents) {
        self.recording.log(&format!("{}/{entity}", self.root), shape);
    }

    fn log_static(&self, entity: &str, shape: &impl AsComponents) {
        self.recording.log_static(&format!("{}/{entity}", self.root), shape);
    }

    /// The car, its wheels, and where it is told to go.
    fn car(&self, frame: &Frame) {
        let (pose, vehicle) = (frame.vehicle.pose, &self.episode.vehicle);
        self.log("car", &shapes::pose([pose.x_m, pose.y_m, 0.0], pose.heading_rad));
        let half_track_m = 0.5 * vehicle.width_m - WHEEL_M[1];
        for (wheel, left_m) in [("front_left", half_track_m), ("front_right", -half_track_m)] {
            let wheel = format!("car/wheels/{wheel}");
            self.log(&wheel, &shapes::pose([vehicle.wheelbase_m, left_m, 0.0], frame.vehicle.steering_rad));
        }
        let decision = &frame.decision;
        let colour = colours::of_source(decision.source);
        let point = decision.look_ahead;
        self.log("car/look_ahead", &shapes::dots(&[dot(point, 6.0, colour)]));
        self.log("car/pursuit", &shapes::strips(&[pursuit(point, colour)]));
    }

    /// The way behind the car, piece by piece: the viewer shows all pieces up to the cursor.
    fn trace(&mut self, frame: &Frame) {
        let position = frame.vehicle.pose.position();
        if self.was_reset || self.swept.is_none() {
            (self.swept, self.driven) = (None, vec![position]);
        }
        if self.swept.is_some_and(|last| last.distance(position) < SWEPT_EVERY_M) {
            return;
        }
        self.swept = Some(position);
        self.driven.push(position);
        let world_from_ego = frame.vehicle.pose.world_from_ego();
        let body = self.episode.vehicle.body_in_ego().map(|corner| world_from_ego.point(corner));
        let colour = self.colour.unwrap_or_else(|| colours::of_source(frame.decision.source));
        let swept = Strip { radius_pt: 0.5, ..outline(&body, LINE_Z_M, colours::faded(colour, 110)) };
        self.log("swept", &shapes::strips(&[swept]));
        let way = self.driven.iter().map(|&point| raised(point, 2.0 * LINE_Z_M)).collect();
        self.log("driven", &shapes::strips(&[strip(way, colour)]));
        self.driven = vec![position];
    }

    /// Signals that frames hold, and who drives.
    fn read_off(&mut self, frame: &Frame) {
        let degrees = |steering_rad: f32| f64::from(steering_rad.to_degrees());
        let values = [
            ("steering/actual", degrees(frame.vehicle.steering_rad)),
            ("steering/commanded", degrees(frame.command.steering_rad)),
            ("speed/actual", f64::from(frame.vehicle.speed_mps)),
            ("speed/commanded", f64::from(frame.command.speed_mps)),
            ("distance/clearance", f64::from(frame.clearance_m)),
            ("distance/safe_ratio", f64::from(frame.safe_ratio)),
        ];
        for (name, value) in values {
            self.signal(name, value);
        }
        if self.driver != Some(frame.decision.source) {
            self.driver = Some(frame.decision.source);
            self.log("driver", &StateChange::single(frame.decision.source.name()));
        }
    }

    fn signal(&self, name: &str, value: f64) {
        self.recording.log_value(&format!("{}/signals/{name}", self.root), value);
    }

    /// What the expert would have said in the driver's place. It is asked at every tick, because it smooths its answers.
    fn ask_expert(&mut self, frame: &Frame, inspect: bool) -> (LookAheadPoint, Option<Inspection>) {
        if self.was_reset {
            self.expert.reset();
        }
        let truth = GroundTruth { map: &self.map, vehicle: frame.vehicle, progress_m: frame.progress_m };
        let situation = Situation { observation: &frame.observation, truth };
        if inspect {
            let (decision, inspection) = self.expert.inspect(&situation);
            (decision.look_ahead, Some(inspection))
        } else {
            (self.expert.decide(&situation).look_ahead, None)
        }
    }

    /// What the network would have said while the expert drove. It is asked at every tick, also when it drove itself,
    /// because it smooths its answers.
    fn ask_novice(&mut self, frame: &Frame) -> Option<Decision> {
        let novice = self.novice.as_mut()?;
        if self.was_reset {
            novice.reset();
        }
        Some(novice.act(&frame.observation))
    }

    /// What the planner weighed. It is asked at every tick, because it estimates its wheel angle.
    fn ask_planner(&mut self, frame: &Frame, explain: bool) -> Option<Explanation> {
        let planner = self.planner.as_mut()?;
        if self.was_reset {
            planner.reset();
        }
        planner.act(&frame.observation);
        if explain { planner.explain(&frame.observation) } else { None }
    }

    /// Candidate paths, the cheaper the brighter, the chosen one white; or the field that was followed.
    fn weighed(&self, explanation: &Explanation) {
        match explanation {
            Explanation::Paths(paths) => {
                let costs = paths.iter().map(|path| path.cost);
                let (low, high) = costs.fold((f32::MAX, f32::MIN), |(low, high), cost| (low.min(cost), high.max(cost)));
                let strips: Vec<Strip> = paths
                    .iter()
                    .map(|path| {
                        let share = (high - path.cost) / (high - low).max(f32::MIN_POSITIVE);
                        let points = path.points.iter().map(|&point| raised(point, 2.0 * LINE_Z_M)).collect();
                        if path.is_chosen {
                            strip(points, colours::CAR)
                        } else {
                            let colour = colours::faded(colours::PLANNER, 30 + (180.0 * share) as u8);
                            Strip { radius_pt: 0.5, ..strip(points, colour) }
                        }
                    })
                    .collect();
                self.log("car/candidates", &shapes::strips(&strips));
            }
            Explanation::Field(samples) => {
                let strongest = samples.iter().map(|sample| sample.field.length()).fold(f32::MIN_POSITIVE, f32::max);
                let arrows: Vec<Arrow> = samples
                    .iter()
                    .map(|sample| {
                        // Walls push many times as hard as the goal pulls: the square root keeps both visible.
                        let length_m = FIELD_M * (sample.field.length() / strongest).sqrt();
                        let [x, y] = (length_m * sample.field.normalize_or_zero()).to_array();
                        Arrow { from: raised(sample.at, 5.0 * LINE_Z_M), vector: [x, y, 0.0], colour: colours::FIELD }
                    })
                    .collect();
                self.log("car/field", &shapes::arrows(&arrows));
            }
        }
    }

    /// The answers of learner and expert side by side, how far they are apart (τ̂) and how sure the learner is (χ̂).
    fn compare(&mut self, frame: &Frame, expert: LookAheadPoint) {
        let driven = frame.decision;
        let said = self.ask_novice(frame);
        let (learner, expert) = if driven.source == Source::Expert {
            if let Some(said) = said {
                self.log("car/network_point", &shapes::dots(&[dot(said.look_ahead, 5.0, colours::NOVICE)]));
                // What was said while the other one drove.
                self.log("car/expert_point", &shapes::dots(&[]));
            }
            (said, driven.look_ahead)
        } else {
            self.log("car/expert_point", &shapes::dots(&[dot(expert, 5.0, colours::EXPERT)]));
            if said.is_some() {
                self.log("car/network_point", &shapes::dots(&[]));
            }
            (Some(driven), expert)
        };
        let Some(learner) = learner else { return };
        if let Some(spread) = learner.spread {
            self.doubt(learner.look_ahead, spread);
        }
        let geometry = &self.episode.sensing.geometry;
        let predicted = Prediction { mean: learner.look_ahead.to_image_fraction(geometry), sigma: [0.0; 2] };
        let evidence = Evidence::new(&predicted, expert.to_image_fraction(geometry));
        self.signal("discrepancy/tau_hat", f64::from(evidence.discrepancy));
        if let Some(tau) = self.rule.tau() {
            self.signal("discrepancy/threshold", f64::from(tau));
        }
    }

    /// The ellipses around the network's point, and χ̂ as the decision rule compares it.
    fn doubt(&mut self, point: LookAheadPoint, spread: Spread) {
        let (at, scale) = ([point.ahead_m, point.left_m, 0.1], [spread.ahead_m, spread.left_m, 1.0]);
        self.log("car/spread", &shapes::pose(at, 0.0).with_scale(scale));
        // Not static: without a pose they would lie around the car.
        if !std::mem::replace(&mut self.has_spread, true) {
            self.log("car/spread/ellipses", &shapes::strips(&[1.0, 2.0].map(circle)));
        }
        let side_m = self.episode.sensing.geometry.side_m;
        let sigma = [spread.left_m, spread.ahead_m].map(|metres| metres / side_m);
        let chi = self.rule.chi();
        let doubt = chi.map_or(sigma, |(_, chi_on)| chi_on.of(sigma));
        self.signal("doubt/across", f64::from(doubt[0]));
        self.signal("doubt/ahead", f64::from(doubt[1]));
        if let Some((chi, _)) = chi {
            self.signal("doubt/threshold", f64::from(chi));
        }
    }

    /// The expert's candidate arcs, the better the brighter, the plan it chose, and the rule behind it.
    fn candidates(&mut self, inspection: &Inspection) {
        let scores = inspection.candidates.iter().filter_map(|candidate| candidate.score);
        let (low, high) = scores.fold((f32::MAX, f32::MIN), |(low, high), score| (low.min(score), high.max(score)));
        let arcs: Vec<Strip> = inspection
            .candidates
            .iter()
            .map(|candidate| {
                let share = candidate.score.map_or(0.0, |score| (score - low) / (high - low).max(f32::MIN_POSITIVE));
                let colour = colours::faded(colours::EXPERT, 25 + (130.0 * share) as u8);
                Strip { radius_pt: 0.5, ..strip(arc(candidate.curvature_per_m, candidate.free_m), colour) }
            })
            .collect();
        self.log("car/expert_candidates", &shapes::strips(&arcs));
        let way = inspection.way.iter().step_by(2).map(|&point| raised(point, 3.0 * LINE_Z_M)).collect();
        self.log("expert_plan", &shapes::strips(&[strip(way, colours::EXPERT)]));
        if self.expert_rule != Some(inspection.rule) {
            self.expert_rule = Some(inspection.rule);
            self.log("expert_rule", &StateChange::single(rule_name(inspection.rule)));
        }
    }

    /// Events, in the log and where they happened.
    fn happened(&mut self, frame: &Frame) {
        let (what, at) = match frame.event {
            Event::Drove => return,
            Event::ReachedEnd => ("finish reached", None),
            Event::NearCollision { at, .. } => ("near-collision", Some(at)),
            Event::Stuck { at, .. } => ("stuck", Some(at)),
        };
        let Frame { tick, progress_m, .. } = frame;
        let text = format!("{}: {what} at tick {tick}, {progress_m:.1} m along the route", self.root);
        let level = if at.is_some() { TextLogLevel::WARN } else { TextLogLevel::INFO };
        self.log("events", &TextLog::new(text).with_level(level));
        if let Some(at) = at {
            self.failures.push(Dot {
                at: raised(at.world_from_ego().point(Vec2::new(self.episode.vehicle.front_m(), 0.0)), 1.5),
                radius_pt: 9.0,
                colour: colours::FAILURE,
                label: format!("{what}, tick {tick}"),
            });
            self.log("near_collisions", &shapes::dots(&self.failures));
        }
    }

    /// The range within which the safe ratio is measured: the body, grown on all sides.
    fn safe_ring(&self) -> Strip {
        let range_m = self.episode.metrics.safe_range_m;
        let body = self.episode.vehicle.body_in_ego();
        let quarter = |corner: Vec2, from_rad: f32| {
            (0..=6).map(move |i| corner + range_m * Vec2::from_angle(from_rad + i as f32 * TAU / 24.0))
        };
        // Counter-clockwise from the front left corner, whose quarter begins ahead.
        let ring: Vec<Vec2> =
            body.iter().enumerate().flat_map(|(i, &corner)| quarter(corner, i as f32 * TAU / 4.0)).collect();
        outline(&ring, LINE_Z_M, colours::RING)
    }

    fn seen_patch(&self) -> Strip {
        let geometry = &self.episode.sensing.geometry;
        let (near_m, far_m, half_m) = (geometry.near_edge_ahead_m, geometry.far_edge_ahead_m(), 0.5 * geometry.side_m);
        let corners = [[far_m, half_m], [near_m, half_m], [near_m, -half_m], [far_m, -half_m]].map(Vec2::from);
        Strip { radius_pt: 0.6, ..outline(&corners, LINE_Z_M, colours::PATCH) }
    }

    /// Names and colours of the signals.
    fn show_signals(&self) {
        let signal = |entity: &str, name: &str, colour: Colour| {
            let (name, colour) = match self.colour {
                Some(own) if colour == colours::FAINT => (format!("{name}: {}", self.root), colours::faded(own, 90)),
                Some(own) if colour != colours::FAILURE => (format!("{name}: {}", self.root), own),
                _ => (name.to_owned(), colour),
            };
            let line = SeriesLines::new().with_names([name]).with_colors([shapes::color(colour)]).with_widths([1.5]);
            self.log_static(&format!("signals/{entity}"), &line);
        };
        for (entity, name, colour) in [
            ("steering/commanded", "commanded", colours::FAINT),
            ("steering/actual", "road wheels", colours::RING),
            ("speed/commanded", "commanded", colours::FAINT),
            ("speed/actual", "driven", colours::RING),
            ("distance/clearance", "clearance", colours::PATCH),
            ("distance/safe_ratio", "safe ratio", colours::RING),
            ("discrepancy/tau_hat", "τ̂", colours::NOVICE),
            ("discrepancy/threshold", "τ", colours::FAILURE),
            ("doubt/across", "χ̂ across", colours::NOVICE),
            ("doubt/ahead", "χ̂ ahead", colours::PATCH),
            ("doubt/threshold", "χ", colours::FAILURE),
        ] {
            signal(entity, name, colour);
        }
    }
}

fn strip(points: Vec<[f32; 3]>, colour: Colour) -> Strip {
    Strip { points, radius_pt: 1.5, colour }
}

/// A point of the ego frame, over everything else.
fn dot(point: LookAheadPoint, radius_pt: f32, colour: Colour) -> Dot {
    Dot { at: [point.ahead_m, point.left_m, 0.15], radius_pt, colour, label: String::new() }
}

/// The arc to a look-ahead point that pure pursuit follows.
fn pursuit(point: LookAheadPoint, colour: Colour) -> Strip {
    let curvature_per_m = point.curvature_per_m();
    let chord_m = point.ahead_m.hypot(point.left_m);
    // Chord and arc of a circle: 2 asin(κ c / 2) / κ.
    let half = 0.5 * curvature_per_m * chord_m;
    let length_m = if half.abs() < 1e-3 { chord_m } else { 2.0 * half.clamp(-1.0, 1.0).asin() / curvature_per_m };
    Strip { radius_pt: 1.0, ..strip(arc(curvature_per_m, length_m), colours::faded(colour, 200)) }
}

/// An arc of the rear axle in the ego frame, about a point per metre.
fn arc(curvature_per_m: f32, length_m: f32) -> Vec<[f32; 3]> {
    let steps = (length_m.ceil() as u32).clamp(1, 16);
    let at = |i| sim::geometry::Pose::default().advanced_along_arc(curvature_per_m, length_m * i as f32 / steps as f32);
    (0..=steps).map(|i| raised(at(i).position(), 2.0 * LINE_Z_M)).collect()
}

/// A circle that the pose of its entity stretches to an ellipse.
fn circle(radius: f32) -> Strip {
    let points = (0..=32).map(|i| raised(radius * Vec2::from_angle(i as f32 * TAU / 32.0), 0.0)).collect();
    Strip { points, radius_pt: if radius == 1.0 { 1.2 } else { 0.7 }, colour: colours::NOVICE }
}

/// Names and colours of states.
fn states<const N: usize>(states: [(&str, Colour); N]) -> StateConfiguration {
    StateConfiguration::new()
        .with_values(states.map(|(name, _)| name))
        .with_colors(states.map(|(_, colour)| shapes::color(colour)))
}

fn rule_name(rule: Rule) -> &'static str {
    match rule {
        Rule::Far => "3: as far as possible",
        Rule::Avoid => "2: avoid",
        Rule::Relaxed => "2: avoid, less clearance",
        Rule::LastResort => "last resort",
    }
}
