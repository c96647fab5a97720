//! A drive as shapes: made from the frames of the closed loop, and from nothing else.
//!
//! The loop knows nothing of it. What a frame does not hold — the expert's answer beside the driver's, the view behind
//! the grid — is worked out again from the frame's state, with copies that nobody else uses.

use super::colours;
use super::lot::{LINE_Z_M, outline, raised};
use super::sensors::{self, Sensors};
use crate::drivers;
use crate::settings::Settings;
use expert::{Inspection, Rule, ScriptedExpert};
use planners::Planner;
use planners::explanation::Explanation;
use policy::decision_rule::{DecisionRule, Evidence};
use policy::drivers::NetPolicy;
use policy::network::Prediction;
use protocol::{Arrow, Block, Clock, Colour, Dot, Mark, Pose, Shape, Strip};
use sim::driver::{Driver as _, GroundTruth, LookAheadPoint, Policy as _, Situation, Source, Spread};
use sim::episode::{Episode, EpisodeSettings};
use sim::frame::{Event, Frame};
use sim::geometry::Vec2;
use sim::map::Map;
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

/// How much of a drive is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// What frames hold: costs next to nothing.
    Frames,
    /// Also what the expert would have done, what was weighed and the full views: costs more than driving.
    Everything,
}

/// One drive being recorded.
pub struct Drive {
    root: String,
    map: Arc<Map>,
    episode: EpisodeSettings,
    rule: DecisionRule,
    /// A copy of the teacher that watches.
    expert: Option<ScriptedExpert>,
    /// A copy of the network that watches while the teacher drives.
    novice: Option<NetPolicy>,
    /// A copy of the planner that drives.
    planner: Option<Planner>,
    sensors: Option<Sensors>,
    time_s: f64,
    driver: Option<Source>,
    expert_rule: Option<Rule>,
    has_spread: bool,
    /// Colour of its signals among those of other drivers; `None` if it is alone.
    colour: Option<Colour>,
    /// Where the last outline of the swept path was drawn, and the way of the rear axle since.
    swept: Option<Vec2>,
    driven: Vec<Vec2>,
    failures: Vec<Dot>,
    was_reset: bool,
}

impl Drive {
    /// A drive that is about to begin. `root`: entity under which it is found.
    pub fn new(root: &str, episode: &Episode, settings: &Settings, detail: Detail) -> Self {
        let is_full = detail == Detail::Everything;
        Self {
            root: root.to_owned(),
            map: Arc::clone(episode.map()),
            episode: episode.settings().clone(),
            rule: settings.dagger.rule,
            expert: is_full.then(|| drivers::expert(settings)),
            novice: None,
            planner: None,
            sensors: is_full.then(|| Sensors::new(root, episode)),
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
    pub fn with_novice(self, novice: NetPolicy) -> Self {
        Self { novice: Some(novice), ..self }
    }

    /// Also shows what the planner that drives weighed.
    #[must_use]
    pub fn with_planner(self, planner: Option<Planner>) -> Self {
        Self { planner, ..self }
    }

    /// Tells its signals from those of other drivers in the same plot.
    #[must_use]
    pub fn among_others(self, colour: Colour) -> Self {
        Self { colour: Some(colour), ..self }
    }

    /// Lets a frame pass that is not shown.
    pub fn skip(&mut self, frame: &Frame) {
        self.time_s = f64::from(frame.time_s);
    }

    /// What does not change: the car, its ring, names and colours.
    pub fn always(&self) -> Vec<Mark> {
        let vehicle = &self.episode.vehicle;
        let middle_m = 0.5 * (vehicle.front_m() - vehicle.rear_overhang_m);
        let body = Block {
            centre: [middle_m, 0.0, 0.75],
            size_m: [vehicle.length_m, vehicle.width_m, 1.3],
            yaw_rad: 0.0,
            is_round: false,
            colour: colours::faded(colours::CAR, 70),
        };
        let half_track_m = 0.5 * vehicle.width_m - WHEEL_M[1];
        let wheel = |ahead_m: f32, left_m: f32| Block {
            centre: [ahead_m, left_m, 0.5 * WHEEL_M[0]],
            size_m: [WHEEL_M[0], WHEEL_M[1], WHEEL_M[0]],
            yaw_rad: 0.0,
            is_round: false,
            colour: colours::TYRE,
        };
        let nose = vehicle.front_m();
        let heading = [[nose - 0.9, 0.5], [nose - 0.1, 0.0], [nose - 0.9, -0.5]].map(|[x, y]| [x, y, 1.45]);
        let mut marks = vec![
            self.mark("car/body", Shape::Blocks(vec![body])),
            self.mark("car/heading", Shape::Strips(vec![strip(heading.to_vec(), colours::CAR)])),
            self.mark("car/wheels/rear", Shape::Blocks(vec![wheel(0.0, half_track_m), wheel(0.0, -half_track_m)])),
            self.mark("car/wheels/front_left/tyre", Shape::Blocks(vec![wheel(0.0, 0.0)])),
            self.mark("car/wheels/front_right/tyre", Shape::Blocks(vec![wheel(0.0, 0.0)])),
            self.mark("car/safe_ring", Shape::Strips(vec![self.safe_ring()])),
            self.mark("car/seen_patch", Shape::Strips(vec![self.seen_patch()])),
            self.mark("driver", Shape::States(driver_states())),
        ];
        marks.extend(self.signals());
        if self.expert.is_some() {
            marks.push(self.mark("expert_rule", Shape::States(rule_states())));
        }
        marks
    }

    /// What a frame shows, when it was observed.
    pub fn frame(&mut self, frame: &Frame) -> (Clock, Vec<Mark>) {
        let clock = Clock::Episode { tick: i64::from(frame.tick), time_s: self.time_s };
        let is_picture = frame.tick.is_multiple_of(PICTURE_EVERY);
        let mut marks = Vec::with_capacity(32);
        self.car(frame, &mut marks);
        self.trace(frame, &mut marks);
        self.read_off(frame, &mut marks);
        let expert = self.ask_expert(frame, is_picture);
        self.compare(frame, expert.as_ref().map(|(point, _)| *point), &mut marks);
        if let Some((_, Some(inspection))) = expert {
            self.candidates(&inspection, &mut marks);
        }
        if let Some(explanation) = self.ask_planner(frame, is_picture) {
            marks.push(self.weighed(&explanation));
        }
        if is_picture {
            match &self.sensors {
                Some(sensors) => marks.extend(sensors.look(&self.map, frame)),
                None => marks.push(sensors::shown(&self.root, frame)),
            }
        }
        self.happened(frame, &mut marks);
        self.was_reset = matches!(frame.event, Event::NearCollision { .. } | Event::Stuck { .. });
        self.time_s = f64::from(frame.time_s);
        (clock, marks)
    }

    fn mark(&self, entity: &str, shape: Shape) -> Mark {
        Mark::new(format!("{}/{entity}", self.root), shape)
    }

    /// The car, its wheels, and where it is told to go.
    fn car(&self, frame: &Frame, marks: &mut Vec<Mark>) {
        let (pose, vehicle) = (frame.vehicle.pose, &self.episode.vehicle);
        let at = |at, yaw_rad| Shape::Pose(Pose { at, yaw_rad, scale: [1.0; 3] });
        marks.push(self.mark("car", at([pose.x_m, pose.y_m, 0.0], pose.heading_rad)));
        let half_track_m = 0.5 * vehicle.width_m - WHEEL_M[1];
        for (wheel, left_m) in [("front_left", half_track_m), ("front_right", -half_track_m)] {
            let wheel = format!("car/wheels/{wheel}");
            marks.push(self.mark(&wheel, at([vehicle.wheelbase_m, left_m, 0.0], frame.vehicle.steering_rad)));
        }
        let decision = &frame.decision;
        let colour = colours::of_source(decision.source);
        let point = decision.look_ahead;
        marks.push(self.mark("car/look_ahead", Shape::Dots(vec![dot(point, 6.0, colour)])));
        marks.push(self.mark("car/pursuit", Shape::Strips(vec![pursuit(point, colour)])));
    }

    /// The way behind the car. Each mark is a piece: the viewer shows all up to the cursor.
    fn trace(&mut self, frame: &Frame, marks: &mut Vec<Mark>) {
        let position = frame.vehicle.pose.position();
        if self.was_reset {
            (self.swept, self.driven) = (None, vec![position]);
        }
        if self.swept.is_some_and(|last| last.distance(position) < SWEPT_EVERY_M) {
            return;
        }
        self.swept = Some(position);
        self.driven.push(position);
        let world_from_ego = frame.vehicle.pose.world_from_ego();
        let body = self.episode.vehicle.body_in_ego().map(|corner| world_from_ego.point(corner));
        let colour = colours::of_source(frame.decision.source);
        let swept = Strip { radius_pt: 0.5, ..outline(&body, LINE_Z_M, colours::faded(colour, 110)) };
        marks.push(self.mark("swept", Shape::Strips(vec![swept])));
        let way = self.driven.iter().map(|&point| raised(point, 2.0 * LINE_Z_M)).collect();
        marks.push(self.mark("driven", Shape::Strips(vec![strip(way, colour)])));
        self.driven = vec![position];
    }

    /// Signals that frames hold, and who drives.
    fn read_off(&mut self, frame: &Frame, marks: &mut Vec<Mark>) {
        let degrees = |steering_rad: f32| f64::from(steering_rad.to_degrees());
        let values = [
            ("steering/actual", degrees(frame.vehicle.steering_rad)),
            ("steering/commanded", degrees(frame.command.steering_rad)),
            ("speed/actual", f64::from(frame.vehicle.speed_mps)),
            ("speed/commanded", f64::from(frame.command.speed_mps)),
            ("distance/clearance", f64::from(frame.clearance_m)),
            ("distance/safe_ratio", f64::from(frame.safe_ratio)),
        ];
        marks.extend(values.map(|(name, value)| self.signal(name, value)));
        if self.driver != Some(frame.decision.source) {
            self.driver = Some(frame.decision.source);
            marks.push(self.mark("driver", Shape::State(driver_name(frame.decision.source).to_owned())));
        }
    }

    fn signal(&self, name: &str, value: f64) -> Mark {
        self.mark(&format!("signals/{name}"), Shape::Value(value))
    }

    /// What the expert would have said in the driver's place. It is asked at every tick, for it steadies its answers.
    fn ask_expert(&mut self, frame: &Frame, inspect: bool) -> Option<(LookAheadPoint, Option<Inspection>)> {
        let expert = self.expert.as_mut()?;
        if self.was_reset {
            expert.reset();
        }
        let truth = GroundTruth { map: &self.map, vehicle: frame.vehicle, progress_m: frame.progress_m };
        let situation = Situation { observation: &frame.observation, truth };
        Some(if inspect {
            let (decision, inspection) = expert.inspect(&situation);
            (decision.look_ahead, Some(inspection))
        } else {
            (expert.decide(&situation).look_ahead, None)
        })
    }

    /// What the planner weighed. It is asked at every tick, for it estimates its wheels.
    fn ask_planner(&mut self, frame: &Frame, explain: bool) -> Option<Explanation> {
        let planner = self.planner.as_mut()?;
        if self.was_reset {
            planner.reset();
        }
        planner.act(&frame.observation);
        if explain { planner.explain(&frame.observation) } else { None }
    }

    /// Candidate paths, the cheaper the brighter, the chosen one white; or the field that was followed.
    fn weighed(&self, explanation: &Explanation) -> Mark {
        match explanation {
            Explanation::Paths(paths) => {
                let costs = paths.iter().map(|path| path.cost);
                let (low, high) = costs.fold((f32::MAX, f32::MIN), |(low, high), cost| (low.min(cost), high.max(cost)));
                let strips = paths.iter().map(|path| {
                    let share = (high - path.cost) / (high - low).max(f32::MIN_POSITIVE);
                    let points = path.points.iter().map(|&point| raised(point, 2.0 * LINE_Z_M)).collect();
                    if path.is_chosen {
                        strip(points, colours::CAR)
                    } else {
                        let colour = colours::faded(colours::PLANNER, 30 + (180.0 * share) as u8);
                        Strip { radius_pt: 0.5, ..strip(points, colour) }
                    }
                });
                self.mark("car/candidates", Shape::Strips(strips.collect()))
            }
            Explanation::Field(samples) => {
                let strongest = samples.iter().map(|sample| sample.field.length()).fold(f32::MIN_POSITIVE, f32::max);
                let arrows = samples.iter().map(|sample| {
                    // Walls push many times as hard as the goal pulls: the root keeps both to be seen.
                    let length_m = FIELD_M * (sample.field.length() / strongest).sqrt();
                    let [x, y] = (length_m * sample.field.normalize_or_zero()).to_array();
                    Arrow { from: raised(sample.at, 5.0 * LINE_Z_M), vector: [x, y, 0.0], colour: colours::FIELD }
                });
                self.mark("car/field", Shape::Arrows(arrows.collect()))
            }
        }
    }

    /// The answers of learner and expert side by side, how far they are apart (τ̂) and how sure the learner is (χ̂).
    fn compare(&mut self, frame: &Frame, expert: Option<LookAheadPoint>, marks: &mut Vec<Mark>) {
        let driven = frame.decision;
        // It is asked every tick, also when it drove itself: it remembers.
        let said = self.novice.as_mut().map(|novice| {
            if self.was_reset {
                novice.reset();
            }
            novice.act(&frame.observation)
        });
        let (learner, expert) = if driven.source == Source::Expert {
            let point = said.map(|said| Shape::Dots(vec![dot(said.look_ahead, 5.0, colours::NOVICE)]));
            marks.extend(point.map(|point| self.mark("car/network_point", point)));
            (said, Some(driven.look_ahead))
        } else {
            let point = expert.map(|point| Shape::Dots(vec![dot(point, 5.0, colours::EXPERT)]));
            marks.extend(point.map(|point| self.mark("car/expert_point", point)));
            (Some(driven), expert)
        };
        let Some(learner) = learner else { return };
        if let Some(spread) = learner.spread {
            self.doubt(learner.look_ahead, spread, marks);
        }
        if let Some(expert) = expert {
            let geometry = &self.episode.sensing.geometry;
            let predicted = Prediction { mean: learner.look_ahead.to_image_fraction(geometry), sigma: [0.0; 2] };
            let evidence = Evidence::new(&predicted, expert.to_image_fraction(geometry));
            marks.push(self.signal("discrepancy/tau_hat", f64::from(evidence.discrepancy)));
            marks.extend(self.tau().map(|tau| self.signal("discrepancy/threshold", f64::from(tau))));
        }
    }

    /// The ellipses around the network's point, and χ̂ as the decision rule compares it.
    fn doubt(&mut self, point: LookAheadPoint, spread: Spread, marks: &mut Vec<Mark>) {
        let (at, scale) = ([point.ahead_m, point.left_m, 0.1], [spread.ahead_m, spread.left_m, 1.0]);
        marks.push(self.mark("car/spread", Shape::Pose(Pose { at, yaw_rad: 0.0, scale })));
        // Not static: without a pose they would lie around the car.
        if !std::mem::replace(&mut self.has_spread, true) {
            marks.push(self.mark("car/spread/ellipses", Shape::Strips([1.0, 2.0].map(circle).to_vec())));
        }
        let side_m = self.episode.sensing.geometry.side_m;
        let sigma = [spread.left_m, spread.ahead_m].map(|metres| metres / side_m);
        let (doubt, chi) = match self.rule {
            DecisionRule::AllBelow { chi, chi_on, .. } | DecisionRule::AnyBelowLiteral { chi, chi_on, .. } => {
                (chi_on.of(sigma), Some(chi))
            }
            DecisionRule::TauOnly { .. } | DecisionRule::ExpertOnly => (sigma, None),
        };
        marks.push(self.signal("doubt/across", f64::from(doubt[0])));
        marks.push(self.signal("doubt/ahead", f64::from(doubt[1])));
        marks.extend(chi.map(|chi| self.signal("doubt/threshold", f64::from(chi))));
    }

    fn tau(&self) -> Option<f32> {
        match self.rule {
            DecisionRule::AllBelow { tau, .. }
            | DecisionRule::AnyBelowLiteral { tau, .. }
            | DecisionRule::TauOnly { tau } => Some(tau),
            DecisionRule::ExpertOnly => None,
        }
    }

    /// The expert's candidate arcs, the better the brighter, the plan it chose, and the rule behind it.
    fn candidates(&mut self, inspection: &Inspection, marks: &mut Vec<Mark>) {
        let scores = inspection.candidates.iter().filter_map(|candidate| candidate.score);
        let (low, high) = scores.fold((f32::MAX, f32::MIN), |(low, high), score| (low.min(score), high.max(score)));
        let arcs = inspection.candidates.iter().map(|candidate| {
            let share = candidate.score.map_or(0.0, |score| (score - low) / (high - low).max(f32::MIN_POSITIVE));
            let colour = colours::faded(colours::EXPERT, 25 + (130.0 * share) as u8);
            Strip { radius_pt: 0.5, ..strip(arc(candidate.curvature_per_m, candidate.free_m), colour) }
        });
        marks.push(self.mark("car/expert_candidates", Shape::Strips(arcs.collect())));
        let way = inspection.way.iter().step_by(2).map(|&point| raised(point, 3.0 * LINE_Z_M)).collect();
        marks.push(self.mark("expert_plan", Shape::Strips(vec![strip(way, colours::EXPERT)])));
        if self.expert_rule != Some(inspection.rule) {
            self.expert_rule = Some(inspection.rule);
            marks.push(self.mark("expert_rule", Shape::State(rule_name(inspection.rule).to_owned())));
        }
    }

    /// Events, in the log and where they happened.
    fn happened(&mut self, frame: &Frame, marks: &mut Vec<Mark>) {
        let (what, at) = match frame.event {
            Event::Drove => return,
            Event::ReachedEnd => ("finish reached", None),
            Event::NearCollision { at, .. } => ("near-collision", Some(at)),
            Event::Stuck { at, .. } => ("stuck", Some(at)),
        };
        let Frame { tick, progress_m, .. } = frame;
        let text = format!("{}: {what} at tick {tick}, {progress_m:.1} m along the route", self.root);
        marks.push(self.mark("events", Shape::Line { text, is_warning: at.is_some() }));
        if let Some(at) = at {
            self.failures.push(Dot {
                at: raised(at.world_from_ego().point(Vec2::new(self.episode.vehicle.front_m(), 0.0)), 1.5),
                radius_pt: 9.0,
                colour: colours::FAILURE,
                label: format!("{what}, tick {tick}"),
            });
            marks.push(self.mark("near_collisions", Shape::Dots(self.failures.clone())));
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
    fn signals(&self) -> Vec<Mark> {
        let signal = |entity: &str, name: &str, colour: Colour| {
            let (name, colour) = match self.colour {
                Some(own) if colour == colours::FAINT => (format!("{name}: {}", self.root), colours::faded(own, 90)),
                Some(own) if colour != colours::FAILURE => (format!("{name}: {}", self.root), own),
                _ => (name.to_owned(), colour),
            };
            self.mark(&format!("signals/{entity}"), Shape::Signal { name, colour, dotted: false })
        };
        vec![
            signal("steering/commanded", "commanded", colours::FAINT),
            signal("steering/actual", "road wheels", colours::RING),
            signal("speed/commanded", "commanded", colours::FAINT),
            signal("speed/actual", "driven", colours::RING),
            signal("distance/clearance", "clearance", colours::PATCH),
            signal("distance/safe_ratio", "safe ratio", colours::RING),
            signal("discrepancy/tau_hat", "τ̂", colours::NOVICE),
            signal("discrepancy/threshold", "τ", colours::FAILURE),
            signal("doubt/across", "χ̂ across", colours::NOVICE),
            signal("doubt/ahead", "χ̂ ahead", colours::PATCH),
            signal("doubt/threshold", "χ", colours::FAILURE),
        ]
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

fn driver_name(source: Source) -> &'static str {
    match source {
        Source::Expert => "expert",
        Source::Novice => "network",
        Source::Planner => "planner",
    }
}

fn driver_states() -> Vec<(String, Colour)> {
    [Source::Expert, Source::Novice, Source::Planner]
        .map(|source| (driver_name(source).to_owned(), colours::of_source(source)))
        .to_vec()
}

fn rule_name(rule: Rule) -> &'static str {
    match rule {
        Rule::Far => "3: as far as possible",
        Rule::Avoid => "2: avoid",
        Rule::Relaxed => "2: avoid, less clearance",
        Rule::LastResort => "last resort",
    }
}

fn rule_states() -> Vec<(String, Colour)> {
    [
        (Rule::Far, colours::PLANNER),
        (Rule::Avoid, colours::RING),
        (Rule::Relaxed, colours::NOVICE),
        (Rule::LastResort, colours::FAILURE),
    ]
    .map(|(rule, colour)| (rule_name(rule).to_owned(), colour))
    .to_vec()
}
