//! The command line of lotpilot: clap → settings → call → exit code. No algorithm lives here.
#![allow(clippy::disallowed_methods, reason = "wall time is shown to people here; nothing computed depends on it")]
#![allow(missing_docs, reason = "what users read is the help of clap")]

mod args;
mod build_info;
pub mod cli;
mod commands;
mod console;
mod interrupt;
mod output;
mod picture_folder;
mod record;
mod viewer;

use anyhow::ensure;
use clap::{Arg, Command, CommandFactory as _, FromArgMatches as _};
use experiment::progress::Interrupted;
use sim::limits::THREADS_MAX;
use std::ffi::OsString;
use std::io::ErrorKind;
use std::process::ExitCode;

/// Stack size of every thread of the pool: as much as the main thread has on Linux.
const STACK_BYTES: usize = 8 << 20;
/// Bad input, or an environment in which the work cannot be done. Our own bugs panic (101).
const EXIT_REFUSED: u8 = 2;

/// Parses the command line, runs the command, and says what went wrong.
pub fn main() -> ExitCode {
    // First of all: a signal before ends the process as signals do.
    if let Err(error) = interrupt::install() {
        output::error(format_args!("{error:#}"));
        return ExitCode::from(EXIT_REFUSED);
    }
    let command = with_negative_numbers(cli::Cli::command()).color(output::Color::from_args().of_clap());
    let cli = match command.try_get_matches().and_then(|matches| cli::Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(said) => return say(&said),
    };
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        // Whatever went wrong because of it.
        Err(error) if error.is::<Interrupted>() || interrupt::is_requested() => {
            let kept = error.downcast::<Interrupted>().map_or_else(|error| format!("{error:#}"), |error| error.kept);
            output::note(interrupt::said(&kept));
            ExitCode::from(interrupt::EXIT)
        }
        Err(error) => {
            output::error(format_args!("{error:#}"));
            ExitCode::from(EXIT_REFUSED)
        }
    }
}

/// Prints help, the version, or what is wrong with the command line: without letters in it that a terminal obeys or that nobody
/// sees. What nobody got on a full disk is no success; whoever closes stdout has had enough.
fn say(said: &clap::Error) -> ExitCode {
    // What is wrong with the command line quotes it.
    let is_hidden = |arg: OsString| output::printable(&arg.to_string_lossy()) != arg.to_string_lossy();
    if said.use_stderr() && std::env::args_os().any(is_hidden) {
        output::line(output::printable(said.render().to_string().trim_end()));
        return exit_code_of(said);
    }
    match said.print() {
        Err(error) if !said.use_stderr() && error.kind() != ErrorKind::BrokenPipe => {
            output::error(format_args!("stdout: {error}"));
            ExitCode::from(EXIT_REFUSED)
        }
        _ => exit_code_of(said),
    }
}

fn exit_code_of(said: &clap::Error) -> ExitCode {
    ExitCode::from(u8::try_from(said.exit_code()).unwrap_or(EXIT_REFUSED))
}

/// A command whose flags take `-1` for a value, so that their own errors say what they take, and not for another flag.
fn with_negative_numbers(command: Command) -> Command {
    let takes_values = |arg: Arg| {
        let takes_values = arg.get_action().takes_values();
        if takes_values { arg.allow_negative_numbers(true) } else { arg }
    };
    command.mut_args(takes_values).mut_subcommands(with_negative_numbers)
}

fn run(cli: &cli::Cli) -> anyhow::Result<()> {
    // What rayon reads where no number is given; the second is its old name.
    for name in ["RAYON_NUM_THREADS", "RAYON_RS_NUM_CPUS"].iter().filter(|_| cli.threads() == 0) {
        let asked_for = std::env::var(name).ok().and_then(|number| number.parse::<u64>().ok());
        ensure!(
            asked_for.is_none_or(|threads| threads <= u64::from(THREADS_MAX)),
            "{name} is more than {THREADS_MAX}; lower it, or give --threads"
        );
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(cli.threads())
        .stack_size(STACK_BYTES)
        .build_global()
        .map_err(|error| anyhow::anyhow!("threads cannot be started ({error}); ask for fewer with --threads"))?;
    // Within the pool: a thread outside it goes to sleep and is woken up at every parallel step, three times per control
    // tick. On a busy machine that costs more than the driving.
    rayon::scope(|_| cli.run())
}
