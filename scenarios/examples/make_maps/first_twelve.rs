//! Twelve maps. Where trained drivers failed on them, the families of generated lots were widened: they are development maps.

use super::drawing::{Drawing, FREE, OCCUPIED, UNKNOWN, area, band, car, disc, turned};
use sim::geometry::{Pose, Vec2};
use sim::scenario::ReferencePath;

pub(super) fn drawings() -> Vec<Drawing> {
    vec![
        office(),
        hospital(),
        pillar_hall(),
        parked_street(),
        street_islands(),
        one_aisle(),
        three_aisles(),
        wide_aisle(),
        race_track(),
        winding_track(),
        warehouse(),
        courtyard(),
    ]
}

/// A corridor with a bend; rooms with doors too narrow for the car on both sides, behind walls of 20 cm.
fn office() -> Drawing {
    let mut shapes = Vec::new();
    for i in 0..11 {
        let x = 3.0 + 6.5 * i as f32;
        for (y, door_y) in [(1.0, 7.1), (11.5, 11.4)] {
            // The rooms at the bend would reach into it.
            if i < 10 || y < 5.0 {
                shapes.push((area(x, y, x + 6.3, y + 6.0), FREE));
                shapes
                    .push((area(x + 1.5 + 0.2 * i as f32, door_y - 0.2, x + 2.5 + 0.2 * i as f32, door_y + 0.2), FREE));
            }
        }
    }
    for i in 0..6 {
        let y = 21.0 + 6.5 * i as f32;
        for (x, door_x) in [(74.4, 80.5), (84.9, 84.8)] {
            shapes.push((area(x, y, x + 6.0, y + 6.3), FREE));
            shapes.push((area(door_x - 0.2, y + 2.0, door_x + 0.2, y + 3.1), FREE));
        }
    }
    shapes.push((band(&[(1.0, 9.3), (82.65, 9.3), (82.65, 61.0)], 8.0, 4.2), FREE));
    Drawing {
        name: "office",
        about: "An office corridor of 4.2 m with rooms behind thin walls and doors.",
        size_m: (93.0, 63.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes,
        lot: "start = [18.0, 9.3, 0.0]\ngoal = [82.65, 42.0, 90.0]\n",
        centre_line: None,
    }
}

/// A corridor that is offset three times, with niches and beds left standing along the walls.
fn hospital() -> Drawing {
    let line =
        [(1.0, 8.0), (30.0, 8.0), (44.0, 12.5), (66.0, 12.5), (80.0, 7.0), (98.0, 7.0), (112.0, 10.5), (149.0, 10.5)];
    let mut shapes = vec![(band(&line, 14.0, 3.8), FREE)];
    for x in [20.0, 56.0, 90.0, 122.0] {
        shapes.push((area(x, 4.0, x + 2.5, 16.0), FREE));
    }
    // Beds.
    shapes.push((area(50.0, 13.6, 52.0, 14.4), OCCUPIED));
    shapes.push((area(126.0, 8.6, 128.0, 9.3), OCCUPIED));
    Drawing {
        name: "hospital",
        about: "A hospital corridor of 3.8 m with offsets, niches and beds.",
        size_m: (150.0, 20.0),
        pixel_m: 0.1,
        origin: "[-20.0, -8.0, 0.0]",
        background: UNKNOWN,
        shapes,
        lot: "start = [-2.0, 0.0, 0.0]\ngoal = [110.0, 2.5, 0.0]\n",
        centre_line: None,
    }
}

/// An L of two halls; two rows of pillars leave a lane of 5.4 m in the middle.
fn pillar_hall() -> Drawing {
    let mut shapes = vec![(area(1.0, 1.0, 77.0, 17.0), FREE), (area(61.0, 1.0, 77.0, 75.0), FREE)];
    for i in 0..9 {
        let along = 5.0 + 6.0 * i as f32;
        shapes.push((turned(along, 5.9, 0.7, 0.7, 0.0), OCCUPIED));
        shapes.push((turned(along, 12.1, 0.7, 0.7, 0.0), OCCUPIED));
        shapes.push((turned(65.9, along + 20.0, 0.7, 0.7, 0.0), OCCUPIED));
        shapes.push((turned(72.1, along + 20.0, 0.7, 0.7, 0.0), OCCUPIED));
    }
    // A stairwell in the outer corner.
    shapes.push((area(66.0, 1.0, 77.0, 7.0), OCCUPIED));
    Drawing {
        name: "pillar-hall",
        about: "An L-shaped hall of 16 m with two rows of pillars.",
        size_m: (78.0, 76.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes,
        lot: "start = [19.0, 9.0, 0.0]\ngoal = [69.0, 56.0, 90.0]\n",
        centre_line: None,
    }
}

/// A street between houses that bends gently, cars parked on both sides, with gaps.
fn parked_street() -> Drawing {
    let line = [(1.0, 20.0), (60.0, 20.0), (110.0, 35.0), (159.0, 35.0)];
    let mut shapes = vec![(band(&line, 60.0, 8.8), FREE)];
    let path = sim::path::Path::new(&ReferencePath { points: line.map(Vec2::from).to_vec(), corner_radius_m: 60.0 });
    for (i, side) in (0..46).flat_map(|i| [(i, 1.0), (i, -1.0)]) {
        let is_gap = (i * 7 + if side > 0.0 { 2 } else { 5 }) % 9 == 0;
        let pose = path.pose_at(20.0 + 5.6 * i as f32 / 2.0 + if side > 0.0 { 0.0 } else { 1.7 });
        if i % 2 == 0 && !is_gap {
            let centre = pose.position() + side * 3.3 * pose.ahead().perp();
            shapes.push(car(centre.x, centre.y, pose.heading_rad.to_degrees()));
        }
    }
    Drawing {
        name: "parked-street",
        about: "A street between houses with parked cars on both sides.",
        size_m: (160.0, 55.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: UNKNOWN,
        shapes,
        lot: "start = [20.0, 20.0, 0.0]\ngoal = [140.0, 35.0, 0.0]\n",
        centre_line: None,
    }
}

/// Pavements build out into a street on either side in turn, and there is a refuge in the middle.
fn street_islands() -> Drawing {
    let mut shapes = vec![(band(&[(1.0, 10.0), (70.0, 10.0), (110.0, 24.0), (180.0, 24.0)], 40.0, 7.6), FREE)];
    for (x, y) in [(30.0, 6.2), (46.0, 13.8), (62.0, 6.2)] {
        shapes.push((area(x, y - 3.2, x + 5.0, y + 3.2), OCCUPIED));
        shapes.push((disc(x, y, 3.2), OCCUPIED));
        shapes.push((disc(x + 5.0, y, 3.2), OCCUPIED));
    }
    shapes.push((turned(142.0, 24.2, 8.0, 0.8, 0.0), OCCUPIED));
    Drawing {
        name: "street-islands",
        about: "A street of 7.6 m with pavements built out on either side and a refuge; kerbs, which hide nothing.",
        size_m: (181.0, 32.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes,
        lot: "start = [14.0, 10.0, 0.0]\ngoal = [160.0, 24.0, 0.0]\nwall_height_m = 0.15\n",
        centre_line: None,
    }
}

/// One aisle between two rows of parked cars, around a corner; some stalls are empty.
fn one_aisle() -> Drawing {
    let mut shapes = vec![(area(1.0, 1.0, 83.0, 17.0), FREE), (area(67.0, 1.0, 83.0, 75.0), FREE)];
    for i in 0..31 {
        let along = 2.2 + 2.5 * i as f32;
        let is_empty = |row: usize| (i * 5 + row * 3).is_multiple_of(7);
        if along < 80.0 && !is_empty(0) {
            shapes.push(car(along, 3.6 + 0.1 * (i % 3) as f32, 90.0));
        }
        if along < 66.0 && !is_empty(1) {
            shapes.push(car(along, 14.4, 91.0));
        }
        if along > 4.0 && along < 72.0 && !is_empty(2) {
            shapes.push(car(80.4, along, 0.0));
        }
        if along > 22.0 && along < 74.0 && !is_empty(3) {
            shapes.push(car(69.6, along, 179.0));
        }
    }
    // A planted corner.
    shapes.push((disc(66.5, 17.5, 4.5), OCCUPIED));
    Drawing {
        name: "one-aisle",
        about: "A car park of one aisle of 6 m between rows of parked cars, around a corner.",
        size_m: (84.0, 76.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: UNKNOWN,
        shapes,
        lot: "start = [19.0, 9.0, 0.0]\ngoal = [75.0, 54.0, 90.0]\n",
        centre_line: None,
    }
}

/// Three aisles joined at both ends; the two that are not driven are closed when the map is read.
fn three_aisles() -> Drawing {
    let mut shapes = vec![(area(8.0, 1.0, 90.0, 53.0), FREE)];
    for (row, y) in [3.3, 14.1, 18.9, 29.7, 34.5, 45.3, 50.1].into_iter().enumerate() {
        for i in 0..24 {
            let x = 20.0 + 2.5 * i as f32;
            if (i * 3 + row * 5) % 8 != 0 {
                shapes.push(car(x, y, if row % 2 == 0 { 90.0 } else { 270.0 }));
            }
        }
    }
    // Heads of the double rows.
    for y in [16.5, 32.1, 47.7] {
        shapes.push((turned(16.9, y, 2.6, 8.0, 0.0), OCCUPIED));
        shapes.push((turned(80.6, y, 2.6, 8.0, 0.0), OCCUPIED));
        shapes.push((turned(49.0, y, 64.0, 0.3, 0.0), OCCUPIED));
    }
    shapes.push((area(8.0, 48.0, 90.0, 53.0), OCCUPIED));
    shapes.push((area(18.0, 1.0, 80.0, 1.6), OCCUPIED));
    Drawing {
        name: "three-aisles",
        about: "A car park of three aisles of 6 m; the branches beside the route are closed when it is read.",
        size_m: (96.0, 54.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes,
        lot: "start = [30.0, 8.7, 0.0]\ngoal = [38.0, 24.3, 180.0]\nclose_branches = true\n",
        centre_line: None,
    }
}

/// An aisle of 8 m between rows of cars parked at 60°.
fn wide_aisle() -> Drawing {
    let mut shapes = vec![(area(1.0, 1.0, 139.0, 21.0), FREE)];
    for i in 0..42 {
        let x = 4.0 + 3.2 * i as f32;
        if i % 6 != 2 {
            shapes.push(car(x, 4.4, 60.0));
        }
        if i % 5 != 3 {
            shapes.push(car(x, 17.6, 240.0));
        }
    }
    // Planters make the aisle wind.
    for (x, y) in [(45.0, 8.4), (70.0, 13.4), (96.0, 8.6)] {
        shapes.push((disc(x, y, 1.2), OCCUPIED));
    }
    Drawing {
        name: "wide-aisle",
        about: "A car park with an aisle of 8 m between rows at 60°, and planters in it.",
        size_m: (140.0, 22.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: UNKNOWN,
        shapes,
        lot: "start = [19.0, 11.0, 0.0]\ngoal = [120.0, 11.0, 0.0]\n",
        centre_line: None,
    }
}

/// A ring with one large island, in UTM coordinates.
fn race_track() -> Drawing {
    let corners = [
        (40.0, 6.0),
        (94.0, 6.0),
        (94.0, 44.0),
        (60.0, 44.0),
        (46.0, 34.0),
        (20.0, 44.0),
        (6.0, 30.0),
        (6.0, 6.0),
        (42.0, 6.0),
    ];
    Drawing {
        name: "race-track",
        about: "A race track of 6 m around an island, in UTM coordinates.",
        size_m: (100.0, 50.0),
        pixel_m: 0.1,
        origin: "[467300.0, 5427800.0, 0.0]",
        background: UNKNOWN,
        shapes: vec![(band(&corners, 11.0, 6.0), FREE)],
        lot: "start = [467340.0, 5427806.0, 0.0]\nloop = true\n",
        centre_line: None,
    }
}

/// A band that winds, on a coarse raster.
fn winding_track() -> Drawing {
    let corners = [
        (2.0, 8.0),
        (34.0, 8.0),
        (48.0, 26.0),
        (70.0, 26.0),
        (78.0, 6.0),
        (100.0, 6.0),
        (112.0, 28.0),
        (92.0, 44.0),
        (60.0, 44.0),
        (40.0, 40.0),
        (2.0, 44.0),
    ];
    let driven =
        sim::path::Path::new(&ReferencePath { points: corners.map(Vec2::from).to_vec(), corner_radius_m: 9.0 });
    let in_map = Pose::new(Vec2::ZERO, 0.3).world_from_ego();
    let ends_m = 20.0..driven.length_m() - 20.0;
    let along_m =
        (0..).map(|i| 2.0 * i as f32).skip_while(|s_m| *s_m < ends_m.start).take_while(|s_m| ends_m.contains(s_m));
    Drawing {
        name: "winding-track",
        about: "A track of 4.8 m that winds, at half a metre per pixel, turned.",
        size_m: (124.0, 54.0),
        pixel_m: 0.5,
        origin: "[0.0, 0.0, 0.3]",
        background: OCCUPIED,
        shapes: vec![(band(&corners, 9.0, 4.8), FREE)],
        lot: "centre_line = \"winding-track.csv\"\n",
        centre_line: Some(along_m.map(|s_m| in_map.point(driven.pose_at(s_m).position())).collect()),
    }
}

/// Racks with aisles of 3.8 m; the route leads down one of them and back by the next but one.
fn warehouse() -> Drawing {
    let mut shapes = vec![(area(11.0, 9.0, 87.0, 41.4), FREE)];
    for i in 0..5 {
        let y = 8.6 + 6.6 * i as f32;
        shapes.push((area(20.0, y, 76.0, y + 2.8), OCCUPIED));
    }
    // Pallets, and columns before the heads of the racks.
    shapes.push((area(40.0, 8.0, 41.2, 8.8), OCCUPIED));
    shapes.push((area(55.0, 21.8, 56.2, 22.6), OCCUPIED));
    Drawing {
        name: "warehouse",
        about: "A warehouse with racks and aisles of 3.8 m; the branches beside the route are closed when it is read.",
        size_m: (100.0, 46.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes,
        lot: "start = [30.0, 13.3, 0.0]\ngoal = [36.0, 26.5, 180.0]\nclose_branches = true\n",
        centre_line: None,
    }
}

/// Open ground with planters, trees and a fountain.
fn courtyard() -> Drawing {
    let mut shapes = vec![(area(1.0, 1.0, 119.0, 20.0), FREE)];
    for (x, y, radius_m) in [(36.0, 12.5, 2.2), (84.0, 11.0, 2.4)] {
        shapes.push((disc(x, y, radius_m), OCCUPIED));
    }
    for (x, y) in [
        (24.0, 6.0),
        (26.0, 17.0),
        (47.0, 5.0),
        (48.0, 16.5),
        (58.0, 15.6),
        (60.0, 8.0),
        (72.0, 17.5),
        (74.0, 5.5),
        (95.0, 17.0),
        (97.0, 6.0),
    ] {
        shapes.push((disc(x, y, 0.45), OCCUPIED));
    }
    shapes.push((turned(66.0, 17.8, 8.0, 1.2, 15.0), OCCUPIED));
    shapes.push((turned(52.0, 3.6, 6.0, 1.2, -15.0), OCCUPIED));
    Drawing {
        name: "courtyard",
        about: "A courtyard of 19 m with a fountain, planters and trees.",
        size_m: (120.0, 21.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes,
        lot: "start = [18.0, 11.0, 0.0]\ngoal = [100.0, 12.0, 0.0]\n",
        centre_line: None,
    }
}
