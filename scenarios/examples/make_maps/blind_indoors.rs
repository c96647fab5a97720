//! Ten maps of halls, works and cellars, scaled to a car, drawn by somebody who did not know how any driver fares.

use crate::drawing::{Drawing, FREE, OCCUPIED, Shape, area, band, disc, plain, scatter, turned};

pub(super) fn drawings() -> Vec<Drawing> {
    vec![
        hangar(),
        brewery(),
        museum(),
        mine_gallery(),
        greenhouse(),
        sorting_centre(),
        tram_depot(),
        server_hall(),
        tunnel_repair(),
        swimming_hall(),
    ]
}

/// Past the nose of one aircraft and then of another, which stands the other way round.
fn hangar() -> Drawing {
    let mut shapes = vec![
        (area(22.0, 4.0, 128.0, 50.0), FREE),
        // Where aircraft parts come in, and where they go out.
        (area(1.0, 7.0, 22.0, 16.0), FREE),
        (area(128.0, 37.0, 150.0, 46.0), FREE),
        // Workshops, a paint booth, a dock round a tail, and offices.
        (area(22.0, 20.0, 40.0, 50.0), OCCUPIED),
        (area(25.0, 23.0, 38.0, 34.0), FREE),
        (area(62.0, 4.0, 80.0, 13.4), OCCUPIED),
        (area(50.0, 39.0, 62.5, 50.0), OCCUPIED),
        (area(98.0, 4.0, 128.0, 33.0), OCCUPIED),
        (area(101.0, 7.0, 125.0, 30.0), FREE),
    ];
    for (x, nose_y, forward) in [(48.0, 17.0, -1.0), (80.0, 37.0, 1.0)] {
        let behind = |length_m: f32| nose_y - forward * length_m;
        let (root, tip) = (behind(13.0), behind(20.5));
        shapes.push((band(&[(x, behind(2.0)), (x, behind(33.0))], 0.0, 4.0), OCCUPIED));
        shapes.push((band(&[(x - 14.0, tip), (x, root), (x + 14.0, tip)], 0.0, 3.0), OCCUPIED));
        for engine_x in [x - 6.0, x + 6.0] {
            shapes.push((turned(engine_x, behind(14.0), 4.0, 1.8, 90.0), OCCUPIED));
        }
    }
    // A fence behind the wing, a tug, engines on stands, steps and crates.
    shapes.push((area(82.0, 30.0, 98.0, 30.4), OCCUPIED));
    for (x, y, length_m, width_m, heading) in [
        (43.0, 23.0, 5.0, 2.4, 5.0),
        (65.4, 48.4, 4.0, 2.2, 5.0),
        (28.0, 17.2, 3.0, 1.6, 10.0),
        (57.0, 6.0, 2.4, 1.6, 40.0),
        (88.0, 32.0, 2.4, 2.0, 0.0),
        (97.0, 47.6, 6.0, 1.8, -12.0),
        (110.0, 36.4, 3.2, 2.0, 20.0),
        (119.0, 46.8, 2.0, 2.0, 0.0),
    ] {
        shapes.push((turned(x, y, length_m, width_m, heading), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [18.0, 11.5, 0.0]\ngoal = [131.0, 41.5, 0.0]\n",
        ..plain("hangar", "A hangar: round the noses of two aircraft that nearly fill it.", (151.0, 54.0))
    }
}

/// From the delivery lane past the kettles, up between the tanks, and along the bottling line.
fn brewery() -> Drawing {
    let mut shapes = vec![
        (area(1.0, 4.0, 24.0, 10.0), FREE),
        (area(24.0, 2.0, 57.6, 20.0), FREE),
        (area(57.6, 4.2, 58.4, 10.2), FREE),
        (area(58.4, 2.0, 80.0, 56.0), FREE),
        (area(12.0, 42.0, 58.4, 56.0), FREE),
        // A cold store.
        (area(22.0, 23.0, 55.0, 39.0), FREE),
        // The conveyor of the bottling line, with its filler and its packer.
        (area(20.0, 44.6, 58.0, 45.6), OCCUPIED),
        (disc(51.0, 45.1, 1.9), OCCUPIED),
        (area(31.0, 43.4, 37.0, 46.6), OCCUPIED),
        // Malt, crates, a cleaning trolley.
        (area(26.0, 2.0, 30.0, 4.0), OCCUPIED),
        (turned(52.0, 3.4, 1.6, 1.2, 15.0), OCCUPIED),
        (turned(43.0, 52.3, 1.2, 1.0, 30.0), OCCUPIED),
        (turned(24.0, 48.4, 1.6, 1.2, -20.0), OCCUPIED),
        (area(72.0, 51.0, 80.0, 56.0), OCCUPIED),
    ];
    for x in [31.5, 40.0, 48.5] {
        shapes.push((disc(x, 15.6, 3.3), OCCUPIED));
    }
    shapes.push((disc(40.5, 2.6, 2.6), OCCUPIED));
    for i in 0..8 {
        let y = 4.6 + 6.0 * i as f32;
        shapes.push((disc(72.8, y, 2.7), OCCUPIED));
        if (1..6).contains(&i) {
            shapes.push((disc(63.2, y + 1.2, 2.7), OCCUPIED));
            shapes.push((area(58.4, y + 0.8, 63.2, y + 1.6), OCCUPIED));
        }
    }
    for i in 0..7 {
        let x = 16.0 + 6.5 * i as f32;
        shapes.push((area(x, 54.6 - 1.2 * scatter(5 * i, 1), x + 1.4 + 3.0 * scatter(5 * i, 2), 56.0), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [18.0, 7.0, 0.0]\ngoal = [30.0, 50.0, 180.0]\n",
        ..plain("brewery", "A brewery: past kettles, between two rows of tanks, along the bottling line.", (82.0, 58.0))
    }
}

/// Rooms whose doors do not face one another, with exhibits in them.
fn museum() -> Drawing {
    let rooms = [
        (1.0, 8.0, 20.0, 16.0),
        (20.6, 4.0, 43.4, 24.0),
        (44.0, 4.0, 67.4, 24.0),
        (68.0, 4.0, 88.4, 24.0),
        (68.0, 24.6, 88.4, 46.0),
        (44.0, 26.0, 67.4, 46.0),
        (1.0, 34.0, 43.4, 42.0),
        // Stores.
        (3.0, 19.0, 17.0, 31.0),
        (20.6, 26.0, 42.0, 32.0),
    ];
    let doors = [
        (20.0, 10.2, 20.6, 13.8),
        (43.4, 16.4, 44.0, 19.8),
        (67.4, 7.4, 68.0, 10.8),
        (79.0, 24.0, 82.6, 24.6),
        (67.4, 38.2, 68.0, 41.6),
        (43.4, 35.8, 44.0, 39.4),
    ];
    let mut shapes: Vec<(Shape, u8)> =
        rooms.iter().chain(&doors).map(|&(x, y, to_x, to_y)| (area(x, y, to_x, to_y), FREE)).collect();
    // Plinths, glass cases, a carriage, the bones of a whale, benches.
    for (x, y, length_m, width_m, heading) in [
        (31.0, 7.6, 3.0, 3.0, 45.0),
        (26.0, 21.0, 6.0, 1.4, 0.0),
        (38.0, 23.2, 3.0, 1.6, 0.0),
        (49.0, 8.0, 7.0, 3.0, -35.0),
        (60.4, 20.0, 10.0, 3.0, -25.0),
        (85.4, 7.0, 3.0, 3.0, 0.0),
        (71.6, 18.6, 7.0, 2.6, 90.0),
        (73.0, 30.0, 4.8, 2.2, 40.0),
        (84.4, 42.4, 3.4, 3.4, 20.0),
        (87.8, 30.0, 5.0, 1.2, 90.0),
        (56.0, 32.0, 8.0, 2.4, 5.0),
        (50.0, 45.4, 6.0, 1.4, 0.0),
        (62.0, 45.4, 4.0, 1.4, 0.0),
        (28.0, 41.6, 5.0, 1.0, 0.0),
        (12.0, 34.4, 4.0, 1.0, 0.0),
    ] {
        shapes.push((turned(x, y, length_m, width_m, heading), OCCUPIED));
    }
    // Statues.
    for (x, y) in [(36.5, 11.6), (64.0, 12.6), (86.2, 20.0), (63.0, 36.4), (36.0, 34.9), (22.0, 41.0), (12.0, 15.2)] {
        shapes.push((disc(x, y, 0.6), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [18.0, 12.0, 0.0]\ngoal = [19.0, 38.0, 180.0]\n",
        ..plain("museum", "A museum: six rooms and a gallery, with doors of 3.5 m and exhibits.", (90.0, 48.0))
    }
}

/// Rough rock, props, drifts that were given up, mine cars in a passing place.
fn mine_gallery() -> Drawing {
    let line = [(1.0, 12.0), (30.0, 14.0), (52.0, 32.0), (80.0, 27.0), (98.0, 46.0), (126.0, 50.0), (159.0, 44.0)];
    let gallery = band(&line, 14.0, 3.6);
    let mut shapes = Vec::new();
    if let Shape::Band { line, .. } = &gallery {
        for (i, point) in line.iter().step_by(2).enumerate() {
            let (x, y) = (point.x + 1.8 * scatter(5 * i, 1) - 0.9, point.y + 1.8 * scatter(5 * i, 2) - 0.9);
            shapes.push((disc(x, y, 1.3 + 0.9 * scatter(5 * i, 3)), FREE));
        }
    }
    shapes.push((gallery, FREE));
    for (drift, width_m) in
        [([(34.0, 17.0), (44.0, 6.0)], 3.4), ([(64.0, 30.0), (70.0, 46.0)], 3.8), ([(112.0, 48.0), (116.0, 32.0)], 3.0)]
    {
        shapes.push((band(&drift, 0.0, width_m), FREE));
    }
    // Drifts walled up or fallen in.
    shapes.push((turned(40.4, 10.0, 1.0, 6.0, -48.0), OCCUPIED));
    shapes.push((disc(67.6, 40.4, 2.6), OCCUPIED));
    shapes.push((turned(113.0, 44.0, 0.4, 4.0, -76.0), OCCUPIED));
    // A passing place with mine cars, a niche for the lamps, a refuge.
    shapes.push((turned(86.0, 36.6, 14.0, 5.0, 46.0), FREE));
    for (x, y) in [(83.1, 35.9), (86.6, 39.5)] {
        shapes.push((turned(x, y, 3.4, 1.7, 46.0), OCCUPIED));
    }
    shapes.push((disc(20.0, 16.0, 1.8), FREE));
    shapes.push((disc(140.0, 44.6, 1.8), FREE));
    for (x, y) in [(24.1, 11.8), (23.9, 15.4), (71.7, 26.6), (72.3, 30.2), (131.9, 47.1), (132.5, 50.7)] {
        shapes.push((disc(x, y, 0.25), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [18.0, 13.2, 4.0]\ngoal = [141.0, 47.3, -10.0]\n",
        ..plain(
            "mine-gallery",
            "A winding mine gallery of 3.5 to 5 m in rough rock, with drifts that are closed.",
            (160.0, 58.0),
        )
    }
}

/// Down one path between the benches, back along the next, and out to the packing shed along the third.
fn greenhouse() -> Drawing {
    let mut shapes = vec![
        (area(1.0, 1.0, 73.0, 33.0), FREE),
        (area(73.0, 26.2, 74.0, 29.8), FREE),
        (area(74.0, 21.0, 106.0, 36.0), FREE),
    ];
    // Rows of benches, with gaps for people.
    let rows = [(1.0, 73.0, 0.5, 4.3), (1.0, 63.0, 7.7, 15.3), (11.0, 73.0, 18.7, 26.3), (1.0, 73.0, 29.7, 33.5)];
    for (row, (from, to, low, high)) in rows.into_iter().enumerate() {
        for i in 0..8 {
            let x = from + 9.0 * i as f32;
            let (short, shorter) = (0.4 * scatter(i, row), 0.4 * scatter(i, row + 7));
            if x < to {
                shapes.push((area(x, low + short, to.min(x + 8.2), high - shorter), OCCUPIED));
            }
        }
    }
    // Barrows, pots, water butts.
    for (x, y, radius_m) in
        [(36.0, 7.5, 0.5), (50.0, 15.6, 0.5), (28.0, 18.6, 0.6), (44.0, 29.5, 0.5), (72.0, 5.4, 1.0), (2.0, 28.6, 1.0)]
    {
        shapes.push((disc(x, y, radius_m), OCCUPIED));
    }
    // Packing tables, and boxes of tomatoes.
    for (x, y, length_m, width_m) in [
        (81.0, 23.4, 8.0, 1.6),
        (93.0, 23.4, 8.0, 1.6),
        (80.0, 33.6, 6.0, 2.0),
        (89.0, 34.6, 3.0, 2.4),
        (99.0, 33.0, 2.4, 2.4),
        (77.4, 26.0, 1.2, 1.0),
    ] {
        shapes.push((turned(x, y, length_m, width_m, 0.0), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [18.0, 6.0, 0.0]\ngoal = [87.0, 28.3, 0.0]\nwall_height_m = 0.9\n",
        ..plain(
            "greenhouse",
            "A greenhouse: three paths of 3 to 4 m between benches, then the packing shed.",
            (107.0, 38.0),
        )
    }
}

/// Conveyors on both sides of a lane, bays with cages, a scanner, cages left in the lane.
fn sorting_centre() -> Drawing {
    let line = [(1.0, 12.0), (36.0, 12.0), (60.0, 36.0), (92.0, 36.0), (92.0, 14.0), (135.0, 14.0)];
    let mut shapes =
        vec![(area(1.0, 1.0, 135.0, 51.0), FREE), (band(&line, 1.5, 9.4), OCCUPIED), (band(&line, 1.5, 5.4), FREE)];
    // Chutes, on the far side of the conveyors.
    for i in 0..6 {
        let along = 4.6 * i as f32;
        shapes.push((turned(8.0 + along, 18.0, 1.4, 3.4, 12.0), OCCUPIED));
        shapes.push((turned(64.0 + along, 42.0, 1.4, 3.4, -12.0), OCCUPIED));
    }
    // Bays, and cages in them.
    for (x, y) in [(12.0, 15.2), (26.0, 8.8), (66.0, 39.2), (80.0, 32.8), (97.4, 17.2), (116.0, 10.8)] {
        shapes.push((turned(x, y, 4.0, 2.4, 0.0), FREE));
        shapes.push((turned(x + 0.8, y, 1.4, 1.6, 8.0), OCCUPIED));
    }
    // A floor with cages that wait for lorries.
    shapes.push((area(103.0, 16.7, 135.0, 26.0), OCCUPIED));
    shapes.push((area(104.0, 11.3, 134.0, 25.0), FREE));
    for i in 0..6 {
        let x = 105.2 + 4.6 * i as f32;
        shapes.push((area(x, 18.0 + 3.0 * scatter(5 * i, 4), x + 3.4, 25.0), OCCUPIED));
    }
    // A scanner, and posts that guard it.
    for y in [33.8, 38.2] {
        shapes.push((turned(74.0, y, 1.6, 1.2, 0.0), OCCUPIED));
    }
    // Cages and parcels left in the lane.
    for (x, y, heading) in [
        (32.0, 14.0, 0.0),
        (45.6, 24.6, 45.0),
        (53.6, 26.8, 40.0),
        (90.2, 24.0, 85.0),
        (109.0, 12.0, 10.0),
        (126.0, 16.1, 0.0),
    ] {
        shapes.push((turned(x, y, 1.5, 1.0, heading), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [18.0, 12.0, 0.0]\ngoal = [117.0, 14.0, 0.0]\nwall_height_m = 1.0\n",
        ..plain(
            "sorting-centre",
            "A parcel sorting centre: a lane of 5.4 m between conveyors, with cages left in it.",
            (136.0, 52.0),
        )
    }
}

/// Trams in five tracks; the way changes from one gap to the next where a tram is out.
fn tram_depot() -> Drawing {
    let tracks: [&[(f32, f32)]; 5] = [
        &[(2.0, 32.0), (33.0, 63.0), (64.0, 94.0), (100.0, 130.0), (131.0, 161.0)],
        &[(2.0, 34.0), (34.8, 64.0), (64.8, 97.0), (97.8, 128.0), (128.8, 161.0)],
        &[(2.0, 25.0), (25.8, 50.0), (71.0, 104.0), (104.8, 134.0), (134.8, 161.0)],
        &[(2.0, 30.0), (30.8, 61.0), (61.8, 98.0), (120.0, 144.0), (144.8, 161.0)],
        &[(2.0, 32.0), (32.8, 63.0), (63.8, 96.0), (96.8, 128.0), (128.8, 161.0)],
    ];
    let mut shapes = vec![(area(1.0, 1.0, 162.0, 30.2), FREE)];
    for (track, trams) in tracks.into_iter().enumerate() {
        let y = 4.0 + 5.8 * track as f32;
        for &(from, to) in trams {
            shapes.push((area(from + 1.4, y - 1.3, to - 1.4, y + 1.3), OCCUPIED));
            shapes.push((area(from, y - 0.9, to, y + 0.9), OCCUPIED));
        }
    }
    // Platforms and wheel sets that fill the gaps on which the way does not go on.
    for (x, y, length_m) in [(42.0, 18.5, 9.0), (79.0, 12.7, 7.0), (89.0, 24.3, 8.0), (129.0, 18.5, 10.0)] {
        shapes.push((turned(x, y, length_m, 3.2, 0.0), OCCUPIED));
    }
    // Ladders, a bucket, a bench, a jack.
    for (x, y, length_m, width_m) in [
        (27.0, 14.1, 3.0, 0.5),
        (44.0, 11.4, 0.8, 0.5),
        (60.0, 12.0, 2.4, 1.0),
        (84.0, 17.1, 2.4, 0.5),
        (95.0, 19.8, 0.6, 0.5),
        (111.0, 25.0, 1.6, 1.0),
        (133.0, 25.6, 3.0, 0.5),
    ] {
        shapes.push((turned(x, y, length_m, width_m, 0.0), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [19.0, 12.7, 0.0]\ngoal = [143.0, 24.3, 0.0]\n",
        ..plain(
            "tram-depot",
            "A tram depot: gaps of 3.2 m between trams, and twice over to the next gap.",
            (163.0, 31.2),
        )
    }
}

/// Aisles between racks, closed by doors at differing depths; coolers in a corridor; a room of batteries.
fn server_hall() -> Drawing {
    let mut shapes = vec![
        (area(1.0, 18.0, 75.6, 23.0), FREE),
        (area(70.0, 18.0, 75.6, 53.0), FREE),
        (area(75.6, 46.0, 128.0, 51.0), FREE),
        (area(79.0, 41.0, 106.0, 57.0), FREE),
        (area(79.0, 24.0, 106.0, 37.0), FREE),
    ];
    for i in 0..10 {
        let x = 6.0 + 6.2 * i as f32;
        for (x, y, door_y) in
            [(x, 29.6, 24.0 + 8.0 * scatter(5 * i, 1)), (x + 1.8, 11.4, 16.6 - 7.0 * scatter(5 * i, 2))]
        {
            shapes.push((turned(x, y, 2.8, 13.4, 0.0), FREE));
            shapes.push((turned(x, door_y, 2.8, 0.4, 0.0), OCCUPIED));
        }
    }
    // Coolers, columns, cabinets, a cable drum, a trolley.
    for i in 0..5 {
        shapes.push((turned(75.0, 26.5 + 4.2 * i as f32, 1.2, 2.6, 0.0), OCCUPIED));
    }
    for i in 0..4 {
        let x = 82.0 + 6.6 * i as f32;
        shapes.push((turned(x, 43.4, 4.6, 1.6, 0.0), OCCUPIED));
        shapes.push((turned(x + 1.0, 54.2, 4.6, 2.0, 0.0), OCCUPIED));
    }
    for (x, y, length_m, width_m, heading) in [
        (30.0, 22.6, 0.8, 0.8, 0.0),
        (54.0, 18.4, 0.8, 0.8, 0.0),
        (43.0, 19.0, 1.6, 1.0, 20.0),
        (92.0, 46.6, 1.4, 0.8, -10.0),
        (100.0, 51.4, 0.8, 0.8, 0.0),
        (114.0, 50.5, 1.6, 1.0, 0.0),
    ] {
        shapes.push((turned(x, y, length_m, width_m, heading), OCCUPIED));
    }
    shapes.push((disc(62.0, 22.0, 0.7), OCCUPIED));
    Drawing {
        shapes,
        lot: "start = [18.0, 20.5, 0.0]\ngoal = [110.0, 48.3, 0.0]\n",
        ..plain(
            "server-hall",
            "A server hall: past the closed aisles of the racks, the coolers and the batteries.",
            (129.0, 60.0),
        )
    }
}

/// A road tunnel with works on one side, then on the other, then past a lorry.
fn tunnel_repair() -> Drawing {
    let line = [(1.0, 10.0), (60.0, 10.0), (112.0, 40.0), (175.0, 40.0)];
    let mut shapes = vec![
        (band(&line, 50.0, 8.4), FREE),
        // Doors to the other tube, a lay-by with a container and a van.
        (area(30.0, 14.2, 33.0, 17.0), FREE),
        (turned(104.0, 40.6, 3.0, 4.0, 30.0), FREE),
        (area(149.0, 44.0, 170.0, 47.6), FREE),
        (turned(155.0, 46.3, 6.0, 2.4, 0.0), OCCUPIED),
        (turned(163.4, 46.4, 4.8, 1.9, 3.0), OCCUPIED),
        // The floor is open on the right, behind boards.
        (area(28.0, 5.8, 44.0, 10.4), OCCUPIED),
        // Scaffolding under the vault on the left.
        (turned(85.0, 26.7, 15.0, 5.2, 30.0), OCCUPIED),
        // A mixer lorry and a pump.
        (area(132.0, 39.2, 140.5, 41.8), OCCUPIED),
        (area(134.0, 41.8, 136.0, 44.2), OCCUPIED),
    ];
    // Cones that lead past the works.
    for (x, y) in [
        (22.0, 6.6),
        (24.0, 7.8),
        (26.0, 9.2),
        (45.6, 9.0),
        (47.0, 7.4),
        (73.1, 21.3),
        (75.0, 21.0),
        (77.0, 20.9),
        (93.4, 30.4),
        (94.0, 32.2),
        (124.0, 43.2),
        (127.0, 42.4),
        (130.0, 41.4),
        (142.4, 42.2),
        (144.4, 43.4),
    ] {
        shapes.push((disc(x, y, 0.25), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [18.0, 11.0, 0.0]\ngoal = [154.0, 40.0, 0.0]\nwall_height_m = 1.0\n",
        ..plain(
            "tunnel-repair",
            "A bent road tunnel under repair: half of it closed, right and left in turn.",
            (175.0, 50.0),
        )
    }
}

/// The deck round a pool on three sides, between columns, deck chairs and pots.
fn swimming_hall() -> Drawing {
    let mut shapes = vec![
        (area(22.0, 4.0, 92.0, 44.0), FREE),
        (area(1.0, 5.0, 22.0, 10.0), FREE),
        (area(1.0, 38.0, 22.0, 43.0), FREE),
        // Changing rooms.
        (area(3.0, 14.0, 17.0, 34.0), FREE),
        // The pool, the children's pool, showers between them, a whirlpool.
        (area(34.0, 11.0, 80.0, 36.0), OCCUPIED),
        (area(22.0, 13.0, 31.0, 35.0), OCCUPIED),
        (area(31.0, 23.0, 34.0, 24.0), OCCUPIED),
        (disc(50.0, 37.0, 2.6), OCCUPIED),
        // The diving tower, and where the lifeguard sits.
        (area(87.0, 20.0, 92.0, 27.0), OCCUPIED),
        (turned(81.0, 31.0, 1.2, 1.2, 0.0), OCCUPIED),
        // A bar in the corner.
        (turned(92.0, 44.0, 6.0, 6.0, 45.0), OCCUPIED),
    ];
    for i in 0..6 {
        let x = 26.0 + 9.6 * i as f32;
        shapes.push((disc(x, 9.4, 0.35), OCCUPIED));
        shapes.push((disc(80.4, 12.5 + 3.4 * i as f32, 0.4), OCCUPIED));
        if i % 3 != 0 {
            shapes.push((turned(x + 3.0, 4.9, 0.8, 1.9, 12.0), OCCUPIED));
            shapes.push((turned(x + 5.0, 5.0, 0.8, 1.9, -8.0), OCCUPIED));
        }
    }
    // Pots with palms, and benches.
    for (x, y) in [(74.0, 38.0), (64.0, 42.8), (58.0, 42.8), (36.0, 37.0), (25.0, 36.4), (88.0, 8.0), (90.0, 33.0)] {
        shapes.push((disc(x, y, 0.7), OCCUPIED));
    }
    for x in [40.0, 46.0, 72.0] {
        shapes.push((turned(x, 43.5, 3.0, 0.8, 0.0), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [18.0, 7.3, 0.0]\ngoal = [19.0, 40.5, 180.0]\nwall_height_m = 0.15\n",
        ..plain(
            "swimming-hall",
            "A swimming hall: the deck round a pool on three of its sides, between columns and chairs.",
            (94.0, 48.0),
        )
    }
}
