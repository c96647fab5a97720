//! Ten maps of streets, villages and land, drawn by somebody who did not know how any driver fares, but had read that
//! some families were made after failures.

use crate::drawing::{Drawing, FREE, OCCUPIED, UNKNOWN, area, band, car, disc, plain, scatter, turned};
use sim::geometry::Vec2;
use sim::path::Path;
use sim::scenario::ReferencePath;

pub(super) fn drawings() -> Vec<Drawing> {
    vec![
        campsite(),
        towpath(),
        castle_gate(),
        vineyard(),
        woonerf(),
        allotments(),
        bridge_works(),
        cemetery(),
        stable_yard(),
        quarry(),
    ]
}

/// A place beside a line with rounded corners: x, y and the heading of the line in degrees.
fn beside(line: &[(f32, f32)], radius_m: f32, along_m: f32, left_m: f32) -> (f32, f32, f32) {
    let points = line.iter().map(|&point| Vec2::from(point)).collect();
    let pose = Path::new(&ReferencePath { points, corner_radius_m: radius_m }).pose_at(along_m);
    let place = pose.world_from_ego().point(Vec2::new(0.0, left_m));
    (place.x, place.y, pose.heading_rad.to_degrees())
}

/// A gravel road round a camping ground; tents, caravans and cars on pitches between hedges.
fn campsite() -> Drawing {
    let mut shapes = vec![(band(&[(1.0, 12.0), (103.0, 12.0), (103.0, 42.0), (1.0, 42.0)], 9.0, 5.0), FREE)];
    for i in 0..7 {
        let x = 28.0 + 9.8 * i as f32;
        for (k, (low, high)) in [(1.6, 10.0), (14.0, 26.4), (27.6, 40.0), (44.0, 54.0)].into_iter().enumerate() {
            shapes.push((area(x, low, x + 9.0, high), FREE));
            let back = if k % 2 == 0 { low + 2.8 } else { high - 2.8 };
            let (at_x, heading) = (x + 3.4 + 1.6 * scatter(i, k), 24.0 * scatter(i, k + 4) - 12.0);
            match (i + 2 * k) % 4 {
                0 => shapes.push((turned(at_x, back, 5.8, 2.3, heading), OCCUPIED)),
                1 => shapes.push((disc(at_x, back, 1.7), OCCUPIED)),
                2 => shapes.push((turned(at_x, back, 4.0, 3.2, heading), OCCUPIED)),
                _ => {}
            }
            if (i * 3 + k) % 4 == 1 {
                let hedge = if k % 2 == 0 { high - 0.6 } else { low };
                shapes.push((area(x, hedge, x + 4.8, hedge + 0.6), OCCUPIED));
            }
            if (i + k) % 3 == 0 {
                shapes.push(car(x + 7.4, if k % 2 == 0 { high - 3.2 } else { low + 3.2 }, 90.0));
            }
        }
    }
    // A tap, trees at the road, the pillars of two barriers.
    for (x, y) in [(37.4, 10.1), (57.0, 13.9), (76.6, 10.2), (67.2, 40.2), (47.6, 43.9), (27.4, 40.1)] {
        shapes.push((disc(x, y, 0.35), OCCUPIED));
    }
    for y in [9.9, 14.1, 39.9, 44.1] {
        shapes.push((area(25.0, y - 0.5, 25.8, y + 0.5), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [18.5, 12.0, 0.0]\ngoal = [19.0, 42.0, 180.0]\nwall_height_m = 1.6\n",
        ..plain("campsite", "A gravel road round a camping ground, past pitches between hedges.", (113.0, 56.0))
    }
}

/// A towpath with a verge: water on the left, trees on the right, a bridge hole and a lock.
fn towpath() -> Drawing {
    let line = [(1.0, 12.0), (52.0, 12.0), (86.0, 25.0), (124.0, 25.0), (152.0, 13.0), (191.0, 13.0)];
    let mut shapes = vec![
        (band(&line, 35.0, 3.4), FREE),
        (band(&line.map(|(x, y)| (x, y - 1.3)), 35.0, 3.6), FREE),
        // A place to turn, with logs and a car.
        (area(24.0, 3.0, 38.0, 10.0), FREE),
        (area(25.0, 3.6, 31.0, 5.2), OCCUPIED),
        car(34.6, 5.8, 60.0),
        // Abutments of a bridge, and the wall below it along the water.
        (area(99.0, 18.0, 107.0, 32.0), OCCUPIED),
        (area(98.9, 23.3, 107.1, 26.2), FREE),
    ];
    for i in 0..18 {
        let (x, y, _) = beside(&line, 35.0, 10.0 + 9.7 * i as f32, -2.3 - 0.3 * scatter(i, 1));
        shapes.push((disc(x, y, 0.25 + 0.15 * scatter(i, 2)), OCCUPIED));
    }
    // Benches, a moored boat's gangway, the beam of the lock, a stack of reed.
    for (along_m, left_m, length_m, width_m, turn) in [
        (53.0, -2.5, 1.8, 0.6, 0.0),
        (68.0, 1.5, 1.0, 0.6, 90.0),
        (139.0, 1.6, 5.0, 0.5, -12.0),
        (148.5, -2.2, 3.0, 1.0, 4.0),
        (162.0, 1.4, 0.5, 0.5, 0.0),
    ] {
        let (x, y, heading) = beside(&line, 35.0, along_m, left_m);
        shapes.push((turned(x, y, length_m, width_m, heading + turn), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [18.5, 12.0, 0.0]\ngoal = [172.0, 13.0, 0.0]\nwall_height_m = 0.15\n",
        ..plain("towpath", "A towpath along a canal, through a bridge hole of 2.9 m and past a lock.", (192.0, 36.0))
    }
}

/// From the forecourt through the gate tower to the outer ward, and out by the lower gate over the moat.
fn castle_gate() -> Drawing {
    let mut shapes = vec![
        (area(1.0, 17.0, 38.0, 23.0), FREE),
        (area(36.0, 9.0, 68.0, 33.0), FREE),
        (area(77.0, 8.0, 104.0, 33.0), FREE),
        (area(112.0, 13.6, 149.0, 18.4), FREE),
        // Towers, then the two gates.
        (disc(67.5, 20.9, 3.2), OCCUPIED),
        (disc(67.5, 31.1, 3.2), OCCUPIED),
        (area(60.0, 24.4, 80.0, 27.6), FREE),
        (area(102.0, 14.5, 114.0, 17.5), FREE),
        // The well, the house of the guard, a cannon.
        (disc(50.0, 20.4, 2.4), OCCUPIED),
        (area(59.0, 9.0, 68.0, 14.6), OCCUPIED),
        (turned(61.0, 30.2, 2.4, 1.0, -30.0), OCCUPIED),
        // The ward: smithy, stable wall, well, hay cart, steps.
        (area(90.0, 25.0, 104.0, 33.0), OCCUPIED),
        (area(77.0, 8.0, 87.0, 14.4), OCCUPIED),
        (disc(95.0, 11.4, 1.2), OCCUPIED),
        (turned(81.0, 18.0, 3.4, 1.6, 70.0), OCCUPIED),
        (turned(101.6, 22.4, 2.4, 1.2, 90.0), OCCUPIED),
        (area(79.0, 31.0, 86.0, 33.0), OCCUPIED),
    ];
    for (x, heading) in [(39.4, 88.0), (42.2, 91.0), (47.9, 90.0), (50.6, 86.0)] {
        shapes.push(car(x, 11.8, heading));
    }
    for x in [40.0, 46.5, 53.0] {
        shapes.push((disc(x, 29.6, 0.4), OCCUPIED));
        shapes.push((area(x + 2.2, 31.2, x + 4.0, 31.8), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [19.0, 20.0, 0.0]\ngoal = [131.0, 16.0, 0.0]\n",
        ..plain("castle-gate", "A castle's forecourt, its gate tower, a ward and a second gate.", (150.0, 40.0))
    }
}

/// Tracks at the ends of rows of vines; between the rows no car has room.
fn vineyard() -> Drawing {
    let mut shapes = vec![
        (area(1.0, 5.6, 70.0, 10.2), FREE),
        (area(54.0, 5.6, 59.4, 54.0), FREE),
        (area(46.0, 49.0, 124.0, 54.0), FREE),
        // Three blocks of vines.
        (area(8.0, 10.2, 54.0, 42.0), FREE),
        (area(59.4, 13.6, 111.0, 49.0), FREE),
        (area(63.0, 54.0, 109.8, 61.0), FREE),
        // A tractor with its trailer, a shed.
        (turned(64.4, 7.9, 4.0, 2.0, 78.0), OCCUPIED),
        (turned(68.0, 7.6, 3.6, 1.7, 95.0), OCCUPIED),
        (area(47.4, 49.0, 51.4, 52.8), OCCUPIED),
    ];
    for i in 0..29 {
        let x = 9.0 + 1.6 * i as f32;
        shapes.push((area(x - 0.2, 10.7 + 0.5 * scatter(i, 1), x + 0.2, 41.6), OCCUPIED));
        shapes.push((area(x + 54.8, 54.4 + 0.4 * scatter(i, 2), x + 55.2, 60.6), OCCUPIED));
    }
    for i in 0..22 {
        let y = 14.6 + 1.6 * i as f32;
        shapes.push((area(59.9 + 0.6 * scatter(i, 3), y - 0.2, 110.4, y + 0.2), OCCUPIED));
    }
    // Crates, bins and a heap of posts left at the edge.
    for (x, y, length_m, width_m, heading) in [
        (30.0, 6.1, 1.2, 1.0, 8.0),
        (31.6, 6.2, 1.2, 1.0, -5.0),
        (54.5, 30.0, 1.2, 0.8, 80.0),
        (58.8, 22.0, 2.4, 0.8, 92.0),
        (84.0, 53.4, 2.6, 0.9, 3.0),
    ] {
        shapes.push((turned(x, y, length_m, width_m, heading), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [18.5, 7.9, 0.0]\ngoal = [105.5, 51.4, 0.0]\nwall_height_m = 1.6\n",
        ..plain("vineyard", "Tracks of 4 to 5 m round blocks of vines, with two corners.", (125.0, 62.0))
    }
}

/// A home zone: planters from either side, cars in bays between them, gardens behind fences.
fn woonerf() -> Drawing {
    let line = [(1.0, 13.0), (64.0, 13.0), (94.0, 27.0), (165.0, 27.0)];
    let mut shapes = vec![(band(&line, 22.0, 7.2), FREE)];
    for i in [0, 1, 2, 4, 6, 7, 8] {
        for side in [-1.0, 1.0] {
            let along_m = 12.0 + 17.0 * i as f32 + 4.0 * side;
            let (x, y, heading) = beside(&line, 22.0, along_m, 6.4 * side);
            shapes.push((turned(x, y, 11.0, 4.0, heading), FREE));
            let (x, y, heading) = beside(&line, 22.0, along_m + 5.0 * scatter(i, 1) - 2.5, 4.0 * side);
            shapes.push((turned(x, y, 1.0, 1.6, heading), FREE));
            let (x, y, _) = beside(&line, 22.0, along_m - 3.5 + 7.0 * scatter(i, 2), 7.2 * side);
            shapes.push((disc(x, y, 0.4), OCCUPIED));
        }
    }
    for (i, along_m) in [34.0, 52.0, 74.0, 106.0, 124.0, 140.0].into_iter().enumerate() {
        let side = if i % 2 == 0 { 1.0 } else { -1.0 };
        let reach_m = 3.6 + 0.5 * scatter(i, 3);
        let (x, y, heading) = beside(&line, 22.0, along_m, side * (3.6 - 0.5 * reach_m));
        shapes.push((turned(x, y, 1.4 + scatter(i, 4), reach_m, heading), OCCUPIED));
        let (x, y, heading) = beside(&line, 22.0, along_m + 4.6, 2.6 * side);
        shapes.push(car(x, y, heading));
        // Bicycles, or a tree, on the other side.
        let (x, y, heading) = beside(&line, 22.0, along_m + 9.0, -3.1 * side);
        shapes.push((turned(x, y, 2.2 * scatter(i, 5) + 0.4, 0.7, heading), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [19.0, 13.0, 0.0]\ngoal = [147.0, 27.0, 0.0]\nwall_height_m = 0.5\n",
        ..plain("woonerf", "A home zone where planters from either side leave 3 to 3.6 m of 7.2 m.", (166.0, 40.0))
    }
}

/// Paths between the hedges of gardens; what goes straight on at the corners is shut by a gate.
fn allotments() -> Drawing {
    let corners = [(40.4, 11.6), (43.6, 38.4), (76.4, 41.6), (79.6, 66.4)];
    let mut shapes = vec![(
        band(&[(1.0, 10.0), (42.0, 10.0), (42.0, 40.0), (78.0, 40.0), (78.0, 68.0), (117.0, 68.0)], 8.0, 3.4),
        FREE,
    )];
    shapes.extend(corners.map(|(x, y)| (disc(x, y, 3.2), FREE)));
    // Paths that go on, each behind a gate that leaves a slit.
    for (x, y, to_x, to_y) in
        [(43.0, 8.6, 54.0, 11.4), (40.6, 41.0, 43.4, 53.0), (79.0, 38.6, 92.0, 41.4), (76.6, 69.0, 79.4, 78.0)]
    {
        shapes.push((area(x, y, to_x, to_y), FREE));
    }
    for (x, y, to_x, to_y) in
        [(46.0, 8.6, 46.3, 10.6), (41.4, 44.0, 43.4, 44.3), (85.0, 39.4, 85.3, 41.4), (76.6, 71.4, 78.6, 71.7)]
    {
        shapes.push((area(x, y, to_x, to_y), OCCUPIED));
    }
    // Gardens: lower left corner, and the side on which the path lies.
    for (i, (x, y, side)) in [
        (8.0, 12.3, 0),
        (18.5, 12.3, 0),
        (13.0, 1.4, 2),
        (24.0, 1.4, 2),
        (29.7, 22.0, 1),
        (29.7, 31.0, 1),
        (44.3, 13.0, 3),
        (44.3, 22.0, 3),
        (51.0, 42.3, 0),
        (61.2, 42.3, 0),
        (51.0, 31.4, 2),
        (61.2, 31.4, 2),
        (65.7, 52.0, 1),
        (80.3, 43.6, 3),
        (80.3, 52.4, 3),
        (86.0, 70.3, 0),
        (97.0, 70.3, 0),
        (91.0, 59.4, 2),
        (102.0, 59.4, 2),
    ]
    .into_iter()
    .enumerate()
    {
        let (length_m, width_m) = if side % 2 == 0 { (9.6, 6.3) } else { (10.0, 8.2) };
        let (mid_x, mid_y) = (x + 0.5 * length_m, y + 0.5 * width_m);
        let shift_m = 4.0 * scatter(i, 1) - 2.0;
        shapes.push((turned(mid_x, mid_y, length_m, width_m, 0.0), FREE));
        // A gate, a shed at the back, a bed or a tree.
        let (gate, shed) = match side {
            0 => ((mid_x + shift_m, y), (mid_x - shift_m, y + width_m - 1.2)),
            1 => ((x + length_m, mid_y + shift_m), (x + 1.4, mid_y - shift_m)),
            2 => ((mid_x + shift_m, y + width_m), (mid_x - shift_m, y + 1.2)),
            _ => ((x, mid_y + shift_m), (x + length_m - 1.4, mid_y - shift_m)),
        };
        shapes.push((turned(gate.0, gate.1, 1.2, 1.6, if side % 2 == 0 { 0.0 } else { 90.0 }), FREE));
        shapes.push((turned(shed.0, shed.1, 2.6, 2.0, 0.0), OCCUPIED));
        shapes.push((disc(mid_x - shift_m, mid_y, 0.3 + 0.4 * scatter(i, 2)), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [18.5, 10.0, 0.0]\ngoal = [99.0, 68.0, 0.0]\nwall_height_m = 1.6\n",
        ..plain("allotments", "Paths of 3.4 m between the hedges of garden plots, with four corners.", (118.0, 79.0))
    }
}

/// A country road over a bridge that is being mended: a gate of 2.7 m, then barriers from either side.
fn bridge_works() -> Drawing {
    let line = [(1.0, 12.0), (48.0, 12.0), (78.0, 20.0), (136.0, 20.0), (166.0, 26.0), (205.0, 26.0)];
    let mut shapes = vec![
        (band(&line, 60.0, 7.0), FREE),
        // A lay-by with the workers' cabin and a roller.
        (area(24.0, 14.0, 42.0, 19.0), FREE),
        (area(26.0, 16.2, 32.0, 18.6), OCCUPIED),
        (turned(37.0, 17.0, 3.6, 1.8, 12.0), OCCUPIED),
        // Railings that leave 6 m, and the barriers on the bridge.
        (area(84.0, 16.0, 130.0, 17.0), OCCUPIED),
        (area(84.0, 23.0, 130.0, 24.0), OCCUPIED),
        (turned(92.0, 18.4, 0.6, 2.9, 20.0), OCCUPIED),
        (area(92.5, 19.0, 96.5, 19.6), OCCUPIED),
        (turned(107.0, 21.7, 0.6, 2.9, 20.0), OCCUPIED),
        (area(107.5, 20.4, 111.0, 21.0), OCCUPIED),
        (turned(121.0, 18.3, 0.6, 2.8, 20.0), OCCUPIED),
    ];
    for (along_m, half_m) in [(52.0, 1.6), (54.0, 1.6)] {
        for side in [-1.0, 1.0] {
            let (x, y, _) = beside(&line, 60.0, along_m, half_m * side);
            shapes.push((disc(x, y, 0.25), OCCUPIED));
        }
    }
    // Between the gate and the edges, then cones, and heaps of sand and stones behind the bridge.
    for side in [-1.0, 1.0] {
        let (x, y, heading) = beside(&line, 60.0, 53.0, 2.6 * side);
        shapes.push((turned(x, y, 1.0, 1.4, heading), OCCUPIED));
    }
    for i in 0..5 {
        let (x, y, _) = beside(&line, 60.0, 68.0 + 3.0 * i as f32, -3.2 + 0.3 * i as f32);
        shapes.push((disc(x, y, 0.25), OCCUPIED));
    }
    for (along_m, left_m, radius_m) in [(146.0, 3.4, 1.3), (150.0, 3.0, 1.5), (164.0, -3.4, 1.4)] {
        let (x, y, _) = beside(&line, 60.0, along_m, left_m);
        shapes.push((disc(x, y, radius_m), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [19.0, 12.0, 0.0]\ngoal = [186.0, 26.0, 0.0]\nwall_height_m = 0.9\n",
        ..plain(
            "bridge-works",
            "A bridge of 6 m with barriers from either side, behind a gate of 2.7 m.",
            (206.0, 36.0),
        )
    }
}

/// From one gate along limes and graves, past the chapel, to the other gate.
fn cemetery() -> Drawing {
    let mut shapes = vec![
        // The street before the gate, three alleys, the place at the chapel.
        (area(1.0, 8.0, 30.0, 16.0), FREE),
        (area(29.0, 9.4, 110.0, 14.6), FREE),
        (area(93.4, 9.4, 98.6, 58.6), FREE),
        (area(1.0, 53.4, 98.6, 58.6), FREE),
        (area(51.0, 9.4, 80.0, 20.4), FREE),
        (area(56.0, 3.0, 74.0, 13.4), OCCUPIED),
        (area(60.0, 13.4, 63.0, 14.6), OCCUPIED),
        (disc(78.0, 18.6, 0.9), OCCUPIED),
        // The two gates leave 3 m.
        (area(29.0, 8.0, 30.0, 10.5), OCCUPIED),
        (area(29.0, 13.5, 30.0, 16.0), OCCUPIED),
        (area(36.0, 53.0, 36.8, 54.5), OCCUPIED),
        (area(36.0, 57.5, 36.8, 59.0), OCCUPIED),
        car(9.0, 14.6, 0.0),
        car(24.5, 9.3, 180.0),
        // A chain between posts, compost and a skip behind it.
        (area(100.2, 10.4, 100.5, 13.6), OCCUPIED),
        (disc(107.0, 13.0, 1.4), OCCUPIED),
        (turned(105.0, 10.6, 3.0, 1.6, 0.0), OCCUPIED),
    ];
    // Lower left corner of a field, graves in x, graves in y.
    for (x, y, cols, rows) in
        [(31.4, 14.6, 11, 2), (31.4, 3.2, 14, 2), (82.6, 3.2, 6, 2), (83.0, 14.6, 6, 9), (38.0, 44.2, 32, 3)]
            .into_iter()
            .chain([(98.6, 18.0, 4, 10), (38.0, 58.6, 34, 2)])
    {
        shapes.push((area(x, y, x + 1.7 * cols as f32 + 0.4, y + 3.1 * rows as f32), FREE));
        for i in 0..cols * rows {
            let (col, row) = (i % cols, i / cols);
            let (at_x, at_y) = (x + 1.05 + 1.7 * col as f32, y + 1.55 + 3.1 * row as f32);
            let length_m = 1.9 + 0.4 * scatter(i, cols);
            shapes.push((turned(at_x, at_y, 1.0, length_m, 0.0), OCCUPIED));
        }
    }
    for i in 0..4 {
        let x = 34.0 + 5.5 * i as f32;
        shapes.extend([9.7, 14.3].map(|y| (disc(x, y, 0.35), OCCUPIED)));
    }
    for (x, y) in [(93.7, 26.0), (93.7, 34.0), (98.3, 42.0)] {
        shapes.push((area(x - 0.3, y - 0.9, x + 0.3, y + 0.9), OCCUPIED));
    }
    // A watering place and a hand cart.
    shapes.push((turned(70.0, 57.9, 2.4, 1.0, 0.0), OCCUPIED));
    shapes.push((turned(52.0, 54.2, 1.6, 0.8, 15.0), OCCUPIED));
    Drawing {
        shapes,
        lot: "start = [19.0, 12.0, 0.0]\ngoal = [24.0, 56.0, 180.0]\nwall_height_m = 0.8\n",
        ..plain("cemetery", "Alleys between graves, round a chapel, from a gate of 3 m to another.", (112.0, 66.0))
    }
}

/// Through an archway into a yard with trailers and bales, then along the fence of the riding ground.
fn stable_yard() -> Drawing {
    let lane = [(68.2, 27.0), (68.2, 57.0), (139.0, 57.0)];
    let mut shapes = vec![
        // The riding ground, its fence along the lane, two slits in it.
        (area(71.0, 33.0, 130.0, 54.4), FREE),
        (band(&lane, 8.0, 6.0), OCCUPIED),
        (area(70.0, 43.0, 72.0, 44.0), FREE),
        (area(104.0, 53.0, 105.0, 55.0), FREE),
        (area(1.0, 10.0, 37.0, 14.4), FREE),
        (area(36.0, 10.7, 43.0, 13.8), FREE),
        (area(42.0, 7.8, 74.0, 30.0), FREE),
        (band(&lane, 8.0, 4.8), FREE),
        // A barn.
        (area(63.6, 7.8, 74.0, 13.2), OCCUPIED),
    ];
    // Jumps.
    for (x, y, heading) in [(82.0, 42.0, 80.0), (94.0, 47.0, 20.0), (108.0, 40.0, 60.0), (119.0, 46.0, 100.0)] {
        shapes.push((turned(x, y, 3.6, 0.4, heading), OCCUPIED));
    }
    // A dung heap, a lorry, a trailer, a tractor, a trough, a block to mount from.
    for (x, y, length_m, width_m, heading) in [
        (46.0, 26.2, 6.0, 5.0, 0.0),
        (51.0, 9.2, 7.2, 2.4, 0.0),
        (60.6, 10.4, 4.0, 2.0, 84.0),
        (56.6, 26.6, 3.6, 1.9, 80.0),
        (44.2, 19.4, 2.4, 0.8, 90.0),
        (59.6, 18.8, 1.2, 0.9, 25.0),
    ] {
        shapes.push((turned(x, y, length_m, width_m, heading), OCCUPIED));
    }
    for (x, y) in [(72.9, 14.2), (72.9, 15.8), (71.4, 14.6), (61.6, 28.8), (63.2, 29.0), (88.0, 59.2), (89.6, 59.4)] {
        shapes.push((disc(x, y, 0.75), OCCUPIED));
    }
    shapes.push((area(12.0, 9.6, 15.0, 10.6), OCCUPIED));
    shapes.push((turned(66.3, 38.0, 2.4, 0.9, 90.0), OCCUPIED));
    Drawing {
        shapes,
        lot: "start = [18.5, 12.2, 0.0]\ngoal = [120.0, 57.0, 0.0]\nwall_height_m = 1.3\n",
        ..plain("stable-yard", "An archway of 3.1 m, a stable yard and a lane along a riding ground.", (140.0, 62.0))
    }
}

/// A haul road cut into rock, with boulders at its edges, a place to load and a bend of half a turn.
fn quarry() -> Drawing {
    let line = [(1.0, 13.0), (94.0, 13.0), (118.0, 36.0), (92.0, 60.0), (60.0, 54.0), (1.0, 60.0)];
    let mut shapes = vec![(band(&line, 22.0, 8.0), FREE)];
    for i in 0..112 {
        let along_m = 2.0 + 2.1 * i as f32;
        for (k, side) in [(1, -1.0), (2, 1.0)] {
            let (x, y, _) = beside(&line, 22.0, along_m, side * (2.4 + 1.2 * scatter(i, k)));
            shapes.push((disc(x, y, 1.8 + 1.4 * scatter(i, k + 2)), FREE));
        }
    }
    shapes.extend([
        // The place to load: a dumper, an excavator, heaps.
        (disc(54.0, 20.0, 9.5), FREE),
        (turned(55.6, 23.0, 8.6, 4.2, 25.0), OCCUPIED),
        (turned(47.4, 20.4, 5.0, 3.0, 70.0), OCCUPIED),
        (disc(62.0, 18.6, 1.8), OCCUPIED),
        // An old cut, straight on, behind boulders.
        (area(96.0, 9.4, 130.0, 15.4), FREE),
    ]);
    shapes.extend([9.8, 12.2, 14.6].map(|y| (disc(105.0 + 0.3 * y, y, 0.95), OCCUPIED)));
    for i in 0..24 {
        let side = if i % 3 == 0 { 1.0 } else { -1.0 };
        let (x, y, _) = beside(&line, 22.0, 6.0 + 9.4 * i as f32, side * (3.3 + 0.9 * scatter(i, 5)));
        shapes.push((disc(x, y, 0.35 + 0.7 * scatter(i, 6)), OCCUPIED));
    }
    // Blocks that have come down.
    for (along_m, left_m, length_m, heading) in
        [(84.0, 2.6, 2.4, 20.0), (150.0, -2.4, 2.2, 50.0), (186.0, 2.2, 2.8, 5.0)]
    {
        let (x, y, _) = beside(&line, 22.0, along_m, left_m);
        shapes.push((turned(x, y, length_m, 1.9, heading), OCCUPIED));
    }
    Drawing {
        shapes,
        background: UNKNOWN,
        lot: "start = [18.5, 13.0, 0.0]\ngoal = [19.5, 58.0, 174.0]\nwall_height_m = 1.0\n",
        ..plain("quarry", "A haul road of 3.5 to 12 m between rock and boulders, through a wide bend.", (134.0, 72.0))
    }
}
