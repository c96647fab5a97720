//! What holds for all baselines.

use super::*;
use proptest::prelude::*;

pub(super) fn rig() -> PlannerContext {
    PlannerContext::of(&EpisodeSettings::paper())
}

/// A grid with these cells (row, column) occupied.
pub(super) fn grid_with(cells: &[(usize, usize)]) -> OccupancyGrid {
    let mut grid = OccupancyGrid::free();
    for &(row, col) in cells {
        grid.set_occupied(row, col);
    }
    grid
}

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
fn distances_to_occupied_cells_are_exact() {
    let geometry = GridGeometry::paper();
    let nearest = |cells: &[(usize, usize)], x, y, range_m| {
        nearest_occupied(&grid_with(cells), &geometry, Vec2::new(x, y), range_m)
    };
    // Cell (24, 12) is the square X 4.30…4.78, |Y| ≤ 0.24.
    let ahead = nearest(&[(24, 12)], 3.8, 0.0, 2.0).unwrap();
    assert!((ahead.distance_m - 0.5).abs() < 1e-5 && ahead.away.distance(-Vec2::X) < 1e-5, "{ahead:?}");
    let beside = nearest(&[(24, 12)], 4.5, 1.24, 2.0).unwrap();
    assert!((beside.distance_m - 1.0).abs() < 1e-5 && beside.away.distance(Vec2::Y) < 1e-5, "{beside:?}");
    let corner = nearest(&[(24, 12)], 4.0, 0.64, 2.0).unwrap(); // 3-4-5
    assert!((corner.distance_m - 0.5).abs() < 1e-5 && corner.away.distance(Vec2::new(-0.6, 0.8)) < 1e-4, "{corner:?}");
    assert_eq!(nearest(&[(24, 12)], 3.8, 0.0, 0.49), None);
    assert_eq!(nearest(&[(24, 12)], 4.5, 0.0, 1.0).unwrap().distance_m, 0.0);
    // Midway between two cells they cancel.
    let between = nearest(&[(20, 10), (20, 14)], 6.46, 0.0, 2.0).unwrap();
    assert!((between.distance_m - 0.72).abs() < 1e-5 && between.away.length() < 1e-6, "{between:?}");
}

#[test]
fn the_farthest_visible_point_is_the_end_of_the_longest_free_line() {
    let sight = Sight::new(&rig());
    let mut wall = OccupancyGrid::free();
    wall.occupy_row(10, u32::MAX);
    // Row 10 spans X 11.02…11.50. Straight ahead 7.2 m are free, at 45° the line leaves the patch after 8.5 m.
    let goal = sight.goal(Goal::FarthestVisible, &wall);
    assert!(goal.distance(rig().bumper()) > 8.0 && goal.x < 11.1 && goal.y > 0.0, "{goal}");
    assert_eq!(sight.goal(Goal::Ahead, &wall), Vec2::new(16.3, 0.0));
    // Nothing is visible.
    assert_eq!(sight.goal(Goal::FarthestVisible, &OccupancyGrid::occupied()), Vec2::new(16.3, 0.0));
}

/// The walk goes up to the wall and stops 0.2 m before it, whatever the field says.
#[test]
fn a_walk_ends_before_obstacles_and_at_the_edges() {
    let mut wall = OccupancyGrid::free();
    wall.occupy_row(20, u32::MAX); // X 6.22…6.70
    let end = walk_along_field(&wall, &rig(), 2.3, 6.0, |_, _| Vec2::X);
    assert!((end.x - 6.0).abs() < 1e-3 && end.y == 0.0, "{end}");
    let sideways = walk_along_field(&OccupancyGrid::free(), &rig(), 2.3, 20.0, |_, _| Vec2::Y);
    assert!((sideways.y - 6.0).abs() < 0.1 && sideways.x == rig().bumper().x, "{sideways}");
    let back = walk_along_field(&OccupancyGrid::free(), &rig(), 2.3, 6.0, |_, _| -Vec2::X);
    assert!(back.x >= 0.0 && back.x < 0.1 && back.y == 0.0, "not beyond the rear axle: {back}");
    let weak = walk_along_field(&OccupancyGrid::free(), &rig(), 2.3, 1.0, |_, _| 0.04 * Vec2::Y);
    assert!((weak.x - rig().bumper().x - 1.0).abs() < 1e-4 && weak.y == 0.0, "{weak}");
}

#[test]
fn arcs_are_answered_with_points_that_pure_pursuit_drives_back() {
    for curvature in [-0.25, -0.1, 0.0, 0.03, 0.25] {
        let decision = steer_along(curvature);
        assert!((decision.look_ahead.curvature_per_m() - curvature).abs() < 1e-5);
        assert!(decision.look_ahead.ahead_m > 3.0);
        assert_eq!(decision.source, Source::Planner);
    }
    assert!((rig().speed_mps(0.0) - 2.2).abs() < 1e-6 && (rig().speed_mps(0.2507) - 0.5).abs() < 1e-3);
}

#[test]
fn the_wheels_turn_as_fast_as_they_can() {
    let mut wheel = WheelEstimate::new(&rig());
    wheel.command_rad = 0.03;
    assert!((wheel.advance() - 0.0172).abs() < 1e-6); // 0.344 rad/s · 50 ms
    assert!((wheel.advance() - 0.03).abs() < 1e-6);
    wheel.reset();
    assert_eq!(wheel.advance(), 0.0);
}

#[test]
fn parameters_survive_toml_and_wrong_ones_are_refused() {
    for baseline in Baseline::all() {
        baseline.check().unwrap();
        let parameters = baseline.parameters();
        assert_eq!(baseline.with_parameters(parameters.clone()).unwrap(), baseline, "{}", baseline.name());
        let mut unknown = parameters.clone();
        unknown.insert("typo".to_owned(), toml::Value::Integer(1));
        assert!(baseline.with_parameters(unknown).unwrap_err().to_string().contains("typo"));
        for key in parameters.keys() {
            let mut missing = parameters.clone();
            missing.remove(key);
            assert!(baseline.with_parameters(missing).unwrap_err().to_string().contains(key), "{key}");
        }
    }
    assert_eq!(Baseline::Vvf(vvf::Params::paper()).parameters()["range_m"].as_float(), Some(2.3));
    let wide = Baseline::Vvf(vvf::Params { mask: 1.5, ..vvf::Params::paper() });
    assert!(wide.check().unwrap_err().contains("mask"));
}

/// The tuner starts at the paper's parameters, and every corner of the space makes a sound planner.
#[test]
fn search_spaces_hold_the_starting_point() {
    for baseline in Baseline::all() {
        let start = baseline.to_unit_cube();
        let there_and_back = baseline.at(&start).to_unit_cube();
        assert!(start.iter().zip(&there_and_back).all(|(a, b)| (a - b).abs() < 1e-4), "{}", baseline.name());
        let dimensions = start.len();
        assert_eq!(baseline.search_space().len(), dimensions);
        for corner in 0..1_u32 << dimensions {
            let unit: Vec<f32> = (0..dimensions).map(|bit| (corner >> bit & 1) as f32).collect();
            baseline.at(&unit).check().unwrap();
        }
        for (name, _) in baseline.search_space() {
            assert!(baseline.parameters().contains_key(name), "{name} is no parameter of {}", baseline.name());
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
            Baseline::all().iter().map(|baseline| (baseline.name(), baseline.planner(&rig()))).collect()
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
    for baseline in Baseline::all() {
        let mut planner = baseline.planner(&rig());
        for grid in [OccupancyGrid::free(), OccupancyGrid::occupied(), grid_with(&alternating)] {
            for _ in 0..40 {
                let point = planner.act(&Observation { grid }).look_ahead;
                assert!(point.ahead_m.is_finite() && point.left_m.is_finite(), "{}: {point:?}", baseline.name());
            }
        }
    }
}
