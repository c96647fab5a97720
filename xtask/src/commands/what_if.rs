//! `what-if`: how many near-collisions are avoided if one thing is replaced by the truth.

use crate::args::JsonArgs;
use crate::console::Console;
use crate::output::Output;
use clap::Args;
use evaluation::avoidable;
use experiment::progress::Interrupted;
use experiment::trained;
use report::what_if;
use std::path::PathBuf;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask what-if runs/evaluate-default-s1                       of each driver
  cargo xtask what-if runs/evaluate-default-s1 --driver run:runs/train-dagger-default-s1

From 6 s before each near-collision the car is driven on: with nothing changed, on the clean grid, without dead time, without
action smoothing, by an expert that sees the clean patch alone; and by the expert, from 24 s to 0.5 s before. The table counts the
places that are passed.";

#[derive(Debug, Clone, Args)]
pub(crate) struct WhatIfArgs {
    /// Folder of an evaluation, or of a training that ended with one; its settings are used.
    #[arg(value_name = "RUN")]
    folder: PathBuf,
    /// Its drivers, as named in its tables [default: all].
    #[arg(long = "driver", value_name = "NAME", num_args = 1..)]
    drivers: Vec<String>,
    #[command(flatten)]
    pub(crate) json: JsonArgs,
}

pub(crate) fn run(args: &WhatIfArgs, output: &Output) -> anyhow::Result<()> {
    let settings = trained::settings_of(&args.folder)?;
    let console = Console::new(output);
    let Some(rows) = avoidable::of_evaluation(&args.folder, &settings, &args.drivers, &console)? else {
        return Err(Interrupted { kept: "nothing is written".to_owned() }.into());
    };
    let text = || {
        if rows.is_empty() {
            "no near-collisions".to_owned()
        } else {
            format!("{}\n\n{}", what_if::table(&rows), what_if::NOTES)
        }
    };
    output.table(text, &rows)
}
