//! What drivers did on lots unlike those they were trained on, one row per kind of lot.

use crate::markdown::{escaped, with_header};
use comfy_table::Table;
use evaluation::format::quoted_rate;
use evaluation::judge::DriverEstimate;
use evaluation::results::EvaluationResults;
use evaluation::slices::{Slice, SliceKind};
use evaluation::totals::Totals;
use experiment::run_dir::RunDir;
use serde::Serialize;
use sim::seed::RootSeed;

/// One driver on one kind of lot.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// Kind of lot, or `all`.
    pub lots: String,
    /// Whether a driver was trained on lots of this kind and name.
    pub trained_on: bool,
    /// Who drove.
    pub driver: String,
    /// Sum of the routes, metres.
    pub route_m: f64,
    /// Near-collisions in all.
    pub near_collisions: u32,
    /// Times something was touched.
    pub contacts: u32,
    /// Times no progress was made.
    pub stuck: u32,
    /// Least clearance, metres; below 0 the body overlapped something.
    pub least_clearance_m: Option<f32>,
    /// Near-collisions per 100 m with the interval that may be quoted.
    #[serde(skip)]
    quoted: String,
}

/// The rows of an evaluation at its first noise level, kind by kind, driver by driver; `seed` is that of its trials.
pub fn rows(results: &EvaluationResults, drivers: &[&str], seed: RootSeed) -> Vec<Row> {
    let is_trained_on = |slice: &Slice| {
        let mut groups = (0..).zip(results.groups());
        slice.kind == SliceKind::Group && groups.any(|(group, lots)| lots.is_trained_on && slice.contains(group))
    };
    let row = |slice: &Slice, driver: usize, estimate: &DriverEstimate| {
        let totals = results.totals(0, driver, slice, None);
        let Totals { reference_m, near_collisions, contacts, stuck, clearance_min_m, .. } = totals;
        Row {
            lots: slice.label.clone(),
            trained_on: is_trained_on(slice),
            driver: drivers[driver].to_owned(),
            route_m: reference_m,
            near_collisions,
            contacts,
            stuck,
            least_clearance_m: clearance_min_m,
            quoted: quoted_rate(&totals, estimate),
        }
    };
    let of_slice = |slice: Slice| {
        let (estimates, _) = results.judge(0, &slice, 0, seed);
        estimates.iter().enumerate().map(|(driver, estimate)| row(&slice, driver, estimate)).collect::<Vec<_>>()
    };
    results.slices().into_iter().flat_map(of_slice).collect()
}

/// Writes `elsewhere.md`; returns its text.
///
/// # Errors
/// If the file cannot be written.
pub fn write(rows: &[Row], drivers: &[&str], run: &RunDir) -> anyhow::Result<String> {
    let text = table(rows, drivers).to_string();
    run.write("elsewhere.md", format!("{text}\n").as_bytes())?;
    Ok(text)
}

/// A line per kind of lot, for each driver `near-collisions (contacts; least clearance)`, and the rate of the last one.
fn table(rows: &[Row], drivers: &[&str]) -> Table {
    let mut header = vec!["lots".to_owned(), "route".to_owned()];
    header.extend(drivers.iter().map(|driver| format!("{driver}: near-coll. (contacts; least m)")));
    header.extend(drivers.last().map(|driver| format!("{driver} per 100 m [95 %]")));
    let mut table = with_header(header);
    for of_lots in rows.chunks(drivers.len()) {
        let mark = if of_lots[0].trained_on { " (trained on)" } else { "" };
        let mut cells = vec![format!("{}{mark}", escaped(&of_lots[0].lots)), format!("{:.0} m", of_lots[0].route_m)];
        cells.extend(of_lots.iter().map(|row| {
            let least = row.least_clearance_m.map_or_else(|| "–".to_owned(), |metres| format!("{metres:.2}"));
            format!("{} ({}; {least})", row.near_collisions, row.contacts)
        }));
        cells.extend(of_lots.last().map(|row| row.quoted.clone()));
        table.add_row(cells);
    }
    table
}
