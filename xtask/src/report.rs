//! Tables of an evaluation, as Markdown, JSON and CSV.

use crate::run_dir::RunDir;
use crate::settings::EvaluationSettings;
use crate::summary::{Cell, Cells, Rate, Totals};
use comfy_table::{Table, presets};
use serde::Serialize;
use sim::scenario::Direction;

/// A table that is both readable in a terminal and Markdown.
pub fn markdown(header: Vec<String>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN).set_header(header);
    table
}

/// The paper's results on a lot (methods.md 0): five trials in both directions.
struct PaperRow {
    lot: &'static str,
    length_m: f64,
    dagger_safe_ratio: f64,
}

const PAPER: [PaperRow; 3] = [
    PaperRow { lot: "lot-a", length_m: 231.0, dagger_safe_ratio: 0.83 },
    PaperRow { lot: "lot-b", length_m: 139.0, dagger_safe_ratio: 0.72 },
    PaperRow { lot: "lot-c", length_m: 149.0, dagger_safe_ratio: 0.91 },
];

/// What was driven.
#[derive(Debug, Clone, Copy)]
pub struct Evaluation<'a> {
    /// With which trials.
    pub settings: &'a EvaluationSettings,
    /// What came of it.
    pub cells: &'a Cells,
}

/// One run, as a line of `episodes.jsonl`.
#[derive(Debug, Serialize)]
pub struct RunLine<'a> {
    /// Who drove.
    pub driver: &'a str,
    /// Where.
    pub lot: &'a str,
    /// Which way.
    pub direction: Direction,
    /// Which trial.
    pub trial: u32,
    /// What came of it.
    #[serde(flatten)]
    pub report: &'a sim::episode::EpisodeReport,
}

/// A row of the JSON and CSV tables.
#[derive(Debug, Serialize)]
struct Row<'a> {
    driver: &'a str,
    lot: &'a str,
    direction: &'a str,
    runs: u32,
    reference_m: f64,
    near_collisions: u32,
    near_collisions_per_100m: f64,
    lower_95: f64,
    upper_95: f64,
    safe_ratio: f64,
    contacts: u32,
    stuck: u32,
    timed_out: u32,
    given_up: u32,
    mean_speed_mps: f64,
    clearance_min_m: Option<f32>,
    steering_reversals: u32,
}

impl Evaluation<'_> {
    /// Writes `evaluation.md`, `.json` and `.csv`.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, run: &RunDir) -> anyhow::Result<()> {
        run.write("evaluation.md", format!("{}\n", self.to_markdown()).as_bytes())?;
        let rows = self.rows();
        let json = serde_json::json!({ "settings": self.settings, "rows": rows });
        run.write("evaluation.json", format!("{}\n", serde_json::to_string_pretty(&json)?).as_bytes())?;
        let mut csv = csv::Writer::from_writer(Vec::new());
        for row in &rows {
            csv.serialize(row)?;
        }
        run.write("evaluation.csv", &csv.into_inner()?)
    }

    /// Driver by lot (generated lots of one kind together), the paper's rows below.
    pub fn to_markdown(&self) -> String {
        let header = [
            "driver",
            "lot",
            "route",
            "near-collisions (→, ←)",
            "per 100 m [95 %]",
            "safe ratio",
            "contacts",
            "stuck",
            "timed out",
            "given up",
            "m/s",
        ];
        let mut table = markdown(header.map(str::to_owned).to_vec());
        let families = self.cells.families();
        for driver in self.cells.drivers() {
            for family in families.iter().copied().map(Some).chain((families.len() > 1).then_some(None)) {
                table.add_row(self.markdown_row(driver, family));
            }
        }
        for paper in PAPER.iter().filter(|paper| families.contains(&paper.lot)) {
            table.add_row(paper_row(paper));
        }
        let EvaluationSettings { seed, trials, noise, .. } = self.settings;
        format!("{table}\n\nTrials per lot and direction: {trials}, noise: {}, seed: {}.", noise.name(), seed.0)
    }

    /// A driver on a family of lots, or on all.
    fn markdown_row(&self, driver: &str, family: Option<&str>) -> Vec<String> {
        let is_here = |cell: &Cell| cell.driver == driver && family.is_none_or(|family| cell.family == family);
        let totals = self.cells.pooled(is_here);
        let [forward, reverse] = Direction::BOTH.map(|direction| {
            let way = self.cells.pooled(|cell| is_here(cell) && cell.direction == direction);
            if way.runs == 0 { "–".to_owned() } else { way.near_collisions.to_string() }
        });
        vec![
            driver.to_owned(),
            family.map_or_else(|| "all".to_owned(), |family| self.cells.family_label(family)),
            format!("{:.0} m", totals.reference_m),
            format!("{} ({forward}, {reverse})", totals.near_collisions),
            with_interval(&totals.rate()),
            format!("{:.3}", totals.safe_ratio()),
            totals.contacts.to_string(),
            totals.stuck.to_string(),
            totals.timed_out.to_string(),
            totals.given_up.to_string(),
            format!("{:.2}", totals.mean_speed_mps()),
        ]
    }

    /// Every cell, then every driver's lots with both directions, then its sum.
    fn rows(&self) -> Vec<Row<'_>> {
        let mut rows: Vec<Row<'_>> = self
            .cells
            .0
            .iter()
            .map(|Cell { driver, lot, direction, totals, .. }| Row::new(driver, lot, name(*direction), totals))
            .collect();
        for driver in self.cells.drivers() {
            for lot in self.cells.lots() {
                rows.push(Row::new(
                    driver,
                    lot,
                    "both",
                    &self.cells.pooled(|cell| cell.driver == driver && cell.lot == lot),
                ));
            }
            rows.push(Row::new(driver, "all", "both", &self.cells.pooled(|cell| cell.driver == driver)));
        }
        rows
    }
}

impl<'a> Row<'a> {
    fn new(driver: &'a str, lot: &'a str, direction: &'a str, totals: &Totals) -> Self {
        let rate = totals.rate();
        Self {
            driver,
            lot,
            direction,
            runs: totals.runs,
            reference_m: totals.reference_m,
            near_collisions: totals.near_collisions,
            near_collisions_per_100m: rate.per_unit,
            lower_95: rate.lower,
            upper_95: rate.upper,
            safe_ratio: totals.safe_ratio(),
            contacts: totals.contacts,
            stuck: totals.stuck,
            timed_out: totals.timed_out,
            given_up: totals.given_up,
            mean_speed_mps: totals.mean_speed_mps(),
            clearance_min_m: totals.clearance_min_m,
            steering_reversals: totals.steering_reversals,
        }
    }
}

fn paper_row(paper: &PaperRow) -> Vec<String> {
    let metres = 10.0 * paper.length_m;
    let unknown = || "–".to_owned();
    vec![
        "paper: DAgger".to_owned(),
        paper.lot.to_owned(),
        format!("{metres:.0} m"),
        "0 (0, 0)".to_owned(),
        with_interval(&Rate::new(0, metres / 100.0)),
        format!("{:.2}", paper.dagger_safe_ratio),
        unknown(),
        unknown(),
        unknown(),
        unknown(),
        unknown(),
    ]
}

fn with_interval(rate: &Rate) -> String {
    format!("{:.2} [{:.2}, {:.2}]", rate.per_unit, rate.lower, rate.upper)
}

/// A direction in tables.
pub fn name(direction: Direction) -> &'static str {
    match direction {
        Direction::Forward => "forward",
        Direction::Reverse => "reverse",
    }
}
