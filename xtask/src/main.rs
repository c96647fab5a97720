//! `cargo xtask <command>`: see [`xtask::cli`] for the commands.

use clap::Parser as _;
use std::num::NonZeroUsize;
use std::process::ExitCode;
use xtask::cli::{Cli, Command};
use xtask::{
    evaluate, generate, interrupt, listing, metres, pixel_accuracy, render, reproduce, train, tune, visualise,
};

// Training allocates and frees large buffers all the time: a quarter faster than with the system's allocator.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Of every thread of the pool: as much as the main thread has on Linux.
const STACK_BYTES: usize = 8 << 20;
/// Bad input, or an environment in which the work cannot be done. Our own bugs panic (101).
const EXIT_REFUSED: u8 = 2;
/// Ended by Ctrl-C, as shells have it.
const EXIT_INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    let cli = Cli::parse();
    match run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if error.is::<interrupt::Interrupted>() => {
            eprintln!("{error}");
            ExitCode::from(EXIT_INTERRUPTED)
        }
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(EXIT_REFUSED)
        }
    }
}

fn run(cli: Cli) -> anyhow::Result<()> {
    interrupt::install()?;
    let threads = cli.threads.map_or(0, NonZeroUsize::get); // 0: all cores
    rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK_BYTES).build_global()?;
    // Within the pool: a thread outside it goes to sleep and is woken up at every parallel step, three times per control
    // tick. On a busy machine that costs more than the driving.
    rayon::scope(|_| command(cli.command))
}

fn command(command: Command) -> anyhow::Result<()> {
    match command {
        Command::TrainBc(args) => train::bc(&args),
        Command::TrainDagger(args) => train::dagger(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Reproduce(args) => reproduce::run(&args),
        Command::Generate(args) => generate::run(&args),
        Command::PixelAccuracy(args) => pixel_accuracy::run(&args),
        Command::Metres(args) => metres::run(&args),
        Command::Settings(args) => listing::settings(&args),
        Command::Lots => listing::lots(),
        Command::Drivers(args) => listing::drivers(&args),
        Command::Visualise(args) => visualise::run(&args),
        Command::Tune(args) => tune::run(&args),
        Command::Render(args) => render::run(&args),
    }
}
