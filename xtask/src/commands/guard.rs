//! `guard`: does the claim still hold? Trains the default and fails if its policy has become worse. For a nightly run.

use super::{train, within};
use crate::args::OutArgs;
use crate::console::Console;
use crate::output::Output;
use anyhow::{Context as _, ensure};
use clap::Args;
use evaluation::estimate;
use evaluation::format::exact_rate;
use evaluation::totals::Totals;
use experiment::drivers::{DriverSpec, NamedDriver};
use experiment::progress::Interrupted;
use experiment::run_dir::RunDir;
use experiment::settings::{EvaluationSettings, Settings};
use serde::Deserialize;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask guard                       train, drive, compare: about 12 minutes on two cores
  cargo xtask guard --out runs/nightly --overwrite";

/// What the policy did when it was last recorded.
const RECORD: &str = include_str!("guard.toml");

#[derive(Debug, Clone, Args)]
pub(crate) struct GuardArgs {
    #[command(flatten)]
    out: OutArgs,
}

/// `guard.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    /// Development lots: neither trained on nor test lots.
    lots: Vec<String>,
    /// Upper end of the interval of the recorded rate, near-collisions per 100 m.
    upper_per_100m: f64,
    /// Commit, command and figures of the record.
    #[expect(dead_code, reason = "for people")]
    recorded: String,
}

pub(crate) fn run(args: &GuardArgs, output: &Output) -> anyhow::Result<()> {
    let record: Record = toml::from_str(RECORD).context("guard.toml")?;
    let settings = Settings::preset("default")?;
    let development = Settings {
        evaluation: EvaluationSettings { lots: record.lots, trials: 1, ..settings.evaluation.clone() },
        ..settings.clone()
    };
    let console = Console::new(output);
    let driving = [&settings, &development].map(|settings| estimate::evaluation(settings, 1));
    console.plan(estimate::training(&settings, true).into_iter().chain(driving).collect());
    let run = RunDir::create(&args.out.place("guard", "default", settings.seed.0), &settings)?;
    output.note(format_args!("run: {}", run.path().display()));
    let interrupted = || Interrupted { kept: format!("what was done is in {}", run.path().display()) };
    let Ok((policy, outcome)) = train::tabulated(&settings, &run, &console, output)? else {
        return Err(interrupted().into());
    };
    let driver = NamedDriver::network(
        "DAgger",
        DriverSpec::Run { folder: run.path().to_owned() },
        policy,
        settings.dagger.device,
    );
    let drivers = [driver];
    let drive = |settings: &Settings, folder: &str| -> anyhow::Result<Totals> {
        let results = within::evaluate(&run, folder, settings, &drivers, &console)?;
        let all = results.slices().pop().context("nothing was driven")?;
        Ok(results.totals(0, 0, &all, None))
    };
    let reference = drive(&settings, "reference")?;
    let development = drive(&development, "development")?;
    for (place, totals) in [("the three lots", &reference), ("development lots", &development)] {
        output.print(format_args!(
            "{place}: near-collisions {} in {:.0} m, per 100 m {}; contacts {}",
            totals.near_collisions,
            totals.reference_m,
            exact_rate(totals.near_collisions, totals.reference_m),
            totals.contacts
        ));
    }
    run.finish(outcome)?;
    ensure!(
        reference.near_collisions == 0,
        "the default policy has near-collisions on the three lots; see {}/reference",
        run.path().display()
    );
    let rate = development.rate().per_unit;
    ensure!(
        rate <= record.upper_per_100m,
        "on development lots the rate {rate:.3} per 100 m lies above the recorded interval, which ends at {}; see \
         {}/development. If the change is meant, record the new figures in xtask/src/commands/guard.toml",
        record.upper_per_100m,
        run.path().display()
    );
    output.print("as good as recorded");
    Ok(())
}
