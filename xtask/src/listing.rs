//! `settings`, `lots`, `drivers`: what there is.

use crate::cli::SettingsArgs;
use crate::settings::{PRESETS, Settings};
use crate::{drivers, lots};

/// Prints the resolved settings as TOML, which `--config` reads again.
///
/// # Errors
/// If a layer is wrong.
pub fn settings(args: &SettingsArgs) -> anyhow::Result<()> {
    let settings = Settings::resolve(&args.layers, args.seed)?;
    for preset in PRESETS {
        println!("# --preset {:8} {}", preset.name, preset.about);
    }
    print!("\n{}", settings.to_toml());
    Ok(())
}

/// Prints how lots are named.
///
/// # Errors
/// None so far.
pub fn lots() -> anyhow::Result<()> {
    print_specs(&lots::SPECS);
    Ok(())
}

/// Prints how drivers are named.
///
/// # Errors
/// None so far.
pub fn drivers() -> anyhow::Result<()> {
    print_specs(&drivers::SPECS);
    Ok(())
}

fn print_specs(specs: &[(&str, &str)]) {
    for (spec, about) in specs {
        println!("{spec:14} {about}");
    }
}
