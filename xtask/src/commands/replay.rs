//! `replay`: drives runs again, and says whether they are the same.

use super::evaluate;
use crate::args::{JsonArgs, LayerArgs};
use crate::console::Console;
use crate::output::{Output, note};
use anyhow::{Context as _, ensure};
use clap::{ArgGroup, Args};
use evaluation::records::{self, RunRecord};
use experiment::drive::Replay;
use experiment::drivers::NamedDriver;
use experiment::progress::{Interrupted, Progress as _};
use experiment::replay_key::ReplayKey;
use experiment::run_dir;
use experiment::settings::{Layers, Settings};
use experiment::trained;
use report::replays::{self, Row};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask replay expert@lot-b@reverse@3@paper@1@0                the result of a run, and its digest
  cargo xtask replay --of runs/evaluate-default-s1                   16 of its runs: whether each is the same here, bit for bit
  cargo xtask replay --of runs/evaluate-default-s1 expert@lot-b@reverse@3@paper@1@842

To look at a run: cargo xtask visualise replay KEY, or cargo xtask render animation KEY";

#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("runs").args(["keys", "of"]).required(true).multiple(true))]
pub(crate) struct ReplayArgs {
    /// `DRIVER@LOT@WAY@TRIAL@NOISE@SEED@TICK`, from `runs.jsonl`, `failures.jsonl` or `failures.md`; the whole run is driven,
    /// whatever its tick.
    #[arg(value_name = "KEY")]
    keys: Vec<ReplayKey>,
    /// Folder of the evaluation that the keys come from: its settings are used, and its digests compared.
    #[arg(long, alias = "run", value_name = "RUN", conflicts_with_all = ["preset", "config", "overrides"])]
    of: Option<PathBuf>,
    /// Number of runs of `--of` to drive, spread over all of them, unless keys are named.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 16,
        value_parser = clap::value_parser!(u32).range(1..),
        conflicts_with = "keys",
        requires = "of"
    )]
    sample: u32,
    #[command(flatten)]
    pub(crate) json: JsonArgs,
    #[command(flatten)]
    layers: LayerArgs,
}

/// A run as an evaluation recorded it.
struct Recorded {
    sha256: String,
    near_collisions: u32,
    driven_m: f32,
}

pub(crate) fn run(args: &ReplayArgs, output: &Output) -> anyhow::Result<()> {
    let (settings, keys, recorded) = if let Some(folder) = &args.of {
        of_evaluation(folder, args)?
    } else {
        let specs: Vec<_> = args.keys.iter().map(|key| key.driver.clone()).collect();
        let (settings, _) = evaluate::settings_for(&specs, &Layers::from(&args.layers), output)?;
        (settings, args.keys.clone(), BTreeMap::new())
    };
    let mut drivers: BTreeMap<String, NamedDriver> = BTreeMap::new();
    for key in &keys {
        if let Entry::Vacant(entry) = drivers.entry(key.driver.to_string()) {
            let driver = key.driver.clone().load(&settings);
            // Keys of a folder are as it was made.
            let driver = driver
                .with_context(|| args.of.as_deref().map_or_else(|| key.to_string(), run_dir::paths_are_as_made))?;
            entry.insert(driver).check(&settings)?;
        }
    }
    let console = Console::new(output);
    console.begin("replay", "driving again");
    let (mut rows, mut differing) = (Vec::new(), 0);
    for (index, key) in keys.iter().enumerate() {
        if console.is_cancelled() {
            return Err(Interrupted { kept: "nothing is written".to_owned() }.into());
        }
        console.at(index as f64 / keys.len() as f64, &mut |_| key.to_string());
        let replay = Replay::new(key, &settings.episode)?;
        let (report, sha256) = replay.again(&settings.episode, &drivers[&key.driver.to_string()])?;
        let recorded = recorded.get(&key.to_string());
        if let Some(recorded) = recorded.filter(|recorded| recorded.sha256 != sha256) {
            differing += 1;
            note(format_args!(
                "{key}: {} near-collisions in {:.3} m were recorded, with digest {}",
                recorded.near_collisions, recorded.driven_m, recorded.sha256
            ));
        }
        let is_same = recorded.map(|recorded| recorded.sha256 == sha256);
        let (key, lot) = (key.clone(), replay.lot.name().to_owned());
        rows.push(Row { key, lot, metrics: report.metrics, sha256, is_same });
    }
    console.end(&format!("{} runs", rows.len()));
    output.table(|| replays::table(&rows).to_string(), &rows)?;
    ensure!(
        differing == 0,
        "{differing} of {} runs are not what was recorded: this program, its machine or a file that it read differs from \
         those of manifest.toml",
        rows.len()
    );
    Ok(())
}

/// The settings of an evaluation, the keys to drive, and what it recorded by key.
fn of_evaluation(
    folder: &Path,
    args: &ReplayArgs,
) -> anyhow::Result<(Settings, Vec<ReplayKey>, BTreeMap<String, Recorded>)> {
    let settings = trained::settings_of(folder)?;
    let file = records::of_finished(folder, records::RUNS)?;
    // Twice through the file: it may be longer than memory is large.
    let mut runs = 0;
    if args.keys.is_empty() {
        records::each_line(&file, |_: RunRecord| {
            runs += 1;
            Ok(())
        })?;
    }
    let count = runs.min(args.sample as usize);
    let sample: BTreeSet<usize> = (0..count).map(|index| index * runs / count).collect();
    let named: Vec<ReplayKey> = args.keys.iter().map(|key| ReplayKey { tick: 0, ..key.clone() }).collect();
    let names: BTreeSet<String> = named.iter().map(ReplayKey::to_string).collect();
    let (mut index, mut sampled, mut recorded) = (0, Vec::new(), BTreeMap::new());
    records::each_line(&file, |run: RunRecord| {
        if sample.contains(&index) {
            sampled.push(run.replay.clone());
        }
        if sample.contains(&index) || names.contains(&run.replay) {
            let metrics = &run.report.metrics;
            let of_run =
                Recorded { sha256: run.sha256, near_collisions: metrics.near_collisions, driven_m: metrics.driven_m };
            recorded.insert(run.replay, of_run);
        }
        index += 1;
        Ok(())
    })?;
    let parsed = |key: &String| {
        key.parse::<ReplayKey>().with_context(|| format!("{}: a run cannot be driven from here", file.display()))
    };
    let keys = if named.is_empty() { sampled.iter().map(parsed).collect::<anyhow::Result<_>>()? } else { named };
    for key in &keys {
        recorded.get(&key.to_string()).with_context(|| format!("{key}: {} has no such run", file.display()))?;
    }
    Ok((settings, keys, recorded))
}
