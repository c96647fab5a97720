//! Near-collisions against the number of different lots that were trained on.

use crate::markdown::table_of;
use crate::plots::{self, RatePoint, RateSeries};
use crate::trainings_table::TrainingsTable;
use anyhow::Context as _;
use evaluation::drive_stage::DriveStage;
use evaluation::format::{quoted_interval, quoted_rate};
use evaluation::names::{BC, DAGGER};
use evaluation::results::EvaluationResults;
use evaluation::scaling::{self, Extent};
use evaluation::stage::Stage;
use evaluation::summary::csv_of;
use evaluation::table1::Table1;
use experiment::lots::{self, Lot};
use experiment::settings::Settings;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::Path;

/// What was trained on so many lots, on lots of one kind or on all of them.
#[derive(Debug, Clone, Serialize)]
struct Row {
    /// Different generated lots that were trained on, of all kinds together.
    different_lots: usize,
    /// `BC` or `DAgger`.
    method: &'static str,
    /// Labelled ticks that were trained on.
    samples: usize,
    /// Kind of lot that was driven on.
    lots: String,
    /// Sum of the routes, metres.
    route_m: f64,
    near_collisions: u32,
    contacts: u32,
    per_100m: f64,
    lower: f64,
    upper: f64,
    #[serde(skip)]
    quoted: String,
}

/// Above the table.
pub const TITLE: &str = "Near-collisions against different lots";

/// The table, by what the stages left in the folder `root`.
///
/// # Errors
/// If what a stage wrote cannot be read.
pub fn table(settings: &Settings, extent: &Extent, stages: &[Stage], root: &Path) -> anyhow::Result<TrainingsTable> {
    let rows = rows(settings, extent, stages, root)?;
    let totals: Vec<&Row> = rows.iter().filter(|row| row.lots == rows[rows.len() - 1].lots).collect();
    let mut table =
        table_of(&["different lots", "method", "samples", "route", "near-collisions (contacts)", "per 100 m [95 %]"]);
    for row in &totals {
        table.add_row(vec![
            row.different_lots.to_string(),
            row.method.to_owned(),
            row.samples.to_string(),
            format!("{:.1} km", row.route_m / 1000.0),
            format!("{} ({})", row.near_collisions, row.contacts),
            row.quoted.clone(),
        ]);
    }
    let text = format!("{table}\n\n{LEGEND}");
    Ok(TrainingsTable { csv: csv_of(&rows)?, svg: plot(&totals), text })
}

const LEGEND: &str = "Of one training of each, with as many drives and optimiser steps; DAgger keeps the expert's ticks, so that its samples \
    differ. Intervals of 95 % are for other lots, not for other seeds; (b): where near-collisions come \
    in clusters, the farther ends of the exact interval and a bootstrap.";

fn rows(settings: &Settings, extent: &Extent, stages: &[Stage], root: &Path) -> anyhow::Result<Vec<Row>> {
    let drive = DriveStage::load(stages.last().context("the last stage drives")?)?;
    let results = EvaluationResults::read(&drive.plan(), &root.join(scaling::DRIVES))?;
    let listed = Lot::parse_all(&settings.training.lots, &settings.episode.vehicle)?;
    let of_a_kind = lots::generated_by_kind(&listed);
    let judge = |slice| {
        let (estimates, _) = results.judge(0, &slice, 0, drive.settings().evaluation.seed);
        (slice, estimates)
    };
    let judged: Vec<_> = results.slices().into_iter().map(judge).collect();
    let mut rows = Vec::new();
    for (at, &different) in extent.different_lots.iter().enumerate() {
        let folder = root.join(scaling::folder(different));
        let table1 = Table1::read(&folder)?.with_context(|| format!("{}: no table1.json", folder.display()))?;
        let samples = [table1.rows.first(), table1.rows.last()].map(|row| row.map_or(0, |row| row.dataset));
        let lots_met = [1, table1.rows.len()]
            .map(|rounds| scaling::lots_met(of_a_kind.values().map(|&listed| listed as usize), different, rounds));
        for (part, method) in [BC, DAGGER].into_iter().enumerate() {
            // A training meets no more lots than its rounds list: of as many samples it is the same network again.
            let is_known =
                |row: &Row| (row.method, row.different_lots, row.samples) == (method, lots_met[part], samples[part]);
            if rows.iter().any(is_known) {
                continue;
            }
            for (slice, estimates) in &judged {
                let totals = results.totals(0, 2 * at + part, slice, None);
                let estimate = &estimates[2 * at + part];
                let [lower, upper] = quoted_interval(&totals, estimate);
                rows.push(Row {
                    different_lots: lots_met[part],
                    method,
                    samples: samples[part],
                    lots: slice.label.clone(),
                    route_m: totals.reference_m,
                    near_collisions: totals.near_collisions,
                    contacts: totals.contacts,
                    per_100m: totals.rate().per_unit,
                    lower,
                    upper,
                    quoted: quoted_rate(&totals, estimate),
                });
            }
        }
    }
    Ok(rows)
}

fn plot(rows: &[&Row]) -> String {
    let of = |method: &'static str| rows.iter().filter(move |row| row.method == method);
    let counts: BTreeSet<usize> = rows.iter().map(|row| row.different_lots).collect();
    let point = |row: &Row| RatePoint {
        x: counts.range(..row.different_lots).count() as f64,
        per_100m: row.per_100m,
        interval: [row.lower, row.upper],
    };
    let series = [BC, DAGGER]
        .map(|method| RateSeries { name: method.to_owned(), points: of(method).map(|row| point(row)).collect() });
    let counts: Vec<String> = counts.iter().map(ToString::to_string).collect();
    plots::rates_against_lots("Near-collisions on unseen lots", &counts, &series)
}
