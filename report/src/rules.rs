//! The `DAgger` family at equal samples: what collecting cost, and how the policies drive.

use crate::markdown::table_of;
use crate::plots::{self, RatePoint, RateSeries};
use crate::trainings_table::{TrainingsTable, columns_of};
use anyhow::Context as _;
use evaluation::drive_stage::DriveStage;
use evaluation::format::{difference, quoted_interval, with_interval};
use evaluation::results::EvaluationResults;
use evaluation::rules::{self, Extent};
use evaluation::stage::Stage;
use evaluation::statistics::bootstrap::Interval;
use evaluation::summary::csv_of;
use evaluation::trainings::{TRAININGS_MIN, Team};
use experiment::settings::Settings;
use policy::dagger::Keep;
use policy::dataset::Collection;
use serde::Serialize;
use std::path::Path;

/// A training, or all seeds of a rule together.
#[derive(Debug, Clone, Default, Serialize)]
struct Row {
    rule: String,
    /// Root seed of the training; empty: all together.
    seed: Option<u64>,
    /// Labelled ticks that were learned from.
    samples: usize,
    /// Networks trained per round, critics included.
    networks: usize,
    /// Ticks driven in the iterations, by whomever.
    ticks: u64,
    /// … by the network.
    novice_ticks: u64,
    /// Ticks at which the method asks the expert.
    queries: u64,
    /// Times the expert took the wheel; empty where nobody else ever had it.
    interventions: Option<u64>,
    /// Mean length of an intervention, seconds.
    intervention_s: Option<f64>,
    /// Sum of the ways driven while collecting, metres.
    collected_m: f64,
    near_collisions_collecting: u32,
    contacts_collecting: u32,
    /// Sum of the routes on unseen lots, metres.
    route_m: f64,
    near_collisions: u32,
    contacts: u32,
    per_100m: f64,
    /// Empty of several seeds that have too few lots to be judged by.
    lower: Option<f64>,
    upper: Option<f64>,
    /// Near-collisions per 100 m, of all seeds together less those of the paper's rule; empty of one seed, and where the
    /// paper's rule was not trained.
    difference_per_100m: Option<f64>,
    difference_lower: Option<f64>,
    difference_upper: Option<f64>,
    #[serde(skip)]
    difference: Option<Interval>,
}

/// The rule that others are compared with.
const OF_PAPER: &str = "all_below";

/// Above the table.
pub const TITLE: &str = "Decision rules at equal samples";

/// The table, by what the stages left in the folder `root`.
///
/// # Errors
/// If what a stage wrote cannot be read.
pub fn table(settings: &Settings, extent: &Extent, stages: &[Stage], root: &Path) -> anyhow::Result<TrainingsTable> {
    let drive = DriveStage::load(stages.last().context("the last stage drives")?)?;
    let results = EvaluationResults::read(&drive.plan(), &root.join(rules::DRIVES))?;
    let everywhere = results.slices().pop().context("lots were driven on")?;
    let control_period_s = f64::from(settings.episode.control_period_s());
    let seed_of_trials = drive.settings().evaluation.seed;
    let (estimates, _) = results.judge(0, &everywhere, 0, seed_of_trials);
    let mut rows = Vec::new();
    for (driver, (seed, rule)) in rules::policies(settings, extent).into_iter().enumerate() {
        let mut row = Row { rule: rule.map_or(rules::CLONED, rules::title).to_owned(), ..Row::default() };
        row.seed = Some(seed.0);
        let first = extent.rules.first().context("there is a rule")?;
        // Behaviour cloning is a single network, whatever it is done for.
        row.networks = rule.and_then(|rule| rules::rule_of(settings, rule)).map_or(1, |rule| rule.networks());
        add_rounds(&mut row, &root.join(rules::folder(rule.unwrap_or(first), seed)), rule, extent)?;
        let totals = results.totals(0, driver, &everywhere, None);
        (row.route_m, row.near_collisions, row.contacts) =
            (totals.reference_m, totals.near_collisions, totals.contacts);
        row.per_100m = totals.rate().per_unit;
        [row.lower, row.upper] = quoted_interval(&totals, &estimates[driver]).map(Some);
        rows.push(row);
    }
    let titles = std::iter::once(rules::CLONED).chain(extent.rules.iter().map(|rule| rules::title(rule)));
    let mut pooled: Vec<Row> = titles.map(|title| pool(&rows, title)).collect();
    // Networks that drove the same lots are not independent evidence: the metres are those of one.
    let team = |title: &str| {
        let drivers: Vec<usize> = (0..rows.len()).filter(|&driver| rows[driver].rule == title).collect();
        let seeds = drivers.iter().filter_map(|&driver| rows[driver].seed).collect();
        Team { name: title.to_owned(), drivers, seeds, duplicates: Vec::new() }
    };
    let teams: Vec<Team> = pooled.iter().map(|row| team(&row.rule)).collect();
    let of_paper = teams.iter().position(|team| team.name == rules::title(OF_PAPER));
    let of_teams = results.judge_teams(0, &everywhere, &teams, of_paper.unwrap_or(0), &estimates, seed_of_trials);
    for (at, row) in pooled.iter_mut().enumerate() {
        let judged = of_teams.as_ref().map(|estimates| estimates[at].per_100m);
        let is_other = of_paper.is_some_and(|of_paper| of_paper != at);
        row.difference = of_teams.as_ref().map(|estimates| estimates[at].difference_per_100m).filter(|_| is_other);
        [row.difference_per_100m, row.difference_lower, row.difference_upper] = columns_of(row.difference);
        (row.lower, row.upper) = match teams[at].drivers[..] {
            // What stands by itself has its interval of few lots, too.
            [driver] => (rows[driver].lower, rows[driver].upper),
            _ => judged.map(|interval| (interval.lower, interval.upper)).unzip(),
        };
        row.per_100m = f64::from(row.near_collisions) / (row.route_m / 100.0);
    }
    for row in rows.iter_mut().chain(&mut pooled) {
        row.judge_interventions(control_period_s);
    }
    let text = format!("{}\n\n{}", to_markdown(&pooled), legend(settings, extent));
    Ok(TrainingsTable { csv: csv_of(&[pooled.clone(), rows].concat())?, svg: plot(&pooled), text })
}

impl Row {
    /// Says how long interventions lasted, and leaves them out where there was nobody to take the wheel from: the expert takes
    /// it at the beginning of a drive, too.
    fn judge_interventions(&mut self, control_period_s: f64) {
        self.interventions = self.interventions.filter(|_| self.novice_ticks > 0);
        let expert_s = (self.ticks - self.novice_ticks) as f64 * control_period_s;
        self.intervention_s = self.interventions.filter(|&times| times > 0).map(|times| expert_s / times as f64);
    }
}

/// Adds what collecting gave and cost. Behaviour cloning (`rule` = `None`) is round 0, a rule's are the rounds after it.
fn add_rounds(row: &mut Row, folder: &Path, rule: Option<&str>, extent: &Extent) -> anyhow::Result<()> {
    let last = if rule.is_some() { extent.iterations } else { 0 };
    for round in 0..=last {
        let folder = folder.join(format!("round-{round:02}"));
        let collection = Collection::read(&folder)?.with_context(|| format!("{}: no round.toml", folder.display()))?;
        row.samples += collection.samples;
        if rule.is_some() && round == 0 {
            continue;
        }
        let effort = collection.effort.with_context(|| format!("{}: of an earlier version", folder.display()))?;
        row.ticks += collection.ticks;
        row.novice_ticks += collection.novice_ticks;
        row.queries += effort.queries;
        *row.interventions.get_or_insert(0) += effort.interventions;
        row.collected_m += collection.driven_m;
        row.near_collisions_collecting += collection.near_collisions;
        row.contacts_collecting += effort.contacts;
    }
    Ok(())
}

/// All seeds of a rule together.
fn pool(rows: &[Row], title: &str) -> Row {
    let mut all = Row { rule: title.to_owned(), ..Row::default() };
    for row in rows.iter().filter(|row| row.rule == title) {
        all.samples += row.samples;
        all.networks = row.networks;
        all.ticks += row.ticks;
        all.novice_ticks += row.novice_ticks;
        all.queries += row.queries;
        *all.interventions.get_or_insert(0) += row.interventions.unwrap_or(0);
        all.collected_m += row.collected_m;
        all.near_collisions_collecting += row.near_collisions_collecting;
        all.contacts_collecting += row.contacts_collecting;
        all.route_m += row.route_m;
        all.near_collisions += row.near_collisions;
        all.contacts += row.contacts;
    }
    all
}

/// Share of the ticks, percent.
fn percent(part: u64, ticks: u64) -> f64 {
    100.0 * part as f64 / ticks.max(1) as f64
}

/// How the table is read.
fn legend(settings: &Settings, extent: &Extent) -> String {
    let trainings = match extent.seeds {
        1 => "one training of each rule".to_owned(),
        seeds => format!("{seeds} trainings of each rule, summed up; rates are means"),
    };
    let of_seeds = if extent.seeds < TRAININGS_MIN as u64 { "other lots" } else { "other lots and other seeds" };
    // What a method would ask for is not what it learned from then.
    let learned = match settings.dagger.keep {
        Keep::EveryTick => {
            " Every rule learned from the expert's labels of all ticks, also of those at which its method would not have asked: \
             what the network would come to on the labels that were asked for is not shown."
        }
        Keep::ExpertTicks => "",
    };
    let thresholds = rules::with_other_thresholds(settings).map_or_else(String::new, |rule| {
        format!(" {} has the thresholds of the settings (`dagger.rule`), every other rule its own.", rules::title(rule))
    });
    format!(
        "Of {trainings}; behaviour cloning has the samples of the first round alone. EnsembleDAgger and ThriftyDAgger train \
         several networks and drive with their mean, or that of a majority where each chooses among several modes.{thresholds}{learned} Intervals of 95 % are for \
         {of_seeds}; a difference that excludes zero (*) is one of several comparisons, and no adjustment is made for their \
         number."
    )
}

fn to_markdown(rows: &[Row]) -> String {
    let mut table = table_of(&[
        "rule",
        "samples",
        "networks",
        "the expert is asked in",
        "drives",
        "interventions (mean length)",
        "collecting: near-collisions (contacts) in",
        "unseen lots: near-collisions (contacts) in",
        "per 100 m [95 %]",
        "less the paper's, all below",
    ]);
    for row in rows {
        table.add_row(vec![
            row.rule.clone(),
            row.samples.to_string(),
            row.networks.to_string(),
            format!("{:.1} %", percent(row.queries, row.ticks)),
            format!("{:.1} %", percent(row.ticks - row.novice_ticks, row.ticks)),
            match (row.interventions, row.intervention_s) {
                (Some(times), Some(seconds)) => format!("{times} ({seconds:.1} s)"),
                (Some(times), None) => times.to_string(),
                (None, _) => "–".to_owned(),
            },
            format!(
                "{} ({}) in {:.1} km",
                row.near_collisions_collecting,
                row.contacts_collecting,
                row.collected_m / 1000.0
            ),
            format!("{} ({}) in {:.1} km", row.near_collisions, row.contacts, row.route_m / 1000.0),
            match row.lower.zip(row.upper) {
                Some((lower, upper)) => with_interval(row.per_100m, [lower, upper], 2),
                None => format!("{:.2}", row.per_100m),
            },
            difference(row.difference, 2),
        ]);
    }
    table.to_string()
}

/// Safety against expert effort: a point per rule.
fn plot(rows: &[Row]) -> String {
    let series: Vec<RateSeries> = rows
        .iter()
        .map(|row| {
            let x = percent(row.queries, row.ticks);
            let interval = [row.lower, row.upper].map(|end| end.unwrap_or(row.per_100m));
            let point = RatePoint { x, per_100m: row.per_100m, interval };
            RateSeries { name: row.rule.clone(), points: vec![point] }
        })
        .collect();
    plots::rates_against_effort("Near-collisions on unseen lots", &series)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(seed: u64, near_collisions: u32) -> Row {
        Row {
            rule: "SafeDAgger".to_owned(),
            seed: Some(seed),
            ticks: 1000,
            novice_ticks: 900,
            queries: 100,
            interventions: Some(4),
            route_m: 500.0,
            near_collisions,
            ..Row::default()
        }
    }

    #[test]
    fn seeds_are_pooled_by_counts_and_lengths() {
        let other = Row { rule: "vanilla DAgger".to_owned(), ..row(1, 9) };
        let pooled = pool(&[row(1, 2), row(2, 3), other], "SafeDAgger");
        assert_eq!((pooled.near_collisions, pooled.route_m, pooled.seed), (5, 1000.0, None));
        let table = to_markdown(std::slice::from_ref(&pooled));
        assert!(table.contains("| 10.0 %") && table.contains("5 (0) in 1.0 km"), "{table}");
        assert!(plot(&[pooled]).contains("SafeDAgger"));
    }

    /// Behaviour cloning had interventions of 0.0 s, and "expert only" one in every drive.
    #[test]
    fn nobody_intervenes_where_the_expert_alone_drives() {
        let interventions = |novice_ticks, interventions| {
            let mut row = Row { novice_ticks, interventions: Some(interventions), ..row(1, 2) };
            row.judge_interventions(0.05);
            let table = to_markdown(std::slice::from_ref(&row));
            let cells = table.lines().last().unwrap().split('|').map(str::trim).collect::<Vec<_>>();
            (cells[6].to_owned(), row.interventions, row.intervention_s)
        };
        // The expert drives 100 ticks of 1000, 5 s in all.
        assert_eq!(interventions(900, 4), ("4 (1.2 s)".to_owned(), Some(4), Some(1.25)));
        assert_eq!(interventions(1000, 0), ("0".to_owned(), Some(0), None));
        for times in [0, 2] {
            assert_eq!(interventions(0, times), ("–".to_owned(), None, None));
        }
    }
}
