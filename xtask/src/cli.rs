//! The command line: which commands there are.

use crate::build_info::PROGRAM;
use crate::commands::{
    drivers, evaluate, generate, guard, lots, pixel_accuracy, render, reproduce, sample_size, settings, train, tune,
    visualise,
};
use clap::{Parser, Subcommand};
use std::num::NonZeroUsize;

/// lotpilot: learns to drive through parking lots in simulation, and measures how well.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version = PROGRAM, after_help = EXAMPLES)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Threads to compute with [default: all cores]. Changes nothing but the time it takes.
    #[arg(long, global = true, value_name = "N", display_order = 1000)]
    threads: Option<NonZeroUsize>,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask train-dagger                       train, print the paper's table, check on three lots
  cargo xtask train-dagger --preset smoke        the same line end to end in seconds
  cargo xtask evaluate --driver expert --driver run:runs/train-dagger-default-s1
  cargo xtask settings --preset paper            every setting there is
  cargo xtask generate --lots lot-a --out lots   TOML and a picture";

#[derive(Debug, Subcommand)]
enum Command {
    /// Behaviour cloning: the expert drives once, a network learns from it.
    #[command(after_help = train::BC_EXAMPLES)]
    TrainBc(train::TrainArgs),
    /// Behaviour cloning, then DAgger; ends with the paper's table and a closed-loop check on three lots.
    #[command(after_help = train::DAGGER_EXAMPLES)]
    TrainDagger(train::TrainArgs),
    /// Drives drivers over lots and counts near-collisions and the safe ratio.
    #[command(after_help = evaluate::EXAMPLES)]
    Evaluate(evaluate::EvaluateArgs),
    /// The paper in a box: trains, drives and writes one report with the paper's tables beside ours.
    #[command(after_help = reproduce::EXAMPLES)]
    Reproduce(reproduce::ReproduceArgs),
    /// Trains the default and fails if its policy has become worse: for a nightly run.
    #[command(after_help = guard::EXAMPLES)]
    Guard(guard::GuardArgs),
    /// Writes lots as TOML plus a top-view PNG.
    #[command(after_help = generate::EXAMPLES)]
    Generate(generate::GenerateArgs),
    /// How many pixels of the noisy bird's-eye view are right.
    PixelAccuracy(pixel_accuracy::PixelAccuracyArgs),
    /// How far must be driven to see a difference in near-collisions, or to bound their rate.
    #[command(after_help = sample_size::EXAMPLES)]
    SampleSize(sample_size::SampleSizeArgs),
    /// Prints the resolved settings as TOML.
    Settings(settings::SettingsArgs),
    /// Lists the lots that can be named.
    Lots(lots::LotsArgs),
    /// Lists the drivers that can be named, or prints the parameters of one planner as a file.
    Drivers(drivers::DriversArgs),
    /// Searches parameters of the model-based planners on lot a and training lots, the same way for each.
    #[command(after_help = tune::EXAMPLES)]
    Tune(tune::TuneArgs),
    /// Draws lots, drives, samples and noise as PNG and SVG.
    #[command(after_help = render::EXAMPLES)]
    Render(render::RenderArgs),
    /// Records lots, drives and near-collisions, to be looked at in Rerun's viewer.
    #[command(after_help = visualise::EXAMPLES)]
    Visualise(visualise::VisualiseArgs),
    /// Old name of `sample-size`.
    #[command(hide = true)]
    Metres,
}

impl Cli {
    /// Threads to compute with; 0: all cores.
    pub fn threads(&self) -> usize {
        self.threads.map_or(0, NonZeroUsize::get)
    }

    /// Does what is asked for.
    ///
    /// # Errors
    /// If something named does not exist or cannot be read or written, or by Ctrl-C.
    pub fn run(&self) -> anyhow::Result<()> {
        match &self.command {
            Command::TrainBc(args) => train::bc(args),
            Command::TrainDagger(args) => train::dagger(args),
            Command::Evaluate(args) => evaluate::run(args),
            Command::Reproduce(args) => reproduce::run(args),
            Command::Guard(args) => guard::run(args),
            Command::Generate(args) => generate::run(args),
            Command::PixelAccuracy(args) => pixel_accuracy::run(args),
            Command::SampleSize(args) => sample_size::run(args),
            Command::Settings(args) => settings::run(args),
            Command::Lots(args) => lots::run(args),
            Command::Drivers(args) => drivers::run(args),
            Command::Tune(args) => tune::run(args),
            Command::Render(args) => render::run(args),
            Command::Visualise(args) => visualise::run(args),
            Command::Metres => anyhow::bail!("the command metres is named sample-size now"),
        }
    }
}
