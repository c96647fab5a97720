//! Near-collisions against the number of different lots that were trained on.

use crate::markdown::table_of;
use crate::plots::{self, RatePoint, RateSeries};
use crate::trainings_table::{TrainingsTable, columns_of};
use anyhow::Context as _;
use evaluation::drive_stage::DriveStage;
use evaluation::format::{difference, quoted_interval, quoted_rate};
use evaluation::names::{BC, DAGGER};
use evaluation::results::EvaluationResults;
use evaluation::scaling::{self, Extent};
use evaluation::stage::Stage;
use evaluation::statistics::bootstrap::Interval;
use evaluation::summary::csv_of;
use evaluation::table1::Table1;
use experiment::lots::{self, Lot};
use experiment::settings::Settings;
use policy::dagger::Keep;
use policy::fit::Budget;
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
    /// Near-collisions per 100 m, this less that of the same method on the next larger number of lots; empty for the largest.
    difference_per_100m: Option<f64>,
    difference_lower: Option<f64>,
    difference_upper: Option<f64>,
    #[serde(skip)]
    quoted: String,
    #[serde(skip)]
    difference: Option<Interval>,
}

/// Networks of a method that learned from so many lots.
struct Learned {
    method: &'static str,
    different_lots: usize,
    samples: usize,
    /// Their number among the drivers.
    driver: usize,
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
    let mut table = table_of(&[
        "different lots",
        "method",
        "samples",
        "route",
        "near-collisions (contacts)",
        "per 100 m [95 %]",
        "less that of more lots",
    ]);
    for row in &totals {
        table.add_row(vec![
            row.different_lots.to_string(),
            row.method.to_owned(),
            row.samples.to_string(),
            format!("{:.1} km", row.route_m / 1000.0),
            format!("{} ({})", row.near_collisions, row.contacts),
            row.quoted.clone(),
            difference(row.difference, 2),
        ]);
    }
    let text = format!("{table}\n\n{}", legend(settings, &totals));
    Ok(TrainingsTable { csv: csv_of(&rows)?, svg: plot(&totals), text })
}

/// How the table is read.
fn legend(settings: &Settings, rows: &[&Row]) -> String {
    let samples = rows.iter().filter(|row| row.method == DAGGER).map(|row| row.samples).collect::<BTreeSet<_>>();
    let kept = match settings.dagger.keep {
        Keep::ExpertTicks if samples.len() > 1 => {
            "; DAgger keeps the expert's ticks, and where these are few it has fewer samples"
        }
        Keep::ExpertTicks | Keep::EveryTick => "",
    };
    // More samples take more steps where passes over them are counted.
    let is_of_steps = matches!(settings.dagger.fit.budget, Budget::Steps(_));
    let steps = if is_of_steps { "drives and optimiser steps" } else { "drives" };
    format!(
        "Of one training of each, with as many {steps}{kept}. All drove the same lots: differences are paired. Intervals of 95 % are for other lots, not for \
         other seeds (*: excludes zero); (b): where near-collisions come in clusters, the farther ends of the exact interval and a bootstrap."
    )
}

fn rows(settings: &Settings, extent: &Extent, stages: &[Stage], root: &Path) -> anyhow::Result<Vec<Row>> {
    let drive = DriveStage::load(stages.last().context("the last stage drives")?)?;
    let results = EvaluationResults::read(&drive.plan(), &root.join(scaling::DRIVES))?;
    let listed = Lot::parse_all(&settings.training.lots, &settings.episode.vehicle)?;
    let of_a_kind = lots::generated_by_kind(&listed);
    let mut learned: Vec<Learned> = Vec::new();
    for (at, different) in ascending(&extent.different_lots) {
        let folder = root.join(scaling::folder(different));
        let table1 = Table1::read(&folder)?.with_context(|| format!("{}: no table1.json", folder.display()))?;
        let samples = [table1.rows.first(), table1.rows.last()].map(|row| row.map_or(0, |row| row.dataset));
        let lots_met = [1, table1.rows.len()]
            .map(|rounds| scaling::lots_met(of_a_kind.values().map(|&listed| listed as usize), different, rounds));
        for (part, method) in [BC, DAGGER].into_iter().enumerate() {
            let found =
                Learned { method, different_lots: lots_met[part], samples: samples[part], driver: 2 * at + part };
            // A training meets no more lots than its rounds list: of as many samples it is the same network again.
            let is_again = |known: &Learned| {
                (known.method, known.different_lots, known.samples) == (method, found.different_lots, found.samples)
            };
            if !learned.iter().any(is_again) {
                learned.push(found);
            }
        }
    }
    let slices = results.slices();
    let seed = drive.settings().evaluation.seed;
    let mut rows = Vec::new();
    for (at, of) in learned.iter().enumerate() {
        let next = learned[at + 1..].iter().find(|next| next.method == of.method);
        for slice in &slices {
            let (estimates, comparisons) = results.judge(0, slice, next.map_or(of.driver, |next| next.driver), seed);
            let (totals, estimate) = (results.totals(0, of.driver, slice, None), &estimates[of.driver]);
            let [lower, upper] = quoted_interval(&totals, estimate);
            let compared = comparisons.iter().find(|comparison| comparison.driver == of.driver);
            let difference = compared.and_then(|comparison| comparison.difference_per_100m);
            let [difference_per_100m, difference_lower, difference_upper] = columns_of(difference);
            rows.push(Row {
                different_lots: of.different_lots,
                method: of.method,
                samples: of.samples,
                lots: slice.label.clone(),
                route_m: totals.reference_m,
                near_collisions: totals.near_collisions,
                contacts: totals.contacts,
                per_100m: totals.rate().per_unit,
                lower,
                upper,
                difference_per_100m,
                difference_lower,
                difference_upper,
                quoted: quoted_rate(&totals, estimate),
                difference,
            });
        }
    }
    Ok(rows)
}

/// The numbers of lots from the smallest on, each with its place among those asked for.
fn ascending(different_lots: &[u32]) -> Vec<(usize, u32)> {
    let mut numbers: Vec<(usize, u32)> = different_lots.iter().copied().enumerate().collect();
    numbers.sort_by_key(|&(_, lots)| lots);
    numbers
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Of `--different 16,1,4` the rate of one lot was subtracted from that of sixteen, as that of more lots.
    #[test]
    fn each_number_of_lots_is_compared_with_the_next_larger_one_however_they_are_named() {
        assert_eq!(ascending(&[16, 1, 4]), [(1, 1), (2, 4), (0, 16)]);
        assert_eq!(ascending(&[1, 4]), [(0, 1), (1, 4)]);
    }
}
