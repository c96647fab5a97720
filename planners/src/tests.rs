//! What holds for every planner.

use crate::context::head_for;
use crate::method::Method as _;
use crate::registry::{Planner, PlannerSpec};
use crate::test_scenes::{context, grid_with};
use crate::vvf;
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::TestRunner;
use sim::driver::{Decision, LookAheadPoint, Policy};
use sim::geometry::Vec2;
use sim::sensing::{GRID_CELLS, Observation, OccupancyGrid};

/// A grid, every row of which is like the last one except for a few cells.
fn grids() -> impl Strategy<Value = OccupancyGrid> {
    (any::<u32>(), any::<u32>(), proptest::collection::vec((any::<u32>(), any::<u32>(), any::<u32>()), GRID_CELLS))
        .prop_map(|(left, right, rows)| {
            // Walls of random width on both sides, some clutter.
            let walls = ((1_u32 << (left % 12)) - 1) | !((1_u32 << (25 - right % 12)) - 1);
            let mut grid = OccupancyGrid::free();
            for (row, (a, b, c)) in rows.into_iter().enumerate() {
                grid.occupy_row(row, walls | a & b & c);
            }
            grid
        })
}

#[test]
fn readings_are_sound_and_named_behind_their_method() {
    for spec in PlannerSpec::all() {
        assert_eq!(PlannerSpec::named(spec.name()).as_ref(), Some(&spec));
        for (reading, _, read) in spec.readings() {
            read.check().unwrap();
            assert_ne!(read, spec, "{reading}");
            assert_eq!(PlannerSpec::named(&format!("{}/{reading}", spec.name())), Some(read));
        }
    }
    assert_eq!(PlannerSpec::named("dwa/typo"), None);
    assert_eq!(PlannerSpec::named("vvf/fox"), None, "that is a reading of dwa");
}

#[test]
fn parameters_survive_toml_and_wrong_ones_are_refused() {
    for spec in PlannerSpec::all() {
        spec.check().unwrap();
        let parameters = spec.parameters();
        assert_eq!(spec.with_parameters(parameters.clone()).unwrap(), spec, "{}", spec.name());
        let mut unknown = parameters.clone();
        unknown.insert("typo".to_owned(), toml::Value::Integer(1));
        assert!(spec.with_parameters(unknown).unwrap_err().to_string().contains("typo"));
        for key in parameters.keys() {
            let mut missing = parameters.clone();
            missing.remove(key);
            assert!(spec.with_parameters(missing).unwrap_err().to_string().contains(key), "{key}");
        }
    }
    assert_eq!(PlannerSpec::Vvf(vvf::Params::paper()).parameters()["range_m"].as_float(), Some(2.3));
    let wide = PlannerSpec::Vvf(vvf::Params { mask: 1.5, ..vvf::Params::paper() });
    assert!(wide.check().unwrap_err().contains("mask"));
}

/// The tuner starts at the paper's parameters, and every corner of the space makes a sound planner.
#[test]
fn search_spaces_hold_the_starting_point() {
    for spec in PlannerSpec::all() {
        let start = spec.to_unit_cube();
        let there_and_back = spec.at(&start).parameters();
        for (key, value) in spec.parameters() {
            let is_same = match (value.as_float(), there_and_back[&key].as_float()) {
                (Some(value), Some(back)) => (value - back).abs() <= 1e-4 * value.abs(),
                _ => value == there_and_back[&key],
            };
            assert!(is_same, "{}: {key} = {value} became {}", spec.name(), there_and_back[&key]);
        }
        let dimensions = start.len();
        assert_eq!(spec.search_space().len(), dimensions);
        for corner in 0..1_u32 << dimensions {
            let unit: Vec<f32> = (0..dimensions).map(|bit| (corner >> bit & 1) as f32).collect();
            spec.at(&unit).check().unwrap();
        }
        for (name, _) in spec.search_space() {
            assert!(spec.parameters().contains_key(name), "{name} is not a parameter of {}", spec.name());
        }
    }
}

/// Two grids after each other: state included.
fn answers<P: Policy + Clone>(planner: &P, grids: [OccupancyGrid; 2]) -> [LookAheadPoint; 2] {
    let mut planner = planner.clone();
    grids.map(|grid| planner.act(&Observation { grid }).look_ahead)
}

/// The share of grids to whose mirror images a planner gives the same answer, not the mirrored one. Where two mirror images
/// cost the same, either is right, and the tie is broken to one side.
fn share_of_ties<P: Policy + Clone>(planner: &P, grids: &[OccupancyGrid]) -> f32 {
    let is_tie = |grid: &&OccupancyGrid| {
        let [[point, _], [image, _]] = [**grid, grid.mirrored()].map(|grid| answers(planner, [grid; 2]));
        point == image && point.left_m != 0.0
    };
    grids.iter().filter(is_tie).count() as f32 / grids.len() as f32
}

/// Answers to the left whatever it is shown.
#[derive(Clone)]
struct BlindPlanner;

impl Policy for BlindPlanner {
    fn act(&mut self, _: &Observation) -> Decision {
        head_for(Vec2::new(8.0, 1.0))
    }
}

/// The tie that mirrored answers are excused for is not the rule: it must not excuse who does not look.
#[test]
fn a_planner_that_ignores_its_grid_is_no_mirror_image_of_itself() {
    let mut runner = TestRunner::deterministic();
    let grids: Vec<OccupancyGrid> = (0..48).map(|_| grids().new_tree(&mut runner).unwrap().current()).collect();
    assert_eq!(share_of_ties(&BlindPlanner, &grids), 1.0);
    for (name, spec) in PlannerSpec::in_every_reading() {
        let planner = spec.planner(&context());
        let share = share_of_ties(&planner, &grids);
        assert!(share < 0.4, "{name}: ties on {share} of the grids");
        // Nor does one pass that answers straight on whatever it is shown.
        let first = answers(&planner, [grids[0]; 2]);
        let others = grids.iter().filter(|grid| answers(&planner, [**grid; 2]) != first).count();
        assert!(others > grids.len() / 2, "{name}: {others} other answers");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn answers_are_finite_repeatable_and_mirror_images(first in grids(), second in grids()) {
        use std::sync::LazyLock;
        static PLANNERS: LazyLock<Vec<(String, Planner)>> = LazyLock::new(|| {
            PlannerSpec::in_every_reading().into_iter().map(|(name, spec)| (name, spec.planner(&context()))).collect()
        });
        for (name, planner) in PLANNERS.iter() {
            let found = answers(planner, [first, second]);
            prop_assert!(found.iter().all(|point| point.ahead_m.is_finite() && point.left_m.is_finite()), "{name}");
            prop_assert_eq!(found, answers(planner, [first, second]), "{}", name);
            let mirrored = answers(planner, [first.mirrored(), second.mirrored()]);
            for (point, image) in found.iter().zip(&mirrored) {
                let turned = (point.left_m + image.left_m).abs() + (point.ahead_m - image.ahead_m).abs();
                // Where two mirror images cost the same, either is right: a tie is broken to one side.
                // How rare that is, `a_planner_that_ignores_its_grid_is_no_mirror_image_of_itself` says.
                let is_tie = point == image;
                // MPPI weighs rollouts by exponentials of their costs: a rounding of these is millimetres of the answer.
                let allowed_m = if name.starts_with("mppi") { 1e-2 } else { 2e-3 };
                prop_assert!(turned < allowed_m || is_tie, "{}: {:?} and {:?}", name, point, image);
                if is_tie {
                    break; // From here on the two have different pasts.
                }
            }
        }
    }
}

#[test]
fn no_grid_makes_an_answer_that_is_not_finite() {
    let alternating: Vec<(usize, usize)> =
        (0..GRID_CELLS * GRID_CELLS).filter(|i| i % 2 == 0).map(|i| (i / GRID_CELLS, i % GRID_CELLS)).collect();
    for (name, spec) in PlannerSpec::in_every_reading() {
        let mut planner = spec.planner(&context());
        for grid in [OccupancyGrid::free(), OccupancyGrid::occupied(), grid_with(&alternating)] {
            for _ in 0..40 {
                let decision = planner.act(&Observation { grid });
                let point = decision.look_ahead;
                assert!(point.ahead_m.is_finite() && point.left_m.is_finite(), "{name}: {decision:?}");
                assert!(decision.speed_limit_mps.is_none_or(f32::is_finite), "{name}: {decision:?}");
            }
        }
    }
}
