//! What commands of several trainings and one drive of all their policies have in common: they are begun, resumed, shared
//! out, done and reported in the same way.

use super::{perform, train};
use crate::args::{LayerArgs, OutArgs, run_folder};
use crate::build_info;
use crate::console::Console;
use crate::output::Output;
use anyhow::{Context as _, ensure};
use clap::Args;
use evaluation::shards::ShardRecord;
use evaluation::stage::Stage;
use experiment::inputs::{self, Inputs};
use experiment::lots::Lot;
use experiment::manifest::{Manifest, Outcome, Request};
use experiment::run_dir::RunDir;
use experiment::settings::{Layers, Settings};
use experiment::shard::Shard;
use report::trainings_table::TrainingsTable;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// Options of every such command.
#[derive(Debug, Clone, Args)]
pub(crate) struct TrainingsArgs {
    #[command(flatten)]
    layers: LayerArgs,
    /// Root seed of the trainings.
    #[arg(long)]
    pub(crate) seed: Option<u64>,
    #[command(flatten)]
    out: OutArgs,
    /// Does only a share of the trainings, for one of several machines (docs/cluster.md); `merge` puts the shares
    /// together.
    #[arg(long, value_name = "NUMBER/OF")]
    shard: Option<Shard>,
    /// Continues an interrupted run with its own settings, to the same result; finished trainings are skipped.
    #[arg(
        long,
        value_name = "RUN", value_parser = run_folder(),
        conflicts_with_all = ["preset", "config", "overrides", "seed", "out", "overwrite", "shard"]
    )]
    resume: Option<PathBuf>,
}

impl TrainingsArgs {
    pub(crate) fn layers(&self) -> Layers {
        Layers::from(&self.layers)
    }

    /// The settings: the preset with what the command changes of it, and over that what the user asks for, in a file or by flags.
    ///
    /// # Errors
    /// Naming what is wrong in which layer.
    pub(crate) fn settings(&self, changes: impl IntoIterator<Item = String>) -> anyhow::Result<Settings> {
        let layers = self.layers();
        let of_command =
            Layers { preset: layers.preset.clone(), overrides: changes.into_iter().collect(), ..Layers::default() };
        Settings::resolve_over(&Settings::resolve(&of_command, None)?, &layers, self.seed)
    }
}

/// Refuses what `option` names a second time: folders and rows are called so.
pub(crate) fn ensure_distinct<T: PartialEq + Display>(option: &str, named: &[T]) -> anyhow::Result<()> {
    for (at, name) in named.iter().enumerate() {
        ensure!(!named[..at].contains(name), "{option} {name} is named twice");
    }
    Ok(())
}

/// What a manifest, without the record of a shard, asks for.
pub(crate) struct AskedFor {
    pub(crate) stages: Vec<Stage>,
    /// The lots, parameters and networks from files that are read.
    pub(crate) inputs: Inputs,
    /// Where they lie.
    pub(crate) reads: Vec<PathBuf>,
}

/// A command of this kind; `E`: how much is done, besides what the settings say.
pub(crate) struct Trainings<E> {
    pub(crate) command: &'static str,
    /// Above its table.
    pub(crate) title: &'static str,
    pub(crate) stages: fn(&Settings, &E, &Path) -> anyhow::Result<Vec<Stage>>,
    /// What is written as `COMMAND.md`, `.csv` and `.svg`, by what the stages left in a folder.
    pub(crate) table: fn(&Settings, &E, &[Stage], &Path) -> anyhow::Result<TrainingsTable>,
    /// Lots that nothing is trained on.
    pub(crate) unseen: fn(&E) -> &[String],
}

/// What a run is begun with.
pub(crate) struct Begun<E> {
    pub(crate) preset: String,
    pub(crate) settings: Settings,
    pub(crate) extent: E,
}

impl<E: Serialize + DeserializeOwned> Trainings<E> {
    /// Continues the run at `--resume`, or begins one.
    pub(crate) fn run(
        &self,
        args: &TrainingsArgs,
        begin: impl FnOnce() -> anyhow::Result<Begun<E>>,
        output: &Output,
    ) -> anyhow::Result<()> {
        let (run, settings, extent, shard) = match &args.resume {
            Some(path) => self.resume(path, output)?,
            None => self.begin(args, begin()?, output)?,
        };
        let console = Console::new(output);
        let mut stages = (self.stages)(&settings, &extent, run.path())?;
        if let Some(record) = &shard {
            stages = record.share_of(stages);
        }
        perform::all(self.command, &stages, &run, &console, output)?;
        let (name, folder) = (self.command, run.path().display());
        if let Some(ShardRecord { number, .. }) = shard {
            run.finish(Outcome::Reproduction { stages: stages.len() })?;
            output.note(format_args!(
                "written: {folder}: shard {number}; put all together with cargo xtask merge RUN..."
            ));
        } else {
            let table = (self.table)(&settings, &extent, &stages, run.path())?;
            table.write(&run, name)?;
            output.table(|| format!("\n{}\n\n{}", self.title, table.text), &())?;
            run.finish(Outcome::Reproduction { stages: stages.len() })?;
            output.note(format_args!("written: {folder}/{name}.md, {name}.csv and {name}.svg"));
        }
        console.report_time();
        Ok(())
    }

    fn begin(
        &self,
        args: &TrainingsArgs,
        begun: Begun<E>,
        output: &Output,
    ) -> anyhow::Result<(RunDir, Settings, E, Option<ShardRecord>)> {
        let Begun { preset, settings, extent } = begun;
        train::check_lots(&settings, output)?;
        train::check_unseen(&settings, (self.unseen)(&extent), output)?;
        let mut reads = train::places(&settings, (self.unseen)(&extent))?;
        reads.extend(args.layers.file().map(Path::to_owned));
        // Only names and settings are asked for: the run has no place yet.
        let stages = (self.stages)(&settings, &extent, Path::new(""))?;
        for stage in &stages {
            stage.settings.check().with_context(|| stage.folder.clone())?;
        }
        let shard = args.shard.map(|number| ShardRecord::of_stages(number, None, &settings, stages));
        let mut arguments = toml::Table::try_from(&extent)?;
        if let Some(record) = &shard {
            record.add_to(&mut arguments);
        }
        let request = Request { arguments, inputs: self.inputs(&settings, &extent)?, reads };
        let run = RunDir::create(&args.out.place(self.command, &preset, settings.seed.0), &settings, &request)?;
        Ok((run, settings, extent, shard))
    }

    fn resume(&self, path: &Path, output: &Output) -> anyhow::Result<(RunDir, Settings, E, Option<ShardRecord>)> {
        let (run, settings, mut manifest) = build_info::resume(path, self.command, output)?;
        let shard = ShardRecord::take_from(&mut manifest).with_context(|| path.display().to_string())?;
        if shard.is_some() {
            build_info::check_began_shard(path, &manifest)?;
        }
        let extent: E = manifest.arguments.clone().try_into().with_context(|| path.display().to_string())?;
        manifest.check_inputs(&self.inputs(&settings, &extent)?)?;
        Ok((run, settings, extent, shard))
    }

    /// What a manifest, without the record of a shard, asks for.
    pub(crate) fn asked_for(&self, settings: &Settings, manifest: &Manifest) -> anyhow::Result<AskedFor> {
        let extent: E = manifest.arguments.clone().try_into()?;
        Ok(AskedFor {
            stages: (self.stages)(settings, &extent, Path::new(""))?,
            inputs: self.inputs(settings, &extent)?,
            reads: train::places(settings, (self.unseen)(&extent))?,
        })
    }

    /// The lots from files that are read.
    fn inputs(&self, settings: &Settings, extent: &E) -> anyhow::Result<Inputs> {
        let mut found = train::inputs(settings)?;
        found.extend(inputs::of(&Lot::parse_all((self.unseen)(extent), &settings.episode.vehicle)?, &[]));
        Ok(found)
    }
}
