//! Several trainings of one recipe, judged together: what another training would do, on other lots (docs/methods.md 8.3).
//!
//! An interval of one network says how sure the rate of that network is. Here it is for other lots *and* other seeds.

use crate::judge::{Stratum, strata};
use crate::results::{EvaluationResults, RunSummary};
use crate::slices::Slice;
use crate::statistics::bootstrap::{DRAWS, Interval, Units};
use crate::statistics::poisson::Rate;
use crate::statistics::student::{half_width_of_mean, together, widened};
use experiment::drivers::NamedDriver;
use sim::seed::RootSeed;

/// Fewer trainings say nothing about others (chosen).
pub const TRAININGS_MIN: usize = 3;

/// Drivers that were trained alike except for the seed, or a single other one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Team {
    /// The name of the first.
    pub name: String,
    /// Indices of the plan's drivers, by seed.
    pub drivers: Vec<usize>,
    /// The root seed of each; none of a driver that was not trained.
    pub seeds: Vec<u64>,
}

/// Every driver in a team, in the order of the first of each; none if no team has [`TRAININGS_MIN`] members. The same seed
/// again is the same network, and counts once.
pub fn teams(drivers: &[NamedDriver]) -> Vec<Team> {
    let mut teams: Vec<Team> = Vec::new();
    let recipe = |index: usize| drivers[index].training.as_ref().map(|training| &training.recipe);
    for (index, driver) in drivers.iter().enumerate() {
        let alone = |seeds| Team { name: driver.name.clone(), drivers: vec![index], seeds };
        let Some(training) = &driver.training else {
            teams.push(alone(Vec::new()));
            continue;
        };
        let seed = training.seed.0;
        match teams.iter_mut().find(|team| recipe(team.drivers[0]) == Some(&training.recipe)) {
            Some(team) => {
                if let Err(place) = team.seeds.binary_search(&seed) {
                    team.seeds.insert(place, seed);
                    team.drivers.insert(place, index);
                }
            }
            None => teams.push(alone(vec![seed])),
        }
    }
    teams.retain(|team| team.drivers.len() == 1 || team.drivers.len() >= TRAININGS_MIN);
    if teams.iter().any(|team| team.drivers.len() > 1) { teams } else { Vec::new() }
}

/// A team in a slice.
#[derive(Debug, Clone, PartialEq)]
pub struct TeamEstimate {
    /// Near-collisions per 100 m, mean over its trainings.
    pub per_100m: Interval,
    /// The same less that of the team it is compared with.
    pub difference_per_100m: Interval,
}

/// Every team of an evaluation in a slice.
#[derive(Debug, Clone, PartialEq)]
pub struct JudgedTeams {
    /// The teams, and how each stands.
    pub teams: Vec<(Team, TeamEstimate)>,
}

impl JudgedTeams {
    /// The team of a driver; `None` if it was trained too seldom to speak for others.
    pub fn of(&self, driver: usize) -> Option<&(Team, TeamEstimate)> {
        self.teams.iter().find(|(team, _)| team.drivers.contains(&driver))
    }
}

impl EvaluationResults {
    /// How drivers stand in a slice at a noise level, and how they differ from one of them, where they were trained often
    /// enough; `None` if no recipe was, or nothing varies.
    pub fn judge_trainings(
        &self,
        level: usize,
        slice: &Slice,
        drivers: &[NamedDriver],
        with: usize,
        seed: RootSeed,
    ) -> Option<JudgedTeams> {
        let teams = teams(drivers);
        let with = teams.iter().position(|team| team.drivers.contains(&with))?;
        let estimates = self.judge_teams(level, slice, &teams, with, seed)?;
        Some(JudgedTeams { teams: teams.into_iter().zip(estimates).collect() })
    }

    /// How teams stand in a slice at a noise level, and how they differ from one of them, `with`. Lots are drawn as in
    /// [`judge`](Self::judge), for the means over trainings; Student's interval of these means adds what other seeds bring.
    /// Trainings of one seed begin alike, so teams of the same seeds differ by pairs. `None` if nothing varies.
    pub fn judge_teams(
        &self,
        level: usize,
        slice: &Slice,
        teams: &[Team],
        with: usize,
        seed: RootSeed,
    ) -> Option<Vec<TeamEstimate>> {
        let pairs = self.common_runs(level, slice);
        let strata = strata(&pairs, slice.is_pooled());
        if strata.iter().all(|clusters| clusters.len() < 2) {
            return None;
        }
        let drivers = pairs[0].len();
        let per_100m = |sums: &[f64], driver: usize| sums[driver] / sums[drivers];
        let of_sums = |sums: &[f64], out: &mut [f64]| {
            let (rates, differences) = out.split_at_mut(teams.len());
            for (rate, Team { drivers, .. }) in rates.iter_mut().zip(teams) {
                *rate = drivers.iter().map(|&driver| per_100m(sums, driver)).sum::<f64>() / drivers.len() as f64;
            }
            for (difference, rate) in differences.iter_mut().zip(&*rates) {
                *difference = rate - rates[with];
            }
        };
        let intervals = units(&strata, drivers).percentile_intervals(seed, DRAWS, 2 * teams.len(), &of_sums);
        let (rates, differences) = intervals.split_at(teams.len());

        let mut all = vec![0.0; drivers + 1];
        for row in &pairs {
            add(&mut all, row);
        }
        let by_seed = |team: &Team| -> Vec<f64> { team.drivers.iter().map(|&driver| per_100m(&all, driver)).collect() };
        let of_with = by_seed(&teams[with]);
        // No draw of lots without events has any. Trainings that drove the same lots add no metres.
        let supported = Rate::new(0, all[drivers]).upper;
        let estimate = |(team, (&rate, &difference)): (&Team, (&Interval, &Interval))| {
            let own = by_seed(team);
            let half_width = half_width_of_mean(&own);
            let per_100m = widened(rate, half_width);
            let half_width = if team.seeds == teams[with].seeds {
                half_width_of_mean(&own.iter().zip(&of_with).map(|(own, with)| own - with).collect::<Vec<_>>())
            } else {
                together(half_width, half_width_of_mean(&of_with))
            };
            TeamEstimate {
                per_100m: Interval { lower: per_100m.lower.max(0.0), upper: per_100m.upper.max(supported), ..per_100m },
                difference_per_100m: widened(difference, half_width),
            }
        };
        Some(teams.iter().zip(rates.iter().zip(differences)).map(estimate).collect())
    }
}

/// The near-collisions of each driver in every cluster, and the hundreds of metres that all share.
fn units(strata: &[Stratum<'_>], drivers: usize) -> Units {
    let mut units = Units::new(drivers + 1);
    let mut sums = vec![0.0; drivers + 1];
    for clusters in strata {
        units.begin_stratum();
        for rows in clusters {
            sums.fill(0.0);
            for row in *rows {
                add(&mut sums, row);
            }
            units.push(&sums);
        }
    }
    units
}

fn add(sums: &mut [f64], row: &[RunSummary]) {
    for (sum, unit) in sums.iter_mut().zip(row) {
        *sum += f64::from(unit.near_collisions);
    }
    sums[row.len()] += f64::from(row[0].reference_m) / 100.0;
}

#[cfg(test)]
mod tests {
    use super::*;
    use experiment::trained::Training;
    use std::collections::BTreeSet;

    fn trained(recipe: &str, seed: u64) -> NamedDriver {
        let mut driver =
            NamedDriver::expert(&expert::ExpertSettings::half_points()).renamed(&format!("{recipe}{seed}"));
        driver.training = Some(Training {
            recipe: recipe.to_owned(),
            seed: RootSeed(seed),
            lots: Vec::new(),
            digests: BTreeSet::new(),
        });
        driver
    }

    #[test]
    fn trainings_of_a_recipe_are_a_team_and_every_other_driver_is_one_by_itself() {
        let expert = NamedDriver::expert(&expert::ExpertSettings::half_points());
        let drivers = [trained("a", 2), trained("bc", 1), expert, trained("a", 1), trained("a", 3), trained("bc", 2)];
        let found = teams(&drivers);
        let found: Vec<(&str, &[usize])> = found.iter().map(|team| (team.name.as_str(), &*team.drivers)).collect();
        assert_eq!(found, [("a2", &[3, 0, 4][..]), ("expert", &[2])], "two of bc say nothing about others");
        assert_eq!(teams(&drivers[..4]), [], "nothing was trained often enough");
    }

    /// Three runs with `--seed 1` were three trainings that agree to the last digit.
    #[test]
    fn the_same_seed_again_is_no_further_training() {
        let twice = [trained("a", 1), trained("a", 2), trained("a", 1), trained("a", 3), trained("a", 3)];
        let found = teams(&twice);
        assert_eq!((&*found[0].drivers, &*found[0].seeds), (&[0, 1, 3][..], &[1, 2, 3][..]));
        assert_eq!(teams(&[trained("a", 1), trained("a", 1), trained("a", 1)]), []);
    }
}
