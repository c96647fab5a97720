//! `settings`: the resolved settings as TOML, which `--config` reads again, or what one of them means.

use crate::args::LayerArgs;
use crate::output::Output;
use clap::Args;
use experiment::settings::{Layers, PRESETS, Settings, reference};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask settings > mine.toml                  the settings that most users need; edit, then --config mine.toml
  cargo xtask settings --preset paper --all
  cargo xtask settings --explain dagger.eta         meaning, unit, range, defaults, source
  cargo xtask settings --explain dagger.fit         every setting of a section";

#[derive(Debug, Clone, Args)]
pub(crate) struct SettingsArgs {
    /// Explains a setting, or lists those of a section.
    #[arg(long, value_name = "KEY", conflicts_with_all = ["all", "seed", "preset", "config", "overrides"])]
    explain: Option<String>,
    /// Prints every setting, not only those that most users need.
    #[arg(long)]
    all: bool,
    /// Root seed of training data, weights and shuffling.
    #[arg(long)]
    seed: Option<u64>,
    #[command(flatten)]
    layers: LayerArgs,
}

pub(crate) fn run(args: &SettingsArgs, output: &Output) -> anyhow::Result<()> {
    if let Some(key) = &args.explain {
        output.print(reference::explain(key)?.trim_end());
        return Ok(());
    }
    let settings = Settings::resolve(&Layers::from(&args.layers), args.seed)?;
    for preset in PRESETS {
        output.print(format_args!("# --preset {:8} {}", preset.name, preset.about));
    }
    if args.all {
        output.print(format_args!("\n{}", settings.to_commented_toml().trim_end()));
    } else {
        output.print("# Every other setting: cargo xtask settings --all");
        output.print(format_args!("\n{}", settings.common_to_commented_toml().trim_end()));
    }
    Ok(())
}
