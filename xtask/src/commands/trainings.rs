//! What commands of several trainings and one drive of all their policies have in common: they are begun, resumed, done
//! and reported in the same way.

use super::{perform, train};
use crate::args::{LayerArgs, OutArgs, run_folder};
use crate::build_info;
use crate::console::Console;
use crate::output::Output;
use anyhow::{Context as _, ensure};
use clap::Args;
use evaluation::stages::Stage;
use experiment::inputs::{self, Inputs};
use experiment::lots::Lot;
use experiment::manifest::{Outcome, Request};
use experiment::run_dir::RunDir;
use experiment::settings::{Layers, Settings};
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
    /// Continues an interrupted run with its own settings, to the same result; finished trainings are skipped.
    #[arg(long, value_name = "RUN", value_parser = run_folder(), conflicts_with_all = ["preset", "config", "overrides", "seed", "out"])]
    resume: Option<PathBuf>,
}

impl TrainingsArgs {
    pub(crate) fn layers(&self) -> Layers {
        Layers::from(&self.layers)
    }
}

/// Refuses what `option` names a second time: folders and rows are called so.
pub(crate) fn ensure_distinct<T: PartialEq + Display>(option: &str, named: &[T]) -> anyhow::Result<()> {
    for (at, name) in named.iter().enumerate() {
        ensure!(!named[..at].contains(name), "{option} {name} is named twice");
    }
    Ok(())
}

/// A command of this kind; `E`: how much is done, besides what the settings say.
pub(crate) struct Trainings<E> {
    pub(crate) command: &'static str,
    /// Above its table.
    pub(crate) title: &'static str,
    pub(crate) stages: fn(&Settings, &E, &Path) -> anyhow::Result<Vec<Stage>>,
    /// Writes `COMMAND.md`, `.csv` and `.svg`; returns the table.
    pub(crate) write: fn(&Settings, &E, &[Stage], &RunDir) -> anyhow::Result<String>,
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
        let (run, settings, extent) = if let Some(path) = &args.resume {
            let (run, settings, manifest) = RunDir::resume(path, self.command)?;
            build_info::check_can_go_on(path, &manifest, output)?;
            let extent: E = manifest.arguments.clone().try_into().with_context(|| path.display().to_string())?;
            manifest.check_inputs(&self.inputs(&settings, &extent)?)?;
            (run, settings, extent)
        } else {
            let Begun { preset, settings, extent } = begin()?;
            let mut places = train::check_lots(&settings, output)?;
            places.extend(train::check_unseen(&settings, (self.unseen)(&extent))?);
            args.out.ensure_apart_from(places.iter().map(PathBuf::as_path).chain(args.layers.file()))?;
            for stage in (self.stages)(&settings, &extent, Path::new(""))? {
                stage.settings.check().with_context(|| stage.folder.clone())?;
            }
            let arguments = toml::Table::try_from(&extent)?;
            let request = Request { arguments, inputs: self.inputs(&settings, &extent)? };
            let run = RunDir::create(&args.out.place(self.command, &preset, settings.seed.0), &settings, &request)?;
            (run, settings, extent)
        };
        let stages = (self.stages)(&settings, &extent, run.path())?;
        let console = Console::new(output);
        perform::all(self.command, &stages, &run, &console, output)?;
        let table = (self.write)(&settings, &extent, &stages, &run)?;
        output.table(|| format!("\n{}\n\n{table}", self.title), &())?;
        run.finish(Outcome::Reproduction { stages: stages.len() })?;
        let name = self.command;
        output.note(format_args!("written: {}/{name}.md, {name}.csv and {name}.svg", run.path().display()));
        console.report_time();
        Ok(())
    }

    /// The lots from files that are read.
    fn inputs(&self, settings: &Settings, extent: &E) -> anyhow::Result<Inputs> {
        let mut found = train::inputs(settings)?;
        found.extend(inputs::of(&Lot::parse_all((self.unseen)(extent), &settings.episode.vehicle)?, &[]));
        Ok(found)
    }
}
