//! Several trainings of one method, judged together: what another training would do, on other lots (docs/methods.md 8.3).
//!
//! An interval of one network says how sure the rate of that network is. Here it is for other lots *and* other seeds.

use crate::format::{contacts_interval, quoted_interval};
use crate::judge::{
    DriverEstimate, STATISTICS, Statistic, Stratum, add, columns, reference_100m, statistics, strata, units,
};
use crate::results::EvaluationResults;
use crate::slices::Slice;
use crate::statistics::bootstrap::{DRAWS, Interval, UNITS_MIN};
use crate::statistics::poisson::Rate;
use crate::statistics::student::{half_width_of_mean, together, widened};
use crate::totals::Totals;
use anyhow::{Context as _, bail, ensure};
use experiment::drivers::{DriverSpec, NamedDriver};
use glob::{MatchOptions, Pattern};
use sim::limits::NAME_CHARS_MAX;
use sim::seed::RootSeed;
use sim::validate::is_hidden;
use std::collections::BTreeMap;

/// Fewer trainings say nothing about others (chosen).
pub const TRAININGS_MIN: usize = 3;

/// Methods by name, and the names of the drivers that are trainings of each.
pub type Methods = BTreeMap<String, Vec<String>>;

/// Finds the drivers that each `METHOD=PATTERN` means. In a pattern of their names `?` stands for one character and `*` for
/// any that are not slashes; everything else stands for itself. Patterns of one method add up.
///
/// # Errors
/// If a text is not of this form, or no driver has such a name.
pub fn methods(texts: &[String], drivers: &[NamedDriver]) -> anyhow::Result<Methods> {
    let options = MatchOptions { require_literal_separator: true, ..MatchOptions::new() };
    let mut methods = Methods::new();
    for text in texts {
        let (method, pattern) = text
            .split_once('=')
            .with_context(|| format!("method {text:?}: write a name and its drivers, as in mine=run:runs/mine-s*"))?;
        let found = Pattern::new(&plain(pattern)).with_context(|| format!("method {text:?}"))?;
        let named = drivers.iter().map(|driver| &driver.name).filter(|name| found.matches_with(name, options));
        let names = methods.entry(method.to_owned()).or_default();
        let before = names.len();
        names.extend(named.cloned());
        ensure!(
            names.len() > before,
            "method {text:?}: no driver is named so; there are {}",
            drivers.iter().map(|driver| driver.name.as_str()).collect::<Vec<_>>().join(", ")
        );
    }
    Ok(methods)
}

/// A pattern in which nothing but `?` and `*` is special.
fn plain(pattern: &str) -> String {
    let mut pattern = pattern.replace('[', "[[]");
    // Two would stand for slashes as well.
    while pattern.contains("**") {
        pattern = pattern.replace("**", "*");
    }
    pattern
}

/// Says which drivers are trainings of which method.
///
/// # Errors
/// If the name of a method is none, or that of a driver; if it has fewer than [`TRAININGS_MIN`] drivers, one that is not
/// there or was never trained, one network twice, or two trainings from one seed; if a driver is of two methods.
pub fn assign(methods: &Methods, drivers: &mut [NamedDriver]) -> anyhow::Result<()> {
    for (method, names) in methods {
        let name_of_method = || format!("method {method:?}");
        check_name(method).with_context(name_of_method)?;
        ensure!(
            drivers.iter().all(|driver| driver.name != *method),
            "method {method:?}: a driver has this name; choose another"
        );
        ensure!(
            names.len() >= TRAININGS_MIN,
            "method {method:?}: name at least {TRAININGS_MIN} drivers, not {}: fewer say nothing about others",
            names.len()
        );
        let (mut seeds, mut digests) = (BTreeMap::new(), BTreeMap::new());
        for name in names {
            let driver = drivers.iter_mut().find(|driver| driver.name == *name);
            let driver = driver.with_context(|| format!("method {method:?}: no driver is named {name:?}"))?;
            let is_trained = driver.spec.is_network() || matches!(driver.spec, DriverSpec::Callback { .. });
            ensure!(is_trained, "method {method:?}: {name:?} is no training; leave it out");
            match &driver.method {
                Some(other) if other == method => bail!("method {method:?}: {name:?} is named twice"),
                Some(other) => bail!("methods {other:?} and {method:?}: {name:?} is of both"),
                None => driver.method = Some(method.clone()),
            }
            if let Some(other) = driver.digest().and_then(|digest| digests.insert(digest, name)) {
                bail!("method {method:?}: {other:?} and {name:?} are the same network; leave one out");
            }
            let seed = driver.training.as_ref().map(|training| training.seed.0);
            if let Some((seed, other)) = seed.and_then(|seed| Some((seed, seeds.insert(seed, name)?))) {
                bail!(
                    "method {method:?}: {other:?} and {name:?} were both trained from seed {seed}, so they are not two \
                     trainings of one method"
                );
            }
        }
    }
    Ok(())
}

/// Checks what stands in tables of Markdown as a name.
fn check_name(method: &str) -> anyhow::Result<()> {
    ensure!(!method.trim().is_empty(), "write a name before the =, as in mine=run:runs/mine-s*");
    ensure!(method.chars().count() <= NAME_CHARS_MAX, "shorten its name to at most {NAME_CHARS_MAX} characters");
    let is_other = |&letter: &char| is_hidden(letter) || "|`*<>[]\\".contains(letter);
    let other = method.chars().find(is_other);
    ensure!(other.is_none(), "{:?} cannot be in its name, which stands in tables", other.unwrap_or_default());
    Ok(())
}

/// Trainings of one method, which differ by their seed, or a single other driver.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Team {
    /// That of the method, else of the first driver.
    pub name: String,
    /// Indices of the plan's drivers: by seed, or in their order where the seed of one is not known.
    pub drivers: Vec<usize>,
    /// The root seed of each; none where that of one is not known.
    pub seeds: Vec<u64>,
    /// Indices of those that were trained from one of these seeds once more: they belong to it, and do not count.
    pub duplicates: Vec<usize>,
}

/// What trainings have in common.
#[derive(PartialEq)]
enum InCommon<'a> {
    /// The method that somebody said they are of.
    Method(&'a str),
    /// Everything but the seed.
    Recipe(&'a str),
}

impl<'a> InCommon<'a> {
    /// `None`: it is by itself.
    fn of(driver: &'a NamedDriver) -> Option<Self> {
        let recipe = || driver.training.as_ref().map(|training| Self::Recipe(&training.recipe));
        driver.method.as_deref().map(Self::Method).or_else(recipe)
    }
}

/// Every driver in a team, in the order of the first of each; none if no team has [`TRAININGS_MIN`] members. The same seed
/// again is not another training, also where another machine made another network of it, and counts once.
pub fn teams(drivers: &[NamedDriver]) -> Vec<Team> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (index, driver) in drivers.iter().enumerate() {
        let own = InCommon::of(driver);
        let like = |group: &&mut Vec<usize>| own.is_some() && InCommon::of(&drivers[group[0]]) == own;
        match groups.iter_mut().find(like) {
            Some(group) => group.push(index),
            None => groups.push(vec![index]),
        }
    }
    let mut teams: Vec<Team> = groups.into_iter().map(|group| Team::of(group, drivers)).collect();
    teams.retain(|team| team.drivers.len() == 1 || team.drivers.len() >= TRAININGS_MIN);
    if teams.iter().any(|team| team.drivers.len() > 1) { teams } else { Vec::new() }
}

impl Team {
    fn of(mut group: Vec<usize>, drivers: &[NamedDriver]) -> Self {
        let first = &drivers[group[0]];
        let name = first.method.as_ref().unwrap_or(&first.name).clone();
        let seed_of = |index: &usize| drivers[*index].training.as_ref().map(|training| training.seed.0);
        if !group.iter().all(|index| seed_of(index).is_some()) {
            return Self { name, drivers: group, seeds: Vec::new(), duplicates: Vec::new() };
        }
        let network_of = |index: &usize| (seed_of(index), drivers[*index].digest());
        group.sort_by_cached_key(network_of);
        let mut duplicates = Vec::new();
        group.dedup_by(|index, before| {
            let is_duplicate = seed_of(index) == seed_of(before);
            if is_duplicate {
                duplicates.push(*index);
            }
            is_duplicate
        });
        Self { name, seeds: group.iter().filter_map(seed_of).collect(), drivers: group, duplicates }
    }

    /// Whether a driver belongs to it.
    pub fn has(&self, driver: usize) -> bool {
        self.drivers.contains(&driver) || self.duplicates.contains(&driver)
    }
}

/// A team in a slice: means over its trainings. Differences are its mean less that of the team it is compared with.
#[derive(Debug, Clone, PartialEq)]
pub struct TeamEstimate {
    /// Near-collisions per 100 m of route.
    pub per_100m: Interval,
    /// The same, difference.
    pub difference_per_100m: Interval,
    /// Contacts per 100 m of route.
    pub contacts_per_100m: Interval,
    /// Safe ratio, difference.
    pub difference_safe_ratio: Interval,
    /// Steering reversals per 100 m driven, difference.
    pub difference_reversals_per_100m: Interval,
}

/// Every team of an evaluation in a slice.
#[derive(Debug, Clone, PartialEq)]
pub struct JudgedTeams {
    /// The teams; none if nothing was trained often enough.
    pub teams: Vec<Team>,
    /// How each stands; `None` if they cannot be judged.
    pub(crate) estimates: Option<Vec<TeamEstimate>>,
}

impl JudgedTeams {
    /// Whether there are teams, and enough was driven to judge them by.
    pub fn are_judged(&self) -> bool {
        self.estimates.is_some()
    }

    /// The team of a driver, and how it stands; `None` if it was trained too seldom to speak for others.
    pub fn of(&self, driver: usize) -> Option<(&Team, Option<&TeamEstimate>)> {
        let index = self.teams.iter().position(|team| team.has(driver))?;
        Some((&self.teams[index], self.estimates.as_ref().map(|estimates| &estimates[index])))
    }

    /// The teams, and how each stands; none if they cannot be judged.
    pub fn judged(&self) -> impl Iterator<Item = (&Team, &TeamEstimate)> {
        self.teams.iter().zip(self.estimates.iter().flatten())
    }
}

impl EvaluationResults {
    /// How teams stand in a slice at a noise level, and how they differ from one of them, `with`. Lots are drawn as in
    /// [`judge`](Self::judge), for the means over trainings; Student's interval of these means adds what other seeds bring.
    /// Trainings of one seed begin alike, so teams of the same seeds differ by pairs. What fewer than [`TRAININGS_MIN`] say about
    /// other seeds does not count. A driver by itself has the interval that it has elsewhere: `of_drivers` are the estimates of
    /// [`judge`](Self::judge). `None` of fewer trials, or lots of a sample, than [`UNITS_MIN`]: all of them may be alike by chance.
    pub fn judge_teams(
        &self,
        level: usize,
        slice: &Slice,
        teams: &[Team],
        with: usize,
        of_drivers: &[DriverEstimate],
        seed: RootSeed,
    ) -> Option<Vec<TeamEstimate>> {
        let pairs = self.common_runs(level, slice);
        let strata = strata(&pairs, slice.is_pooled());
        if !are_enough(&strata) {
            return None;
        }
        let drivers = pairs[0].len();
        let of_sums = |sums: &[f64], out: &mut [f64]| means_and_differences(sums, teams, with, out);
        let outputs = 2 * STATISTICS * teams.len();
        let intervals = units(&strata, drivers).percentile_intervals(seed, DRAWS, outputs, &of_sums);
        let (means, differences) = intervals.split_at(STATISTICS * teams.len());

        let mut all = vec![0.0; columns(drivers)];
        for row in &pairs {
            add(&mut all, row);
        }
        let by_seed = |team: &Team, which: usize| -> Vec<f64> {
            team.drivers.iter().map(|&driver| statistics(&all, driver)[which]).collect()
        };
        let of_seeds = |values: &[f64]| if values.len() < TRAININGS_MIN { 0.0 } else { half_width_of_mean(values) };
        // No draw of lots without events has any. Trainings that drove the same lots add no metres.
        let supported = Rate::new(0, reference_100m(&all)).upper;
        let estimate = |(place, team): (usize, &Team)| {
            let is_paired = !team.seeds.is_empty() && team.seeds == teams[with].seeds || team == &teams[with];
            let mean = |which: Statistic| {
                let half_width = of_seeds(&by_seed(team, which as usize));
                widened(means[STATISTICS * place + which as usize], half_width)
            };
            let difference = |which: Statistic| {
                let (own, of_with) = (by_seed(team, which as usize), by_seed(&teams[with], which as usize));
                let half_width = if is_paired {
                    of_seeds(&own.iter().zip(&of_with).map(|(own, with)| own - with).collect::<Vec<_>>())
                } else {
                    together(of_seeds(&own), of_seeds(&of_with))
                };
                widened(differences[STATISTICS * place + which as usize], half_width)
            };
            let of_events = |which: Statistic| {
                let found = mean(which);
                Interval { lower: found.lower.max(0.0), upper: found.upper.max(supported), ..found }
            };
            let mut estimate = TeamEstimate {
                per_100m: of_events(Statistic::NearCollisions),
                difference_per_100m: difference(Statistic::NearCollisions),
                contacts_per_100m: of_events(Statistic::Contacts),
                difference_safe_ratio: difference(Statistic::SafeRatio),
                difference_reversals_per_100m: difference(Statistic::Reversals),
            };
            if let [driver] = team.drivers[..] {
                estimate.take_intervals_of(&self.totals(level, driver, slice, None), &of_drivers[driver]);
            }
            estimate
        };
        Some(teams.iter().enumerate().map(estimate).collect())
    }
}

impl TeamEstimate {
    /// Takes over the intervals of a driver's rates: a team of one is that driver.
    fn take_intervals_of(&mut self, totals: &Totals, of_driver: &DriverEstimate) {
        [self.per_100m.lower, self.per_100m.upper] = quoted_interval(totals, of_driver);
        [self.contacts_per_100m.lower, self.contacts_per_100m.upper] = contacts_interval(totals, of_driver);
    }
}

/// The means over its trainings of each team, by [`Statistic`], then their differences from those of the team `with`.
fn means_and_differences(sums: &[f64], teams: &[Team], with: usize, out: &mut [f64]) {
    let (means, differences) = out.split_at_mut(STATISTICS * teams.len());
    for (out, team) in means.chunks_exact_mut(STATISTICS).zip(teams) {
        let each = team.drivers.iter().map(|&driver| statistics(sums, driver));
        let sum = each.fold([0.0; STATISTICS], |sum, of| std::array::from_fn(|which| sum[which] + of[which]));
        out.copy_from_slice(&sum.map(|sum| sum / team.drivers.len() as f64));
    }
    let of_with = &means[STATISTICS * with..][..STATISTICS];
    for (out, means) in differences.chunks_exact_mut(STATISTICS).zip(means.chunks_exact(STATISTICS)) {
        for ((difference, mean), of_with) in out.iter_mut().zip(means).zip(of_with) {
            *difference = mean - of_with;
        }
    }
}

/// Whether so much is drawn that not all of it may be alike by chance.
fn are_enough(strata: &[Stratum<'_>]) -> bool {
    // What a stratum has one of is never drawn.
    strata.iter().map(Vec::len).filter(|&units| units > 1).sum::<usize>() >= UNITS_MIN as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use experiment::trained::Training;

    fn trained(recipe: &str, seed: u64) -> NamedDriver {
        let mut driver =
            NamedDriver::expert(&expert::ExpertSettings::half_points()).renamed(&format!("{recipe}{seed}"));
        driver.spec = DriverSpec::Checkpoint { folder: driver.name.clone().into() };
        driver.training = Some(Training { recipe: recipe.to_owned(), seed: RootSeed(seed) });
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

    /// Trainings whose settings follow from others', or of another program.
    #[test]
    fn trainings_of_a_named_method_are_a_team_however_they_were_made() {
        let onnx = |name: &str| {
            let mut driver = trained(name, 0);
            driver.training = None;
            driver
        };
        let named = |texts: &[&str], drivers: &mut [NamedDriver]| {
            let texts: Vec<String> = texts.iter().map(|&text| text.to_owned()).collect();
            assign(&methods(&texts, drivers)?, drivers)
        };
        let renamed = |name: &str, seed| trained(&format!("recipe of {name}"), seed).renamed(name);
        let mut drivers = vec![
            renamed("run:c/3", 3),
            renamed("run:c/1", 1),
            onnx("onnx:a"),
            renamed("run:c/2", 2),
            renamed("run:c/2/bc", 2),
            onnx("onnx:b"),
            onnx("onnx:c"),
            NamedDriver::expert(&expert::ExpertSettings::half_points()),
        ];
        named(&["control=run:c/**", "mine=onnx:a?", "mine=onnx:b0", "mine=onnx:c*"], &mut drivers).unwrap();
        let found = teams(&drivers);
        let of = |team: &Team| (team.name.clone(), team.drivers.clone(), team.seeds.clone());
        let mine = ("mine".to_owned(), vec![2, 5, 6], Vec::new());
        let control = ("control".to_owned(), vec![1, 3, 0], vec![1, 2, 3]);
        assert_eq!(
            found.iter().map(of).collect::<Vec<_>>(),
            [control, mine, ("run:c/2/bc".to_owned(), vec![4], vec![2]), ("expert".to_owned(), vec![7], Vec::new())]
        );

        let mut refused = |texts: &[&str]| {
            for driver in &mut drivers {
                driver.method = None;
            }
            format!("{:#}", named(texts, &mut drivers).unwrap_err())
        };
        for (texts, problem) in [
            (&["control"][..], "write a name and its drivers"),
            (&["control=run:d/*"], "no driver is named so"),
            (&["control=run:c/[12]"], "no driver is named so"),
            (&["control=run:c/1", "control=run:c/2"], "at least 3 drivers, not 2"),
            (&["control=run:c/*", "other=run:c/*"], "is of both"),
            (&["control=run:c/*", "control=run:c/1"], "named twice"),
            (&["control=run:c/1", "control=run:c/2", "control=run:c/2/*"], "both trained from seed 2"),
            (&["run:c/1=run:c/*"], "a driver has this name"),
            (&["=run:c/*"], "write a name before the ="),
            (&["a\nb=run:c/*"], "'\\n' cannot be in its name"),
            (&["a|b=run:c/*"], "'|' cannot be in its name"),
            (&["a\u{200b}=run:c/*"], "'\\u{200b}' cannot be in its name"),
            (&[&format!("{}=run:c/*", "m".repeat(101))], "shorten"),
            (&["others=onnx:?0", "others=expert"], "is no training"),
        ] {
            assert!(refused(texts).contains(problem), "{texts:?}: {}", refused(texts));
        }
    }

    /// Three runs with `--seed 1` were three trainings that agree to the last digit.
    #[test]
    fn the_same_seed_again_is_no_further_training() {
        let twice = [trained("a", 1), trained("a", 2), trained("a", 1), trained("a", 3), trained("a", 3)];
        let found = teams(&twice);
        assert_eq!((&*found[0].drivers, &*found[0].seeds), (&[0, 1, 3][..], &[1, 2, 3][..]));
        assert_eq!(found[0].duplicates, [2, 4]);
        assert!((0..5).all(|driver| found[0].has(driver)));
        assert_eq!(teams(&[trained("a", 1), trained("a", 1), trained("a", 1)]), []);
    }
}
