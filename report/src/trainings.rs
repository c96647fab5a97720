//! Several trainings that differ by their seed: what each came to, and the mean over them.

use crate::drive::rows_of;
use crate::markdown::table_of;
use evaluation::conclusions::{BC, DAGGER, Driven};
use evaluation::format::{interval, quoted_rate};
use evaluation::judge::DriverEstimate;
use evaluation::slices::Slice;
use evaluation::stages::{self, Chain, Extent, UNWEIGHTED, named};
use evaluation::statistics::bootstrap::Interval;
use evaluation::totals::Totals;
use evaluation::trainings::{JudgedTeams, Team, TeamEstimate};
use experiment::settings::Settings;
use std::fmt::Write as _;
use std::path::Path;

/// Heads of [`row`].
pub(crate) const HEADER: [&str; 7] =
    ["driver", "trainings", "lots", "near-collisions, by seed", "contacts", "per 100 m [95 %]", "Δ per 100 m [95 %]"];

/// A team on some lots: what each of its trainings came to, their mean and, for another than all are compared with, the
/// difference.
pub(crate) fn row(team: &Team, lots: &str, each: &[Totals], estimate: &TeamEstimate, is_other: bool) -> [String; 7] {
    let Interval { estimate: difference, lower, upper, .. } = estimate.difference_per_100m;
    [
        team.name.clone(),
        team.drivers.len().to_string(),
        lots.to_owned(),
        list(each, |totals| totals.near_collisions),
        list(each, |totals| totals.contacts),
        interval(estimate.per_100m, 3),
        if is_other { format!("{difference:+.3} [{lower:+.3}, {upper:+.3}]") } else { "–".to_owned() },
    ]
}

fn list(each: &[Totals], count: fn(&Totals) -> u32) -> String {
    each.iter().map(|totals| count(totals).to_string()).collect::<Vec<_>>().join(", ")
}

/// Near-collisions, contacts and least clearance of a driver, of all its trainings where there are several. `estimates` are
/// of every driver in the slice.
pub(crate) fn headline_row(
    driven: &Driven<'_>,
    slice: &Slice,
    driver: usize,
    lots: &str,
    (estimates, judged): (&[DriverEstimate], Option<&JudgedTeams>),
) -> [String; 7] {
    let of_team = judged.and_then(|judged| judged.of(driver)).filter(|(team, _)| team.drivers.len() > 1);
    let drivers = of_team.map_or(std::slice::from_ref(&driver), |(team, _)| &team.drivers);
    let totals = |&driver: &usize| driven.results.totals(0, driver, slice, None);
    let each: Vec<Totals> = drivers.iter().map(totals).collect();
    let name = &driven.plan.drivers[driver].name;
    let reference_m = each[0].reference_m;
    let clearance_m = each.iter().filter_map(|totals| totals.clearance_min_m).reduce(f32::min);
    [
        if each.len() > 1 { format!("{name}, {} trainings", each.len()) } else { name.clone() },
        lots.to_owned(),
        format!("{reference_m:.0} m"),
        list(&each, |totals| totals.near_collisions),
        match of_team {
            Some((_, estimate)) if each.iter().any(|totals| totals.near_collisions > 0) => {
                interval(estimate.per_100m, 2)
            }
            _ => quoted_rate(&each[0], &estimates[driver]),
        },
        list(&each, |totals| totals.contacts),
        clearance_m.map_or_else(|| "–".to_owned(), |metres| format!("{metres:.2} m")),
    ]
}

/// Lots that every training drove, and how all drivers stand there; `None` where there are none.
struct Place<'a> {
    lots: &'static str,
    driven: &'a Driven<'a>,
    judged: Option<(Slice, Vec<DriverEstimate>)>,
}

impl<'a> Place<'a> {
    fn new(lots: &'static str, driven: &'a Driven<'a>, slice: Option<Slice>) -> Self {
        let judged = slice.map(|slice| {
            let (estimates, _) = driven.results.judge(0, &slice, 0, driven.plan.settings.evaluation.seed);
            (slice, estimates)
        });
        Self { lots, driven, judged }
    }
}

/// Every training by itself, then the means over the seeds.
pub(crate) fn by_seed(
    settings: &Settings,
    extent: &Extent,
    root: &Path,
    reference: &Driven<'_>,
    unseen: &Driven<'_>,
) -> anyhow::Result<String> {
    let places = [
        Place::new("the paper's", reference, Some(reference.all())),
        Place::new("of them not trained on", reference, reference.unseen()),
        Place::new("unseen, generated", unseen, Some(unseen.all())),
    ];
    let mut table =
        table_of(&["policy", "seed", "η̂", "the paper's lots", "of them not trained on", "unseen generated lots"]);
    for (base, chain) in [(BC, None), (DAGGER, Some(Chain::Weighted)), (UNWEIGHTED, Some(Chain::Unweighted))] {
        for seed in stages::seeds(settings, extent) {
            let name = named(base, seed, settings);
            let cell = |Place { driven, judged, .. }: &Place<'_>| {
                let found = driven.driver(&name).zip(judged.as_ref());
                found.map_or_else(String::new, |(driver, (slice, estimates))| {
                    let totals = driven.results.totals(0, driver, slice, None);
                    format!("{}: {}", totals.near_collisions, quoted_rate(&totals, &estimates[driver]))
                })
            };
            let rows = chain.map_or_else(|| Ok(Vec::new()), |chain| rows_of(root, chain, seed))?;
            let shares = rows.iter().filter_map(|row| row.eta_hat).map(|share| format!("{share:.3}"));
            table.add_row([
                base.to_owned(),
                seed.0.to_string(),
                shares.collect::<Vec<_>>().join(", "),
                cell(&places[0]),
                cell(&places[1]),
                cell(&places[2]),
            ]);
        }
    }
    let mut over_seeds = table_of(&HEADER);
    for Place { lots, driven, judged } in &places {
        let Some((slice, _)) = judged else { continue };
        let judged = driven.judge_trainings(slice);
        for (team, estimate) in judged.iter().flat_map(|judged| &judged.teams) {
            let totals = |&driver: &usize| driven.results.totals(0, driver, slice, None);
            let each: Vec<Totals> = team.drivers.iter().map(totals).collect();
            over_seeds.add_row(row(team, lots, &each, estimate, team.name != DAGGER));
        }
    }
    let mut text = format!(
        "Trainings that differ in nothing but their root seed; η̂ of each iteration. Intervals here are of one network each \
         and do not cover what another training would have given.\n\n{table}"
    );
    if over_seeds.row_count() > 0 {
        let _ = write!(
            text,
            "\n\nTheir means beside the other drivers, with intervals for other trials or lots and other seeds; the difference is \
             to DAgger (others − DAgger).\n\n{over_seeds}"
        );
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use evaluation::plan::Plan;
    use evaluation::results::EvaluationResults;
    use experiment::drivers::NamedDriver;
    use experiment::lots::Lot;
    use experiment::run_dir::Training;
    use experiment::trials::{Purpose, Trial};
    use sim::episode::EpisodeReport;
    use sim::frame::Ending;
    use sim::metrics::EpisodeMetrics;
    use sim::scenario::Direction;
    use sim::seed::RootSeed;

    /// "In short" had the first training alone.
    #[test]
    fn all_trainings_of_a_driver_are_in_its_row() {
        let settings = Settings::preset("default").unwrap();
        let driver = |name: &str| NamedDriver::expert(&settings.expert).renamed(name);
        let trained = |seed: u64| {
            let mut driver = driver(&named(DAGGER, RootSeed(seed), &settings));
            driver.training = Some(Training { recipe: DAGGER.to_owned(), seed: RootSeed(seed), lots: Vec::new() });
            driver
        };
        let drivers = [driver("expert"), trained(1), trained(2), trained(3)];
        let lots = Lot::parse_all(&["reference"], &settings.episode.vehicle).unwrap();
        let plan = Plan { settings: &settings, drivers: &drivers, lots: &lots, compare_with: 1, shard: None };
        let mut results = EvaluationResults::new(&plan);
        for (index, trial) in Trial::all(RootSeed(1), Purpose::Evaluation, &lots, 5, &Direction::BOTH).enumerate() {
            for (driver, near_collisions) in [0, 1, 2, 3].into_iter().enumerate() {
                let metrics = EpisodeMetrics {
                    near_collisions,
                    reference_m: 100.0,
                    driven_m: 100.0,
                    clearance_min_m: 1.0 - 0.1 * near_collisions as f32,
                    ..EpisodeMetrics::default()
                };
                let report = EpisodeReport { ending: Ending::ReachedEnd, metrics, events: vec![] };
                results.add(0, driver, index, &trial, &report);
            }
        }
        let driven = Driven { plan: &plan, results: &results };
        let slice = driven.all();
        let judged = driven.judge_trainings(&slice);
        let (estimates, _) = driven.results.judge(0, &slice, 0, RootSeed(1));
        let row = |driver| headline_row(&driven, &slice, driver, "lots", (&estimates, judged.as_ref()));
        let expected =
            ["DAgger, 3 trainings", "lots", "3000 m", "30, 60, 90", "2.00 [0.00, 4.48]", "0, 0, 0", "0.70 m"];
        assert_eq!(row(1), expected);
        assert_eq!(row(0)[..4], ["expert", "lots", "3000 m", "0"]);
        assert!(row(0)[4].contains("one-sided"), "{:?}", row(0));
        let (team, estimate) = judged.as_ref().unwrap().of(0).unwrap();
        let totals = driven.results.totals(0, 0, &slice, None);
        assert_eq!(row_of_others(team, totals, estimate), "-2.000 [-4.484, +0.484]");
    }

    fn row_of_others(team: &Team, totals: Totals, estimate: &TeamEstimate) -> String {
        super::row(team, "lots", &[totals], estimate, true)[6].clone()
    }
}
