//! How many pixels of the perceived bird's-eye view are right.

use experiment::lots::Lot;
use experiment::settings::{NoiseChoice, Settings};
use experiment::trials::{self, Purpose, Trial};
use rayon::prelude::*;
use serde::Serialize;
use sim::scenario::Direction;
use sim::sensing::{BEV_PIXELS, Sensor};

/// Between two poses along the route, metres.
pub const SPACING_M: f32 = 1.0;
/// Ticks between them at the paper's 1.43 m/s.
const TICKS_PER_POSE: u32 = 14;

/// The paper's accuracies (docs/methods.md 0).
pub const PAPER: [(&str, f64); 3] = [("lot-a", 98.14), ("lot-b", 97.75), ("lot-c", 97.85)];

/// Pixels, summed over poses.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Pixels {
    /// Poses looked from.
    pub poses: u64,
    /// Free pixels that seem occupied.
    pub false_occupied: u64,
    /// Occupied pixels that seem free.
    pub false_free: u64,
    /// Occupied pixels.
    pub occupied: u64,
    /// Cells of the grid that are wrong.
    pub cells_wrong: u64,
}

/// Looks along the routes of a lot, both ways, in so many trials.
///
/// # Errors
/// If the lot cannot be driven.
pub fn look(settings: &Settings, lot: &Lot, noise: NoiseChoice, trials: u32) -> anyhow::Result<Pixels> {
    let lots = std::slice::from_ref(lot);
    let trials: Vec<_> = Trial::all(settings.seed, Purpose::Calibration, lots, trials, &Direction::BOTH).collect();
    let parts =
        trials.par_iter().map(|trial| along_route(settings, trial, noise)).collect::<anyhow::Result<Vec<_>>>()?;
    Ok(parts.into_iter().fold(Pixels::default(), Pixels::plus))
}

fn along_route(settings: &Settings, trial: &Trial<'_>, noise: NoiseChoice) -> anyhow::Result<Pixels> {
    let map = trial.map(&settings.episode)?;
    let episode = trials::episode_settings(&settings.episode, noise, &map);
    let sensor = Sensor::new(&map, episode.sensing.clone(), &episode.noise, trial.episode_seed());
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
}
