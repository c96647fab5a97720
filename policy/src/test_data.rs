//! What the tests of several modules need.

use crate::dataset::{Collection, EpisodeRecord, Round, Sample, Tick};
use rand::RngExt as _;
use sim::driver::Source;
use sim::scenario::Direction;
use sim::seed::{RootSeed, Stream};
use sim::sensing::OccupancyGrid;
use std::fs;
use std::path::PathBuf;

/// A folder of this test, empty.
pub(crate) fn scratch(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("policy-test-{}-{name}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    folder
}

/// Grids like those of a parking lot: free ground, blocks of cars, some speckle.
pub(crate) fn lots(count: usize) -> Vec<OccupancyGrid> {
    let mut rng = RootSeed(11).rng(Stream::Layout, 0);
    (0..count)
        .map(|_| {
            let mut grid = OccupancyGrid::free();
            for _ in 0..4 {
                let (row, col) = (rng.random_range(0..25), rng.random_range(0..25));
                for r in row..(row + 7).min(25) {
                    for c in col..(col + 5).min(25) {
                        grid.set_occupied(r, c);
                    }
                }
            }
            for _ in 0..20 {
                grid.set_occupied(rng.random_range(0..25), rng.random_range(0..25));
            }
            grid
        })
        .collect()
}

/// Samples whose label can be read off the grid: the mass of occupied cells decides.
pub(crate) fn round(count: usize) -> Round {
    let samples: Vec<_> = lots(count)
        .into_iter()
        .enumerate()
        .map(|(index, grid)| {
            let left = (0..25).flat_map(|row| (0..12).map(move |col| (row, col)));
            let left = left.filter(|&(row, col)| grid.is_occupied(row, col)).count() as f32;
            let right = grid.count_occupied() as f32 - left;
            let tau_hat = if index % 7 == 0 { 0.3 } else { 0.0 };
            Sample { grid, label: [0.5 + 0.003 * (left - right), 0.2 + 0.002 * (left + right)], tau_hat }
        })
        .collect();
    samples.into()
}

/// A round as it is collected, with `each` noise augmentations per sample, and its record.
pub(crate) fn collected(samples: usize, each: usize) -> (Round, Collection) {
    let tick = |index: usize| {
        let along = index as f32;
        Tick {
            episode: (index / 20) as u32,
            tick: (index % 20) as u32,
            time_s: 0.05 * along,
            x_m: along,
            y_m: -along,
            heading_rad: 0.1,
            speed_mps: 1.5,
            steering_rad: 0.02,
            command_steering_rad: 0.03,
            command_speed_mps: 1.6,
            driver: [Source::Expert, Source::Novice][index % 2],
        }
    };
    let mut round = round(samples);
    round.ticks = (0..samples).map(tick).collect();
    round.noise_augmentations =
        round.samples.iter().flat_map(|sample| std::iter::repeat_n(sample.grid.mirrored(), each)).collect();
    let record = EpisodeRecord {
        lot: "bent lane".to_owned(),
        direction: Direction::Reverse,
        samples,
        near_collisions: 1,
        driven_m: 30.0,
    };
    let collection = Collection {
        round: 0,
        samples,
        noise_augmentations: each,
        ticks: samples as u64,
        novice_ticks: 3,
        tau_hat_sum: 0.25,
        driven_s: 2.5,
        near_collisions: 1,
        driven_m: 30.0,
        effort: None,
        agreement: None,
        episodes: vec![record],
    };
    (round, collection)
}
