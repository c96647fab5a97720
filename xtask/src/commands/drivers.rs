//! `drivers`: how drivers are named, or the parameters of one planner as a file.

use crate::args::JsonArgs;
use crate::output::Output;
use clap::Args;
use experiment::drivers::{self, PlannerFile};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask drivers
  cargo xtask drivers vvf > mine.toml                       edit, then drive with it:
  cargo xtask evaluate --driver vvf --driver vvf:mine.toml";

#[derive(Debug, Clone, Args)]
pub(crate) struct DriversArgs {
    /// A planner, whose parameters are printed as the file that `NAME:FILE` reads.
    #[arg(value_name = "PLANNER", conflicts_with = "json")]
    planner: Option<String>,
    #[command(flatten)]
    pub(crate) json: JsonArgs,
}

pub(crate) fn run(args: &DriversArgs, output: &Output) -> anyhow::Result<()> {
    if let Some(name) = &args.planner {
        output.print(PlannerFile::text_of(name)?.trim_end());
        return Ok(());
    }
    let specs = drivers::specs();
    let names: Vec<(&str, &str)> = specs.iter().map(|(spec, about)| (spec.as_str(), about.as_str())).collect();
    output.names(&names)
}
