//! `settings`: the resolved settings as TOML, which `--config` reads again.

use crate::args::LayerArgs;
use clap::Args;
use experiment::settings::{Layers, PRESETS, Settings};

#[derive(Debug, Clone, Args)]
pub(crate) struct SettingsArgs {
    #[command(flatten)]
    layers: LayerArgs,
    /// Root seed of training data, weights and shuffling.
    #[arg(long)]
    seed: Option<u64>,
}

pub(crate) fn run(args: &SettingsArgs) -> anyhow::Result<()> {
    let settings = Settings::resolve(&Layers::from(&args.layers), args.seed)?;
    for preset in PRESETS {
        println!("# --preset {:8} {}", preset.name, preset.about);
    }
    print!("\n{}", settings.to_toml());
    Ok(())
}
