//! `evaluate`: trials driven by a network, incidents explained, tables made.

use crate::{Effort, Goal, NETWORK, Report, on_threads, ratio, time};
use anyhow::Context as _;
use evaluation::evaluate::evaluate;
use evaluation::plan::Plan;
use evaluation::summary::Summary;
use experiment::drivers::DriverSpec;
use experiment::lots::Lot;
use experiment::manifest::{Build, Request};
use experiment::progress::Silent;
use experiment::run_dir::{Place, RunDir};
use experiment::settings::Settings;
use std::path::Path;

/// Measures the default evaluation of a network on the three reference lots, on one thread and on two: everything that
/// `cargo xtask evaluate` does but the report.
///
/// # Errors
/// If a lot cannot be driven or the folder for temporary files cannot be written.
pub fn figures(effort: Effort, report: Report<'_>) -> anyhow::Result<()> {
    let folder = std::env::temp_dir().join(format!("lotpilot-bench-{}", std::process::id()));
    let measured = measure(effort, report, &folder);
    // Whether it worked or not; that it cannot be removed is nobody's error.
    std::fs::remove_dir_all(&folder).ok();
    measured
}

fn measure(effort: Effort, report: Report<'_>, folder: &Path) -> anyhow::Result<()> {
    let settings = Settings::preset("default")?;
    let network = NETWORK.parse::<DriverSpec>()?.load(&settings)?;
    let lots = Lot::parse_all(&["lot-a", "lot-b", "lot-c"], &settings.episode.vehicle)?;
    let plan = Plan { settings: &settings, drivers: &[network], lots: &lots, compare_with: 0, shard: None };
    let once = || {
        let run = create(&folder.join("evaluated"), &settings)?;
        let results = evaluate(&plan, &run, &Silent)?.context("nothing cancels it")?;
        Summary::new(&plan, &results).write(&run)
    };
    let on = |threads: usize, what: &str| {
        on_threads(threads, || {
            let mut outcome = Ok(());
            let figure = time(effort, what, ("s", 1.0), None, || {
                // The first error counts, whatever comes after it.
                if outcome.is_ok() {
                    outcome = once();
                }
            });
            outcome.map(|()| figure)
        })
    };
    let one = on(1, "evaluate, network on three lots, 30 runs, one thread")?;
    let two = on(2, "the same on two threads")?;
    let gain = ratio("evaluate, one thread over two", &one, &two, Goal::AtLeast(1.7));
    [one, two, gain].into_iter().for_each(report);
    Ok(())
}

fn create(folder: &Path, settings: &Settings) -> anyhow::Result<RunDir> {
    let build = Build::default();
    let place =
        Place { build: &build, out: Some(folder), overwrite: true, command: "bench", preset: "default", seed: 1 };
    RunDir::create(&place, settings, &Request::default())
}
