//! The lines that an evaluation leaves: one type per file, written and read.

use crate::incidents::{Cause, Findings};
use anyhow::{Context as _, ensure};
use experiment::manifest;
use experiment::replay_key::ReplayKey;
use experiment::settings::NoiseChoice;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sim::episode::EpisodeReport;
use sim::frame::Ending;
use sim::limits::{RECORD_BYTES_MAX, RUN_LINES_BYTES_MAX};
use sim::scenario::Direction;
use std::io::{BufRead as _, BufReader, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};
use storage::sums;

/// The version of `runs.jsonl`, `failures.jsonl` and `wall_time.jsonl` that this program writes.
pub const SCHEMA: u32 = 2;
/// Names of the files.
pub const RUNS: &str = "runs.jsonl";
/// See [`RUNS`].
pub const FAILURES: &str = "failures.jsonl";
/// See [`RUNS`].
pub const WALL_TIME: &str = "wall_time.jsonl";

/// The path of a file of a finished evaluation, or of what a training ended with.
///
/// # Errors
/// If the folder holds none.
pub fn of_finished(folder: &Path, file: &str) -> anyhow::Result<PathBuf> {
    ensure!(
        manifest::has_file(folder, file)?,
        "{}: holds no finished evaluation; name the folder of one (cargo xtask evaluate), or of a training that ended with \
         its check",
        folder.display()
    );
    Ok(folder.join(file))
}

/// Who drove where: what all lines begin with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordHeader {
    /// Version of the format: [`SCHEMA`].
    pub schema: u32,
    /// Who drove, as named in tables.
    pub driver: String,
    /// The lot.
    pub lot: String,
    /// The direction of the drive.
    pub direction: Direction,
    /// Which trial of the lot, from 0.
    pub trial: u32,
    /// Sensor noise.
    pub noise: NoiseChoice,
}

/// One run, as a line of `runs.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// Who drove where.
    #[serde(flatten)]
    pub header: RecordHeader,
    /// Whether it was ended by the time limit.
    pub timed_out: bool,
    /// Driven way per simulated time, m/s.
    pub mean_speed_mps: f32,
    /// Replays it: [`ReplayKey`].
    pub replay: String,
    /// Digest of everything seen, decided and driven: [`DriveDigest`](experiment::drive_digest::DriveDigest).
    pub sha256: String,
    /// How it ended, its metrics and its events.
    #[serde(flatten)]
    pub report: EpisodeReport,
}

impl RunRecord {
    /// The line of a finished run.
    pub fn new(header: RecordHeader, replay: &ReplayKey, sha256: &str, report: &EpisodeReport) -> Self {
        Self {
            header,
            timed_out: report.ending == Ending::TimedOut,
            mean_speed_mps: report.metrics.mean_speed_mps(),
            replay: replay.to_string(),
            sha256: sha256.to_owned(),
            report: report.clone(),
        }
    }
}

/// A near-collision, as a line of `failures.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FailureRecord {
    /// Who drove where.
    #[serde(flatten)]
    pub header: RecordHeader,
    /// The control tick, from 0.
    pub tick: u32,
    /// Where along the route, metres.
    pub route_m: f32,
    /// Rear axle in the world, metres.
    pub x_m: f32,
    /// Rear axle in the world, metres.
    pub y_m: f32,
    /// Heading in the world, degrees, counter-clockwise from x.
    pub heading_deg: f32,
    /// Speed at the last observation, m/s.
    pub speed_mps: f32,
    /// Its cause.
    pub cause: Cause,
    /// What the rules found.
    #[serde(flatten)]
    pub findings: Findings,
    /// Replays it: [`ReplayKey`].
    pub replay: String,
}

/// What a run took, as a line of `wall_time.jsonl`: apart, because everything else is the same in every repetition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WallTimeRecord {
    /// Who drove where.
    #[serde(flatten)]
    pub header: RecordHeader,
    /// Seconds: the run's share, by decisions, of what its batch took in lock-step.
    pub wall_s: f64,
}

/// Reads a finished file line by line; no more than a line is held.
///
/// # Errors
/// If it is missing, damaged or of another version, or `take` refuses a line.
pub fn each_line<T: DeserializeOwned>(path: &Path, take: impl FnMut(T) -> anyhow::Result<()>) -> anyhow::Result<()> {
    each_line_of(path, sums::open(path, RUN_LINES_BYTES_MAX)?, take)
}

/// Reads the lines of a file; `path` is for errors.
///
/// # Errors
/// If it is of another version, or `take` refuses a line.
pub fn each_line_of<T: DeserializeOwned>(
    path: &Path,
    lines: impl Read,
    mut take: impl FnMut(T) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    each_line_at(path, lines, |_, line| take(line))
}

/// [`each_line_of`], with the bytes of the file that the line takes, its end included.
///
/// # Errors
/// If it is of another version, or `take` refuses a line.
pub fn each_line_at<T: DeserializeOwned>(
    path: &Path,
    lines: impl Read,
    mut take: impl FnMut(Range<u64>, T) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut lines = BufReader::new(lines);
    let mut line = Vec::new();
    let mut from = 0;
    for number in 1.. {
        line.clear();
        let read = lines.by_ref().take(RECORD_BYTES_MAX + 1).read_until(b'\n', &mut line);
        if read.with_context(|| path.display().to_string())? == 0 {
            break;
        }
        let to = from + line.len() as u64;
        parse(&line).and_then(|found| take(from..to, found)).with_context(|| {
            format!("{}:{number}: not of this evaluation; drive it again into another folder", path.display())
        })?;
        from = to;
    }
    Ok(())
}

fn parse<T: DeserializeOwned>(line: &[u8]) -> anyhow::Result<T> {
    #[derive(Deserialize)]
    struct Version {
        #[serde(default)]
        schema: u32,
    }
    ensure!(line.len() as u64 <= RECORD_BYTES_MAX, "the line has more than {RECORD_BYTES_MAX} bytes");
    let Version { schema } = serde_json::from_slice(line)?;
    ensure!(schema == SCHEMA, "written by another version of lotpilot (schema {schema}, this one reads {SCHEMA})");
    Ok(serde_json::from_slice(line)?)
}

#[cfg(test)]
mod tests {
    /// One level of noise in seven came back with another last bit, and a begun evaluation at it was refused.
    #[test]
    fn numbers_are_read_back_as_they_were_written() {
        for level in (1..60).flat_map(|n| (1..60).map(move |of| f64::from(n) / f64::from(of))) {
            let read: f64 = serde_json::from_str(&serde_json::to_string(&level).unwrap()).unwrap();
            assert_eq!(read.to_bits(), level.to_bits(), "{level}");
        }
    }
}
