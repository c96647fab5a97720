//! Which of the paper's conclusions hold here: decided by rule, from paired intervals, one sentence each.
//!
//! A comparison holds where the interval of 95 % of the paired difference lies on the paper's side of zero, does not hold
//! where it lies on the other, and cannot be told where it contains zero. Where there are several trainings of a recipe, the
//! difference is that of their means, and its interval is for other lots and other seeds.

use crate::format::{clustered, difference, exact_rate, interval, quoted_interval, quoted_rate, rate_ratio};
use crate::incidents::Cause;
use crate::judge::{Comparison, DriverEstimate};
use crate::names::{BC, DAGGER};
use crate::paper::{self, PaperLot};
use crate::plan::Plan;
use crate::results::EvaluationResults;
use crate::slices::{Slice, SliceKind};
use crate::statistics::bootstrap::Interval;
use crate::statistics::comparison::{RateRatio, ratio_of_intervals};
use crate::statistics::poisson::{CONFIDENCE, Rate, upper_bound};
use crate::statistics::sample_size::Question;
use crate::statistics::student::half_width_of_mean;
use crate::totals::Totals;
use crate::trainings::{self, JudgedTeams, TRAININGS_MIN, TeamEstimate};
use experiment::drivers::NamedDriver;
use experiment::settings::Smoothing;
use policy::dagger::IterationRow;
use serde::Serialize;
use statrs::statistics::Statistics as _;

/// No near-collision supports "none" from the metres on that bound the rate here, one-sided, near-collisions per 100 m:
/// 3 km.
const NONE_PER_100M: f64 = 0.1;
/// With fewer paired runs a resampled interval is too narrow to decide by (chosen: a reference lot has ten).
const PAIRS_MIN: usize = 10;
/// A rate is "as in the paper" within this factor.
const AS_IN_THE_PAPER: f64 = 2.0;

/// Index of the paper's driver; the first where it does not take part.
pub fn compare_with(drivers: &[NamedDriver]) -> usize {
    drivers.iter().position(|driver| driver.name == DAGGER).unwrap_or(0)
}

/// Whether a conclusion holds here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// It holds here, too.
    Holds,
    /// The opposite holds here.
    DoesNotHold,
    /// It cannot be told from this many metres and trainings.
    CannotBeTold,
}

impl Verdict {
    /// Heading in the report.
    pub fn title(self) -> &'static str {
        match self {
            Self::Holds => "Holds",
            Self::DoesNotHold => "Does not hold",
            Self::CannotBeTold => "Cannot be told",
        }
    }

    /// The verdict of an interval that lies above zero if the paper is right.
    fn of(interval: Option<Interval>) -> Self {
        match interval {
            Some(interval) if interval.excludes_zero() && interval.lower > 0.0 => Self::Holds,
            Some(interval) if interval.excludes_zero() => Self::DoesNotHold,
            _ => Self::CannotBeTold,
        }
    }
}

/// A conclusion and its verdict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statement {
    /// The conclusion, in our words.
    pub claim: String,
    /// Whether it holds here.
    pub verdict: Verdict,
    /// The figures it rests on.
    pub figures: String,
}

/// An evaluation that has been driven.
#[derive(Debug, Clone, Copy)]
pub struct DrivenPlan<'a> {
    /// The plan.
    pub plan: &'a Plan<'a>,
    /// Its results.
    pub results: &'a EvaluationResults,
}

impl DrivenPlan<'_> {
    /// Index of a driver.
    pub fn driver(&self, name: &str) -> Option<usize> {
        self.plan.drivers.iter().position(|driver| driver.name == name)
    }

    /// Whether the paper's three lots were driven, and no others.
    pub fn is_of_papers_lots(&self) -> bool {
        let groups = self.results.groups();
        let is_driven = |lot: &PaperLot| groups.iter().any(|group| group.name == lot.lot);
        groups.len() == paper::LOTS.len() && paper::LOTS.iter().all(is_driven)
    }

    /// All lots together.
    pub fn all(&self) -> Slice {
        self.results.slices().pop().expect("at least one lot is driven")
    }

    /// The lots that no driver was trained on; `None` if that is every lot or none.
    pub fn unseen(&self) -> Option<Slice> {
        let groups = self.results.groups();
        let unseen: Vec<&str> =
            groups.iter().filter(|group| !group.is_trained_on).map(|group| group.name.as_str()).collect();
        (unseen.len() < groups.len()).then_some(())?;
        let slices = self.results.slices();
        match unseen[..] {
            [] => None,
            [_] => groups.iter().position(|group| !group.is_trained_on).and_then(|at| slices.get(at).cloned()),
            _ => slices.into_iter().find(|slice| slice.kind == SliceKind::Unseen),
        }
    }

    /// How all drivers compare with DAgger in a slice; `None` where it did not drive.
    pub fn against_dagger(&self, slice: Slice, place: &str) -> Option<Against<'_>> {
        let dagger = self.driver(DAGGER)?;
        let (estimates, comparisons) = self.judge(&slice);
        let teams = self.judge_teams(&slice, &estimates);
        Some(Against { driven: *self, dagger, slice, place: place.to_owned(), estimates, comparisons, teams })
    }

    /// How every driver stands in a slice, and how the others compare with DAgger; with the first where that did not drive.
    pub fn judge(&self, slice: &Slice) -> (Vec<DriverEstimate>, Vec<Comparison>) {
        self.results.judge(0, slice, compare_with(self.plan.drivers), self.plan.settings.evaluation.seed)
    }

    /// How every driver stands in a slice.
    pub fn estimates(&self, slice: &Slice) -> Vec<DriverEstimate> {
        self.judge(slice).0
    }

    /// How the drivers compare with DAgger over all their trainings; `estimates` are those of [`judge`](Self::judge). Where
    /// DAgger was trained too seldom, or did not drive, they are not judged.
    pub fn judge_teams(&self, slice: &Slice, estimates: &[DriverEstimate]) -> JudgedTeams {
        let teams = trainings::teams(self.plan.drivers);
        let dagger = self.driver(DAGGER);
        let with = dagger.and_then(|dagger| teams.iter().position(|team| team.has(dagger)));
        let seed = self.plan.settings.evaluation.seed;
        let judged = with.and_then(|with| self.results.judge_teams(0, slice, &teams, with, estimates, seed));
        JudgedTeams { teams, estimates: judged }
    }
}

/// The other drivers against DAgger on some lots.
#[derive(Debug)]
pub struct Against<'a> {
    driven: DrivenPlan<'a>,
    dagger: usize,
    slice: Slice,
    /// The lots, as in "on the paper's lots".
    place: String,
    /// How each driver stands.
    estimates: Vec<DriverEstimate>,
    /// Differences are theirs − DAgger's.
    comparisons: Vec<Comparison>,
    /// The same over trainings that differ by their seed.
    teams: JudgedTeams,
}

/// What the paper concludes from its drives on its lots.
pub fn on_reference_lots(driven: &DrivenPlan<'_>) -> Vec<Statement> {
    let place = if driven.is_of_papers_lots() { "on the paper's lots" } else { "on the lots of the evaluation" };
    let Some(all) = driven.against_dagger(driven.all(), place) else { return Vec::new() };
    let unseen = driven.unseen().and_then(|unseen| driven.against_dagger(unseen, "on the lots it was not trained on"));
    let mut statements = vec![all.no_near_collision()];
    statements.extend(unseen.as_ref().map(Against::no_near_collision));
    for planner in ["tentacle", "vvf"] {
        let Some(other) = driven.driver(planner) else { continue };
        statements.push(all.fails_less(other));
        statements.extend(unseen.as_ref().map(|unseen| unseen.fails_less(other)));
        statements.extend([all.keeps_further_away(other), all.steers_calmer(other), all.minds_noise_less(other)]);
        statements.extend(all.fails_as_in_the_paper(other));
    }
    statements.extend(driven.driver(BC).map(|bc| all.fails_less(bc)));
    statements
}

impl Against<'_> {
    /// What should hold beyond the paper's own comparison: against behaviour cloning and all planners, of their kin and
    /// tuned ones included.
    pub fn others(&self) -> Vec<Statement> {
        let is_other = |&other: &usize| {
            let name = self.name(other);
            name == BC || !["expert", BC, DAGGER].iter().any(|known| name.starts_with(known))
        };
        (0..self.driven.plan.drivers.len()).filter(is_other).map(|other| self.fails_less(other)).collect()
    }

    fn name(&self, driver: usize) -> &str {
        &self.driven.plan.drivers[driver].name
    }

    fn totals(&self, driver: usize) -> Totals {
        self.driven.results.totals(0, driver, &self.slice, None)
    }

    /// `None` also with too few runs to decide by.
    fn comparison(&self, other: usize) -> Option<&Comparison> {
        let found = self.comparisons.iter().find(|comparison| comparison.driver == other);
        found.filter(|comparison| comparison.pairs >= PAIRS_MIN)
    }

    /// Every training of a driver's recipe, and how they stand together where they can be judged.
    fn trainings_of<'a>(&'a self, driver: &'a usize) -> (&'a [usize], Option<&'a TeamEstimate>) {
        match self.teams.of(*driver) {
            Some((team, estimate)) => (team.drivers.as_slice(), estimate),
            None => (std::slice::from_ref(driver), None),
        }
    }

    /// Near-collisions (contacts) of a driver and their rate; of all its trainings where they can be judged together.
    fn rate(&self, driver: usize) -> String {
        let totals = self.totals(driver);
        let reference_m = totals.reference_m;
        let (all, estimate) = self.trainings_of(&driver);
        let each: Vec<Totals> = all.iter().map(|&driver| self.totals(driver)).collect();
        let count = |totals: &Totals| format!("{} ({})", totals.near_collisions, totals.contacts);
        let counts = each.iter().map(count).collect::<Vec<_>>().join(", ");
        let of_one = || quoted_rate(&totals, &self.estimates[driver]);
        let (route, rate) = match estimate {
            _ if each.len() == 1 => ("m", of_one()),
            Some(_) if each.iter().all(|totals| totals.near_collisions == 0) => ("m each", exact_rate(0, reference_m)),
            Some(TeamEstimate { per_100m, .. }) => ("m each", interval(*per_100m, 2)),
            None => ("m each", format!("of the first {}", of_one())),
        };
        format!("{} {counts} in {reference_m:.0} {route}, {rate} per 100 m", self.name(driver))
    }

    fn no_near_collision(&self) -> Statement {
        let Totals { reference_m, .. } = self.totals(self.dagger);
        let (all, _) = self.trainings_of(&self.dagger);
        let near_collisions: u32 = all.iter().map(|&driver| self.totals(driver).near_collisions).sum();
        // Trainings that drove the same lots add no metres.
        let bound = 100.0 * upper_bound(near_collisions, CONFIDENCE) / reference_m.max(f64::MIN_POSITIVE);
        let verdict = match near_collisions {
            0 if bound <= NONE_PER_100M => Verdict::Holds,
            0 => Verdict::CannotBeTold,
            _ => Verdict::DoesNotHold,
        };
        Statement {
            claim: format!("DAgger drives {} without a near-collision", self.place),
            verdict,
            figures: self.rate(self.dagger),
        }
    }

    /// The difference of another driver's mean from DAgger's, over all trainings where they can be judged together.
    fn difference(
        &self,
        other: usize,
        of_trainings: impl Fn(&TeamEstimate) -> Interval,
        of_pair: impl Fn(&Comparison) -> Option<Interval>,
    ) -> Option<Interval> {
        let comparison = self.comparison(other)?;
        match self.trainings_of(&other) {
            (_, Some(estimate)) => Some(of_trainings(estimate)),
            (_, None) => of_pair(comparison),
        }
    }

    /// A figure of a driver, of each of its trainings.
    fn each(&self, driver: usize, digits: usize, of: impl Fn(&Totals) -> f64) -> String {
        let (all, _) = self.trainings_of(&driver);
        let each: Vec<String> = all.iter().map(|&driver| format!("{:.digits$}", of(&self.totals(driver)))).collect();
        format!("{} {}", self.name(driver), each.join(", "))
    }

    fn fails_less(&self, other: usize) -> Statement {
        let found = self.difference(
            other,
            |estimate| estimate.difference_per_100m,
            |comparison| comparison.difference_per_100m,
        );
        let verdict = Verdict::of(found);
        let (ours, theirs) = (self.rate(self.dagger), self.rate(other));
        let mut figures = format!("{ours}; {theirs}; difference {}", difference(found, 2));
        let is_of_single = !self.teams.are_judged() || self.comparison(other).is_none();
        if verdict == Verdict::CannotBeTold && is_of_single {
            let both = [other, self.dagger];
            let clustered = both.map(|driver| self.estimates[driver].dispersion.map_or(1.0, |found| found.index));
            let rates = both.map(|driver| self.totals(driver).rate().per_unit);
            figures += &metres_needed(rates, clustered.into_iter().fold(1.0, f64::max));
        }
        let claim = format!("DAgger has fewer near-collisions than {} {}", self.name(other), self.place);
        Statement { claim, verdict, figures }
    }

    fn keeps_further_away(&self, other: usize) -> Statement {
        let of_pair = |comparison: &Comparison| comparison.difference_safe_ratio;
        let found = self.difference(other, |estimate| estimate.difference_safe_ratio, of_pair).map(negated);
        let [ours, theirs] = [self.dagger, other].map(|driver| self.each(driver, 3, Totals::safe_ratio));
        Statement {
            claim: format!("DAgger has a larger safe ratio than {}", self.name(other)),
            verdict: Verdict::of(found),
            figures: format!(
                "{ours}; {theirs}; difference {}; on lots whose widths were fitted to the expert's",
                difference(found, 3)
            ),
        }
    }

    fn steers_calmer(&self, other: usize) -> Statement {
        let of_pair = |comparison: &Comparison| comparison.difference_reversals_per_100m;
        let found = self.difference(other, |estimate| estimate.difference_reversals_per_100m, of_pair);
        let [ours, theirs] = [self.dagger, other].map(|driver| self.each(driver, 1, Totals::reversals_per_100m));
        // Two things are compared then: the drivers, and what follows them.
        let settings = self.driven.plan.settings;
        let is_smoothed =
            settings.evaluation.smoothing == Smoothing::Own && settings.dagger.inference.smoothing_ticks > 0.0;
        let smoothed = if is_smoothed { "; networks' actions are smoothed, those of planners are not" } else { "" };
        Statement {
            claim: format!("DAgger oscillates less than {}", self.name(other)),
            verdict: Verdict::of(found),
            figures: format!(
                "steering reversals per 100 m: {ours}; {theirs}; difference {}{smoothed}",
                difference(found, 1)
            ),
        }
    }

    /// Near-collisions that the same driver avoids on the clean grid. They are few: compared exactly, without pairs, as if each
    /// came by itself; not at all where near-collisions of either driver come in clusters, or of too few trials. Several
    /// trainings drove the same lots and are not counted together: each has to be told from the other driver.
    fn minds_noise_less(&self, other: usize) -> Statement {
        let noisy = |driver: usize| {
            let count = self.driven.results.count_of_cause(0, driver, &self.slice, Cause::NoiseInduced);
            (count, self.totals(driver))
        };
        let of = |(noisy, totals): &(u32, Totals)| (*noisy, totals.reference_m / 100.0);
        let name = self.name(other);
        let (trainings, _) = self.trainings_of(&self.dagger);
        let ours: Vec<(u32, Totals)> = trainings.iter().map(|&driver| noisy(driver)).collect();
        let theirs = noisy(other);
        let ratios: Vec<RateRatio> = ours.iter().map(|ours| RateRatio::new(of(&theirs), of(ours))).collect();
        let is_clustered = trainings.iter().chain([&other]).any(|&driver| clustered(&self.estimates[driver]).is_some());
        let verdict = if is_clustered || self.comparison(other).is_none() {
            Verdict::CannotBeTold
        } else if ratios.iter().all(|ratio| ratio.lower > 1.0) {
            Verdict::Holds
        } else if ratios.iter().all(|ratio| ratio.upper.is_some_and(|upper| upper < 1.0)) {
            Verdict::DoesNotHold
        } else {
            Verdict::CannotBeTold
        };
        let why_not = match (is_clustered, self.comparison(other)) {
            (true, _) => "; they come in clusters",
            (false, None) => "; too few trials",
            (false, Some(_)) => "",
        };
        let counts = ours.iter().map(|(noisy, totals)| format!("{noisy} of {}", totals.near_collisions));
        let figures = format!(
            "DAgger {}, {name} {} of {}; rate ratio {}, if each came by itself{why_not}",
            counts.collect::<Vec<_>>().join(", "),
            theirs.0,
            theirs.1.near_collisions,
            ratios.iter().map(rate_ratio).collect::<Vec<_>>().join(", ")
        );
        Statement { claim: format!("DAgger has fewer noise-induced near-collisions than {name}"), verdict, figures }
    }

    /// Whether a planner of the paper fails about as often here; `None` where the paper did not drive.
    fn fails_as_in_the_paper(&self, planner: usize) -> Option<Statement> {
        let name = self.name(planner);
        let of_paper = paper::DRIVERS.iter().position(|known| *known == name)?;
        let (events, metres) = paper::count(of_paper, |_| true);
        let ours = self.driven.is_of_papers_lots().then(|| self.totals(planner))?;
        let exact = RateRatio::new((ours.near_collisions, ours.reference_m / 100.0), (events, metres / 100.0));
        let estimate = &self.estimates[planner];
        let ratio = match clustered(estimate) {
            // Of the paper's events nothing is known but their number.
            Some(of_ours) => {
                let [lower, upper] = quoted_interval(&ours, estimate);
                let of_paper = Rate::new(events, metres / 100.0);
                let of_paper = (of_paper.per_unit, [of_paper.lower, of_paper.upper]);
                let [lower, upper] = ratio_of_intervals(Interval { lower, upper, ..of_ours }, of_paper);
                RateRatio { lower, upper: Some(upper), ..exact }
            }
            None => exact,
        };
        let upper = ratio.upper.unwrap_or(f64::INFINITY);
        let verdict = if 1.0 / AS_IN_THE_PAPER <= ratio.lower && upper <= AS_IN_THE_PAPER {
            Verdict::Holds
        } else if ratio.lower > AS_IN_THE_PAPER || upper < 1.0 / AS_IN_THE_PAPER {
            Verdict::DoesNotHold
        } else {
            Verdict::CannotBeTold
        };
        Some(Statement {
            claim: format!("{name} fails about as often as in the paper (within a factor of {AS_IN_THE_PAPER})"),
            verdict,
            figures: format!(
                "{}; paper {events} in {metres:.0} m, {} per 100 m; rate ratio {}",
                self.rate(planner),
                exact_rate(events, metres),
                rate_ratio(&ratio)
            ),
        })
    }
}

fn negated(interval: Interval) -> Interval {
    Interval { estimate: -interval.estimate, lower: -interval.upper, upper: -interval.lower, ..interval }
}

/// What it would take to tell two rates apart, if they are what was seen and events cluster as much.
fn metres_needed(per_100m: [f64; 2], dispersion: f64) -> String {
    if per_100m[0] == per_100m[1] {
        return String::new();
    }
    let question = Question { per_100m, power: 0.8, alpha: 1.0 - CONFIDENCE, dispersion };
    let km = (question.metres_each() / 1000.0).ceil();
    format!("; if these are the rates, about {km:.0} km each would tell in four of five evaluations")
}

/// The network's share rises from iteration to iteration until it passes η. One training decides; there is no interval.
pub fn share_of_the_network(rows: &[IterationRow], eta: f64) -> Statement {
    let shares: Vec<f64> = rows.iter().filter_map(|row| row.eta_hat).collect();
    let verdict = match shares[..] {
        [_, .., last] if last > eta && shares.is_sorted_by(|before, after| before < after) => Verdict::Holds,
        [only] if only > eta => Verdict::CannotBeTold,
        [] => Verdict::CannotBeTold,
        _ => Verdict::DoesNotHold,
    };
    let shares: Vec<String> = shares.iter().map(|share| format!("{share:.3}")).collect();
    // Without them a share says little: labels of half the range are within τ twice as easily.
    let read_with = rows.iter().rev().find_map(|row| row.agreement).map_or_else(String::new, |last| {
        format!(
            " (in the last, the best constant answer is within τ in {:.3} of the ticks; at τ scaled as the labels, {:.3}, \
             the network is in {:.3})",
            last.constant_within_tau, last.tau_scaled, last.within_tau_scaled
        )
    });
    Statement {
        claim: format!("η̂ rises over the iterations to more than {eta}"),
        verdict,
        figures: format!("η̂ = {}{read_with}; paper .44, .64, .65, .74, .90", shares.join(", ")),
    }
}

/// The weight α τ̂ makes Σ τ̂ smaller: the ratio of an iteration lies below one. Decided by pairs of trainings; one pair,
/// whose interval is for other samples, says nothing of another seed's.
pub fn effect_of_the_weight(iteration: u32, of_samples: Option<Interval>, by_seed: &[f64]) -> Statement {
    let of_seeds = (by_seed.len() >= TRAININGS_MIN).then(|| {
        let (mean, half_width) = (by_seed.mean(), half_width_of_mean(by_seed));
        let pairs = by_seed.len() as u32;
        Interval { estimate: mean, lower: mean - half_width, upper: mean + half_width, units: pairs, apart: pairs }
    });
    // Student's interval holds for few values, other than the bootstrap's.
    let verdict = match of_seeds {
        Some(ratio) if ratio.upper < 1.0 => Verdict::Holds,
        Some(ratio) if ratio.lower > 1.0 => Verdict::DoesNotHold,
        _ => Verdict::CannotBeTold,
    };
    let figures = match (of_seeds, of_samples) {
        (Some(ratio), _) => {
            let each: Vec<String> = by_seed.iter().map(|ratio| format!("{ratio:.3}")).collect();
            format!(
                "Σ τ̂ with the weight over without, by seed: {}; mean {}; paper .62 … .91",
                each.join(", "),
                interval(ratio, 3)
            )
        }
        (None, Some(ratio)) => format!(
            "Σ τ̂ with the weight over without: {}, for other samples, not for other seeds; paper .62 … .91",
            interval(ratio, 3)
        ),
        (None, None) => "too few held-back samples".to_owned(),
    };
    let claim = format!("the weight on τ̂ lowers the network's error (iteration {iteration})");
    Statement { claim, verdict, figures }
}

#[cfg(test)]
mod tests;
