//! What is done, as a list: read it beside the paper's experiments.
//!
//! | stage | what the report needs it for |
//! |---|---|
//! | `chains/sN-weighted` | behaviour cloning and `DAgger` with the paper's weight α on τ̂: Table 1, the driver of every table |
//! | `chains/sN-unweighted` | the same with α = 0: Table 1's effect of the weight; none where nothing is weighted anyway |
//! | `chains/s1-any-below`, `-tau-only` | the other two readings of Algorithm 2, line 9, for a few iterations |
//! | `chains/sN-expert-equal` | control: as many rounds that the expert alone drove, with as many samples as `DAgger` has |
//! | `chains/s1-expert-only` | control: the same with all of the expert's samples |
//! | `chains/s1-alpha-15` | control: ten times the paper's weight; none where it is that anyway |
//! | `chains/s1-far-points` | control: points as far as the way is open, as in the paper; none where they are so anyway |
//! | `chains/s1-person` | control: the expert points with the delay and the unsteadiness of a person; none where it does anyway |
//! | `drives/reference` | the paper's tables: every driver on its lots |
//! | `drives/unseen` | generated lots that nothing was trained or tuned on |
//! | `drives/rules` | the policies after the first iterations under each decision rule |
//! | `drives/controls` | the controls beside what they are compared with, and the expert's rules on the noisy grid, on the unseen lots |
//! | `drives/far-points` | the control with far points, which has another speed law, on the same lots |
//! | `drives/readings`, `drives/readings-unseen` | every planner in every reading of what its publication leaves open |
//! | `drives/unsmoothed`, `drives/smoothed` | the same lots, every driver without and with action smoothing |
//! | `on-policy` | on-policy labelled rollouts: calibration of the variance, Σ τ̂ with and without the weight |
//! | `family/…` | if asked for: the stages of [`rules`], the decision rules of the `DAgger` family at equal samples |
//! | `deviations/…` | if asked for: the stages of [`deviations`], trainings with one thing at a time as in the paper |
//!
//! Behaviour cloning has no τ̂, so that neither α nor the rule changes a bit of it: it is trained once per seed.

use crate::deviations;
use crate::names::{ALPHA_15, BC, DAGGER, EXPERT_EQUAL, EXPERT_ONLY, GRID_EXPERT, OF_PERSON, UNWEIGHTED};
use crate::rules;
use crate::stage::{Stage, Step};
use anyhow::ensure;
use experiment::settings::{Settings, Smoothing, has_points_of_paper, with_points_of_paper};
use experiment::shard::Shard;
use planners::PlannerSpec;
use policy::dagger::IterationRow;
use policy::decision_rule::{ChiOn, DecisionRule};
use serde::{Deserialize, Serialize};
use sim::seed::RootSeed;
use std::collections::BTreeMap;
use std::path::Path;

/// How much is done, besides what the settings say: the arguments in the manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extent {
    /// Trainings, each from a root seed of its own, the settings' first.
    pub seeds: u64,
    /// Generated lots that all drivers meet for the first time; driven once each way.
    pub unseen: Vec<String>,
    /// Iterations of the chains that compare decision rules.
    pub rule_iterations: u32,
    /// Tuned planners, as named on the command line.
    pub tuned: Vec<String>,
    /// The comparison of decision rules; none: it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rules: Option<rules::Extent>,
    /// The trainings with one thing at a time as in the paper; none: they are left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deviations: Option<deviations::Extent>,
}

/// A training chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Chain {
    /// The paper's.
    Weighted,
    /// α = 0.
    Unweighted,
    /// Algorithm 2 as printed.
    AnyBelow,
    /// Without χ.
    TauOnly,
    /// The expert drives alone, in as many rounds of as many lots and optimiser steps.
    ExpertOnly,
    /// The same with as many samples as [`Self::Weighted`] has.
    ExpertEqual,
    /// α = 15.
    Alpha15,
    /// Points as far as the way is open, as the paper has them.
    FarPoints,
    /// Labels with the delay and the unsteadiness of a person.
    Person,
}

impl Chain {
    /// Its folder.
    pub fn folder(self, seed: RootSeed) -> String {
        let name = match self {
            Self::Weighted => "weighted",
            Self::Unweighted => "unweighted",
            Self::AnyBelow => "any-below",
            Self::TauOnly => "tau-only",
            Self::ExpertOnly => "expert-only",
            Self::ExpertEqual => "expert-equal",
            Self::Alpha15 => "alpha-15",
            Self::FarPoints => "far-points",
            Self::Person => "person",
        };
        format!("chains/s{}-{name}", seed.0)
    }

    fn about(self) -> &'static str {
        match self {
            Self::Weighted => "behaviour cloning, DAgger with the weight on τ̂",
            Self::Unweighted => "DAgger with α = 0",
            Self::AnyBelow => "DAgger under \"any below\", Algorithm 2 as printed",
            Self::TauOnly => "DAgger under \"τ̂ alone\"",
            Self::ExpertOnly => "as many rounds as DAgger, the expert drives alone",
            Self::ExpertEqual => "the same with as many samples as DAgger",
            Self::Alpha15 => "DAgger with α = 15",
            Self::FarPoints => "behaviour cloning, DAgger with points as far as the way is open",
            Self::Person => "behaviour cloning, DAgger with the hand of a person",
        }
    }

    /// Whether it is trained: not where it would be the paper's once more.
    pub fn is_trained(self, settings: &Settings) -> bool {
        let loss = &settings.dagger.fit.loss;
        match self {
            Self::Unweighted => !loss.is_like(&loss.with_alpha(UNWEIGHTED_ALPHA)),
            Self::Alpha15 => !loss.is_like(&loss.with_alpha(HEAVY_ALPHA)),
            Self::FarPoints => !has_points_of_paper(settings),
            Self::Person => settings.expert != settings.expert.clone().with_hand_of_a_person(),
            Self::Weighted | Self::AnyBelow | Self::TauOnly | Self::ExpertOnly | Self::ExpertEqual => true,
        }
    }

    fn stage(self, settings: &Settings, extent: &Extent) -> Stage {
        let mut settings = match self {
            Self::FarPoints => with_points_of_paper(settings),
            Self::Person => Settings { expert: settings.expert.clone().with_hand_of_a_person(), ..settings.clone() },
            _ => settings.clone(),
        };
        let dagger = &mut settings.dagger;
        let tau = dagger.rule.tau().unwrap_or(TAU);
        let (chi, chi_on) = dagger.rule.chi().unwrap_or((CHI, ChiOn::default()));
        match self {
            Self::Weighted | Self::FarPoints | Self::Person => {}
            Self::Unweighted => dagger.fit.loss = dagger.fit.loss.with_alpha(UNWEIGHTED_ALPHA),
            Self::AnyBelow => dagger.rule = DecisionRule::AnyBelowLiteral { tau, chi, chi_on },
            Self::TauOnly => dagger.rule = DecisionRule::TauOnly { tau },
            Self::ExpertOnly | Self::ExpertEqual => dagger.rule = DecisionRule::ExpertOnly,
            Self::Alpha15 => dagger.fit.loss = dagger.fit.loss.with_alpha(HEAVY_ALPHA),
        }
        if matches!(self, Self::AnyBelow | Self::TauOnly) {
            dagger.iterations_max = dagger.iterations_max.min(extent.rule_iterations);
            dagger.iterations_min = dagger.iterations_min.min(extent.rule_iterations);
        }
        // Other points are other labels.
        let has_cloning = matches!(self, Self::Weighted | Self::FarPoints | Self::Person);
        let weighted = || Self::Weighted.folder(settings.seed);
        let cloning_of = (!has_cloning).then(weighted);
        let samples_of = (self == Self::ExpertEqual).then(weighted);
        Stage {
            folder: self.folder(settings.seed),
            about: self.about().to_owned(),
            settings,
            step: Step::Train { cloning_of, samples_of },
        }
    }
}

/// α of [`Chain::Unweighted`].
const UNWEIGHTED_ALPHA: f32 = 0.0;
/// α of [`Chain::Alpha15`].
const HEAVY_ALPHA: f32 = 15.0;

/// Settings of a training with as many iterations as another, of as many samples on average: `rows` are those of the other.
pub fn with_as_many_samples(settings: &Settings, rows: &[IterationRow]) -> Settings {
    let mut settings = settings.clone();
    let dagger = &mut settings.dagger;
    let iterations = rows.get(1..).unwrap_or_default();
    let samples: usize = iterations.iter().map(|row| row.samples).sum();
    (dagger.iterations_min, dagger.iterations_max) = (iterations.len() as u32, iterations.len() as u32);
    // None at all would stand for all of them.
    dagger.samples_per_round = samples.div_ceil(iterations.len().max(1)).max(1) as u32;
    settings
}

/// The paper's τ and χ, for chains whose rule has none.
const TAU: f32 = 0.07;
/// See [`TAU`].
const CHI: f32 = 0.1;

/// Name of what was trained from a seed: the first one's is that of the paper's driver.
pub fn named(base: &str, seed: RootSeed, settings: &Settings) -> String {
    if seed == settings.seed { base.to_owned() } else { format!("{base} (seed {})", seed.0) }
}

/// Folders of the stages that drive, and of the one with on-policy rollouts.
pub const REFERENCE: &str = "drives/reference";
/// See [`REFERENCE`].
pub const UNSEEN: &str = "drives/unseen";
/// See [`REFERENCE`].
pub const RULES: &str = "drives/rules";
/// See [`REFERENCE`].
pub const CONTROLS: &str = "drives/controls";
/// See [`REFERENCE`].
pub const FAR_POINTS: &str = "drives/far-points";
/// See [`REFERENCE`].
pub const READINGS: &str = "drives/readings";
/// See [`REFERENCE`].
pub const READINGS_UNSEEN: &str = "drives/readings-unseen";
/// See [`REFERENCE`].
pub const UNSMOOTHED: &str = "drives/unsmoothed";
/// See [`REFERENCE`].
pub const SMOOTHED: &str = "drives/smoothed";
/// See [`REFERENCE`].
pub const ON_POLICY: &str = "on-policy";
/// Folder of the comparison of decision rules.
pub const FAMILY: &str = "family";
/// Folder of the trainings with one thing at a time as in the paper.
pub const DEVIATIONS: &str = "deviations";

/// Action smoothing of [`SMOOTHED`] where the settings' networks have none, control ticks.
const SMOOTHING_TICKS: f32 = 8.0;

/// Refuses settings that the report would name wrong.
///
/// # Errors
/// If the decision rule is another than the one that its readings are compared with.
pub fn check(settings: &Settings) -> anyhow::Result<()> {
    ensure!(
        settings.dagger.rule.is_like(&DecisionRule::paper()),
        "dagger.rule: a reproduction trains by the paper's rule, all_below, and compares its other readings with it; leave the rule \
         out (thresholds may be set, as in dagger.rule.all_below.tau=0.05), or compare rules with cargo xtask rules"
    );
    Ok(())
}

/// Everything, in the order in which it is done. `root`: the folder of the whole run.
///
/// # Errors
/// See [`of_rules`] and [`of_deviations`].
pub fn all(settings: &Settings, extent: &Extent, root: &Path) -> anyhow::Result<Vec<Stage>> {
    let mut stages = trainings(settings, extent);
    stages.extend(drives(settings, extent, root));
    stages.push(Stage {
        folder: ON_POLICY.to_owned(),
        about: "on-policy labelled rollouts: networks drive, the expert labels".to_owned(),
        settings: settings.clone(),
        step: Step::OnPolicy { seeds: settings.training_seeds(extent.seeds) },
    });
    if let Some(compared) = of_rules(settings, extent, root)? {
        stages.extend(compared.stages.into_iter().map(|stage| stage.within(FAMILY)));
    }
    for stage in of_deviations(settings, extent, root)?.into_iter().flatten() {
        let is_base = stage.folder == deviations::BASE;
        let mut stage = stage.within(DEVIATIONS);
        if let Step::Train { cloning_of, .. } = &mut stage.step
            && is_base
        {
            *cloning_of = Some(Chain::Weighted.folder(settings.seed));
        }
        stages.push(stage);
    }
    Ok(stages)
}

/// The comparison of decision rules.
#[derive(Debug)]
pub struct ComparedRules {
    /// Its settings: few lots and short fits, because there are so many trainings.
    pub settings: Settings,
    /// Its stages; their folders lie in [`FAMILY`].
    pub stages: Vec<Stage>,
}

/// The comparison of decision rules, if it is asked for.
///
/// # Errors
/// If the settings contradict those of the comparison.
pub fn of_rules(settings: &Settings, extent: &Extent, root: &Path) -> anyhow::Result<Option<ComparedRules>> {
    let Some(compared) = &extent.rules else { return Ok(None) };
    let settings = rules::in_short(settings)?;
    let stages = rules::stages(&settings, compared, &root.join(FAMILY));
    Ok(Some(ComparedRules { settings, stages }))
}

/// The trainings with one thing at a time as in the paper, if they are asked for; their folders lie in [`DEVIATIONS`].
///
/// # Errors
/// If the settings contradict each other with one thing as in the paper.
pub fn of_deviations(settings: &Settings, extent: &Extent, root: &Path) -> anyhow::Result<Option<Vec<Stage>>> {
    let deviations = extent.deviations.as_ref();
    deviations.map(|deviations| deviations::stages(settings, deviations, &root.join(DEVIATIONS))).transpose()
}

/// The stages without the trainings whose folders are missing, and without the drivers that depend on them: an earlier
/// version did not do all that this one does.
pub fn without_trainings(stages: Vec<Stage>, is_there: impl Fn(&str) -> bool) -> Vec<Stage> {
    let is_missing = |stage: &&Stage| matches!(stage.step, Step::Train { .. }) && !is_there(&stage.folder);
    let missing: Vec<String> = stages.iter().filter(is_missing).map(|stage| stage.folder.clone()).collect();
    let drives = |spec: &str, folder: &String| Path::new(spec).ancestors().any(|part| part.ends_with(folder));
    let left = stages.into_iter().filter(|stage| !missing.contains(&stage.folder)).map(|mut stage| {
        if let Step::Drive { drivers } = &mut stage.step {
            drivers.retain(|(_, spec)| !missing.iter().any(|folder| drives(spec, folder)));
        }
        stage
    });
    left.filter(|stage| !matches!(&stage.step, Step::Drive { drivers } if drivers.is_empty())).collect()
}

/// What shards share out. What drives needs every network: trainings are put together first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Whole trainings.
    Trainings,
    /// The trials of everything that drives.
    Drives,
}

/// The share of a part that a shard does.
pub fn share(stages: Vec<Stage>, part: Part, shard: Shard) -> Vec<Stage> {
    match part {
        Part::Trainings => {
            let dealt = dealt_out(&stages, shard.of());
            let is_taken = |place: &Option<usize>| place.is_some_and(|place| shard.takes(place));
            let taken: Vec<Stage> =
                stages.into_iter().zip(dealt).filter_map(|(stage, place)| is_taken(&place).then_some(stage)).collect();
            let folders: Vec<String> = taken.iter().map(|stage| stage.folder.clone()).collect();
            let with_its_cloning = |mut stage: Stage| {
                if let Step::Train { cloning_of, .. } = &mut stage.step {
                    // Its weights are the same wherever it is trained.
                    cloning_of.take_if(|chain| !folders.contains(chain));
                }
                stage
            };
            taken.into_iter().map(with_its_cloning).collect()
        }
        Part::Drives => {
            let shared_out = |stage: Stage| match stage.step {
                Step::Drive { drivers } => Some(Stage { step: Step::DriveShard { drivers, shard }, ..stage }),
                _ => None,
            };
            stages.into_iter().filter_map(shared_out).collect()
        }
    }
}

/// The place of each training in the order in which they are dealt out; `None` for what trains nothing. A training that needs
/// the samples of another goes with it. So do all that begin with one behaviour cloning, which is trained once that way,
/// unless there are more shards than clonings.
fn dealt_out(stages: &[Stage], shards: u32) -> Vec<Option<usize>> {
    let steps: BTreeMap<&str, &Step> = stages.iter().map(|stage| (stage.folder.as_str(), &stage.step)).collect();
    let with_samples = |folder: &str| match steps.get(folder) {
        Some(Step::Train { samples_of: Some(other), .. }) => other.clone(),
        _ => folder.to_owned(),
    };
    let with_cloning = |folder: &str| {
        let mut first = folder;
        while let Some(Step::Train { cloning_of: Some(other), .. }) = steps.get(first) {
            first = other;
        }
        first.to_owned()
    };
    let places = |unit: &dyn Fn(&str) -> String| {
        let mut units: Vec<String> = Vec::new();
        let mut place = |stage: &Stage| {
            let Step::Train { .. } = stage.step else { return None };
            let unit = unit(&stage.folder);
            let known = units.iter().position(|known| *known == unit);
            Some(known.unwrap_or_else(|| {
                units.push(unit);
                units.len() - 1
            }))
        };
        let places: Vec<Option<usize>> = stages.iter().map(&mut place).collect();
        (places, units.len())
    };
    let (by_cloning, clonings) = places(&with_cloning);
    if clonings >= shards as usize { by_cloning } else { places(&with_samples).0 }
}

fn trainings(settings: &Settings, extent: &Extent) -> Vec<Stage> {
    let mut stages = Vec::new();
    for seed in settings.training_seeds(extent.seeds) {
        let of_seed = Settings { seed, ..settings.clone() };
        let chains = [Chain::Weighted, Chain::Unweighted, Chain::ExpertEqual];
        stages.extend(stages_of(&chains, &of_seed, extent));
    }
    let of_first_seed =
        [Chain::AnyBelow, Chain::TauOnly, Chain::ExpertOnly, Chain::Alpha15, Chain::FarPoints, Chain::Person];
    stages.extend(stages_of(&of_first_seed, settings, extent));
    stages
}

/// Those of some chains that are trained.
fn stages_of(chains: &[Chain], settings: &Settings, extent: &Extent) -> impl Iterator<Item = Stage> {
    chains.iter().filter(|chain| chain.is_trained(settings)).map(|chain| chain.stage(settings, extent))
}

/// Drivers by their names in tables.
type Drivers = Vec<(String, String)>;

/// What a chain ended with, as a driver of the command line; `/bc` behind it: what it began with.
fn spec(root: &Path, chain: Chain, seed: RootSeed, rest: &str) -> String {
    format!("run:{}/{}{rest}", root.display(), chain.folder(seed))
}

/// Behaviour cloning, then `DAgger` with the weight and without, of every seed.
fn networks(settings: &Settings, extent: &Extent, root: &Path) -> Drivers {
    let of_seed = |seed| {
        [(BC, Chain::Weighted, "/bc"), (DAGGER, Chain::Weighted, ""), (UNWEIGHTED, Chain::Unweighted, "")]
            .into_iter()
            .filter(|(_, chain, _)| chain.is_trained(settings))
            .map(move |(name, chain, rest)| (named(name, seed, settings), spec(root, chain, seed, rest)))
    };
    settings.training_seeds(extent.seeds).into_iter().flat_map(of_seed).collect()
}

/// The policies after the first iterations under each decision rule.
fn under_each_rule(settings: &Settings, extent: &Extent, root: &Path) -> Drivers {
    let of_first_seed = |name: &str, chain| (name.to_owned(), spec(root, chain, settings.seed, ""));
    let rule_iterations = extent.rule_iterations.min(settings.dagger.iterations_max);
    // The other chains end there, or earlier: their last network is meant.
    let all_below = if rule_iterations < settings.dagger.iterations_max {
        let folder = Chain::Weighted.folder(settings.seed);
        ("all below".to_owned(), format!("net:{}/{folder}/round-{rule_iterations:02}", root.display()))
    } else {
        of_first_seed("all below", Chain::Weighted)
    };
    vec![all_below, of_first_seed("any below", Chain::AnyBelow), of_first_seed("τ̂ alone", Chain::TauOnly)]
}

/// The controls behind the networks that they are compared with.
fn controls(networks: &[(String, String)], settings: &Settings, extent: &Extent, root: &Path) -> Drivers {
    let of_first_seed = |name: &str, chain, rest: &str| (name.to_owned(), spec(root, chain, settings.seed, rest));
    let mut controls = networks.to_vec();
    controls.push(of_first_seed(EXPERT_ONLY, Chain::ExpertOnly, ""));
    let equal = |seed| (named(EXPERT_EQUAL, seed, settings), spec(root, Chain::ExpertEqual, seed, ""));
    controls.extend(settings.training_seeds(extent.seeds).into_iter().map(equal));
    if Chain::Alpha15.is_trained(settings) {
        controls.push(of_first_seed(ALPHA_15, Chain::Alpha15, ""));
    }
    if Chain::Person.is_trained(settings) {
        let of_person = OF_PERSON.into_iter().zip(["/bc", ""]);
        controls.extend(of_person.map(|(name, rest)| of_first_seed(name, Chain::Person, rest)));
    }
    controls.push((GRID_EXPERT.to_owned(), "grid-expert".to_owned()));
    controls
}

fn drives(settings: &Settings, extent: &Extent, root: &Path) -> Vec<Stage> {
    let networks = networks(settings, extent, root);
    let own = |name: &str| (name.to_owned(), name.to_owned());
    let expert = vec![own("expert")];
    let tuned: Drivers = extent.tuned.iter().map(|spec| (tuned_name(spec), spec.clone())).collect();
    let planners: Drivers = PlannerSpec::all().iter().map(|planner| own(planner.name())).collect();
    let readings: Drivers = PlannerSpec::in_every_reading().iter().map(|(name, _)| own(name)).collect();
    // Where a planner has been tuned, only the paper's two take part as they are, too: the others stand for nothing.
    let is_tuned = |name: &str| tuned.iter().any(|(tuned, _)| *tuned == tuned_name(name));
    let stands_for_itself = |name: &str| name == "tentacle" || name == "vvf" || !is_tuned(name);
    let enough: Drivers = planners.iter().filter(|(name, _)| stands_for_itself(name)).cloned().collect();

    let evaluation = &settings.evaluation;
    let drive = |folder: &str, about: &str, (lots, trials): (&[String], u32), drivers: Drivers| {
        let mut settings = settings.clone();
        (settings.evaluation.lots, settings.evaluation.trials) = (lots.to_vec(), trials);
        Stage { folder: folder.to_owned(), about: about.to_owned(), settings, step: Step::Drive { drivers } }
    };
    let (of_paper, unseen) = ((&evaluation.lots[..], evaluation.trials), (&extent.unseen[..], 1));
    let everyone = |planners: &Drivers| [&expert, &networks, planners, &tuned].map(Clone::clone).concat();
    let mut stages = vec![
        drive(REFERENCE, "every driver on the paper's lots", of_paper, everyone(&planners)),
        drive(UNSEEN, "drivers on generated lots", unseen, everyone(&enough)),
        drive(RULES, "policies under each decision rule", of_paper, under_each_rule(settings, extent, root)),
        drive(CONTROLS, "controls on generated lots", unseen, controls(&networks, settings, extent, root)),
    ];

    if Chain::FarPoints.is_trained(settings) {
        let far = Chain::FarPoints.stage(settings, extent).settings;
        let policies = [(BC, "/bc"), (DAGGER, "")]
            .map(|(name, rest)| (name.to_owned(), spec(root, Chain::FarPoints, settings.seed, rest)))
            .to_vec();
        let mut stage = drive(FAR_POINTS, "policies with far points on generated lots", unseen, policies);
        (stage.settings.episode, stage.settings.expert) = (far.episode, far.expert);
        stages.push(stage);
    }

    let beside_dagger = [networks[1..2].to_vec(), readings].concat();
    stages.push(drive(READINGS, "every reading of the planners on the paper's lots", of_paper, beside_dagger.clone()));
    stages.push(drive(READINGS_UNSEEN, "every reading of the planners on generated lots", unseen, beside_dagger));

    let own_ticks = settings.dagger.inference.smoothing_ticks;
    let ticks = if own_ticks > 0.0 { own_ticks } else { SMOOTHING_TICKS };
    for (folder, about, ticks) in [
        (UNSMOOTHED, "every driver without action smoothing", 0.0),
        (SMOOTHED, "every driver with action smoothing", ticks),
    ] {
        let drivers = [&expert, &networks[..2].to_vec(), &enough, &tuned].map(Clone::clone).concat();
        let mut stage = drive(folder, about, unseen, drivers);
        stage.settings.evaluation.smoothing = Smoothing::Ticks(ticks);
        stages.push(stage);
    }
    stages
}

/// `tuned:vvf` and `vvf:FILE` → `vvf, tuned`.
fn tuned_name(spec: &str) -> String {
    let name = spec.strip_prefix("tuned:").or_else(|| spec.split(':').next()).unwrap_or(spec);
    format!("{name}, tuned")
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::loss::{LossSettings, WeightForm};

    fn extent() -> Extent {
        Extent {
            seeds: 1,
            unseen: vec!["test:20".to_owned()],
            rule_iterations: 1,
            tuned: Vec::new(),
            rules: None,
            deviations: None,
        }
    }

    #[test]
    fn chains_differ_from_the_papers_in_one_thing_each() {
        let settings = Settings::preset("default").unwrap();
        let stages = all(&settings, &extent(), Path::new("R")).unwrap();
        let of = |folder: &str| stages.iter().find(|stage| stage.folder == folder).unwrap().settings.dagger.clone();
        assert_eq!(of("chains/s1-weighted"), settings.dagger);
        let mut unweighted = of("chains/s1-unweighted");
        assert_eq!(unweighted.fit.loss.alpha, 0.0);
        unweighted.fit.loss.alpha = 1.5;
        assert_eq!(unweighted, settings.dagger);
        let any = of("chains/s1-any-below");
        assert_eq!(any.rule, DecisionRule::AnyBelowLiteral { tau: 0.07, chi: 0.1, chi_on: ChiOn::StdPerAxis });
        assert_eq!((any.iterations_max, any.fit), (1, settings.dagger.fit.clone()));
        assert_eq!(of("chains/s1-tau-only").rule, DecisionRule::TauOnly { tau: 0.07 });
        let mut control = of("chains/s1-expert-only");
        assert_eq!(control.rule, DecisionRule::ExpertOnly);
        assert_eq!(of("chains/s1-expert-equal"), control);
        control.rule = settings.dagger.rule;
        assert_eq!(control, settings.dagger);
        let mut heavy = of("chains/s1-alpha-15");
        assert_eq!(heavy.fit.loss.alpha, 15.0);
        heavy.fit.loss.alpha = 1.5;
        assert_eq!(heavy, settings.dagger);
        let far = stages.iter().find(|stage| stage.folder == "chains/s1-far-points").unwrap();
        assert_eq!(far.step, Step::Train { cloning_of: None, samples_of: None });
        assert_eq!(far.settings, with_points_of_paper(&settings));
        let person = stages.iter().find(|stage| stage.folder == "chains/s1-person").unwrap();
        assert_eq!(person.step, Step::Train { cloning_of: None, samples_of: None });
        let expert = expert::ExpertSettings { reaction_delay_s: 0.3, label_jitter: 0.0097, ..settings.expert.clone() };
        assert_eq!(person.settings, Settings { expert, ..settings.clone() });
        let of_paper = all(&Settings::preset("paper").unwrap(), &extent(), Path::new("R")).unwrap();
        assert!(of_paper.iter().all(|stage| !stage.folder.contains("far-points")), "its points are far anyway");
    }

    /// With the authors' linear weight, which does not use α, a network was trained three times; and twice where α was 0 or 15.
    #[test]
    fn no_network_is_trained_twice_whatever_is_weighted() {
        let default = Settings::preset("default").unwrap();
        let of_paper = default.dagger.fit.loss;
        let linear = |gain| LossSettings { weight: WeightForm::Linear { gain }, ..of_paper };
        let samples_of = |stage: &Stage| match &stage.step {
            Step::Train { samples_of, .. } => samples_of.clone(),
            _ => None,
        };
        let (both, unweighted, heavy) = (vec![], vec!["chains/s1-unweighted"], vec!["chains/s1-alpha-15"]);
        for (loss, missing) in [
            (of_paper, both.clone()),
            (linear(10.0), both),
            (of_paper.with_alpha(0.0), unweighted.clone()),
            (linear(0.0), unweighted),
            (of_paper.with_alpha(15.0), heavy),
        ] {
            let mut settings = default.clone();
            settings.dagger.fit.loss = loss;
            let stages = all(&settings, &extent(), Path::new("R")).unwrap();
            let trained: Vec<&Stage> = stages.iter().filter(|stage| matches!(stage.step, Step::Train { .. })).collect();
            let folders: Vec<&str> = trained.iter().map(|stage| stage.folder.as_str()).collect();
            assert_eq!(folders.len() + missing.len(), 9, "{loss:?}: {folders:?}");
            assert!(missing.iter().all(|folder| !folders.contains(folder)), "{loss:?}: {folders:?}");
            for (at, one) in trained.iter().enumerate() {
                for other in &trained[..at] {
                    let (mut alike, losses) =
                        (one.settings.clone(), [one, other].map(|it| it.settings.dagger.fit.loss));
                    alike.dagger.fit.loss = losses[1];
                    let has_like_loss = losses[0].is_like(&losses[1]);
                    let is_same = alike == other.settings && has_like_loss && samples_of(one) == samples_of(other);
                    assert!(!is_same, "{loss:?}: {} and {}", one.folder, other.folder);
                }
            }
            // Nobody drives what is not trained.
            let left = without_trainings(stages.clone(), |folder| folders.contains(&folder));
            assert_eq!(left, stages);
            let specs = stages.iter().filter_map(|stage| match &stage.step {
                Step::Drive { drivers } => Some(drivers.iter().map(|(_, spec)| spec)),
                _ => None,
            });
            for spec in specs.flatten().filter(|spec| spec.contains("R/chains/")) {
                assert!(folders.iter().any(|folder| spec.contains(folder)), "{loss:?}: {spec}");
            }
        }
    }

    /// It was called "all below".
    #[test]
    fn another_decision_rule_than_the_papers_is_refused_and_other_thresholds_are_not() {
        let mut settings = Settings::preset("default").unwrap();
        settings.dagger.rule = DecisionRule::AllBelow { tau: 0.05, chi: 0.2, chi_on: ChiOn::StdNorm };
        check(&settings).unwrap();
        settings.dagger.rule = DecisionRule::named("safe_dagger").unwrap();
        let error = check(&settings).unwrap_err().to_string();
        assert!(error.contains("dagger.rule") && error.contains("cargo xtask rules"), "{error}");
    }

    /// `render results` of a run that an earlier version finished said that one of its chains is not a run.
    #[test]
    fn what_an_earlier_version_did_not_train_is_left_out() {
        let settings = Settings::preset("default").unwrap();
        let stages = all(&settings, &extent(), Path::new("R")).unwrap();
        let missing = ["chains/s1-expert-equal", "chains/s1-far-points"];
        let left = without_trainings(stages.clone(), |folder| !missing.contains(&folder));
        let gone = ["chains/s1-expert-equal", "chains/s1-far-points", FAR_POINTS];
        assert_eq!(left.len(), stages.len() - gone.len());
        assert!(left.iter().all(|stage| !gone.contains(&stage.folder.as_str())));
        let controls = left.iter().find(|stage| stage.folder == CONTROLS).unwrap();
        let Step::Drive { drivers } = &controls.step else { panic!("{controls:?}") };
        let names: Vec<&str> = drivers.iter().map(|(name, _)| name.as_str()).collect();
        let [bc, dagger] = OF_PERSON;
        assert_eq!(names, ["BC", "DAgger", "DAgger, α = 0", EXPERT_ONLY, ALPHA_15, bc, dagger, GRID_EXPERT]);
        assert_eq!(without_trainings(stages.clone(), |_| true), stages);
    }

    #[test]
    fn the_control_has_the_iterations_and_samples_of_the_other() {
        let settings = Settings::preset("default").unwrap();
        let row = |round, samples| IterationRow {
            round,
            samples,
            dataset: 0,
            eta_hat: None,
            tau_hat_per_s: None,
            near_collisions: 0,
            effort: None,
            agreement: None,
            mean_weight: None,
            validation_nll: None,
            validation_rmse_m: None,
        };
        let of = |samples: &[usize]| {
            let rows: Vec<_> = (0..).zip(samples).map(|(round, &samples)| row(round, samples)).collect();
            let dagger = with_as_many_samples(&settings, &rows).dagger;
            assert_eq!(dagger.iterations_min, dagger.iterations_max);
            (dagger.iterations_max, dagger.samples_per_round)
        };
        assert_eq!(of(&[900, 100, 301]), (2, 201), "the other stopped early");
        assert_eq!(of(&[900, 0]), (1, 1), "no samples are not all samples");
        assert_eq!(of(&[900]), (0, 1));
    }

    #[test]
    fn shards_have_every_training_once_and_all_of_them_drive() {
        let (settings, extent) = (Settings::preset("default").unwrap(), extent());
        let stages = all(&settings, &extent, Path::new("R")).unwrap();
        let shares = |part, of: &str| {
            let shards = of.parse::<Shard>().unwrap().all();
            shards.map(|shard| share(stages.clone(), part, shard)).collect::<Vec<_>>()
        };
        let mut expected: Vec<&str> =
            stages.iter().map(|stage| stage.folder.as_str()).filter(|folder| folder.starts_with("chains")).collect();
        expected.sort_unstable();
        let weighted = Chain::Weighted.folder(settings.seed);
        let equal = Step::Train { cloning_of: Some(weighted.clone()), samples_of: Some(weighted.clone()) };
        for of in ["1/1", "1/2", "1/3", "1/4", "1/8", "1/16"] {
            let trained = shares(Part::Trainings, of);
            let mut folders: Vec<&str> = trained.iter().flatten().map(|stage| stage.folder.as_str()).collect();
            folders.sort_unstable();
            assert_eq!(folders, expected, "{of}");
            // What needs the samples of another is trained where that one is.
            for shard in trained {
                let has = |folder: &str| shard.iter().any(|stage| stage.folder == folder);
                assert_eq!(has(&weighted), shard.iter().any(|stage| stage.step == equal), "{of}");
            }
        }
        // Three behaviour clonings, of the seed, of far points and of a person: three machines train each of them once, in the
        // steps of one machine.
        let few = shares(Part::Trainings, "1/3");
        assert!(few.iter().flatten().all(|stage| stages.contains(stage)));
        // More of them would have nothing to do that way: the second has the chain with α = 0, and trains its cloning itself.
        let many = shares(Part::Trainings, "1/8");
        assert_eq!(many[1].len(), 1);
        assert_eq!(many[1][0].step, Step::Train { cloning_of: None, samples_of: None });
        for driven in shares(Part::Drives, "1/4") {
            assert_eq!(driven.len(), 9);
            let takes_time = |stage: &Stage| stage.tasks().iter().all(|(_, seconds)| *seconds > 0.0);
            assert!(driven.iter().all(|stage| stage.folder.starts_with("drives") && takes_time(stage)));
        }
    }

    #[test]
    fn tables_with_trainings_of_their_own_lie_in_folders_and_drive_what_lies_there() {
        let settings = Settings::preset("default").unwrap();
        let unseen = ["validation:9:all".to_owned()];
        let rules = ["expert_only", "all_below"].map(str::to_owned).to_vec();
        let rules = rules::Extent { rules, ..rules::Extent::of_all(1, &unseen) };
        let deviations =
            deviations::Extent { deviations: vec!["start".to_owned(), "points".to_owned()], unseen: unseen.to_vec() };
        let plain = all(&settings, &extent(), Path::new("R")).unwrap();
        let extent = Extent { rules: Some(rules), deviations: Some(deviations), ..extent() };
        let stages = all(&settings, &extent, Path::new("R")).unwrap();
        assert_eq!(stages[..plain.len()], plain);
        let further = &stages[plain.len()..];
        let folders: Vec<&str> = further.iter().map(|stage| stage.folder.as_str()).collect();
        assert_eq!(
            folders,
            [
                "family/s1-expert_only",
                "family/s1-all_below",
                "family/drives",
                "deviations/as-it-is",
                "deviations/start",
                "deviations/points",
                "deviations/drives",
                "deviations/drives-points"
            ]
        );
        let train =
            |cloning_of: Option<&str>| Step::Train { cloning_of: cloning_of.map(str::to_owned), samples_of: None };
        assert_eq!(further[1].step, train(Some("family/s1-expert_only")));
        assert_eq!(further[3].step, train(Some("chains/s1-weighted")), "it is the same behaviour cloning");
        assert_eq!(further[4].step, train(Some("deviations/as-it-is")));
        assert_eq!(further[5].step, train(None), "other points are other labels");
        // Few lots, many trainings.
        assert_eq!(further[1].settings.training.lots, ["lot-a", "train:36:all"]);
        assert!(further[4].settings.training == settings.training && further[4].settings.dagger != settings.dagger);
        // Everybody who drives there was trained there.
        for stage in further {
            let Step::Drive { drivers } = &stage.step else { continue };
            for (name, spec) in drivers {
                let run = spec.strip_prefix("run:R/").unwrap().trim_end_matches("/bc");
                assert!(folders.contains(&run), "{name}: {spec}");
            }
        }
        // Shards have each once.
        let shards = "1/3".parse::<Shard>().unwrap().all().map(|shard| share(stages.clone(), Part::Trainings, shard));
        let mut shared: Vec<String> = shards.flatten().map(|stage| stage.folder).collect();
        shared.sort_unstable();
        let is_training = |stage: &&Stage| matches!(stage.step, Step::Train { .. });
        let mut trained: Vec<String> = stages.iter().filter(is_training).map(|stage| stage.folder.clone()).collect();
        trained.sort_unstable();
        assert_eq!(shared, trained);
    }

    #[test]
    fn drivers_are_named_and_more_seeds_add_theirs() {
        let settings = Settings::preset("default").unwrap();
        let tuned = ["dwa:t/dwa.toml", "tuned:vff"].map(str::to_owned).to_vec();
        let extent = Extent { seeds: 2, tuned, ..extent() };
        let stages = all(&settings, &extent, Path::new("R")).unwrap();
        let names = |folder: &str| -> Vec<String> {
            let stage = stages.iter().find(|stage| stage.folder == folder).unwrap();
            let Step::Drive { drivers } = &stage.step else { panic!("{folder} drives") };
            drivers.iter().map(|(name, _)| name.clone()).collect()
        };
        let reference = names(REFERENCE);
        for name in ["expert", "BC", "DAgger", "DAgger, α = 0", "DAgger (seed 2)", "tentacle", "dwa", "dwa, tuned"] {
            assert!(reference.iter().any(|found| found == name), "{name} is missing from {reference:?}");
        }
        assert!(names(UNSEEN).contains(&"vff, tuned".to_owned()));
        for name in ["dwa", "vff"] {
            assert!(!names(UNSEEN).contains(&name.to_owned()), "its tuned variant stands for {name}");
        }
        assert!(names(UNSEEN).contains(&"vvf".to_owned()) && names(UNSEEN).contains(&"cvm".to_owned()));
        let controls = names(CONTROLS);
        assert_eq!(controls[..3], ["BC", "DAgger", "DAgger, α = 0"]);
        let second = format!("{EXPERT_EQUAL} (seed 2)");
        let [bc, dagger] = OF_PERSON;
        let expected = [EXPERT_ONLY, EXPERT_EQUAL, &second, ALPHA_15, bc, dagger, GRID_EXPERT];
        assert_eq!(controls[6..], expected, "{controls:?}");
        assert_eq!(names(SMOOTHED), names(UNSMOOTHED));
        assert_eq!(names(READINGS), names(READINGS_UNSEEN));
        for name in ["DAgger", "dwa", "dwa/fox", "cvm/simmons", "tentacle/short", "vff"] {
            assert!(names(READINGS).contains(&name.to_owned()), "{name} is missing");
        }
        assert!(names(SMOOTHED).contains(&"tentacle".to_owned()) && names(SMOOTHED).contains(&"DAgger".to_owned()));
    }

    #[test]
    fn smoothing_is_that_of_the_networks_or_that_of_the_default() {
        let smoothing = |preset: &str, folder: &str| {
            let stages = all(&Settings::preset(preset).unwrap(), &extent(), Path::new("R")).unwrap();
            stages.into_iter().find(|stage| stage.folder == folder).unwrap().settings.evaluation.smoothing
        };
        let own = Settings::preset("default").unwrap().dagger.inference.smoothing_ticks;
        assert_eq!(smoothing("default", SMOOTHED), Smoothing::Ticks(own));
        assert_eq!(smoothing("paper", SMOOTHED), Smoothing::Ticks(SMOOTHING_TICKS));
        assert_eq!(smoothing("paper", UNSMOOTHED), Smoothing::Ticks(0.0));
        assert_eq!(smoothing("default", UNSEEN), Smoothing::Own);
    }
}
