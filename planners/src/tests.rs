//! What holds for every planner.

use crate::method::Method as _;
use crate::registry::{Planner, PlannerSpec};
use crate::test_scenes::{context, grid_with};
use crate::vvf;
use proptest::prelude::*;
use sim::driver::{LookAheadPoint, Policy as _};
use sim::sensing::{GRID_CELLS, Observation, OccupancyGrid};

/// A grid, every row of which is like the last one but for a few cells.
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
        let there_and_back = spec.at(&start).to_unit_cube();
        assert!(start.iter().zip(&there_and_back).all(|(a, b)| (a - b).abs() < 1e-4), "{}", spec.name());
        let dimensions = start.len();
        assert_eq!(spec.search_space().len(), dimensions);
        for corner in 0..1_u32 << dimensions {
            let unit: Vec<f32> = (0..dimensions).map(|bit| (corner >> bit & 1) as f32).collect();
            spec.at(&unit).check().unwrap();
        }
        for (name, _) in spec.search_space() {
            assert!(spec.parameters().contains_key(name), "{name} is no parameter of {}", spec.name());
        }
    }
}

/// Two grids after each other: state included.
fn answers(planner: &Planner, grids: [OccupancyGrid; 2]) -> [LookAheadPoint; 2] {
    let mut planner = planner.clone();
    grids.map(|grid| planner.act(&Observation { grid }).look_ahead)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn answers_are_finite_repeatable_and_mirror_images(first in grids(), second in grids()) {
        use std::sync::LazyLock;
        static PLANNERS: LazyLock<Vec<(&str, Planner)>> = LazyLock::new(|| {
            PlannerSpec::all().iter().map(|spec| (spec.name(), spec.planner(&context()))).collect()
        });
        for (name, planner) in PLANNERS.iter() {
            let found = answers(planner, [first, second]);
            prop_assert!(found.iter().all(|point| point.ahead_m.is_finite() && point.left_m.is_finite()), "{name}");
            prop_assert_eq!(found, answers(planner, [first, second]), "{}", name);
            let mirrored = answers(planner, [first.mirrored(), second.mirrored()]);
            for (point, image) in found.iter().zip(&mirrored) {
                let turned = (point.left_m + image.left_m).abs() + (point.ahead_m - image.ahead_m).abs();
                // Where two mirror images cost the same, either is right: a tie is broken to one side.
                let is_tie = point.left_m == image.left_m && point.ahead_m == image.ahead_m;
                prop_assert!(turned < 2e-3 || is_tie, "{}: {:?} and {:?}", name, point, image);
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
    for spec in PlannerSpec::all() {
        let mut planner = spec.planner(&context());
        for grid in [OccupancyGrid::free(), OccupancyGrid::occupied(), grid_with(&alternating)] {
            for _ in 0..40 {
                let point = planner.act(&Observation { grid }).look_ahead;
                assert!(point.ahead_m.is_finite() && point.left_m.is_finite(), "{}: {point:?}", spec.name());
            }
        }
    }
}
