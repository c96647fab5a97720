//! One decision of each model-based planner in a lane with a corner.

use divan::{Bencher, black_box};
use planners::{PlannerContext, PlannerSpec};
use sim::driver::Policy as _;
use sim::episode::EpisodeSettings;
use sim::sensing::{Observation, OccupancyGrid};

fn main() {
    divan::main();
}

#[divan::bench(args = ["tentacle", "vvf", "dwa", "cvm", "apf", "vff", "mppi"])]
fn decision(bencher: Bencher<'_, '_>, name: &str) {
    let mut grid = OccupancyGrid::free();
    (0..6).for_each(|row| grid.occupy_row(row, u32::MAX));
    (6..16).for_each(|row| grid.occupy_row(row, 0x1FF_0000));
    (16..25).for_each(|row| grid.occupy_row(row, 0x1FF_01FF));
    let planners = PlannerSpec::all();
    let spec = planners.iter().find(|spec| spec.name() == name).expect("a planner's name");
    let mut planner = spec.planner(&PlannerContext::of(&EpisodeSettings::paper()));
    bencher.bench_local(|| planner.act(black_box(&Observation { grid })));
}
