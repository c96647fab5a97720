//! The command line, nothing else.

mod render;

pub use render::{
    ColourChoice, RenderArgs, RenderLotArgs, RenderNoiseArgs, RenderReportArgs, RenderWhat, SamplesArgs,
    TrajectoriesArgs, Way,
};

use crate::settings::NoiseChoice;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// Learns to drive through parking lots, and measures how well.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", after_help = EXAMPLES)]
pub struct Cli {
    /// Threads to compute with [default: all cores]. Changes nothing but the time it takes.
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask train-dagger                       train, print the paper's table, check on three lots
  cargo xtask train-dagger --preset smoke        the same line end to end in seconds
  cargo xtask evaluate --driver expert --driver run:runs/train-dagger-default-s1
  cargo xtask settings --preset paper            every setting there is
  cargo xtask generate --lots lot-a --out lots   TOML and a picture";

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Behaviour cloning: the expert drives once, a network learns from it.
    #[command(after_help = TRAIN_EXAMPLES)]
    TrainBc(TrainArgs),
    /// Behaviour cloning, then `DAgger`; ends with the paper's table and a closed-loop check on three lots.
    #[command(after_help = TRAIN_EXAMPLES)]
    TrainDagger(TrainArgs),
    /// Drives drivers over lots and counts near-collisions and the safe ratio.
    #[command(after_help = EVALUATE_EXAMPLES)]
    Evaluate(EvaluateArgs),
    /// The paper in a box: trains, drives and writes one report with the paper's tables beside ours.
    #[command(after_help = REPRODUCE_EXAMPLES)]
    Reproduce(ReproduceArgs),
    /// Writes lots as TOML plus a top-view PNG.
    #[command(after_help = GENERATE_EXAMPLES)]
    Generate(GenerateArgs),
    /// How many pixels of the perceived bird's-eye view are right.
    PixelAccuracy(PixelAccuracyArgs),
    /// How far must be driven to see a difference in near-collisions, or to bound their rate.
    #[command(after_help = METRES_EXAMPLES)]
    Metres(MetresArgs),
    /// Prints the resolved settings as TOML.
    Settings(SettingsArgs),
    /// Lists the lots that can be named.
    Lots,
    /// Lists the drivers that can be named, or prints the parameters of one planner as a file.
    Drivers(DriversArgs),
    /// Records lots, drives and near-collisions, to be looked at in Rerun's viewer.
    #[command(after_help = VISUALISE_EXAMPLES)]
    Visualise(VisualiseArgs),
    /// Searches parameters of the model-based planners on lot a and training lots, the same way for each.
    #[command(after_help = TUNE_EXAMPLES)]
    Tune(TuneArgs),
    /// Draws lots, drives, samples and noise as PNG and SVG.
    #[command(after_help = render::EXAMPLES)]
    Render(RenderArgs),
}

/// Where settings come from, lowest priority first: preset, file, `--set`, then the flags of the command.
#[derive(Debug, Clone, Default, Args)]
pub struct LayerArgs {
    /// Named set of settings to start from [default: default].
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
    /// TOML file with the settings to change; the rest stays as in the preset.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Changes one setting, e.g. `dagger.eta=0.8`; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
}

impl LayerArgs {
    /// The preset that is meant where none is named.
    pub fn preset_name(&self) -> &str {
        self.preset.as_deref().unwrap_or("default")
    }
}

/// Settings and their root seed.
#[derive(Debug, Clone, Default, Args)]
pub struct SettingsArgs {
    /// Layers.
    #[command(flatten)]
    pub layers: LayerArgs,
    /// Root seed of training data, weights and shuffling.
    #[arg(long)]
    pub seed: Option<u64>,
}

const TRAIN_EXAMPLES: &str = "\
Examples:
  cargo xtask train-dagger --seed 2
  cargo xtask train-dagger --set dagger.eta=0.85 --set dagger.fit_iteration.budget.steps=2000
  cargo xtask train-dagger --set training.lots='[\"lot-a\", \"lot-c\"]' --no-eval
  cargo xtask train-dagger --resume runs/train-dagger-default-s1";

/// Arguments of the training commands.
#[derive(Debug, Clone, Default, Args)]
pub struct TrainArgs {
    /// Settings.
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// Folder of the run [default: runs/COMMAND-PRESET-sSEED, the next free one].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Deletes what an earlier run left in `--out`.
    #[arg(long, requires = "out")]
    pub overwrite: bool,
    /// Continues an interrupted run with its own settings, to the same result.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["preset", "config", "overrides", "seed", "out"])]
    pub resume: Option<PathBuf>,
    /// Records the learning curves, the first N runs of every round and of every driver of the check at the end for
    /// Rerun's viewer, into the folder of the run.
    #[arg(long, value_name = "N", num_args = 0..=1, default_missing_value = "1")]
    pub record: Option<usize>,
    /// Trains only: no closed-loop check at the end.
    #[arg(long)]
    pub no_eval: bool,
}

const EVALUATE_EXAMPLES: &str = "\
Examples:
  cargo xtask evaluate --driver expert --lots lot-a --trials 2
  cargo xtask evaluate --driver run:runs/train-dagger-default-s1/bc --driver run:runs/train-dagger-default-s1
  cargo xtask evaluate --driver net:runs/train-dagger-default-s1/round-03 --lots lot-b --noise hard --out runs/hard
  cargo xtask evaluate --driver expert --driver run:runs/train-dagger-default-s1 --noise sweep --lots test:100";

/// Arguments of `evaluate`.
#[derive(Debug, Clone, Default, Args)]
pub struct EvaluateArgs {
    /// Who drives; may be repeated. See `cargo xtask drivers`. The settings of the first `run:DIR` are used unless
    /// `--config` or `--preset` names others.
    #[arg(long = "driver", value_name = "SPEC", required = true, num_args = 1..)]
    pub drivers: Vec<String>,
    /// Lots to drive; see `cargo xtask lots` [default: the setting evaluation.lots].
    #[arg(long, value_name = "SPEC", num_args = 1.., value_delimiter = ',')]
    pub lots: Vec<String>,
    /// Trials per lot and direction; each draws its own obstacles and noise.
    #[arg(long, value_name = "N")]
    pub trials: Option<u32>,
    /// Which ways the lots are driven.
    #[arg(long)]
    pub directions: Option<Directions>,
    /// What is seen wrongly: clean, paper, hard, lot (as the lot asks for) or multiples of paper; several are compared,
    /// `sweep` stands for 0,0.5,1,1.5,2.
    #[arg(long, value_name = "LEVEL", num_args = 1.., value_delimiter = ',')]
    pub noise: Vec<String>,
    /// Driver the others are compared with [default: the last network, else the first driver].
    #[arg(long, value_name = "SPEC")]
    pub compare_with: Option<String>,
    /// Seed of obstacles and noise of the trials.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Settings.
    #[command(flatten)]
    pub layers: LayerArgs,
    /// Records the first N runs of every driver for Rerun's viewer, into the folder of the results.
    #[arg(long, value_name = "N", num_args = 0..=1, default_missing_value = "1")]
    pub record: Option<usize>,
    /// Folder of the results [default: runs/evaluate-PRESET-sSEED, the next free one].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Deletes what an earlier run left in `--out`.
    #[arg(long, requires = "out")]
    pub overwrite: bool,
}

/// Ways a lot can be driven.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Directions {
    /// Forward and reverse.
    Both,
    /// From start to finish.
    Forward,
    /// From finish to start.
    Reverse,
}

const REPRODUCE_EXAMPLES: &str = "\
Examples:
  cargo xtask reproduce                               half an hour on two cores
  cargo xtask reproduce --preset smoke --out runs/try   every stage within a minute
  cargo xtask reproduce --full --unseen test:50
  cargo xtask reproduce --resume runs/reproduce-default-s1";

/// Arguments of `reproduce`.
#[derive(Debug, Clone, Default, Args)]
pub struct ReproduceArgs {
    /// Settings.
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// Five training seeds, twice the trials, more unseen lots, longer ablations.
    #[arg(long)]
    pub full: bool,
    /// Lots that no driver has met; see `cargo xtask lots` [default: test:20; test:100 with --full].
    #[arg(long, value_name = "SPEC", num_args = 1.., value_delimiter = ',')]
    pub unseen: Vec<String>,
    /// Folder of `cargo xtask tune`: planners also drive with the parameters found there [default: those in xtask/tuned].
    #[arg(long, value_name = "DIR")]
    pub tuned: Option<PathBuf>,
    /// Folder of the run [default: runs/reproduce-PRESET-sSEED, the next free one].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Deletes what an earlier run left in `--out`.
    #[arg(long, requires = "out")]
    pub overwrite: bool,
    /// Continues an interrupted run with its own settings, to the same result; finished stages are skipped.
    #[arg(
        long,
        value_name = "DIR",
        conflicts_with_all = ["preset", "config", "overrides", "seed", "out", "full", "unseen", "tuned"]
    )]
    pub resume: Option<PathBuf>,
}

const GENERATE_EXAMPLES: &str = "\
Examples:
  cargo xtask generate --lots lot-a,lot-b,lot-c --out lots
  cargo xtask generate --lots lot-a --seed 7 --count 5 --out lots
  cargo xtask generate --lots my-map.yaml --scale 20 --start 0.4,1.2,90 --goal 3.1,0.5,-90 --out lots
  cargo xtask generate --lots my-map.yaml --start 4,2,0 --loop --out lots";

/// Arguments of `generate`.
#[derive(Debug, Clone, Args)]
pub struct GenerateArgs {
    /// Lots to write; see `cargo xtask lots`.
    #[arg(long, value_name = "SPEC", num_args = 1.., value_delimiter = ',', required = true)]
    pub lots: Vec<String>,
    /// Seed of the obstacles.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Drawings of each lot, each with its own obstacles.
    #[arg(long, default_value_t = 1)]
    pub count: u32,
    /// Folder to write into.
    #[arg(long, value_name = "DIR", default_value = "lots")]
    pub out: PathBuf,
    /// Pixels per metre of the pictures [default: as fits 1600 pixels].
    #[arg(long, value_name = "PIXELS")]
    pub pixels_per_metre: Option<f32>,
    /// Replaces files of the same name.
    #[arg(long)]
    pub overwrite: bool,
    /// Where to drive on a map.
    #[command(flatten)]
    pub map: MapArgs,
}

/// Where to drive on a ROS map (`--lots MAP.yaml`) or TPCAP case (`--lots CASE.csv`). Coordinates are those of the map;
/// `MAP.lot.toml` can hold the same and is read first.
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(next_help_heading = "Maps")]
pub struct MapArgs {
    /// Makes the lot this many times as large as the map.
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    pub scale: Option<f32>,
    /// Where the rear axle starts: metres, metres, degrees counter-clockwise from x.
    #[arg(long, value_name = "X,Y,DEG", value_parser = pose, allow_hyphen_values = true)]
    pub start: Option<[f32; 3]>,
    /// Where it is to arrive; the route there is found automatically.
    #[arg(long, value_name = "X,Y,DEG", value_parser = pose, allow_hyphen_values = true)]
    pub goal: Option<[f32; 3]>,
    /// Instead of a goal: a route round a loop, back to the start.
    #[arg(long = "loop", conflicts_with = "goal")]
    pub is_loop: bool,
    /// Instead of all three: CSV file with the route of the rear axle, x and y in metres.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["start", "goal", "is_loop"])]
    pub centre_line: Option<PathBuf>,
    /// Clearance that a route found automatically keeps around the body, metres in the lot [default: 0.25].
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    pub clearance: Option<f32>,
}

/// `X,Y,DEG`.
fn pose(text: &str) -> Result<[f32; 3], String> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| "write x,y,degrees, e.g. 3.5,-2,90, without spaces".to_owned())
}

/// Arguments of `pixel-accuracy`.
#[derive(Debug, Clone, Args)]
pub struct PixelAccuracyArgs {
    /// Lots to look at; see `cargo xtask lots`.
    #[arg(long, value_name = "SPEC", num_args = 1.., value_delimiter = ',', default_value = "lot-a,lot-b,lot-c")]
    pub lots: Vec<String>,
    /// Noise levels.
    #[arg(long, num_args = 1.., value_delimiter = ',', default_value = "paper")]
    pub level: Vec<NoiseChoice>,
    /// Trials per lot and direction.
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub trials: u32,
    /// Settings.
    #[command(flatten)]
    pub settings: SettingsArgs,
}

const METRES_EXAMPLES: &str = "\
Examples:
  cargo xtask metres --below 0.1                      no event within these metres shows less than 0.1 per 100 m
  cargo xtask metres --between 1.4,0.5                to tell two drivers apart
  cargo xtask metres --between 1.4,1.2 --power 0.9 --dispersion 2";

/// Arguments of `metres`. Rates are near-collisions per 100 m.
#[derive(Debug, Clone, Args)]
pub struct MetresArgs {
    /// A rate to be shown as not reached, by a run without an event.
    #[arg(long, value_name = "RATE", required_unless_present = "between")]
    pub below: Option<f64>,
    /// Two rates to be told apart.
    #[arg(long, value_name = "RATE,RATE", value_parser = two_rates)]
    pub between: Option<[f64; 2]>,
    /// Probability of seeing a difference that is there.
    #[arg(long, default_value_t = 0.8)]
    pub power: f64,
    /// Confidence: one-sided for `--below`, two-sided for `--between`.
    #[arg(long, default_value_t = 0.95)]
    pub confidence: f64,
    /// Variance over mean of the counts, as printed by `evaluate`; 1 = independent events.
    #[arg(long, default_value_t = 1.0)]
    pub dispersion: f64,
}

fn two_rates(text: &str) -> Result<[f64; 2], String> {
    let rates = text.split_once(',').and_then(|(a, b)| Some([a.trim().parse().ok()?, b.trim().parse().ok()?]));
    rates.ok_or_else(|| "two numbers with a comma between them are needed, as in 1.4,0.5".to_owned())
}

/// Arguments of `drivers`.
#[derive(Debug, Clone, Default, Args)]
pub struct DriversArgs {
    /// A planner, whose parameters are printed as the file that `NAME:FILE` reads.
    #[arg(value_name = "PLANNER")]
    pub planner: Option<String>,
}

const VISUALISE_EXAMPLES: &str = "\
Examples:
  cargo xtask visualise lot lot-b
  cargo xtask visualise episode --driver expert --driver run:runs/train-dagger-default-s1 --lot lot-b
  cargo xtask visualise replay run:runs/train-dagger-default-s1@lot-b@reverse@3@paper@1@842
  cargo xtask visualise run runs/train-dagger-default-s1
  cargo xtask visualise failures runs/evaluate-default-s1 --limit 5

The viewer that fits: pip install rerun-sdk==0.36.3, then: rerun recordings/*.rrd
The first time, the recorder is built (about 8 minutes on two cores).";

/// Arguments of `visualise`.
#[derive(Debug, Clone, Args)]
pub struct VisualiseArgs {
    /// What to look at.
    #[command(subcommand)]
    pub what: What,
    /// Where it goes.
    #[command(flatten)]
    pub sink: SinkArgs,
}

/// Where recordings go.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Recording")]
pub struct SinkArgs {
    /// File to write [default: recordings/NAME.rrd].
    #[arg(long, global = true, value_name = "FILE.rrd", conflicts_with_all = ["spawn", "connect"])]
    pub out: Option<PathBuf>,
    /// Shows it in a viewer of this machine instead, started if none runs.
    #[arg(long, global = true, conflicts_with = "connect")]
    pub spawn: bool,
    /// Shows it in a viewer that runs already [default: on this machine].
    #[arg(long, global = true, value_name = "URL", num_args = 0..=1, default_missing_value = "")]
    pub connect: Option<String>,
}

/// What can be looked at.
#[derive(Debug, Clone, Subcommand)]
pub enum What {
    /// A lot.
    Lot(VisualiseLotArgs),
    /// An episode of an evaluation, driven by one driver, or by several side by side.
    Episode(EpisodeArgs),
    /// The run of a replay key, around its moment.
    Replay(ReplayArgs),
    /// A training: loss, validation, learning rate, and what every round brought.
    Run(RunArgs),
    /// Near-collisions of an evaluation, a recording each.
    Failures(FailuresArgs),
}

/// Arguments of `visualise lot`.
#[derive(Debug, Clone, Args)]
pub struct VisualiseLotArgs {
    /// The lot; see `cargo xtask lots`.
    #[arg(value_name = "SPEC")]
    pub lot: String,
    /// Seed of the obstacles, as in `generate`.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// Arguments of `visualise episode`: obstacles and noise are those of the same trial in `evaluate`.
#[derive(Debug, Clone, Args)]
pub struct EpisodeArgs {
    /// Who drives; may be repeated. See `cargo xtask drivers`.
    #[arg(long = "driver", value_name = "SPEC", required = true, num_args = 1..)]
    pub drivers: Vec<String>,
    /// The lot; see `cargo xtask lots`.
    #[arg(long, value_name = "SPEC", default_value = "lot-a")]
    pub lot: String,
    /// Which trial.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub trial: u32,
    /// From finish to start.
    #[arg(long)]
    pub reverse: bool,
    /// What is seen wrongly: clean, paper, hard, lot or multiples of paper [default: the first of evaluation.noise].
    #[arg(long, value_name = "LEVEL")]
    pub noise: Option<String>,
    /// Seed of the evaluation.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Settings.
    #[command(flatten)]
    pub layers: LayerArgs,
}

/// Arguments of `visualise replay`.
#[derive(Debug, Clone, Args)]
pub struct ReplayArgs {
    /// From `failures.md`, `failures.jsonl` or `runs.jsonl`. Unless a `run:` drives, name the settings it was driven
    /// with: `--config RUN/settings.toml`.
    #[arg(value_name = "KEY")]
    pub key: String,
    /// Settings.
    #[command(flatten)]
    pub layers: LayerArgs,
}

/// Arguments of `visualise run`.
#[derive(Debug, Clone, Args)]
pub struct RunArgs {
    /// Folder of a training.
    #[arg(value_name = "DIR")]
    pub run: PathBuf,
}

/// Arguments of `visualise failures`.
#[derive(Debug, Clone, Args)]
pub struct FailuresArgs {
    /// Folder of an evaluation, or of a training with one.
    #[arg(value_name = "DIR")]
    pub run: PathBuf,
    /// Near-collisions to record, from the top of the list.
    #[arg(long, value_name = "N", default_value_t = 12)]
    pub limit: usize,
}

const TUNE_EXAMPLES: &str = "\
Examples:
  cargo xtask tune
  cargo xtask tune --planner vvf --budget 128 --out runs/tune-vvf
  cargo xtask evaluate --driver vvf --driver vvf:runs/tune-default-s1/vvf.toml";

/// Arguments of `tune`.
#[derive(Debug, Clone, Args)]
pub struct TuneArgs {
    /// Planners to tune [default: all].
    #[arg(long = "planner", value_name = "NAME", num_args = 1.., value_delimiter = ',')]
    pub planners: Vec<String>,
    /// Lots to tune on: lot-a and generated training lots only.
    #[arg(long, value_name = "SPEC", num_args = 1.., value_delimiter = ',', default_value = "lot-a,train:4")]
    pub lots: Vec<String>,
    /// Candidates per planner, its own parameters included.
    #[arg(long, value_name = "N", default_value_t = 48)]
    pub budget: u32,
    /// Trials per lot and direction that every candidate drives; the best few drive as many fresh ones again.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub trials: u32,
    /// Seed of candidates, obstacles and noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// What is seen wrongly.
    #[arg(long, value_name = "LEVEL", default_value = "paper")]
    pub noise: crate::settings::NoiseChoice,
    /// Settings of car, sensor and metrics.
    #[command(flatten)]
    pub layers: LayerArgs,
    /// Folder of the results [default: runs/tune-PRESET-sSEED, the next free one].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Deletes what an earlier run left in `--out`.
    #[arg(long, requires = "out")]
    pub overwrite: bool,
}
