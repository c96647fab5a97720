//! Arguments of `render`.

use super::LayerArgs;
use clap::{Args, Subcommand, ValueEnum};
use std::path::PathBuf;

pub(super) const EXAMPLES: &str = "\
Examples:
  cargo xtask render lot --lots lot-a,test:2
  cargo xtask render contact-sheet --lots train:6:easy,train:6,train:6:hard
  cargo xtask render trajectories --driver expert --driver run:runs/NAME --lots lot-b
  cargo xtask render trajectories --driver expert --lots lot-a --by speed
  cargo xtask render trajectories --run runs/NAME --round 1
  cargo xtask render samples runs/NAME/round-01 --count 8
  cargo xtask render noise --lots lot-a --noise paper,hard
  cargo xtask render report runs/NAME";

/// Arguments of `render`.
#[derive(Debug, Clone, Args)]
pub struct RenderArgs {
    /// What is drawn.
    #[command(subcommand)]
    pub what: RenderWhat,
    /// Folder to write into.
    #[arg(long, global = true, value_name = "DIR", default_value = "pictures")]
    pub out: PathBuf,
    /// Replaces files of the same name.
    #[arg(long, global = true)]
    pub overwrite: bool,
}

/// What is drawn.
#[derive(Debug, Clone, Subcommand)]
pub enum RenderWhat {
    /// Lots from above, PNG and SVG.
    Lot(RenderLotArgs),
    /// The lines drivers drove over a lot, PNG and SVG.
    Trajectories(TrajectoriesArgs),
    /// Many lots on one page, PNG and SVG.
    ContactSheet(RenderLotArgs),
    /// Samples of a round's data set with labels and predictions, PNG.
    Samples(SamplesArgs),
    /// What each noise layer makes wrong in one view, PNG.
    Noise(RenderNoiseArgs),
    /// The report of a run anew, into its folder.
    Report(RenderReportArgs),
}

/// Arguments of `render report`.
#[derive(Debug, Clone, Args)]
pub struct RenderReportArgs {
    /// Folder of a training or an evaluation.
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
}

/// Arguments of `render lot` and `render contact-sheet`.
#[derive(Debug, Clone, Args)]
pub struct RenderLotArgs {
    /// Lots to draw; see `cargo xtask lots`.
    #[arg(long, value_name = "SPEC", num_args = 1.., value_delimiter = ',', required = true)]
    pub lots: Vec<String>,
    /// Seed of the obstacles.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Pixels per metre of single lots [default: as fits 1600 pixels].
    #[arg(long, value_name = "PIXELS")]
    pub pixels_per_metre: Option<f32>,
}

/// What colours mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ColourChoice {
    /// How fast.
    Speed,
    /// Which driver.
    Driver,
    /// Expert or network.
    Who,
}

/// Ways to drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Way {
    /// From start to finish.
    Forward,
    /// From finish to start.
    Reverse,
}

/// Arguments of `render trajectories`.
#[derive(Debug, Clone, Args)]
pub struct TrajectoriesArgs {
    /// Who drives, as in an evaluation; may be repeated. See `cargo xtask drivers`.
    #[arg(long = "driver", value_name = "SPEC", num_args = 1.., required_unless_present = "run")]
    pub drivers: Vec<String>,
    /// Instead: a drive of a training run, network and expert in turn as the decision rule chose.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["drivers", "lot", "direction", "noise", "seed", "preset", "config", "overrides"])]
    pub run: Option<PathBuf>,
    /// Round of the training run; 0 = behaviour cloning.
    #[arg(long, default_value_t = 1, requires = "run")]
    pub round: u32,
    /// Lot to drive; see `cargo xtask lots`.
    #[arg(long = "lots", value_name = "SPEC", default_value = "lot-a")]
    pub lot: String,
    /// Which way.
    #[arg(long, default_value = "forward")]
    pub direction: Way,
    /// Which trial: obstacles and noise; of a training run, which of its drives.
    #[arg(long, default_value_t = 0)]
    pub trial: u32,
    /// What is seen wrongly: clean, paper, hard, lot or a multiple of paper.
    #[arg(long, value_name = "LEVEL", default_value = "paper")]
    pub noise: String,
    /// Seed of obstacles and noise of the trials.
    #[arg(long)]
    pub seed: Option<u64>,
    /// What colours mean [default: driver; of a training run, who].
    #[arg(long)]
    pub by: Option<ColourChoice>,
    /// Pixels per metre [default: as fits 1600 pixels].
    #[arg(long, value_name = "PIXELS")]
    pub pixels_per_metre: Option<f32>,
    /// Settings.
    #[command(flatten)]
    pub layers: LayerArgs,
}

/// Arguments of `render samples`.
#[derive(Debug, Clone, Args)]
pub struct SamplesArgs {
    /// Folder of the round, e.g. runs/NAME/round-01.
    #[arg(value_name = "ROUND")]
    pub round: PathBuf,
    /// Samples to draw, evenly spaced over the round.
    #[arg(long, value_name = "N", default_value_t = 12)]
    pub count: usize,
    /// Folder of the network that predicts [default: the one trained after the round, if it is there].
    #[arg(long, value_name = "DIR")]
    pub net: Option<PathBuf>,
}

/// Arguments of `render noise`.
#[derive(Debug, Clone, Args)]
pub struct RenderNoiseArgs {
    /// Lot to look at; see `cargo xtask lots`.
    #[arg(long = "lots", value_name = "SPEC", default_value = "lot-a")]
    pub lot: String,
    /// Noise levels: paper, hard or multiples of paper.
    #[arg(long, value_name = "LEVEL", num_args = 1.., value_delimiter = ',', default_value = "paper,hard")]
    pub noise: Vec<crate::settings::NoiseChoice>,
    /// Where the rear axle stands, metres along the route [default: where most layers of the last level show].
    #[arg(long, value_name = "METRES")]
    pub at: Option<f32>,
    /// Seed of obstacles and noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}
