//! Ten maps of places where people park, load, queue, repair, test, race or practise with vehicles, drawn by somebody
//! who did not know how any driver fares.

use crate::drawing::{
    Drawing, FREE, OCCUPIED, Shape, Shapes, UNKNOWN, area, band, car, disc, discs, distance_m, plain, polar, scatter,
    shake, solid, turned, way,
};
use sim::geometry::Vec2;
use sim::maths::{angle_rad, cos, sin};

pub(super) fn drawings() -> Vec<Drawing> {
    vec![
        scrap_yard(),
        drive_in_cinema(),
        recycling_ramp(),
        grain_silos(),
        lock_up_garages(),
        car_train(),
        ski_car_park(),
        forest_off_road(),
        repair_shop(),
        cone_course(),
    ]
}

/// A straight wall, rail or fence, longer by half its width at either end.
fn rail(from: (f32, f32), to: (f32, f32), width_m: f32) -> Shape {
    let (a, b) = (Vec2::from(from), Vec2::from(to));
    let (middle, along) = (0.5 * (a + b), b - a);
    turned(middle.x, middle.y, along.length() + width_m, width_m, angle_rad(along).to_degrees())
}

/// So many posts from one place to another.
fn posts(from: (f32, f32), to: (f32, f32), count: usize, radius_m: f32) -> Shapes {
    let (a, b) = (Vec2::from(from), Vec2::from(to));
    discs((0..count).map(|i| a + (b - a) * (i as f32 / (count - 1) as f32)), radius_m)
}

/// A tractor or lorry with a trailer behind it, `x` and `y` of the coupling.
fn with_trailer(x: f32, y: f32, heading_deg: f32, lengths_m: (f32, f32), width_m: f32, bend_deg: f32) -> Shapes {
    let front = polar(x, y, 0.5 * lengths_m.0 + 0.3, heading_deg);
    let rear = polar(x, y, -(0.5 * lengths_m.1 + 0.5), heading_deg + bend_deg);
    solid([
        turned(front.x, front.y, lengths_m.0, width_m, heading_deg),
        turned(rear.x, rear.y, lengths_m.1, width_m, heading_deg + bend_deg),
        disc(x, y, 0.4),
    ])
}

/// Places (x, y, heading in degrees) every `spacing_m` beside a line, `left_m` to its left.
fn beside(line: &[Vec2], left_m: f32, spacing_m: f32) -> Vec<(f32, f32, f32)> {
    let mut places: Vec<(f32, f32, f32)> = Vec::new();
    for ends in line.windows(2) {
        let along = ends[1] - ends[0];
        let left = along.normalize_or_zero().perp() * left_m;
        for part in 0..10 {
            let at = ends[0] + along * (part as f32 / 10.0) + left;
            if places.last().is_none_or(|&(x, y, _)| at.distance(Vec2::new(x, y)) >= spacing_m) {
                places.push((at.x, at.y, angle_rad(along).to_degrees()));
            }
        }
    }
    places
}

/// A yard of wrecks at any angle, with a weighbridge, tyre heaps and a press.
fn scrap_yard() -> Drawing {
    let mut shapes = vec![(area(1.0, 1.0, 83.0, 44.0), FREE)];
    // The rows between the two lanes, and wrecks along the fence.
    for i in 0..24 {
        let x = 2.0 + 2.55 * i as f32;
        for (k, y) in [14.2, 19.0, 23.6].into_iter().enumerate() {
            if (k, i) != (0, 16) && (k, i) != (0, 17) && (k, i) != (2, 9) {
                shapes.push(car(x + 0.2 * shake(i, k), y + 0.8 * shake(i, k + 3), 90.0 + 24.0 * shake(i, k + 6)));
            }
        }
    }
    for i in 0..11 {
        if i != 4 && i != 5 {
            shapes.push(car(4.0 + 6.0 * i as f32, 2.2 + 0.4 * shake(i, 20), 12.0 * shake(i, 21)));
        }
    }
    // Sheet metal behind the upper lane, and a crane on a round base.
    for i in 0..18 {
        let x = 3.0 + 4.4 * i as f32;
        shapes.push((disc(x, 41.0 + shake(i, 30), 3.2 + 1.1 * scatter(i, 31)), OCCUPIED));
    }
    shapes.extend(solid([
        disc(38.0, 37.4, 2.6),
        turned(38.0, 34.9, 5.5, 1.4, 24.0),
        turned(20.0, 36.0, 6.2, 2.5, 7.0),
    ]));
    // Weighbridge between rails, with its hut.
    shapes.extend(solid([
        rail((26.0, 5.1), (36.0, 5.1), 0.3),
        rail((26.0, 9.0), (36.0, 9.0), 0.3),
        area(28.5, 1.0, 33.0, 4.3),
        turned(31.0, 10.4, 4.0, 1.0, 0.0),
    ]));
    shapes.extend(posts((26.0, 4.0), (26.0, 1.4), 3, 0.2));
    // Tyres, stacks of pressed cars and the press round the turn.
    let tyres = [(43.5, 10.9, 1.3), (45.6, 11.3, 1.1), (53.0, 3.6, 1.0), (61.6, 24.6, 1.5), (62.6, 20.2, 1.2)];
    shapes.extend(solid(tyres.map(|(x, y, radius_m)| disc(x, y, radius_m))));
    shapes.extend(solid([
        area(75.2, 8.6, 83.0, 22.0),
        disc(80.0, 37.0, 6.0),
        disc(79.4, 5.6, 3.9),
        turned(75.5, 3.0, 4.2, 1.9, 25.0),
        turned(77.6, 26.0, 5.4, 2.4, 76.0),
        area(79.0, 22.0, 83.0, 34.0),
        turned(74.5, 36.6, 4.0, 2.0, 160.0),
        turned(64.0, 15.5, 1.8, 3.8, 10.0),
        disc(74.8, 18.0, 0.8),
    ]));
    Drawing {
        shapes,
        lot: "start = [18.0, 7.0, 0.0]\ngoal = [20.0, 30.0, 180.0]\nwall_height_m = 2.0\n",
        ..plain("scrap-yard", "A scrap yard with rows of wrecks, a weighbridge, tyre heaps and a press.", (84.0, 45.0))
    }
}

/// Cars in curved rows before a screen.
fn drive_in_cinema() -> Drawing {
    let at = |radius_m: f32, angle_deg: f32| <(f32, f32)>::from(polar(48.0, 74.0, radius_m, angle_deg));
    let arc = |radius_m: f32, from: i16, to: i16| -> Vec<(f32, f32)> {
        (from..=to).step_by(5).map(|angle| at(radius_m, f32::from(angle))).collect()
    };
    let lane = |mouth, radius_m| [vec![mouth], arc(radius_m, 225, 315)].concat();
    let (outer, inner) = (lane((2.5, 52.0), 47.0), lane((9.5, 68.0), 31.0));
    let turn = [at(47.0, 313.0), (87.0, 46.5), (76.0, 57.5), at(31.0, 313.0)];
    let mut shapes =
        vec![(band(&outer, 3.0, 7.4), FREE), (band(&inner, 3.0, 7.4), FREE), (band(&turn, 6.0, 8.6), FREE)];
    shapes.extend([(band(&arc(31.0, 227, 313), 3.0, 16.0), FREE), (band(&arc(47.0, 225, 313), 3.0, 15.4), FREE)]);
    // The meadow before the screen, and the bank between the lanes.
    shapes.extend([
        (band(&arc(19.0, 205, 335), 3.0, 16.0), FREE),
        (disc(48.0, 62.0, 10.0), FREE),
        (area(36.0, 66.0, 60.0, 74.0), OCCUPIED),
    ]);
    shapes.push((band(&arc(39.2, 215, 315), 3.0, 0.9), OCCUPIED));
    shapes.extend(discs((0..43).map(|i| at(22.6, 200.0 + 3.4 * i as f32)), 0.15));
    shapes.extend(solid([band(&arc(27.0, 190, 228), 3.0, 0.6), band(&arc(26.5, 307, 345), 3.0, 0.6)]));
    for (row, (radius_m, faces)) in [(25.9, 0.0), (36.1, 0.0), (42.3, 180.0), (52.2, 180.0)].into_iter().enumerate() {
        let step_deg = (2.75_f32 / radius_m).to_degrees();
        for i in 0..(83.0 / step_deg) as usize {
            let angle = 229.0 + step_deg * i as f32;
            let (x, y) = at(radius_m + 0.45 * shake(i, row), angle);
            if row == 0 || scatter(i, row + 10) > 0.13 {
                shapes.push(car(x, y, angle + faces + 5.0 * shake(i, row + 20)));
            }
            shapes.extend(discs([at(radius_m + 1.2, angle + 0.5 * step_deg)], 0.15));
        }
    }
    // The hut with the projector, a snack van, the ticket hut and loudspeakers.
    let (x, y) = at(36.2, 270.0);
    shapes.extend(solid([
        turned(x, y, 8.0, 5.6, 0.0),
        turned(86.4, 41.2, 3.8, 1.8, 62.0),
        turned(9.3, 49.7, 2.2, 1.6, -45.0),
        disc(80.6, 52.0, 0.4),
        disc(14.5, 59.0, 0.5),
    ]));
    Drawing {
        shapes,
        lot: "start = [13.0, 41.2, -43.0]\ngoal = [21.5, 56.2, 135.0]\nwall_height_m = 1.5\n",
        ..plain("drive-in-cinema", "A drive-in cinema with curved rows of cars before the screen.", (96.0, 74.0))
    }
}

/// Skips docked at an angle to both sides of a raised ramp.
fn recycling_ramp() -> Drawing {
    let mut shapes = vec![
        (area(4.0, 1.0, 15.0, 43.0), FREE),
        (area(10.0, 29.0, 89.0, 43.0), FREE),
        (area(77.0, 31.0, 89.0, 76.0), FREE),
        // Saw teeth: the walls at which the skips stand.
        (area(16.0, 27.0, 75.5, 32.0), OCCUPIED),
        (area(16.0, 40.0, 77.0, 43.5), OCCUPIED),
    ];
    for i in 0..12 {
        let x = 19.0 + 4.8 * i as f32;
        shapes.push((turned(x, 31.4, 3.6, 3.2, 60.0), FREE));
        shapes.push((turned(x + 1.6, 40.6, 3.6, 3.0, -60.0), FREE));
        shapes.push((turned(x - 0.4, 30.6 + 0.3 * shake(i, 1), 3.0, 2.4, 60.0), OCCUPIED));
        if i != 7 {
            shapes.push((turned(x + 1.3, 41.2 + 0.3 * shake(i, 2), 3.0, 2.4, -60.0), OCCUPIED));
        }
    }
    // People who unload: cars at the edge, one with a trailer.
    shapes.extend([car(27.0, 38.6, 3.0), car(38.0, 33.7, 178.0), car(62.0, 33.9, -4.0), car(71.0, 38.7, 6.0)]);
    shapes.extend(with_trailer(49.0, 38.4, 2.0, (4.6, 2.6), 1.8, -6.0));
    // Gate with its office and a barrier, and a pallet of old screens.
    shapes.extend(solid([
        area(4.0, 17.0, 7.2, 24.0),
        area(12.2, 19.5, 15.0, 21.0),
        turned(13.9, 12.0, 1.2, 1.0, 12.0),
        disc(11.9, 19.6, 0.2),
        turned(5.0, 30.0, 1.6, 1.2, 30.0),
        turned(5.2, 39.5, 2.2, 1.4, 80.0),
        disc(7.5, 42.3, 0.9),
        disc(9.6, 42.5, 0.8),
        disc(11.6, 42.4, 0.8),
    ]));
    // Bottle banks, fridges and the paint hut on the way out.
    for i in 0..6 {
        shapes.push((disc(88.0 + 0.2 * shake(i, 5), 44.5 + 2.2 * i as f32, 0.95), OCCUPIED));
    }
    for i in 0..5 {
        shapes.push((turned(77.6 + 0.3 * shake(i, 6), 47.0 + 1.2 * i as f32, 0.8, 0.9, 20.0 * shake(i, 7)), OCCUPIED));
    }
    shapes.extend(solid([area(77.0, 56.0, 80.6, 62.0), turned(87.5, 31.8, 2.6, 1.5, 40.0)]));
    shapes.push(car(87.6, 66.0, 86.0));
    shapes.extend(solid([rail((83.0, 31.2), (86.0, 31.2), 0.5), disc(88.0, 36.0, 0.6)]));
    Drawing {
        shapes,
        lot: "start = [9.6, 17.0, 90.0]\ngoal = [83.6, 60.0, 90.0]\nwall_height_m = 1.2\n",
        ..plain(
            "recycling-ramp",
            "A recycling yard where skips stand at an angle on both sides of a ramp.",
            (92.0, 77.0),
        )
    }
}

/// Round silos, a weighbridge and a hall that grain is tipped in.
fn grain_silos() -> Drawing {
    let mut shapes = vec![
        (area(1.0, 1.0, 79.0, 18.0), FREE),
        (area(62.0, 3.0, 79.0, 66.0), FREE),
        (area(1.0, 50.0, 79.0, 66.0), FREE),
        (area(1.0, 15.0, 62.0, 52.0), FREE),
    ];
    for row in 0..3 {
        for col in 0..5 {
            let (x, y) = (7.0 + 11.2 * col as f32, 20.5 + 11.3 * row as f32);
            shapes.extend([(disc(x, y, 5.3), OCCUPIED), (disc(x, y, 4.9), UNKNOWN)]);
        }
    }
    // Conveyors between the silos, the dryer, and stairs at some silos.
    shapes.extend(solid([
        area(1.0, 25.5, 62.0, 26.8),
        area(1.0, 36.9, 62.0, 38.2),
        area(57.0, 17.5, 66.4, 46.0),
        turned(13.0, 15.0, 1.4, 2.6, 20.0),
        turned(41.5, 14.8, 2.0, 1.2, -15.0),
        turned(34.6, 49.0, 1.6, 1.4, 40.0),
    ]));
    // Weighbridge, laboratory and the queue on the lower side.
    shapes.extend(solid([
        rail((28.0, 7.2), (42.0, 7.2), 0.35),
        rail((28.0, 11.2), (42.0, 11.2), 0.35),
        area(31.0, 1.0, 38.5, 6.4),
        area(33.0, 12.5, 37.0, 16.0),
    ]));
    shapes.extend(posts((28.0, 6.0), (28.0, 1.6), 5, 0.2));
    shapes.extend(posts((42.0, 6.0), (42.0, 1.6), 5, 0.2));
    shapes.extend(posts((28.0, 12.3), (28.0, 15.0), 3, 0.2));
    shapes.extend(posts((42.0, 12.3), (42.0, 15.0), 3, 0.2));
    shapes.extend(with_trailer(13.0, 3.2, 2.0, (4.8, 7.2), 2.4, 5.0));
    shapes.extend(with_trailer(24.0, 3.4, -3.0, (4.6, 5.0), 2.3, -4.0));
    shapes.extend(with_trailer(53.0, 3.6, 4.0, (4.8, 6.5), 2.4, -12.0));
    // The tipping hall, open at both ends.
    shapes.extend(solid([area(66.0, 24.0, 67.2, 44.0), area(73.6, 22.0, 79.0, 44.0)]));
    for i in 0..4 {
        let y = 26.0 + 5.0 * i as f32;
        shapes.extend(solid([area(66.0, y, 67.9, y + 0.7), area(73.0, y, 74.0, y + 0.7)]));
    }
    shapes.extend(solid([turned(74.5, 5.0, 9.0, 2.5, 47.0), area(76.6, 9.0, 79.0, 22.5), disc(75.9, 17.6, 0.8)]));
    // Heaps in the open shed, wagons and a loader on the upper side.
    shapes.push((area(1.0, 62.5, 60.0, 66.5), OCCUPIED));
    for i in 0..5 {
        let x = 5.0 + 11.5 * i as f32;
        shapes.extend([(area(x, 62.0, x + 7.0, 65.5), FREE), (disc(x + 3.5, 66.0, 3.0 + 0.5 * shake(i, 3)), OCCUPIED)]);
    }
    shapes.extend(with_trailer(47.0, 51.0, 178.0, (4.6, 6.6), 2.4, 4.0));
    shapes.extend(solid([
        turned(29.0, 60.6, 4.4, 2.2, 166.0),
        turned(75.0, 62.0, 8.0, 2.4, 128.0),
        area(76.8, 44.0, 79.0, 60.0),
        disc(66.0, 64.8, 1.4),
        disc(69.2, 65.2, 1.1),
        turned(64.0, 49.2, 2.4, 1.2, 15.0),
    ]));
    Drawing {
        shapes,
        lot: "start = [17.5, 9.3, 0.0]\ngoal = [22.0, 56.5, 180.0]\nwall_height_m = 2.0\n",
        ..plain("grain-silos", "A grain store with round silos, a weighbridge and a tipping hall.", (80.0, 67.0))
    }
}

/// Blocks of garages, some of them open, with bins and a car half out.
fn lock_up_garages() -> Drawing {
    let mut shapes = vec![
        (area(1.0, 6.0, 79.0, 13.0), FREE),
        (area(63.0, 6.0, 79.0, 32.0), FREE),
        (area(1.0, 25.0, 79.0, 32.0), FREE),
        (area(1.0, 25.0, 17.0, 51.0), FREE),
        (area(1.0, 44.0, 79.0, 51.0), FREE),
    ];
    // Doors along the sides of each aisle: the front, the way into a garage, the first door, cars half out, open doors.
    let rows = [
        (6.0, -1.0, 1.6, vec![4, 15], vec![2, 10, 17]),
        (13.0, 1.0, 1.6, vec![9], vec![3, 14, 18]),
        (25.0, -1.0, 1.6, vec![3, 13], vec![6, 16]),
        (32.0, 1.0, 18.6, vec![4, 14], vec![2, 11, 17]),
        (44.0, -1.0, 18.6, vec![6, 16], vec![1, 9, 14]),
    ];
    for (row, (front, into, first, half_out, open)) in rows.into_iter().enumerate() {
        for i in 0..20 {
            let x = first + 3.05 * i as f32 + 1.25;
            shapes.push((turned(x, front, 2.5, 0.5, 0.0), FREE));
            if open.contains(&i) {
                shapes.push((turned(x, front + into * 2.6, 2.5, 5.2, 0.0), FREE));
                shapes.push(match i % 3 {
                    0 => car(x, front + into * 3.0, 90.0 + 2.0 * shake(i, row)),
                    1 => (turned(x + 0.4 * shake(i, 3), front + into * 4.4, 1.8, 0.7, 8.0), OCCUPIED),
                    _ => (turned(x - 0.7, front + into * 3.0, 0.7, 1.9, 12.0 * shake(i, 5)), OCCUPIED),
                });
            }
            if half_out.contains(&i) {
                shapes.push((turned(x, front + into * 1.2, 2.5, 2.4, 0.0), FREE));
                shapes.push(car(x, front - into * 0.1, 90.0 + 3.0 * shake(i, row)));
            }
        }
    }
    // Hedge along the uppermost aisle, bins, a moped, a skip, a tree and lamp posts.
    for i in 0..52 {
        shapes.push((disc(1.0 + 1.5 * i as f32, 51.0 + 0.3 * shake(i, 40), 0.9), OCCUPIED));
    }
    shapes.extend(solid([
        turned(77.6, 9.0, 1.0, 0.8, 5.0),
        turned(77.5, 10.4, 1.0, 0.8, -8.0),
        turned(77.8, 24.0, 4.2, 1.9, 88.0),
        turned(2.6, 30.0, 0.8, 1.9, 20.0),
        disc(2.8, 38.0, 1.1),
        turned(64.2, 20.0, 1.8, 0.7, 70.0),
        turned(15.8, 36.0, 1.0, 0.9, 4.0),
        turned(15.7, 37.3, 1.0, 0.9, -4.0),
        disc(62.8, 13.6, 0.5),
        turned(45.0, 49.4, 1.9, 0.8, 4.0),
        disc(74.0, 30.9, 0.2),
        disc(17.6, 44.4, 0.5),
    ]));
    shapes.push(car(58.0, 48.9, 2.0));
    Drawing {
        shapes,
        lot: "start = [17.5, 9.3, 0.0]\ngoal = [48.0, 47.4, 0.0]\nwall_height_m = 2.0\n",
        ..plain("lock-up-garages", "Blocks of lock-up garages with open doors, bins and cars half out.", (80.0, 53.0))
    }
}

/// The lanes before a car train, its ramp and its deck with rails and stanchions.
fn car_train() -> Drawing {
    let mut shapes = vec![(area(1.0, 1.0, 160.0, 39.0), FREE)];
    // Waiting lanes: all but one are full or closed by bollards.
    for (lane, y) in [2.4, 12.8, 16.6].into_iter().enumerate() {
        for i in 0..6 {
            shapes.push(car(
                5.0 + 6.1 * i as f32 + 0.5 * shake(i, lane),
                y + 0.2 * shake(i, lane + 4),
                2.0 * shake(i, lane + 8),
            ));
        }
    }
    shapes.extend(solid([
        rail((1.0, 4.6), (40.0, 4.6), 0.3),
        rail((1.0, 10.6), (38.0, 10.6), 0.3),
        rail((1.0, 14.7), (36.0, 14.7), 0.3),
    ]));
    shapes.extend(posts((38.0, 11.0), (36.4, 18.6), 7, 0.2));
    shapes.extend(posts((40.0, 4.4), (41.0, 1.2), 4, 0.2));
    shapes.extend(posts((38.2, 10.8), (40.6, 12.2), 4, 0.2));
    shapes.push((area(1.0, 18.4, 36.0, 19.0), OCCUPIED));
    // From the lanes to the ramp, and from the train down to the road.
    let points = [(1.0, 7.6), (42.0, 7.6), (53.0, 24.0), (124.0, 24.0), (136.0, 11.0), (160.0, 11.0)];
    let line = way(&points, 9.0);
    for left_m in [-3.4, 3.4] {
        for (x, y, heading_deg) in beside(&line, left_m, 1.5) {
            if (40.0..64.0).contains(&x) || (113.0..139.0).contains(&x) {
                shapes.push((turned(x, y, 1.1, 0.25, heading_deg), OCCUPIED));
            }
        }
    }
    // Three wagons: rails, stanchions and the gaps between them.
    for wagon in 0..3 {
        let x = 64.0 + 16.4 * wagon as f32;
        for (y, out) in [(22.3, -0.4), (25.7, 0.4)] {
            shapes.push((rail((x, y + out), (x + 15.4, y + out), 0.5), OCCUPIED));
            shapes.extend(posts((x + 0.4, y + 0.2 * out), (x + 15.0, y + 0.2 * out), 7, 0.16));
        }
    }
    for (x, reach) in [(63.0, -1.0), (113.5, 1.0)] {
        for (y, out) in [(22.2, -1.0), (25.8, 1.0)] {
            shapes.push((rail((x, y), (x + reach * 3.0, y + out * 1.4), 0.4), OCCUPIED));
        }
    }
    // The other train, loaded, and the platform with its shelters and lamps.
    for i in 0..9 {
        shapes.push(car(60.0 + 6.2 * i as f32, 31.0, 180.0 * (i % 2) as f32));
    }
    shapes.extend(solid([
        rail((56.0, 29.4), (116.0, 29.4), 0.3),
        rail((56.0, 32.6), (116.0, 32.6), 0.3),
        area(117.0, 29.0, 131.0, 33.0),
    ]));
    shapes.extend(posts((62.0, 18.5), (112.0, 18.5), 6, 0.2));
    shapes.extend(solid([
        area(70.0, 15.5, 78.0, 17.3),
        area(92.0, 15.4, 97.0, 17.2),
        turned(85.0, 16.2, 1.8, 0.5, 0.0),
        area(60.0, 2.0, 84.0, 9.0),
    ]));
    shapes.extend([car(92.0, 4.5, 88.0), car(95.2, 4.2, 92.0), car(101.0, 4.6, 90.0)]);
    shapes.extend(solid([
        rail((139.0, 7.4), (160.0, 7.4), 0.3),
        rail((139.0, 14.6), (160.0, 14.6), 0.3),
        disc(146.0, 18.0, 1.4),
        disc(142.0, 26.0, 1.8),
        disc(149.0, 31.0, 1.6),
    ]));
    shapes.push(car(46.0, 33.0, 70.0));
    Drawing {
        shapes,
        lot: "start = [18.0, 7.6, 0.0]\ngoal = [143.5, 11.0, 0.0]\nwall_height_m = 0.4\n",
        ..plain("car-train", "A station where cars drive onto the deck of a train and off again.", (161.0, 40.0))
    }
}

/// A car park between snow heaps, below a valley station.
fn ski_car_park() -> Drawing {
    let points = [(2.0, 10.0), (40.0, 10.0), (54.0, 30.0), (32.0, 48.0), (48.0, 66.0), (98.0, 66.0)];
    let line = way(&points, 9.0);
    let mut shapes = vec![(band(&points[..3], 9.0, 9.0), FREE), (band(&points[1..], 9.0, 16.0), FREE)];
    // Ploughed heaps.
    for (side, left_m) in [-1.0_f32, 1.0].into_iter().enumerate() {
        for (i, (x, y, _)) in beside(&line, left_m * 5.6, 1.7).into_iter().enumerate() {
            if x < 48.0 && y < 24.0 {
                let heap =
                    disc(x + 0.4 * shake(i, side), y + 0.5 * shake(i, side + 2), 1.2 + 1.0 * scatter(i, side + 4));
                shapes.push((heap, OCCUPIED));
            }
        }
        for (i, (x, y, _)) in beside(&line, left_m * 8.6, 1.7).into_iter().enumerate() {
            if y > 22.0 && distance_m(&line, Vec2::new(x, y)) > 7.5 {
                let heap =
                    disc(x + 0.5 * shake(i, side + 6), y + 0.5 * shake(i, side + 8), 1.0 + 1.1 * scatter(i, side + 9));
                shapes.push((heap, OCCUPIED));
            }
        }
        // Cars with their noses to the heaps, not quite in line.
        for (i, (x, y, heading_deg)) in beside(&line, left_m * 5.4, 2.8).into_iter().enumerate() {
            let clear = distance_m(&line, Vec2::new(x, y)) > 5.2;
            if y > 27.0 && x < 78.0 && clear && scatter(i, side + 11) > 0.12 {
                let askew_deg = 9.0 * shake(i, side + 13);
                shapes.push(car(
                    x + 0.4 * shake(i, side + 15),
                    y + 0.4 * shake(i, side + 17),
                    heading_deg + 90.0 + askew_deg,
                ));
            }
        }
    }
    // A bus, the station with its ropes, ski racks and a plough.
    shapes.extend(solid([
        turned(86.0, 71.6, 12.0, 2.5, 1.0),
        turned(85.0, 60.6, 9.0, 2.4, 3.0),
        turned(20.0, 14.0, 1.2, 0.9, 20.0),
    ]));
    shapes.extend(posts((79.0, 62.2), (92.0, 62.4), 11, 0.12));
    shapes.extend(solid([disc(56.5, 20.5, 0.6), disc(33.0, 6.2, 0.9), disc(26.0, 14.3, 1.0)]));
    Drawing {
        shapes,
        lot: "start = [18.5, 10.0, 0.0]\ngoal = [79.0, 66.5, 0.0]\nwall_height_m = 1.4\n",
        ..plain("ski-car-park", "A car park between heaps of snow below a ski lift.", (100.0, 78.0))
    }
}

/// A track for off-road practice between trunks, boulders and logs.
fn forest_off_road() -> Drawing {
    let points =
        [(2.0, 10.0), (30.0, 10.0), (42.0, 29.0), (23.0, 41.0), (34.0, 60.0), (58.0, 55.0), (60.0, 31.0), (96.0, 21.0)];
    let line = way(&points, 7.5);
    let mut shapes = vec![(area(1.0, 1.0, 97.0, 70.0), FREE)];
    for row in 0..48 {
        for col in 0..64 {
            let i = row * 37 + col * col * 11 + row * row * 7 + row * col;
            let x = 1.5 + 1.5 * col as f32 + 0.4 * shake(i, 1);
            let y = 1.5 + 1.45 * row as f32 + 0.4 * shake(i, 2) + 0.7 * (col % 2) as f32;
            let half_m = 2.9 + 0.7 * sin(0.21 * x) + 0.5 * cos(0.33 * y);
            let off_m = distance_m(&line, Vec2::new(x, y)) - half_m;
            if off_m > 0.0 && (off_m < 5.0 || scatter(i, 4) < 0.55) {
                shapes.push((disc(x, y, 0.22 + 0.3 * scatter(i, 3)), OCCUPIED));
            }
        }
    }
    // Boulders and logs at the edge of the track.
    for (side, left_m) in [-3.3_f32, 3.3].into_iter().enumerate() {
        for (i, (x, y, heading_deg)) in beside(&line, left_m, 5.5).into_iter().enumerate() {
            let at = polar(x, y, left_m.signum() * 0.7 * scatter(i, side), heading_deg + 90.0);
            let shape = match (i + side) % 3 {
                0 => disc(at.x, at.y, 0.6 + 0.5 * scatter(i, side + 2)),
                1 => turned(at.x, at.y, 3.6, 0.5, heading_deg + 14.0 * shake(i, side + 4)),
                _ => turned(at.x, at.y, 1.3, 0.9, heading_deg + 60.0 * shake(i, side + 6)),
            };
            shapes.push((shape, OCCUPIED));
        }
    }
    Drawing {
        shapes,
        lot: "start = [18.0, 10.0, 0.0]\ngoal = [77.0, 26.3, -15.5]\nwall_height_m = 2.0\n",
        ..plain(
            "forest-off-road",
            "An off-road practice track between trunks, boulders and logs in a forest.",
            (98.0, 71.0),
        )
    }
}

/// A hall with lifts and a second one for bodywork.
fn repair_shop() -> Drawing {
    let mut shapes = vec![
        // The yard in front, hall with its door, second hall and the yard behind.
        (area(1.0, 2.0, 22.0, 20.0), FREE),
        (area(23.0, 2.0, 76.0, 20.0), FREE),
        (area(21.0, 8.4, 24.0, 13.2), FREE),
        (area(48.0, 21.0, 76.0, 47.0), FREE),
        (area(65.2, 19.0, 71.4, 22.0), FREE),
        (area(44.0, 48.0, 76.0, 78.0), FREE),
        (area(55.0, 46.0, 60.4, 49.0), FREE),
    ];
    // Customers' cars and tyres in the yard.
    for i in 0..6 {
        shapes.push(car(3.6 + 2.9 * i as f32, 17.2 + 0.3 * shake(i, 1), 90.0 + 4.0 * shake(i, 2)));
    }
    shapes.extend(solid([disc(20.8, 4.2, 0.7), disc(20.9, 5.7, 0.7)]));
    shapes.extend([car(9.5, 4.0, 176.0), car(16.2, 3.8, 4.0)]);
    // Bays with two-post lifts; some hold a car, the others are closed by what stands in them.
    for i in 0..8 {
        for (k, y, nose_deg) in [(0, 4.9, 90.0), (1, 17.2, -90.0)] {
            let x = 26.6 + 4.4 * i as f32;
            if k == 1 && i == 7 {
                continue;
            }
            shapes.extend(solid([disc(x - 1.6, y, 0.3), disc(x + 1.6, y, 0.3)]));
            if scatter(i, k + 4) > 0.25 {
                shapes.push(car(x, y + 0.4 * shake(i, k + 6), nose_deg + 3.0 * shake(i, k + 8)));
            } else {
                shapes.extend(solid([turned(x, y, 1.0, 0.7, 20.0), disc(x + 0.3, y + 1.8, 0.4)]));
            }
            let bench = if k == 0 { 2.5 } else { 19.5 };
            shapes.push((turned(x + 2.2, bench, 1.6, 0.9, 0.0), OCCUPIED));
        }
        shapes.push((area(28.6 + 4.4 * i as f32, 7.4, 29.0 + 4.4 * i as f32, 7.8), OCCUPIED));
    }
    // Tool trolleys, an engine on a hoist and the parts counter.
    shapes.extend(solid([
        turned(34.2, 13.9, 1.1, 0.6, 15.0),
        turned(47.5, 7.7, 1.0, 0.7, -20.0),
        disc(56.0, 14.0, 0.5),
        area(73.5, 2.0, 76.0, 9.0),
        turned(74.6, 12.6, 1.4, 0.9, 70.0),
        area(61.4, 16.0, 64.0, 20.0),
        turned(64.6, 3.2, 2.4, 1.2, 0.0),
        disc(68.6, 3.4, 0.9),
        disc(70.6, 3.2, 0.8),
    ]));
    // Bodywork: the paint booth, cars under sheets, pillars.
    shapes.extend(solid([area(48.0, 21.0, 57.0, 31.5), area(62.6, 32.6, 63.2, 33.2), area(62.6, 24.0, 63.2, 24.6)]));
    shapes.extend([car(60.2, 24.2, 82.0), car(73.8, 31.0, 97.0), car(70.6, 42.5, 60.0), car(74.3, 41.0, 92.0)]);
    shapes.extend([car(50.2, 34.6, 4.0), car(50.0, 38.4, -3.0), car(50.6, 43.0, 8.0), car(65.8, 44.0, 95.0)]);
    shapes.extend(solid([turned(74.6, 24.0, 1.2, 2.4, 0.0), turned(62.6, 45.6, 2.0, 0.9, 0.0), disc(74.8, 36.0, 0.6)]));
    // The yard behind, with wrecks under repair, a container and a fence of posts.
    shapes.push((area(44.0, 52.0, 50.2, 54.6), OCCUPIED));
    shapes.extend([car(49.0, 60.0, 12.0), car(48.6, 64.5, -20.0), car(49.4, 70.5, 6.0)]);
    shapes.extend(posts((52.0, 57.0), (52.0, 77.5), 15, 0.15));
    shapes.extend(posts((63.6, 49.2), (63.6, 77.5), 20, 0.15));
    shapes.push((disc(69.0, 73.0, 1.6), OCCUPIED));
    shapes.extend([car(67.5, 55.0, 80.0), car(70.8, 56.0, 84.0), car(68.6, 65.0, 130.0)]);
    shapes.extend(posts((50.4, 53.6), (52.0, 57.0), 4, 0.15));
    Drawing {
        shapes,
        lot: "start = [18.0, 10.8, 0.0]\ngoal = [57.8, 60.0, 90.0]\nwall_height_m = 2.0\n",
        ..plain("repair-shop", "A car repair shop: bays with lifts, a hall for bodywork and the yards.", (77.0, 79.0))
    }
}

/// A course of cones on a wide plain, with cones to swerve round.
fn cone_course() -> Drawing {
    let points = [
        (2.0, 10.0),
        (44.0, 10.0),
        (56.0, 22.0),
        (74.0, 12.0),
        (98.0, 16.0),
        (100.0, 42.0),
        (80.0, 50.0),
        (64.0, 36.0),
        (46.0, 50.0),
        (2.0, 50.0),
    ];
    let line = way(&points, 8.0);
    let mut shapes = vec![(area(1.0, 1.0, 113.0, 59.0), FREE)];
    for side in [-1.0_f32, 1.0] {
        let mut last = Vec2::new(-9.0, 0.0);
        for (i, (x, y, heading_deg)) in beside(&line, 0.0, 0.2).into_iter().enumerate() {
            let half_m = 2.6 + 0.6 * sin(0.025 * i as f32 + side);
            let cone = polar(x, y, side * half_m, heading_deg + 90.0);
            if cone.distance(last) > 1.5 && distance_m(&line, cone) > half_m - 0.15 {
                shapes.push((disc(cone.x, cone.y, 0.17), OCCUPIED));
                last = cone;
            }
        }
    }
    // Cones to swerve round, and what stands beside the course.
    shapes.extend(discs([(29.0, 11.3), (37.0, 8.7), (38.0, 48.9), (30.0, 51.2)], 0.2));
    shapes.extend(solid([
        turned(52.0, 33.0, 6.4, 2.2, 20.0),
        area(20.0, 27.0, 28.0, 31.0),
        turned(34.0, 29.0, 3.0, 3.0, 12.0),
    ]));
    for i in 0..9 {
        shapes.push(car(66.0 + 2.9 * i as f32, 3.4 + 0.3 * shake(i, 1), 90.0 + 6.0 * shake(i, 2)));
    }
    shapes.extend(with_trailer(86.0, 31.0, 60.0, (4.8, 4.2), 1.9, 14.0));
    shapes.push((disc(108.0, 52.0, 2.0), OCCUPIED));
    shapes.extend([car(76.0, 26.0, 20.0), car(12.0, 35.0, -40.0), car(8.0, 24.0, 70.0)]);
    let tyres = [(104.6, 11.5), (105.8, 13.3), (106.6, 15.4), (60.6, 27.5), (58.4, 28.3), (75.5, 56.0), (73.2, 54.6)];
    shapes.extend(discs(tyres, 0.7));
    Drawing {
        shapes,
        lot: "start = [18.0, 10.0, 0.0]\ngoal = [18.0, 50.0, 180.0]\nwall_height_m = 0.4\n",
        ..plain("cone-course", "A course of cones on a wide plain, for practice against the clock.", (114.0, 60.0))
    }
}
