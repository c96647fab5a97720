//! Controls of the report of `reproduce`: what else could explain that `DAgger` drives better.

use crate::drive::rows_of;
use crate::markdown::table_of;
use crate::trainings::{Place, over_seeds};
use evaluation::conclusions::DrivenPlan;
use evaluation::format::{difference, quoted_rate};
use evaluation::names::{ALPHA_15, BC, DAGGER, EXPERT_EQUAL, EXPERT_ONLY, GRID_EXPERT, OF_PERSON, UNWEIGHTED};
use evaluation::stages::Chain;
use experiment::lots::UNSEEN;
use sim::seed::RootSeed;
use std::fmt::Write as _;
use std::path::Path;

/// Policies that differ from `DAgger` in one thing, and the chain that trained each; then what was not trained.
const CONTROLS: [(&str, Option<Chain>); 9] = [
    (BC, Some(Chain::Weighted)),
    (DAGGER, Some(Chain::Weighted)),
    (UNWEIGHTED, Some(Chain::Unweighted)),
    (EXPERT_ONLY, Some(Chain::ExpertOnly)),
    (EXPERT_EQUAL, Some(Chain::ExpertEqual)),
    (ALPHA_15, Some(Chain::Alpha15)),
    (OF_PERSON[0], Some(Chain::Person)),
    (OF_PERSON[1], Some(Chain::Person)),
    (GRID_EXPERT, None),
];

/// Policies that differ from `DAgger` in one thing, on unseen lots: the first training of each, then the means of those that
/// were trained several times.
pub(crate) fn controls(root: &Path, seed: RootSeed, driven: &DrivenPlan<'_>) -> anyhow::Result<String> {
    let mut table = table_of(&[
        "policy",
        "rounds",
        "samples",
        "mean weight of τ̂",
        "near-collisions (contacts)",
        "per 100 m [95 %]",
        "− DAgger's [95 %]",
    ]);
    let place = Place::new(UNSEEN, driven, driven.all());
    for (name, chain) in CONTROLS {
        // An earlier version did not train all of them.
        let Some(driver) = driven.driver(name) else { continue };
        let mut rows = chain.map_or_else(|| Ok(Vec::new()), |chain| rows_of(root, chain, seed))?;
        if name == BC || name == OF_PERSON[0] {
            rows.truncate(1);
        }
        let last = rows.last();
        let or_dash = |number: Option<usize>| number.map_or_else(|| "–".to_owned(), |number| number.to_string());
        let totals = place.totals(driver);
        let found = place.comparisons.iter().find(|comparison| comparison.driver == driver);
        let weight = last.and_then(|row| row.mean_weight);
        table.add_row([
            name.to_owned(),
            or_dash(last.map(|_| rows.len())),
            or_dash(last.map(|row| row.dataset)),
            weight.map_or_else(|| "–".to_owned(), |weight| format!("{weight:.2}")),
            format!("{} ({})", totals.near_collisions, totals.contacts),
            quoted_rate(&totals, &place.estimates[driver]),
            found.map_or_else(|| "–".to_owned(), |found| difference(found.difference_per_100m, 2)),
        ]);
    }
    let delay_s = driven.plan.settings.expert.clone().with_hand_of_a_person().reaction_delay_s;
    let mut text = format!(
        "### Controls\n\nOn the unseen lots. *{EXPERT_ONLY}*: rounds on the same lots as DAgger's with as many \
         optimiser steps each, but the expert drives throughout, so that every tick is the expert's and there are more samples. *{EXPERT_EQUAL}*: \
         the same, each iteration thinned evenly to DAgger's mean number of samples. If the first is no worse than DAgger, more of \
         the expert's data does as well; if the second is not, either, it does not matter who drove. α is the weight on τ̂; its mean weight is 1 where nothing is weighted. \
         *A person's hand*: the expert's labels come {delay_s} s late and tremble, as a person's would; the paper's expert was one. *{GRID_EXPERT}*: \
         nothing is learned; what the network is ahead of it is what learning brings.\n\n{table}"
    );
    let over_seeds = over_seeds([&place]);
    if over_seeds.row_count() > 0 {
        let _ = write!(
            text,
            "\n\nMeans over seeds beside the controls that were trained once, with intervals for other lots and, of several \
             trainings, other seeds; the difference is to DAgger (others − DAgger).\n\n{over_seeds}"
        );
    }
    Ok(text)
}

/// Points at half of the open way beside points as far as it is open, on unseen lots.
pub(crate) fn points(
    root: &Path,
    seed: RootSeed,
    half: &DrivenPlan<'_>,
    far: &DrivenPlan<'_>,
) -> anyhow::Result<String> {
    let mut table = table_of(&["points", "policy", "last η̂", "near-collisions (contacts)", "per 100 m [95 %]", "m/s"]);
    for (name, driven, chain) in [("half", half, Chain::Weighted), ("far", far, Chain::FarPoints)] {
        let everywhere = driven.all();
        let estimates = driven.estimates(&everywhere);
        let rows = rows_of(root, chain, seed)?;
        for policy in [BC, DAGGER] {
            let Some(driver) = driven.driver(policy) else { continue };
            let totals = driven.results.totals(0, driver, &everywhere, None);
            let eta_hat = rows.iter().rev().find_map(|row| row.eta_hat).filter(|_| policy == DAGGER);
            table.add_row([
                name.to_owned(),
                policy.to_owned(),
                eta_hat.map_or_else(|| "–".to_owned(), |eta_hat| format!("{eta_hat:.3}")),
                format!("{} ({})", totals.near_collisions, totals.contacts),
                quoted_rate(&totals, &estimates[driver]),
                format!("{:.2}", totals.mean_speed_mps()),
            ]);
        }
    }
    Ok(format!(
        "### Half and far points\n\nOn the unseen lots. *Half*: the expert's points lie at half of the open way, our reading; \
         *far*: as far as the way is open, as the paper's rule three says, driven at half as fast. One training each, at another \
         speed, so that there are no pairs.\n\n{table}"
    ))
}

/// Planners in every reading, beside `DAgger`: on the paper's lots and on unseen ones.
pub(crate) fn readings(reference: &DrivenPlan<'_>, unseen: &DrivenPlan<'_>) -> String {
    let mut table = table_of(&[
        "driver",
        "the paper's lots",
        "per 100 m [95 %]",
        "− DAgger's [95 %]",
        UNSEEN,
        "per 100 m [95 %]",
        "− DAgger's [95 %]",
    ]);
    let judged = [reference, unseen].map(|driven| {
        let everywhere = driven.all();
        let judged = driven.judge(&everywhere);
        (driven, everywhere, judged)
    });
    for (driver, named) in reference.plan.drivers.iter().enumerate() {
        let cells = judged.iter().flat_map(|(driven, everywhere, (estimates, comparisons))| {
            let totals = driven.results.totals(0, driver, everywhere, None);
            let found = comparisons.iter().find(|comparison| comparison.driver == driver);
            [
                format!("{} ({})", totals.near_collisions, totals.contacts),
                quoted_rate(&totals, &estimates[driver]),
                found.map_or_else(|| "–".to_owned(), |found| difference(found.difference_per_100m, 2)),
            ]
        });
        table.add_row(std::iter::once(named.name.clone()).chain(cells));
    }
    format!(
        "### Readings of the planners\n\nNear-collisions (contacts) of every planner at its publication's parameters, and in \
         every other reading of what the publication leaves open (`NAME/READING`); \
         tuned ones are in the tables above. DAgger is the first training.\n\n{table}"
    )
}

/// Every driver without action smoothing and with it, on unseen lots.
pub(crate) fn action_smoothing(without: &DrivenPlan<'_>, with: &DrivenPlan<'_>) -> String {
    let header = ["driver", "without", "per 100 m [95 %]", "reversals", "with", "per 100 m [95 %]", "reversals"];
    let mut table = table_of(&header);
    let judged = [without, with].map(|driven| {
        let everywhere = driven.all();
        let estimates = driven.estimates(&everywhere);
        (driven, everywhere, estimates)
    });
    for (driver, named) in without.plan.drivers.iter().enumerate() {
        let cells = judged.iter().flat_map(|(driven, everywhere, estimates)| {
            let totals = driven.results.totals(0, driver, everywhere, None);
            let count = format!("{} ({})", totals.near_collisions, totals.contacts);
            [count, quoted_rate(&totals, &estimates[driver]), format!("{:.1}", totals.reversals_per_100m())]
        });
        table.add_row(std::iter::once(named.name.clone()).chain(cells));
    }
    format!(
        "### Action smoothing\n\nNear-collisions (contacts), and steering reversals per 100 m driven, on the unseen lots. Of the planners that were tuned, only the paper's two are here as \
         published, too. Elsewhere in this report networks are smoothed as they were trained to be, and nobody else is.\n\n{table}"
    )
}
