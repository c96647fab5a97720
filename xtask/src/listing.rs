//! `settings`, `lots`, `drivers`: what there is.

use crate::cli::{DriversArgs, SettingsArgs};
use crate::drivers::{self, PlannerFile};
use crate::lots;
use crate::settings::{PRESETS, Settings};
use anyhow::Context as _;
use planners::Baseline;

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

/// Prints how drivers are named, or the parameters of one planner as a file.
///
/// # Errors
/// If there is no planner of the name.
pub fn drivers(args: &DriversArgs) -> anyhow::Result<()> {
    let Some(name) = &args.planner else {
        print_specs(&drivers::specs());
        return Ok(());
    };
    if let Some(text) = drivers::tuned_file(name) {
        print!("{text}");
        return Ok(());
    }
    let baselines = Baseline::all();
    let baseline = baselines.iter().find(|baseline| baseline.name() == name).with_context(|| {
        let names: Vec<&str> = baselines.iter().map(Baseline::name).collect();
        format!("no planner {name:?}; there are {}", names.join(", "))
    })?;
    println!("# {}", baseline.about());
    for (parameter, span) in baseline.search_space() {
        println!("# cargo xtask tune searches {parameter}: {span}");
    }
    let file = PlannerFile { planner: name.clone(), parameters: baseline.parameters(), search: None };
    print!("\n{}", toml::to_string(&file)?);
    Ok(())
}

fn print_specs(specs: &[(&str, &str)]) {
    for (spec, about) in specs {
        println!("{spec:15} {about}");
    }
}
