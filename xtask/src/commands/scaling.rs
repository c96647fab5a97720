//! `scaling`: how much more different lots buy.

use super::trainings::{Begun, Trainings, TrainingsArgs, ensure_distinct};
use crate::args::lot_name;
use crate::output::Output;
use anyhow::ensure;
use clap::Args;
use evaluation::scaling::{self, Extent};
use experiment::lots::Lot;
use scenarios::split::Family;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask scaling                                 1, 4, 16 and 64 lots of each family of `all`, the first twelve of fifteen: hours
  cargo xtask scaling --different 2,8 --unseen sealed:my-phrase:90:all
  cargo xtask scaling --resume runs/scaling-default-s1";

#[derive(Debug, Clone, Args)]
pub(crate) struct ScalingArgs {
    #[command(flatten)]
    common: TrainingsArgs,
    /// Different lots of each kind that is trained on; one training each.
    #[arg(
        long, value_name = "N", num_args = 1.., value_delimiter = ',', default_values_t = [1, 4, 16, 64],
        conflicts_with = "resume"
    )]
    different: Vec<u32>,
    /// Lots to drive all policies on, once each way.
    #[arg(
        long, value_name = "SPEC", num_args = 1.., value_delimiter = ',', value_parser = lot_name,
        default_value = "validation:180:all",
        conflicts_with = "resume"
    )]
    unseen: Vec<String>,
}

/// Lots of each of the first twelve families in every round: about as much as the default trains on; no lot that is there in every training.
const LOTS_OF_A_FAMILY: usize = 16;

pub(crate) const COMMAND: &str = "scaling";

pub(crate) const SCALING: Trainings<Extent> = Trainings {
    command: COMMAND,
    title: report::scaling::TITLE,
    stages: |settings, extent, root| Ok(scaling::stages(settings, extent, root)),
    table: report::scaling::table,
    unseen: |extent| &extent.unseen,
};

pub(crate) fn run(args: &ScalingArgs, output: &Output) -> anyhow::Result<()> {
    SCALING.run(&args.common, || begin(args), output)
}

fn begin(args: &ScalingArgs) -> anyhow::Result<Begun<Extent>> {
    let layers = args.common.layers();
    let lots = LOTS_OF_A_FAMILY * Family::ALL.len();
    let is_default = layers.preset_name() == "default";
    let settings = args.common.settings(is_default.then(|| format!("training.lots=[\"train:{lots}:all\"]")))?;
    let extent = Extent { different_lots: args.different.clone(), unseen: args.unseen.clone() };
    ensure!(!extent.different_lots.contains(&0), "--different 0: name at least one lot");
    ensure_distinct("--different", &extent.different_lots)?;
    let lots = Lot::parse_all(&settings.training.lots, &settings.episode.vehicle)?;
    ensure!(lots.iter().any(Lot::is_generated), "training.lots names no generated lots, of which there could be more");
    Ok(Begun { preset: layers.preset_name().to_owned(), settings, extent })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        args: ScalingArgs,
    }

    /// The lots of the command took the place of those in a file, without a word.
    #[test]
    fn lots_that_a_file_names_are_trained_on() {
        let file = std::env::temp_dir().join(format!("xtask-test-{}-scaling.toml", std::process::id()));
        std::fs::write(&file, "training.lots = [\"train:2:rooms\"]\n").unwrap();
        let file = file.to_str().unwrap();
        let lots = |arguments: &[&str]| {
            let line = Line::try_parse_from([&["scaling"][..], arguments].concat()).unwrap();
            begin(&line.args).unwrap().settings.training.lots
        };
        assert_eq!(lots(&[]), ["train:192:all"]);
        assert_eq!(lots(&["--config", file]), ["train:2:rooms"]);
        let named = ["--config", file, "--set", "training.lots=[\"train:3:lane\"]"];
        assert_eq!(lots(&named), ["train:3:lane"]);
        std::fs::remove_file(file).unwrap();
    }
}
