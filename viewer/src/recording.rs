//! One recording: a stream of Rerun with the layout of its first view.

use crate::blueprint;
use crate::layout::Layout;
use anyhow::Context as _;
use experiment::view_request::Sink;
use rerun::log::{ChunkBatcherConfig, PendingRow};
use rerun::{ApplicationId, AsComponents, RecordingStream, RecordingStreamBuilder, Scalars, SpawnOptions};
use std::cell::{Cell, RefCell};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Duration;
use storage::whole::PARTIAL;

/// The version of the viewer that opens these recordings.
pub const RERUN_VERSION: &str = "0.36.3";

/// What waits in memory before it is written to a file, bytes: a few large chunks per entity instead of many small ones.
const BATCH_BYTES: u64 = 16 << 20;

/// What a recording is.
pub(crate) struct Header {
    /// Recordings of one application share what the user changes about their layout.
    pub(crate) application: &'static str,
    /// Shown in the viewer's list of recordings.
    pub(crate) title: String,
    /// The first view.
    pub(crate) layout: Layout,
    /// The time line that is shown first.
    pub(crate) timeline: &'static str,
    /// What the recording is about, if it is a moment.
    pub(crate) event: Option<Moment>,
}

/// A moment of interest.
///
/// The viewer starts at the beginning of a time line. So there is one, [`EVENT_TIME`], that begins shortly before the
/// moment; what came earlier is on the other time lines.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment {
    /// Where [`EVENT_TIME`] begins, and until when it is played again and again: simulated seconds.
    pub(crate) played_s: [f64; 2],
}

/// Simulated time from shortly before a moment of interest on.
pub(crate) const EVENT_TIME: &str = "event_time";

/// An open recording.
pub(crate) struct Recording {
    stream: RecordingStream,
    event: Option<Moment>,
    /// Whether the time is before what [`EVENT_TIME`] shows.
    is_before_event: Cell<bool>,
    /// The first thing that could not be logged.
    failed: RefCell<Option<anyhow::Error>>,
    /// Where it goes, if that is a file.
    file: Option<Partial>,
}

/// A file under another name until it is whole. What is not, is deleted.
struct Partial {
    whole: PathBuf,
    written: PathBuf,
    /// Whose lock says that somebody is at it; none before it is there, and where the file system has no locks.
    lock: Option<File>,
}

impl Partial {
    /// The process is part of its name: of two that make the same recording at once, each makes it whole.
    fn of(whole: PathBuf) -> Self {
        let written = whole.with_added_extension(format!("{}.{PARTIAL}", std::process::id()));
        Self { whole, written, lock: None }
    }

    /// Deletes what processes that were killed left of the same recording.
    fn delete_left(&self) {
        let name = self.whole.file_name().unwrap_or_default().to_string_lossy();
        let (start, ending) = (format!("{name}."), format!(".{PARTIAL}"));
        for entry in std::fs::read_dir(folder_of(&self.whole)).into_iter().flatten().flatten() {
            let file = entry.file_name().to_string_lossy().into_owned();
            let process = file.strip_prefix(&start).and_then(|rest| rest.strip_suffix(&ending));
            if process.is_some_and(|id| id.parse::<u32>().is_ok()) && locked(&entry.path()).is_some() {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }

    /// Says that somebody is at it.
    fn lock(&mut self) {
        self.lock = locked(&self.written);
    }
}

/// A file that nobody else is at, locked; none where that cannot be told.
fn locked(file: &Path) -> Option<File> {
    let is_file = std::fs::symlink_metadata(file).ok()?.is_file();
    let opened = File::options().write(true).open(file).ok().filter(|_| is_file)?;
    opened.try_lock().ok().map(|()| opened)
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

impl Drop for Partial {
    fn drop(&mut self) {
        // Of a whole one nothing is there any more; of another, the error that ended it is what is said.
        let _ = std::fs::remove_file(&self.written);
    }
}

impl Recording {
    /// Begins a recording and sends its layout. `name`: of its file in a folder.
    ///
    /// # Errors
    /// If the file cannot be created, or there is no viewer.
    pub(crate) fn begin(sink: &Sink, name: &str, header: &Header) -> anyhow::Result<Self> {
        let builder = RecordingStreamBuilder::new(application(header)?);
        let (stream, file) = match sink {
            Sink::File(path) => save(builder, path.clone())?,
            Sink::Folder(folder) => save(builder, folder.join(format!("{name}.rrd")))?,
            Sink::Connect(Some(url)) => (builder.connect_grpc_opts(url.as_str()).with_context(|| url.clone())?, None),
            Sink::Connect(None) => (builder.connect_grpc().context("the viewer of this machine")?, None),
            Sink::Spawn => (spawn(builder)?, None),
        };
        Self::with_layout(stream, file, header)
    }

    fn with_layout(stream: RecordingStream, file: Option<Partial>, header: &Header) -> anyhow::Result<Self> {
        // A wall clock means nothing in a simulation, and would make every file differ.
        stream.set_log_time_enabled(false);
        stream.send_recording_name(header.title.as_str())?;
        blueprint::send(&stream, application(header)?, header)?;
        let (is_before_event, failed) = (Cell::new(false), RefCell::new(None));
        Ok(Self { stream, event: header.event, is_before_event, failed, file })
    }

    /// What is logged from now on holds from this control tick on.
    pub(crate) fn at_tick(&self, tick: u32, sim_time_s: f64) {
        self.stream.set_time_sequence("tick", i64::from(tick));
        self.stream.set_duration_secs("sim_time", sim_time_s);
        if let Some(Moment { played_s: [first_s, _] }) = self.event {
            self.is_before_event.set(sim_time_s < first_s);
            // Shapes that were logged earlier are there when the time line begins.
            self.stream.set_duration_secs(EVENT_TIME, sim_time_s.max(first_s));
        }
    }

    /// What is logged from now on holds from this optimiser step on, counted over all rounds.
    pub(crate) fn at_step(&self, step: i64, round: i64) {
        self.stream.set_time_sequence("step", step);
        self.stream.set_time_sequence("round", round);
    }

    /// Shows something from now on, until the same entity shows something else. What cannot be logged fails the
    /// recording when it ends.
    pub(crate) fn log(&self, entity: &str, shape: &impl AsComponents) {
        self.keep(entity, self.stream.log(entity, shape));
    }

    /// Shows the value of a signal. Unlike shapes, earlier values stay visible, each at its own time only.
    pub(crate) fn log_value(&self, entity: &str, value: f64) {
        if self.is_before_event.get() {
            let mut earlier = self.stream.now();
            earlier.remove(&EVENT_TIME.into());
            let row = PendingRow::from_iter(earlier, Scalars::single(value).as_serialized_batches());
            self.stream.record_row(entity.into(), row, false);
        } else {
            self.log(entity, &Scalars::single(value));
        }
    }

    /// Shows something at all times.
    pub(crate) fn log_static(&self, entity: &str, shape: &impl AsComponents) {
        self.keep(entity, self.stream.log_static(entity, shape));
    }

    fn keep(&self, entity: &str, logged: rerun::RecordingStreamResult<()>) {
        if let Err(error) = logged {
            self.failed.borrow_mut().get_or_insert_with(|| anyhow::Error::from(error).context(entity.to_owned()));
        }
    }

    /// Waits until everything is written; the file, if it is one.
    ///
    /// # Errors
    /// If something could not be logged or written.
    pub(crate) fn end(self) -> anyhow::Result<Option<PathBuf>> {
        let place = self.file.as_ref().map_or_else(|| "the viewer".to_owned(), |file| file.whole.display().to_string());
        if let Some(error) = self.failed.into_inner() {
            return Err(error.context(place));
        }
        self.stream
            .flush_blocking()
            .with_context(|| format!("{place}: cannot be written; is the disk full, or the viewer gone?"))?;
        self.stream.disconnect();
        let Some(file) = self.file else { return Ok(None) };
        std::fs::rename(&file.written, &file.whole).with_context(|| format!("{place}: cannot be written"))?;
        Ok(Some(file.whole.clone()))
    }

    /// A recording that stays in memory.
    #[cfg(test)]
    pub(crate) fn in_memory(header: &Header) -> (Self, rerun::sink::MemorySinkStorage) {
        let (stream, storage) = RecordingStreamBuilder::new(application(header).unwrap()).memory().unwrap();
        (Self::with_layout(stream, None, header).unwrap(), storage)
    }
}

fn application(header: &Header) -> anyhow::Result<ApplicationId> {
    Ok(ApplicationId::try_from(format!("lotpilot-{}", header.application))?)
}

fn save(builder: RecordingStreamBuilder, path: PathBuf) -> anyhow::Result<(RecordingStream, Option<Partial>)> {
    let folder = folder_of(&path);
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot be created; choose a file with --out", folder.display()))?;
    let batches =
        ChunkBatcherConfig { flush_tick: Duration::MAX, flush_num_bytes: BATCH_BYTES, ..ChunkBatcherConfig::DEFAULT };
    let mut file = Partial::of(path);
    file.delete_left();
    // Never through a link that somebody put there.
    if std::fs::symlink_metadata(&file.written).is_ok() {
        std::fs::remove_file(&file.written).with_context(|| file.written.display().to_string())?;
    }
    let stream =
        builder.batcher_config(batches).save(&file.written).with_context(|| file.whole.display().to_string())?;
    file.lock();
    Ok((stream, Some(file)))
}

/// A viewer of this machine that nobody else can reach.
fn spawn(builder: RecordingStreamBuilder) -> anyhow::Result<RecordingStream> {
    let options = SpawnOptions { extra_args: vec!["--bind=127.0.0.1".to_owned()], ..SpawnOptions::default() };
    builder.spawn_opts(&options).with_context(|| {
        format!("no viewer could be started; install it with: pip install rerun-sdk=={RERUN_VERSION} (or write a file)")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What an error or a kill cut short stood in the place of an earlier recording.
    #[test]
    fn a_recording_takes_the_place_of_another_when_it_is_whole() {
        let folder = std::env::temp_dir().join(format!("lotpilot-partial-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("a.rrd");
        std::fs::write(&file, "earlier").unwrap();
        let begin = || Recording::begin(&Sink::File(file.clone()), "a", &crate::tests::header(None)).unwrap();
        let files = || std::fs::read_dir(&folder).unwrap().count();
        let failed = begin();
        assert_eq!(files(), 2);
        drop(failed);
        assert_eq!((files(), std::fs::read(&file).unwrap()), (1, b"earlier".to_vec()));
        assert_eq!(begin().end().unwrap(), Some(file.clone()));
        assert_eq!(files(), 1);
        assert_ne!(std::fs::read(&file).unwrap(), b"earlier");
        std::fs::remove_dir_all(folder).unwrap();
    }

    /// Two viewers wrote into one file, and the first that was done gave it its name.
    #[test]
    fn a_recording_is_written_into_a_file_of_its_process_and_those_of_the_dead_go() {
        let folder = std::env::temp_dir().join(format!("lotpilot-processes-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("a.rrd");
        let of_process = |id: u32| folder.join(format!("a.rrd.{id}.{PARTIAL}"));
        let (living, dead) = (of_process(1), of_process(u32::MAX));
        for other in [&living, &dead] {
            std::fs::write(other, "").unwrap();
        }
        let held = locked(&living).unwrap();
        let recording = Recording::begin(&Sink::File(file.clone()), "a", &crate::tests::header(None)).unwrap();
        assert!(of_process(std::process::id()).is_file());
        recording.end().unwrap();
        assert!(living.is_file() && !dead.exists() && file.is_file());
        drop(held);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn the_viewer_that_is_named_is_the_one_that_opens_these_recordings() {
        let package = include_str!("../Cargo.toml");
        assert!(package.contains(&format!("rerun = {{ version = \"={RERUN_VERSION}\"")), "{package}");
        let help = include_str!("../../xtask/src/commands/visualise.rs");
        for text in [help, include_str!("../../docs/recordings.md")] {
            let named: Vec<&str> = text.split("rerun-sdk==").skip(1).collect();
            assert!(!named.is_empty() && named.iter().all(|version| version.starts_with(RERUN_VERSION)), "{named:?}");
        }
    }
}
