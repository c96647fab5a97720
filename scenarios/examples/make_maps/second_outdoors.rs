//! Ten maps of streets and land, drawn by somebody who did not know how any driver fares.

use crate::drawing::{
    Drawing, FREE, OCCUPIED, Shapes, UNKNOWN, area, band, car, disc, discs, distance_m, plain, scatter, shake, solid,
    stroke, turned,
};
use sim::geometry::Vec2;
use sim::maths::{angle_rad, sin_cos};

pub(super) fn drawings() -> Vec<Drawing> {
    vec![
        village_pond(),
        goods_station(),
        logging_road(),
        fun_fair(),
        gorge_road(),
        lighthouse_mole(),
        zoo(),
        ski_village(),
        hay_meadow(),
        railway_arches(),
    ]
}

/// Points along a line, `step_m` apart, with the line's direction there in degrees.
fn along(line: &[(f32, f32)], step_m: f32) -> Vec<(Vec2, f32)> {
    let mut points = Vec::new();
    let mut ahead_m = 0.0;
    for ends in line.windows(2) {
        let (from, to) = (Vec2::from(ends[0]), Vec2::from(ends[1]));
        let length_m = from.distance(to);
        let heading_deg = angle_rad(to - from).to_degrees();
        while ahead_m <= length_m {
            points.push((from + (to - from) * (ahead_m / length_m), heading_deg));
            ahead_m += step_m;
        }
        ahead_m -= length_m;
    }
    points
}

/// Single posts along a line.
fn posts(line: &[(f32, f32)], step_m: f32, radius_m: f32) -> Shapes {
    discs(along(line, step_m).into_iter().map(|(at, _)| at), radius_m)
}

/// Round lumps of different sizes along a line: rock, snow, bushes.
fn rough(line: &[(f32, f32)], step_m: f32, least_m: f32, most_m: f32, seed: usize) -> Shapes {
    solid(along(line, step_m).into_iter().enumerate().map(|(i, (at, _))| {
        let (x, y) = (at.x + scatter(i, seed) - 0.5, at.y + scatter(i, seed + 1) - 0.5);
        disc(x, y, least_m + (most_m - least_m) * scatter(i, seed + 2))
    }))
}

/// Boxes one behind the other along a line, each a little out of line.
fn row(line: &[(f32, f32)], size_m: (f32, f32), gap_m: f32, loose_deg: f32, seed: usize) -> Shapes {
    solid(along(line, size_m.0 + gap_m).into_iter().enumerate().map(|(i, (at, heading_deg))| {
        let width_m = size_m.1 * (0.85 + 0.3 * scatter(i, seed + 1));
        turned(at.x, at.y, size_m.0, width_m, heading_deg + loose_deg * shake(i, seed))
    }))
}

/// A pile of logs with ragged ends.
fn logs(x: f32, y: f32, heading_deg: f32, count: usize) -> Shapes {
    let (sin, cos) = sin_cos(heading_deg.to_radians());
    let log = |i: usize| {
        let (ahead_m, left_m) = (1.2 * scatter(i, 5) - 0.6, 0.42 * (i as f32 - 0.5 * count as f32));
        turned(x + ahead_m * cos - left_m * sin, y + ahead_m * sin + left_m * cos, 4.6, 0.45, heading_deg)
    };
    solid((0..count).map(log))
}

/// Tree trunks from `near_m` to `far_m` beside a road, too close together for a car.
fn trees(road: &[Vec2], near_m: f32, far_m: f32, size_m: (f32, f32)) -> Shapes {
    let mut trees = Vec::new();
    let step_m = 1.75;
    for col in 0..(size_m.0 / step_m) as usize {
        for up in 0..(size_m.1 / step_m) as usize {
            let (x, y) = (scatter(col * 17 + up, 3) - 0.5, scatter(up * 31 + col, 7) - 0.5);
            let at = Vec2::new((col as f32 + 0.5 + 0.4 * x) * step_m, (up as f32 + 0.5 + 0.4 * y) * step_m);
            let aside_m = distance_m(road, at);
            if aside_m > near_m && aside_m < far_m {
                trees.push((disc(at.x, at.y, 0.3 + 0.3 * scatter(col + 3 * up, 11)), OCCUPIED));
            }
        }
    }
    trees
}

/// A village street that goes round the duck pond.
fn village_pond() -> Drawing {
    let mut shapes = solid([
        // Gardens' hedges, outside and inside.
        stroke(
            [
                (0.0, 14.0),
                (0.0, 7.4),
                (13.0, 7.0),
                (27.0, 7.8),
                (40.0, 7.0),
                (55.0, 7.6),
                (64.0, 11.0),
                (69.0, 18.0),
                (71.0, 30.0),
                (69.0, 42.0),
                (64.0, 50.0),
                (55.0, 55.5),
                (40.0, 56.5),
                (22.0, 55.6),
                (0.0, 56.4),
                (0.0, 49.6),
            ],
            0.7,
        ),
        stroke([(0.0, 13.2), (12.0, 13.4), (23.0, 14.2), (34.0, 13.4)], 0.6),
        stroke([(0.0, 50.4), (14.0, 49.6), (25.0, 50.2), (33.0, 48.6)], 0.6),
    ]);
    // The pond behind its edge of stones.
    let pond = [(48.0, 31.0, 8.5), (52.0, 27.0, 7.0), (46.0, 35.0, 6.5), (54.0, 33.0, 6.4), (44.0, 28.0, 6.0)];
    shapes.extend(solid(pond.map(|(x, y, radius_m)| disc(x, y, radius_m))));
    shapes.extend(pond.map(|(x, y, radius_m)| (disc(x, y, radius_m - 0.4), UNKNOWN)));
    shapes.push((disc(47.0, 32.0, 0.9), OCCUPIED));
    // Posts keep cars off the green.
    shapes.extend(posts(&[(34.0, 14.2), (37.0, 18.0), (40.6, 23.4)], 1.5, 0.15));
    shapes.extend(posts(&[(42.0, 40.6), (38.0, 45.0), (33.6, 47.8)], 1.5, 0.15));
    // Houses outside, the church with its tower, houses inside.
    shapes.extend(solid([
        turned(9.0, 4.0, 9.0, 6.4, 3.0),
        turned(23.0, 4.4, 10.0, 6.4, -4.0),
        turned(36.0, 3.4, 8.0, 6.6, 5.0),
        turned(49.0, 4.6, 9.0, 6.4, 8.0),
        turned(69.4, 16.4, 10.0, 6.5, 64.0),
        turned(71.0, 34.0, 8.0, 7.0, 93.0),
        turned(67.2, 46.8, 9.0, 6.0, 122.0),
        turned(42.0, 59.0, 14.0, 6.8, -2.0),
        turned(51.6, 58.4, 4.6, 4.6, -2.0),
        turned(17.0, 59.4, 10.0, 6.6, 4.0),
        turned(8.0, 17.4, 8.0, 6.0, 2.0),
        turned(24.0, 18.6, 9.0, 7.0, -5.0),
        turned(20.0, 45.6, 10.0, 7.4, 5.0),
        turned(7.0, 46.8, 7.0, 5.8, -3.0),
        turned(26.0, 32.0, 8.0, 12.0, 10.0),
    ]));
    // Willows, the oak with its bench, benches, the pump, the bus shelter.
    shapes.extend(solid([
        disc(59.5, 23.4, 0.6),
        disc(61.2, 32.0, 0.7),
        disc(57.0, 40.2, 0.6),
        disc(36.0, 26.0, 0.7),
        disc(35.0, 38.0, 0.8),
        disc(64.6, 21.6, 0.9),
        turned(53.0, 18.6, 1.8, 0.6, -12.0),
        turned(60.4, 36.4, 1.8, 0.6, 80.0),
        turned(44.0, 43.4, 1.8, 0.6, 25.0),
        disc(47.0, 17.6, 0.5),
        turned(30.4, 54.4, 3.6, 1.4, -3.0),
        turned(66.8, 39.6, 0.9, 0.9, 10.0),
    ]));
    shapes.extend([car(16.0, 12.2, 178.0), car(32.4, 9.0, 3.0), car(67.8, 27.0, 96.0), car(57.4, 52.2, 155.0)]);
    shapes.push((turned(41.6, 8.6, 3.4, 1.7, 4.0), OCCUPIED));
    Drawing {
        background: FREE,
        shapes,
        lot: "start = [19.0, 9.8, 0.0]\ngoal = [17.0, 52.8, 180.0]\nwall_height_m = 2.0\n",
        ..plain("village-pond", "A village street that goes round the duck pond.", (78.0, 63.0))
    }
}

/// The loading road of a country goods station, over the level crossing and back behind the train.
fn goods_station() -> Drawing {
    let mut shapes = solid([
        stroke([(1.0, 1.0), (103.4, 1.0), (102.8, 16.0), (102.2, 30.0), (101.0, 41.0), (1.0, 41.0), (1.0, 1.0)], 0.4),
        // Goods shed with a loading platform, the station house, a hut at the crossing.
        area(24.0, 1.0, 66.0, 8.0),
        area(30.0, 8.0, 58.0, 10.2),
        area(4.0, 1.0, 17.0, 8.8),
        turned(99.4, 7.8, 4.0, 3.6, 4.0),
        area(72.0, 1.0, 74.4, 9.0),
        area(74.0, 1.0, 97.0, 5.8),
    ]);
    // The train: couplings too short to pass between; a low wagon with a boiler; the buffer stop.
    shapes.extend(row(&[(7.0, 18.6), (78.0, 18.6)], (10.4, 2.9), 1.1, 0.0, 2));
    shapes.extend(solid([turned(86.0, 18.6, 6.4, 2.7, 0.0), turned(90.4, 18.6, 0.8, 2.9, 0.0)]));
    // The siding behind: tank wagons, then coal pens.
    shapes.extend(row(&[(6.0, 31.2), (35.0, 31.2)], (8.2, 2.8), 1.2, 0.0, 9));
    shapes.push((area(42.6, 29.6, 44.0, 32.8), OCCUPIED));
    for i in 0..5 {
        let x = 48.0 + 6.6 * i as f32;
        shapes.push((area(x - 0.3, 30.4, x + 0.3, 37.0), OCCUPIED));
    }
    shapes.extend(solid([
        area(47.7, 36.6, 74.7, 37.2),
        disc(51.0, 34.6, 2.3),
        disc(58.2, 35.0, 2.2),
        disc(64.0, 33.6, 2.4),
        disc(70.6, 34.8, 2.4),
    ]));
    shapes.extend(row(&[(39.6, 33.0), (48.0, 33.6)], (2.6, 1.1), 1.0, 8.0, 14));
    shapes.extend(posts(&[(75.6, 36.0), (79.6, 33.8)], 1.5, 0.15));
    shapes.extend(posts(&[(85.4, 33.4), (90.8, 33.8)], 1.5, 0.15));
    shapes.extend(posts(&[(98.2, 34.0), (102.0, 33.0)], 1.5, 0.15));
    // Crane, water tower, sleepers, crates, a cable drum, lamps.
    shapes.extend(solid([
        disc(82.0, 33.6, 2.6),
        disc(94.0, 34.4, 3.4),
        turned(99.0, 27.6, 0.5, 0.5, 0.0),
        turned(88.6, 29.6, 4.6, 2.2, 14.0),
        turned(80.0, 10.4, 2.6, 2.4, 8.0),
        turned(78.4, 7.6, 2.4, 1.6, -14.0),
        turned(69.0, 9.6, 1.2, 1.2, 30.0),
        turned(21.0, 9.4, 1.6, 1.0, 12.0),
        disc(62.0, 9.8, 0.8),
        disc(46.0, 28.4, 0.2),
        disc(27.0, 28.6, 0.2),
        turned(100.6, 30.4, 2.4, 1.4, 70.0),
        turned(57.0, 29.6, 1.4, 1.1, 24.0),
    ]));
    // Lorries and vans at the platform; gates of the crossing, folded back.
    shapes.extend(solid([
        turned(46.0, 11.4, 7.6, 2.4, 2.0),
        turned(35.4, 11.5, 5.4, 2.1, -3.0),
        turned(83.6, 8.4, 5.4, 2.1, 42.0),
        turned(36.0, 28.0, 5.4, 2.2, 3.0),
        turned(71.0, 22.2, 3.0, 1.6, -4.0),
        turned(17.0, 22.0, 1.6, 1.2, 20.0),
        turned(101.6, 15.0, 0.3, 4.4, 4.0),
        turned(101.2, 22.4, 0.3, 4.4, 6.0),
    ]));
    shapes.push(car(94.0, 8.4, 20.0));
    Drawing {
        background: FREE,
        shapes,
        lot: "start = [19.0, 13.4, 0.0]\ngoal = [20.0, 25.6, 180.0]\nwall_height_m = 2.0\n",
        ..plain(
            "goods-station",
            "The loading road of a country goods station, over the level crossing and back behind the train.",
            (108.0, 42.0),
        )
    }
}

/// A logging road through a wood, past piles of logs and a forwarder.
fn logging_road() -> Drawing {
    let size_m = (118.0, 74.0);
    let road = [
        (3.0, 13.0),
        (28.0, 11.0),
        (44.0, 18.0),
        (48.0, 30.0),
        (40.0, 42.0),
        (44.0, 55.0),
        (58.0, 62.0),
        (74.0, 56.0),
        (84.0, 44.0),
        (115.0, 40.0),
    ];
    let mut shapes = vec![(band(&road, 9.0, 12.0), FREE)];
    // A clearing for timber, and a glade.
    shapes.extend([(disc(37.6, 44.0, 6.6), FREE), (disc(80.0, 54.0, 8.0), FREE)]);
    shapes.extend(trees(&road.map(Vec2::from), 2.6, 6.5, size_m));
    shapes.extend([(disc(38.0, 44.0, 4.4), FREE), (disc(79.4, 52.6, 5.4), FREE)]);
    shapes.extend(logs(36.0, 42.8, 74.0, 6));
    shapes.extend(logs(38.2, 48.4, 105.0, 3));
    shapes.extend(logs(24.0, 14.4, -3.0, 3));
    shapes.extend(logs(98.0, 39.0, -8.0, 3));
    // The forwarder with its crane, a trailer, stumps, a fallen fir, boulders, the barrier's posts.
    shapes.extend(solid([
        turned(82.4, 54.4, 8.0, 2.7, 130.0),
        turned(77.4, 57.6, 4.0, 0.5, 60.0),
        turned(49.9, 25.2, 3.4, 0.5, 28.0),
        disc(57.0, 59.2, 0.5),
        disc(43.6, 35.0, 0.45),
        disc(45.0, 51.0, 0.4),
        disc(74.0, 52.6, 0.5),
        disc(92.4, 45.0, 0.8),
        disc(93.6, 46.0, 0.6),
        turned(64.6, 62.6, 5.0, 0.6, -32.0),
        disc(34.0, 10.8, 0.2),
        disc(32.8, 15.6, 0.2),
    ]));
    Drawing {
        background: UNKNOWN,
        shapes,
        lot: "start = [18.0, 11.8, -4.6]\ngoal = [98.0, 42.2, -7.4]\nwall_height_m = 2.0\n",
        ..plain("logging-road", "A logging road through a wood, past piles of logs and a forwarder.", size_m)
    }
}

/// The lane of a fun fair between stalls, dodgems, carousels and a big wheel.
fn fun_fair() -> Drawing {
    let mut shapes = solid([stroke([(1.0, 1.0), (117.0, 1.0), (117.0, 59.0), (1.0, 59.0), (1.0, 1.0)], 0.3)]);
    // Stalls along the lane.
    shapes.extend(row(&[(3.6, 7.4), (30.0, 7.0)], (4.2, 2.6), 0.9, 5.0, 1));
    shapes.extend(row(&[(3.6, 17.2), (35.0, 17.6)], (3.4, 2.6), 0.8, 6.0, 4));
    shapes.extend(row(
        &[(55.2, 11.6), (57.0, 14.4), (62.0, 22.0), (65.4, 31.0), (67.4, 34.2)],
        (3.6, 2.4),
        1.0,
        7.0,
        6,
    ));
    shapes.extend(row(
        &[(41.2, 34.6), (46.8, 37.0), (50.8, 42.0), (54.0, 47.6), (55.0, 51.8)],
        (3.4, 2.4),
        0.9,
        6.0,
        8,
    ));
    shapes.extend(row(&[(57.0, 54.2), (115.0, 52.0)], (4.6, 2.6), 1.0, 4.0, 12));
    shapes.extend(row(&[(83.0, 40.8), (115.0, 40.4)], (3.0, 2.4), 0.9, 8.0, 15));
    // Dodgems with pillars round the floor, the carousel, the chair swing, the big wheel, the ghost train.
    shapes.push((area(31.0, 2.0, 50.0, 10.0), OCCUPIED));
    shapes.push((area(32.0, 3.0, 49.0, 9.0), UNKNOWN));
    for (x, y, radius_m) in [(45.0, 25.0, 6.6), (71.5, 37.0, 6.0), (101.0, 25.0, 9.0)] {
        shapes.extend([(disc(x, y, radius_m), OCCUPIED), (disc(x, y, radius_m - 0.3), UNKNOWN)]);
        shapes.push((disc(x, y, 1.6), OCCUPIED));
    }
    shapes.extend(solid([
        turned(52.2, 8.4, 3.0, 2.6, 50.0),
        turned(79.0, 41.2, 2.4, 2.4, 25.0),
        turned(37.2, 20.4, 2.2, 2.0, 20.0),
        turned(36.6, 26.0, 7.0, 2.6, 95.0),
        turned(36.8, 32.6, 4.0, 2.4, 80.0),
        turned(20.0, 32.0, 24.0, 12.0, 4.0),
    ]));
    // Caravans of the showmen behind.
    shapes.extend(row(&[(72.0, 8.0), (88.0, 14.0)], (6.4, 2.4), 2.0, 20.0, 3));
    shapes.extend(row(&[(8.0, 50.0), (34.0, 54.0)], (6.4, 2.4), 3.0, 25.0, 5));
    // Ticket booths, a lamp, bins, a high striker, a balloon cart, the generator.
    shapes.extend(solid([
        turned(52.6, 20.6, 1.4, 1.4, 30.0),
        turned(30.0, 14.6, 1.0, 1.0, 10.0),
        turned(19.4, 9.0, 1.2, 0.8, -8.0),
        disc(44.0, 16.2, 0.3),
        disc(58.8, 29.4, 0.4),
        disc(49.5, 35.6, 0.9),
        turned(48.9, 32.6, 5.4, 0.15, 80.0),
        turned(53.8, 41.0, 1.5, 1.5, 12.0),
        turned(57.4, 50.6, 1.8, 1.0, 30.0),
        turned(74.0, 50.8, 1.4, 1.2, -6.0),
        turned(88.6, 44.0, 1.3, 0.9, 14.0),
        disc(66.0, 47.0, 0.3),
    ]));
    Drawing {
        background: FREE,
        shapes,
        lot: "start = [18.0, 12.2, 0.0]\ngoal = [97.0, 46.8, -2.0]\nwall_height_m = 2.0\n",
        ..plain("fun-fair", "The lane of a fun fair between stalls, dodgems, carousels and a big wheel.", (118.0, 60.0))
    }
}

/// A mountain road in a gorge, over the river by an old bridge, with rocks that fell on it.
fn gorge_road() -> Drawing {
    let mut shapes = vec![
        (band(&[(0.0, 27.0), (30.0, 31.0), (56.0, 25.0), (84.0, 27.0), (124.0, 34.0)], 12.0, 9.0), UNKNOWN),
        (band(&[(2.0, 40.0), (24.0, 44.0), (42.0, 41.0), (53.0, 34.0)], 10.0, 6.6), FREE),
        (band(&[(43.0, 40.0), (54.0, 33.0), (60.0, 18.0), (70.0, 11.0)], 7.5, 4.6), FREE),
        (band(&[(60.0, 18.0), (70.0, 11.6), (90.0, 15.0), (104.0, 23.0), (122.0, 24.0)], 10.0, 6.6), FREE),
        // Bays to let others pass.
        (turned(33.0, 46.0, 12.0, 5.0, -10.0), FREE),
        (turned(80.0, 9.6, 12.0, 5.0, 8.0), FREE),
        (disc(52.0, 35.0, 4.4), FREE),
        (disc(61.6, 16.4, 4.6), FREE),
    ];
    // Rock faces.
    shapes.extend(rough(&[(2.0, 43.8), (22.0, 47.8), (27.0, 49.0)], 1.3, 0.5, 1.2, 21));
    shapes.extend(rough(&[(27.0, 49.4), (40.0, 47.2), (44.0, 44.2), (52.0, 39.4), (57.0, 36.0)], 1.4, 0.5, 1.1, 23));
    shapes.extend(rough(&[(56.6, 14.0), (63.0, 9.8), (71.0, 7.6), (74.0, 6.0), (87.0, 8.0)], 1.4, 0.5, 1.2, 25));
    shapes.extend(rough(&[(87.0, 9.6), (92.0, 11.6), (105.0, 19.0), (122.0, 20.0)], 1.3, 0.4, 1.1, 27));
    // Guard stones above the river.
    shapes.extend(posts(&[(2.0, 37.2), (23.0, 41.2), (41.0, 38.2), (48.0, 34.2)], 1.6, 0.25));
    shapes.extend(posts(&[(67.0, 16.6), (72.0, 14.6), (89.0, 17.6), (103.0, 25.6), (122.0, 26.6)], 1.6, 0.25));
    // Boulders, a chapel, a road worker's hut, a car in the bay, a crash barrier's end, snow poles.
    shapes.extend(solid([
        disc(17.4, 44.6, 0.9),
        disc(19.0, 45.4, 1.1),
        disc(16.0, 43.4, 0.35),
        disc(94.2, 14.4, 0.9),
        disc(95.8, 14.8, 1.1),
        disc(93.2, 14.6, 0.35),
        disc(42.4, 43.6, 0.8),
        turned(36.0, 46.9, 3.4, 3.6, -8.0),
        turned(85.4, 9.4, 3.6, 2.6, 10.0),
        disc(71.0, 9.6, 0.5),
        disc(88.0, 16.8, 0.6),
        disc(110.0, 26.4, 0.15),
    ]));
    shapes.extend([car(29.6, 46.3, -12.0), car(78.6, 9.8, 6.0)]);
    Drawing {
        shapes,
        lot: "start = [20.0, 42.2, 8.0]\ngoal = [104.0, 22.6, 12.0]\nwall_height_m = 2.0\n",
        ..plain(
            "gorge-road",
            "A mountain road in a gorge, over the river by an old bridge, with rocks that fell on it.",
            (124.0, 56.0),
        )
    }
}

/// From the fishermen's quay along a bent mole to the lighthouse.
fn lighthouse_mole() -> Drawing {
    let mole = [(52.0, 13.0), (72.0, 20.0), (84.0, 36.0), (78.0, 52.0), (60.0, 60.0), (22.0, 61.0)];
    let mut shapes = vec![
        (band(&mole, 11.0, 8.2), OCCUPIED),
        (band(&mole, 11.0, 6.6), FREE),
        // The quay, and the head of the mole.
        (area(1.0, 3.0, 56.0, 18.0), OCCUPIED),
        (area(2.0, 4.0, 55.0, 17.2), FREE),
        (disc(17.0, 61.0, 8.0), OCCUPIED),
        (disc(17.0, 61.0, 7.2), FREE),
        (band(&mole, 11.0, 6.6), FREE),
        (disc(13.4, 61.6, 2.4), OCCUPIED),
    ];
    // Concrete blocks on the side of the sea.
    let sea = [(57.0, 10.0), (74.4, 15.8), (86.0, 28.0), (88.0, 36.0), (81.6, 54.0), (61.6, 63.8), (26.0, 65.0)];
    for (i, (at, heading_deg)) in along(&sea, 2.3).into_iter().enumerate() {
        let (x, y) = (at.x + 0.8 * scatter(i, 2) - 0.4, at.y + 0.8 * scatter(i, 3) - 0.4);
        shapes.push((turned(x, y, 1.9, 1.5, heading_deg + 90.0 * scatter(i, 4)), OCCUPIED));
    }
    // Sheds on the quay, boats pulled up, bollards along the edge.
    shapes.extend(solid([
        area(1.0, 3.0, 13.0, 8.0),
        area(14.2, 3.0, 22.0, 7.2),
        area(27.0, 3.0, 41.0, 8.2),
        turned(47.6, 6.2, 5.6, 2.0, 24.0),
        turned(53.0, 6.6, 4.4, 1.7, 70.0),
        turned(24.6, 6.4, 5.0, 1.8, 94.0),
    ]));
    shapes.extend(posts(&[(4.0, 16.6), (54.0, 16.6)], 7.0, 0.25));
    shapes.extend(posts(&[(70.0, 22.9), (80.0, 36.4), (75.6, 49.6), (59.0, 57.4), (28.0, 58.4)], 8.0, 0.22));
    // Fish boxes, nets, lobster pots, a winch, a van, a forklift, a tub, benches, the crane.
    shapes.extend(solid([
        turned(19.0, 15.4, 3.2, 1.4, 4.0),
        turned(22.4, 15.0, 1.2, 1.2, 20.0),
        disc(31.4, 15.0, 1.3),
        disc(33.2, 15.6, 0.9),
        turned(38.0, 9.0, 2.4, 1.3, -6.0),
        turned(44.0, 15.2, 5.2, 2.0, 176.0),
        turned(13.0, 9.4, 2.2, 1.2, 30.0),
        disc(50.6, 15.8, 0.8),
        turned(66.4, 15.6, 2.4, 1.2, 20.0),
        turned(81.4, 26.6, 1.6, 1.2, 50.0),
        turned(85.6, 37.4, 1.7, 0.6, 92.0),
        turned(74.4, 51.0, 1.6, 1.3, 14.0),
        disc(66.0, 59.6, 0.8),
        turned(48.6, 63.2, 4.2, 1.5, 2.0),
        turned(41.0, 59.0, 2.0, 1.1, -6.0),
        turned(33.0, 63.2, 1.7, 0.6, 0.0),
        turned(18.4, 66.4, 1.7, 0.6, 10.0),
    ]));
    Drawing {
        background: UNKNOWN,
        shapes,
        lot: "start = [19.0, 11.6, 0.0]\ngoal = [34.0, 60.8, 180.0]\nwall_height_m = 0.4\n",
        ..plain("lighthouse-mole", "From the fishermen's quay along a bent mole to the lighthouse.", (94.0, 72.0))
    }
}

/// The winding footpath of a zoo between pens, an aviary and kiosks.
fn zoo() -> Drawing {
    let path = [
        (2.0, 58.0),
        (24.0, 60.0),
        (38.0, 52.0),
        (34.0, 38.0),
        (20.0, 28.0),
        (24.0, 12.0),
        (44.0, 9.0),
        (58.0, 20.0),
        (60.0, 40.0),
        (74.0, 52.0),
        (102.0, 50.0),
    ];
    let mut shapes = solid([stroke([(1.0, 1.0), (103.0, 1.0), (103.0, 67.0), (1.0, 67.0), (1.0, 1.0)], 0.5)]);
    // Walls between the pens; their ponds, rocks, huts and trees.
    shapes.extend(solid([
        stroke([(1.0, 40.0), (20.0, 42.0), (34.0, 38.0)], 0.4),
        stroke([(1.0, 20.0), (22.0, 24.0)], 0.4),
        stroke([(44.0, 9.0), (38.0, 26.0), (60.0, 34.0)], 0.4),
        stroke([(38.0, 26.0), (30.0, 36.0)], 0.4),
        stroke([(60.0, 30.0), (80.0, 26.0), (103.0, 30.0)], 0.4),
        stroke([(40.0, 50.0), (52.0, 67.0)], 0.4),
        stroke([(80.0, 26.0), (76.0, 1.0)], 0.4),
        stroke([(66.0, 46.0), (60.0, 67.0)], 0.4),
        turned(9.0, 48.0, 6.0, 4.0, 12.0),
        turned(50.0, 44.0, 9.0, 5.0, 30.0),
        turned(88.0, 38.0, 12.0, 6.0, 2.0),
        turned(68.0, 12.0, 8.0, 5.0, 80.0),
        turned(8.0, 8.0, 7.0, 6.0, 0.0),
    ]));
    shapes.extend([
        (disc(10.0, 32.0, 4.0), UNKNOWN),
        (disc(48.0, 22.0, 3.4), UNKNOWN),
        (disc(88.0, 14.0, 5.0), UNKNOWN),
    ]);
    shapes.extend(rough(&[(68.0, 22.0), (74.0, 18.0), (72.0, 30.0)], 2.6, 0.5, 1.2, 31));
    shapes.extend(rough(&[(40.0, 30.0), (46.0, 33.0), (32.0, 20.0)], 3.4, 0.4, 1.0, 33));
    // The path between its fences; squares before the aviary and the cafe.
    let square = [(37.0, 48.0, 6.2), (24.0, 17.0, 6.4), (62.0, 42.0, 6.0)];
    shapes.push((band(&path, 8.0, 6.6), OCCUPIED));
    shapes.extend(square.map(|(x, y, radius_m)| (disc(x, y, radius_m), OCCUPIED)));
    // Bars in the fences, to look into the pens.
    for bars in [&[(30.0, 35.2), (23.0, 30.2)], &[(58.4, 22.0), (59.8, 38.0)], &[(30.0, 11.2), (42.0, 9.3)]] {
        let gap = |(at, heading_deg): (Vec2, f32)| (turned(at.x, at.y, 1.1, 7.2, heading_deg), FREE);
        shapes.extend(along(bars, 2.2).into_iter().map(gap));
    }
    shapes.push((band(&path, 8.0, 5.8), FREE));
    shapes.extend(square.map(|(x, y, radius_m)| (disc(x, y, radius_m - 0.4), FREE)));
    // Aviary, ice-cream kiosk, cafe tables, benches, signs, bins, prams, a keeper's cart.
    shapes.extend(solid([
        disc(41.2, 50.0, 2.6),
        turned(19.6, 15.6, 3.0, 2.6, 70.0),
        disc(27.4, 20.2, 0.5),
        disc(28.4, 17.4, 0.5),
        turned(66.0, 39.6, 3.2, 2.8, 40.0),
        disc(62.6, 37.4, 0.6),
        turned(20.0, 57.6, 1.7, 0.6, 5.0),
        turned(12.4, 60.8, 1.7, 0.6, 4.0),
        disc(29.0, 59.6, 0.35),
        turned(30.0, 35.8, 1.8, 0.6, 38.0),
        turned(23.2, 33.2, 1.0, 0.7, 30.0),
        turned(34.0, 8.4, 1.8, 0.6, -10.0),
        turned(41.0, 12.0, 2.4, 1.3, -8.0),
        disc(53.0, 13.4, 0.3),
        turned(60.8, 27.0, 1.8, 0.6, 88.0),
        turned(56.8, 33.0, 1.1, 0.7, 80.0),
        turned(72.4, 48.0, 1.2, 0.8, 40.0),
        turned(84.0, 53.4, 1.8, 0.6, -3.0),
        turned(90.0, 48.8, 1.0, 0.8, 10.0),
    ]));
    Drawing {
        background: FREE,
        shapes,
        lot: "start = [17.0, 59.2, 5.0]\ngoal = [85.0, 51.0, -4.0]\nwall_height_m = 0.5\n",
        ..plain("zoo", "The winding footpath of a zoo between pens, an aviary and kiosks.", (104.0, 68.0))
    }
}

/// The street of a ski village between heaps of snow, past the valley station of the lift.
fn ski_village() -> Drawing {
    let street = [(2.0, 13.0), (30.0, 15.0), (48.0, 11.0), (66.0, 20.0), (74.0, 36.0), (92.0, 42.0), (122.0, 40.0)];
    let mut shapes = vec![(band(&street, 9.0, 8.4), FREE)];
    // The square at the lift.
    shapes.extend([(turned(68.0, 24.0, 18.0, 15.0, 55.0), FREE), (turned(38.0, 17.0, 10.0, 6.0, -12.0), FREE)]);
    // Snow pushed to the sides.
    shapes.extend(rough(&[(2.0, 17.6), (29.0, 19.4), (34.0, 21.0)], 1.5, 0.6, 1.4, 41));
    shapes.extend(rough(&[(44.0, 18.4), (48.0, 15.8), (58.0, 20.6)], 1.5, 0.6, 1.3, 43));
    shapes.extend(rough(&[(2.0, 8.4), (30.0, 10.4), (47.0, 6.4), (64.0, 14.4)], 1.5, 0.5, 1.5, 45));
    shapes.extend(rough(&[(78.0, 24.0), (80.0, 33.0), (93.0, 37.4), (122.0, 35.4)], 1.5, 0.6, 1.4, 47));
    shapes.extend(rough(&[(66.0, 33.0), (72.0, 40.4), (91.0, 46.8), (122.0, 44.8)], 1.5, 0.5, 1.5, 49));
    // Chalets.
    shapes.extend(solid([
        turned(9.0, 3.8, 11.0, 7.0, 3.0),
        turned(24.0, 4.6, 9.0, 8.0, 6.0),
        turned(39.0, 3.4, 12.0, 6.6, -9.0),
        turned(10.0, 23.0, 12.0, 8.0, 2.0),
        turned(27.0, 25.0, 10.0, 8.0, -3.0),
        turned(46.0, 22.6, 9.0, 8.0, 14.0),
        turned(89.0, 29.6, 11.0, 9.0, 16.0),
        turned(106.0, 30.4, 12.0, 8.0, -5.0),
        turned(84.0, 52.0, 13.0, 8.0, 14.0),
        turned(104.0, 52.6, 12.0, 9.0, -4.0),
        turned(70.0, 46.4, 9.0, 8.0, 30.0),
    ]));
    // The lift with its queue's railings, ski racks, the ticket hut, the plough, the ski bus, sledges, lamps.
    shapes.extend(solid([
        turned(61.4, 28.4, 8.0, 5.0, 55.0),
        turned(66.6, 30.0, 3.6, 0.15, 55.0),
        turned(65.2, 31.2, 3.6, 0.15, 55.0),
        turned(59.4, 22.4, 3.0, 0.8, 55.0),
        turned(73.0, 17.2, 2.4, 2.2, 55.0),
        turned(75.6, 24.0, 6.6, 2.4, 58.0),
        turned(36.6, 18.2, 8.0, 2.4, -11.0),
        turned(15.0, 17.2, 1.2, 0.6, 30.0),
        turned(16.4, 16.9, 1.2, 0.6, -20.0),
        disc(70.8, 25.6, 0.9),
        disc(20.0, 10.8, 0.2),
        disc(52.0, 16.4, 0.2),
        disc(84.0, 43.0, 0.2),
        disc(100.0, 37.8, 0.2),
        turned(94.6, 45.2, 2.6, 0.7, -4.0),
        turned(77.0, 41.0, 1.6, 1.2, 20.0),
    ]));
    shapes.extend([car(26.4, 11.4, 6.0), car(47.0, 8.4, 4.0), car(108.0, 37.6, -6.0)]);
    Drawing {
        background: UNKNOWN,
        shapes,
        lot: "start = [18.0, 14.0, 4.0]\ngoal = [105.0, 41.2, -4.0]\nwall_height_m = 2.0\n",
        ..plain(
            "ski-village",
            "The street of a ski village between heaps of snow, past the valley station of the lift.",
            (124.0, 58.0),
        )
    }
}

/// A mown meadow between a hedge and the standing maize, with bales, a baler and a trailer.
fn hay_meadow() -> Drawing {
    let mut shapes = vec![
        (area(1.0, 1.0, 29.0, 9.4), FREE),
        (band(&[(22.0, 6.0), (50.0, 8.0), (82.0, 9.0), (84.0, 34.0), (82.0, 56.0)], 9.0, 11.0), FREE),
        (band(&[(84.0, 30.0), (82.0, 54.0), (56.0, 56.0), (48.0, 44.0)], 9.0, 11.0), FREE),
        (band(&[(52.0, 50.0), (44.0, 36.0), (20.0, 34.0), (2.0, 37.0)], 9.0, 9.0), FREE),
    ];
    // The hedge outside, bushes and oaks.
    shapes.extend(rough(
        &[(22.0, 0.8), (50.0, 2.6), (82.0, 3.0), (88.6, 9.0), (89.8, 34.0), (88.4, 56.0)],
        1.6,
        0.5,
        1.3,
        51,
    ));
    shapes.extend(rough(&[(88.4, 56.0), (86.6, 60.4), (82.0, 61.8), (56.0, 62.0), (48.6, 55.4)], 1.6, 0.5, 1.2, 53));
    // The ragged edge of the maize.
    shapes.extend(rough(&[(30.0, 11.8), (50.0, 13.6), (77.0, 15.0), (78.2, 34.0), (76.4, 49.0)], 0.9, 0.2, 0.7, 55));
    shapes.extend(rough(&[(76.0, 49.6), (58.0, 50.4), (47.6, 31.6), (20.0, 29.6), (2.0, 32.4)], 0.9, 0.2, 0.7, 57));
    // Gate posts and the fence of the lane.
    shapes.extend(posts(&[(3.0, 8.6), (27.0, 8.8)], 1.6, 0.15));
    shapes.extend(posts(&[(3.0, 1.8), (21.0, 1.8)], 1.6, 0.15));
    // Round bales, some in a stack.
    let bales = [
        (36.0, 10.0),
        (46.4, 4.8),
        (57.6, 11.6),
        (68.0, 6.0),
        (84.8, 20.0),
        (81.0, 27.0),
        (86.6, 33.6),
        (80.4, 41.4),
        (66.0, 58.0),
        (57.0, 54.6),
        (52.6, 46.0),
        (36.0, 37.6),
        (26.0, 31.8),
        (10.0, 38.8),
    ];
    shapes.extend(discs(bales, 0.8));
    shapes.extend(row(&[(72.4, 12.6), (77.0, 12.8)], (1.5, 1.3), 0.1, 6.0, 4));
    shapes.extend(row(&[(86.4, 12.0), (86.8, 16.0)], (1.5, 1.3), 0.1, 6.0, 6));
    // Tractor and baler, trailer, a rake, a water tank, a lone oak.
    shapes.extend(solid([
        turned(75.0, 57.4, 4.2, 2.2, 172.0),
        turned(70.8, 58.0, 3.4, 2.4, 174.0),
        turned(86.0, 44.6, 7.0, 2.4, 96.0),
        turned(47.0, 38.8, 2.6, 1.8, 40.0),
        turned(31.0, 3.6, 2.8, 1.6, 8.0),
        disc(82.0, 50.0, 0.7),
    ]));
    Drawing {
        shapes,
        lot: "start = [18.0, 5.4, 0.0]\ngoal = [19.0, 34.8, 176.0]\nwall_height_m = 2.0\n",
        ..plain(
            "hay-meadow",
            "A mown meadow between a hedge and the standing maize, with bales, a baler and a trailer.",
            (92.0, 64.0),
        )
    }
}

/// A back street along a railway viaduct, through one arch and on behind it.
fn railway_arches() -> Drawing {
    let mut shapes = solid([stroke([(1.0, 1.0), (119.0, 1.0), (119.0, 59.0), (1.0, 59.0), (1.0, 1.0)], 0.6)]);
    // The piers, a little askew; workshops in the arches, some set back; one arch for the road.
    for i in 0..16 {
        let (x, y) = (5.0 + 7.6 * i as f32, 26.0 + 0.5 * i as f32);
        shapes.push((turned(x, y, 2.4, 9.0, 4.0), OCCUPIED));
        let aside_m = [0.0, 1.6, -1.0, 2.6][i % 4];
        if i != 7 {
            shapes.push((turned(x + 3.8, y + aside_m, 6.0, 0.4, 4.0), OCCUPIED));
        }
    }
    // Houses over the street, yards behind.
    shapes.extend(solid([
        area(1.0, 1.0, 15.0, 11.6),
        area(15.6, 1.0, 28.0, 12.4),
        area(28.8, 1.0, 41.0, 11.4),
        area(42.0, 1.0, 54.0, 12.0),
        turned(64.0, 8.0, 16.0, 10.0, 28.0),
        turned(60.0, 48.0, 14.0, 9.0, -20.0),
        area(68.6, 46.6, 82.0, 56.0),
        turned(90.0, 51.4, 14.0, 9.0, 3.0),
        turned(107.0, 52.4, 16.0, 9.0, 4.0),
        turned(46.0, 43.0, 10.0, 7.0, 12.0),
        turned(80.0, 21.0, 7.0, 2.6, 70.0),
    ]));
    // The street's end is fenced off; scrap and vans close the yard on the other side.
    shapes.extend(solid([
        stroke([(70.4, 12.0), (70.0, 20.0), (72.4, 27.0)], 0.3),
        stroke([(52.6, 33.0), (51.6, 38.0), (51.0, 43.0)], 0.3),
    ]));
    // Skips, bins, tyres, a hoist, pallets, lamps.
    shapes.extend(solid([
        turned(67.0, 19.6, 3.6, 1.8, 82.0),
        turned(33.0, 21.0, 1.4, 1.1, 10.0),
        turned(35.0, 21.2, 1.3, 1.1, -6.0),
        disc(46.0, 22.4, 0.7),
        disc(47.6, 22.8, 0.6),
        turned(55.0, 35.2, 2.4, 1.4, 30.0),
        turned(27.0, 13.0, 1.2, 0.8, 0.0),
        turned(71.0, 44.6, 1.2, 1.2, 20.0),
        disc(73.4, 45.6, 0.2),
        turned(81.0, 38.6, 2.2, 1.2, 6.0),
        turned(98.0, 46.4, 1.3, 1.0, 12.0),
        disc(40.0, 12.0, 0.2),
    ]));
    shapes.extend([car(20.0, 20.2, 4.0), car(51.0, 13.6, 2.0), car(76.0, 45.0, 182.0), car(91.0, 38.6, 6.0)]);
    shapes.extend(solid([turned(10.0, 13.2, 5.4, 2.1, 1.0), turned(104.6, 46.0, 5.4, 2.1, 184.0)]));
    Drawing {
        background: FREE,
        shapes,
        lot: "start = [18.0, 16.2, 0.0]\ngoal = [100.0, 42.4, 4.0]\nwall_height_m = 2.0\n",
        ..plain(
            "railway-arches",
            "A back street along a railway viaduct, through one arch and on behind it.",
            (120.0, 60.0),
        )
    }
}
