//! `deviations`: what the deviations of a preset from the paper do.

use super::trainings::{Begun, Trainings, TrainingsArgs, ensure_distinct};
use crate::args::lot_name;
use crate::output::Output;
use anyhow::ensure;
use clap::Args;
use evaluation::deviations::{self, DEVIATIONS, Extent};
use experiment::settings::Settings;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask deviations                              a training per thing that is not as in the paper: hours
  cargo xtask deviations --only smoothing,mirror --unseen sealed:my-phrase:90:all
  cargo xtask deviations --resume runs/deviations-default-s1";

#[derive(Debug, Clone, Args)]
pub(crate) struct DeviationsArgs {
    #[command(flatten)]
    common: TrainingsArgs,
    /// Things to do as in the paper, one at a time, by name [default: all but `steps`, which takes hours].
    #[arg(long, visible_alias = "of", value_name = "NAME", num_args = 1.., value_delimiter = ',', conflicts_with = "resume")]
    only: Vec<String>,
    /// Lots to drive all policies on, once each way.
    #[arg(
        long, value_name = "SPEC", num_args = 1.., value_delimiter = ',', value_parser = lot_name,
        default_value = "validation:180:all",
        conflicts_with = "resume"
    )]
    unseen: Vec<String>,
}

pub(crate) const COMMAND: &str = "deviations";

pub(crate) const RUN: Trainings<Extent> = Trainings {
    command: COMMAND,
    title: report::deviations::TITLE,
    stages: deviations::stages,
    write: report::deviations::write,
    unseen: |extent| &extent.unseen,
};

/// Not done unless it is asked for.
const TOO_LONG: &str = "steps";

pub(crate) fn run(args: &DeviationsArgs, output: &Output) -> anyhow::Result<()> {
    RUN.run(&args.common, || begin(args), output)
}

fn begin(args: &DeviationsArgs) -> anyhow::Result<Begun<Extent>> {
    let layers = args.common.layers();
    let settings = Settings::resolve(&layers, args.common.seed)?;
    let known = DEVIATIONS.map(|deviation| deviation.name);
    for name in &args.only {
        ensure!(
            known.contains(&name.as_str()),
            "--only {name}: no deviation has this name; there are {}",
            known.join(", ")
        );
    }
    ensure_distinct("--only", &args.only)?;
    let is_asked_for =
        |name: &str| if args.only.is_empty() { name != TOO_LONG } else { args.only.iter().any(|only| only == name) };
    let mut names = Vec::new();
    for deviation in DEVIATIONS.iter().filter(|deviation| is_asked_for(deviation.name)) {
        let is_other = deviations::as_in_the_paper(&settings, deviation)? != settings;
        ensure!(
            is_other || args.only.is_empty(),
            "--only {}: these settings are as in the paper there",
            deviation.name
        );
        if is_other {
            names.push(deviation.name.to_owned());
        }
    }
    ensure!(!names.is_empty(), "these settings are as in the paper in all of that, so there is nothing to compare");
    let extent = Extent { deviations: names, unseen: args.unseen.clone() };
    Ok(Begun { preset: layers.preset_name().to_owned(), settings, extent })
}
