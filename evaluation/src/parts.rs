//! Rows of parts of an evaluation in the order of the whole: the bytes that one command would have written.

use crate::evaluate::{BATCH, DRIVING, FILES};
use crate::plan::Plan;
use crate::read::{Place, Places};
use crate::records::{self, RecordHeader};
use anyhow::{Context as _, ensure};
use experiment::run_dir::RunDir;
use experiment::trials::Trial;
use serde::Deserialize;
use sim::limits::RUN_LINES_BYTES_MAX;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use storage::growing::{self, Growing};
use storage::sums;

/// A trial in words: `LOT@DIRECTION@TRIAL`.
pub(crate) fn key(trial: &Trial<'_>) -> String {
    format!("{}@{}@{}", trial.lot.name(), trial.direction.name(), trial.index)
}

/// What says where a line belongs.
#[derive(Deserialize)]
struct Keyed {
    #[serde(flatten)]
    header: RecordHeader,
    /// Of a wall time there is none.
    replay: Option<String>,
}

/// What was driven of a whole: some of its trials, or all of them by some of its drivers.
pub(crate) struct Part<'a> {
    pub(crate) folder: &'a Path,
    pub(crate) plan: Plan<'a>,
}

impl Part<'_> {
    /// Where the lines of a file are, with their places in the whole plan; `own`: the places in that of the part.
    fn rows(&self, name: &str, own: &Places<'_>, places: &Places<'_>) -> anyhow::Result<Vec<(Place, Range<u64>)>> {
        let path = self.folder.join(name);
        let mut rows = Vec::new();
        let mut seen = BTreeSet::new();
        let lines = sums::open(&path, RUN_LINES_BYTES_MAX)?;
        records::each_line_at(&path, lines, |bytes, Keyed { header, replay }| {
            let place = replay.map_or_else(|| own.of(&header), |replay| own.of_drive(&header, &replay))?;
            let is_new = seen.insert(place);
            ensure!(is_new || name == records::FAILURES, "there twice");
            rows.push((places.of(&header)?, bytes));
            Ok(())
        })?;
        if name != records::FAILURES {
            let levels = self.plan.settings.evaluation.noise.iter().enumerate();
            for (level, noise) in levels {
                for (driver, named) in self.plan.drivers.iter().enumerate() {
                    let missing = (0..own.trials.len()).find(|&trial| !seen.contains(&Place { level, driver, trial }));
                    if let Some(trial) = missing {
                        anyhow::bail!(
                            "{}: lacks {} by {} at noise {noise}; drive it again into another folder",
                            path.display(),
                            key(&own.trials[trial]),
                            named.name
                        );
                    }
                }
            }
        }
        Ok(rows)
    }
}

/// The lines of an evaluation, as one command would have written them: where they are, so that no more than a batch of them
/// is ever held.
#[derive(Debug)]
pub struct Rows([RowsOfFile; FILES.len()]);

/// Those of one file.
#[derive(Debug)]
struct RowsOfFile {
    /// The file of each part.
    files: Vec<PathBuf>,
    /// In the order of the whole.
    rows: Vec<Row>,
}

#[derive(Debug)]
struct Row {
    place: Place,
    part: usize,
    bytes: Range<u64>,
}

impl Row {
    /// What an evaluation drives, and writes, at once: a batch of trials, by one driver at one noise level.
    fn drive(&self) -> (usize, usize, usize) {
        (self.place.trial / BATCH, self.place.level, self.place.driver)
    }
}

impl Rows {
    /// Those of the parts of a plan, which are all of it.
    ///
    /// # Errors
    /// If a file is missing or damaged, or a row is missing, there twice, or of another part or plan.
    pub(crate) fn of(parts: &[Part<'_>], plan: &Plan<'_>) -> anyhow::Result<Self> {
        let places = Places::new(plan);
        let mut of_files = FILES.map(|name| {
            let files = parts.iter().map(|part| part.folder.join(name)).collect();
            RowsOfFile { files, rows: Vec::new() }
        });
        for (index, part) in parts.iter().enumerate() {
            // Of many trials it is large: no two parts have one at once.
            let own = Places::new(&part.plan);
            for (name, of_file) in FILES.into_iter().zip(&mut of_files) {
                let found = part.rows(name, &own, &places)?.into_iter();
                of_file.rows.extend(found.map(|(place, bytes)| Row { place, part: index, bytes }));
            }
        }
        for RowsOfFile { rows, .. } in &mut of_files {
            // Stable: the near-collisions of a run stay in their order.
            rows.sort_by_key(|row| (row.drive(), row.place));
        }
        Ok(Self(of_files))
    }

    /// Writes them into the folder of a run as an evaluation would, which can go on where this was stopped.
    ///
    /// # Errors
    /// If a file cannot be read or written.
    pub fn write(&self, run: &RunDir) -> anyhow::Result<()> {
        if sums::is_listed(run.path(), records::RUNS)? {
            return Ok(growing::clear(run.path(), DRIVING)?);
        }
        // What was begun there may be of another commit.
        let mut lines = Growing::begin(run.path(), DRIVING, &run.identity()?, &FILES)?;
        let mut readers = self.0.each_ref().map(Reader::new);
        let [runs, ..] = &self.0;
        for of_drive in runs.rows.chunk_by(|row, next| row.drive() == next.drive()) {
            let drive = of_drive[0].drive();
            let texts = readers.iter_mut().map(|reader| reader.next(drive)).collect::<anyhow::Result<Vec<_>>>()?;
            run.ensure_held()?;
            lines.add(&texts)?;
        }
        Ok(lines.finish()?)
    }
}

/// Reads the rows of a file in their order.
struct Reader<'a> {
    of: &'a RowsOfFile,
    at: usize,
    /// Files that are open, by part: there may be more parts than a process may have files.
    open: BTreeMap<usize, File>,
}

/// Files that a [`Reader`] has open at most.
const OPEN_MAX: usize = 64;

impl<'a> Reader<'a> {
    fn new(of: &'a RowsOfFile) -> Self {
        Self { of, at: 0, open: BTreeMap::new() }
    }

    /// The rows of a drive, which is the next one.
    fn next(&mut self, drive: (usize, usize, usize)) -> anyhow::Result<Vec<u8>> {
        let RowsOfFile { files, rows } = self.of;
        let mut text = Vec::new();
        while let Some(row) = rows.get(self.at).filter(|row| row.drive() == drive) {
            let path = &files[row.part];
            if !self.open.contains_key(&row.part) && self.open.len() == OPEN_MAX {
                self.open.clear();
            }
            let file = match self.open.entry(row.part) {
                Entry::Occupied(open) => open.into_mut(),
                Entry::Vacant(place) => place.insert(File::open(path).with_context(|| path.display().to_string())?),
            };
            let count = row.bytes.end - row.bytes.start;
            let read = file.seek(SeekFrom::Start(row.bytes.start));
            let read = read
                .and_then(|_| file.take(count).read_to_end(&mut text))
                .with_context(|| path.display().to_string())?;
            ensure!(read as u64 == count, "{}: became shorter while it was read; begin again", path.display());
            self.at += 1;
        }
        Ok(text)
    }
}
