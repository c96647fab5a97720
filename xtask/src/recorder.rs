//! The Rerun recorder: a program of its own (`xtask/recorder`), built when first needed and fed through a pipe.
//!
//! Nothing is paid when nobody records. While recording, messages wait in a bounded queue for a thread that writes them;
//! a recorder that dies is warned about once, and whatever was going on goes on.

use anyhow::{Context as _, bail};
use protocol::Message;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::SystemTime;

/// The version of rerun that the recorder is built with, and so of the viewer that fits.
pub const RERUN_VERSION: &str = "0.36.3";
/// Messages that may wait: some seconds of driving, a few megabytes.
const QUEUE: usize = 256;

/// A running recorder.
#[derive(Debug)]
pub struct Recorder {
    queue: SyncSender<Message>,
    writer: JoinHandle<std::io::Result<()>>,
    child: Child,
    is_lost: bool,
}

impl Recorder {
    /// Builds the recorder if need be, and starts it.
    ///
    /// # Errors
    /// If it cannot be built or started.
    pub fn start() -> anyhow::Result<Self> {
        Self::start_program(&build()?)
    }

    /// Starts a recorder that is there already.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn start_program(program: &Path) -> anyhow::Result<Self> {
        let mut command = Command::new(program);
        command.stdin(Stdio::piped());
        // Ctrl-C is for the bench; the recorder ends when its pipe does, and so writes everything.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().with_context(|| format!("{}: cannot be started", program.display()))?;
        let mut pipe = BufWriter::with_capacity(1 << 18, child.stdin.take().expect("it was asked to be piped"));
        let (queue, messages): (SyncSender<Message>, Receiver<Message>) = sync_channel(QUEUE);
        let writer = std::thread::spawn(move || {
            while let Ok(message) = messages.recv() {
                protocol::write(&mut pipe, &message)?;
            }
            pipe.flush()
        });
        Ok(Self { queue, writer, child, is_lost: false })
    }

    /// Passes a message on; waits while the recorder is behind.
    pub fn send(&mut self, message: Message) {
        if !self.is_lost && self.queue.send(message).is_err() {
            self.is_lost = true;
            eprintln!("warning: the recorder is gone; going on without recording");
        }
    }

    /// Waits until everything is written.
    ///
    /// # Errors
    /// If the recorder failed; it has said why.
    pub fn finish(self) -> anyhow::Result<()> {
        let Self { queue, writer, mut child, .. } = self;
        drop(queue);
        let written = writer.join().expect("the writer does not panic");
        let status = child.wait().context("the recorder")?;
        if !status.success() {
            bail!("the recorder failed ({status}); the recording is not complete");
        }
        written.context("the pipe to the recorder")
    }
}

/// Builds the recorder unless it is there and newer than all it is made of: Cargo would take a second of two cores to
/// find that out.
fn build() -> anyhow::Result<PathBuf> {
    let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("recorder");
    let target = target_folder()?.join("recorder");
    let program = target.join("debug").join(format!("recorder{}", std::env::consts::EXE_SUFFIX));
    if is_fresh(&program, &package) {
        return Ok(program);
    }
    let is_there = program.is_file();
    let takes = if is_there { "seconds to minutes" } else { "about 8 minutes on two cores, only this once" };
    eprintln!("building the Rerun recorder ({takes}) …");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.args(["build", "--locked", "--manifest-path"]).arg(package.join("Cargo.toml"));
    command.arg("--target-dir").arg(&target);
    if is_there {
        command.arg("--quiet");
    }
    let status = command.status().context("cargo, which builds the recorder, cannot be started; install Rust")?;
    if !status.success() {
        bail!("{}: the recorder cannot be built, see above", package.display());
    }
    // Cargo leaves a program alone that it finds to be right, however old.
    File::options().append(true).open(&program).and_then(|file| file.set_modified(SystemTime::now())).ok();
    Ok(program)
}

/// Whether a program is newer than all sources of the recorder. What cannot be read is for Cargo to judge.
fn is_fresh(program: &Path, package: &Path) -> bool {
    let changed = |path: &Path| path.metadata().and_then(|metadata| metadata.modified());
    let folders = ["", "src", "../protocol", "../protocol/src"].map(|folder| package.join(folder));
    let sources = folders.iter().flat_map(|folder| std::fs::read_dir(folder).into_iter().flatten()).flatten();
    let mut files = sources.map(|entry| entry.path()).filter(|path| path.is_file()).peekable();
    let Ok(built) = changed(program) else { return false };
    files.peek().is_some() && files.all(|file| changed(&file).is_ok_and(|at| at < built))
}

/// Where this program was built: beside it the recorder is kept.
fn target_folder() -> anyhow::Result<PathBuf> {
    let program = std::env::current_exe().context("this program does not know where it is")?;
    let folder =
        program.ancestors().find(|folder| folder.file_name().is_some_and(|name| name == "debug" || name == "release"));
    Ok(folder.and_then(Path::parent).unwrap_or(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../target"))).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::{Clock, Mark, Shape};

    /// More than the queue and the pipe hold: whoever drives would wait for ever if death were not noticed.
    #[test]
    fn a_recorder_that_dies_stops_nothing() {
        let mut recorder = Recorder::start_program(Path::new("false")).unwrap();
        for tick in 0..10_000 {
            let marks = vec![Mark::new("a/signal", Shape::Document("x".repeat(200)))];
            recorder.send(Message::At { recording: 0, clock: Clock::Episode { tick, time_s: 0.0 }, marks });
        }
        assert!(recorder.is_lost);
        assert!(format!("{:#}", recorder.finish().unwrap_err()).contains("not complete"));
    }

    #[test]
    fn a_recorder_that_is_not_there_is_named() {
        let error = Recorder::start_program(Path::new("/no/such/recorder")).unwrap_err();
        assert!(format!("{error:#}").contains("/no/such/recorder"));
    }

    #[test]
    fn only_a_recorder_older_than_its_sources_is_built_again() {
        let root = std::env::temp_dir().join(format!("parking-recorder-{}", std::process::id()));
        let (package, program) = (root.join("recorder"), root.join("program"));
        for source in ["recorder/Cargo.lock", "recorder/src/main.rs", "protocol/Cargo.toml", "protocol/src/lib.rs"] {
            std::fs::create_dir_all(root.join(source).parent().unwrap()).unwrap();
            std::fs::write(root.join(source), "").unwrap();
        }
        assert!(!is_fresh(&program, &package), "there is none");
        std::fs::write(&program, "").unwrap();
        let later = |path: &Path, seconds| {
            let file = File::options().append(true).open(path).unwrap();
            file.set_modified(SystemTime::now() + std::time::Duration::from_secs(seconds)).unwrap();
        };
        later(&program, 60);
        assert!(is_fresh(&program, &package));
        later(&root.join("protocol/src/lib.rs"), 120);
        assert!(!is_fresh(&program, &package));
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn the_viewer_that_is_named_is_the_one_that_fits() {
        let package = include_str!("../recorder/Cargo.toml");
        assert!(package.contains(&format!("rerun = {{ version = \"={RERUN_VERSION}\"")), "{package}");
        let readme = include_str!("../../README.md");
        assert!(readme.contains(&format!("pip install rerun-sdk=={RERUN_VERSION}")));
        // Whoever only trains does not compile rerun.
        assert!(!include_str!("../../Cargo.lock").contains("name = \"rerun\""));
    }
}
