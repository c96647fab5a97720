//! Eight more, drawn when families and presets were as they are, to see what carries over to maps nobody had in mind.

use crate::drawing::{Drawing, FREE, OCCUPIED, Shape, UNKNOWN, area, band, car, disc, plain, scatter, turned};

pub(super) fn drawings() -> Vec<Drawing> {
    vec![ferry_deck(), construction_site(), old_town(), drive_through(), toll_plaza(), farm_track(), quay(), ramps()]
}

/// The car deck of a ferry: lorries on both sides of a casing, the way between them.
fn ferry_deck() -> Drawing {
    let mut shapes = vec![(area(1.0, 1.0, 139.0, 19.0), FREE)];
    shapes.push((area(44.0, 9.4, 100.0, 12.6), OCCUPIED));
    shapes.push((area(44.0, 12.6, 100.0, 19.0), OCCUPIED));
    for i in 0..8 {
        let x = 27.0 + 13.0 * i as f32;
        let length_m = 7.0 + 5.0 * scatter(i, 1);
        shapes.push((turned(x, 2.6, length_m, 2.5, 0.0), OCCUPIED));
        if !(40.0..=104.0).contains(&x) {
            shapes.push((turned(x, 15.8 + 0.8 * scatter(i, 2), length_m, 2.5, 0.0), OCCUPIED));
        }
    }
    for (x, y) in [(22.0, 12.5), (33.0, 11.0), (106.0, 12.0), (113.0, 13.0)] {
        shapes.push(car(x, y, 0.0));
    }
    Drawing {
        shapes,
        lot: "start = [12.0, 8.0, 0.0]\ngoal = [126.0, 8.0, 0.0]\n",
        ..plain("ferry-deck", "The car deck of a ferry: past a casing between lorries and cars.", (140.0, 20.0))
    }
}

/// Fences, containers, heaps of earth and an excavator beside a way that was left.
fn construction_site() -> Drawing {
    let line = [(1.0, 9.0), (46.0, 9.0), (62.0, 42.0), (119.0, 42.0)];
    let mut shapes = vec![
        (area(1.0, 1.0, 119.0, 49.0), FREE),
        // Two fences.
        (band(&line, 11.0, 6.3), OCCUPIED),
        (band(&line, 11.0, 6.0), FREE),
        (turned(34.0, 11.2, 1.2, 0.6, 20.0), OCCUPIED),
        (turned(84.0, 39.9, 2.0, 1.0, -10.0), OCCUPIED),
    ];
    for (x, y, radius_m) in [(30.0, 3.4, 1.8), (38.0, 16.0, 2.6), (72.0, 20.0, 5.0), (84.0, 34.0, 3.0)] {
        shapes.push((disc(x, y, radius_m), OCCUPIED));
    }
    for (x, y, heading) in [(20.0, 16.0, 0.0), (76.0, 30.0, 80.0), (100.0, 34.0, 10.0), (36.0, 30.0, 45.0)] {
        shapes.push((turned(x, y, 6.0, 2.4, heading), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [14.0, 9.0, 0.0]\ngoal = [104.0, 42.0, 0.0]\nwall_height_m = 2.0\n",
        ..plain("construction-site", "A way between fences across a building site.", (120.0, 50.0))
    }
}

/// Fronts of houses that do not stand in line.
fn old_town() -> Drawing {
    let line = [(1.0, 10.0), (34.0, 10.0), (56.0, 20.0), (84.0, 20.0), (100.0, 34.0), (100.0, 69.0)];
    let mut shapes = vec![(band(&line, 9.0, 6.6), FREE)];
    for i in 0..4 {
        let x = 14.0 + 5.2 * i as f32 * 0.9;
        shapes.push((turned(x, 6.9 + 0.5 * scatter(i, 3), 4.6, 1.2, 4.0 * scatter(i, 4) - 2.0), OCCUPIED));
        shapes.push((turned(x + 2.0, 13.3 - 0.5 * scatter(i, 5), 4.4, 1.0, 4.0 * scatter(i, 6) - 2.0), OCCUPIED));
    }
    for i in 0..5 {
        let x = 60.0 + 4.6 * i as f32;
        shapes.push((turned(x, 17.0 + 0.4 * scatter(i, 7), 4.0, 1.1, 0.0), OCCUPIED));
        shapes.push((turned(100.0 - 3.2 + 0.5 * scatter(i, 8), 40.0 + 4.4 * i as f32, 4.0, 1.2, 90.0), OCCUPIED));
    }
    // A square.
    shapes.push((area(68.0, 19.0, 79.0, 29.0), FREE));
    shapes.push((disc(74.0, 26.0, 1.6), OCCUPIED));
    Drawing {
        shapes,
        lot: "start = [15.0, 10.0, 0.0]\ngoal = [100.0, 57.0, 90.0]\n",
        ..plain("old-town", "A street of 4 to 6 m between the houses of an old town.", (110.0, 70.0))
    }
}

/// The lane round a restaurant, between a kerb and its wall, with a menu board and a window.
fn drive_through() -> Drawing {
    let line = [(1.0, 8.0), (52.0, 8.0), (52.0, 34.0), (14.0, 34.0), (14.0, 58.0), (69.0, 58.0)];
    let mut shapes = vec![(band(&line, 8.0, 4.4), FREE)];
    shapes.push((area(30.0, 31.4, 40.0, 32.4), OCCUPIED));
    shapes.push((turned(54.0, 22.0, 2.4, 0.5, 90.0), OCCUPIED));
    shapes.push((disc(24.0, 9.9, 0.3), OCCUPIED));
    shapes.push((disc(12.3, 46.0, 0.3), OCCUPIED));
    Drawing {
        shapes,
        background: UNKNOWN,
        lot: "start = [14.0, 8.0, 0.0]\ngoal = [56.0, 58.0, 0.0]\nwall_height_m = 0.2\n",
        ..plain("drive-through", "A lane of 4.4 m between kerbs, round two bends and two more.", (70.0, 66.0))
    }
}

/// Booths on islands; the lanes beside the route are closed when it is read.
fn toll_plaza() -> Drawing {
    let mut shapes = vec![(area(1.0, 12.0, 149.0, 20.0), FREE), (area(50.0, 3.0, 100.0, 29.0), FREE)];
    for k in 0..8 {
        // The plaza widens and narrows in steps.
        let (low, high) = (12.0 - 1.1 * k as f32, 20.0 + 1.1 * k as f32);
        shapes.push((area(50.0 - 2.5 * (8 - k) as f32, low, 100.0 + 2.5 * (8 - k) as f32, high), FREE));
    }
    for lane in 0..5 {
        let y = 6.0 + 5.0 * lane as f32;
        shapes.push((area(66.0, y - 0.6, 84.0, y + 0.6), OCCUPIED));
        shapes.push((area(73.0, y - 1.0, 77.0, y + 1.0), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [20.0, 16.0, 0.0]\ngoal = [130.0, 16.0, 0.0]\nwall_height_m = 1.0\nclose_branches = true\n",
        ..plain(
            "toll-plaza",
            "A toll plaza: lanes of 3 to 4 m between booths; those beside the route are closed when it is read.",
            (150.0, 32.0),
        )
    }
}

/// Between hedges, with a passing place and a gate.
fn farm_track() -> Drawing {
    let line = [(1.0, 20.0), (30.0, 20.0), (52.0, 34.0), (76.0, 16.0), (102.0, 30.0), (128.0, 12.0), (159.0, 12.0)];
    let mut shapes: Vec<(Shape, u8)> = vec![(band(&line, 22.0, 4.2), FREE)];
    shapes.push((area(14.0, 20.0, 27.0, 24.6), FREE));
    for (x, y) in [(40.0, 24.3), (90.4, 25.6), (114.5, 24.0)] {
        shapes.push((disc(x, y, 0.4), OCCUPIED));
    }
    for (x, y) in [(138.0, 9.9), (138.0, 14.1)] {
        shapes.push((turned(x, y, 0.3, 0.9, 0.0), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [12.0, 20.0, 0.0]\ngoal = [148.0, 12.0, 0.0]\nwall_height_m = 1.4\n",
        ..plain("farm-track", "A farm track of 4.2 m between hedges, winding.", (160.0, 46.0))
    }
}

/// Bollards, the legs of a crane and goods on a quay; water on one side.
fn quay() -> Drawing {
    let mut shapes = vec![(area(1.0, 6.0, 149.0, 22.0), FREE)];
    for i in 0..12 {
        shapes.push((disc(12.0 + 11.0 * i as f32, 7.0, 0.35), OCCUPIED));
    }
    for x in [44.0, 58.0, 98.0, 112.0] {
        for y in [9.6, 18.4] {
            shapes.push((turned(x, y, 2.2, 1.0, 0.0), OCCUPIED));
        }
    }
    for (i, (x, y)) in
        [(30.0, 17.5), (51.0, 12.5), (70.0, 19.0), (76.0, 11.0), (86.0, 16.6), (105.0, 14.8), (124.0, 10.5)]
            .into_iter()
            .enumerate()
    {
        shapes.push((turned(x, y, 3.0 + 3.0 * scatter(i, 9), 2.4, 30.0 * scatter(i, 10) - 15.0), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [16.0, 13.5, 0.0]\ngoal = [136.0, 14.0, 0.0]\nwall_height_m = 0.3\n",
        ..plain("quay", "A quay of 16 m with goods and the legs of two cranes.", (150.0, 28.0))
    }
}

/// Half-turns between concrete walls, as on the ramps of a multi-storey car park.
fn ramps() -> Drawing {
    let line = [(1.0, 8.0), (50.0, 8.0), (50.0, 28.0), (20.0, 28.0), (20.0, 48.0), (79.0, 48.0)];
    let mut shapes = vec![(band(&line, 9.9, 5.0), FREE)];
    for (x, y) in [(30.0, 10.2), (36.0, 30.2), (48.0, 45.8)] {
        shapes.push((turned(x, y, 0.8, 0.5, 0.0), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [14.0, 8.0, 0.0]\ngoal = [66.0, 48.0, 0.0]\n",
        ..plain("ramps", "Ramps of 5 m with half-turns of 10 m radius between walls.", (80.0, 56.0))
    }
}
