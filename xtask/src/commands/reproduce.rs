//! `reproduce`: the paper in a box. Trains, drives and writes one report; every stage has a folder of its own and is
//! skipped where it is finished already.

use super::trainings::AskedFor;
use super::{perform, train};
use crate::args::{LayerArgs, OutArgs, lot_name, run_folder};
use crate::build_info;
use crate::console::Console;
use crate::output::Output;
use anyhow::{Context as _, ensure};
use clap::{Args, ValueEnum};
use evaluation::shards::ShardRecord;
use evaluation::stage::{self, Stage, Step};
use evaluation::stages::{self, Extent};
use evaluation::{deviations, rules, tune};
use experiment::command_line::quoted_path;
use experiment::drivers::{self, DriverSpec, NamedDriver};
use experiment::inputs::{self, Inputs};
use experiment::lots::Lot;
use experiment::manifest::{self, Manifest, Outcome, Request};
use experiment::run_dir::RunDir;
use experiment::settings::{Layers, Settings};
use experiment::shard::Shard;
use experiment::trained;
use planners::PlannerSpec;
use report::reproduction::{self, Recipe};
use std::path::{Path, PathBuf};
use storage::sums;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask reproduce                               more than 70 minutes on two cores
  cargo xtask reproduce --preset smoke --out runs/try   every stage within a minute
  cargo xtask reproduce --full --unseen sealed:my-phrase:120:all
  cargo xtask reproduce --full --tables rules,deviations      every table in one run: a night
  cargo xtask reproduce --preset paper --seeds 3        the paper's own regime: days
  cargo xtask reproduce --resume runs/reproduce-default-s1
  cargo xtask reproduce --full --shard 3/16 --out trained/3
  cargo xtask merge trained/* --out runs/full
  cargo xtask reproduce --networks runs/full --shard 3/16 --out driven/3
  cargo xtask merge driven/*";

#[derive(Debug, Clone, Args)]
pub(crate) struct ReproduceArgs {
    #[command(flatten)]
    layers: LayerArgs,
    /// Root seed of the first training.
    #[arg(long)]
    seed: Option<u64>,
    /// Five training seeds, twice the trials, more unseen lots, longer ablations.
    #[arg(long)]
    full: bool,
    /// Trainings of DAgger with its weight on τ̂, and as many without: with the root seed, and with those that follow it
    /// [default: 1; 5 with --full].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100))]
    seeds: Option<u64>,
    /// Lots that no driver was trained or tuned on; see `cargo xtask lots`. Those of the default are for development, as all
    /// runs share their phrase; final figures take a phrase of your own, whose lots nobody has seen [default:
    /// sealed:reproduce:24:all; sealed:reproduce:120:all with --full].
    #[arg(long, value_name = "SPEC", num_args = 1.., value_delimiter = ',', value_parser = lot_name)]
    unseen: Vec<String>,
    /// Further tables, as the commands of these names make them, with trainings of their own: hours each.
    #[arg(long, value_name = "TABLE", num_args = 1.., value_delimiter = ',')]
    tables: Vec<FurtherTable>,
    /// Folder of `cargo xtask tune`: planners also drive with the parameters found there [default: those in planners/tuned].
    #[arg(long, value_name = "DIR")]
    tuned: Option<PathBuf>,
    /// Does only a share of the trainings, for one of several machines (docs/cluster.md); `merge` puts the shares
    /// together.
    #[arg(long, value_name = "NUMBER/OF")]
    shard: Option<Shard>,
    /// Folder of a run whose networks are all trained: the shard is a share of what they drive, with the settings of
    /// that run.
    #[arg(
        long,
        value_name = "RUN", value_parser = run_folder(),
        requires = "shard",
        conflicts_with_all = ["preset", "config", "overrides", "seed", "full", "seeds", "unseen", "tables", "tuned"]
    )]
    networks: Option<PathBuf>,
    #[command(flatten)]
    out: OutArgs,
    /// Continues an interrupted run with its own settings, to the same result; finished stages are skipped.
    #[arg(
        long,
        value_name = "RUN", value_parser = run_folder(),
        conflicts_with_all = [
            "preset", "config", "overrides", "seed", "out", "overwrite", "full", "seeds", "unseen", "tables", "tuned", "shard",
            "networks"
        ]
    )]
    resume: Option<PathBuf>,
}

/// A table with trainings of its own, as a command of the same name makes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FurtherTable {
    Rules,
    Deviations,
}

pub(crate) const COMMAND: &str = "reproduce";
/// Trainings of `--full`.
const SEEDS_FULL: u64 = 5;

pub(crate) fn run(args: &ReproduceArgs, output: &Output) -> anyhow::Result<()> {
    let (run, settings, Arguments { extent, shard }) = match args {
        ReproduceArgs { resume: Some(path), .. } => resume(path, output)?,
        ReproduceArgs { networks: Some(networks), .. } => begin_drives(args, networks)?,
        _ => begin(args, output)?,
    };
    let Some(record) = shard else { return finish(&run, settings, extent, output) };
    let root = record.networks.as_deref().unwrap_or(run.path());
    let stages = record.share_of(stages::all(&settings, &extent, root)?);
    let console = Console::new(output);
    perform::all(COMMAND, &stages, &run, &console, output)?;
    run.finish(Outcome::Reproduction { stages: stages.len() })?;
    let (folder, number) = (run.path().display(), record.number);
    output.note(format_args!("written: {folder}: shard {number}; put all together with cargo xtask merge RUN..."));
    console.report_time();
    Ok(())
}

/// Does what is left of a run, and writes its report.
pub(crate) fn finish(run: &RunDir, settings: Settings, extent: Extent, output: &Output) -> anyhow::Result<()> {
    let stages = stages::all(&settings, &extent, run.path())?;
    let recipe = Recipe { settings, extent, stages };
    let console = Console::new(output);
    perform::all(COMMAND, &recipe.stages, run, &console, output)?;
    let conclusions = reproduction::write(&recipe, run)?;
    output.table(|| format!("\nWhat holds here\n\n{conclusions}"), &conclusions)?;
    run.finish(Outcome::Reproduction { stages: recipe.stages.len() })?;
    output.note(format_args!("written: {}/report.html, report.md, conclusions.csv and figures/", run.path().display()));
    console.report_time();
    Ok(())
}

/// What a run was asked for, besides what its settings say.
struct Arguments {
    extent: Extent,
    /// Which share of it is done.
    shard: Option<ShardRecord>,
}

impl Arguments {
    fn read(path: &Path, mut manifest: Manifest) -> anyhow::Result<Self> {
        let shard = ShardRecord::take_from(&mut manifest).with_context(|| path.display().to_string())?;
        Ok(Self { extent: extent_of(&manifest).with_context(|| path.display().to_string())?, shard })
    }

    fn to_table(&self) -> anyhow::Result<toml::Table> {
        let mut table = toml::Table::try_from(&self.extent)?;
        if let Some(shard) = &self.shard {
            shard.add_to(&mut table);
        }
        Ok(table)
    }
}

fn begin(args: &ReproduceArgs, output: &Output) -> anyhow::Result<(RunDir, Settings, Arguments)> {
    let layers = Layers::from(&args.layers);
    let mut settings = Settings::resolve(&layers, args.seed)?;
    stages::check(&settings)?;
    settings.check_rollouts()?;
    let is_smoke = layers.preset_name() == "smoke";
    if args.full {
        settings.evaluation.trials *= 2;
        settings.check().context("twice evaluation.trials")?;
    }
    let unseen = match &args.unseen[..] {
        [] if args.full => vec!["sealed:reproduce:120:all".to_owned()],
        [] if is_smoke => vec!["test:1:easy".to_owned()],
        [] => vec!["sealed:reproduce:24:all".to_owned()],
        named => named.to_vec(),
    };
    let seeds = args.seeds.unwrap_or(if args.full { SEEDS_FULL } else { 1 });
    let is_asked_for = |table| args.tables.contains(&table);
    let rules = is_asked_for(FurtherTable::Rules).then(|| rules::Extent::of_all(seeds, &unseen));
    let deviations = is_asked_for(FurtherTable::Deviations).then(|| deviations::Extent::of_all(&settings, &unseen));
    let deviations = deviations.transpose()?;
    ensure!(
        deviations.as_ref().is_none_or(|extent| !extent.deviations.is_empty()),
        "--tables deviations: these settings are as in the paper in all of that, so there is nothing to compare"
    );
    let extent = Extent {
        seeds,
        unseen,
        rule_iterations: if args.full { settings.dagger.iterations_max } else { 1 },
        tuned: tuned(args.tuned.as_deref())?,
        rules,
        deviations,
    };
    // Before the folder is claimed: a misspelt lot should not leave one behind.
    train::check_lots(&settings, output)?;
    train::check_unseen(&settings, &extent.unseen, output)?;
    let mut reads = places(&settings, &extent)?;
    reads.extend(args.layers.file().map(Path::to_owned));
    settings.check_training_seeds(extent.seeds)?;
    // Only the names of the folders are asked for: the run has no place yet.
    let stages = stages::all(&settings, &extent, Path::new(""))?;
    for stage in &stages {
        stage.settings.check().with_context(|| stage.folder.clone())?;
    }
    let preset = format!("{}{}", if args.full { "full-" } else { "" }, layers.preset_name());
    let shard = args.shard.map(|number| ShardRecord::of_stages(number, None, &settings, stages));
    let inputs = inputs(&settings, &extent)?;
    create(args, &preset, settings, Arguments { extent, shard }, (inputs, reads))
}

/// Begins a share of what the networks of a run drive.
fn begin_drives(args: &ReproduceArgs, networks: &Path) -> anyhow::Result<(RunDir, Settings, Arguments)> {
    let name = networks.display();
    ensure!(sums::exists(networks)?, "--networks {name}: this is not a run; cargo xtask reproduce makes one");
    let manifest = Manifest::read(networks)?;
    let (settings, preset) = (trained::settings_of(networks)?, manifest.preset.clone());
    ensure!(manifest.command == COMMAND, "--networks {name}: this is a run of {}", manifest.command);
    let Arguments { extent, shard } = Arguments::read(networks, manifest.clone())?;
    ensure!(
        shard.is_none(),
        "--networks {name}: this is a shard; put all of them together first with cargo xtask merge RUN..."
    );
    ensure!(!manifest::is_finished(networks)?, "--networks {name}: this run is finished; nothing is left to drive");
    let stages = stages::all(&settings, &extent, networks)?;
    for stage in stages.iter().filter(|stage| matches!(stage.step, Step::Train { .. })) {
        ensure!(
            manifest::is_finished(&networks.join(&stage.folder))?,
            "--networks {name}: {} is not trained yet; train it with --shard and merge, or with --resume {}",
            stage.folder,
            quoted_path(networks)
        );
    }
    ensure!(
        manifest.is_of_this_target() && manifest.rounds_like_here(build_info::get()),
        "--networks {name}: trained on a machine that rounds otherwise; drive on one of that kind"
    );
    // What its networks were trained with.
    manifest.check_inputs(&inputs(&settings, &extent)?)?;
    let inputs = inputs_of_drives(&settings, &extent, &stages)?;
    let mut reads = places(&settings, &extent)?;
    reads.push(networks.to_owned());
    let shard = args.shard.map(|number| ShardRecord::of_stages(number, Some(networks.to_owned()), &settings, stages));
    create(args, &preset, settings, Arguments { extent, shard }, (inputs, reads))
}

fn create(
    args: &ReproduceArgs,
    preset: &str,
    settings: Settings,
    arguments: Arguments,
    (inputs, reads): (Inputs, Vec<PathBuf>),
) -> anyhow::Result<(RunDir, Settings, Arguments)> {
    let place = args.out.place(COMMAND, preset, settings.seed.0);
    let run = RunDir::create(&place, &settings, &Request { arguments: arguments.to_table()?, inputs, reads })?;
    Ok((run, settings, arguments))
}

/// What a run did, by the files that it left.
pub(crate) fn recipe_of(path: &Path) -> anyhow::Result<Recipe> {
    let settings = trained::settings_of(path)?;
    let Arguments { extent, shard } = Arguments::read(path, Manifest::read(path)?)?;
    ensure!(shard.is_none(), "{}: this is a shard, which has no report; put all together with merge", path.display());
    // By either: of a line that the list lost, or a folder that is gone, rows of tables would vanish without a word.
    let listed = sums::names(path)?;
    let is_there = |folder: &str| path.join(folder).exists() || listed.contains(&format!("{folder}/{}", sums::FILE));
    let stages = stages::without_trainings(stages::all(&settings, &extent, path)?, is_there);
    stage::ensure_of_run(&stages, path)?;
    let stages = perform::with_those_who_drove(stages, path)?;
    Ok(Recipe { settings, extent, stages })
}

/// How much a run does, by a manifest without the record of a shard.
pub(crate) fn extent_of(manifest: &Manifest) -> anyhow::Result<Extent> {
    manifest.arguments.clone().try_into().context("this is not a folder of cargo xtask reproduce")
}

fn resume(path: &Path, output: &Output) -> anyhow::Result<(RunDir, Settings, Arguments)> {
    let (run, settings, manifest) = build_info::resume(path, COMMAND, output)?;
    let arguments = Arguments::read(path, manifest.clone())?;
    let Arguments { extent, shard } = &arguments;
    if shard.is_some() {
        build_info::check_began_shard(path, &manifest)?;
    }
    let found = match shard.as_ref().and_then(|shard| shard.networks.as_deref()) {
        Some(networks) => inputs_of_drives(&settings, extent, &stages::all(&settings, extent, networks)?)?,
        None => inputs(&settings, extent)?,
    };
    manifest.check_inputs(&found)?;
    Ok((run, settings, arguments))
}

/// What a manifest, without the record of a shard, asks for: of the files, those that its trainings read.
pub(crate) fn asked_for(settings: &Settings, manifest: &Manifest) -> anyhow::Result<AskedFor> {
    let extent = extent_of(manifest)?;
    Ok(AskedFor {
        stages: stages::all(settings, &extent, Path::new(""))?,
        inputs: inputs(settings, &extent)?,
        reads: places(settings, &extent)?,
    })
}

/// The lots, parameters and networks from files that a share of the drives reads.
pub(crate) fn inputs_of_drives(settings: &Settings, extent: &Extent, stages: &[Stage]) -> anyhow::Result<Inputs> {
    let mut found = inputs(settings, extent)?;
    for stage in stages {
        if let Step::Drive { drivers } = &stage.step {
            found.extend(inputs::of(&[], &stage::load(drivers, settings)?));
        }
    }
    Ok(found)
}

/// The lots and parameters from files that are read.
fn inputs(settings: &Settings, extent: &Extent) -> anyhow::Result<Inputs> {
    let mut found = train::inputs(settings)?;
    let unseen = Lot::parse_all(&extent.unseen, &settings.episode.vehicle)?;
    let tuned = NamedDriver::load_all(&extent.tuned, settings)?;
    found.extend(inputs::of(&unseen, &tuned));
    Ok(found)
}

/// The files that [`inputs`] are of.
fn places(settings: &Settings, extent: &Extent) -> anyhow::Result<Vec<PathBuf>> {
    let mut found = train::places(settings, &extent.unseen)?;
    found.extend(DriverSpec::parse_all(&extent.tuned)?.iter().flat_map(DriverSpec::places).map(PathBuf::from));
    Ok(found)
}

/// Planners with tuned parameters: those of a folder that `tune` wrote, else those that ship with the program.
fn tuned(folder: Option<&Path>) -> anyhow::Result<Vec<String>> {
    let Some(folder) = folder else {
        return Ok(drivers::tuned_specs());
    };
    let specs: Vec<String> = PlannerSpec::in_every_reading()
        .iter()
        .map(|(name, planner)| (planner.name(), folder.join(format!("{}.toml", tune::file_stem(name)))))
        .filter(|(_, file)| file.is_file())
        .map(|(method, file)| format!("{method}:{}", file.display()))
        .collect();
    ensure!(!specs.is_empty(), "--tuned {}: holds no parameters; cargo xtask tune writes them", folder.display());
    DriverSpec::parse_all(&specs)?;
    Ok(specs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Alone {
        #[command(flatten)]
        args: ReproduceArgs,
    }

    /// Readings were left out, or "no parameters" where there was nothing else.
    #[test]
    fn whatever_was_tuned_drives_readings_too() {
        let folder = std::env::temp_dir().join(format!("xtask-test-{}-tuned", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for name in ["cvm.toml", "dwa-fox.toml", "dwa-fox.candidates.toml", "tuning.md"] {
            std::fs::write(folder.join(name), "").unwrap();
        }
        let of = |name: &str| format!("{}:{}", &name[..3], folder.join(name).display());
        assert_eq!(tuned(Some(&folder)).unwrap(), [of("dwa-fox.toml"), of("cvm.toml")]);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    /// Shards of `--networks full` and of `--networks ./full` were not of one whole.
    #[test]
    fn a_run_whose_networks_drive_has_one_name() {
        let networks = |name: &str| {
            let words = ["reproduce", "--shard", "1/2", "--networks", name];
            Alone::try_parse_from(words).unwrap().args.networks.unwrap()
        };
        let whole = std::env::current_dir().unwrap().join("full");
        for name in ["full", "./full", "full/", &whole.display().to_string()] {
            assert_eq!(networks(name).to_str(), Some("full"), "{name}");
        }
    }
}
