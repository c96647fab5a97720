//! `pixel-accuracy`: how many pixels of the perceived bird's-eye view are right.

use crate::cli::PixelAccuracyArgs;
use crate::interrupt::{self, Interrupted};
use crate::lots::Lot;
use crate::progress::Work;
use crate::report::markdown;
use crate::settings::{NoiseChoice, Settings};
use crate::trials::{Purpose, Trial, episode_config};
use anyhow::ensure;
use rayon::prelude::*;
use sim::scenario::Direction;
use sim::sensing::{BEV_PIXELS, Sensor};

/// Between two poses along the route, metres.
const SPACING_M: f32 = 1.0;
/// Ticks between them at the paper's 1.43 m/s.
const TICKS_PER_POSE: u32 = 14;

/// The paper's accuracies (methods.md 0).
const PAPER: [(&str, f64); 3] = [("lot-a", 98.14), ("lot-b", 97.75), ("lot-c", 97.85)];

/// Shares of pixels, summed over poses.
#[derive(Debug, Clone, Copy, Default)]
struct Pixels {
    poses: u64,
    false_occupied: u64,
    false_free: u64,
    occupied: u64,
    cells_wrong: u64,
}

/// The command.
///
/// # Errors
/// If something named does not exist, or by Ctrl-C.
pub fn run(args: &PixelAccuracyArgs) -> anyhow::Result<()> {
    ensure!(args.trials > 0, "--trials is 0; at least one is needed");
    let settings = Settings::resolve(&args.settings.layers, args.settings.seed)?;
    let lots = Lot::parse_all(&args.lots)?;
    let header = [
        "lot",
        "level",
        "poses",
        "accuracy %",
        "paper %",
        "false occupied %",
        "false free %",
        "cells wrong %",
        "occupied %",
    ];
    let mut table = markdown(header.map(str::to_owned).to_vec());
    let mut work = Work::begin("looking");
    let stretches = (lots.len() * args.level.len()) as f64;
    let mut done = 0.0;
    for lot in &lots {
        for &noise in &args.level {
            if interrupt::is_requested() {
                println!("{table}");
                return Err(Interrupted { kept: "the table holds what was measured".to_owned() }.into());
            }
            work.at(done / stretches, || lot.name().to_owned());
            let pixels = look(&settings, lot, noise, args.trials)?;
            table.add_row(pixels.row(lot.name(), noise));
            done += 1.0;
        }
    }
    work.end(&format!("{} lots", lots.len()));
    println!(
        "{table}\n\nPoses every {SPACING_M} m along the routes, both directions, trials: {}, seed: {}.",
        args.trials, settings.seed.0
    );
    Ok(())
}

fn look(settings: &Settings, lot: &Lot, noise: NoiseChoice, trials: u32) -> anyhow::Result<Pixels> {
    let lots = std::slice::from_ref(lot);
    let jobs: Vec<_> = Trial::all(settings.seed, Purpose::Calibration, lots, trials, &Direction::BOTH).collect();
    let parts = jobs.par_iter().map(|job| along_route(settings, job, noise)).collect::<anyhow::Result<Vec<_>>>()?;
    Ok(parts.into_iter().fold(Pixels::default(), Pixels::plus))
}

fn along_route(settings: &Settings, job: &Trial<'_>, noise: NoiseChoice) -> anyhow::Result<Pixels> {
    let map = job.map(&settings.episode)?;
    let episode = episode_config(settings, noise, &map);
    let sensor = Sensor::new(&map, episode.sensing.clone(), &episode.noise, job.episode_seed());
    let poses = (map.path().length_m() / SPACING_M) as u32;
    let mut pixels = Pixels::default();
    for index in 0..poses {
        let pose = map.path().pose_at(index as f32 * SPACING_M);
        let (clean, perceived) =
            (sensor.clean_view(&map, pose), sensor.perceived_view(&map, pose, index * TICKS_PER_POSE));
        for (row, col) in (0..BEV_PIXELS).flat_map(|row| (0..BEV_PIXELS).map(move |col| (row, col))) {
            let (is, seems) = (clean.is_occupied(row, col), perceived.is_occupied(row, col));
            pixels.occupied += u64::from(is);
            pixels.false_occupied += u64::from(!is && seems);
            pixels.false_free += u64::from(is && !seems);
        }
        let (is, seems) = (clean.to_grid(), perceived.to_grid());
        pixels.cells_wrong += is.cells().zip(seems.cells()).filter(|(is, seems)| is != seems).count() as u64;
        pixels.poses += 1;
    }
    Ok(pixels)
}

impl Pixels {
    fn plus(self, other: Self) -> Self {
        Self {
            poses: self.poses + other.poses,
            false_occupied: self.false_occupied + other.false_occupied,
            false_free: self.false_free + other.false_free,
            occupied: self.occupied + other.occupied,
            cells_wrong: self.cells_wrong + other.cells_wrong,
        }
    }

    fn row(&self, lot: &str, noise: NoiseChoice) -> Vec<String> {
        let pixels = (self.poses * (BEV_PIXELS * BEV_PIXELS) as u64) as f64;
        let cells = (self.poses * (sim::sensing::GRID_CELLS * sim::sensing::GRID_CELLS) as u64) as f64;
        let percent = |count: u64, of: f64| format!("{:.2}", 100.0 * count as f64 / of);
        let paper = PAPER.iter().find(|(name, _)| *name == lot && noise == NoiseChoice::Paper);
        vec![
            lot.to_owned(),
            noise.name(),
            self.poses.to_string(),
            format!("{:.2}", 100.0 - 100.0 * (self.false_occupied + self.false_free) as f64 / pixels),
            paper.map_or_else(|| "–".to_owned(), |(_, percent)| format!("{percent:.2}")),
            percent(self.false_occupied, pixels),
            percent(self.false_free, pixels),
            percent(self.cells_wrong, cells),
            percent(self.occupied, pixels),
        ]
    }
}
