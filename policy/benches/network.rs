//! Answers of the network; trainings are measured by `cargo xtask bench`. `cargo bench --profile dev -p policy` shares the optimised
//! development profile (and its artefacts) with everything else.

use divan::{Bencher, counter::ItemsCount};
use policy::network::{InferenceSettings, NetworkArchitecture, Predictor, Weights};
use sim::seed::RootSeed;
use sim::sensing::OccupancyGrid;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    divan::main();
}

const NETS: [&str; 2] = ["compact", "paper"];

fn net(name: &str) -> NetworkArchitecture {
    match name {
        "compact" => NetworkArchitecture { modes: 1, ..NetworkArchitecture::compact() },
        _ => NetworkArchitecture::paper(),
    }
}

/// A lane between two rows of parked cars, at varying offsets.
fn grids(count: usize) -> Vec<OccupancyGrid> {
    (0..count)
        .map(|index| {
            let mut grid = OccupancyGrid::free();
            let edge = 6 + index % 5;
            for row in 0..25 {
                for col in (0..edge).chain(edge + 11..25) {
                    let is_gap = (row + index) % 9 < 2;
                    if !is_gap || col % 7 < 3 {
                        grid.set_occupied(row, col);
                    }
                }
            }
            grid
        })
        .collect()
}

#[divan::bench(args = [1, 16, 64, 512], consts = [0, 1], sample_count = 20)]
fn infer<const NET: usize>(bencher: Bencher<'_, '_>, batch: usize) {
    let grids = grids(batch);
    let grids: Vec<_> = grids.iter().collect();
    let inference = if NETS[NET] == "paper" { InferenceSettings::plain() } else { InferenceSettings::smoothed() };
    let weights = Weights::init(net(NETS[NET]), RootSeed(1), 0);
    let predictor = Predictor::new(&weights, inference);
    predictor.predict(&grids);
    bencher.counter(ItemsCount::new(batch)).bench_local(|| predictor.predict(&grids));
}
