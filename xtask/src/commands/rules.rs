//! `rules`: the `DAgger` family at equal samples.

use super::trainings::{Begun, Trainings, TrainingsArgs, ensure_distinct};
use crate::args::lot_name;
use crate::output::Output;
use anyhow::ensure;
use clap::Args;
use evaluation::rules::{self, Extent};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask rules                                   every rule, one seed, few lots: hours
  cargo xtask rules --rule expert_only,all_below,hg_dagger --seeds 5 --unseen sealed:my-phrase:90:all
  cargo xtask rules --resume runs/rules-default-s1
  cargo xtask rules --seeds 5 --shard 2/50 --out shards/2
  cargo xtask merge shards/* --out runs/rules         then --resume runs/rules, which drives";

#[derive(Debug, Clone, Args)]
pub(crate) struct RulesArgs {
    #[command(flatten)]
    common: TrainingsArgs,
    /// Trainings of each rule: with the root seed, and with those that follow it.
    #[arg(
        long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=100),
        conflicts_with = "resume"
    )]
    seeds: u64,
    /// Rules by the name of their setting (dagger.rule); all of them if none is named. The rule that the settings name has
    /// their thresholds, every other its own.
    #[arg(long, value_name = "NAME", num_args = 1.., value_delimiter = ',', conflicts_with = "resume")]
    rule: Vec<String>,
    /// Iterations of every training, after behaviour cloning.
    #[arg(
        long, value_name = "N", default_value_t = rules::ITERATIONS, value_parser = clap::value_parser!(u32).range(1..=50),
        conflicts_with = "resume"
    )]
    iterations: u32,
    /// Samples that a round adds to the data set, for every rule.
    #[arg(
        long, value_name = "N", default_value_t = rules::SAMPLES, value_parser = clap::value_parser!(u32).range(1..),
        conflicts_with = "resume"
    )]
    samples: u32,
    /// Lots to drive all policies on, once each way.
    #[arg(
        long, value_name = "SPEC", num_args = 1.., value_delimiter = ',', value_parser = lot_name, default_value = "validation:90:all",
        conflicts_with = "resume"
    )]
    unseen: Vec<String>,
}

pub(crate) const COMMAND: &str = "rules";

pub(crate) const RULES: Trainings<Extent> = Trainings {
    command: COMMAND,
    title: report::rules::TITLE,
    stages: |settings, extent, root| Ok(rules::stages(settings, extent, root)),
    table: report::rules::table,
    unseen: |extent| &extent.unseen,
};

pub(crate) fn run(args: &RulesArgs, output: &Output) -> anyhow::Result<()> {
    RULES.run(&args.common, || begin(args), output)
}

fn begin(args: &RulesArgs) -> anyhow::Result<Begun<Extent>> {
    let layers = args.common.layers();
    let changes: &[&str] = match layers.preset_name() {
        "default" => &rules::FEW_LOTS,
        "strong" => &[rules::EVERY_TICK],
        _ => &[],
    };
    let settings = args.common.settings(changes.iter().map(|&text| text.to_owned()))?;
    let known = rules::all().map(|(name, _)| name.to_owned());
    let named = if args.rule.is_empty() { known.to_vec() } else { args.rule.clone() };
    for rule in &named {
        ensure!(known.contains(rule), "--rule {rule}: no rule has this name; there are {}", known.join(", "));
    }
    ensure_distinct("--rule", &named)?;
    if let Some(rule) = rules::with_other_thresholds(&settings) {
        ensure!(
            named.iter().any(|name| name == rule),
            "dagger.rule: has thresholds of {rule}, which is not among the rules that are compared; name it with --rule, or leave \
             the thresholds out"
        );
    }
    let RulesArgs { seeds, iterations, samples, .. } = *args;
    settings.check_training_seeds(seeds)?;
    let extent = Extent { rules: named, seeds, iterations, samples, unseen: args.unseen.clone() };
    Ok(Begun { preset: layers.preset_name().to_owned(), settings, extent })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use policy::dagger::Keep;
    use policy::fit::Budget;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        args: RulesArgs,
    }

    /// Lots, trials and steps of the command took the place of those in a file, without a word.
    #[test]
    fn what_a_file_sets_counts_and_the_rest_is_in_short() {
        let file = std::env::temp_dir().join(format!("xtask-test-{}-rules.toml", std::process::id()));
        let text =
            "training.lots = [\"train:2:rooms\"]\ndagger.keep = \"expert_ticks\"\ndagger.fit.budget.steps = 300\n";
        std::fs::write(&file, text).unwrap();
        let line = ["rules", "--config", file.to_str().unwrap(), "--set", "training.trials=3"];
        let settings = begin(&Line::try_parse_from(line).unwrap().args).unwrap().settings;
        assert_eq!(settings.training.lots, ["train:2:rooms"]);
        assert_eq!((settings.training.trials, settings.dagger.keep), (3, Keep::ExpertTicks));
        assert_eq!(settings.dagger.fit.budget, Budget::Steps(300));
        assert_eq!(settings.dagger.cloning_budget, Budget::Steps(2000), "that of the command");
        std::fs::remove_file(file).unwrap();
    }
}
