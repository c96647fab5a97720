//! `tune`: parameters of the model-based planners.

use crate::args::{LayerArgs, OutArgs, lot_name, run_folder};
use crate::build_info;
use crate::console::Console;
use crate::interrupt;
use crate::output::Output;
use anyhow::{Context as _, ensure};
use clap::Args;
use evaluation::tune;
use experiment::inputs::{self, Inputs};
use experiment::lots::Lot;
use experiment::manifest::{Outcome, Request};
use experiment::progress::Interrupted;
use experiment::run_dir::RunDir;
use experiment::settings::{Layers, NoiseChoice, Settings, Smoothing};
use serde::{Deserialize, Serialize};
use sim::limits::DRIVES_AT_ONCE_MAX;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use std::path::{Path, PathBuf};

const COMMAND: &str = "tune";

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask tune
  cargo xtask tune --planner vvf --budget 128 --out runs/tune-vvf
  cargo xtask tune --resume runs/tune-vvf
  cargo xtask evaluate --driver vvf --driver vvf:runs/tune-default-s1/vvf.toml";

#[derive(Debug, Clone, Args)]
pub(crate) struct TuneArgs {
    /// Planners to tune, or readings of them, as in dwa/fox [default: all, each as published].
    #[arg(long = "planner", value_name = "NAME", num_args = 1.., value_delimiter = ',')]
    planners: Vec<String>,
    /// Lots to tune on: lot-a and generated training lots only. Only these flags decide what is driven, not the
    /// settings of `evaluation`.
    #[arg(long, alias = "lot", value_name = "SPEC", num_args = 1.., value_delimiter = ',', value_parser = lot_name, default_value = "lot-a,train:4")]
    lots: Vec<String>,
    /// Candidates per planner, its own parameters included.
    #[arg(long, value_name = "N", default_value_t = 48, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    budget: u32,
    /// Trials per lot and direction that every candidate drives; the best few then drive as many fresh ones.
    #[arg(long, value_name = "N", default_value_t = 1)]
    trials: u32,
    /// Seed of candidates, obstacles and noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Sensor noise.
    #[arg(long, alias = "level", value_name = "LEVEL", default_value = "paper")]
    noise: NoiseChoice,
    #[command(flatten)]
    layers: LayerArgs,
    #[command(flatten)]
    out: OutArgs,
    /// Continues an interrupted search with its own settings, to the same result.
    #[arg(
        long,
        value_name = "RUN", value_parser = run_folder(),
        conflicts_with_all = [
            "planners", "lots", "budget", "trials", "seed", "noise", "preset", "config", "overrides", "out", "overwrite"
        ]
    )]
    resume: Option<PathBuf>,
}

/// What a search was asked for besides its settings.
#[derive(Debug, Serialize, Deserialize)]
struct Asked {
    planners: Vec<String>,
    budget: u32,
}

pub(crate) fn run(args: &TuneArgs, output: &Output) -> anyhow::Result<()> {
    let (run, settings, asked) = if let Some(path) = &args.resume {
        let (run, settings, manifest) = build_info::resume(path, COMMAND, output)?;
        let asked: Asked = manifest.arguments.try_into().with_context(|| path.display().to_string())?;
        (run, settings, asked)
    } else {
        begin(args)?
    };
    interrupt::can_resume(COMMAND, run.path());
    let planners = tune::planners_named(&asked.planners)?;
    let console = Console::new(output);
    // Planners take about as long as each other.
    console.plan([("lots", 1.0)].into_iter().chain(planners.iter().map(|_| ("tuning", 120.0))).collect());
    let tuned = tune::tune(&settings, &planners, asked.budget as usize, &run, &console)?;
    if tuned.len() < planners.len() {
        let kept = format!("{} of {} planners are tuned in {}", tuned.len(), planners.len(), run.path().display());
        return Err(Interrupted { kept }.into());
    }
    let table = report::tuning::table(&tuned);
    output.table(|| format!("\n{table}"), &())?;
    run.write("tuning.md", format!("{table}\n").as_bytes())?;
    run.finish(Outcome::Tuning { planners: tuned.iter().map(|found| found.name.clone()).collect() })?;
    if let Some(first) = tuned.first() {
        let method = first.name.split('/').next().unwrap_or_default();
        let (folder, stem) = (run.path().display(), tune::file_stem(&first.name));
        output.note(format_args!("written: {folder}/*.toml; drive one with --driver {method}:{folder}/{stem}.toml"));
    }
    console.report_time();
    Ok(())
}

fn begin(args: &TuneArgs) -> anyhow::Result<(RunDir, Settings, Asked)> {
    let layers = Layers::from(&args.layers);
    let mut settings = Settings::resolve(&layers, None)?;
    // Written into the folder, so that it says what was driven.
    settings.evaluation.seed = RootSeed(args.seed);
    settings.evaluation.lots.clone_from(&args.lots);
    settings.evaluation.trials = args.trials;
    settings.evaluation.directions = Direction::BOTH.to_vec();
    settings.evaluation.noise = vec![args.noise];
    settings.evaluation.smoothing = Smoothing::Own;
    settings.check()?;
    tune::planners_named(&args.planners)?;
    let lots = Lot::parse_all(&args.lots, &settings.episode.vehicle)?;
    tune::check(&lots)?;
    let drives = 2 * lots.len() * Direction::BOTH.len() * args.trials as usize;
    ensure!(
        drives <= DRIVES_AT_ONCE_MAX,
        "--lots, --trials: {drives} drives for each planner, both ways and again for the finalists; at most {DRIVES_AT_ONCE_MAX} are possible"
    );
    let mut reads = inputs::places(&lots, &[]);
    reads.extend(args.layers.file().map(Path::to_owned));
    let asked = Asked { planners: args.planners.clone(), budget: args.budget };
    let request = Request { arguments: toml::Table::try_from(&asked)?, inputs: Inputs::default(), reads };
    let run = RunDir::create(&args.out.place(COMMAND, layers.preset_name(), args.seed), &settings, &request)?;
    Ok((run, settings, asked))
}
