//! The scripted expert: stands in for the person who labels, with the paper's three rules.
//!
//! 1. The look-ahead point lies inside drivable space.
//! 2. With an obstacle ahead, it is a point from which the obstacle can be avoided, the one with the fewest obstacles
//!    around the way to it.
//! 3. Otherwise it lies as far ahead as possible inside drivable space.
//!
//! The paper gives no more detail. Here, a decision takes four steps, each in a file:
//!
//! - `search`: plans of two arcs each (`fan`), forecast with the car's body and the speed of its steering (`rollout`);
//!   the best one says whether, where and with how much clearance what is ahead can be avoided (rule two);
//! - `elastic_band`: the way of that plan, pulled into the middle of the free space, so that it no longer depends on
//!   which plan it came from;
//! - `label`: the point on that way, at a share of what is open of it (rule three; half where the paper's "half for safety
//!   reasons" is one of the point and not of the speed, see [`sim::controller::SpeedLaw`]), drivable (rule one), and
//!   smoothed from tick to tick;
//! - `stats`: which rule it was.
//!
//! Where the numbers come from is in docs/methods.md 3 and E5. The expert decides from the clean scene around the car.
//! The route has one purpose: a plan that turns back is refused. The same situation and memory give the same bytes.
//!
//! [`GridExpert`] decides by the same steps from the noisy grid alone, as a policy.

mod context;
mod elastic_band;
mod fan;
mod label;
mod line_of_sight;
mod on_grid;
mod rollout;
mod search;
mod settings;
mod stats;

pub use elastic_band::SPACING_M as WAY_SPACING_M;
pub use on_grid::GridExpert;
pub use rollout::STEP_TURN_MAX_RAD;
pub use search::Candidate;
pub use settings::{ExpertSettings, PlanWeights, Sees};
use sim::maths;
pub use stats::{ExpertStats, Rule};

use context::{ExpertContext, Scene};
use elastic_band::ElasticBand;
use label::{Ground, Label};
use line_of_sight::LineOfSight;
use rand::Rng as _;
use rollout::{Footprint, Motion};
use search::{Arcs, Plan, Search};
use sim::driver::{Decision, Driver, LookAheadPoint, Situation, Source};
use sim::episode::EpisodeSettings;
use sim::geometry::Vec2;
use sim::seed::Rng;
use sim::vehicle::VehicleState;
use std::cell::OnceCell;
use std::collections::VecDeque;

/// Consecutive labels farther apart than this count as a jump, metres.
const JUMP_M: f32 = 1.0;
/// Ranges at which steering at the smoothed way is tried, from the open one to the nearest.
const RANGES: usize = 5;

/// The expert at the wheel.
#[derive(Debug, Clone)]
pub struct ScriptedExpert {
    settings: ExpertSettings,
    context: ExpertContext,
    footprint: Footprint,
    arcs: Arcs,
    /// The last decision: the expert's only memory while delay and jitter are off.
    last: Option<Label>,
    /// Points decided but not yet answered (reaction delay).
    delayed: VecDeque<LookAheadPoint>,
    hand: Rng,
    stats: ExpertStats,
    inspection: Option<Inspection>,
}

/// How a decision was reached.
#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    /// Which rule fired.
    pub rule: Rule,
    /// Clearance the plan keeps, metres; `None` for a last resort.
    pub clearance_m: Option<f32>,
    /// Every first arc, straight on first and then ever tighter, left before right.
    pub candidates: Vec<Candidate>,
    /// Which of them was chosen.
    pub chosen: usize,
    /// Way of the rear axle along the chosen plan, world.
    pub way: Vec<Vec2>,
    /// The point before it was smoothed, ego frame.
    pub wanted: LookAheadPoint,
    /// The point decided on, ego frame.
    pub decided: LookAheadPoint,
}

/// What the rules ask for, before it is smoothed.
#[derive(Debug, Clone, Copy)]
struct Wish {
    label: Label,
    rule: Rule,
    has_failed: bool,
}

impl ScriptedExpert {
    /// An expert for the vehicle, camera and controller of an episode. `hand` is the stream its label jitter is drawn from,
    /// of [`Stream::Expert`](sim::seed::Stream::Expert); nothing is drawn while the jitter is off.
    pub fn new(settings: ExpertSettings, episode: &EpisodeSettings, hand: Rng) -> Self {
        let footprint = Footprint::new(&episode.vehicle, settings.nose_margin_m, settings.disc_relief_m);
        Self {
            arcs: Arcs::new(&settings, footprint.nose_m()),
            footprint,
            context: ExpertContext::of(episode),
            last: None,
            delayed: VecDeque::new(),
            hand,
            stats: ExpertStats::default(),
            inspection: None,
            settings,
        }
    }

    /// Counts since the expert was made.
    pub fn stats(&self) -> &ExpertStats {
        &self.stats
    }

    /// The settings.
    pub fn settings(&self) -> &ExpertSettings {
        &self.settings
    }

    /// Decides and explains the decision. Takes several times as long as deciding: every first arc is followed.
    pub fn inspect(&mut self, situation: &Situation<'_>) -> (Decision, Inspection) {
        self.inspection = Some(Inspection::empty());
        let decision = self.decide(situation);
        let inspection = self.inspection.take().unwrap_or_else(Inspection::empty);
        (decision, inspection)
    }

    /// The three rules.
    fn wish(&self, scene: &Scene<'_>, sight: &LineOfSight, mut inspection: Option<&mut Inspection>) -> Wish {
        let search = Search {
            settings: &self.settings,
            context: &self.context,
            footprint: &self.footprint,
            arcs: &self.arcs,
            scene,
            sight,
            start: self.when_obeyed(scene.vehicle),
            start_progress_m: OnceCell::new(),
            last_index: self.last.map(|last| last.index(&self.settings)),
        };
        let ground = self.ground(scene, sight);

        // Rule two: a point from which avoidance is possible — with the comfortable clearance, or with less.
        let mut best: Option<(usize, Plan)> = None;
        for (level, &clearance_m) in self.settings.clearances_m.iter().enumerate() {
            let mut candidates = Vec::new();
            let plan = search.best_plan(clearance_m, inspection.is_some().then_some(&mut candidates));
            let is_better = plan.is_some_and(|plan| best.is_none_or(|(_, best)| plan.free_m > best.free_m));
            if let Some(plan) = plan.filter(|_| is_better) {
                best = Some((level, plan));
            }
            // Those of the plan that is driven; where there is none, of the last level.
            if let Some(inspection) = inspection.as_mut().filter(|_| is_better || best.is_none()) {
                inspection.candidates = candidates;
            }
            if best.is_some_and(|(_, best)| best.free_m >= self.settings.avoidable_m) {
                break;
            }
        }

        let (chosen, clearance_m, wish) = if let Some((level, plan)) = best {
            // Rule three: as far as possible, or a share of that (`reach_share`).
            let label = self.smoothed(&search, &ground, &plan);
            let rule = match level {
                0 if plan.first_free_m >= self.settings.obstacle_ahead_m => Rule::Far,
                0 => Rule::Avoid,
                _ => Rule::Relaxed,
            };
            if let Some(inspection) = &mut inspection {
                inspection.way = search.way(&plan, elastic_band::SPACING_M).collect();
            }
            (plan.first, Some(self.settings.clearances_m[level]), Wish { label, rule, has_failed: false })
        } else {
            let (first, gap_m) = search.widest_gap();
            let label = ground.nearest_label_on(self.arcs.curvature_per_m(first));
            (first, None, Wish { label, rule: Rule::LastResort, has_failed: gap_m < 0.0 })
        };
        if let Some(inspection) = &mut inspection {
            (inspection.chosen, inspection.clearance_m, inspection.rule) = (chosen, clearance_m, wish.rule);
            inspection.wanted = wish.label.point();
        }
        wish
    }

    /// The label on the smoothed way: at a share of what is open of it (`reach_share`), steering at the farthest
    /// point that it is safe to steer at; in corners, and where pursuing the way is never safe, the plan's own arc.
    ///
    /// Every share fades to 0 gradually, so a small change of the scene moves the label little.
    fn smoothed(&self, search: &Search<'_>, ground: &Ground<'_>, plan: &Plan) -> Label {
        let mut band = ElasticBand::along(search.way(plan, elastic_band::SPACING_M), search.start.ahead);
        band.relax(search.ground(), &self.settings.elastic_band);
        let open_m = ground.open_way_m(&band);
        let settings = &self.settings.elastic_band;
        // From the preferred range to the nearest, each takes the share it deserves of what is left.
        let near_m = settings.steer_near_m;
        let turn_rad = search.scene.vehicle.pose.ahead().angle_to(band.heading_at(settings.steer_m)).abs();
        let bent = (turn_rad / settings.steer_bend_rad).min(1.0);
        let steer_m = (settings.steer_m + bent * (near_m - settings.steer_m)).min(open_m);
        let (mut rest, mut curvature_per_m) = (1.0, 0.0);
        for i in 0..RANGES {
            let range_m = steer_m + (near_m - steer_m) * i as f32 / (RANGES - 1) as f32;
            let share = rest * search.trust(&band, range_m);
            curvature_per_m += share * ground.label_at(band.at(range_m)).curvature_per_m;
            rest -= share;
            if rest <= 0.0 {
                break;
            }
        }
        curvature_per_m += rest * self.arcs.curvature_per_m(plan.first);
        let front_m = self.context.vehicle.front_m();
        let arc_length_m = front_m + (settings.reach_share * (open_m - front_m)).min(settings.reach_max_m);
        ground.kept_drivable(Label { curvature_per_m, arc_length_m })
    }

    /// The car when it begins to obey: the dead time further on, steering at the last label meanwhile.
    fn when_obeyed(&self, state: VehicleState) -> Motion {
        let vehicle = &self.context.vehicle;
        let curvature_per_m = state.curvature_per_m(vehicle);
        let motion = Motion::new(state.pose, curvature_per_m);
        let dead_time_s = vehicle.dead_time_s;
        let change_per_m = vehicle.steering_rate_max_radps / vehicle.wheelbase_m * dead_time_s;
        let pending_per_m = self.last.map_or(curvature_per_m, |last| last.curvature_per_m);
        motion.step(pending_per_m, change_per_m, state.speed_mps * dead_time_s)
    }

    fn ground<'a>(&'a self, scene: &'a Scene<'a>, sight: &'a LineOfSight) -> Ground<'a> {
        Ground { settings: &self.settings, context: &self.context, scene, sight }
    }

    /// Adds the reaction delay and the jitter of a human hand; both are off by default.
    fn as_by_hand(&mut self, decided: LookAheadPoint) -> LookAheadPoint {
        let delay_ticks = (self.settings.reaction_delay_s / self.context.control_period_s).round() as usize;
        self.delayed.push_back(decided);
        let point =
            if self.delayed.len() > delay_ticks { self.delayed.pop_front() } else { self.delayed.front().copied() };
        let point = point.unwrap_or(decided);
        if self.settings.label_jitter == 0.0 {
            return point;
        }
        let [u, w] = point.to_image_fraction(self.context.geometry());
        let sigma = self.settings.label_jitter;
        let [u, w] = [u, w].map(|fraction| (fraction + sigma * standard_normal(&mut self.hand)).clamp(0.0, 1.0));
        LookAheadPoint::from_image_fraction([u, w], self.context.geometry())
    }
}

impl Driver for ScriptedExpert {
    fn decide(&mut self, situation: &Situation<'_>) -> Decision {
        let truth = &situation.truth;
        let sight = LineOfSight::new(self.settings.sees, truth.map, truth.vehicle.pose, &self.context.sensing);
        self.decide_in(&Scene::from(truth), &sight)
    }

    fn reset(&mut self) {
        self.last = None;
        self.delayed.clear();
    }
}

impl ScriptedExpert {
    /// The decision in a scene of which `sight` says what is known.
    fn decide_in(&mut self, scene: &Scene<'_>, sight: &LineOfSight) -> Decision {
        let mut inspection = self.inspection.take();
        let wish = self.wish(scene, sight, inspection.as_mut());
        // Rule one has the last word: the point lies inside drivable space.
        let smoothed = self.last.map_or(wish.label, |last| wish.label.smoothed(last, &self.settings));
        let label = self.ground(scene, sight).kept_drivable(smoothed);

        let moved_m = self.last.map_or(0.0, |last| distance_m(last.point(), label.point()));
        self.stats.count(wish.rule, wish.has_failed, moved_m > JUMP_M);
        self.last = Some(label);
        if let Some(inspection) = &mut inspection {
            inspection.decided = label.point();
        }
        self.inspection = inspection;
        Decision {
            look_ahead: self.as_by_hand(label.point()),
            source: Source::Expert,
            spread: None,
            speed_limit_mps: None,
        }
    }
}

impl Inspection {
    fn empty() -> Self {
        let nowhere = LookAheadPoint { ahead_m: 0.0, left_m: 0.0 };
        Self {
            rule: Rule::Far,
            clearance_m: None,
            candidates: Vec::new(),
            chosen: 0,
            way: Vec::new(),
            wanted: nowhere,
            decided: nowhere,
        }
    }
}

fn distance_m(a: LookAheadPoint, b: LookAheadPoint) -> f32 {
    maths::hypot(a.ahead_m - b.ahead_m, a.left_m - b.left_m)
}

/// Irwin–Hall: twelve uniform draws have variance 1. Its tails end at 6σ, which suits a hand.
fn standard_normal(rng: &mut Rng) -> f32 {
    let uniform = |rng: &mut Rng| (rng.next_u32() >> 8) as f32 / (1 << 24) as f32;
    (0..12).map(|_| uniform(rng)).sum::<f32>() - 6.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::seed::{RootSeed, Stream};
    use sim::sensing::GridGeometry;

    fn expert(settings: ExpertSettings) -> ScriptedExpert {
        ScriptedExpert::new(settings, &EpisodeSettings::paper(), RootSeed(1).rng(Stream::Expert, 0))
    }

    /// 10 000 answers: means, standard deviations and the covariance within four standard errors, .01/√n, .01/√(2n), .01²/√n.
    #[test]
    fn a_hand_is_as_unsteady_as_it_is_told_on_either_axis_by_itself() {
        const ANSWERS: u16 = 10_000;
        let mut expert = expert(ExpertSettings { label_jitter: 0.01, ..ExpertSettings::half_points() });
        let geometry = GridGeometry::paper();
        let steady = LookAheadPoint::from_image_fraction([0.4, 0.6], &geometry);
        let mut sums = [0.0; 5];
        for _ in 0..ANSWERS {
            let [u, w] = expert.as_by_hand(steady).to_image_fraction(&geometry).map(f64::from);
            let (u, w) = (u - 0.4, w - 0.6);
            for (sum, value) in sums.iter_mut().zip([u, w, u * u, w * w, u * w]) {
                *sum += value / f64::from(ANSWERS);
            }
        }
        let [mean_u, mean_w, square_u, square_w, product] = sums;
        assert!(mean_u.abs() < 4e-4 && mean_w.abs() < 4e-4, "{sums:?}");
        let is_as_told = |square: f64| (square.sqrt() - 0.01).abs() < 2.9e-4;
        assert!(is_as_told(square_u) && is_as_told(square_w) && product.abs() < 4e-6, "{sums:?}");
    }

    /// After a near-collision it would point for 0.3 s at what lay before it there.
    #[test]
    fn put_back_onto_the_route_a_hand_points_at_what_it_sees() {
        let mut expert = expert(ExpertSettings { reaction_delay_s: 0.3, ..ExpertSettings::half_points() });
        // Six ticks late; until there is an answer so old, the first.
        let found = [5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0]
            .map(|ahead_m| expert.as_by_hand(LookAheadPoint { ahead_m, left_m: 0.0 }).ahead_m);
        assert_eq!(found, [5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 6.0]);
        expert.reset();
        assert_eq!(expert.as_by_hand(LookAheadPoint { ahead_m: 4.5, left_m: 0.0 }).ahead_m, 4.5);
    }
}
