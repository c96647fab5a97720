//! Recordings made while an evaluation or a training goes on: the first runs of every driver or round.

use super::drive::{Detail, Drive};
use super::training::{self, Curve};
use super::{Target, layout, legend, lot_marks, root_of};
use crate::recorder::Recorder;
use crate::settings::Settings;
use anyhow::Context as _;
use policy::dagger::Progress;
use policy::drivers::NetPolicy;
use protocol::{Message, Sink};
use sim::episode::Episode;
use sim::frame::Frame;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Name of the recording of a training.
const TRAINING: u32 = 0;

/// A recorder and what it records at present.
pub struct Live {
    recorder: Recorder,
    folder: PathBuf,
    /// Runs to record of every driver and noise level, or of every round.
    runs: usize,
    /// How many were recorded, by what they belong to.
    recorded: BTreeMap<String, usize>,
    next: u32,
    /// Running episodes that are recorded, by their index within the batch.
    drives: BTreeMap<usize, (u32, Drive)>,
    curve: Curve,
    files: usize,
}

impl Live {
    /// Starts recording into the folder `recordings` of a run.
    ///
    /// # Errors
    /// If the recorder cannot be built or started, or the folder cannot be created.
    pub fn start(run: &Path, runs: usize) -> anyhow::Result<Self> {
        let folder = run.join("recordings");
        std::fs::create_dir_all(&folder).with_context(|| format!("{}: cannot be created", folder.display()))?;
        let recorder = Recorder::start()?;
        let (recorded, drives) = (BTreeMap::new(), BTreeMap::new());
        Ok(Self { recorder, folder, runs, recorded, next: TRAINING + 1, drives, curve: Curve::default(), files: 0 })
    }

    /// Begins with the learning curves of a training.
    pub fn training(&mut self) {
        let header =
            self.target("training").header("training", "training".to_owned(), layout::of_training(false), None);
        let header = protocol::Header { timeline: "step".to_owned(), ..header };
        self.recorder.send(Message::Begin { recording: TRAINING, header: Box::new(header) });
        self.recorder.send(Message::Always { recording: TRAINING, marks: training::always() });
    }

    /// Takes note of how a training goes.
    pub fn progress(&mut self, progress: &Progress<'_>) {
        let moment = match *progress {
            Progress::Collected { collection, dataset, .. } => Some(self.curve.collected(collection, dataset)),
            Progress::Fitting { fit, .. } => self.curve.step(fit),
            Progress::Collecting { .. } | Progress::Finished { .. } => None,
        };
        if let Some((clock, marks)) = moment {
            self.recorder.send(Message::At { recording: TRAINING, clock, marks });
        }
        if matches!(progress, Progress::Collected { .. }) {
            self.end_drives();
        }
    }

    /// Begins to record some of the episodes that are about to be driven. `of`: driver and noise level, or round;
    /// `names`: of every episode.
    pub fn begin(&mut self, of: &str, settings: &Settings, episodes: &[Episode], names: &[String], view: &View<'_>) {
        self.end_drives();
        let recorded = self.recorded.entry(of.to_owned()).or_default();
        let count = self.runs.saturating_sub(*recorded).min(episodes.len());
        *recorded += count;
        for (index, (episode, name)) in episodes.iter().zip(names).enumerate().take(count) {
            let mut drive = Drive::new(view.root, episode, settings, view.detail);
            if let Some(novice) = view.novice {
                drive = drive.with_novice(novice.clone());
            }
            let (recording, map) = (self.next, episode.map());
            self.next += 1;
            let name = format!("{of}, {name}");
            let layout = layout::of_drives(map, &[view.root.to_owned()], view.detail);
            let file = root_of(&name.replace(", ", "-").replace(' ', "-"));
            let header = self.target(&file).header("drive", name, layout, None);
            self.recorder.send(Message::Begin { recording, header: Box::new(header) });
            let mut marks = lot_marks(map, legend::DRIVE);
            marks.extend(drive.always());
            self.recorder.send(Message::Always { recording, marks });
            self.drives.insert(index, (recording, drive));
            self.files += 1;
        }
    }

    /// Takes a frame of an episode, recorded or not.
    pub fn frame(&mut self, episode: usize, frame: &Frame) {
        if let Some((recording, drive)) = self.drives.get_mut(&episode) {
            let (clock, marks) = drive.frame(frame);
            self.recorder.send(Message::At { recording: *recording, clock, marks });
        }
    }

    /// Ends what is recorded and says where it is. A recorder that failed has said why; the run is none the worse.
    pub fn finish(mut self) {
        self.end_drives();
        match self.recorder.finish() {
            Ok(()) => eprintln!(
                "recorded: {} runs in {}; open them: {}",
                self.files,
                self.folder.display(),
                super::viewer_hint(&format!("{}/*.rrd", self.folder.display()))
            ),
            Err(error) => eprintln!("warning: {error:#}"),
        }
    }

    fn end_drives(&mut self) {
        for (recording, _) in std::mem::take(&mut self.drives).into_values() {
            self.recorder.send(Message::End { recording });
        }
    }

    fn target(&self, name: &str) -> Target {
        let file = self.folder.join(format!("{name}.rrd"));
        Target { sink: Sink::File(file.display().to_string()), file: Some(file) }
    }
}

/// How drives are shown.
pub struct View<'a> {
    /// Entity of the driver.
    pub root: &'a str,
    /// How much is shown.
    pub detail: Detail,
    /// Who is asked beside the expert.
    pub novice: Option<&'a NetPolicy>,
}
