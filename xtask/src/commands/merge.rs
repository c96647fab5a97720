//! `merge`: the shards of an evaluation, driven on several machines, as one evaluation.

use crate::args::{JsonArgs, OutArgs};
use crate::commands::evaluate::{self, Asked};
use crate::console::Console;
use crate::interrupt;
use crate::output::Output;
use clap::Args;
use evaluation::plan::Plan;
use evaluation::shards::Shards;
use experiment::drivers::NamedDriver;
use experiment::inputs;
use experiment::lots::Lot;
use experiment::run_dir::{Request, RunDir};
use std::path::PathBuf;

pub(crate) const EXAMPLES: &str = "\
Examples:
  for i in 1 2 3; do cargo xtask evaluate --driver expert --lots test:30 --shard $i/3 --out shards/$i; done
  cargo xtask merge shards/* --out runs/merged";

#[derive(Debug, Clone, Args)]
pub(crate) struct MergeArgs {
    /// Folders that `evaluate --shard` wrote: every shard once, in any order.
    #[arg(value_name = "DIR", required = true)]
    shards: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) json: JsonArgs,
    #[command(flatten)]
    out: OutArgs,
}

pub(crate) fn run(args: &MergeArgs, output: &Output) -> anyhow::Result<()> {
    let shards = Shards::read(&args.shards)?;
    let (settings, manifest) = (shards.settings(), shards.manifest());
    let asked: Asked = manifest.arguments.clone().try_into()?;
    let drivers = NamedDriver::load_all(&asked.drivers, settings)?;
    let lots = Lot::parse_all(&settings.evaluation.lots, &settings.episode.vehicle)?;
    manifest.check_inputs(&inputs::of(&lots, &drivers))?;
    let plan = Plan { settings, drivers: &drivers, lots: &lots, compare_with: asked.compare_with, shard: None };
    let rows = shards.rows(&plan)?;
    let request = Request { arguments: manifest.arguments.clone(), inputs: manifest.inputs.clone() };
    let seed = settings.evaluation.seed.0;
    // From here on it is an evaluation like any other, which `evaluate --resume` finishes if this is interrupted.
    let run = RunDir::create(&args.out.place(evaluate::COMMAND, &manifest.preset, seed), settings, &request)?;
    interrupt::can_resume(evaluate::COMMAND, run.path());
    rows.write(&run)?;
    evaluate::finish(&plan, &run, &Console::new(output), output)
}
