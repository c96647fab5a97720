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
    table: |_, _, stages, root| report::deviations::table(stages, root),
    unseen: |extent| &extent.unseen,
};

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
    let extent = if args.only.is_empty() {
        Extent::of_all(&settings, &args.unseen)?
    } else {
        for name in &args.only {
            let changed = deviations::called(name).map(|deviation| deviations::as_in_the_paper(&settings, deviation));
            let is_other = changed.transpose()?.is_some_and(|changed| changed != settings);
            ensure!(is_other, "--only {name}: these settings are as in the paper there");
        }
        let is_named = |name: &&str| args.only.iter().any(|only| only == name);
        let deviations = known.into_iter().filter(is_named).map(str::to_owned).collect();
        Extent { deviations, unseen: args.unseen.clone() }
    };
    ensure!(
        !extent.deviations.is_empty(),
        "these settings are as in the paper in all of that, so there is nothing to compare"
    );
    Ok(Begun { preset: layers.preset_name().to_owned(), settings, extent })
}
