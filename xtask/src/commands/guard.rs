//! `guard`: does the claim still hold? Trains the default and fails if its policy has become worse. For a nightly run.

use super::{train, within};
use crate::args::{OutArgs, run_folder};
use crate::build_info;
use crate::console::Console;
use crate::interrupt;
use crate::output::Output;
use anyhow::{Context as _, ensure};
use clap::Args;
use evaluation::estimate;
use evaluation::format::exact_rate;
use evaluation::names::DAGGER;
use evaluation::totals::Totals;
use experiment::drivers::DriverSpec;
use experiment::manifest::{self, Request};
use experiment::progress::Interrupted;
use experiment::run_dir::RunDir;
use experiment::settings::{EvaluationSettings, Settings};
use serde::Deserialize;
use std::path::PathBuf;

const COMMAND: &str = "guard";

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask guard                       train, drive, compare: some twenty minutes on two cores
  cargo xtask guard --out runs/nightly --overwrite

The limits stand in xtask/src/commands/guard.toml, with the commit that they were recorded at, and how.";

/// What the policy did when it was last recorded.
const RECORD: &str = include_str!("guard.toml");

#[derive(Debug, Clone, Args)]
pub(crate) struct GuardArgs {
    #[command(flatten)]
    out: OutArgs,
    /// Continues an interrupted run.
    #[arg(long, value_name = "RUN", value_parser = run_folder(), conflicts_with_all = ["out", "overwrite"])]
    resume: Option<PathBuf>,
}

/// `guard.toml`: places with what the policy did there.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    place: Vec<RecordedPlace>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RecordedPlace {
    /// Name of its folder within the run.
    name: String,
    /// Lots that were not trained on, or obstacles that were not; no sealed ones.
    lots: Vec<String>,
    /// Trials per lot and direction.
    trials: u32,
    /// Upper end of the interval of the recorded rate, near-collisions per 100 m.
    upper_per_100m: f64,
    /// Commit, command and figures of the record.
    #[expect(dead_code, reason = "for people")]
    recorded: String,
}

impl RecordedPlace {
    fn settings(&self, settings: &Settings) -> Settings {
        let (lots, trials) = (self.lots.clone(), self.trials);
        let evaluation = EvaluationSettings { lots, trials, ..settings.evaluation.clone() };
        Settings { evaluation, ..settings.clone() }
    }
}

pub(crate) fn run(args: &GuardArgs, output: &Output) -> anyhow::Result<()> {
    let record: Record = toml::from_str(RECORD).context("guard.toml")?;
    let settings = Settings::preset("default")?;
    let run = if let Some(path) = &args.resume {
        let (run, begun_with, _) = build_info::resume(path, COMMAND, output)?;
        ensure!(begun_with == settings, "{}: the default settings have changed since; begin again", path.display());
        run
    } else {
        RunDir::create(&args.out.place(COMMAND, "default", settings.seed.0), &settings, &Request::default())?
    };
    interrupt::can_resume(COMMAND, run.path());
    output.note(format_args!("run: {}", run.path().display()));
    let console = Console::new(output);
    let mut tasks = estimate::rest_of_training(&settings, true, run.path());
    for place in &record.place {
        if !manifest::is_finished(&run.path().join(&place.name))? {
            tasks.push(estimate::evaluation(&place.settings(&settings), 1));
        }
    }
    console.plan(tasks);
    let interrupted = || Interrupted { kept: format!("what was done is in {}", run.path().display()) };
    let Ok(outcome) = train::tabulated(&settings, &run, &console, output)? else {
        return Err(interrupted().into());
    };
    let drivers = [DriverSpec::Run { folder: run.path().to_owned() }.load(&settings)?.renamed(DAGGER)];
    let mut worse = Vec::new();
    for place in &record.place {
        let results = within::evaluate(&run, &place.name, &place.settings(&settings), &drivers, &console)?;
        let all = results.slices().pop().context("nothing was driven")?;
        let Totals { near_collisions, reference_m, contacts, .. } = results.totals(0, 0, &all, None);
        let rate = exact_rate(near_collisions, reference_m);
        output.print(format_args!(
            "{}: near-collisions {near_collisions} in {reference_m:.0} m, per 100 m {rate}; contacts {contacts}",
            place.name
        ));
        if 100.0 * f64::from(near_collisions) / reference_m > place.upper_per_100m {
            worse.push(format!("{} ({rate}, recorded up to {})", place.name, place.upper_per_100m));
        }
    }
    run.finish(outcome)?;
    ensure!(
        worse.is_empty(),
        "more near-collisions per 100 m than recorded: {}; see {}. If the change is meant, record the new figures in \
         xtask/src/commands/guard.toml, as it says there",
        worse.join(", "),
        run.path().display()
    );
    output.print("as good as recorded");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slip in `guard.toml` was found by the nightly run alone.
    #[test]
    fn the_record_can_be_driven_and_names_no_sealed_lot() {
        let record: Record = toml::from_str(RECORD).unwrap();
        let default = Settings::preset("default").unwrap();
        assert!(!record.place.is_empty());
        for place in &record.place {
            place.settings(&default).check().unwrap_or_else(|error| panic!("{}: {error:#}", place.name));
            assert!(place.upper_per_100m > 0.0, "{}", place.name);
            assert!(place.lots.iter().all(|lot| !lot.starts_with("sealed")), "{}: {:?}", place.name, place.lots);
        }
    }
}
