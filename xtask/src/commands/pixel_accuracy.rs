//! `pixel-accuracy`: how many pixels of the noisy bird's-eye view are right.

use crate::args::LayerArgs;
use crate::console::Console;
use anyhow::ensure;
use clap::Args;
use evaluation::pixel_accuracy::{SPACING_M, look};
use experiment::lots::Lot;
use experiment::progress::{Interrupted, Progress as _};
use experiment::settings::{Layers, NoiseChoice, Settings};

#[derive(Debug, Clone, Args)]
pub(crate) struct PixelAccuracyArgs {
    /// Lots to look at; see `cargo xtask lots`.
    #[arg(long, alias = "lot", value_name = "SPEC", num_args = 1.., value_delimiter = ',', default_value = "lot-a,lot-b,lot-c")]
    lots: Vec<String>,
    /// Noise levels.
    #[arg(long, value_name = "LEVEL", num_args = 1.., value_delimiter = ',', default_value = "paper")]
    noise: Vec<NoiseChoice>,
    /// Trials per lot and direction.
    #[arg(long, value_name = "N", default_value_t = 5)]
    trials: u32,
    /// Root seed of the trials.
    #[arg(long)]
    seed: Option<u64>,
    #[command(flatten)]
    layers: LayerArgs,
}

pub(crate) fn run(args: &PixelAccuracyArgs) -> anyhow::Result<()> {
    ensure!(args.trials > 0, "--trials is 0; at least one is needed");
    let settings = Settings::resolve(&Layers::from(&args.layers), args.seed)?;
    let lots = Lot::parse_all(&args.lots, &settings.episode.vehicle)?;
    let mut table = report::pixel_accuracy::table();
    let console = Console::default();
    console.begin("looking", "looking");
    let stretches = (lots.len() * args.noise.len()) as f64;
    let mut done = 0.0;
    for lot in &lots {
        for &noise in &args.noise {
            if console.is_cancelled() {
                println!("{table}");
                return Err(Interrupted { kept: "the table holds what was measured".to_owned() }.into());
            }
            console.at(done / stretches, &mut |_| lot.name().to_owned());
            let pixels = look(&settings, lot, noise, args.trials)?;
            table.add_row(report::pixel_accuracy::row(&pixels, lot.name(), noise));
            done += 1.0;
        }
    }
    console.end(&format!("{} lots", lots.len()));
    println!(
        "{table}\n\nPoses every {SPACING_M} m along the routes, both directions, trials: {}, seed: {}.",
        args.trials, settings.seed.0
    );
    Ok(())
}
