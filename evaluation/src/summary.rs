//! An evaluation, counted and judged: the tables as data.

use crate::format::{bound_per_100m, contacts_interval, quotable, quoted_interval};
use crate::incidents::Cause;
use crate::json;
use crate::judge::{Comparison, DriverEstimate};
use crate::plan::Plan;
use crate::results::EvaluationResults;
use crate::slices::Slice;
use crate::totals::Totals;
use crate::trainings::{self, Team, TeamEstimate};
use experiment::run_dir::RunDir;
use experiment::settings::{EvaluationSettings, NoiseChoice};
use serde::{Deserialize, Serialize};
use sim::scenario::Direction;
use std::path::Path;

/// The version of `summary.json` that this program writes.
pub const SCHEMA: u32 = 2;
const FILE: &str = "summary.json";

/// All tables of an evaluation; `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tables {
    /// Version of the format: [`SCHEMA`].
    pub schema: u32,
    /// Which trials.
    pub settings: EvaluationSettings,
    /// Drivers by slice, noise and direction.
    pub rows: Vec<Row>,
    /// Every other driver against one.
    pub comparisons: Vec<ComparisonRow>,
    /// What was trained several times, as one; empty if nothing was.
    pub trainings: Vec<TrainingsRow>,
    /// Near-collisions by cause.
    pub causes: Vec<CauseRow>,
    /// Drivers against noise.
    pub noise_sweep: Vec<SweepRow>,
}

impl Tables {
    /// Reads `summary.json`; `None` if nothing was evaluated there.
    ///
    /// # Errors
    /// If it is not what it should be, or of another version.
    pub fn read(folder: &Path) -> anyhow::Result<Option<Self>> {
        json::read_versioned(&folder.join(FILE), SCHEMA)
    }
}

/// A row of `summary.csv`: a driver on some lots at one noise level. Intervals are of 95 %.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Who drove.
    pub driver: String,
    /// Sensor noise.
    pub noise: NoiseChoice,
    /// Where: the label of a slice.
    pub lots: String,
    /// `both`, `forward` or `reverse`.
    pub direction: String,
    /// Runs driven.
    pub runs: u32,
    /// Length of the routes, metres: what rates are per.
    pub reference_m: f64,
    /// Way driven, metres.
    pub driven_m: f64,
    /// Near-collisions.
    pub near_collisions: u32,
    /// Near-collisions per 100 m of route.
    pub per_100m: f64,
    /// Exact Poisson interval, per 100 m.
    pub garwood_lower: f64,
    /// See `garwood_lower`.
    pub garwood_upper: f64,
    /// One-sided upper bound, per 100 m.
    pub one_sided_upper: f64,
    /// Interval by paired bootstrap, per 100 m.
    pub bootstrap_lower: Option<f64>,
    /// See `bootstrap_lower`.
    pub bootstrap_upper: Option<f64>,
    /// Variance of the rate over that of as many independent events.
    pub dispersion: Option<f64>,
    /// p-value of Pearson's X² of the counts, if events were independent.
    pub dispersion_p: Option<f64>,
    /// Mean over groups of lots and directions, per 100 m.
    pub per_100m_unweighted: Option<f64>,
    /// Mean over runs, 0…1.
    pub safe_ratio: f64,
    /// Interval by bootstrap.
    pub safe_ratio_lower: Option<f64>,
    /// See `safe_ratio_lower`.
    pub safe_ratio_upper: Option<f64>,
    /// Mean over groups of lots and directions.
    pub safe_ratio_unweighted: Option<f64>,
    /// Times the body touched something.
    pub contacts: u32,
    /// Interval of contacts per 100 m of route: the farther ends of the exact one and the bootstrap's. `None` in files of
    /// earlier versions.
    #[serde(default)]
    pub contacts_per_100m_lower: Option<f64>,
    /// See `contacts_per_100m_lower`.
    #[serde(default)]
    pub contacts_per_100m_upper: Option<f64>,
    /// Times the car got stuck.
    pub stuck: u32,
    /// Runs ended by the time limit.
    pub timed_out: u32,
    /// Runs given up: after too many events, or where nothing ahead on the route is free.
    pub given_up: u32,
    /// Driven way per simulated time, m/s.
    pub mean_speed_mps: f64,
    /// Least clearance in any run, metres.
    pub clearance_min_m: Option<f32>,
    /// Changes of the steering direction per 100 m driven.
    pub steering_reversals_per_100m: f64,
    /// Road-wheel angle steered per 100 m driven, radians.
    pub steering_effort_rad_per_100m: f64,
}

/// A row of `comparisons.csv`: differences are driver − `compared_with`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComparisonRow {
    /// Who drove.
    pub driver: String,
    /// The driver it is compared with.
    pub compared_with: String,
    /// Sensor noise.
    pub noise: NoiseChoice,
    /// Where: the label of a slice.
    pub lots: String,
    /// Runs both have driven.
    pub pairs: usize,
    /// Near-collisions per 100 m, driver − other.
    pub difference_per_100m: Option<f64>,
    /// Interval by paired bootstrap.
    pub difference_lower: Option<f64>,
    /// See `difference_lower`.
    pub difference_upper: Option<f64>,
    /// Whether the interval excludes zero.
    pub excludes_zero: Option<bool>,
    /// Rate ratio, driver / other.
    pub ratio: Option<f64>,
    /// Exact interval, if each event came by itself: not to be quoted where those of either driver cluster.
    pub ratio_lower: f64,
    /// See `ratio_lower`; `None` if unbounded.
    pub ratio_upper: Option<f64>,
    /// Exact test of equal rates, if each event came by itself.
    pub p_value: f64,
    /// The same, adjusted for the number of comparisons.
    pub p_holm: f64,
    /// Safe ratio, driver − other.
    pub difference_safe_ratio: Option<f64>,
    /// Interval by paired bootstrap.
    pub difference_safe_ratio_lower: Option<f64>,
    /// See `difference_safe_ratio_lower`.
    pub difference_safe_ratio_upper: Option<f64>,
}

impl Row {
    /// The interval that may be quoted, near-collisions per 100 m: that of [`quoted_interval`], by what the row holds.
    pub fn quoted_interval(&self) -> [f64; 2] {
        let bootstrap = self.bootstrap_lower.zip(self.bootstrap_upper).map(<[f64; 2]>::from);
        quotable([self.garwood_lower, self.garwood_upper], bootstrap, self.dispersion)
    }
}

/// A row of `trainings.csv`: several trainings of one method, as one, or another driver beside them. Intervals
/// of 95 % are for other lots and, where there are several, other trainings. Differences are team − `compared_with`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrainingsRow {
    /// The method, else the first of the trainings.
    pub driver: String,
    /// How many trainings it has; 1: no training, or one of its own kind.
    pub trainings: usize,
    /// The same of those it is compared with: of the driver that others are compared with, or of the first team where that one
    /// is of too few trainings to be in any.
    pub compared_with: String,
    /// Sensor noise.
    pub noise: NoiseChoice,
    /// Where: the label of a slice.
    pub lots: String,
    /// Near-collisions of each, with spaces between them: by seed, or in the order of the drivers where one's is not known.
    pub near_collisions: String,
    /// Contacts of each, in the same order.
    pub contacts: String,
    /// Near-collisions per 100 m of route, mean.
    pub per_100m: f64,
    /// See `per_100m`.
    pub per_100m_lower: f64,
    /// See `per_100m`.
    pub per_100m_upper: f64,
    /// Near-collisions per 100 m of route, team − other.
    pub difference_per_100m: f64,
    /// See `difference_per_100m`.
    pub difference_lower: f64,
    /// See `difference_per_100m`.
    pub difference_upper: f64,
    /// Contacts per 100 m of route, mean. `None` in files of earlier versions.
    #[serde(default)]
    pub contacts_per_100m: Option<f64>,
    /// See `contacts_per_100m`.
    #[serde(default)]
    pub contacts_per_100m_lower: Option<f64>,
    /// See `contacts_per_100m`.
    #[serde(default)]
    pub contacts_per_100m_upper: Option<f64>,
}

/// A row of `noise_sweep.csv`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SweepRow {
    /// Who drove.
    pub driver: String,
    /// Where: the label of a slice.
    pub lots: String,
    /// Sensor noise.
    pub noise: NoiseChoice,
    /// The noise as a multiple of `paper`; `None` for what the lots ask for.
    pub times_paper: Option<f64>,
    /// Length of the routes, metres: what rates are per.
    pub reference_m: f64,
    /// Near-collisions.
    pub near_collisions: u32,
    /// Near-collisions per 100 m of route.
    pub per_100m: f64,
    /// The interval that may be quoted, per 100 m: that of [`quoted_interval`].
    pub lower: f64,
    /// See `lower`.
    pub upper: f64,
    /// Mean over runs, 0…1.
    pub safe_ratio: f64,
}

/// Near-collisions of a cause.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CauseRow {
    /// Who drove.
    pub driver: String,
    /// Sensor noise.
    pub noise: NoiseChoice,
    /// Where: the label of a slice.
    pub lots: String,
    /// Its cause.
    pub cause: Cause,
    /// Near-collisions.
    pub near_collisions: u32,
}

/// One noise level in one slice, judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// Index of the noise level.
    pub level: usize,
    /// The lots.
    pub slice: Slice,
    /// Estimates by driver.
    pub estimates: Vec<DriverEstimate>,
    /// Every other driver against `compare_with`.
    pub comparisons: Vec<Comparison>,
    /// Estimates by team.
    pub teams: Vec<TeamEstimate>,
}

/// An evaluation, counted and judged.
#[derive(Debug)]
pub struct Summary<'a> {
    /// What was to be driven.
    pub plan: &'a Plan<'a>,
    /// Its results.
    pub results: &'a EvaluationResults,
    /// What was trained several times; empty if nothing was.
    pub teams: Vec<Team>,
    /// Level by level, slice by slice.
    judged: Vec<Judged>,
}

impl<'a> Summary<'a> {
    /// Judges what was driven.
    pub fn new(plan: &'a Plan<'a>, results: &'a EvaluationResults) -> Self {
        let evaluation = &plan.settings.evaluation;
        let slices = results.slices();
        let both = (0..evaluation.noise.len()).flat_map(|level| slices.iter().map(move |slice| (level, slice.clone())));
        let teams = trainings::teams(plan.drivers);
        let with = team_of(&teams, plan.compare_with);
        let judge = |(level, slice)| {
            let (estimates, comparisons) = results.judge(level, &slice, plan.compare_with, evaluation.seed);
            let of_teams = (!teams.is_empty())
                .then(|| results.judge_teams(level, &slice, &teams, with, &estimates, evaluation.seed))
                .flatten()
                .unwrap_or_default();
            Judged { level, slice, estimates, comparisons, teams: of_teams }
        };
        let judged = both.map(judge).collect();
        Self { plan, results, teams, judged }
    }

    /// The team that the others are compared with: that of `compare_with`, else the first, as where that one is of two trainings.
    pub fn team_compared_with(&self) -> &Team {
        &self.teams[team_of(&self.teams, self.plan.compare_with)]
    }

    /// The teams at a noise level, team by team, slice by slice.
    pub fn team_estimates(&self, level: usize) -> impl Iterator<Item = (&Team, &Judged, &TeamEstimate)> {
        let of_team = move |(index, team)| {
            self.at_level(level).filter_map(move |judged| Some((team, judged, judged.teams.get(index)?)))
        };
        self.teams.iter().enumerate().flat_map(of_team)
    }

    /// The result of each training of a team in a slice.
    pub fn of_team(&self, team: &Team, judged: &Judged) -> Vec<Totals> {
        team.drivers.iter().map(|&driver| self.results.totals(judged.level, driver, &judged.slice, None)).collect()
    }

    /// Everything that the tables hold.
    pub fn tables(&self) -> Tables {
        Tables {
            schema: SCHEMA,
            settings: self.plan.settings.evaluation.clone(),
            rows: self.rows(),
            comparisons: self.comparison_rows(),
            trainings: self.training_rows(),
            causes: self.cause_rows(),
            noise_sweep: self.sweep_rows(),
        }
    }

    /// Writes `summary.json`, `summary.csv`, `comparisons.csv`, `trainings.csv` if something was trained several times, and
    /// `noise_sweep.csv` if there are several levels.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, run: &RunDir) -> anyhow::Result<()> {
        let tables = self.tables();
        run.write(FILE, json::to_text(&tables)?.as_bytes())?;
        run.write("summary.csv", &csv_of(&tables.rows)?)?;
        if !tables.comparisons.is_empty() {
            run.write("comparisons.csv", &csv_of(&tables.comparisons)?)?;
        }
        if !tables.trainings.is_empty() {
            run.write("trainings.csv", &csv_of(&tables.trainings)?)?;
        }
        if self.levels().len() > 1 {
            run.write("noise_sweep.csv", &csv_of(&tables.noise_sweep)?)?;
        }
        Ok(())
    }

    /// The noise levels, in the order of their indices.
    pub fn levels(&self) -> &'a [NoiseChoice] {
        &self.plan.settings.evaluation.noise
    }

    /// The name of a driver.
    pub fn driver(&self, index: usize) -> &'a str {
        &self.plan.drivers[index].name
    }

    /// What was judged at a noise level, slice by slice.
    pub fn at_level(&self, level: usize) -> impl Iterator<Item = &Judged> {
        let slices = self.judged.len() / self.levels().len();
        self.judged[level * slices..][..slices].iter()
    }

    /// Driver by driver, slice by slice, where anything was driven.
    pub fn estimates(&self, level: usize) -> impl Iterator<Item = (usize, &Judged, Totals)> {
        (0..self.plan.drivers.len()).flat_map(move |driver| {
            self.at_level(level).filter_map(move |judged| {
                let totals = self.results.totals(level, driver, &judged.slice, None);
                (totals.runs > 0).then_some((driver, judged, totals))
            })
        })
    }

    fn rows(&self) -> Vec<Row> {
        let ways = [("both", None), ("forward", Some(Direction::Forward)), ("reverse", Some(Direction::Reverse))];
        let mut rows = Vec::new();
        for level in 0..self.levels().len() {
            for (driver, judged, _) in self.estimates(level) {
                for (name, direction) in ways {
                    let totals = self.results.totals(level, driver, &judged.slice, direction);
                    if totals.runs > 0 {
                        rows.push(self.row(driver, judged, name, &totals));
                    }
                }
            }
        }
        rows
    }

    fn row(&self, driver: usize, judged: &Judged, direction: &str, totals: &Totals) -> Row {
        let rate = totals.rate();
        // Only the whole is resampled and weighed.
        let is_whole = direction == "both";
        let estimate = if is_whole { judged.estimates[driver].clone() } else { DriverEstimate::default() };
        let [contacts_lower, contacts_upper] = contacts_interval(totals, &estimate);
        let unweighted = (is_whole && judged.slice.is_pooled())
            .then(|| self.results.unweighted(judged.level, driver, &judged.slice));
        Row {
            driver: self.driver(driver).to_owned(),
            noise: self.levels()[judged.level],
            lots: judged.slice.label.clone(),
            direction: direction.to_owned(),
            runs: totals.runs,
            reference_m: totals.reference_m,
            driven_m: totals.driven_m,
            near_collisions: totals.near_collisions,
            per_100m: rate.per_unit,
            garwood_lower: rate.lower,
            garwood_upper: rate.upper,
            one_sided_upper: bound_per_100m(totals.near_collisions, totals.reference_m),
            bootstrap_lower: estimate.per_100m.map(|interval| interval.lower),
            bootstrap_upper: estimate.per_100m.map(|interval| interval.upper),
            dispersion: estimate.dispersion.map(|dispersion| dispersion.index),
            dispersion_p: estimate.dispersion.map(|dispersion| dispersion.p_value),
            per_100m_unweighted: unweighted.map(|[rate, _]| rate),
            safe_ratio: totals.safe_ratio(),
            safe_ratio_lower: estimate.safe_ratio.map(|interval| interval.lower),
            safe_ratio_upper: estimate.safe_ratio.map(|interval| interval.upper),
            safe_ratio_unweighted: unweighted.map(|[_, safe_ratio]| safe_ratio),
            contacts: totals.contacts,
            contacts_per_100m_lower: Some(contacts_lower),
            contacts_per_100m_upper: Some(contacts_upper),
            stuck: totals.stuck,
            timed_out: totals.timed_out,
            given_up: totals.given_up,
            mean_speed_mps: totals.mean_speed_mps(),
            clearance_min_m: totals.clearance_min_m,
            steering_reversals_per_100m: totals.reversals_per_100m(),
            steering_effort_rad_per_100m: totals.effort_rad_per_100m(),
        }
    }

    fn comparison_rows(&self) -> Vec<ComparisonRow> {
        let row = |judged: &Judged, comparison: &Comparison| ComparisonRow {
            driver: self.driver(comparison.driver).to_owned(),
            compared_with: self.driver(self.plan.compare_with).to_owned(),
            noise: self.levels()[judged.level],
            lots: judged.slice.label.clone(),
            pairs: comparison.pairs,
            difference_per_100m: comparison.difference_per_100m.map(|interval| interval.estimate),
            difference_lower: comparison.difference_per_100m.map(|interval| interval.lower),
            difference_upper: comparison.difference_per_100m.map(|interval| interval.upper),
            excludes_zero: comparison.difference_per_100m.map(|interval| interval.excludes_zero()),
            ratio: comparison.ratio.ratio,
            ratio_lower: comparison.ratio.lower,
            ratio_upper: comparison.ratio.upper,
            p_value: comparison.ratio.p_value,
            p_holm: comparison.p_holm,
            difference_safe_ratio: comparison.difference_safe_ratio.map(|interval| interval.estimate),
            difference_safe_ratio_lower: comparison.difference_safe_ratio.map(|interval| interval.lower),
            difference_safe_ratio_upper: comparison.difference_safe_ratio.map(|interval| interval.upper),
        };
        let rows = self.judged.iter().flat_map(|judged| judged.comparisons.iter().map(move |c| (judged, c)));
        rows.map(|(judged, comparison)| row(judged, comparison)).collect()
    }

    fn training_rows(&self) -> Vec<TrainingsRow> {
        let row = |level: usize, (team, judged, estimate): (&Team, &Judged, &TeamEstimate)| {
            let each = self.of_team(team, judged);
            let join = |count: fn(&Totals) -> u32| {
                each.iter().map(|totals| count(totals).to_string()).collect::<Vec<_>>().join(" ")
            };
            TrainingsRow {
                driver: team.name.clone(),
                trainings: team.drivers.len(),
                compared_with: self.team_compared_with().name.clone(),
                noise: self.levels()[level],
                lots: judged.slice.label.clone(),
                near_collisions: join(|totals| totals.near_collisions),
                contacts: join(|totals| totals.contacts),
                per_100m: estimate.per_100m.estimate,
                per_100m_lower: estimate.per_100m.lower,
                per_100m_upper: estimate.per_100m.upper,
                difference_per_100m: estimate.difference_per_100m.estimate,
                difference_lower: estimate.difference_per_100m.lower,
                difference_upper: estimate.difference_per_100m.upper,
                contacts_per_100m: Some(estimate.contacts_per_100m.estimate),
                contacts_per_100m_lower: Some(estimate.contacts_per_100m.lower),
                contacts_per_100m_upper: Some(estimate.contacts_per_100m.upper),
            }
        };
        let levels = 0..self.levels().len();
        levels.flat_map(|level| self.team_estimates(level).map(move |of_team| row(level, of_team))).collect()
    }

    fn sweep_rows(&self) -> Vec<SweepRow> {
        let mut rows = Vec::new();
        for (level, &noise) in self.levels().iter().enumerate() {
            for (driver, judged, totals) in self.estimates(level) {
                let [lower, upper] = quoted_interval(&totals, &judged.estimates[driver]);
                rows.push(SweepRow {
                    driver: self.driver(driver).to_owned(),
                    lots: judged.slice.label.clone(),
                    noise,
                    times_paper: noise.times_paper(),
                    reference_m: totals.reference_m,
                    near_collisions: totals.near_collisions,
                    per_100m: totals.rate().per_unit,
                    lower,
                    upper,
                    safe_ratio: totals.safe_ratio(),
                });
            }
        }
        rows
    }

    fn cause_rows(&self) -> Vec<CauseRow> {
        let mut rows = Vec::new();
        for (level, &noise) in self.levels().iter().enumerate() {
            for (driver, judged, _) in self.estimates(level) {
                rows.extend(Cause::ALL.map(|cause| CauseRow {
                    driver: self.driver(driver).to_owned(),
                    noise,
                    lots: judged.slice.label.clone(),
                    cause,
                    near_collisions: self.results.count_of_cause(level, driver, &judged.slice, cause),
                }));
            }
        }
        rows
    }
}

/// The index of the team of a driver, else of the first: two trainings of one recipe are no team.
fn team_of(teams: &[Team], driver: usize) -> usize {
    teams.iter().position(|team| team.has(driver)).unwrap_or(0)
}

/// Rows as CSV with a header.
///
/// # Errors
/// If a row cannot be written as one.
pub fn csv_of(rows: &[impl Serialize]) -> anyhow::Result<Vec<u8>> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    for row in rows {
        csv.serialize(row)?;
    }
    Ok(csv.into_inner()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use experiment::drivers::NamedDriver;
    use experiment::lots::Lot;
    use experiment::settings::Settings;
    use experiment::trained::Training;
    use experiment::trials::{Purpose, Trial};
    use sim::episode::EpisodeReport;
    use sim::frame::Ending;
    use sim::metrics::EpisodeMetrics;
    use sim::seed::RootSeed;

    /// `noise_sweep.csv`, and the plot of it, had exact intervals where the tables had those of the bootstrap.
    #[test]
    fn the_noise_sweep_has_the_intervals_of_the_tables() {
        let mut settings = Settings::preset("default").unwrap();
        settings.evaluation.noise = vec![NoiseChoice::Clean, NoiseChoice::Paper];
        let drivers = [NamedDriver::expert(&settings.expert)];
        let lots = Lot::parse_all(&["lot-b"], &settings.episode.vehicle).unwrap();
        let plan = Plan { settings: &settings, drivers: &drivers, lots: &lots, compare_with: 0, shard: None };
        let mut results = EvaluationResults::new(&plan);
        for (index, trial) in Trial::all(RootSeed(1), Purpose::Evaluation, &lots, 6, &Direction::BOTH).enumerate() {
            // One in every trial on the clean grid; with noise, as many and more in a single one.
            let of_levels = [u32::from(trial.direction == Direction::Forward), if trial.index == 0 { 9 } else { 0 }];
            for (level, near_collisions) in of_levels.into_iter().enumerate() {
                let metrics = EpisodeMetrics { near_collisions, reference_m: 100.0, ..EpisodeMetrics::default() };
                let report = EpisodeReport { ending: Ending::ReachedEnd, metrics, events: Vec::new() };
                results.add(level, 0, index, &trial, &report);
            }
        }
        let tables = Summary::new(&plan, &results).tables();
        let both: Vec<&Row> = tables.rows.iter().filter(|row| row.direction == "both").collect();
        let of_tables: Vec<[f64; 2]> = both.iter().map(|row| row.quoted_interval()).collect();
        let of_sweep: Vec<[f64; 2]> = tables.noise_sweep.iter().map(|row| [row.lower, row.upper]).collect();
        assert_eq!(of_sweep, of_tables);
        let exact: Vec<[f64; 2]> = both.iter().map(|row| [row.garwood_lower, row.garwood_upper]).collect();
        assert!(of_sweep[0] == exact[0] && of_sweep[1][1] > 1.5 * exact[1][1], "{of_sweep:?} {exact:?}");
    }

    /// Beside several trainings, `trainings.csv` had the bootstrap's interval of the expert where the first table had the exact one.
    #[test]
    fn a_driver_by_itself_has_one_interval_in_all_tables() {
        let settings = Settings::preset("default").unwrap();
        let expert = NamedDriver::expert(&settings.expert);
        let mut drivers: Vec<NamedDriver> = (0..3).map(|i| expert.clone().renamed(&format!("mine {i}"))).collect();
        for driver in &mut drivers {
            driver.method = Some("mine".to_owned());
        }
        drivers.push(expert);
        let lots = Lot::parse_all(&["lot-b"], &settings.episode.vehicle).unwrap();
        let plan = Plan { settings: &settings, drivers: &drivers, lots: &lots, compare_with: 0, shard: None };
        // Spread over the trials, and all in one of them.
        let of_trials: [fn(u32) -> u32; 2] = [|trial| trial % 2, |trial| if trial == 0 { 12 } else { 0 }];
        for of_trial in of_trials {
            let mut results = EvaluationResults::new(&plan);
            for (index, trial) in Trial::all(RootSeed(1), Purpose::Evaluation, &lots, 12, &Direction::BOTH).enumerate()
            {
                let near_collisions = of_trial(trial.index);
                let metrics = EpisodeMetrics { near_collisions, reference_m: 100.0, ..EpisodeMetrics::default() };
                let report = EpisodeReport { ending: Ending::ReachedEnd, metrics, events: Vec::new() };
                for driver in 0..drivers.len() {
                    results.add(0, driver, index, &trial, &report);
                }
            }
            let tables = Summary::new(&plan, &results).tables();
            let alone = tables.trainings.iter().find(|row| row.trainings == 1).unwrap();
            let row = tables.rows.iter().find(|row| (&*row.driver, &*row.direction) == ("expert", "both")).unwrap();
            assert_eq!([alone.per_100m_lower, alone.per_100m_upper], row.quoted_interval());
        }
    }

    /// It was compared with whoever stood first, because it is not counted.
    #[test]
    fn a_training_of_a_seed_that_is_there_already_is_compared_with_its_own_team() {
        let settings = Settings::preset("default").unwrap();
        let expert = NamedDriver::expert(&settings.expert);
        let trained = |name: &str, seed| {
            let mut driver = expert.clone().renamed(name);
            driver.training = Some(Training { recipe: "mine".to_owned(), seed: RootSeed(seed) });
            driver
        };
        let mine = [trained("mine 1", 1), trained("mine 2", 2), trained("mine 3", 3), trained("mine 1 again", 1)];
        let drivers: Vec<NamedDriver> = std::iter::once(expert).chain(mine).collect();
        let lots = Lot::parse_all(&["lot-b"], &settings.episode.vehicle).unwrap();
        let plan = Plan { settings: &settings, drivers: &drivers, lots: &lots, compare_with: 4, shard: None };
        let mut results = EvaluationResults::new(&plan);
        for (index, trial) in Trial::all(RootSeed(1), Purpose::Evaluation, &lots, 12, &Direction::BOTH).enumerate() {
            for driver in 0..drivers.len() {
                let near_collisions = u32::from(driver > 0);
                let metrics = EpisodeMetrics { near_collisions, reference_m: 100.0, ..EpisodeMetrics::default() };
                let report = EpisodeReport { ending: Ending::ReachedEnd, metrics, events: Vec::new() };
                results.add(0, driver, index, &trial, &report);
            }
        }
        let tables = Summary::new(&plan, &results).tables();
        let [of_expert, of_mine] = &tables.trainings[..] else { panic!("two rows: {:?}", tables.trainings) };
        for (row, name, difference) in [(of_expert, "expert", -1.0), (of_mine, "mine 1", 0.0)] {
            assert_eq!((&*row.driver, &*row.compared_with), (name, "mine 1"));
            assert!((row.difference_per_100m - difference).abs() < 1e-9, "{row:?}");
        }
    }
}
