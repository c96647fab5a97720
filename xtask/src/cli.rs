//! The command line: which commands there are.

use crate::commands::{
    bench, completions, deviations, drivers, evaluate, export, generate, guard, lots, merge, pixel_accuracy, render,
    replay, reproduce, rules, sample_size, scaling, settings, torture, train, tune, verify, visualise, what_if,
};
use crate::output::{Color, Output};
use clap::{CommandFactory as _, Parser, Subcommand};
use sim::limits::THREADS_MAX;

/// lotpilot: learns to drive through parking lots in simulation, and measures how well.
#[derive(Debug, Parser)]
// A line of help is one line, however wide the terminal: whoever searches or pipes it finds whole sentences.
#[command(name = "lotpilot", bin_name = "cargo xtask", version, after_help = EXAMPLES, term_width = 0)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Prints results and errors only.
    #[arg(long, short, global = true, display_order = 1000, help_heading = "Everywhere")]
    quiet: bool,
    /// When to colour: auto (on a terminal, unless `NO_COLOR` is set), always or never.
    #[arg(
        long,
        global = true,
        value_enum,
        value_name = "WHEN",
        default_value_t,
        display_order = 1001,
        hide_possible_values = true,
        help_heading = "Everywhere"
    )]
    color: Color,
    /// Threads to compute with [default: all cores]. Changes nothing but the time it takes.
    #[arg(
        long,
        global = true,
        value_name = "N",
        value_parser = clap::value_parser!(u16).range(1..=i64::from(THREADS_MAX)),
        display_order = 1002,
        help_heading = "Everywhere"
    )]
    threads: Option<u16>,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask train-dagger                       train, print the paper's table, drive three lots and others
  cargo xtask train-dagger --preset smoke        every step of it in seconds
  cargo xtask evaluate --driver expert trained:default
  cargo xtask settings --explain dagger.eta      what a setting means
  cargo xtask generate --lots lot-a --out lots   TOML and a picture";

#[derive(Debug, Subcommand)]
enum Command {
    /// Trains by behaviour cloning, then DAgger; ends with the paper's table, and drives the three lots and others it
    /// has not seen.
    #[command(after_help = train::DAGGER_EXAMPLES)]
    TrainDagger(train::TrainArgs),
    /// Trains by behaviour cloning: the expert drives once, and a network learns from it.
    #[command(after_help = train::BC_EXAMPLES)]
    TrainBc(train::TrainArgs),
    /// Drives drivers over lots and counts near-collisions and the safe ratio.
    #[command(after_help = evaluate::EXAMPLES)]
    Evaluate(evaluate::EvaluateArgs),
    /// Shows what would have avoided the near-collisions of an evaluation, by replacing one thing at a time with the
    /// truth.
    #[command(after_help = what_if::EXAMPLES)]
    WhatIf(what_if::WhatIfArgs),
    /// Draws lots, drives, samples and noise; writes reports and pages of results.
    #[command(after_help = render::EXAMPLES)]
    Render(render::RenderArgs),
    /// Records lots, drives and near-collisions for Rerun's viewer.
    #[command(after_help = visualise::EXAMPLES)]
    Visualise(visualise::VisualiseArgs),
    /// Writes lots as TOML plus a top-view PNG.
    #[command(after_help = generate::EXAMPLES)]
    Generate(generate::GenerateArgs),
    /// Lists the lots that can be named.
    #[command(after_help = lots::EXAMPLES)]
    Lots(lots::LotsArgs),
    /// Lists the drivers that can be named, or prints the parameters of one planner as a file.
    #[command(after_help = drivers::EXAMPLES)]
    Drivers(drivers::DriversArgs),
    /// Prints settings as TOML that `--config` reads, or explains one.
    #[command(after_help = settings::EXAMPLES)]
    Settings(settings::SettingsArgs),
    /// Searches for parameters of the model-based planners on lot a and training lots, in the same way for each.
    #[command(after_help = tune::EXAMPLES)]
    Tune(tune::TuneArgs),
    /// Writes a trained network as an ONNX file.
    #[command(after_help = export::EXAMPLES)]
    Export(export::ExportArgs),
    /// The paper in a box: trains, drives and writes one report with the paper's tables beside ours.
    #[command(after_help = reproduce::EXAMPLES)]
    Reproduce(reproduce::ReproduceArgs),
    /// Trains under every decision rule of the DAgger family at equal samples, and compares effort and safety.
    #[command(after_help = rules::EXAMPLES)]
    Rules(rules::RulesArgs),
    /// Trains with one thing at a time as in the paper, and shows what each deviation from it does.
    #[command(after_help = deviations::EXAMPLES)]
    Deviations(deviations::DeviationsArgs),
    /// Trains on few and on many different lots, and shows how near-collisions fall.
    #[command(after_help = scaling::EXAMPLES)]
    Scaling(scaling::ScalingArgs),
    /// Puts the shards of an evaluation, a reproduction or other trainings together, as if one machine had done all of it.
    #[command(after_help = merge::EXAMPLES)]
    Merge(merge::MergeArgs),
    /// Checks that every file of a run is what was written, by its SHA-256.
    #[command(after_help = verify::EXAMPLES)]
    Verify(verify::VerifyArgs),
    /// Drives runs again by their replay keys, and says whether they are the same as recorded, bit for bit.
    #[command(after_help = replay::EXAMPLES)]
    Replay(replay::ReplayArgs),
    /// Computes how far to drive to see a difference in near-collisions, or to bound their rate.
    #[command(after_help = sample_size::EXAMPLES)]
    SampleSize(sample_size::SampleSizeArgs),
    /// Measures how many pixels of the noisy bird's-eye view are right.
    #[command(after_help = pixel_accuracy::EXAMPLES)]
    PixelAccuracy(pixel_accuracy::PixelAccuracyArgs),
    /// Measures how fast lotpilot is on this machine, next to other simulators and libraries if asked.
    #[command(after_help = bench::EXAMPLES)]
    Bench(bench::BenchArgs),
    /// Trains the default and fails if its policy has become worse: for a nightly run.
    #[command(after_help = guard::EXAMPLES)]
    Guard(guard::GuardArgs),
    /// Kills commands and makes their file operations fail, continues them, and compares every byte.
    #[command(after_help = torture::EXAMPLES)]
    Torture(torture::TortureArgs),
    /// Prints a script that completes commands and flags in a shell.
    #[command(after_help = completions::EXAMPLES)]
    Completions(completions::CompletionsArgs),
}

impl Cli {
    /// Threads to compute with; 0: all cores.
    pub fn threads(&self) -> usize {
        self.threads.map_or(0, usize::from)
    }

    /// Runs the command.
    ///
    /// # Errors
    /// If something named does not exist or cannot be read or written, or on Ctrl-C.
    pub fn run(&self) -> anyhow::Result<()> {
        let output = &Output::new(self.quiet, self.command.is_json());
        match &self.command {
            Command::TrainDagger(args) => train::dagger(args, output),
            Command::TrainBc(args) => train::bc(args, output),
            Command::Evaluate(args) => evaluate::run(args, output),
            Command::WhatIf(args) => what_if::run(args, output),
            Command::Render(args) => render::run(args, output),
            Command::Visualise(args) => visualise::run(args, output),
            Command::Generate(args) => generate::run(args, output),
            Command::Lots(args) => lots::run(args, output),
            Command::Drivers(args) => drivers::run(args, output),
            Command::Settings(args) => settings::run(args, output),
            Command::Tune(args) => tune::run(args, output),
            Command::Export(args) => export::run(args, output),
            Command::Reproduce(args) => reproduce::run(args, output),
            Command::Rules(args) => rules::run(args, output),
            Command::Deviations(args) => deviations::run(args, output),
            Command::Scaling(args) => scaling::run(args, output),
            Command::Merge(args) => merge::run(args, output),
            Command::Verify(args) => verify::run(args, output),
            Command::Replay(args) => replay::run(args, output),
            Command::SampleSize(args) => sample_size::run(args, output),
            Command::PixelAccuracy(args) => pixel_accuracy::run(args, output),
            Command::Bench(args) => bench::run(args, output),
            Command::Guard(args) => guard::run(args, output),
            Command::Torture(args) => torture::run(args, output),
            Command::Completions(args) => completions::run(args, Self::command(), output),
        }?;
        output.finish()
    }
}

impl Command {
    /// Whether tables are printed as JSON.
    fn is_json(&self) -> bool {
        match self {
            Self::TrainBc(train::TrainArgs { json, .. })
            | Self::TrainDagger(train::TrainArgs { json, .. })
            | Self::Evaluate(evaluate::EvaluateArgs { json, .. })
            | Self::Merge(merge::MergeArgs { json, .. })
            | Self::PixelAccuracy(pixel_accuracy::PixelAccuracyArgs { json, .. })
            | Self::SampleSize(sample_size::SampleSizeArgs { json, .. })
            | Self::Lots(lots::LotsArgs { json })
            | Self::Drivers(drivers::DriversArgs { json, .. })
            | Self::Replay(replay::ReplayArgs { json, .. })
            | Self::WhatIf(what_if::WhatIfArgs { json, .. })
            | Self::Verify(verify::VerifyArgs { json, .. }) => json.json,
            Self::Reproduce(_)
            | Self::Rules(_)
            | Self::Deviations(_)
            | Self::Scaling(_)
            | Self::Guard(_)
            | Self::Generate(_)
            | Self::Export(_)
            | Self::Bench(_)
            | Self::Settings(_)
            | Self::Tune(_)
            | Self::Torture(_)
            | Self::Render(_)
            | Self::Visualise(_)
            | Self::Completions(_) => false,
        }
    }
}
