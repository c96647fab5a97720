//! A command disturbed in every way, and the outcome.

use crate::cases::{Case, EMPTY, PREPARED, SMALL};
use crate::content::Content;
use crate::faults::{Fault, Library};
use crate::process::{self, Ended};
use anyhow::{Context as _, ensure};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use storage::sums;

/// Times that a command is killed before it is allowed to run to its end.
const KILLS_IN_A_ROW: usize = 3;
/// After this many failures, nobody reads on.
const FAILURES_MAX: usize = 10;
/// What the names of the folders begin with that are kept of failures.
const FAILURE: &str = "failure-";

/// How much is done to a command.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    /// Operations that each fault strikes, evenly spaced; all of them if there are no more.
    pub strikes: usize,
    /// The first of them, counted from 1 among all operations: those before it were struck by a run that was stopped.
    pub from: usize,
    /// Which of them.
    pub share: Share,
    /// Deaths at random times.
    pub kills: usize,
    /// Seed of these times.
    pub seed: u64,
}

/// One of some shares of the operations that are struck, dealt out in turn.
#[derive(Debug, Clone, Copy)]
pub struct Share {
    /// Which, from 0.
    pub index: usize,
    /// How many there are, at least 1.
    pub of: usize,
}

/// The outcome of disturbing a command.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    /// Files compared every time.
    pub files: usize,
    /// Their bytes.
    pub bytes: usize,
    /// For each fault: operations struck, and operations that the command performs.
    pub struck: [(usize, usize); Fault::ALL.len()],
    /// Deaths at random times.
    pub kills: usize,
    /// What was lost, or was not the same, and where.
    pub failures: Vec<String>,
}

/// A folder to work in, with the program under test and all that it needs.
#[derive(Debug)]
pub struct Workplace {
    program: PathBuf,
    folder: PathBuf,
    run: PathBuf,
    library: Library,
    is_cancelled: fn() -> bool,
}

impl Workplace {
    /// An empty one with a copy of the program, so that a build meanwhile does not exchange it halfway: manifests name its
    /// version, and would differ. `is_cancelled` is asked all the time whether to give up.
    ///
    /// # Errors
    /// If the folder is there already, or something cannot be compiled, copied or written.
    pub fn new(program: &Path, folder: &Path, is_cancelled: fn() -> bool) -> anyhow::Result<Self> {
        // What lies there was prepared by another program.
        let remedy = || format!("{}: cannot be made; if an earlier torture left it, delete it", folder.display());
        fs::create_dir(folder).with_context(remedy)?;
        let filled = Self::fill(program, folder, is_cancelled);
        if filled.is_err() {
            let _ = fs::remove_dir_all(folder);
        }
        filled
    }

    /// Puts the library and the copy of the program into an empty folder.
    fn fill(program: &Path, folder: &Path, is_cancelled: fn() -> bool) -> anyhow::Result<Self> {
        let (folder, library) = (folder.to_owned(), Library::compile(folder)?);
        let copy = folder.join("program");
        fs::copy(program, &copy).with_context(|| program.display().to_string())?;
        let program = copy;
        Ok(Self { program, run: folder.join("run"), folder, library, is_cancelled })
    }

    /// Deletes the folder, but for one that holds a failure, for whoever looks for its cause. Says whether it did.
    ///
    /// # Errors
    /// If it cannot be read or deleted.
    pub fn leave(self) -> anyhow::Result<bool> {
        for entry in fs::read_dir(&self.folder)? {
            if entry?.file_name().to_string_lossy().starts_with(FAILURE) {
                return Ok(false);
            }
        }
        fs::remove_dir_all(&self.folder)?;
        Ok(true)
    }

    /// Disturbs a command in every way. `progress` is called with the share that is done.
    ///
    /// # Errors
    /// If a file cannot be read or written here, the command hangs or fails without being disturbed, or this is cancelled.
    pub fn torture(&self, case: &Case, extent: &Extent, progress: &mut dyn FnMut(f64)) -> anyhow::Result<Outcome> {
        self.prepare(case)?;
        let (right, took) = self.undisturbed(case, None)?;
        let mut outcome = Outcome { files: right.files(), bytes: right.bytes(), ..Outcome::default() };
        for (kind, fault) in Fault::ALL.into_iter().enumerate() {
            let (again, _) = self.undisturbed(case, Some(fault))?;
            if let Some(difference) = again.difference(&right) {
                outcome.failures.push(format!("not disturbed at all: {difference}"));
            }
            let operations = self.library.operations()?;
            let strikes = extent.strikes.min(operations.len());
            let evenly_spaced = (0..strikes).map(|strike| (2 * strike + 1) * operations.len() / (2 * strikes));
            let to_strike = evenly_spaced.filter(|at| at + 1 >= extent.from);
            for at in to_strike.skip(extent.share.index).step_by(extent.share.of) {
                let operation = &operations[at];
                let what = format!("{} at {} of {}, {operation}", fault.name(), at + 1, operations.len());
                let came = self.strike(case, fault, at + 1).and_then(|()| self.compare(&right));
                self.note(case, &mut outcome, &what, came)?;
                outcome.struck[kind].0 += 1;
                progress((kind as f64 + at as f64 / operations.len() as f64) / (Fault::ALL.len() + 1) as f64);
            }
            outcome.struck[kind].1 = operations.len();
        }
        let mut rng = ChaCha8Rng::seed_from_u64(extent.seed);
        while outcome.kills < extent.kills {
            let mut at = Vec::new();
            let mut words = case.command;
            self.begin(case)?;
            while at.len() < KILLS_IN_A_ROW {
                let after = took.mul_f64(rng.random_range(0.0..1.0));
                let mut command = self.command(words);
                if self.ended_within(&mut command, Some(after))?.code.is_some() {
                    break;
                }
                at.push(after);
                words = case.go_on;
            }
            let came = self.go_on(case).and_then(|()| self.compare(&right));
            self.note(case, &mut outcome, &format!("killed after {at:.3?}"), came)?;
            outcome.kills += at.len();
            let share = outcome.kills as f64 / extent.kills as f64;
            progress((Fault::ALL.len() as f64 + share) / (Fault::ALL.len() + 1) as f64);
        }
        Ok(outcome)
    }

    /// Makes what a command reads.
    fn prepare(&self, case: &Case) -> anyhow::Result<()> {
        fs::create_dir_all(self.place(EMPTY))?;
        fs::write(self.place(SMALL.0), SMALL.1)?;
        let is_read = |name: &str| case.copy_of == Some(name) || case.command.contains(name);
        for (name, command) in PREPARED.iter().filter(|(name, _)| is_read(name)) {
            if !self.place(name).exists() {
                self.complete(command)?;
            }
        }
        Ok(())
    }

    /// What a command writes that is left alone, and how long it takes; counts the operations that a fault could strike.
    fn undisturbed(&self, case: &Case, fault: Option<Fault>) -> anyhow::Result<(Content, Duration)> {
        self.begin(case)?;
        let mut command = self.command(case.command);
        if let Some(fault) = fault {
            self.library.load_into(&mut command, &self.run, fault, 0)?;
        }
        let ended = self.ended_within(&mut command, None)?;
        ensure!(ended.is_done(), "{}: {}", case.command, ended.stderr);
        Ok((Content::read(&self.run)?, ended.took))
    }

    /// Runs a command with one fault, and continues it if it did not do its work all the same.
    fn strike(&self, case: &Case, fault: Fault, at: usize) -> anyhow::Result<()> {
        self.begin(case)?;
        let mut command = self.command(case.command);
        self.library.load_into(&mut command, &self.run, fault, at)?;
        let ended = self.ended_within(&mut command, None)?;
        let is_dead = ended.code.is_none();
        // A death that did not come proves nothing.
        ensure!(is_dead == (fault == Fault::Kill), "{}", said(&ended));
        ensure!(is_dead || ended.is_done() || ended.is_refusal(), "{}", said(&ended));
        if ended.is_done() { Ok(()) } else { self.go_on(case) }
    }

    /// Continues as a user would who reads the messages.
    fn go_on(&self, case: &Case) -> anyhow::Result<()> {
        let ended = self.ended(case.go_on)?;
        if ended.is_done() || ended.stderr.contains("this run is finished") {
            return Ok(());
        }
        let is_nothing = ["nothing was begun there", "there is no such run"].iter().any(|it| ended.stderr.contains(it));
        ensure!(ended.is_refusal() && is_nothing, "continuing: {}", said(&ended));
        self.complete(case.command).context("beginning again")
    }

    /// Compares what is there with what is right.
    fn compare(&self, right: &Content) -> anyhow::Result<()> {
        if let Some(difference) = Content::read(&self.run)?.difference(right) {
            anyhow::bail!("{difference}");
        }
        let faults = if sums::exists(&self.run)? { sums::verify(&self.run).faults } else { Vec::new() };
        ensure!(faults.is_empty(), "{faults:?}");
        Ok(())
    }

    /// Keeps the folder of a failure, for whoever looks for its cause. What is given up has not failed.
    fn note(&self, case: &Case, outcome: &mut Outcome, what: &str, came: anyhow::Result<()>) -> anyhow::Result<()> {
        let Err(error) = came else { return Ok(()) };
        if (self.is_cancelled)() {
            return Err(error);
        }
        let kept = format!("{FAILURE}{}-{}", case.name.replace(' ', "-"), outcome.failures.len() + 1);
        let kept = self.folder.join(kept);
        clear(&kept)?;
        if self.run.exists() {
            fs::rename(&self.run, &kept)?;
        }
        outcome.failures.push(format!("{what}: {error:#}; see {}", kept.display()));
        ensure!(outcome.failures.len() < FAILURES_MAX, "{}", outcome.failures.join("\n"));
        Ok(())
    }

    /// The folder of the run as the command finds it.
    fn begin(&self, case: &Case) -> anyhow::Result<()> {
        clear(&self.run)?;
        case.copy_of.map_or(Ok(()), |name| copy(&self.place(name), &self.run))
    }

    fn complete(&self, words: &str) -> anyhow::Result<()> {
        let ended = self.ended(words)?;
        ensure!(ended.is_done(), "{words}: {}", said(&ended));
        Ok(())
    }

    fn ended(&self, words: &str) -> anyhow::Result<Ended> {
        self.ended_within(&mut self.command(words), None)
    }

    fn ended_within(&self, command: &mut Command, kill_after: Option<Duration>) -> anyhow::Result<Ended> {
        process::run(command, &self.folder.join("said"), kill_after, self.is_cancelled)
    }

    /// A command in words, with the folders that they name.
    fn command(&self, words: &str) -> Command {
        let names = || PREPARED.iter().map(|(name, _)| *name).chain([SMALL.0, "RUN"]);
        let with_folder = |word: &str| {
            let named = names().find_map(|name| Some((name, word.strip_prefix(name)?)));
            named.map_or_else(|| word.to_owned(), |(name, rest)| format!("{}{rest}", self.place(name).display()))
        };
        let mut command = Command::new(&self.program);
        command.current_dir(&self.folder).args(words.split_whitespace().map(with_folder));
        command
    }

    fn place(&self, name: &str) -> PathBuf {
        self.folder.join(name.to_lowercase())
    }
}

fn said(ended: &Ended) -> String {
    format!("exit code {:?}: {}", ended.code, ended.stderr.trim_end())
}

fn clear(folder: &Path) -> anyhow::Result<()> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(error).with_context(|| folder.display().to_string())
        }
        _ => Ok(()),
    }
}

fn copy(from: &Path, to: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from).with_context(|| from.display().to_string())? {
        let entry = entry?;
        let to = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy(&entry.path(), &to)?;
        } else {
            fs::copy(entry.path(), to)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    #[cfg(target_os = "linux")]
    use crate::cases::CASES;

    fn scratch(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("torture-test-{}-{name}", std::process::id()))
    }

    /// What an earlier program had prepared was tested, where a process has the number of one before it.
    #[test]
    fn no_data_of_an_earlier_program_are_tested() {
        let folder = scratch("earlier");
        fs::create_dir(&folder).unwrap();
        let refusal = Workplace::new(Path::new("/nowhere"), &folder, || false).unwrap_err().to_string();
        assert!(refusal.contains("if an earlier torture left it, delete it"), "{refusal}");
        fs::remove_dir(folder).unwrap();
    }

    /// Where there was no C compiler, the folder stayed.
    #[test]
    fn what_cannot_be_prepared_leaves_no_folder() {
        let folder = scratch("unprepared");
        Workplace::new(Path::new("/nowhere"), &folder, || false).unwrap_err();
        assert!(!folder.exists());
    }

    /// A failure of the second command replaced that of the first, which the table still named.
    #[cfg(target_os = "linux")]
    #[test]
    fn every_failure_of_every_command_is_kept_until_somebody_has_looked() {
        let folder = scratch("kept");
        let workplace = Workplace::new(&std::env::current_exe().unwrap(), &folder, || false).unwrap();
        for case in &CASES[..2] {
            let mut outcome = Outcome::default();
            for what in ["one", "two"] {
                fs::create_dir(&workplace.run).unwrap();
                fs::write(workplace.run.join("of"), format!("{} {what}", case.name)).unwrap();
                workplace.note(case, &mut outcome, what, Err(anyhow::anyhow!("it differs"))).unwrap();
            }
            for (what, failure) in ["one", "two"].iter().zip(&outcome.failures) {
                let (_, kept) = failure.rsplit_once("see ").unwrap();
                let found = fs::read_to_string(Path::new(kept).join("of")).unwrap();
                assert_eq!(found, format!("{} {what}", case.name));
            }
        }
        let first = folder.join(format!("{FAILURE}{}-1", CASES[0].name));
        assert_eq!(fs::read_to_string(first.join("of")).unwrap(), format!("{} one", CASES[0].name));
        assert!(!workplace.leave().unwrap());
        fs::remove_dir_all(folder).unwrap();
    }

    /// A command that was given up was one more failure, and its process went on.
    #[cfg(target_os = "linux")]
    #[test]
    fn what_is_cancelled_ends_with_its_process_and_leaves_no_folder() {
        let folder = scratch("cancelled");
        let workplace = Workplace::new(&std::env::current_exe().unwrap(), &folder, || true).unwrap();
        let began = std::time::Instant::now();
        let mut sleeping = Command::new("sleep");
        let refused = workplace.ended_within(sleeping.arg("100"), None).unwrap_err().to_string();
        assert!(refused.contains("not compared") && began.elapsed() < Duration::from_secs(50), "{refused}");
        let mut outcome = Outcome::default();
        workplace.note(&CASES[0], &mut outcome, "struck", Err(anyhow::anyhow!("it ended"))).unwrap_err();
        assert!(outcome.failures.is_empty());
        assert!(workplace.leave().unwrap() && !folder.exists());
    }
}
