//! `pixel-accuracy`: how many pixels of the noisy bird's-eye view are right.

use crate::args::{JsonArgs, LayerArgs, lot_name};
use crate::console::{Console, counted_lots};
use crate::output::Output;
use clap::Args;
use evaluation::pixel_accuracy::{Pixels, SPACING_M, look};
use experiment::lots::Lot;
use experiment::notes;
use experiment::progress::{Interrupted, Progress as _};
use experiment::settings::{Layers, NoiseChoice, Settings};
use serde::Serialize;
use sim::limits::TRIAL_MAX;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask pixel-accuracy
  cargo xtask pixel-accuracy --lots test:5 --noise paper,hard --trials 2";

#[derive(Debug, Clone, Args)]
pub(crate) struct PixelAccuracyArgs {
    /// Lots to look at; see `cargo xtask lots`.
    #[arg(long, alias = "lot", value_name = "SPEC", num_args = 1.., value_delimiter = ',', value_parser = lot_name, default_value = "lot-a,lot-b,lot-c")]
    lots: Vec<String>,
    /// Sensor noise, one level or several: clean, paper, hard or multiples of paper, 0 to 10.
    #[arg(long, alias = "level", value_name = "LEVEL", num_args = 1.., value_delimiter = ',', default_value = "paper")]
    noise: Vec<NoiseChoice>,
    /// Trials per lot and direction.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=i64::from(TRIAL_MAX)))]
    trials: u32,
    /// Root seed of the trials.
    #[arg(long)]
    seed: Option<u64>,
    #[command(flatten)]
    pub(crate) json: JsonArgs,
    #[command(flatten)]
    layers: LayerArgs,
}

/// A row of the table, as JSON.
#[derive(Debug, Serialize)]
struct Row<'a> {
    lot: &'a str,
    noise: NoiseChoice,
    #[serde(flatten)]
    pixels: Pixels,
}

pub(crate) fn run(args: &PixelAccuracyArgs, output: &Output) -> anyhow::Result<()> {
    let mut settings = Settings::resolve(&Layers::from(&args.layers), args.seed)?;
    settings.evaluation.noise.clone_from(&args.noise);
    settings.check()?;
    let lots = Lot::parse_all(&args.lots, &settings.episode.vehicle)?;
    output.notes(&notes::of(&lots, &args.noise));
    let mut table = report::pixel_accuracy::table();
    let mut rows = Vec::new();
    let console = Console::new(output);
    console.begin("looking", "looking");
    let stretches = (lots.len() * args.noise.len()) as f64;
    let mut done = 0.0;
    for lot in &lots {
        for &noise in &args.noise {
            if console.is_cancelled() {
                output.table(|| table.to_string(), &rows)?;
                return Err(Interrupted { kept: "the table holds what was measured".to_owned() }.into());
            }
            console.at(done / stretches, &mut |_| lot.name().to_owned());
            let pixels = look(&settings, lot, noise, args.trials)?;
            table.add_row(report::pixel_accuracy::row(&pixels, lot.name(), noise));
            rows.push(Row { lot: lot.name(), noise, pixels });
            done += 1.0;
        }
    }
    console.end(&counted_lots(lots.len()));
    let (trials, seed) = (args.trials, settings.seed.0);
    let note = format!("Poses every {SPACING_M} m along the routes, both directions, trials: {trials}, seed: {seed}.");
    output.table(|| format!("{table}\n\n{note}"), &rows)
}
