//! Tables of an evaluation as Markdown, which is readable in a terminal, too.

use crate::markdown::{escaped, table_of, with_header};
use crate::trainings::{self, HEADER};
use comfy_table::Table;
use evaluation::format::{clustered, difference, exact_rate, p_value, quoted_contacts, quoted_rate, rate_ratio};
use evaluation::incidents::{Cause, NEAR_M};
use evaluation::paper::{self, PaperLot, PaperResult};
use evaluation::slices::Slice;
use evaluation::statistics::bootstrap::DRAWS;
use evaluation::statistics::poisson::DISPERSION_MAX;
use evaluation::summary::{Judged, Summary};
use evaluation::totals::Totals;
use experiment::lots::Lot;
use experiment::run_dir::RunDir;
use experiment::settings::{EvaluationSettings, NoiseChoice};
use sim::scenario::Direction;
use std::fmt::Write as _;

/// Groups of lots up to which a terminal shows a row of each.
const GROUPS_SHOWN: usize = 16;

/// Which rows the tables have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rows {
    /// All.
    All,
    /// Those of many lots together.
    Pooled,
}

impl Rows {
    fn has(self, slice: &Slice) -> bool {
        self == Self::All || slice.is_pooled()
    }
}

/// Writes `summary.md`; returns what of its text is to be printed.
///
/// # Errors
/// If the file cannot be written.
pub fn write(summary: &Summary<'_>, run: &RunDir) -> anyhow::Result<String> {
    let text = to_markdown(summary, Rows::All);
    run.write("summary.md", format!("{text}\n").as_bytes())?;
    let groups = summary.results.groups().len();
    if groups <= GROUPS_SHOWN {
        return Ok(text);
    }
    let pooled = to_markdown(summary, Rows::Pooled);
    Ok(format!(
        "{pooled}\n\nThe rows of the {groups} lots or kinds of lots are in {}/summary.md.",
        run.path().display()
    ))
}

fn to_markdown(summary: &Summary<'_>, rows: Rows) -> String {
    let mut text = String::new();
    let mut causes = String::new();
    for (level, noise) in summary.levels().iter().enumerate() {
        let has_paper = *noise == NoiseChoice::Paper && rows == Rows::All;
        let _ = write!(text, "Near-collisions, noise {noise}\n\n{}\n\n", rates_table(summary, level, rows, has_paper));
        // Only those lots draw new obstacles in every trial.
        let fitted = if summary.plan.lots.iter().any(Lot::is_drawn_per_trial) {
            " (lots a, b and c are as wide as the expert needs for the paper's)"
        } else {
            ""
        };
        let _ = write!(
            text,
            "Safe ratio, noise {noise}{fitted}\n\n{}\n\n",
            safe_ratio_table(summary, level, rows, has_paper)
        );
        let _ = write!(text, "How they drove, noise {noise}\n\n{}\n\n", driving_table(summary, level, rows));
        if summary.plan.drivers.len() > 1 {
            let with = escaped(summary.driver(summary.plan.compare_with));
            let table = comparison_table(summary, level, rows);
            let _ = write!(text, "Compared with {with} (others − {with}), noise {noise}\n\n{table}\n\n");
        }
        if !summary.teams.is_empty() {
            let with = escaped(&summary.team_compared_with().name);
            let table = trainings_table(summary, level, rows);
            let is_judged = table.row_count() > 0;
            let table = if is_judged { table.to_string() } else { TOO_FEW.to_owned() };
            let _ = write!(
                text,
                "Several trainings, as one; intervals are for other lots and, where there are several, other trainings \
                 (Δ: others − {with}), noise {noise}\n\n{table}\n\n"
            );
        }
        if let Some(table) = causes_table(summary, level, rows) {
            let _ = write!(text, "Causes of near-collisions, noise {noise}\n\n{table}\n\n");
            causes = format!(
                "- Causes: the first rule of docs/methods.md 8.4 that holds. Again at the same place: within {NEAR_M} m of route \
                 after the car was put back; places per 100 m: all others.\n"
            );
        }
    }
    if summary.levels().len() > 1 {
        let _ =
            write!(text, "Near-collisions per 100 m; contacts: against noise\n\n{}\n\n", sweep_table(summary, rows));
    }
    let EvaluationSettings { seed, trials, .. } = &summary.plan.settings.evaluation;
    let near_m = summary.plan.settings.episode.metrics.near_collision_m;
    let _ = write!(
        text,
        "Trials per lot and direction: {trials}, seed: {}.\n\n\
         - Near-collision: something lies within {near_m} m in the direction of travel; the car is stopped, put back on the route \
         and drives on.\n\
         - (→, ←): forward, reverse. Rates are per length of the route: for runs given up early they are too low.\n\
         - Intervals of 95 %: exact Poisson, or (b) paired bootstrap ({DRAWS} draws of whole trials, both ways together; of whole \
         lots where these are a sample: generated, or six or more from files) where the dispersion exceeds {DISPERSION_MAX} and \
         events cannot be taken for independent; (b) is no narrower than the exact one. \"< one-sided\": the bound of 95 % where there was none.\n\
         - Dispersion: variance of the rate over what it would be if each near-collision came by itself.\n\
         - Contacts: times the body touched something, with the farther ends of both intervals, since one drive may have many.\n\
         - Unweighted: every lot, or all generated ones of a kind, and direction counts the same, however long its route.\n\
         - Stuck: no headway for a while. Given up: too many near-collisions in one run, or nothing free ahead on the route. \
         Timed out: the time limit. Least clearance: negative is how deep the body was in something. Reversals: changes of the \
         steering's direction. Steering: how far the wheels were turned in all.\n\
         {causes}\
         - Safe ratio: free share of the metre around the body; its intervals, and those of differences (Δ), are bootstrap.\n\
         - *: excludes zero, by six trials or lots that differ, or more. Rate ratio and p: exact test of equal rates; – where events of \
         either driver cluster, as for (b). Holm: adjusted for the drivers compared.\n\
         - –, elsewhere: too few trials, lots or events to say. More: docs/methods.md 8.",
        seed.0
    );
    text
}

/// The paper's rows of the lots that were driven: its own driver's, and those of its planners that took part.
fn paper_rows<'a>(
    summary: &'a Summary<'_>,
) -> impl Iterator<Item = (&'static str, &'static PaperLot, &'static PaperResult)> + use<'a> {
    let took_part = |driver: &str| (0..summary.plan.drivers.len()).any(|index| summary.driver(index) == driver);
    let lots = paper::LOTS.iter().filter(|lot| summary.results.groups().iter().any(|group| group.name == lot.lot));
    let drivers = (0..).zip(paper::DRIVERS).filter(move |&(index, driver)| index == 0 || took_part(driver));
    drivers.flat_map(move |(index, driver)| lots.clone().map(move |lot| (driver, lot, &lot.results[index])))
}

/// Driver by driver, slice by slice.
fn shown<'a>(summary: &'a Summary<'_>, level: usize, rows: Rows) -> impl Iterator<Item = (usize, &'a Judged, Totals)> {
    summary.estimates(level).filter(move |(_, judged, _)| rows.has(&judged.slice))
}

fn rates_table(summary: &Summary<'_>, level: usize, rows: Rows, has_paper: bool) -> Table {
    let mut table = table_of(&[
        "driver",
        "lots",
        "route",
        "near-collisions (→, ←)",
        "per 100 m [95 %]",
        "contacts",
        "unweighted",
        "dispersion",
    ]);
    for (driver, judged, totals) in shown(summary, level, rows) {
        let way = |direction| {
            let totals = summary.results.totals(level, driver, &judged.slice, Some(direction));
            if totals.runs == 0 { "–".to_owned() } else { totals.near_collisions.to_string() }
        };
        let [forward, reverse] = Direction::BOTH.map(way);
        let estimate = &judged.estimates[driver];
        table.add_row([
            escaped(summary.driver(driver)),
            escaped(&judged.slice.label),
            format!("{:.0} m", totals.reference_m),
            format!("{} ({forward}, {reverse})", totals.near_collisions),
            quoted_rate(&totals, estimate),
            totals.contacts.to_string(),
            unweighted(summary, level, driver, &judged.slice, 0, 2),
            estimate.dispersion.map_or_else(|| "–".to_owned(), |dispersion| format!("{:.1}", dispersion.index)),
        ]);
    }
    for (driver, lot, paper) in paper_rows(summary).filter(|_| has_paper) {
        let [forward, reverse] = paper.near_collisions;
        table.add_row([
            format!("paper: {driver}"),
            lot.lot.to_owned(),
            format!("{:.0} m", lot.driven_m()),
            format!("{} ({forward}, {reverse})", forward + reverse),
            exact_rate(forward + reverse, lot.driven_m()),
            "–".to_owned(),
            String::new(),
            "–".to_owned(),
        ]);
    }
    table
}

fn safe_ratio_table(summary: &Summary<'_>, level: usize, rows: Rows, has_paper: bool) -> Table {
    let mut table = table_of(&["driver", "lots", "runs", "safe ratio [95 %]", "unweighted"]);
    for (driver, judged, totals) in shown(summary, level, rows) {
        let interval = judged.estimates[driver].safe_ratio;
        let interval = interval.map_or_else(String::new, |i| format!(" [{:.3}, {:.3}]", i.lower, i.upper));
        table.add_row([
            escaped(summary.driver(driver)),
            escaped(&judged.slice.label),
            totals.runs.to_string(),
            format!("{:.3}{interval}", totals.safe_ratio()),
            unweighted(summary, level, driver, &judged.slice, 1, 3),
        ]);
    }
    for (driver, lot, paper) in paper_rows(summary).filter(|_| has_paper) {
        let ratio = format!("{:.2}", paper.safe_ratio);
        table.add_row([format!("paper: {driver}"), lot.lot.to_owned(), "10".to_owned(), ratio, String::new()]);
    }
    table
}

/// The mean over lots and directions with equal weights; empty where there is nothing to weigh.
fn unweighted(
    summary: &Summary<'_>,
    level: usize,
    driver: usize,
    slice: &Slice,
    which: usize,
    digits: usize,
) -> String {
    if slice.is_pooled() {
        format!("{:.digits$}", summary.results.unweighted(level, driver, slice)[which])
    } else {
        String::new()
    }
}

fn driving_table(summary: &Summary<'_>, level: usize, rows: Rows) -> Table {
    let mut table = table_of(&[
        "driver",
        "lots",
        "contacts: per 100 m [95 %]",
        "stuck",
        "timed out",
        "given up",
        "m/s",
        "least clearance m",
        "reversals /100 m",
        "steering rad/100 m",
    ]);
    for (driver, judged, totals) in shown(summary, level, rows) {
        table.add_row([
            escaped(summary.driver(driver)),
            escaped(&judged.slice.label),
            quoted_contacts(&totals, &judged.estimates[driver]),
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

fn comparison_table(summary: &Summary<'_>, level: usize, rows: Rows) -> Table {
    let mut table =
        table_of(&["driver", "lots", "Δ per 100 m [95 %]", "rate ratio [95 %]", "p", "p Holm", "Δ safe ratio [95 %]"]);
    for driver in 0..summary.plan.drivers.len() {
        for judged in summary.at_level(level).filter(|judged| rows.has(&judged.slice)) {
            for comparison in judged.comparisons.iter().filter(|comparison| comparison.driver == driver) {
                let ratio = &comparison.ratio;
                // These take events for independent.
                let is_exact = [driver, summary.plan.compare_with]
                    .iter()
                    .all(|&driver| clustered(&judged.estimates[driver]).is_none());
                let exact = |text: String| if is_exact { text } else { "–".to_owned() };
                table.add_row([
                    escaped(summary.driver(driver)),
                    escaped(&judged.slice.label),
                    difference(comparison.difference_per_100m, 2),
                    exact(rate_ratio(ratio)),
                    exact(p_value(ratio.p_value)),
                    exact(p_value(comparison.p_holm)),
                    difference(comparison.difference_safe_ratio, 3),
                ]);
            }
        }
    }
    table
}

/// In place of a table of trainings.
const TOO_FEW: &str = "Too little to judge by: at least six lots of a sample, or six trials of other lots, are needed.";

fn trainings_table(summary: &Summary<'_>, level: usize, rows: Rows) -> Table {
    let mut table = table_of(&HEADER);
    for (team, judged, estimate) in summary.team_estimates(level).filter(|(_, judged, _)| rows.has(&judged.slice)) {
        let is_other = *team != *summary.team_compared_with();
        let each = summary.of_team(team, judged);
        table.add_row(trainings::row(team, &judged.slice.label, &each, estimate, is_other));
    }
    table
}

fn causes_table(summary: &Summary<'_>, level: usize, rows: Rows) -> Option<Table> {
    let mut header = vec!["driver", "lots"];
    header.extend(Cause::ALL.map(Cause::name));
    header.extend(["again at the same place", "places per 100 m"]);
    let mut table = table_of(&header);
    for (driver, judged, totals) in shown(summary, level, rows).filter(|(.., totals)| totals.near_collisions > 0) {
        let count = |cause| summary.results.count_of_cause(level, driver, &judged.slice, cause);
        let share = |cause| format!("{:.0} %", 100.0 * f64::from(count(cause)) / f64::from(totals.near_collisions));
        let mut row = vec![escaped(summary.driver(driver)), escaped(&judged.slice.label)];
        row.extend(Cause::ALL.map(|cause| format!("{} ({})", count(cause), share(cause))));
        let again = summary.results.count_of_again(level, driver, &judged.slice);
        let places = f64::from(totals.near_collisions.saturating_sub(again));
        row.extend([again.to_string(), format!("{:.2}", 100.0 * places / totals.reference_m)]);
        table.add_row(row);
    }
    (table.row_count() > 0).then_some(table)
}

fn sweep_table(summary: &Summary<'_>, rows: Rows) -> Table {
    let mut header = vec!["driver".to_owned(), "lots".to_owned()];
    header.extend(summary.levels().iter().map(|noise| format!("noise {noise}")));
    let mut table = with_header(header);
    let slices = summary.results.slices();
    for driver in 0..summary.plan.drivers.len() {
        for (place, slice) in slices.iter().enumerate().filter(|(_, slice)| rows.has(slice)) {
            let rate = |level| {
                let totals = summary.results.totals(level, driver, slice, None);
                let judged = summary.at_level(level).nth(place);
                let of_driven = judged.filter(|_| totals.runs > 0);
                of_driven.map_or_else(
                    || "–".to_owned(),
                    |judged| format!("{}; {}", quoted_rate(&totals, &judged.estimates[driver]), totals.contacts),
                )
            };
            let mut row = vec![escaped(summary.driver(driver)), escaped(&slice.label)];
            row.extend((0..summary.levels().len()).map(rate));
            table.add_row(row);
        }
    }
    table
}
