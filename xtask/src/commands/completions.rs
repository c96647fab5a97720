//! `completions`: what completes commands and flags in a shell.

use crate::output::Output;
use anyhow::Context as _;
use clap::{Args, Command};
use clap_complete::Shell;

pub(crate) const EXAMPLES: &str = "\
Shells complete the name of a program, so give it one:
  cargo build -p xtask && ln -s \"$PWD/target/debug/xtask\" ~/.local/bin/lotpilot
  cargo xtask completions bash > ~/.local/share/bash-completion/completions/lotpilot";

#[derive(Debug, Clone, Args)]
pub(crate) struct CompletionsArgs {
    /// Shell to print the script for.
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

pub(crate) fn run(args: &CompletionsArgs, command: Command, output: &Output) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command.bin_name("lotpilot"), "lotpilot", &mut script);
    output.print(String::from_utf8(script).context("scripts are text")?.trim_end());
    Ok(())
}
