//! What each deviation from the paper does.

use crate::markdown::table_of;
use crate::plots::{self, RateRow};
use crate::trainings_table::{TrainingsTable, columns_of};
use anyhow::Context as _;
use evaluation::deviations::{self, BASE};
use evaluation::drive_stage::DriveStage;
use evaluation::format::{difference, quoted_interval, quoted_rate};
use evaluation::names::{BC, DAGGER};
use evaluation::results::EvaluationResults;
use evaluation::stage::{Stage, Step};
use evaluation::statistics::bootstrap::Interval;
use evaluation::summary::csv_of;
use evaluation::table1::Table1;
use serde::Serialize;
use std::path::Path;

/// A policy of a training.
#[derive(Debug, Clone, Serialize)]
struct Row {
    /// The one thing that is as in the paper.
    deviation: String,
    of_paper: String,
    /// `BC` or `DAgger`.
    method: &'static str,
    /// Sum of the routes, metres.
    route_m: f64,
    near_collisions: u32,
    contacts: u32,
    per_100m: f64,
    lower: f64,
    upper: f64,
    /// Near-collisions per 100 m, this less that of the same method with everything as it is; empty where the car
    /// differs, so that the runs are not pairs.
    difference_per_100m: Option<f64>,
    difference_lower: Option<f64>,
    difference_upper: Option<f64>,
    /// Labelled ticks that were learned from.
    samples: usize,
    /// η̂ of the last iteration; empty for behaviour cloning.
    eta_hat: Option<f64>,
    #[serde(skip)]
    quoted: String,
    #[serde(skip)]
    difference: Option<Interval>,
}

/// Above the table.
pub const TITLE: &str = "One thing at a time as in the paper";

/// The table, by what the stages left in the folder `root`.
///
/// # Errors
/// If what a stage wrote cannot be read.
pub fn table(stages: &[Stage], root: &Path) -> anyhow::Result<TrainingsTable> {
    let mut rows = Vec::new();
    for stage in stages.iter().filter(|stage| matches!(stage.step, Step::Drive { .. })) {
        rows.extend(rows_of(stage, stages, root)?);
    }
    let mut table = table_of(&[
        "as in the paper",
        "method",
        "samples",
        "last η̂",
        "near-collisions (contacts)",
        "per 100 m [95 %]",
        "Δ to everything as it is",
    ]);
    for row in &rows {
        table.add_row([
            row.of_paper.clone(),
            row.method.to_owned(),
            row.samples.to_string(),
            row.eta_hat.map_or_else(|| "–".to_owned(), |eta_hat| format!("{eta_hat:.3}")),
            format!("{} ({}) in {:.1} km", row.near_collisions, row.contacts, row.route_m / 1000.0),
            row.quoted.clone(),
            difference(row.difference, 2),
        ]);
    }
    let text = format!("{table}\n\n{LEGEND}");
    Ok(TrainingsTable { csv: csv_of(&rows)?, svg: plot(&rows), text })
}

const LEGEND: &str = "Of one training of each: intervals of 95 % are for other lots, not for other seeds; (b): where near-collisions \
    come in clusters, the farther ends of the exact interval and a bootstrap. A difference that excludes zero (*) is one of many, and no adjustment is made for their number.";

fn rows_of(stage: &Stage, stages: &[Stage], root: &Path) -> anyhow::Result<Vec<Row>> {
    let drive = DriveStage::load(stage)?;
    let plan = drive.plan();
    let results = EvaluationResults::read(&plan, &root.join(&stage.folder))?;
    let everywhere = results.slices().pop().context("lots were driven on")?;
    let index_of = |name: &str| plan.drivers.iter().position(|driver| driver.name == name);
    let mut rows = Vec::new();
    for (which, method) in [BC, DAGGER].into_iter().enumerate() {
        let base = index_of(&deviations::names(BASE)[which]);
        let (estimates, comparisons) =
            results.judge(0, &everywhere, base.unwrap_or(0), drive.settings().evaluation.seed);
        for training in stages {
            let Some(driver) = index_of(&deviations::names(&training.folder)[which]) else { continue };
            let folder = root.join(&training.folder);
            let table1 = Table1::read(&folder)?.with_context(|| format!("{}: no table1.json", folder.display()))?;
            let round = if which == 0 { table1.rows.first() } else { table1.rows.last() };
            let totals = results.totals(0, driver, &everywhere, None);
            let estimate = &estimates[driver];
            let [lower, upper] = quoted_interval(&totals, estimate);
            let comparison = comparisons.iter().find(|comparison| comparison.driver == driver);
            let difference = comparison.filter(|_| base.is_some()).and_then(|found| found.difference_per_100m);
            let of_paper = deviations::called(&training.folder).map_or("nothing", |deviation| deviation.of_paper);
            let [difference_per_100m, difference_lower, difference_upper] = columns_of(difference);
            rows.push(Row {
                deviation: training.folder.clone(),
                of_paper: of_paper.to_owned(),
                method,
                route_m: totals.reference_m,
                near_collisions: totals.near_collisions,
                contacts: totals.contacts,
                per_100m: totals.rate().per_unit,
                lower,
                upper,
                difference_per_100m,
                difference_lower,
                difference_upper,
                samples: round.map_or(0, |round| round.dataset),
                eta_hat: round.and_then(|round| round.eta_hat),
                quoted: quoted_rate(&totals, estimate),
                difference,
            });
        }
    }
    Ok(rows)
}

fn plot(rows: &[Row]) -> String {
    let row = |row: &Row| RateRow {
        name: format!("{}, {}", row.method, row.deviation),
        per_100m: row.per_100m,
        interval: [row.lower, row.upper],
        group: usize::from(row.method == DAGGER),
    };
    plots::rates("One thing as in the paper", &rows.iter().map(row).collect::<Vec<_>>())
}
