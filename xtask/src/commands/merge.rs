//! `merge`: the shards of an evaluation, a reproduction or other trainings, made on several machines, as if one had done
//! all of it; or evaluations by different drivers, as if one had named all of them.

use crate::args::{JsonArgs, OutArgs};
use crate::build_info;
use crate::commands::evaluate::{self, Asked, MethodArgs};
use crate::commands::trainings::AskedFor;
use crate::commands::{deviations, perform, reproduce, rules, scaling};
use crate::console::Console;
use crate::interrupt;
use crate::output::Output;
use anyhow::{Context as _, bail, ensure};
use clap::Args;
use evaluation::drive_stage::DriveStage;
use evaluation::evaluations::Evaluations;
use evaluation::parts::Rows;
use evaluation::plan::Plan;
use evaluation::shards::{self, Shards, has_networks};
use evaluation::stage::Step;
use evaluation::stages;
use experiment::command_line::{quoted, quoted_path};
use experiment::drivers::{DriverSpec, NamedDriver};
use experiment::inputs;
use experiment::lots::Lot;
use experiment::manifest::{Build, Manifest, Request};
use experiment::run_dir::{Place, RunDir};
use std::path::{Path, PathBuf};
use storage::sums;

pub(crate) const EXAMPLES: &str = "\
Examples:
  for i in 1 2 3; do cargo xtask evaluate --driver expert --lots test:30 --shard $i/3 --out shards/$i; done
  cargo xtask merge shards/* --out runs/merged
  cargo xtask merge trained/* --out runs/full         the networks of a reproduction; then --networks runs/full
  cargo xtask merge driven/*                          what they drove, into runs/full, and its report
  cargo xtask merge shards/* --out runs/rules         the trainings of rules; then rules --resume runs/rules
  cargo xtask merge runs/mine runs/planners --out runs/all     other drivers of the same trials, in one table";

#[derive(Debug, Clone, Args)]
pub(crate) struct MergeArgs {
    /// Folders that a command with `--shard` wrote: every shard once, in any order. Or whole evaluations of the same trials
    /// by different drivers.
    #[arg(value_name = "RUN", required = true)]
    folders: Vec<PathBuf>,
    /// Driver to compare the others with, for whole evaluations [default: the last network, else the first driver].
    #[arg(long, value_name = "SPEC")]
    compare_with: Option<String>,
    #[command(flatten)]
    methods: MethodArgs,
    #[command(flatten)]
    pub(crate) json: JsonArgs,
    #[command(flatten)]
    out: OutArgs,
}

impl MergeArgs {
    /// Everything that is read: the folders that are merged, and these places.
    fn with_folders(&self, mut places: Vec<PathBuf>) -> Vec<PathBuf> {
        places.extend_from_slice(&self.folders);
        places
    }
}

pub(crate) fn run(args: &MergeArgs, output: &Output) -> anyhow::Result<()> {
    if !shards::is_shard(&args.folders[0])? {
        return evaluations(&Evaluations::read(&args.folders)?, args, output);
    }
    let shards = Shards::read(&args.folders)?;
    ensure!(args.compare_with.is_none(), "--compare-with: shards are compared as they were driven; leave it out");
    ensure!(args.methods.is_empty(), "--method: shards are judged as they were driven; leave it out");
    if shards.manifest().command == evaluate::COMMAND {
        return evaluation(&shards, args, output);
    }
    ensure!(
        !shards.manifest().arguments.is_empty(),
        "{}: this is a stage of a shard; name the folder of the shard",
        args.folders[0].display()
    );
    let Some(networks) = shards.networks() else { return trainings(&shards, args, output) };
    ensure!(
        args.out.out.is_none(),
        "--out: these shards drove networks of {0}, and go into {0}; leave it out",
        networks.display()
    );
    ensure!(
        networks.is_dir(),
        "{}: these shards drove the networks of {}, which is not here; run merge where that path leads to it",
        args.folders[0].display(),
        networks.display()
    );
    drives(&shards, networks, args, output)
}

fn evaluation(shards: &Shards, args: &MergeArgs, output: &Output) -> anyhow::Result<()> {
    let (settings, manifest) = (shards.settings(), shards.manifest());
    check_target(args, manifest)?;
    let asked: Asked = manifest.arguments.clone().try_into()?;
    let mut drivers = NamedDriver::load_all(&asked.drivers, settings)?;
    evaluation::trainings::assign(&asked.methods, &mut drivers)?;
    let lots = Lot::parse_all(&settings.evaluation.lots, &settings.episode.vehicle)?;
    manifest.check_inputs(&inputs::of(&lots, &drivers))?;
    let plan = Plan { settings, drivers: &drivers, lots: &lots, compare_with: asked.compare_with, shard: None };
    let rows = shards.rows(&plan)?;
    let request = Request {
        arguments: manifest.arguments.clone(),
        inputs: manifest.inputs.clone(),
        reads: args.with_folders(inputs::places(&lots, &drivers)),
    };
    let seed = settings.evaluation.seed.0;
    let (build, place) = (made_by(manifest), args.out.place(evaluate::COMMAND, &manifest.preset, seed));
    let run = RunDir::create(&Place { build: &build, ..place }, settings, &request)?;
    put_together(&plan, &rows, &run, args, output)
}

fn evaluations(evaluations: &Evaluations, args: &MergeArgs, output: &Output) -> anyhow::Result<()> {
    let (settings, specs) = (evaluations.settings(), evaluations.drivers());
    let named: Vec<String> = specs.iter().map(DriverSpec::to_string).collect();
    check_target(args, evaluations.made_by())?;
    let compare_with = evaluate::compare_with(args.compare_with.as_deref(), &specs)?;
    let mut drivers = NamedDriver::load_all(&named, settings)?;
    let methods = args.methods.or(evaluations.methods(), &mut drivers)?;
    let lots = Lot::parse_all(&settings.evaluation.lots, &settings.episode.vehicle)?;
    let inputs = inputs::of(&lots, &drivers);
    evaluations.check_inputs(&inputs)?;
    let plan = Plan { settings, drivers: &drivers, lots: &lots, compare_with, shard: None };
    evaluate::check(&plan)?;
    let rows = evaluations.rows(&plan)?;
    let asked = Asked { drivers: named, compare_with, methods, shard: None };
    let reads = args.with_folders(inputs::places(&lots, &drivers));
    let request = Request { arguments: toml::Table::try_from(&asked)?, inputs, reads };
    let build = made_by(evaluations.made_by());
    let place = args.out.place(evaluate::COMMAND, evaluations.preset(), settings.evaluation.seed.0);
    let run = RunDir::create(&Place { build: &build, ..place }, settings, &request)?;
    put_together(&plan, &rows, &run, args, output)
}

/// The program that drove, for the manifest of what is merged: it says who drove, not who merged, because what comes out is
/// merged with others in its turn.
fn made_by(manifest: &Manifest) -> Build {
    Build {
        program: manifest.program.clone(),
        git_revision: manifest.git_revision.clone(),
        git_dirty: manifest.git_dirty,
        git_changes: manifest.git_changes.clone(),
        rustc_version: manifest.rustc_version.clone(),
        processor: manifest.processor.clone(),
        processor_features: manifest.processor_features.clone(),
        libraries: manifest.libraries.clone(),
        ..build_info::get().clone()
    }
}

fn check_target(args: &MergeArgs, manifest: &Manifest) -> anyhow::Result<()> {
    let folder = args.folders[0].display();
    ensure!(manifest.is_of_this_target(), "{folder}: made on {}; merge on such a machine", manifest.target);
    // The report replays near-collisions of networks.
    ensure!(
        !has_networks(manifest) || manifest.rounds_like_here(build_info::get()),
        "{folder}: made on a machine that rounds otherwise (processor_features in its manifest.toml); merge on such a machine"
    );
    Ok(())
}

/// Finishes an evaluation whose rows are known. Once they are written it is one like any other, which `evaluate --resume`
/// finishes if this is interrupted; before, that would drive those that are missing.
fn put_together(plan: &Plan<'_>, rows: &Rows, run: &RunDir, args: &MergeArgs, output: &Output) -> anyhow::Result<()> {
    interrupt::goes_on_with(&format!("{} --overwrite", again(args, run)));
    rows.write(run)?;
    interrupt::can_resume(evaluate::COMMAND, run.path());
    evaluate::finish(plan, run, &Console::new(output), output)
}

/// What the shards are shares of, whole.
fn asked_for(shards: &Shards) -> anyhow::Result<AskedFor> {
    let (settings, manifest) = (shards.settings(), shards.manifest());
    match manifest.command.as_str() {
        reproduce::COMMAND => reproduce::asked_for(settings, manifest),
        rules::COMMAND => rules::RULES.asked_for(settings, manifest),
        deviations::COMMAND => deviations::RUN.asked_for(settings, manifest),
        scaling::COMMAND => scaling::SCALING.asked_for(settings, manifest),
        other => bail!("a shard of {other}: it is of another version of lotpilot"),
    }
}

/// Begins a run with the trainings that the shards did.
fn trainings(shards: &Shards, args: &MergeArgs, output: &Output) -> anyhow::Result<()> {
    let (settings, manifest) = (shards.settings(), shards.manifest());
    let command = manifest.command.as_str();
    let AskedFor { stages, inputs, reads } =
        asked_for(shards).with_context(|| args.folders[0].display().to_string())?;
    manifest.check_inputs(&inputs)?;
    let trained = shards.stages(&stages)?;
    let run = match &args.out.out {
        // An earlier merge of them was interrupted.
        Some(out) if !args.out.overwrite && sums::exists(out)? => {
            let (run, found, made) = RunDir::resume(out, command)?;
            shards.check_are_of(out, &found, &made, "choose another --out, or delete it with --overwrite")?;
            run
        }
        _ => {
            let request = Request {
                arguments: manifest.arguments.clone(),
                inputs: manifest.inputs.clone(),
                reads: args.with_folders(reads),
            };
            // It is made as its shards are, except for the share: so a report says what was asked for.
            let build = Build { command_line: whole_command(&manifest.command_line), ..made_by(manifest) };
            let place = args.out.place(command, &manifest.preset, settings.seed.0);
            RunDir::create(&Place { build: &build, ..place }, settings, &request)?
        }
    };
    interrupt::goes_on_with(&again(args, &run));
    for (folder, path) in &trained {
        run.ensure_held()?;
        if !sums::is_listed(run.path(), &format!("{folder}/{}", sums::FILE))? {
            sums::copy_folder(path, run.path(), folder)?;
        }
    }
    let name = quoted_path(run.path());
    let elsewhere = match command {
        reproduce::COMMAND => {
            format!(", or on several machines with cargo xtask {command} --networks {name} --shard NUMBER/OF")
        }
        _ => String::new(),
    };
    output.note(format_args!(
        "written: {}: {} trainings; continue with cargo xtask {command} --resume {name}{elsewhere}",
        run.path().display(),
        trained.len()
    ));
    Ok(())
}

/// Adds what the shards drove to the run whose networks drove, and finishes it.
fn drives(shards: &Shards, networks: &Path, args: &MergeArgs, output: &Output) -> anyhow::Result<()> {
    let (run, settings, manifest) = build_info::resume(networks, reproduce::COMMAND, output)?;
    let remedy = format!("make them again with --networks {}", networks.display());
    shards.check_are_of(networks, &settings, &manifest, &remedy)?;
    let extent = reproduce::extent_of(&manifest).with_context(|| networks.display().to_string())?;
    let all = stages::all(&settings, &extent, networks)?;
    shards.manifest().check_inputs(&reproduce::inputs_of_drives(&settings, &extent, &all)?)?;
    // Nothing is written before all of it is known to be whole.
    shards.stages(&all)?;
    let mut merged = Vec::new();
    for stage in &all {
        if matches!(stage.step, Step::Drive { .. }) {
            let parts = Shards::read(&shards.folders_of(&stage.folder))?;
            merged.push((stage, parts.rows(&DriveStage::load(stage)?.plan())?));
        }
    }
    // Resumed before all of it is written, the run would drive the rest itself.
    interrupt::goes_on_with(&format!("merge {}", named(args)));
    for (stage, rows) in merged {
        let place = perform::place_of(reproduce::COMMAND, &stage.settings);
        if let Some(driven) = run.stage(&stage.folder, &place, &stage.settings)? {
            rows.write(&driven)?;
        }
    }
    interrupt::can_resume(reproduce::COMMAND, run.path());
    // They count as driven now; tables and the rest of the run are made as on one machine.
    reproduce::finish(&run, settings, extent, output)
}

/// The shards as they were named.
fn named(args: &MergeArgs) -> String {
    args.folders.iter().map(|shard| quoted_path(shard)).collect::<Vec<_>>().join(" ")
}

/// The command that puts them together again.
fn again(args: &MergeArgs, run: &RunDir) -> String {
    let compared = args.compare_with.iter().map(|spec| format!(" --compare-with {}", quoted(spec)));
    let methods = args.methods.methods.iter().map(|method| format!(" --method {}", quoted(method)));
    let asked: String = compared.chain(methods).collect();
    format!("merge {}{asked} --out {}", named(args), quoted_path(run.path()))
}

/// The command line of a shard without what concerns the shard alone.
fn whole_command(words: &[String]) -> Vec<String> {
    const OF_SHARD: [&str; 2] = ["--shard", "--out"];
    let mut kept = Vec::new();
    let mut words = words.iter();
    while let Some(word) = words.next() {
        if OF_SHARD.contains(&word.as_str()) {
            words.next();
        } else if word != "--overwrite" && !OF_SHARD.iter().any(|option| word.starts_with(&format!("{option}="))) {
            kept.push(word.clone());
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::whole_command;

    #[test]
    fn the_command_of_a_whole_is_that_of_a_shard_without_its_share() {
        let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
        let shard = words("reproduce --full --shard 1/2 --seed 3 --out=trained/1 --overwrite");
        assert_eq!(whole_command(&shard), words("reproduce --full --seed 3"));
    }
}
