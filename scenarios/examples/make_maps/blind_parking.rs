//! Ten maps of places where people park, load and practise, drawn by somebody who did not know how any driver fares.

use crate::drawing::{Drawing, FREE, OCCUPIED, Shape, UNKNOWN, area, band, car, disc, plain, scatter, turned};
use sim::geometry::{Pose, Vec2};
use sim::path::Path;
use sim::scenario::ReferencePath;

pub(super) fn drawings() -> Vec<Drawing> {
    vec![
        supermarket(),
        truck_stop(),
        bus_station(),
        stadium(),
        motorhome_park(),
        car_wash(),
        spiral_ramp(),
        driving_school(),
        kiss_and_ride(),
        boat_yard(),
    ]
}

/// A point so far ahead and to the left of a place: x, y and heading.
fn seen_from(place: (f32, f32, f32), ahead_m: f32, left_m: f32) -> (f32, f32) {
    let pose = Pose::new(Vec2::new(place.0, place.1), place.2.to_radians());
    pose.world_from_ego().point(Vec2::new(ahead_m, left_m)).into()
}

/// Points about a centre, the radius changing evenly from one angle to the other.
fn spiral(centre: (f32, f32), radii_m: (f32, f32), angles_deg: (f32, f32)) -> Vec<(f32, f32)> {
    let steps = ((angles_deg.1 - angles_deg.0) / 5.0) as usize;
    let between = |ends: (f32, f32), i: usize| ends.0 + (ends.1 - ends.0) * i as f32 / steps as f32;
    (0..=steps).map(|i| seen_from((centre.0, centre.1, between(angles_deg, i)), between(radii_m, i), 0.0)).collect()
}

/// Places to the left of a line with rounded corners, as far apart as asked: x, y and the heading of the line.
fn beside(points: &[(f32, f32)], radius_m: f32, left_m: f32, every_m: f32) -> Vec<(f32, f32, f32)> {
    let points = points.iter().map(|&point| Vec2::from(point)).collect();
    let mut places: Vec<(f32, f32, f32)> = Vec::new();
    for pose in Path::new(&ReferencePath { points, corner_radius_m: radius_m }).poses() {
        let at = pose.position() + left_m * pose.ahead().perp();
        if places.last().is_none_or(|&(x, y, _)| at.distance(Vec2::new(x, y)) >= every_m) {
            places.push((at.x, at.y, pose.heading_rad.to_degrees()));
        }
    }
    places
}

/// Cars nosed in side by side along x, but for the empty bays, none of them quite straight.
fn row(from: (f32, f32), every_m: f32, heading_deg: f32, bays: usize, empty: &[usize]) -> Vec<(Shape, u8)> {
    let parked = (0..bays).filter(|i| !empty.contains(i));
    parked.map(|i| car(from.0 + every_m * i as f32, from.1, heading_deg + 4.0 * scatter(i, bays) - 2.0)).collect()
}

/// Cones or bollards from one place to another.
fn posts(from: (f32, f32), to: (f32, f32), every_m: f32) -> Vec<(Shape, u8)> {
    beside(&[from, to], 0.0, 0.0, every_m).into_iter().map(|(x, y, _)| (disc(x, y, 0.2), OCCUPIED)).collect()
}

/// Bays at 60° on both sides, a trolley bay, trolleys left in the way, and back along the front of the shop.
fn supermarket() -> Drawing {
    let mut shapes = vec![
        (area(1.0, 1.0, 103.0, 35.0), FREE),
        // The shop, hedges, and the islands at the ends of the rows.
        (area(0.0, 30.2, 104.0, 36.0), OCCUPIED),
        (area(0.0, 0.0, 20.0, 6.7), OCCUPIED),
        (area(81.0, 0.0, 104.0, 6.7), OCCUPIED),
        (area(0.0, 12.8, 20.0, 22.4), OCCUPIED),
        (area(91.8, 12.6, 104.0, 36.0), OCCUPIED),
        (area(20.0, 17.3, 82.0, 17.7), OCCUPIED),
        (area(81.6, 13.6, 83.6, 21.6), OCCUPIED),
        (disc(82.6, 13.6, 1.0), OCCUPIED),
        (disc(82.6, 21.6, 1.0), OCCUPIED),
        // The way to the yard is barred.
        (area(97.0, 6.0, 97.3, 13.0), OCCUPIED),
        // A van unloads at the shop, a car is parked across two bays.
        (turned(50.0, 27.0, 5.6, 2.1, 2.0), OCCUPIED),
        car(62.0, 5.2, -10.0),
    ];
    shapes.extend(row((22.0, 4.2), 3.0, -60.0, 13, &[3, 8, 9]));
    shapes.extend(row((67.0, 4.2), 3.0, -60.0, 5, &[2]));
    shapes.extend(row((22.0, 15.0), 3.0, 60.0, 10, &[4]));
    shapes.extend(row((58.0, 15.0), 3.0, 60.0, 8, &[5]));
    shapes.extend(row((22.0, 20.1), 3.0, 240.0, 20, &[2, 7, 12, 13]));
    shapes.extend(posts((2.0, 28.9), (91.0, 28.9), 1.5));
    // The trolley bay: two rails, trolleys pushed into each other.
    for (x, width_m) in [(51.2, 0.2), (52.6, 0.7), (54.0, 0.7), (55.4, 0.2)] {
        shapes.push((turned(x, 15.0, 4.4, width_m, 90.0), OCCUPIED));
    }
    for (x, y, heading) in [(38.0, 8.0, 20.0), (70.0, 10.3, 70.0), (70.6, 11.6, -30.0), (86.6, 26.0, 40.0)] {
        shapes.push((turned(x, y, 1.0, 0.6, heading), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [20.0, 9.6, 0.0]\ngoal = [20.0, 25.6, 180.0]\nwall_height_m = 0.15\n",
        ..plain("supermarket", "Down one aisle of a supermarket's car park and back past the shop.", (104.0, 36.0))
    }
}

/// Two rows of lorries at 45°, round the end of each.
fn truck_stop() -> Drawing {
    let mut shapes = vec![
        (area(1.0, 3.0, 97.0, 58.5), FREE),
        // The restaurant, the shop, and hedges.
        (area(0.0, 11.4, 17.0, 25.0), OCCUPIED),
        (area(14.0, 35.0, 27.4, 45.0), OCCUPIED),
        (area(86.0, 0.0, 98.0, 46.6), OCCUPIED),
        (area(81.0, 33.2, 98.0, 46.6), OCCUPIED),
        (area(0.0, 25.0, 3.0, 60.0), OCCUPIED),
        (disc(20.4, 22.4, 2.2), OCCUPIED),
        (disc(69.4, 15.0, 3.4), OCCUPIED),
        // Trailers, vans and a tractor unit that stand in the aisles.
        (turned(45.0, 4.6, 6.0, 2.2, 0.0), OCCUPIED),
        (turned(84.4, 20.0, 13.6, 2.5, 90.0), OCCUPIED),
        (turned(52.0, 31.4, 6.4, 2.5, 3.0), OCCUPIED),
        (turned(58.0, 48.4, 6.0, 2.2, 0.0), OCCUPIED),
        // A heap of tyres, bins, lamps.
        (disc(61.0, 10.2, 1.1), OCCUPIED),
        (turned(4.2, 36.0, 3.0, 1.6, 90.0), OCCUPIED),
        (disc(76.5, 28.0, 0.3), OCCUPIED),
        (disc(13.0, 28.5, 0.3), OCCUPIED),
    ];
    for i in 0..9 {
        let length_m = [16.5, 16.5, 12.0, 13.6, 16.5, 10.0, 16.5, 15.0, 16.5][i];
        let along = 5.1 * i as f32;
        shapes.push((turned(24.0 + along, 18.2, length_m, 2.55, 45.0), OCCUPIED));
        shapes.push((turned(74.8 - along, 39.8, length_m, 2.55, 135.0), OCCUPIED));
    }
    for x in [28.0, 46.5, 78.0] {
        shapes.push((turned(x, 57.0, 16.0, 2.55, 0.0), OCCUPIED));
    }
    // Cones about a puddle of oil.
    for (x, y) in [(32.0, 26.0), (33.2, 26.2), (33.0, 27.2), (31.9, 27.1)] {
        shapes.push((disc(x, y, 0.2), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [20.0, 7.2, 0.0]\ngoal = [78.0, 51.5, 0.0]\n",
        ..plain("truck-stop", "Aisles of 8 m between lorries parked at 45°, with things left in them.", (98.0, 60.0))
    }
}

/// Platforms at 60°, a bus at each but one.
fn bus_station() -> Drawing {
    let mut shapes = vec![
        (turned(53.5, 23.0, 80.0, 57.2, 60.0), FREE),
        (area(0.0, 0.0, 140.0, 3.0), OCCUPIED),
        (area(0.0, 43.0, 140.0, 48.0), OCCUPIED),
        (area(1.0, 3.0, 62.0, 10.5), FREE),
        (area(78.0, 36.0, 139.0, 43.0), FREE),
        (turned(70.6, 6.6, 7.2, 2.5, 86.0), OCCUPIED),
        (band(&[(73.4, 34.0), (70.6, 43.4)], 0.0, 0.3), OCCUPIED),
        // A bin, a person, and a bus that waits.
        (turned(70.4, 25.4, 0.6, 0.6, 60.0), OCCUPIED),
        (disc(44.0, 9.0, 0.3), OCCUPIED),
        (turned(104.0, 41.4, 12.0, 2.55, 0.0), OCCUPIED),
        (turned(30.0, 4.4, 8.0, 2.4, 0.0), OCCUPIED),
    ];
    for i in 0..8 {
        let x = 22.0 + 9.0 * i as f32;
        shapes.push((turned(x, 23.0, 26.5, 2.6, 60.0), OCCUPIED));
        if i != 5 && i != 7 {
            let along = [-5.0, -3.4, -1.8, 2.5, 0.6, 0.0, -4.6][i];
            shapes.push((turned(x + 4.5 + 0.5 * along, 23.0 + 0.866 * along, 12.0, 2.55, 60.0), OCCUPIED));
        }
    }
    Drawing {
        shapes,
        lot: "start = [20.0, 7.2, 0.0]\ngoal = [120.0, 38.6, 0.0]\nwall_height_m = 0.3\n",
        ..plain("bus-station", "Past platforms at which buses stand, and along the one that is free.", (140.0, 48.0))
    }
}

/// Most of the way round a stadium, cars nosed out along the other side, barriers of the stewards in between.
fn stadium() -> Drawing {
    let line = |radius_m: f32| {
        let mut points = spiral((48.0, 46.0), (radius_m, radius_m), (-90.0, 135.0));
        let (x, y) = points[points.len() - 1];
        points.insert(0, (1.0, 46.0 - radius_m));
        points.push((x - 18.5, y - 18.5));
        points
    };
    let (lane, bays) = (line(31.0), line(36.6));
    let mut shapes =
        vec![(band(&lane, 5.0, 6.0), FREE), (band(&bays, 5.0, 5.2), FREE), (area(32.0, 35.0, 64.0, 57.0), FREE)];
    for (i, (x, y, heading)) in beside(&bays, 5.0, 0.0, 2.7).into_iter().enumerate() {
        if scatter(i, 5) < 0.84 {
            shapes.push(car(x, y, heading - 90.0 + 4.0 * scatter(i, 6) - 2.0));
        }
    }
    // The way to the coaches is barred behind its mouth.
    shapes.push((turned(78.4, 15.6, 19.0, 5.0, -45.0), FREE));
    shapes.push((turned(80.0, 14.0, 0.3, 6.0, -45.0), OCCUPIED));
    let places = beside(&lane, 5.0, 0.0, 1.0);
    for (at_m, left_m, length_m) in
        [(40, 1.8, 2.6), (66, -2.1, 2.6), (94, 1.6, 3.0), (104, -2.0, 2.6), (134, 1.9, 2.4), (153, -2.0, 2.4)]
    {
        let (x, y) = seen_from(places[at_m], 0.0, left_m);
        shapes.push((turned(x, y, 0.4, length_m, places[at_m].2), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [19.0, 15.0, 0.0]\ngoal = [26.1, 67.9, 225.0]\nwall_height_m = 1.1\n",
        ..plain("stadium", "The road of 6 m round a stadium, parked up, with crowd barriers in it.", (90.0, 88.0))
    }
}

/// Pitches between hedges on both sides of a lane of gravel.
fn motorhome_park() -> Drawing {
    let line = [(1.0, 13.0), (40.0, 13.0), (40.0, 42.0), (78.0, 42.0), (78.0, 16.0), (131.0, 16.0)];
    let mut shapes = vec![(band(&line, 9.0, 4.6), FREE)];
    let pitches = [
        (16.0, 19.3, 90.0),
        (23.0, 19.3, 90.0),
        (18.0, 6.7, -90.0),
        (25.0, 6.7, -90.0),
        (33.7, 28.4, 180.0),
        (33.7, 35.4, 180.0),
        (46.3, 21.0, 0.0),
        (46.3, 28.0, 0.0),
        (50.0, 48.3, 90.0),
        (57.0, 48.3, 90.0),
        (64.0, 48.3, 90.0),
        (57.5, 35.7, -90.0),
        (64.5, 35.7, -90.0),
        (71.7, 27.0, 180.0),
        (84.3, 27.0, 0.0),
        (84.3, 34.0, 0.0),
        (95.0, 22.3, 90.0),
        (102.0, 22.3, 90.0),
        (109.0, 22.3, 90.0),
        (88.0, 9.7, -90.0),
        (95.0, 9.7, -90.0),
        (104.0, 9.7, -90.0),
    ];
    for (i, pitch) in pitches.into_iter().enumerate() {
        let heading = pitch.2;
        shapes.push((turned(pitch.0, pitch.1, 8.4, 6.2, heading), FREE));
        if i % 7 == 5 {
            // Nobody there: a chain across.
            let (x, y) = seen_from(pitch, -3.0, 0.0);
            shapes.push((turned(x, y, 0.3, 6.4, heading), OCCUPIED));
            continue;
        }
        let left_m = if i % 3 == 0 { 1.5 } else { -1.5 };
        let (x, y) = seen_from(pitch, 0.2 - 1.7 * scatter(i, 11), left_m);
        shapes.push((turned(x, y, 7.0, 2.3, heading), OCCUPIED));
        let (x, y) = seen_from(pitch, 2.0 * scatter(i, 12), -left_m);
        shapes.push((turned(x, y, 1.8, 0.9, heading + 60.0 * scatter(i, 13)), OCCUPIED));
    }
    // Bins and a tap.
    for (x, y) in [(33.0, 11.2), (70.0, 43.9), (118.0, 14.2)] {
        shapes.push((turned(x, y, 1.4, 0.9, 0.0), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [19.0, 13.0, 0.0]\ngoal = [112.0, 16.0, 0.0]\n",
        ..plain("motorhome-park", "A lane of 4.6 m between pitches with motorhomes and hedges.", (132.0, 54.0))
    }
}

/// Through the open one of two tunnels, past islands with vacuum cleaners.
fn car_wash() -> Drawing {
    let mut shapes = vec![
        (area(1.0, 6.0, 46.0, 12.0), FREE),
        (area(42.0, 6.0, 64.0, 25.0), FREE),
        // The tunnels with their mouths, the second shut and its lane barred.
        (area(52.0, 24.0, 55.2, 45.0), FREE),
        (area(51.3, 24.0, 55.9, 28.0), FREE),
        (area(50.4, 40.5, 56.8, 45.0), FREE),
        (area(60.0, 24.0, 63.2, 45.0), FREE),
        (area(59.0, 42.6, 64.0, 43.0), OCCUPIED),
        (area(57.4, 17.6, 58.6, 25.5), OCCUPIED),
        (area(58.0, 17.6, 65.0, 18.0), OCCUPIED),
        // The yard behind them.
        (area(49.0, 44.5, 113.0, 55.0), FREE),
        (area(72.0, 54.0, 96.0, 60.4), FREE),
        car(77.0, 53.0, -4.0),
        car(88.0, 47.0, 6.0),
        // The staff's way out is chained off, a bucket and a board stand about.
        (area(63.0, 12.4, 78.0, 16.4), FREE),
        (area(65.6, 12.0, 65.9, 17.0), OCCUPIED),
        (disc(43.5, 11.0, 0.3), OCCUPIED),
        (turned(29.0, 7.0, 1.2, 0.5, 0.0), OCCUPIED),
        (disc(66.0, 46.4, 0.3), OCCUPIED),
    ];
    // Brushes.
    for y in [30.0, 33.6, 37.2] {
        shapes.push((area(51.8, y, 52.2, y + 1.4), OCCUPIED));
        shapes.push((area(55.0, y, 55.4, y + 1.4), OCCUPIED));
    }
    for i in 0..5 {
        let x = 74.5 + 4.4 * i as f32;
        shapes.push((turned(x, 57.6, 4.6, 0.8, 60.0), OCCUPIED));
        if i == 0 || i == 2 {
            shapes.push(car(x + 2.3, 57.6, 240.0));
        }
    }
    for i in 0..3 {
        shapes.push(car(57.4 + 2.6 * i as f32, 8.6, 90.0));
    }
    Drawing {
        shapes,
        lot: "start = [19.0, 9.0, 0.0]\ngoal = [95.0, 50.4, 0.0]\n",
        ..plain("car-wash", "Through the tunnel of a car wash, 2.8 m between its brushes.", (114.0, 61.0))
    }
}

/// A turn and a quarter inwards between parapets, cars parked along the outer one.
fn spiral_ramp() -> Drawing {
    let mut line = spiral((38.0, 37.0), (32.0, 20.7), (-90.0, 420.0));
    line.insert(0, (1.0, 5.0));
    let mut shapes = vec![(disc(38.0, 37.0, 11.0), FREE), (band(&line, 5.0, 7.4), FREE)];
    for (i, (x, y, heading)) in beside(&line, 5.0, -2.5, 6.1).into_iter().enumerate() {
        if scatter(i, 4) < 0.66 {
            shapes.push(car(x, y, heading));
        }
    }
    // Lamps on the inner parapet, and cones about a hole in three places.
    for (i, (x, y, _)) in beside(&line, 5.0, 3.5, 9.0).into_iter().enumerate() {
        shapes.push((disc(x, y, 0.3 + 0.2 * scatter(i, 8)), OCCUPIED));
    }
    for (i, (x, y, _)) in beside(&line, 5.0, 2.2, 1.3).into_iter().enumerate() {
        if [41, 42, 83, 84, 85, 120, 121].contains(&i) {
            shapes.push((disc(x, y, 0.25), OCCUPIED));
        }
    }
    Drawing {
        shapes,
        background: UNKNOWN,
        lot: "start = [20.0, 5.0, 0.0]\ngoal = [60.4, 37.0, 95.0]\nwall_height_m = 1.0\n",
        ..plain("spiral-ramp", "Inwards on a ramp of 7.4 m with cars parked along one side.", (74.0, 72.0))
    }
}

/// Once round a course of cones, with gates, a slalom and a box to park in.
fn driving_school() -> Drawing {
    let line = [
        (30.0, 10.0),
        (64.0, 10.0),
        (64.0, 42.0),
        (46.0, 42.0),
        (46.0, 27.0),
        (28.0, 27.0),
        (28.0, 42.0),
        (10.0, 42.0),
        (10.0, 10.0),
        (30.0, 10.0),
    ];
    let mut shapes = vec![(area(1.0, 1.0, 77.0, 51.0), FREE)];
    for left_m in [-2.3, 2.3] {
        for (x, y, _) in beside(&line, 7.0, left_m, 1.4) {
            shapes.push((disc(x, y, 0.2), OCCUPIED));
        }
    }
    shapes.push((area(66.0, 21.0, 66.6, 28.0), FREE));
    for line in [[(66.3, 21.0), (69.2, 21.0)], [(69.2, 22.3), (69.2, 27.0)], [(66.3, 28.2), (69.2, 28.2)]] {
        shapes.extend(posts(line[0], line[1], 1.4));
    }
    // Slaloms and gates.
    for (x, y) in [(44.0, 11.1), (52.0, 8.9), (65.0, 33.0), (63.0, 19.0), (37.0, 28.6), (37.0, 25.4), (11.1, 30.0)] {
        shapes.push((disc(x, y, 0.2), OCCUPIED));
    }
    for (x, y, heading) in [(73.0, 12.0, 80.0), (20.0, 26.0, 10.0), (37.0, 44.0, 0.0), (48.0, 18.5, 30.0)] {
        shapes.push(car(x, y, heading));
    }
    Drawing {
        shapes,
        lot: "start = [34.0, 10.0, 0.0]\nloop = true\nwall_height_m = 0.7\n",
        ..plain("driving-school", "Once round a course of 4.2 m between cones on wide tarmac.", (78.0, 52.0))
    }
}

/// The road to a school: build-outs, parents who have stopped, a lay-by, side ways closed for cars.
fn kiss_and_ride() -> Drawing {
    let line = [(1.0, 10.0), (48.0, 10.0), (60.0, 26.0), (60.0, 46.0), (119.0, 46.0)];
    let mut shapes = vec![
        (band(&line, 12.0, 6.4), FREE),
        (area(74.0, 40.4, 100.0, 43.2), FREE),
        // The old road, the teachers' car park, the way of the fire brigade, the playground.
        (area(46.0, 7.4, 70.0, 12.4), FREE),
        (area(62.0, 31.0, 80.0, 36.0), FREE),
        (area(24.0, 12.0, 28.5, 30.0), FREE),
        (area(72.0, 14.0, 110.0, 29.0), FREE),
        (area(68.0, 30.0, 68.3, 37.0), OCCUPIED),
        // Build-outs, and one in the lay-by.
        (area(36.0, 6.0, 38.4, 8.4), OCCUPIED),
        (area(36.0, 11.6, 38.4, 14.0), OCCUPIED),
        (area(56.0, 37.0, 58.6, 38.6), OCCUPIED),
        (area(86.0, 40.0, 87.2, 43.2), OCCUPIED),
        car(23.0, 7.9, 0.0),
        car(29.5, 8.0, 2.0),
        car(77.0, 41.6, 1.0),
        car(83.0, 41.8, 4.0),
        car(91.0, 41.5, -2.0),
        car(97.0, 44.4, 5.0),
        car(76.0, 33.5, 90.0),
    ];
    shapes.extend(posts((24.4, 14.8), (28.4, 14.8), 1.3));
    shapes.extend(posts((57.0, 7.6), (57.0, 12.4), 1.4));
    // Children wait at the kerb.
    for (x, y) in [(42.0, 12.4), (57.2, 31.0), (80.0, 48.6), (80.8, 48.9), (104.0, 43.4)] {
        shapes.push((disc(x, y, 0.25), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [19.0, 10.6, 0.0]\ngoal = [102.0, 46.8, 0.0]\nwall_height_m = 0.15\n",
        ..plain("kiss-and-ride", "A school's road of 6.4 m with build-outs and parents who stop.", (120.0, 52.0))
    }
}

/// Between boats on cradles, as the crane has put them down.
fn boat_yard() -> Drawing {
    let line = [(1.0, 16.0), (34.0, 16.0), (56.0, 38.0), (84.0, 38.0), (102.0, 16.0), (139.0, 16.0)];
    let mut shapes = vec![(band(&line, 11.0, 22.0), FREE)];
    for (side, left_m) in [(0, -6.4), (1, 6.4)] {
        for (i, (x, y, heading)) in beside(&line, 11.0, left_m, 3.3).into_iter().enumerate() {
            let length_m = 6.6 + 1.8 * scatter(i, side);
            let turn = if scatter(i, side + 2) < 0.5 { 90.0 } else { -90.0 };
            shapes.extend(boat((x, y, heading + turn + 8.0 * scatter(i, side + 4) - 4.0), length_m));
        }
    }
    for (x, y, length_m, width_m, heading) in
        [(45.0, 24.6, 3.4, 1.2, 50.0), (70.0, 39.8, 2.6, 1.0, 0.0), (92.0, 26.0, 3.0, 1.0, -50.0)]
    {
        shapes.push((turned(x, y, length_m, width_m, heading), OCCUPIED));
    }
    Drawing {
        shapes,
        lot: "start = [19.0, 16.0, 0.0]\ngoal = [120.0, 16.0, 0.0]\n",
        ..plain("boat-yard", "A way of 4 to 5 m between boats on cradles.", (140.0, 54.0))
    }
}

/// A hull that narrows to its bow.
fn boat(place: (f32, f32, f32), length_m: f32) -> [(Shape, u8); 3] {
    [(0.6, 2.6), (0.82, 1.9), (1.0, 0.9)].map(|(part, width_m)| {
        let (x, y) = seen_from(place, 0.5 * (part - 1.0) * length_m, 0.0);
        (turned(x, y, part * length_m, width_m, place.2), OCCUPIED)
    })
}
