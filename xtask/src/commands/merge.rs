//! `merge`: the shards of an evaluation or a reproduction, made on several machines, as if one had done all of it.

use crate::args::{JsonArgs, OutArgs};
use crate::commands::evaluate::{self, Asked};
use crate::commands::{perform, reproduce};
use crate::console::Console;
use crate::interrupt;
use crate::output::Output;
use anyhow::ensure;
use clap::Args;
use evaluation::drive_stage::DriveStage;
use evaluation::plan::Plan;
use evaluation::shards::Shards;
use evaluation::stages::{self, Step};
use experiment::drivers::NamedDriver;
use experiment::inputs;
use experiment::lots::Lot;
use experiment::run_dir::{Request, RunDir};
use std::path::{Path, PathBuf};
use storage::sums;

pub(crate) const EXAMPLES: &str = "\
Examples:
  for i in 1 2 3; do cargo xtask evaluate --driver expert --lots test:30 --shard $i/3 --out shards/$i; done
  cargo xtask merge shards/* --out runs/merged
  cargo xtask merge trained/* --out runs/full         the networks of a reproduction; then --networks runs/full
  cargo xtask merge driven/*                          what they drove, into runs/full, and its report";

#[derive(Debug, Clone, Args)]
pub(crate) struct MergeArgs {
    /// Folders that `evaluate --shard` or `reproduce --shard` wrote: every shard once, in any order.
    #[arg(value_name = "DIR", required = true)]
    shards: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) json: JsonArgs,
    #[command(flatten)]
    out: OutArgs,
}

pub(crate) fn run(args: &MergeArgs, output: &Output) -> anyhow::Result<()> {
    let shards = Shards::read(&args.shards)?;
    match (shards.manifest().command.as_str(), shards.networks()) {
        (reproduce::COMMAND, Some(networks)) => {
            ensure!(
                args.out.out.is_none(),
                "--out: these shards drove networks of {0}, and go into {0}; leave it out",
                networks.display()
            );
            drives(&shards, networks, output)
        }
        (reproduce::COMMAND, None) => trainings(&shards, args, output),
        _ => evaluation(&shards, args, output),
    }
}

fn evaluation(shards: &Shards, args: &MergeArgs, output: &Output) -> anyhow::Result<()> {
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

/// Begins a reproduction with the trainings that the shards did.
fn trainings(shards: &Shards, args: &MergeArgs, output: &Output) -> anyhow::Result<()> {
    let (settings, manifest) = (shards.settings(), shards.manifest());
    let extent = reproduce::extent_of(&args.shards[0], manifest)?;
    manifest.check_inputs(&reproduce::inputs(settings, &extent)?)?;
    let trained = shards.stages(&stages::all(settings, &extent, Path::new("")))?;
    let request = Request { arguments: manifest.arguments.clone(), inputs: manifest.inputs.clone() };
    // Trainings that are not there yet if this is interrupted are done by `reproduce --resume`, to the same bytes.
    let run =
        RunDir::create(&args.out.place(reproduce::COMMAND, &manifest.preset, settings.seed.0), settings, &request)?;
    interrupt::can_resume(reproduce::COMMAND, run.path());
    for (folder, path) in &trained {
        sums::copy(path, &run.path().join(folder))?;
        sums::list(run.path(), &[&format!("{folder}/{}", sums::FILE)])?;
    }
    let name = run.path().display();
    output.note(format_args!(
        "written: {name}: {} trainings; go on with cargo xtask reproduce --resume {name}, or on several machines with \
         cargo xtask reproduce --networks {name} --shard NUMBER/OF",
        trained.len()
    ));
    Ok(())
}

/// Adds what the shards drove to the run whose networks drove, and finishes it.
fn drives(shards: &Shards, networks: &Path, output: &Output) -> anyhow::Result<()> {
    let (run, settings, manifest) = RunDir::resume(networks, reproduce::COMMAND)?;
    shards.check_are_of(networks, &settings, &manifest)?;
    let extent = reproduce::extent_of(networks, &manifest)?;
    let all = stages::all(&settings, &extent, networks);
    shards.manifest().check_inputs(&reproduce::inputs_of_drives(&settings, &extent, &all)?)?;
    shards.stages(&all)?;
    let mut merged = Vec::new();
    for stage in &all {
        if matches!(stage.step, Step::Drive { .. }) {
            let parts = Shards::read(&shards.folders_of(&stage.folder))?;
            merged.push((stage, parts.rows(&DriveStage::load(stage)?.plan())?));
        }
    }
    interrupt::can_resume(reproduce::COMMAND, run.path());
    for (stage, rows) in merged {
        let place = perform::place_of(reproduce::COMMAND, &stage.settings);
        if let Some(driven) = run.stage(&stage.folder, &place, &stage.settings)? {
            rows.write(&driven)?;
        }
    }
    // They count as driven now; tables and the rest of the run are made as on one machine.
    reproduce::finish(&run, settings, extent, output)
}
