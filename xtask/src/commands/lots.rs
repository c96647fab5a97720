//! `lots`: how lots are named.

use crate::args::JsonArgs;
use crate::output::Output;
use clap::Args;
use experiment::lots;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask lots
  cargo xtask render lot --lots lot-a,test:2:hard           draws them
  cargo xtask evaluate --driver expert --lots test:10";

#[derive(Debug, Clone, Args)]
pub(crate) struct LotsArgs {
    #[command(flatten)]
    pub(crate) json: JsonArgs,
}

pub(crate) fn run(_: &LotsArgs, output: &Output) -> anyhow::Result<()> {
    let specs = lots::specs();
    let names: Vec<(&str, &str)> = specs.iter().map(|(spec, about)| (*spec, about.as_str())).collect();
    output.names(&names)
}
