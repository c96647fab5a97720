//! Several trainings of one method: the result of each, and the mean over them.

use crate::drive::rows_of;
use crate::markdown::{escaped, table_of};
use comfy_table::Table;
use evaluation::conclusions::DrivenPlan;
use evaluation::format::{interval, quoted_rate};
use evaluation::judge::{Comparison, DriverEstimate};
use evaluation::names::{BC, DAGGER, UNWEIGHTED};
use evaluation::slices::Slice;
use evaluation::stages::{Chain, Extent, named};
use evaluation::statistics::bootstrap::Interval;
use evaluation::totals::Totals;
use evaluation::trainings::{JudgedTeams, Team, TeamEstimate};
use experiment::settings::Settings;
use std::fmt::Write as _;
use std::path::Path;

/// Heads of [`row`].
pub(crate) const HEADER: [&str; 8] = [
    "driver",
    "trainings",
    "lots",
    "near-collisions of each",
    "per 100 m [95 %]",
    "Δ per 100 m [95 %]",
    "contacts of each",
    "per 100 m [95 %]",
];

/// A team on some lots: the result of each of its trainings, their mean and, unless it is the team that all are
/// compared with, the difference.
pub(crate) fn row(team: &Team, lots: &str, each: &[Totals], estimate: &TeamEstimate, is_other: bool) -> [String; 8] {
    let Interval { estimate: difference, lower, upper, .. } = estimate.difference_per_100m;
    [
        escaped(&team.name),
        team.drivers.len().to_string(),
        escaped(lots),
        list(each, |totals| totals.near_collisions),
        interval(estimate.per_100m, 3),
        if is_other { format!("{difference:+.3} [{lower:+.3}, {upper:+.3}]") } else { "–".to_owned() },
        list(each, |totals| totals.contacts),
        interval(estimate.contacts_per_100m, 3),
    ]
}

fn list(each: &[Totals], count: fn(&Totals) -> u32) -> String {
    each.iter().map(|totals| count(totals).to_string()).collect::<Vec<_>>().join(", ")
}

/// Lots that were driven, how all drivers and teams of trainings stand there, and how the others compare with DAgger.
pub(crate) struct Place<'a> {
    lots: &'static str,
    driven: &'a DrivenPlan<'a>,
    slice: Slice,
    pub(crate) estimates: Vec<DriverEstimate>,
    pub(crate) comparisons: Vec<Comparison>,
    teams: JudgedTeams,
}

impl<'a> Place<'a> {
    pub(crate) fn new(lots: &'static str, driven: &'a DrivenPlan<'a>, slice: Slice) -> Self {
        let (estimates, comparisons) = driven.judge(&slice);
        let teams = driven.judge_teams(&slice, &estimates);
        Self { lots, driven, slice, estimates, comparisons, teams }
    }

    pub(crate) fn totals(&self, driver: usize) -> Totals {
        self.driven.results.totals(0, driver, &self.slice, None)
    }
}

/// Near-collisions, contacts and least clearance of a driver, of all its trainings where there are several.
pub(crate) fn headline_row(place: &Place<'_>, driver: usize) -> [String; 7] {
    let of_team = place.teams.of(driver).and_then(|(team, estimate)| Some((team, estimate?)));
    let of_team = of_team.filter(|(team, _)| team.drivers.len() > 1);
    let drivers = of_team.map_or(std::slice::from_ref(&driver), |(team, _)| &team.drivers);
    let each: Vec<Totals> = drivers.iter().map(|&driver| place.totals(driver)).collect();
    let name = &place.driven.plan.drivers[driver].name;
    let reference_m = each[0].reference_m;
    let clearance_m = each.iter().filter_map(|totals| totals.clearance_min_m).reduce(f32::min);
    [
        if each.len() > 1 { format!("{name}, {} trainings", each.len()) } else { name.clone() },
        place.lots.to_owned(),
        format!("{reference_m:.0} m"),
        list(&each, |totals| totals.near_collisions),
        match of_team {
            Some((_, estimate)) if each.iter().any(|totals| totals.near_collisions > 0) => {
                interval(estimate.per_100m, 2)
            }
            _ => quoted_rate(&each[0], &place.estimates[driver]),
        },
        list(&each, |totals| totals.contacts),
        clearance_m.map_or_else(|| "–".to_owned(), |metres| format!("{metres:.2} m")),
    ]
}

/// Every team and single driver at some places, where there are teams.
pub(crate) fn over_seeds<'p, 'a: 'p>(places: impl IntoIterator<Item = &'p Place<'a>>) -> Table {
    let mut table = table_of(&HEADER);
    for place in places {
        for (team, estimate) in place.teams.judged() {
            let each: Vec<Totals> = team.drivers.iter().map(|&driver| place.totals(driver)).collect();
            table.add_row(row(team, place.lots, &each, estimate, team.name != DAGGER));
        }
    }
    table
}

/// Every training by itself, then the means over the seeds.
pub(crate) fn by_seed(
    settings: &Settings,
    extent: &Extent,
    root: &Path,
    reference: &DrivenPlan<'_>,
    unseen: &DrivenPlan<'_>,
) -> anyhow::Result<String> {
    let place = |lots, driven, slice: Option<Slice>| slice.map(|slice| Place::new(lots, driven, slice));
    let places = [
        place("the paper's", reference, Some(reference.all())),
        place("of them not trained on", reference, reference.unseen()),
        place("unseen, generated", unseen, Some(unseen.all())),
    ];
    let mut table =
        table_of(&["policy", "seed", "η̂", "the paper's lots", "of them not trained on", "unseen generated lots"]);
    for (base, chain) in [(BC, None), (DAGGER, Some(Chain::Weighted)), (UNWEIGHTED, Some(Chain::Unweighted))] {
        if chain.is_some_and(|chain| !chain.is_trained(settings)) {
            continue;
        }
        for seed in settings.training_seeds(extent.seeds) {
            let name = named(base, seed, settings);
            let cell = |place: &Option<Place<'_>>| {
                let found = place.as_ref().and_then(|place| Some((place, place.driven.driver(&name)?)));
                found.map_or_else(String::new, |(place, driver)| {
                    let totals = place.totals(driver);
                    let rate = quoted_rate(&totals, &place.estimates[driver]);
                    format!("{} ({}): {rate}", totals.near_collisions, totals.contacts)
                })
            };
            let rows = chain.map_or_else(|| Ok(Vec::new()), |chain| rows_of(root, chain, seed))?;
            let shares = rows.iter().filter_map(|row| row.eta_hat).map(|share| format!("{share:.3}"));
            table.add_row(
                [base.to_owned(), seed.0.to_string(), shares.collect::<Vec<_>>().join(", ")]
                    .into_iter()
                    .chain(places.iter().map(cell)),
            );
        }
    }
    let over_seeds = over_seeds(places.iter().flatten());
    let mut text = format!(
        "Trainings that differ in nothing but their root seed: η̂ of each iteration, near-collisions (contacts). Intervals here are of one network each \
         and do not cover what another training would have given.\n\n{table}"
    );
    if over_seeds.row_count() > 0 {
        let _ = write!(
            text,
            "\n\nTheir means beside the other drivers, with intervals for other trials or lots and, of several trainings, other seeds; \
             the difference is to DAgger (others − DAgger).\n\n{over_seeds}"
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
    use experiment::trained::Training;
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
            driver.training = Some(Training { recipe: DAGGER.to_owned(), seed: RootSeed(seed) });
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
        let driven = DrivenPlan { plan: &plan, results: &results };
        let place = Place::new("lots", &driven, driven.all());
        let row = |driver| headline_row(&place, driver);
        let expected =
            ["DAgger, 3 trainings", "lots", "3000 m", "30, 60, 90", "2.00 [0.00, 4.48]", "0, 0, 0", "0.70 m"];
        assert_eq!(row(1), expected);
        assert_eq!(row(0)[..4], ["expert", "lots", "3000 m", "0"]);
        assert!(row(0)[4].contains("one-sided"), "{:?}", row(0));
        let (team, estimate) = place.teams.of(0).unwrap();
        assert_eq!(row_of_others(team, place.totals(0), estimate.unwrap()), "-2.000 [-4.484, +0.484]");
    }

    fn row_of_others(team: &Team, totals: Totals, estimate: &TeamEstimate) -> String {
        super::row(team, "lots", &[totals], estimate, true)[5].clone()
    }
}
