//! `lots`: how lots are named.

use clap::Args;
use experiment::lots;

#[derive(Debug, Clone, Args)]
pub(crate) struct LotsArgs {}

pub(crate) fn run(_: &LotsArgs) -> anyhow::Result<()> {
    for (spec, about) in lots::SPECS {
        println!("{spec:15} {about}");
    }
    Ok(())
}
