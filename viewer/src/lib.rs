//! Lots, drives and trainings as recordings for Rerun's viewer.
//!
//! Nothing is recorded during a run: replay keys and the folders of trainings are enough to simulate it again, bit
//! for bit, and that is what happens here.
//!
//! | file | what |
//! |---|---|
//! | [`replay`] | drives of an evaluation, by replay key |
//! | [`rollout`] | episodes of a training, round by round |
//! | [`drive`], [`lot`], [`sensors`], [`training`] | what is shown of each |
//! | [`layout`], [`legend`], [`colours`] | the first view |
//! | [`recording`], [`blueprint`], [`shapes`], [`picture`] | Rerun |
#![allow(clippy::disallowed_methods, reason = "angles are for looking at here; what is driven is computed by `sim`")]

mod blueprint;
mod colours;
mod drive;
mod layout;
mod legend;
mod lot;
mod picture;
mod recording;
mod replay;
mod rollout;
mod sensors;
mod shapes;
#[cfg(test)]
mod tests;
mod training;

pub use recording::RERUN_VERSION;

use anyhow::{bail, ensure};
use experiment::lots::Lot;
use experiment::progress::{Interrupted, Progress};
use experiment::settings::Settings;
use experiment::trials::{self, Purpose, Trial};
use experiment::view_request::{Show, Sink, ViewRequest};
use recording::{Header, Recording};
use rerun::TextDocument;
use sim::map::Map;
use sim::metrics::EpisodeMetrics;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use std::path::{Path, PathBuf};

/// What recordings are made with.
struct Context<'a> {
    sink: &'a Sink,
    progress: &'a dyn Progress,
    /// The files that are complete.
    files: &'a mut Vec<PathBuf>,
}

/// Shows what is asked for. `files`: takes those that are complete, also if something fails later.
///
/// # Errors
/// If something named does not exist, a recording cannot be written, or [`Interrupted`] after the recording at hand.
pub fn show(request: &ViewRequest, progress: &dyn Progress, files: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    if let Sink::File(file) = &request.sink {
        let is_single = match request.show.as_slice() {
            [Show::Lot { .. } | Show::Training { .. }] => true,
            [Show::Drives { drives, .. }] => drives.len() == 1,
            _ => false,
        };
        ensure!(is_single, "{}: several recordings need a folder, not one file", file.display());
    }
    let mut context = Context { sink: &request.sink, progress, files };
    request.show.iter().try_for_each(|show| match show {
        Show::Lot { lot, seed } => context.show_lot(lot, *seed),
        Show::Drives { settings, drives } => replay::show(drives, settings, &mut context),
        Show::Training { run } => context.show_training(run),
        Show::Rollouts { run, episodes } => rollout::show(run, *episodes, &mut context),
    })
}

impl Context<'_> {
    /// Begins a recording. `name`: of its file in a folder.
    fn begin(&self, name: &str, header: &Header) -> anyhow::Result<Recording> {
        Recording::begin(self.sink, name, header)
    }

    /// Waits until a recording is written; refuses to continue after it if the user asked to stop.
    fn end(&mut self, recording: Recording) -> anyhow::Result<()> {
        self.files.extend(recording.end()?);
        if self.progress.is_cancelled() {
            return Err(
                Interrupted { kept: "the last recording ends there, those before it are complete".to_owned() }.into()
            );
        }
        Ok(())
    }

    fn show_lot(&mut self, spec: &str, seed: RootSeed) -> anyhow::Result<()> {
        let settings = Settings::preset("default")?;
        let lots = Lot::parse_all(&[spec], &settings.episode.vehicle)?;
        let [lot] = lots.as_slice() else {
            bail!("{spec:?} stands for {} lots; name one, as in test-hard-7", lots.len())
        };
        let trial_seed = trials::trial_seed(seed, Purpose::Pictures, 0);
        let map = Trial { lot, direction: Direction::Forward, index: 0, seed: trial_seed }.map(&settings.episode)?;
        let header = Header {
            application: "lot",
            title: format!("{} seed {}", lot.name(), seed.0),
            layout: layout::of_lot(&map),
            timeline: "sim_time",
            event: None,
        };
        let recording = self.begin(&format!("lot-{}-s{}", lot.name(), seed.0), &header)?;
        show_map(&map, legend::LOT, &recording);
        self.end(recording)
    }

    fn show_training(&mut self, run: &Path) -> anyhow::Result<()> {
        let title = run.file_name().map_or_else(|| "training".to_owned(), |name| name.to_string_lossy().into_owned());
        let header =
            Header { application: "training", title, layout: layout::of_training(), timeline: "step", event: None };
        let recording = self.begin("training", &header)?;
        training::show(run, &recording)?;
        self.end(recording)
    }
}

/// A lot, and what its colours mean.
fn show_map(map: &Map, legend: &str, recording: &Recording) {
    lot::show(map, recording);
    recording.log_static("legend", &TextDocument::from_markdown(legend));
}

/// How a drive went, in a few words.
fn result_of(metrics: &EpisodeMetrics) -> String {
    let events = metrics.near_collisions;
    let s = if events == 1 { "" } else { "s" };
    format!("{:.0} m, {events} near-collision{s}, safe ratio {:.2}", metrics.driven_m, metrics.safe_ratio)
}
