//! Two-stage look-ahead: first arcs a point can steer at, and second arcs that branch off them.
//!
//! One constant arc can express neither "out and back" nor "straight on, then turn" (docs/methods.md E4). A first
//! arc is therefore as good as the best plan that begins with it: this is the paper's "a point from which avoidance
//! is possible".
//!
//! Few of the plans are followed to their end. Bounds say which could not win; arcs that begin alike share what they have
//! in common (`fan`); and probes far along an arc find most of those that are blocked. The best plan is that of a search
//! without all this, to the bit (`tests`).

use crate::context::{ExpertContext, Scene};
use crate::elastic_band::ElasticBand;
use crate::fan::{Arc, Entry, Fan, Forecast};
use crate::line_of_sight::{KnownGround, LineOfSight};
use crate::rollout::{Footprint, Motion};
use crate::settings::ExpertSettings;
use sim::distance_field::NODE_M;
use sim::geometry::Vec2;
use sim::vectors::f32x4;
use std::cell::OnceCell;

/// First arcs: 16 to either side of straight on.
const FIRST_ARCS: usize = 33;
/// Second arcs: 7 to either side of straight on.
const SECOND_ARCS: usize = 15;
/// First arcs are densest where a small change of curvature moves a far point most (docs/methods.md 3.2).
pub(crate) const FIRST_EXPONENT: f32 = 1.5;
/// Second arcs (docs/methods.md E5.1).
const SECOND_EXPONENT: f32 = 1.4;
/// Travels at which second arcs branch off.
const BRANCHES: usize = 5;
/// How much less than at a probe the distance may be at the nearest node of the step there, metres: the places differ by
/// rounding, so the nodes by one row and one column.
const PROBE_SLACK_M: f32 = 1.5 * NODE_M;
/// Clearance that may be lost in a tight start, metres: the error of the distances' interpolation.
const START_SLACK_M: f32 = 0.02;

/// Arcs of both stages.
#[derive(Debug, Clone)]
pub(crate) struct Arcs {
    first: Fan<FIRST_ARCS>,
    second: Fan<SECOND_ARCS>,
}

impl Arcs {
    pub(crate) fn new(settings: &ExpertSettings, nose_m: f32) -> Self {
        Self {
            first: Fan::new(settings.curvature_max_per_m, FIRST_EXPONENT, settings.first_step_m, nose_m),
            second: Fan::new(settings.second_curvature_max_per_m, SECOND_EXPONENT, settings.second_step_m, nose_m),
        }
    }

    pub(crate) fn curvature_per_m(&self, first: usize) -> f32 {
        self.first.arcs[first].curvature_per_m
    }
}

/// Where plans begin, and what they are measured with.
#[derive(Debug)]
pub(crate) struct Search<'a> {
    pub(crate) settings: &'a ExpertSettings,
    pub(crate) context: &'a ExpertContext,
    pub(crate) footprint: &'a Footprint,
    pub(crate) arcs: &'a Arcs,
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) sight: &'a LineOfSight,
    /// The car when it begins to obey this decision.
    pub(crate) start: Motion,
    /// Progress of the bumper there along the route, metres, once it was asked for.
    pub(crate) start_progress_m: OnceCell<f32>,
    /// Curvature index of the last label, −1…1.
    pub(crate) last_index: Option<f32>,
}

/// A first arc and what follows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Plan {
    /// Which first arc.
    pub(crate) first: usize,
    /// Where the second arc branches off and its curvature; `None` if the first arc is the whole plan.
    pub(crate) second: Option<(f32, f32)>,
    /// Free travel of the first arc alone, metres.
    pub(crate) first_free_m: f32,
    /// Free travel of the whole plan, metres.
    pub(crate) free_m: f32,
    /// Its worth.
    pub(crate) score: f32,
}

/// One first arc as the search left it, for pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Curvature of the arc, 1/m.
    pub curvature_per_m: f32,
    /// Free travel along it, metres.
    pub free_m: f32,
    /// Best score of a plan that begins with it; `None` if nothing of it is free, or it makes no progress.
    pub score: Option<f32>,
}

/// A forecast: the free way so far.
#[derive(Debug, Clone, Copy)]
struct Rollout {
    motion: Motion,
    travel_m: f32,
    load_m: f32,
}

/// A first arc, as far as it is forecast.
#[derive(Debug, Clone, Copy)]
struct FirstArc {
    /// While it can continue, it is not yet followed farther than the ramp.
    entry: Entry<FirstRollout>,
    /// What a plan that begins with it scores without travel and load, at most.
    offset: f32,
    /// No plan that begins with it can score more.
    bound: f32,
    /// Whether its plans have been followed.
    is_done: bool,
}

/// A forecast first arc.
#[derive(Debug, Clone, Copy)]
struct FirstRollout {
    rollout: Rollout,
    /// Where second arcs begin.
    branches: [Rollout; BRANCHES],
    n_branches: usize,
    /// So many of the branches lie on the ramp, and every arc that leaves it later has the same ones.
    n_on_ramp: usize,
}

impl Forecast for Rollout {
    fn motion(&self) -> Motion {
        self.motion
    }
}

impl Forecast for FirstRollout {
    fn motion(&self) -> Motion {
        self.rollout.motion
    }
}

impl Search<'_> {
    /// The best plan that keeps a clearance; `None` if not even a step is free.
    ///
    /// Branch and bound: a plan that could not win if all the rest of its way were free is not followed, and neither is a
    /// first arc whose plans could not.
    pub(crate) fn best_plan(&self, clearance_m: f32, candidates: Option<&mut Vec<Candidate>>) -> Option<Plan> {
        let thresholds = self.thresholds(clearance_m);
        let mut firsts = self.enter_firsts(thresholds);
        let mut best: Option<Plan> = None;
        let mut followed = Followed::default();
        // The most promising first: its plans prune the others.
        while let Some(i) = most_promising(&firsts) {
            let first = &mut firsts[i];
            if best.is_some_and(|best| first.bound <= best.score) {
                break;
            }
            if first.entry.is_free {
                self.follow_first(i, first, thresholds);
            } else {
                self.follow_plans(i, first, thresholds, &mut followed, &mut best);
                first.is_done = true;
            }
        }
        if let Some(candidates) = candidates {
            candidates.clear();
            candidates.extend(firsts.iter_mut().enumerate().map(|(i, first)| {
                let mut own = None;
                self.follow_first(i, first, thresholds);
                self.follow_plans(i, first, thresholds, &mut Followed::default(), &mut own);
                let free_m = first.entry.forecast.rollout.travel_m;
                let curvature_per_m = self.arcs.curvature_per_m(i);
                Candidate { curvature_per_m, free_m, score: own.map(|plan| plan.score) }
            }));
        }
        best
    }

    /// The first arc with the largest smallest clearance over the next metres, and that clearance.
    pub(crate) fn widest_gap(&self) -> (usize, f32) {
        let ground = self.ground();
        let steps = (self.settings.tight_start_m / self.settings.first_step_m).ceil() as usize;
        let change_per_m = self.change_per_step(self.settings.first_step_m);
        let gap_m = |first: usize| {
            let mut motion = self.start;
            (0..steps).fold(f32::INFINITY, |gap_m, _| {
                motion = motion.step(self.arcs.curvature_per_m(first), change_per_m, self.settings.first_step_m);
                gap_m.min(self.footprint.clearance_m(ground, motion))
            })
        };
        let mut widest = (0, gap_m(0));
        for first in 1..FIRST_ARCS {
            let gap_m = gap_m(first);
            if gap_m > widest.1 {
                widest = (first, gap_m);
            }
        }
        widest
    }

    /// The rear axle along a plan, every `spacing_m` from the start.
    pub(crate) fn way(&self, plan: &Plan, spacing_m: f32) -> impl Iterator<Item = Vec2> {
        let step_m = self.settings.first_step_m;
        let change_per_m = self.change_per_step(step_m);
        let steps_per_sample = (spacing_m / step_m).round() as usize;
        let first_per_m = self.arcs.curvature_per_m(plan.first);
        let (second, mut motion) = (plan.second, self.start);
        let samples = (plan.free_m / spacing_m) as usize;
        std::iter::once(self.start.position).chain((0..samples).map(move |sample| {
            for i in 0..steps_per_sample {
                let travel_m = (sample * steps_per_sample + i) as f32 * step_m;
                let target_per_m = match second {
                    // Half a step: travels are sums of steps.
                    Some((branch_m, second_per_m)) if travel_m + 0.5 * step_m > branch_m => second_per_m,
                    _ => first_per_m,
                };
                motion = motion.step(target_per_m, change_per_m, step_m);
            }
            motion.position
        }))
    }

    /// How safe it is to pursue a band, always steering at the point `ahead_m` along it, 0…1 by the least clearance.
    pub(crate) fn trust(&self, band: &ElasticBand, ahead_m: f32) -> f32 {
        let (settings, ground) = (self.settings, self.ground());
        let step_m = settings.second_step_m;
        let change_per_m = self.change_per_step(step_m);
        let of_band = &settings.elastic_band;
        let per_m = 1.0 / (of_band.trust_to_m - of_band.trust_from_m);
        let mut motion = self.start;
        let mut trust = 1.0_f32;
        for i in 0..(of_band.forecast_m / step_m) as usize {
            let travel_m = i as f32 * step_m;
            let target = band.at(travel_m + ahead_m) - motion.position;
            let left_m = motion.ahead.perp_dot(target);
            let target_per_m = (2.0 * left_m / target.length_squared())
                .clamp(-settings.curvature_max_per_m, settings.curvature_max_per_m);
            motion = motion.step(target_per_m, change_per_m, step_m);
            let clearance_m = self.footprint.clearance_m(ground, motion);
            trust = trust.min((clearance_m - of_band.trust_from_m) * per_m);
            if trust <= 0.0 {
                return 0.0;
            }
        }
        trust
    }

    /// How far the curvature can change per step at the present speed. Linear in the travel: it takes the rate of
    /// straight wheels, at which the curvature changes slowest.
    fn change_per_step(&self, step_m: f32) -> f32 {
        // Standing still, the wheels would turn on the spot.
        let speed_mps = self.scene.vehicle.speed_mps.max(self.context.speed_min_mps);
        let vehicle = &self.context.vehicle;
        vehicle.steering_rate_max_radps / (vehicle.wheelbase_m * speed_mps) * step_m
    }

    fn thresholds(&self, clearance_m: f32) -> Thresholds {
        let present_m = self.footprint.clearance_m(self.ground(), self.start);
        Thresholds { near_m: clearance_m.min(present_m - START_SLACK_M), far_m: clearance_m }
    }

    /// First arcs as far as their ramps.
    fn enter_firsts(&self, thresholds: Thresholds) -> [FirstArc; FIRST_ARCS] {
        let fan = &self.arcs.first;
        let start = Rollout { motion: self.start, travel_m: 0.0, load_m: 0.0 };
        let start = FirstRollout { rollout: start, branches: [start; BRANCHES], n_branches: 0, n_on_ramp: 0 };
        let drive_on = |first: &mut FirstRollout, next| {
            let is_free = self.drive_on_first(first, next, thresholds);
            first.n_on_ramp = first.n_branches;
            is_free
        };
        let entries = fan.follow_ramps(start, self.change_per_step(fan.step_m), drive_on);
        let blocked_m = self.blocked_m(thresholds);
        std::array::from_fn(|i| {
            let mut first = FirstArc { entry: entries[i], offset: 0.0, bound: 0.0, is_done: false };
            let Rollout { motion, travel_m, .. } = first.entry.forecast.rollout;
            let free_max_m = if first.entry.is_free {
                let mut probes = fan.probes(i, fan.enter(i, motion));
                let blocked = probes.find_map(|(travels_m, noses)| {
                    let blocked = self.ground().at_four_nearest_nodes(noses).simd_lt(blocked_m).to_bitmask();
                    (blocked != 0).then(|| travels_m.to_array()[blocked.trailing_zeros() as usize])
                });
                blocked.map_or(self.settings.horizon_m, |probed_m| travel_m + probed_m)
            } else {
                travel_m
            };
            self.rate_first(i, &mut first, free_max_m);
            first
        })
    }

    /// Forecasts a first arc to its end.
    fn follow_first(&self, i: usize, first: &mut FirstArc, thresholds: Thresholds) {
        let drive_on = |first: &mut FirstRollout, next| self.drive_on_first(first, next, thresholds);
        self.arcs.first.follow(i, &mut first.entry, drive_on);
        self.rate_first(i, first, first.entry.forecast.rollout.travel_m);
    }

    #[inline]
    fn drive_on_first(&self, first: &mut FirstRollout, next: Motion, thresholds: Thresholds) -> bool {
        let step_m = self.settings.first_step_m;
        let clearance_m = self.footprint.clearance_m(self.ground(), next);
        if !self.drive_on(&mut first.rollout, next, step_m, clearance_m, thresholds) {
            return false;
        }
        // Half a step: travels are sums of steps.
        let reached_m = first.rollout.travel_m + 0.5 * step_m;
        if first.n_branches < BRANCHES && reached_m > self.settings.branch_travels_m[first.n_branches] {
            first.branches[first.n_branches] = first.rollout;
            first.n_branches += 1;
        }
        true
    }

    fn rate_first(&self, i: usize, first: &mut FirstArc, free_m: f32) {
        let (weights, index) = (&self.settings.weights, self.arcs.first.arcs[i].index);
        let change = self.last_index.map_or(0.0, |last_index| (index - last_index).abs());
        first.offset = weights.first_free * free_m.min(self.settings.horizon_m) / weights.unit_m
            - weights.first_curvature * index.abs()
            - weights.change * change;
        let FirstRollout { branches, n_branches, .. } = &first.entry.forecast;
        let load_m = branches[..*n_branches].first().map_or(0.0, |branch| branch.load_m);
        first.bound = first.offset + self.bound(load_m);
    }

    /// Moves a forecast to its next step, unless it ends before: at the horizon or at an obstacle.
    #[expect(
        clippy::inline_always,
        reason = "called, it takes motions through memory: numbers that are stored, and loaded as vectors"
    )]
    #[inline(always)]
    fn drive_on(
        &self,
        rollout: &mut Rollout,
        next: Motion,
        step_m: f32,
        clearance_m: f32,
        thresholds: Thresholds,
    ) -> bool {
        let travel_m = rollout.travel_m + step_m;
        if rollout.travel_m >= self.settings.horizon_m || clearance_m < thresholds.at(travel_m, self.settings) {
            return false;
        }
        let load_m = rollout.load_m + self.load(clearance_m) * step_m;
        *rollout = Rollout { motion: next, travel_m, load_m };
        true
    }

    /// Best of travel and load once `load_m` has been collected: free to the horizon without any more.
    #[inline]
    fn bound(&self, load_m: f32) -> f32 {
        self.worth(self.settings.horizon_m, load_m)
    }

    /// Travel and load of a plan. Grows with the travel at a given load.
    #[inline]
    fn worth(&self, travel_m: f32, load_m: f32) -> f32 {
        travel_m / self.settings.weights.unit_m - self.settings.weights.load * load_m / travel_m
    }

    /// The travel above which a load is worth more than this: the inverse of [`Self::worth`].
    fn travel_at_worth(&self, worth: f32, load_m: f32) -> f32 {
        let weights = &self.settings.weights;
        0.5 * weights.unit_m * (worth + (worth * worth + 4.0 * weights.load * load_m / weights.unit_m).sqrt())
    }

    /// Replaces `best` by the best plan that begins with a first arc, if that is better.
    fn follow_plans(
        &self,
        index: usize,
        first: &FirstArc,
        thresholds: Thresholds,
        followed: &mut Followed,
        best: &mut Option<Plan>,
    ) {
        let forecast = &first.entry.forecast;
        let Rollout { motion, travel_m: first_free_m, load_m } = forecast.rollout;
        if first_free_m == 0.0 {
            return;
        }
        let horizon_m = self.settings.horizon_m;
        let mut offer = |second, free_m: f32, load_m: f32, penalty: f32, end: Motion| {
            let free_m = free_m.min(horizon_m);
            let score = self.worth(free_m, load_m) + first.offset - penalty;
            let is_better = best.is_none_or(|best| score > best.score);
            if is_better && self.makes_progress(end, free_m) {
                *best = Some(Plan { first: index, second, first_free_m, free_m, score });
            }
            best.map_or(f32::NEG_INFINITY, |best| best.score)
        };
        let blocked_m = self.blocked_m(thresholds);
        let mut to_beat = offer(None, first_free_m, load_m, 0.0, motion);
        let side = usize::from(self.arcs.curvature_per_m(index) < self.start.curvature_per_m);
        for (i, branch) in forecast.branches[..forecast.n_branches].iter().enumerate().rev() {
            if i < forecast.n_on_ramp {
                let offset = &mut followed.0[side][i];
                if first.offset <= *offset {
                    continue;
                }
                *offset = first.offset;
            }
            let fan = &self.arcs.second;
            let load_max_m = self.load_at_bound(to_beat - first.offset);
            let drive_on = |rollout: &mut Rollout, next| self.drive_on_second(rollout, next, thresholds, load_max_m);
            let entries = fan.follow_ramps(*branch, self.change_per_step(fan.step_m), drive_on);
            for (i, mut entry) in entries.into_iter().enumerate() {
                let penalty = self.penalty(&fan.arcs[i]);
                if entry.is_free {
                    let worth_min = to_beat - first.offset + penalty;
                    if self.is_hopeless(i, &entry.forecast, worth_min, blocked_m) {
                        continue;
                    }
                    let load_max_m = self.load_at_bound(worth_min);
                    let drive_on =
                        |rollout: &mut Rollout, next| self.drive_on_second(rollout, next, thresholds, load_max_m);
                    fan.follow(i, &mut entry, drive_on);
                }
                let branching = Some((branch.travel_m, fan.arcs[i].curvature_per_m));
                let Rollout { motion, travel_m, load_m } = entry.forecast;
                to_beat = offer(branching, travel_m, load_m, penalty, motion);
            }
        }
    }

    fn penalty(&self, second: &Arc) -> f32 {
        self.settings.weights.second_curvature * second.index.abs()
    }

    /// The load above which [`Self::bound`] falls below a worth.
    fn load_at_bound(&self, worth: f32) -> f32 {
        let weights = &self.settings.weights;
        (self.settings.horizon_m / weights.unit_m - worth) * self.settings.horizon_m / weights.load
    }

    /// Whether a second arc from the ramp must be blocked before it is worth more than `worth_min`.
    fn is_hopeless(&self, second: usize, ramp: &Rollout, worth_min: f32, blocked_m: f32x4) -> bool {
        let fan = &self.arcs.second;
        let to_probe_m = f32x4::splat(self.travel_at_worth(worth_min, ramp.load_m) - ramp.travel_m);
        for (travels_m, noses) in fan.probes(second, fan.enter(second, ramp.motion)) {
            let counts = travels_m.simd_lt(to_probe_m);
            if (counts & self.ground().at_four_nearest_nodes(noses).simd_lt(blocked_m)).any() {
                return true;
            }
            if !counts.all() {
                break;
            }
        }
        false
    }

    /// Moves a second arc to its next step, unless it has collected more than `load_max_m`: it is worth less then.
    #[expect(
        clippy::inline_always,
        reason = "called, it takes motions through memory: numbers that are stored, and loaded as vectors"
    )]
    #[inline(always)]
    fn drive_on_second(&self, rollout: &mut Rollout, next: Motion, thresholds: Thresholds, load_max_m: f32) -> bool {
        if rollout.load_m > load_max_m {
            return false;
        }
        let clearance_m = self.footprint.coarse_clearance_m(self.ground(), next);
        self.drive_on(rollout, next, self.settings.second_step_m, clearance_m, thresholds)
    }

    /// A probe that finds less than this at the nearest node finds a forecast blocked, metres.
    fn blocked_m(&self, thresholds: Thresholds) -> f32x4 {
        f32x4::splat(self.footprint.distance_m(thresholds.near_m) - PROBE_SLACK_M)
    }

    pub(crate) fn ground(&self) -> KnownGround<'_> {
        KnownGround { field: self.scene.field, sight: self.sight }
    }

    /// How much something at a clearance weighs, 0…1: "fewest obstacles around the trajectory" (paper), and what
    /// keeps the car in the middle.
    #[inline]
    fn load(&self, clearance_m: f32) -> f32 {
        let share = (1.0 - clearance_m / self.settings.load_range_m).clamp(0.0, 1.0);
        share * share
    }

    /// No turning back: the bumper gains on the route. This only filters plans, so labels remain functions of the scene.
    fn makes_progress(&self, end: Motion, travel_m: f32) -> bool {
        let Some((path, progress_m)) = self.scene.route else { return true };
        let reach_m = self.settings.horizon_m + self.context.vehicle.front_m();
        let progress_of = |motion: Motion| {
            let bumper = motion.on_axis(self.context.vehicle.front_m());
            path.project_near_m(bumper, progress_m, self.context.vehicle.front_m(), reach_m + 4.0)
        };
        let reached_m = progress_of(end);
        let start_m = *self.start_progress_m.get_or_init(|| progress_of(self.start));
        // Behind the finish progress saturates.
        reached_m > path.length_m() - 0.5 || reached_m - start_m >= self.settings.progress_share * travel_m
    }
}

/// The first arc with the highest bound of those that are not done; of equal ones, the straightest.
fn most_promising(firsts: &[FirstArc]) -> Option<usize> {
    let open = firsts.iter().enumerate().filter(|(_, first)| !first.is_done);
    open.max_by(|(i, a), (j, b)| a.bound.total_cmp(&b.bound).then(j.cmp(i))).map(|(i, _)| i)
}

/// What the first arcs had as their offset whose branches on the ramps were followed, by side and branch. The plans of
/// another one from the same branch differ from theirs in nothing but the offset.
struct Followed([[f32; BRANCHES]; 2]);

impl Default for Followed {
    fn default() -> Self {
        Self([[f32::NEG_INFINITY; BRANCHES]; 2])
    }
}

/// Clearance a forecast must keep.
#[derive(Debug, Clone, Copy)]
struct Thresholds {
    near_m: f32,
    far_m: f32,
}

impl Thresholds {
    /// A tight start must not end every arc at once.
    #[inline]
    fn at(self, travel_m: f32, settings: &ExpertSettings) -> f32 {
        if travel_m < settings.tight_start_m { self.near_m } else { self.far_m }
    }
}

#[cfg(test)]
mod tests;
