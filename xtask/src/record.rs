//! `--record` of commands that drive: what they drove, replayed by the viewer program into the folder of the run.

use crate::interrupt;
use crate::output::Output;
use crate::viewer;
use anyhow::ensure;
use clap::Args;
use evaluation::plan::Plan;
use experiment::progress::Interrupted;
use experiment::replay_key::ReplayKey;
use experiment::view_request::{DriveRequest, Show, Sink, ViewRequest};
use report::pictures::file_name;
use std::path::{Path, PathBuf};

/// Runs of a driver at a noise level that are recorded at most: more than anybody looks at (chosen).
const RUNS_MAX: i64 = 100;
/// Recordings of an evaluation at most: about as many as a request to the viewer program names (chosen).
const RECORDINGS_MAX: usize = 1000;

/// `--record`.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct RecordArgs {
    /// Records the first N runs (1 to 100) of every driver and noise level for Rerun when all is done; for a training, also its
    /// learning curves and the first N episodes of every round. Builds the viewer program the first time (8 minutes).
    #[arg(
        long, value_name = "N", num_args = 0..=1, default_missing_value = "1",
        value_parser = clap::value_parser!(u32).range(1..=RUNS_MAX)
    )]
    pub(crate) record: Option<u32>,
}

/// Refuses more recordings than can be asked for, before anything is driven.
///
/// # Errors
/// Naming how many there would be.
pub(crate) fn check(plan: &Plan<'_>, runs: u32) -> anyhow::Result<()> {
    let of_each = plan.trials().take(runs as usize).count();
    let recordings = of_each * plan.drivers.len() * plan.settings.evaluation.noise.len();
    ensure!(
        recordings <= RECORDINGS_MAX,
        "--record {runs}: of so many drivers and levels of noise that makes {recordings} recordings, and at most \
         {RECORDINGS_MAX} are possible; record fewer, or single runs with cargo xtask visualise"
    );
    Ok(())
}

/// The first runs of every driver at every noise level, as in the evaluation.
pub(crate) fn first_runs(plan: &Plan<'_>, runs: u32) -> Show {
    let evaluation = &plan.settings.evaluation;
    let mut drives = Vec::new();
    for &noise in &evaluation.noise {
        for driver in plan.drivers {
            for trial in plan.trials().take(runs as usize) {
                let (lot, way, index) = (trial.lot.name(), trial.direction.name(), trial.index);
                let title = format!("{}, {noise}, {lot}, {way}, trial {index}", driver.name);
                let key = ReplayKey {
                    driver: driver.spec.clone(),
                    lot: trial.lot.spec(),
                    direction: trial.direction,
                    trial: index,
                    noise,
                    seed: evaluation.seed,
                    tick: 0,
                };
                let file = unlike_others(&file_name(&title.replace(", ", "-").replace(' ', "-")), &drives);
                drives.push(DriveRequest { file, title, keys: vec![key] });
            }
        }
    }
    Show::Drives { settings: Box::new(plan.settings.clone()), drives }
}

/// A name of a file that no other drive has: what tells two drivers apart may not be told by names of files.
fn unlike_others(file: &str, drives: &[DriveRequest]) -> String {
    let numbered = (2..).map(|k| format!("{file}-{k}"));
    let mut names = std::iter::once(file.to_owned()).chain(numbered);
    names.find(|name| drives.iter().all(|drive| drive.file != *name)).unwrap_or_else(|| file.to_owned())
}

/// Records into the folder of a run that is finished. Errors are reported and do the run no harm.
///
/// # Errors
/// On Ctrl-C.
pub(crate) fn record(run: &Path, show: Vec<Show>, output: &Output) -> anyhow::Result<()> {
    interrupt::nothing_to_continue();
    match viewer::ask(&ViewRequest { sink: Sink::Folder(recordings_of(run)), show }, output) {
        Err(error) if !error.is::<Interrupted>() => {
            output.note(format_args!("warning: {error:#}"));
            Ok(())
        }
        result => result,
    }
}

/// Where the recordings of a run are kept.
pub(crate) fn recordings_of(run: &Path) -> PathBuf {
    run.join("recordings")
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use experiment::drivers::NamedDriver;
    use experiment::lots::Lot;
    use experiment::settings::Settings;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        args: RecordArgs,
    }

    /// Of very many, an evaluation that had been driven compared every name with every other, and then the viewer program refused
    /// the request.
    #[test]
    fn more_recordings_than_can_be_made_are_refused_before_anything_is_driven() {
        let record = |runs: &str| Line::try_parse_from(["evaluate", "--record", runs]).map(|line| line.args.record);
        assert_eq!(record("100").unwrap(), Some(100));
        assert!(record("101").is_err() && record("0").is_err());

        let settings = Settings::preset("default").unwrap();
        let drivers: Vec<NamedDriver> =
            (0..11).map(|i| NamedDriver::expert(&settings.expert).renamed(&format!("driver {i}"))).collect();
        let lots = Lot::parse_all(&["test:200"], &settings.episode.vehicle).unwrap();
        let plan = Plan { settings: &settings, drivers: &drivers, lots: &lots, compare_with: 0, shard: None };
        assert!(check(&plan, 90).is_ok());
        let refused = check(&plan, 100).unwrap_err().to_string();
        assert!(refused.contains("makes 1100 recordings, and at most 1000 are possible"), "{refused}");
        let few = Plan { lots: &lots[..1], ..plan };
        assert!(check(&few, 100).is_ok(), "there are no more than ten runs");
    }

    /// The recording of `run:a-b` replaced that of `run:a/b`.
    #[test]
    fn drivers_whose_names_differ_by_a_slash_have_recordings_of_their_own() {
        let mut drives: Vec<DriveRequest> = Vec::new();
        for title in ["run:a/b, lot-b", "run:a-b, lot-b", "run:a b, lot-b"] {
            let file = unlike_others(&file_name(title), &drives);
            drives.push(DriveRequest { file, title: title.to_owned(), keys: Vec::new() });
        }
        let files: Vec<&str> = drives.iter().map(|drive| &*drive.file).collect();
        assert_eq!(files, ["run-a-b--lot-b", "run-a-b--lot-b-2", "run-a-b--lot-b-3"]);
    }
}
