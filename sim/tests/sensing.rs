//! The fast grid against brute force, noise anchored in the world, and ASCII art of a known lot.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

use sim::geometry::{Pose, Vec2};
use sim::map::Map;
use sim::maths;
use sim::scenario::{Island, NoiseLevel, Obstacle, ObstacleClass, Scenario, SpeedBump};
use sim::seed::RootSeed;
use sim::sensing::noise::{Layer, NoiseSettings};
use sim::sensing::{BEV_PIXELS, GRID_CELLS, GridGeometry, OccupancyGrid, SensingSettings, Sensor};
use sim::vehicle::VehicleSettings;

/// A 5 m lane along x with a parked car on the right, a cone on the left and a speed bump.
fn lane() -> Map {
    let obstacle = |class, x, y| Obstacle::new(class, Pose::new(Vec2::new(x, y), 0.0));
    let scenario = Scenario::lane(-10.0..=90.0, 5.0, 0.0..=60.0)
        .with_obstacles([
            obstacle(ObstacleClass::Sedan, 20.0, -1.9),
            obstacle(ObstacleClass::Cone, 30.0, 2.0),
            obstacle(ObstacleClass::Person, 40.0, -2.0),
        ])
        .with_speed_bumps([SpeedBump { x_m: 25.0, y_m: 0.0, heading_deg: 0.0, length_m: 0.8, width_m: 5.0 }]);
    Map::build(scenario, &VehicleSettings::hyundai_hg300()).unwrap()
}

/// Two rooms and a corridor behind thin walls, the boundary as high as they are.
fn rooms() -> Map {
    let rectangle = |x: f32, y: f32, length_m: f32, width_m: f32| Island {
        polygon: sim::geometry::rectangle(Pose::new(Vec2::new(x, y), 0.0), length_m, width_m).to_vec(),
        height_m: 2.0,
    };
    let mut scenario = Scenario::lane(-10.0..=90.0, 24.0, 0.0..=60.0);
    scenario.boundary.extend([(-10.0, 6.0), (-4.0, 6.0), (-4.0, 5.0), (-10.0, 5.0)].map(Vec2::from));
    scenario.boundary_height_m = 2.0;
    scenario.islands = vec![
        rectangle(30.0, 2.5, 50.0, 0.2),
        rectangle(20.0, -2.5, 30.0, 0.2),
        rectangle(50.0, -2.5, 20.0, 0.2),
        rectangle(25.0, 7.0, 0.3, 8.0),
    ];
    Map::build(scenario, &VehicleSettings::hyundai_hg300()).unwrap()
}

fn sensor(map: &Map, level: NoiseLevel, seed: u64) -> Sensor {
    let no_dropout = NoiseSettings { dropout: 0.0, ..NoiseSettings::of(level) };
    Sensor::new(map, SensingSettings::paper(), &no_dropout, RootSeed(seed))
}

#[test]
fn the_fast_grid_is_the_max_pool_of_the_brute_force_view() {
    let (lane, rooms) = (lane(), rooms());
    for (map, level, seed) in [
        (&lane, NoiseLevel::Clean, 1),
        (&lane, NoiseLevel::Paper, 2),
        (&lane, NoiseLevel::Paper, 3),
        (&lane, NoiseLevel::Hard, 4),
        (&rooms, NoiseLevel::Clean, 5),
        (&rooms, NoiseLevel::Paper, 6),
    ] {
        let mut sensor = sensor(map, level, seed);
        for i in 0..120_u32 {
            let pose =
                Pose::new(Vec2::new(i as f32 * 0.5, maths::sin(i as f32 * 0.37)), maths::sin(i as f32 * 0.21) * 0.9);
            let tick = 7 * i;
            let fast = sensor.observe(map, pose, tick).grid;
            let brute = sensor.perceived_view(map, pose, tick).to_grid();
            assert_eq!(fast, brute, "{level:?}, seed {seed}, tick {tick}\n{fast}\n{brute}");
        }
    }
}

/// Beyond 13 m the bound of the wobble was none: the lattice of the wobble had been made for 12 m.
#[test]
fn the_fast_grid_is_the_max_pool_on_wide_patches_as_well() {
    let map = lane();
    for side_m in [16.0, 24.0, 40.0] {
        let mut settings = SensingSettings::paper();
        settings.geometry.side_m = side_m;
        let mut sensor = Sensor::new(&map, settings, &NoiseSettings::of(NoiseLevel::Paper), RootSeed(3));
        for i in 0..40_u32 {
            let pose = Pose::new(Vec2::new(i as f32 * 0.5, 0.0), maths::sin(i as f32 * 0.21) * 0.9);
            let fast = sensor.observe(&map, pose, i).grid;
            let view = sensor.perceived_view(&map, pose, i).to_grid();
            assert_eq!(fast, view, "side {side_m} m, tick {i}\n{fast}\n{view}");
        }
    }
}

/// Cells may be open altogether through several openings that overlap.
#[test]
fn the_fast_grid_is_the_max_pool_where_openings_overlap() {
    let map = lane();
    let mut n_open_more = 0;
    for seed in 0..3 {
        let noise = NoiseSettings { false_free: 8.0, dropout: 0.0, ..NoiseSettings::of(NoiseLevel::Paper) };
        let mut sensor = Sensor::new(&map, SensingSettings::paper(), &noise, RootSeed(seed));
        for i in 0..120_u32 {
            let pose =
                Pose::new(Vec2::new(i as f32 * 0.5, maths::sin(i as f32 * 0.37)), maths::sin(i as f32 * 0.21) * 0.9);
            let fast = sensor.observe(&map, pose, i).grid;
            let brute = sensor.perceived_view(&map, pose, i).to_grid();
            assert_eq!(fast, brute, "seed {seed}, tick {i}\n{fast}\n{brute}");
            let clean = sensor.clean_view(&map, pose).to_grid();
            n_open_more += u32::from(fast.count_occupied() + 40 < clean.count_occupied());
        }
    }
    assert!(n_open_more > 50, "only {n_open_more} views are opened widely");
}

#[test]
fn a_straight_lane_looks_like_one() {
    let scenario = Scenario::lane(-10.0..=90.0, 3.0, 0.0..=60.0);
    let map = Map::build(scenario, &VehicleSettings::hyundai_hg300()).unwrap();
    let grid = sensor(&map, NoiseLevel::Clean, 0).observe(&map, Pose::default(), 0).grid;
    // Cells are 0.48 m: |y| ≤ 1.5 m holds the five cells of centre |y| ≤ 0.96 whole, and no more.
    for row in 0..GRID_CELLS {
        for col in 0..GRID_CELLS {
            assert_eq!(!grid.is_occupied(row, col), (10..=14).contains(&col), "({row}, {col})\n{grid}");
        }
    }
}

/// The world mirrored about the vehicle axis gives the mirrored grid: left is left in the map, the grid and `mirrored`.
#[test]
fn the_mirrored_world_gives_the_mirrored_grid() {
    // Away from the edges of pixels, which belong to one side.
    let view = |side: f32| {
        let things = [(ObstacleClass::Sedan, 20.0, -1.91), (ObstacleClass::Cone, 14.0, 1.93)];
        let obstacle = |(class, x, y): (ObstacleClass, f32, f32)| {
            Obstacle::new(class, Pose::new(Vec2::new(x, side * y), side * 0.1))
        };
        let scenario = Scenario::lane(-10.0..=90.0, 5.0, 0.0..=60.0).with_obstacles(things.map(obstacle));
        let map = Map::build(scenario, &VehicleSettings::hyundai_hg300()).unwrap();
        sensor(&map, NoiseLevel::Clean, 0).observe(&map, Pose::new(Vec2::new(8.01, side * 0.31), side * 0.03), 0).grid
    };
    let (grid, mirrored) = (view(1.0), view(-1.0));
    assert_eq!(mirrored, grid.mirrored(), "\n{mirrored}\n{}", grid.mirrored());
    assert_ne!(mirrored, grid);
    // The sedan, 12 m ahead, is on the right: columns > 12.
    let geometry = GridGeometry::paper();
    let row = ((geometry.far_edge_ahead_m() - 12.0) / geometry.cell_m()) as usize;
    assert!(grid.is_occupied(row, 15) && !grid.is_occupied(row, 11), "{grid}");
}

#[test]
fn things_hide_the_ground_behind_them_only_when_occlusion_is_on() {
    let map = lane();
    let occupied = |occlusion| {
        let settings = SensingSettings { occlusion, ..SensingSettings::paper() };
        let mut sensor = Sensor::new(&map, settings, &NoiseSettings::of(NoiseLevel::Clean), RootSeed(0));
        sensor.observe(&map, Pose::new(Vec2::new(10.0, 0.0), 0.0), 0).grid.count_occupied()
    };
    assert!(occupied(true) > occupied(false));
}

/// Whether a line of sight is free is asked of the raster of distances, step by step: nothing that the sensor uses.
#[test]
fn high_walls_hide_what_no_line_of_sight_reaches_and_low_ones_nothing() {
    let map = rooms();
    let low = {
        let mut scenario = map.scenario().clone();
        scenario.boundary_height_m = 0.0;
        scenario.islands.iter_mut().for_each(|island| island.height_m = sim::scenario::KERB_MAX_M);
        Map::build(scenario, &VehicleSettings::hyundai_hg300()).unwrap()
    };
    let settings = SensingSettings::paper();
    let geometry = settings.geometry;
    let (mut wrong, mut hidden) = (0, 0);
    for i in 0..40_u32 {
        let pose =
            Pose::new(Vec2::new(1.5 * i as f32, 0.3 * maths::sin(i as f32 * 0.37)), 0.5 * maths::sin(i as f32 * 0.7));
        let camera = pose.position() + pose.ahead() * settings.camera_ahead_m;
        let view = sensor(&map, NoiseLevel::Clean, 0).clean_view(&map, pose);
        let low_view = sensor(&low, NoiseLevel::Clean, 0).clean_view(&low, pose);
        for (row, col) in
            (0..BEV_PIXELS).step_by(7).flat_map(|row| (0..BEV_PIXELS).step_by(7).map(move |col| (row, col)))
        {
            let point = pose.world_from_ego().point(geometry.pixel_in_ego(row, col));
            let is_drivable = map.signed_distance_m(point) > 0.0;
            assert_eq!(low_view.is_occupied(row, col), !is_drivable, "low walls hide nothing");
            let steps = (camera.distance(point) / 0.02) as usize;
            let on_sight = |k: usize| map.signed_distance_m(camera.lerp(point, k as f32 / steps as f32));
            let sight_m = (0..=steps).map(on_sight).fold(f32::INFINITY, f32::min);
            // Lines of sight that graze an edge are left out: the raster is right to centimetres.
            if sight_m.abs() > 0.05 || view.is_occupied(row, col) == (sight_m < 0.0) {
                wrong += u32::from(view.is_occupied(row, col) != (sight_m < 0.0));
                hidden += u32::from(is_drivable && sight_m < 0.0);
            }
        }
    }
    assert!(hidden > 3000, "{hidden} pixels are hidden");
    assert!(wrong < 20, "{wrong} pixels are judged otherwise, of {hidden} hidden ones");
}

/// Openings in walls as high as a house, whose outlines are lines and no ground.
#[test]
fn noise_opens_kerbs_and_no_walls() {
    let only_openings = NoiseSettings {
        boundary: 0.0,
        shadow: 0.0,
        speed_bump: 0.0,
        false_free: 8.0,
        blob: 0.0,
        stain: 0.0,
        flicker: 0.0,
        dropout: 0.0,
        ..NoiseSettings::of(NoiseLevel::Paper)
    };
    let n_opened = |boundary_height_m: f32, island_height_m: f32| {
        let mut scenario = Scenario::lane(-10.0..=90.0, 12.0, 0.0..=60.0);
        scenario.boundary_height_m = boundary_height_m;
        let polygon = sim::geometry::rectangle(Pose::new(Vec2::new(30.0, 3.0), 0.0), 50.0, 2.0).to_vec();
        scenario.islands = vec![Island { polygon, height_m: island_height_m }];
        let map = Map::build(scenario, &VehicleSettings::hyundai_hg300()).unwrap();
        let settings = SensingSettings { occlusion: false, ..SensingSettings::paper() };
        let sensor = Sensor::new(&map, settings, &only_openings, RootSeed(7));
        let n_opened_at = |x_m: f32| {
            let pose = Pose::new(Vec2::new(x_m, 0.0), 0.0);
            let [noisy, clean] = [sensor.perceived_view(&map, pose, 3), sensor.clean_view(&map, pose)]
                .map(|view| view.to_grid().count_occupied());
            clean - noisy
        };
        [0.0, 10.0, 20.0, 30.0, 40.0].map(n_opened_at).into_iter().sum::<u32>()
    };
    assert!(n_opened(0.0, 0.15) > 8, "kerbs are opened: {}", n_opened(0.0, 0.15));
    assert_eq!(n_opened(2.0, 2.0), 0, "walls are not");
}

/// Between the camera and a patch that is small and far ahead nothing was looked at.
#[test]
fn what_stands_before_the_patch_hides_ground_in_it() {
    let geometry = GridGeometry { side_m: 4.0, near_edge_ahead_m: 10.0 };
    let n_occupied = |things: Vec<Obstacle>| {
        let scenario = Scenario::lane(-40.0..=60.0, 30.0, -20.0..=40.0).with_obstacles(things);
        let map = Map::build(scenario, &VehicleSettings::hyundai_hg300()).unwrap();
        let settings = SensingSettings { geometry, ..SensingSettings::paper() };
        let sensor = Sensor::new(&map, settings, &NoiseSettings::of(NoiseLevel::Clean), RootSeed(0));
        sensor.clean_view(&map, Pose::default()).to_grid().count_occupied()
    };
    // Lines of sight at a slope of 0.12 to 0.2 meet it, and the patch at 1.0 to 2.0 m to the left.
    let pillar = Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(6.0, 0.8), 0.0));
    assert!(n_occupied(Vec::new()) == 0 && n_occupied(vec![pillar]) > 10);
}

/// Errors belong to places: the misread ground stays where it is while the car drives by.
#[test]
fn a_shadow_stays_where_it_is_while_the_car_drives_by() {
    let map = lane();
    let only_shadows = NoiseSettings {
        boundary: 0.0,
        speed_bump: 0.0,
        false_free: 0.0,
        blob: 0.0,
        stain: 0.0,
        flicker: 0.0,
        dropout: 0.0,
        ..NoiseSettings::of(NoiseLevel::Hard)
    };
    let settings = SensingSettings { occlusion: false, ..SensingSettings::paper() };
    let sensor = Sensor::new(&map, settings, &only_shadows, RootSeed(5));
    let geometry = GridGeometry::paper();
    let wrong_at = |pose: Pose| {
        let (noisy, clean) = (sensor.perceived_view(&map, pose, 3), sensor.clean_view(&map, pose));
        let mut points = Vec::new();
        for row in 0..sim::sensing::BEV_PIXELS {
            for col in 0..sim::sensing::BEV_PIXELS {
                if noisy.is_occupied(row, col) != clean.is_occupied(row, col) {
                    points.push(pose.world_from_ego().point(geometry.pixel_in_ego(row, col)));
                }
            }
        }
        points
    };
    let mut compared = 0;
    for x_m in [5.0, 15.0, 25.0, 35.0] {
        // The same ground seen from two poses, 2.4 m apart (40 whole pixels).
        let (here, there) =
            (wrong_at(Pose::new(Vec2::new(x_m, 0.0), 0.0)), wrong_at(Pose::new(Vec2::new(x_m + 2.4, 0.0), 0.0)));
        let both_see = |p: &&Vec2| p.x > x_m + 2.4 + 4.4 && p.x < x_m + 16.2;
        let n_here = here.iter().filter(both_see).count();
        let n_there = there.iter().filter(both_see).count();
        assert!(n_here.abs_diff(n_there) <= 2 + n_here / 50, "{n_here} and {n_there} pixels at {x_m} m");
        compared += n_here;
    }
    assert!(compared > 200, "the test saw only {compared} misread pixels");
}

#[test]
fn noise_does_not_depend_on_who_looked_before() {
    let map = lane();
    let pose = Pose::new(Vec2::new(12.0, 0.3), 0.1);
    let mut fresh = sensor(&map, NoiseLevel::Paper, 9);
    let mut used = sensor(&map, NoiseLevel::Paper, 9);
    for tick in 0..50 {
        used.observe(&map, Pose::new(Vec2::new(tick as f32, 0.0), 0.0), tick);
    }
    assert_eq!(fresh.observe(&map, pose, 77), used.observe(&map, pose, 77));
}

/// Sensors of noise augmentations look at kept ticks only: with `expert_ticks` the tick before may be one that was not kept.
#[test]
fn a_dropped_frame_repeats_the_tick_before_and_no_older_grid() {
    let map = lane();
    let every_frame = NoiseSettings { dropout: 1000.0, ..NoiseSettings::of(NoiseLevel::Paper) };
    let sensor = || Sensor::new(&map, SensingSettings::paper(), &every_frame, RootSeed(9));
    let [here, there] = [12.0, 30.0].map(|x_m| Pose::new(Vec2::new(x_m, 0.3), 0.1));
    let mut steady = sensor();
    let seen = steady.observe(&map, here, 4);
    assert_eq!(steady.observe(&map, there, 5), seen, "dropped");
    assert_eq!(steady.observe(&map, there, 6), seen, "dropped again");
    let mut with_gaps = sensor();
    with_gaps.observe(&map, here, 4);
    let after_gap = with_gaps.observe(&map, there, 40);
    assert_ne!(after_gap, seen, "a grid of another place");
    assert_eq!(after_gap, sensor().observe(&map, there, 40));
}

#[test]
fn clean_level_is_clean_and_hard_is_worse_than_paper() {
    let map = lane();
    let accuracy = |level| {
        let mut sum = 0.0;
        for seed in 0..20 {
            let sensor = sensor(&map, level, seed);
            let pose = Pose::new(Vec2::new(3.0 * seed as f32, 0.0), 0.0);
            sum += sensor.perceived_view(&map, pose, 100).pixel_accuracy(&sensor.clean_view(&map, pose));
        }
        sum / 20.0
    };
    assert_eq!(accuracy(NoiseLevel::Clean), 1.0);
    assert!(accuracy(NoiseLevel::Hard) < accuracy(NoiseLevel::Paper) - 0.002);
}

#[test]
fn grids_round_trip_through_cells() {
    let mut grid = OccupancyGrid::free();
    grid.set_occupied(0, 24);
    grid.set_occupied(24, 0);
    grid.occupy_row(3, 0b101);
    let cells: Vec<u8> = grid.cells().collect();
    assert_eq!(cells.len(), GRID_CELLS * GRID_CELLS);
    assert_eq!(OccupancyGrid::from_cells(&cells), grid);
    assert_eq!(cells[3 * GRID_CELLS], 1);
}

fn only(layer: Layer) -> NoiseSettings {
    let amount = |of: Layer| if of == layer { 1.0 } else { 0.0 };
    NoiseSettings {
        intensity: 2.0,
        boundary: amount(Layer::Boundary),
        shadow: amount(Layer::Shadow),
        speed_bump: amount(Layer::SpeedBump),
        false_free: amount(Layer::FalseFree),
        blob: amount(Layer::Blob),
        stain: amount(Layer::Stain),
        flicker: amount(Layer::Flicker),
        // Every frame but the first.
        dropout: 1000.0 * amount(Layer::Dropout),
    }
}

#[test]
fn an_inspection_blames_the_layer_that_is_on_and_nothing_else() {
    let map = lane();
    for layer in Layer::ALL {
        let (mut pixels, mut cells) = (0, 0);
        for seed in 0..8 {
            let mut sensor = Sensor::new(&map, SensingSettings::paper(), &only(layer), RootSeed(seed));
            for i in 0..12_u32 {
                let (pose, tick) = (Pose::new(Vec2::new(4.0 * i as f32, 0.3), 0.1), 31 * i + 1);
                sensor.observe(&map, Pose::new(Vec2::new(4.0 * i as f32 - 2.0, 0.3), 0.1), tick - 1);
                let shown = sensor.observe(&map, pose, tick);
                let inspection = sensor.inspect(&map, pose, tick, &shown);
                for other in Layer::ALL.into_iter().filter(|&other| other != layer) {
                    let wrong = (inspection.count_pixels(other), inspection.count_cells(other));
                    assert_eq!(wrong, (0, 0), "{other:?} is blamed for {layer:?}");
                }
                pixels += inspection.count_pixels(layer);
                cells += inspection.count_cells(layer);
            }
        }
        assert!(cells > 0, "{layer:?} makes no cell wrong");
        assert_eq!(pixels > 0, layer != Layer::Dropout, "{layer:?}");
    }
}

#[test]
fn an_inspection_explains_every_wrong_pixel_and_cell() {
    let map = lane();
    let mut sensor = Sensor::new(&map, SensingSettings::paper(), &NoiseSettings::of(NoiseLevel::Hard), RootSeed(3));
    for tick in 0..60_u32 {
        let pose = Pose::new(Vec2::new(0.7 * tick as f32, 0.2), maths::sin(0.3 * tick as f32) * 0.4);
        let shown = sensor.observe(&map, pose, tick);
        let inspection = sensor.inspect(&map, pose, tick, &shown);
        assert_eq!(inspection.shown_grid, shown.grid);
        for i in 0..BEV_PIXELS * BEV_PIXELS {
            let (row, col) = (i / BEV_PIXELS, i % BEV_PIXELS);
            let is_wrong = inspection.perceived.is_occupied(row, col) != inspection.clean.is_occupied(row, col);
            assert_eq!(inspection.pixel(row, col).is_some(), is_wrong, "pixel ({row}, {col}), tick {tick}");
        }
        for i in 0..GRID_CELLS * GRID_CELLS {
            let (row, col) = (i / GRID_CELLS, i % GRID_CELLS);
            let is_wrong = shown.grid.is_occupied(row, col) != inspection.clean_grid.is_occupied(row, col);
            assert_eq!(inspection.cell(row, col).is_some(), is_wrong, "cell ({row}, {col}), tick {tick}");
        }
    }
}
