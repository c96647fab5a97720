//! `drivers`: how drivers are named, or the parameters of one planner as a file.

use clap::Args;
use experiment::drivers::{self, PlannerFile};

#[derive(Debug, Clone, Args)]
pub(crate) struct DriversArgs {
    /// A planner, whose parameters are printed as the file that `NAME:FILE` reads.
    #[arg(value_name = "PLANNER")]
    planner: Option<String>,
}

pub(crate) fn run(args: &DriversArgs) -> anyhow::Result<()> {
    match &args.planner {
        Some(name) => print!("{}", PlannerFile::text_of(name)?),
        None => {
            for (spec, about) in drivers::specs() {
                println!("{spec:15} {about}");
            }
        }
    }
    Ok(())
}
