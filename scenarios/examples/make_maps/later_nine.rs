//! Nine more, drawn after the families were widened, and first driven by policies trained on those.

use super::drawing::{Drawing, FREE, OCCUPIED, Shape, UNKNOWN, area, band, car, disc, turned};

pub(super) fn drawings() -> Vec<Drawing> {
    vec![
        forecourt(),
        containers(),
        alley(),
        market(),
        checkpoint(),
        mapped_cellar(),
        hairpins(),
        parking_deck(),
        avenue(),
    ]
}

/// A filling station beside a road: rows of pumps under a roof on pillars, a shop, a tanker.
fn forecourt() -> Drawing {
    let mut shapes = vec![(area(1.0, 1.0, 129.0, 25.0), FREE)];
    for x in [46.0, 60.0, 74.0] {
        for y in [8.0, 17.6] {
            shapes.push((turned(x, y, 7.0, 1.2, 0.0), OCCUPIED));
            shapes.push((disc(x - 4.2, y, 0.3), OCCUPIED));
            shapes.push((disc(x + 4.2, y, 0.3), OCCUPIED));
        }
    }
    shapes.push((area(50.0, 21.5, 70.0, 25.0), OCCUPIED));
    shapes.push((turned(63.0, 3.4, 12.0, 2.5, 0.0), OCCUPIED));
    for (x, y) in [(38.0, 4.0), (36.0, 20.5), (88.0, 5.0), (90.0, 20.0)] {
        shapes.push((turned(x, y, 6.0, 3.0, 0.0), OCCUPIED));
    }
    Drawing {
        name: "forecourt",
        about: "A filling station: the way leads between two rows of pumps.",
        size_m: (130.0, 26.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes,
        lot: "start = [20.0, 12.8, 0.0]\ngoal = [110.0, 12.8, 0.0]\n",
        centre_line: None,
    }
}

/// Blocks of containers, four beside each other, with lanes of 5 m.
fn containers() -> Drawing {
    let mut shapes = vec![(area(1.0, 1.0, 111.0, 59.0), FREE)];
    for col in 0..3 {
        for row in 0..3 {
            let (x, y) = (8.0 + 33.0 * col as f32, 7.0 + 17.4 * row as f32);
            for k in 0..4 {
                let gap = if (col + row * 2 + k) % 5 == 0 { 1.5 } else { 0.0 };
                shapes.push((area(x + gap, y + 2.6 * k as f32, x + 24.6, y + 2.6 * k as f32 + 2.44), OCCUPIED));
            }
        }
    }
    shapes.push((area(1.0, 1.0, 36.0, 7.0), OCCUPIED));
    Drawing {
        name: "containers",
        about: "A container yard: lanes between blocks; the branches beside the route are closed when it is read.",
        size_m: (112.0, 60.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes,
        lot: "start = [15.0, 20.9, 0.0]\ngoal = [92.0, 38.3, 0.0]\nclose_branches = true\n",
        centre_line: None,
    }
}

/// A back alley with bins and a loading ramp, around two corners that lorries have worn off.
fn alley() -> Drawing {
    let mut shapes = vec![(band(&[(1.0, 8.0), (44.0, 8.0), (44.0, 46.0), (99.0, 46.0)], 7.5, 4.6), FREE)];
    shapes.push((area(20.0, 9.0, 26.0, 13.5), FREE));
    shapes.push((area(45.0, 26.0, 49.0, 34.0), FREE));
    for (x, y, heading) in [
        (16.0, 6.2, 2.0),
        (30.5, 9.9, 178.0),
        (42.2, 22.0, 92.0),
        (45.8, 38.0, 90.0),
        (62.0, 47.8, 3.0),
        (76.0, 44.2, 0.0),
    ] {
        shapes.push((turned(x, y, 1.4, 1.1, heading), OCCUPIED));
    }
    shapes.push((turned(47.6, 30.0, 4.0, 2.2, 90.0), OCCUPIED));
    Drawing {
        name: "alley",
        about: "A back alley of 4.6 m with bins, around two corners.",
        size_m: (100.0, 52.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes,
        lot: "start = [18.0, 8.4, 0.0]\ngoal = [82.0, 46.2, 0.0]\n",
        centre_line: None,
    }
}

/// Stalls of a market on both sides of a street, with gaps behind some.
fn market() -> Drawing {
    let mut shapes = vec![(band(&[(1.0, 12.0), (60.0, 12.0), (100.0, 22.0), (149.0, 22.0)], 50.0, 11.0), FREE)];
    let centre = |x: f32| 12.0 + 10.0 * ((x - 58.0) / 44.0).clamp(0.0, 1.0);
    for i in 0..24 {
        let x = 26.0 + 4.2 * i as f32;
        for side in [-1.0_f32, 1.0] {
            let depth = 1.6 + 0.35 * ((i * 5 + if side > 0.0 { 3 } else { 0 }) % 5) as f32;
            if (i * 7 + if side > 0.0 { 4 } else { 0 }) % 6 != 0 {
                let y = centre(x) + side * (5.3 - 0.5 * depth);
                shapes.push((turned(x, y, 2.6, depth, if (58.0..102.0).contains(&x) { 13.0 } else { 0.0 }), OCCUPIED));
            }
        }
    }
    Drawing {
        name: "market",
        about: "A street of 11 m between the stalls of a market.",
        size_m: (150.0, 34.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: UNKNOWN,
        shapes,
        lot: "start = [20.0, 12.0, 0.0]\ngoal = [130.0, 22.0, 0.0]\nwall_height_m = 2.5\n",
        centre_line: None,
    }
}

/// Concrete barriers from either side in turn make traffic wind.
fn checkpoint() -> Drawing {
    let mut shapes = vec![(area(1.0, 1.0, 139.0, 10.0), FREE)];
    for i in 0..5 {
        let x = 34.0 + 17.0 * i as f32;
        let y = if i % 2 == 0 { 3.6 } else { 7.4 };
        shapes.push((turned(x, y, 0.7, 5.2, 0.0), OCCUPIED));
    }
    Drawing {
        name: "checkpoint",
        about: "A road of 9 m on which barriers of 5 m from either side in turn make traffic wind.",
        size_m: (140.0, 11.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes,
        lot: "start = [18.0, 5.5, 0.0]\ngoal = [122.0, 5.5, 0.0]\nwall_height_m = 0.9\n",
        centre_line: None,
    }
}

/// A cellar as a robot maps it: walls that are not straight, specks, rooms half seen.
fn mapped_cellar() -> Drawing {
    let mut shapes =
        vec![(band(&[(1.0, 10.0), (40.0, 10.0), (56.0, 24.0), (56.0, 44.0), (109.0, 44.0)], 10.0, 5.2), FREE)];
    let scatter = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 1000) as f32 / 1000.0;
    for i in 0..60 {
        let x = 2.0 + 0.9 * i as f32;
        for (y, k) in [(7.35, 1), (12.65, 2)] {
            if x < 40.0 {
                shapes.push((disc(x, y, 0.1 + 0.25 * scatter(i, k)), OCCUPIED));
            }
        }
        let x = 62.0 + 0.8 * i as f32;
        for (y, k) in [(41.35, 3), (46.65, 4)] {
            shapes.push((disc(x, y, 0.1 + 0.3 * scatter(i, k)), OCCUPIED));
        }
    }
    for (x, y, size) in [(20.0, 13.0, 3.0), (57.0, 30.0, 4.5), (84.0, 47.0, 3.5)] {
        for k in 0..12 {
            let at = (x + size * scatter(k, 5) - 1.0, y + size * scatter(k, 6));
            shapes.push((disc(at.0, at.1, 0.4 + 0.3 * scatter(k, 7)), FREE));
        }
    }
    for (x, y) in [(26.0, 11.8), (53.9, 33.0), (71.0, 42.1), (90.0, 45.9)] {
        shapes.push((disc(x, y, 0.2), OCCUPIED));
    }
    Drawing {
        name: "mapped-cellar",
        about: "A cellar of 5 m as a robot maps it, with ragged walls and specks.",
        size_m: (110.0, 56.0),
        pixel_m: 0.1,
        origin: "[-30.0, -12.0, 0.0]",
        background: UNKNOWN,
        shapes,
        lot: "start = [-11.0, -2.0, 0.0]\ngoal = [60.0, 32.0, 0.0]\n",
        centre_line: None,
    }
}

/// A mountain road with hairpins of 9 m.
fn hairpins() -> Drawing {
    let corners = [(1.0, 10.0), (62.0, 10.0), (62.0, 30.0), (16.0, 30.0), (16.0, 50.0), (79.0, 50.0)];
    Drawing {
        name: "hairpins",
        about: "A mountain road of 6 m with hairpins of 9 m.",
        size_m: (80.0, 62.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes: vec![(band(&corners, 9.0, 6.0), FREE)],
        lot: "start = [20.0, 10.0, 0.0]\ngoal = [60.0, 50.0, 0.0]\nwall_height_m = 0.15\n",
        centre_line: None,
    }
}

/// Once round the core of a parking deck, cars nosed in along the outer wall.
fn parking_deck() -> Drawing {
    let mut shapes = vec![(area(1.0, 1.0, 69.0, 45.0), FREE), (area(13.0, 13.0, 57.0, 33.0), OCCUPIED)];
    for i in 0..17 {
        let x = 13.0 + 2.7 * i as f32;
        if i % 4 != 2 {
            shapes.push(car(x, 3.6, 88.0));
        }
        if i % 5 != 1 {
            shapes.push(car(x, 42.4, 271.0));
        }
    }
    for i in 0..8 {
        let y = 13.0 + 2.7 * i as f32;
        if i % 3 != 1 {
            shapes.push(car(3.6, y, 1.0));
        }
        if i % 4 != 3 {
            shapes.push(car(66.4, y, 180.0));
        }
    }
    for (x, y) in [(13.0, 11.5), (28.0, 12.6), (42.0, 12.6), (57.0, 11.5), (13.0, 34.5), (35.0, 33.4), (57.0, 34.5)] {
        shapes.push((turned(x, y, 0.6, 0.6, 0.0), OCCUPIED));
    }
    // Stairs in the corners.
    for (x, y) in [(1.0, 1.0), (63.0, 1.0), (1.0, 39.0), (63.0, 39.0)] {
        shapes.push((area(x, y, x + 6.0, y + 6.0), OCCUPIED));
    }
    Drawing {
        name: "parking-deck",
        about: "Once round the core of a parking deck, between cars and pillars.",
        size_m: (70.0, 46.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes,
        lot: "start = [35.0, 9.4, 0.0]\nloop = true\n",
        centre_line: None,
    }
}

/// A drive in a park between two rows of trees, with lawns behind them.
fn avenue() -> Drawing {
    let line = [(1.0, 20.0), (50.0, 20.0), (90.0, 34.0), (139.0, 30.0)];
    let mut shapes = vec![(area(0.5, 0.5, 139.5, 49.5), FREE)];
    let path = sim::path::Path::new(&sim::scenario::ReferencePath {
        points: line.map(sim::geometry::Vec2::from).to_vec(),
        corner_radius_m: 35.0,
    });
    for i in 0..65 {
        let pose = path.pose_at(0.5 + 2.2 * i as f32);
        for side in [-1.0, 1.0] {
            let at = pose.position() + side * 2.6 * pose.ahead().perp();
            let trunk: (Shape, u8) = (disc(at.x, at.y, 0.35), OCCUPIED);
            shapes.push(trunk);
        }
    }
    Drawing {
        name: "avenue",
        about: "A drive of 4.5 m between two rows of trees.",
        size_m: (140.0, 50.0),
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes,
        lot: "start = [20.0, 20.0, 0.0]\ngoal = [120.0, 31.5, -5.0]\nwall_height_m = 4.0\n",
        centre_line: None,
    }
}
