//! Tables of an evaluation, as Markdown, JSON and CSV.

use crate::evaluate::Plan;
use crate::failures::Cause;
use crate::paper::{self, PaperLot, PaperResult};
use crate::run_dir::RunDir;
use crate::settings::{EvaluationSettings, NoiseChoice};
use crate::summary::{Comparison, DriverEstimate, EvaluationResults, Slice, Totals};
use crate::trials::Trial;
use comfy_table::{Table, presets};
use serde::Serialize;
use sim::episode::EpisodeReport;
use sim::frame::Ending;
use sim::scenario::Direction;
use statistics::bootstrap::{DRAWS, Interval};
use statistics::poisson::{CONFIDENCE, DISPERSION_MAX, Rate, upper_bound};
use std::fmt::Write as _;

/// A table that is both readable in a terminal and Markdown.
pub fn markdown(header: Vec<String>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN).set_header(header);
    table
}

pub(crate) fn table_of(header: &[&str]) -> Table {
    markdown(header.iter().map(|&title| title.to_owned()).collect())
}

/// One run, as a line of `runs.jsonl`.
#[derive(Debug, Serialize)]
pub struct RunLine<'a> {
    driver: &'a str,
    lot: &'a str,
    direction: Direction,
    trial: u32,
    noise: NoiseChoice,
    timed_out: bool,
    mean_speed_mps: f32,
    replay: String,
    #[serde(flatten)]
    report: &'a EpisodeReport,
}

impl<'a> RunLine<'a> {
    /// Of a finished run; `replay` is its key ([`crate::replay_key`]).
    pub fn new(
        driver: &'a str,
        job: &Trial<'a>,
        noise: NoiseChoice,
        replay: String,
        report: &'a EpisodeReport,
    ) -> Self {
        let timed_out = report.ending == Ending::TimedOut;
        let mean_speed_mps = report.metrics.mean_speed_mps();
        let (lot, direction, trial) = (job.lot.name(), job.direction, job.trial);
        Self { driver, lot, direction, trial, noise, timed_out, mean_speed_mps, replay, report }
    }
}

/// What a run took, as a line of `wall_time.jsonl`: apart, because everything else is the same in every repetition.
#[derive(Debug, Serialize)]
pub struct WallTimeLine<'a> {
    /// Who drove.
    pub driver: &'a str,
    /// Where.
    pub lot: &'a str,
    /// Which way.
    pub direction: Direction,
    /// Which trial.
    pub trial: u32,
    /// What was seen wrongly.
    pub noise: NoiseChoice,
    /// Seconds: the run's share, by decisions, of what its group took in lock-step.
    pub wall_s: f64,
}

/// A row of `summary.csv`: a driver on some lots at one noise level. Intervals are of 95 %.
#[derive(Debug, Clone, Serialize)]
struct Row {
    driver: String,
    noise: NoiseChoice,
    lots: String,
    direction: &'static str,
    runs: u32,
    reference_m: f64,
    driven_m: f64,
    near_collisions: u32,
    per_100m: f64,
    garwood_lower: f64,
    garwood_upper: f64,
    one_sided_upper: f64,
    bootstrap_lower: Option<f64>,
    bootstrap_upper: Option<f64>,
    dispersion: Option<f64>,
    dispersion_p: Option<f64>,
    per_100m_unweighted: Option<f64>,
    safe_ratio: f64,
    safe_ratio_lower: Option<f64>,
    safe_ratio_upper: Option<f64>,
    safe_ratio_unweighted: Option<f64>,
    contacts: u32,
    stuck: u32,
    timed_out: u32,
    given_up: u32,
    mean_speed_mps: f64,
    clearance_min_m: Option<f32>,
    steering_reversals_per_100m: f64,
    steering_effort_rad_per_100m: f64,
}

/// A row of `comparisons.csv`: differences are driver − `compared_with`.
#[derive(Debug, Clone, Serialize)]
struct ComparisonRow {
    driver: String,
    compared_with: String,
    noise: NoiseChoice,
    lots: String,
    pairs: usize,
    difference_per_100m: Option<f64>,
    difference_lower: Option<f64>,
    difference_upper: Option<f64>,
    excludes_zero: Option<bool>,
    ratio: Option<f64>,
    ratio_lower: f64,
    ratio_upper: Option<f64>,
    p_value: f64,
    p_holm: f64,
    difference_safe_ratio: Option<f64>,
    difference_safe_ratio_lower: Option<f64>,
    difference_safe_ratio_upper: Option<f64>,
}

/// A row of `noise_sweep.csv`.
#[derive(Debug, Clone, Serialize)]
struct SweepRow {
    driver: String,
    lots: String,
    noise: NoiseChoice,
    times_paper: Option<f64>,
    reference_m: f64,
    near_collisions: u32,
    per_100m: f64,
    lower: f64,
    upper: f64,
    safe_ratio: f64,
}

/// Near-collisions of a cause.
#[derive(Debug, Clone, Serialize)]
struct CauseRow {
    driver: String,
    noise: NoiseChoice,
    lots: String,
    cause: Cause,
    near_collisions: u32,
}

/// One noise level in one slice, judged.
struct Judged {
    level: usize,
    slice: Slice,
    estimates: Vec<DriverEstimate>,
    comparisons: Vec<Comparison>,
}

/// An evaluation, counted and judged.
pub struct Summary<'a> {
    plan: &'a Plan<'a>,
    results: &'a EvaluationResults,
    /// Level by level, slice by slice.
    judged: Vec<Judged>,
}

impl<'a> Summary<'a> {
    /// Judges what was driven.
    pub fn new(plan: &'a Plan<'a>, results: &'a EvaluationResults) -> Self {
        let evaluation = &plan.settings.evaluation;
        let slices = Slice::all_of(results);
        let both = (0..evaluation.noise.len()).flat_map(|level| slices.iter().map(move |slice| (level, slice.clone())));
        let judge = |(level, slice)| {
            let (estimates, comparisons) = results.judge(level, &slice, plan.compare_with, evaluation.seed);
            Judged { level, slice, estimates, comparisons }
        };
        Self { plan, results, judged: both.map(judge).collect() }
    }

    /// Writes `summary.md`, `.json`, `.csv`, `comparisons.csv`, and `noise_sweep.csv` if there are several levels.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, run: &RunDir) -> anyhow::Result<()> {
        let (rows, comparisons, sweep) = (self.rows(), self.comparison_rows(), self.sweep_rows());
        run.write("summary.md", format!("{}\n", self.to_markdown()).as_bytes())?;
        let json = serde_json::json!({
            "settings": self.plan.settings.evaluation,
            "rows": rows,
            "comparisons": comparisons,
            "causes": self.cause_rows(),
            "noise_sweep": sweep,
        });
        run.write("summary.json", format!("{}\n", serde_json::to_string_pretty(&json)?).as_bytes())?;
        run.write("summary.csv", &csv_of(&rows)?)?;
        if !comparisons.is_empty() {
            run.write("comparisons.csv", &csv_of(&comparisons)?)?;
        }
        if self.levels().len() > 1 {
            run.write("noise_sweep.csv", &csv_of(&sweep)?)?;
        }
        Ok(())
    }

    /// All tables.
    pub fn to_markdown(&self) -> String {
        let mut text = String::new();
        for (level, noise) in self.levels().iter().enumerate() {
            let has_paper = *noise == NoiseChoice::Paper;
            let _ = write!(text, "Near-collisions, noise {noise}\n\n{}\n\n", self.rates_table(level, has_paper));
            let _ = write!(text, "Safe ratio, noise {noise}\n\n{}\n\n", self.safe_ratio_table(level, has_paper));
            let _ = write!(text, "How they drove, noise {noise}\n\n{}\n\n", self.driving_table(level));
            if self.plan.entries.len() > 1 {
                let with = self.driver(self.plan.compare_with);
                let table = self.comparison_table(level);
                let _ = write!(text, "Compared with {with} (others − {with}), noise {noise}\n\n{table}\n\n");
            }
            if let Some(table) = self.causes_table(level) {
                let _ = write!(text, "Causes of near-collisions, noise {noise}\n\n{table}\n\n");
            }
        }
        if self.levels().len() > 1 {
            let _ = write!(text, "Near-collisions per 100 m against noise\n\n{}\n\n", self.sweep_table());
        }
        let EvaluationSettings { seed, trials, .. } = &self.plan.settings.evaluation;
        let _ = write!(
            text,
            "Trials per lot and direction: {trials}, seed: {}. Intervals of 95 %: exact Poisson, or (b) paired bootstrap \
             ({DRAWS} draws over lot, direction, seed) where the dispersion exceeds {DISPERSION_MAX} and events cannot be \
             taken for independent; safe ratios and differences: bootstrap; * = excludes zero; p: exact test of equal \
             rates, and after Holm. Rates are per length of the route: for runs given up early they are too low.",
            seed.0
        );
        text
    }

    fn levels(&self) -> &[NoiseChoice] {
        &self.plan.settings.evaluation.noise
    }

    fn driver(&self, index: usize) -> &str {
        &self.plan.entries[index].contestant.name
    }

    fn at_level(&self, level: usize) -> impl Iterator<Item = &Judged> {
        self.judged.iter().filter(move |judged| judged.level == level)
    }

    /// Driver by driver, slice by slice, where anything was driven.
    fn estimates(&self, level: usize) -> impl Iterator<Item = (usize, &Judged, Totals)> {
        (0..self.plan.entries.len()).flat_map(move |driver| {
            self.at_level(level).filter_map(move |judged| {
                let totals = self.results.totals(level, driver, &judged.slice, None);
                (totals.runs > 0).then_some((driver, judged, totals))
            })
        })
    }

    /// The paper's rows of the lots that were driven: its own driver's, and those of its planners that took part.
    fn paper_rows(&self) -> impl Iterator<Item = (&'static str, &'static PaperLot, &'static PaperResult)> {
        let took_part = |driver: &str| (0..self.plan.entries.len()).any(|index| self.driver(index) == driver);
        let lots = paper::LOTS.iter().filter(|lot| self.results.families().iter().any(|family| family.name == lot.lot));
        let drivers = (0..).zip(paper::DRIVERS).filter(move |&(index, driver)| index == 0 || took_part(driver));
        drivers.flat_map(move |(index, driver)| lots.clone().map(move |lot| (driver, lot, &lot.results[index])))
    }

    fn rates_table(&self, level: usize, has_paper: bool) -> Table {
        let mut table = table_of(&[
            "driver",
            "lots",
            "route",
            "near-collisions (→, ←)",
            "per 100 m [95 %]",
            "unweighted",
            "dispersion",
        ]);
        for (driver, judged, totals) in self.estimates(level) {
            let way = |direction| {
                let totals = self.results.totals(level, driver, &judged.slice, Some(direction));
                if totals.runs == 0 { "–".to_owned() } else { totals.near_collisions.to_string() }
            };
            let [forward, reverse] = Direction::BOTH.map(way);
            let estimate = &judged.estimates[driver];
            table.add_row([
                self.driver(driver).to_owned(),
                judged.slice.label.clone(),
                format!("{:.0} m", totals.reference_m),
                format!("{} ({forward}, {reverse})", totals.near_collisions),
                quoted_rate(&totals, estimate),
                self.unweighted(level, driver, &judged.slice, 0, 2),
                estimate.dispersion.map_or_else(|| "–".to_owned(), |dispersion| format!("{:.1}", dispersion.index)),
            ]);
        }
        for (driver, lot, paper) in self.paper_rows().filter(|_| has_paper) {
            let [forward, reverse] = paper.near_collisions;
            table.add_row([
                format!("paper: {driver}"),
                lot.lot.to_owned(),
                format!("{:.0} m", lot.driven_m()),
                format!("{} ({forward}, {reverse})", forward + reverse),
                exact_rate(forward + reverse, lot.driven_m()),
                String::new(),
                "–".to_owned(),
            ]);
        }
        table
    }

    fn safe_ratio_table(&self, level: usize, has_paper: bool) -> Table {
        let mut table = table_of(&["driver", "lots", "runs", "safe ratio [95 %]", "unweighted"]);
        for (driver, judged, totals) in self.estimates(level) {
            let interval = judged.estimates[driver].safe_ratio;
            let interval = interval.map_or_else(String::new, |i| format!(" [{:.3}, {:.3}]", i.lower, i.upper));
            table.add_row([
                self.driver(driver).to_owned(),
                judged.slice.label.clone(),
                totals.runs.to_string(),
                format!("{:.3}{interval}", totals.safe_ratio()),
                self.unweighted(level, driver, &judged.slice, 1, 3),
            ]);
        }
        for (driver, lot, paper) in self.paper_rows().filter(|_| has_paper) {
            let ratio = format!("{:.2}", paper.safe_ratio);
            table.add_row([format!("paper: {driver}"), lot.lot.to_owned(), "10".to_owned(), ratio, String::new()]);
        }
        table
    }

    /// The mean over lots and directions with equal weights; empty where there is nothing to weigh.
    fn unweighted(&self, level: usize, driver: usize, slice: &Slice, which: usize, digits: usize) -> String {
        if slice.is_pooled() {
            format!("{:.digits$}", self.results.unweighted(level, driver, slice)[which])
        } else {
            String::new()
        }
    }

    fn driving_table(&self, level: usize) -> Table {
        let mut table = table_of(&[
            "driver",
            "lots",
            "contacts",
            "stuck",
            "timed out",
            "given up",
            "m/s",
            "least clearance m",
            "reversals /100 m",
            "steering rad/100 m",
        ]);
        for (driver, judged, totals) in self.estimates(level) {
            table.add_row([
                self.driver(driver).to_owned(),
                judged.slice.label.clone(),
                totals.contacts.to_string(),
                totals.stuck.to_string(),
                totals.timed_out.to_string(),
                totals.given_up.to_string(),
                format!("{:.2}", totals.mean_speed_mps()),
                totals.clearance_min_m.map_or_else(|| "–".to_owned(), |metres| format!("{metres:.2}")),
                format!("{:.1}", totals.reversals_per_100m()),
                format!("{:.1}", totals.effort_rad_per_100m()),
            ]);
        }
        table
    }

    fn comparison_table(&self, level: usize) -> Table {
        let mut table = table_of(&[
            "driver",
            "lots",
            "Δ per 100 m [95 %]",
            "rate ratio [95 %]",
            "p",
            "p Holm",
            "Δ safe ratio [95 %]",
        ]);
        for driver in 0..self.plan.entries.len() {
            for judged in self.at_level(level) {
                for comparison in judged.comparisons.iter().filter(|comparison| comparison.driver == driver) {
                    let ratio = &comparison.ratio;
                    let number =
                        |value: Option<f64>| value.map_or_else(|| "∞".to_owned(), |value| format!("{value:.2}"));
                    table.add_row([
                        self.driver(driver).to_owned(),
                        judged.slice.label.clone(),
                        difference(comparison.difference_per_100m, 2),
                        match ratio.ratio {
                            Some(value) => format!("{value:.2} [{:.2}, {}]", ratio.lower, number(ratio.upper)),
                            None => format!("– [{:.2}, {}]", ratio.lower, number(ratio.upper)),
                        },
                        p_value(ratio.p_value),
                        p_value(comparison.p_holm),
                        difference(comparison.difference_safe_ratio, 3),
                    ]);
                }
            }
        }
        table
    }

    fn causes_table(&self, level: usize) -> Option<Table> {
        let mut header = vec!["driver", "lots"];
        header.extend(Cause::ALL.map(Cause::name));
        header.extend(["again at the same place", "places per 100 m"]);
        let mut table = table_of(&header);
        for (driver, judged, totals) in self.estimates(level).filter(|(.., totals)| totals.near_collisions > 0) {
            let count = |cause| self.results.count_of_cause(level, driver, &judged.slice, cause);
            let share = |cause| format!("{:.0} %", 100.0 * f64::from(count(cause)) / f64::from(totals.near_collisions));
            let mut row = vec![self.driver(driver).to_owned(), judged.slice.label.clone()];
            row.extend(Cause::ALL.map(|cause| format!("{} ({})", count(cause), share(cause))));
            let again = self.results.count_of_again(level, driver, &judged.slice);
            let places = f64::from(totals.near_collisions.saturating_sub(again));
            row.extend([again.to_string(), format!("{:.2}", 100.0 * places / totals.reference_m)]);
            table.add_row(row);
        }
        (table.row_count() > 0).then_some(table)
    }

    fn sweep_table(&self) -> Table {
        let mut header = vec!["driver".to_owned(), "lots".to_owned()];
        header.extend(self.levels().iter().map(|noise| format!("noise {noise}")));
        let mut table = markdown(header);
        for driver in 0..self.plan.entries.len() {
            for slice in Slice::all_of(self.results) {
                let rate = |level| {
                    let totals = self.results.totals(level, driver, &slice, None);
                    if totals.runs == 0 {
                        "–".to_owned()
                    } else {
                        exact_rate(totals.near_collisions, totals.reference_m)
                    }
                };
                let mut row = vec![self.driver(driver).to_owned(), slice.label.clone()];
                row.extend((0..self.levels().len()).map(rate));
                table.add_row(row);
            }
        }
        table
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

    fn row(&self, driver: usize, judged: &Judged, direction: &'static str, totals: &Totals) -> Row {
        let rate = totals.rate();
        // Resampled and weighed is only the whole.
        let is_whole = direction == "both";
        let estimate = if is_whole { judged.estimates[driver].clone() } else { DriverEstimate::default() };
        let unweighted = (is_whole && judged.slice.is_pooled())
            .then(|| self.results.unweighted(judged.level, driver, &judged.slice));
        Row {
            driver: self.driver(driver).to_owned(),
            noise: self.levels()[judged.level],
            lots: judged.slice.label.clone(),
            direction,
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

    fn sweep_rows(&self) -> Vec<SweepRow> {
        let mut rows = Vec::new();
        for (level, &noise) in self.levels().iter().enumerate() {
            for (driver, judged, totals) in self.estimates(level) {
                let rate = totals.rate();
                rows.push(SweepRow {
                    driver: self.driver(driver).to_owned(),
                    lots: judged.slice.label.clone(),
                    noise,
                    times_paper: noise.times_paper(),
                    reference_m: totals.reference_m,
                    near_collisions: totals.near_collisions,
                    per_100m: rate.per_unit,
                    lower: rate.lower,
                    upper: rate.upper,
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

pub(crate) fn csv_of(rows: &[impl Serialize]) -> anyhow::Result<Vec<u8>> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    for row in rows {
        csv.serialize(row)?;
    }
    Ok(csv.into_inner()?)
}

/// The rate with the interval that may be quoted (methods.md 8.3).
pub(crate) fn quoted_rate(totals: &Totals, estimate: &DriverEstimate) -> String {
    let is_clustered = estimate.dispersion.is_some_and(|dispersion| dispersion.index > DISPERSION_MAX);
    match estimate.per_100m.filter(|_| is_clustered) {
        Some(Interval { lower, upper, .. }) => {
            format!("{:.2} [{lower:.2}, {upper:.2}] (b)", totals.rate().per_unit)
        }
        None => exact_rate(totals.near_collisions, totals.reference_m),
    }
}

/// The rate with its exact interval; for a count of zero the bound it really supports.
pub(crate) fn exact_rate(near_collisions: u32, reference_m: f64) -> String {
    let rate = Rate::new(near_collisions, reference_m / 100.0);
    let interval = format!("{:.2} [{:.2}, {:.2}]", rate.per_unit, rate.lower, rate.upper);
    if near_collisions > 0 {
        return interval;
    }
    format!("{interval}, < {:.3} one-sided", bound_per_100m(0, reference_m))
}

fn bound_per_100m(near_collisions: u32, reference_m: f64) -> f64 {
    100.0 * upper_bound(near_collisions, CONFIDENCE) / reference_m
}

pub(crate) fn difference(interval: Option<Interval>, digits: usize) -> String {
    interval.map_or_else(
        || "–".to_owned(),
        |interval| {
            let Interval { estimate, lower, upper } = interval;
            let mark = if interval.excludes_zero() { " *" } else { "" };
            format!("{estimate:+.digits$} [{lower:+.digits$}, {upper:+.digits$}]{mark}")
        },
    )
}

fn p_value(p: f64) -> String {
    if p < 1e-4 { "< .0001".to_owned() } else { format!("{p:.4}") }
}

/// A direction in tables.
pub fn name(direction: Direction) -> &'static str {
    match direction {
        Direction::Forward => "forward",
        Direction::Reverse => "reverse",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zero_says_what_it_supports_and_clusters_are_quoted_by_the_bootstrap() {
        assert_eq!(exact_rate(0, 5180.0), "0.00 [0.00, 0.07], < 0.058 one-sided");
        assert_eq!(exact_rate(71, 5180.0), "1.37 [1.07, 1.73]");
        let totals = Totals { near_collisions: 71, reference_m: 5180.0, ..Totals::default() };
        let interval = Interval { estimate: 1.37, lower: 0.9, upper: 2.0 };
        let estimate = |index| DriverEstimate {
            dispersion: Some(statistics::poisson::Dispersion { index, freedom: 9, p_value: 0.1 }),
            per_100m: Some(interval),
            safe_ratio: None,
        };
        assert_eq!(quoted_rate(&totals, &estimate(1.5)), "1.37 [1.07, 1.73]");
        assert_eq!(quoted_rate(&totals, &estimate(1.6)), "1.37 [0.90, 2.00] (b)");
        assert_eq!(difference(Some(interval), 1), "+1.4 [+0.9, +2.0] *");
        let around_zero = Interval { lower: -0.1, ..interval };
        assert_eq!(difference(Some(around_zero), 1), "+1.4 [-0.1, +2.0]");
    }
}
