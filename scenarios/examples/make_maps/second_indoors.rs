//! Ten maps of buildings and works, drawn by somebody who did not know how any driver fares.

use crate::drawing::{
    Drawing, FREE, OCCUPIED, Shape, Shapes, UNKNOWN, area, band, car, disc, discs, distance_m, plain, polar, scatter,
    solid, stroke, turned, way,
};
use sim::geometry::{Pose, Vec2, rectangle};
use sim::maths::sin;

pub(super) fn drawings() -> Vec<Drawing> {
    vec![
        furniture_store(),
        car_breakers(),
        sewage_works(),
        cathedral(),
        airport_terminal(),
        roundhouse(),
        wine_cellar(),
        demolition_site(),
        sawmill(),
        theatre(),
    ]
}

/// A part of a circle.
fn arc(x: f32, y: f32, radius_m: f32, from_deg: f32, to_deg: f32) -> Vec<Vec2> {
    (0..=40).map(|i| polar(x, y, radius_m, from_deg + (to_deg - from_deg) * i as f32 / 40.0)).collect()
}

/// A box that points away from a centre.
fn radial(centre: (f32, f32), from_m: f32, to_m: f32, width_m: f32, angle_deg: f32) -> Shape {
    let middle = polar(centre.0, centre.1, 0.5 * (from_m + to_m), angle_deg);
    turned(middle.x, middle.y, to_m - from_m, width_m, angle_deg)
}

/// A line beside a line, to the left where `left_m` is positive.
fn beside(line: &[Vec2], left_m: f32) -> Vec<Vec2> {
    line.windows(2).map(|ends| ends[0] + (ends[1] - ends[0]).normalize_or_zero().perp() * left_m).collect()
}

/// Points at equal distances along a line.
fn spaced(line: &[Vec2], pitch_m: f32) -> Vec<Vec2> {
    let mut points: Vec<Vec2> = line.first().copied().into_iter().collect();
    for &point in line {
        while let Some(&last) = points.last() {
            let gap_m = last.distance(point);
            if gap_m < pitch_m {
                break;
            }
            points.push(last + (point - last) * (pitch_m / gap_m));
        }
    }
    points
}

/// Round posts at equal distances along a line.
fn posts(line: &[Vec2], pitch_m: f32, radius_m: f32) -> Shapes {
    discs(spaced(line, pitch_m), radius_m)
}

/// What lies about in rows in a rectangle, but off the way.
struct Stock {
    low: (f32, f32),
    high: (f32, f32),
    pitch_m: (f32, f32),
    size_m: (f32, f32),
    heading_deg: f32,
    /// How far the things are turned and shifted at random.
    loose_deg: f32,
    loose_m: f32,
    /// Free on either side of the way's middle, at least and at most.
    clear_m: (f32, f32),
}

impl Stock {
    fn put(&self, line: &[Vec2]) -> Shapes {
        let mut shapes = Vec::new();
        let cols = ((self.high.0 - self.low.0) / self.pitch_m.0) as usize;
        let rows = ((self.high.1 - self.low.1) / self.pitch_m.1) as usize;
        for row in 0..rows {
            for col in 0..cols {
                let random = |k: usize| scatter(row * cols + col, k) - 0.5;
                let x = self.low.0 + (col as f32 + 0.5) * self.pitch_m.0 + self.loose_m * random(1);
                let y = self.low.1 + (row as f32 + 0.5) * self.pitch_m.1 + self.loose_m * random(2);
                let heading_deg = self.heading_deg + self.loose_deg * random(3);
                let pose = Pose::new(Vec2::new(x, y), heading_deg.to_radians());
                let [a, b, c, d] = rectangle(pose, self.size_m.0, self.size_m.1);
                let outline = [a, b, c, d, 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + d), 0.5 * (d + a)];
                let nearest_m = outline.iter().map(|&point| distance_m(line, point)).fold(f32::INFINITY, f32::min);
                let clear_m = self.clear_m.0 + (self.clear_m.1 - self.clear_m.0) * scatter(row * 31 + col, 4);
                if nearest_m > clear_m {
                    shapes.push((turned(x, y, self.size_m.0, self.size_m.1, heading_deg), OCCUPIED));
                }
            }
        }
        shapes
    }
}

/// Heaps and blocks of many sizes close to the way, at most about `reach_m` from its middle.
fn rubble(line: &[Vec2], low: (f32, f32), high: (f32, f32), clear_m: f32, reach_m: f32) -> Shapes {
    const PITCH_M: f32 = 1.5;
    let mut shapes = Vec::new();
    let (cols, rows) = (((high.0 - low.0) / PITCH_M) as usize, ((high.1 - low.1) / PITCH_M) as usize);
    for i in 0..cols * rows {
        let random = |k: usize| scatter(i + 37 * (i / cols) * (k + 3), k);
        let x = low.0 + PITCH_M * ((i % cols) as f32 + 0.5 + 0.6 * (random(1) - 0.5));
        let y = low.1 + PITCH_M * ((i / cols) as f32 + 0.5 + 0.6 * (random(2) - 0.5));
        let radius_m = 0.3 + 0.6 * random(3);
        let away_m = distance_m(line, Vec2::new(x, y));
        if away_m - radius_m > clear_m && away_m < reach_m * (0.9 + 0.4 * random(5)) {
            if random(4) > 0.6 {
                shapes.push((turned(x, y, 1.9 * radius_m, 1.1 * radius_m, 180.0 * random(6)), OCCUPIED));
            } else {
                shapes.push((disc(x, y, radius_m), OCCUPIED));
            }
        }
    }
    shapes
}

/// A digger: tracks, cab and arm.
fn digger(x: f32, y: f32, heading_deg: f32, arm_deg: f32) -> Shapes {
    let (elbow, bucket) = (polar(x, y, 3.6, arm_deg), polar(x, y, 5.8, arm_deg + 8.0));
    solid([
        turned(x, y, 3.9, 2.8, heading_deg),
        disc(x, y, 1.6),
        stroke([Vec2::new(x, y), elbow, bucket], 0.6),
        turned(bucket.x, bucket.y, 1.0, 1.4, arm_deg),
    ])
}

/// What stands of the walls of a wing of so many rooms, off the way.
fn ruin(wing: usize, corner: Vec2, heading_deg: f32, (cols, rows): (usize, usize), line: &[Vec2]) -> Shapes {
    let axes = [0.0, 90.0].map(|turn_deg| polar(0.0, 0.0, 1.0, heading_deg + turn_deg));
    let mut shapes = Vec::new();
    for i in 0..cols * rows {
        let random = |k: usize| scatter(i * 3 + wing, k);
        let (u, v) = ((i % cols) as f32, (i / cols) as f32);
        let across = axes[0] * (6.8 * u + 1.6 * sin(0.9 * u + 1.0));
        let up = axes[1] * (6.4 * v + 1.2 * sin(1.7 * v));
        for (k, axis) in axes.into_iter().enumerate().filter(|(k, _)| random(k + 5) >= 0.3) {
            let (first, count) = ((6.0 * random(k + 1)) as usize, (4.0 + 10.0 * random(k + 3)) as usize);
            for n in first..(first + count).min(14) {
                let at = corner + across + up + axis * (0.5 * n as f32);
                if distance_m(line, at) > 2.6 && at.x < 56.0 && at.y < 84.0 {
                    shapes.push((turned(at.x, at.y, 0.6, 0.6, heading_deg), OCCUPIED));
                }
            }
        }
    }
    shapes
}

/// A table with chairs round it.
fn table(x: f32, y: f32, radius_m: f32, chairs: usize) -> Shapes {
    let chair = |i: usize| polar(x, y, radius_m + 0.45, 360.0 * i as f32 / chairs as f32 + 20.0);
    let mut shapes = discs((0..chairs).map(chair), 0.28);
    shapes.push((disc(x, y, radius_m), OCCUPIED));
    shapes
}

/// A store with a winding walk past furnished sample rooms.
fn furniture_store() -> Drawing {
    let walk = [
        (2.0, 7.0),
        (38.0, 7.0),
        (46.0, 19.0),
        (33.0, 27.0),
        (20.0, 22.0),
        (9.0, 30.0),
        (16.0, 45.0),
        (34.0, 46.0),
        (44.0, 36.0),
        (57.0, 34.0),
        (58.0, 16.0),
        (70.0, 10.0),
        (76.0, 24.0),
        (76.0, 53.0),
    ];
    let mut shapes = vec![(band(&walk, 6.5, 5.2), FREE)];
    let rooms = [
        (20.0, 9.0, 27.4, 14.6),
        (27.8, 9.0, 36.5, 14.2),
        (23.0, 1.0, 35.0, 5.0),
        (44.2, 9.0, 51.8, 15.6),
        (20.5, 25.5, 31.0, 33.0),
        (20.0, 37.5, 31.0, 44.0),
        (47.5, 36.0, 56.0, 41.5),
        (59.5, 20.0, 66.5, 29.0),
        (64.0, 33.0, 74.0, 38.6),
        (67.0, 39.0, 74.0, 45.0),
        (78.0, 29.0, 83.0, 36.0),
        (3.0, 9.0, 13.0, 13.5),
        (2.0, 33.0, 9.0, 42.0),
    ];
    shapes.extend(rooms.map(|(x, y, to_x, to_y)| (area(x, y, to_x, to_y), FREE)));
    shapes.extend(furniture());
    Drawing {
        shapes,
        lot: "start = [18.5, 7.4, 0.0]\ngoal = [76.0, 35.5, 90.0]\nwall_height_m = 2.0\n",
        ..plain("furniture-store", "A furniture store with a winding walk past sample rooms.", (84.0, 54.0))
    }
}

/// What stands in the sample rooms and at the edge of the walk.
fn furniture() -> Shapes {
    let boxes = [
        // Beds with bedside tables.
        (22.0, 13.2, 2.1, 1.9, 90.0),
        (24.0, 14.0, 0.6, 0.6, 0.0),
        (25.8, 13.2, 2.1, 1.7, 90.0),
        (29.6, 12.6, 2.2, 1.9, 90.0),
        (32.6, 12.4, 2.1, 1.0, 90.0),
        (35.2, 11.6, 3.4, 0.7, 90.0),
        // Kitchens.
        (29.0, 1.4, 11.0, 0.8, 0.0),
        (23.5, 2.8, 3.0, 0.8, 90.0),
        (29.4, 3.6, 2.8, 1.1, 3.0),
        // Sofas and low tables.
        (21.4, 29.0, 2.6, 1.0, 90.0),
        (25.0, 32.2, 3.0, 1.1, 0.0),
        (25.2, 29.9, 1.3, 0.8, 12.0),
        (29.4, 31.0, 2.2, 1.0, 115.0),
        (21.0, 41.0, 2.4, 1.0, 90.0),
        (25.6, 38.4, 2.8, 1.0, 2.0),
        (25.6, 40.8, 1.2, 1.2, 45.0),
        (30.2, 40.4, 1.2, 1.2, 20.0),
        // Bunks and wardrobes.
        (65.6, 27.2, 2.1, 1.0, 90.0),
        (65.6, 22.4, 2.1, 1.0, 90.0),
        (62.2, 28.3, 1.4, 0.8, 0.0),
        (68.0, 33.6, 6.0, 0.7, 0.0),
        (64.6, 36.4, 2.4, 0.7, 90.0),
        (70.4, 36.2, 1.8, 1.0, 30.0),
        (70.0, 44.4, 4.0, 0.7, 0.0),
        (67.6, 41.6, 2.8, 0.7, 90.0),
        (82.4, 32.6, 4.6, 0.8, 90.0),
        (80.2, 33.4, 1.6, 0.7, 75.0),
        // Desks.
        (2.7, 37.4, 3.8, 0.8, 90.0),
        (5.4, 41.0, 1.6, 0.8, 10.0),
        // Bargain bins and trolleys at the edge of the walk.
        (17.0, 5.1, 1.4, 0.9, 0.0),
        (47.4, 19.6, 1.2, 0.8, 75.0),
        (10.7, 36.9, 1.2, 0.8, 65.0),
        (24.0, 47.2, 1.6, 0.9, 4.0),
        (55.3, 26.0, 1.3, 0.8, 92.0),
        (73.9, 27.4, 1.2, 0.8, 90.0),
        (78.1, 42.0, 1.8, 0.9, 90.0),
    ];
    let mut shapes = solid(boxes.map(|(x, y, length_m, width_m, heading)| turned(x, y, length_m, width_m, heading)));
    shapes.extend(table(50.0, 10.6, 0.8, 5));
    shapes.extend(table(49.8, 13.9, 0.7, 4));
    shapes.extend(discs([(49.2, 40.2), (51.0, 39.0), (52.6, 40.6), (54.4, 39.4)], 0.25));
    shapes.extend(discs([(4.0, 12.4), (5.6, 12.8), (7.4, 12.2), (9.6, 12.9), (11.8, 12.0)], 0.5));
    shapes
}

/// A car breaker's yard whose way bends between rows of wrecks.
fn car_breakers() -> Drawing {
    let points = [
        (2.0, 8.0),
        (50.0, 8.0),
        (66.0, 20.0),
        (60.0, 36.0),
        (41.0, 31.0),
        (24.0, 24.0),
        (11.0, 36.0),
        (22.0, 48.0),
        (74.0, 48.0),
    ];
    let line = way(&points, 7.5);
    let mut shapes = vec![(area(1.0, 1.0, 75.0, 55.0), FREE)];
    // Hut, weighbridge rail, press, crane with jib, a lorry.
    shapes.extend(solid([
        turned(10.0, 3.2, 6.0, 2.5, 2.0),
        turned(36.0, 38.6, 8.0, 3.2, 14.0),
        disc(48.0, 20.0, 1.8),
        stroke([(48.0, 20.0), (40.0, 23.6)], 0.7),
        turned(30.0, 15.2, 8.5, 2.5, 24.0),
        turned(24.2, 12.8, 2.2, 2.4, 24.0),
    ]));
    let wrecks = |low, high, heading_deg: f32, upright: bool| Stock {
        low,
        high,
        pitch_m: if upright { (2.5, 5.1) } else { (5.1, 2.5) },
        size_m: (4.5, 1.8),
        heading_deg,
        loose_deg: 22.0,
        loose_m: 0.5,
        clear_m: (2.2, 2.8),
    };
    for stock in [
        wrecks((1.0, 0.2), (58.0, 5.4), 90.0, true),
        wrecks((2.0, 10.0), (57.0, 20.6), 90.0, true),
        wrecks((26.0, 20.4), (62.0, 28.0), 0.0, false),
        wrecks((1.5, 20.4), (21.5, 54.0), 3.0, false),
        wrecks((16.0, 29.0), (57.0, 46.0), 90.0, true),
        wrecks((57.0, 26.0), (75.0, 46.0), 0.0, false),
        wrecks((62.0, 1.0), (75.0, 27.0), -5.0, false),
        wrecks((20.0, 50.5), (75.0, 55.7), 90.0, true),
    ] {
        shapes.extend(stock.put(&line));
    }
    shapes.extend(rubble(&line, (1.0, 1.0), (75.0, 55.0), 2.5, 4.6));
    Drawing {
        shapes,
        lot: "start = [18.5, 8.0, 0.0]\ngoal = [56.5, 48.0, 0.0]\nwall_height_m = 2.0\n",
        ..plain("car-breakers", "A car breaker's yard with a way between wrecks and heaps of parts.", (76.0, 56.0))
    }
}

/// Sewage works with a service road round the basins.
fn sewage_works() -> Drawing {
    let points = [
        (0.8, 9.0),
        (30.0, 9.0),
        (40.0, 29.0),
        (58.0, 29.0),
        (64.0, 10.0),
        (84.0, 10.0),
        (88.0, 26.0),
        (84.0, 41.6),
        (57.0, 41.6),
        (46.0, 38.2),
        (0.3, 38.2),
    ];
    let line = way(&points, 7.0);
    let mut shapes = vec![(area(0.5, 0.5, 95.5, 55.5), FREE)];
    for (x, y, radius_m) in [(24.0, 25.0, 9.4), (49.2, 15.2, 10.2), (74.0, 24.2, 9.6)] {
        shapes.push((disc(x, y, radius_m), OCCUPIED));
        shapes.push((disc(x, y, radius_m - 0.5), UNKNOWN));
        shapes.push((disc(x, y, 1.0), OCCUPIED));
        shapes.push((radial((x, y), 0.0, radius_m + 0.3, 0.7, 7.0 * x), OCCUPIED));
    }
    for (x, y, to_x, to_y) in [(6.0, 45.2, 21.0, 54.0), (22.0, 45.2, 37.0, 54.0)] {
        shapes.push((area(x, y, to_x, to_y), OCCUPIED));
        shapes.push((area(x + 0.4, y + 0.4, to_x - 0.4, to_y - 0.4), UNKNOWN));
        shapes.push((stroke([(x, y + 4.4), (to_x - 3.0, y + 4.4)], 0.5), OCCUPIED));
    }
    shapes.extend(solid([
        area(43.0, 46.0, 57.0, 54.0),
        disc(66.0, 49.6, 4.2),
        disc(77.0, 50.2, 4.2),
        turned(71.5, 49.9, 4.0, 1.0, 3.0),
        area(3.0, 2.0, 12.0, 5.6),
        turned(35.5, 4.2, 6.2, 2.4, -8.0),
        turned(6.0, 17.0, 3.0, 2.0, 0.0),
        turned(7.0, 32.0, 5.0, 3.0, 0.0),
        disc(52.6, 34.6, 1.8),
        disc(91.0, 46.0, 1.4),
    ]));
    shapes.extend([car(60.5, 4.4, 12.0), car(70.0, 34.6, 95.0)]);
    // Posts, here and there a low wall, on both sides of the road.
    for left_m in [2.5, -2.5] {
        let edge = spaced(&beside(&line, left_m), 1.5);
        for (i, part) in edge.chunks(9).enumerate() {
            if scatter(i, 6) > 0.7 {
                shapes.push((stroke(part.iter().copied(), 0.3), OCCUPIED));
            } else {
                shapes.extend(discs(part.iter().copied(), 0.12));
            }
        }
    }
    Drawing {
        shapes,
        lot: "start = [18.0, 9.0, 0.0]\ngoal = [18.5, 38.2, 180.0]\nwall_height_m = 0.4\n",
        ..plain("sewage-works", "Sewage works with a road between round basins.", (96.0, 56.0))
    }
}

/// A cathedral: up the nave, through the transept and the cloister.
fn cathedral() -> Drawing {
    let mut shapes = vec![
        (area(1.0, 4.0, 16.0, 30.0), FREE),
        (area(15.5, 14.9, 18.0, 19.1), FREE),
        (area(17.6, 7.0, 55.0, 27.0), FREE),
        (area(54.0, 2.0, 64.0, 33.0), FREE),
        (area(63.8, 9.0, 74.0, 25.0), FREE),
        (disc(74.0, 17.0, 8.0), FREE),
        (area(57.3, 32.5, 61.1, 34.6), FREE),
        (area(22.0, 34.0, 62.0, 58.0), FREE),
        (area(18.0, 53.3, 22.5, 57.0), FREE),
        (area(1.0, 52.4, 18.4, 57.8), FREE),
    ];
    for i in 0..20 {
        let x = 22.0 + 1.4 * i as f32;
        if i == 10 {
            continue;
        }
        shapes.push((area(x, 8.0, x + 0.5, 14.8 - 0.3 * scatter(i, 1)), OCCUPIED));
        shapes.push((area(x, 19.2 + 0.3 * scatter(i, 2), x + 0.5, 26.0), OCCUPIED));
    }
    // Pillars, the four of the crossing larger.
    shapes.extend(discs((0..6).flat_map(|i| [11.4, 22.6].map(|y| (20.4 + 5.8 * i as f32, y))), 0.75));
    shapes.extend(discs([(53.6, 10.4), (53.6, 23.6), (64.2, 10.2), (64.2, 23.8)], 1.3));
    // Choir screen, stalls, altar, pulpit.
    shapes.extend(posts(&[Vec2::new(64.0, 11.0), Vec2::new(64.0, 24.0)], 1.2, 0.2));
    shapes.extend(solid([
        area(66.0, 10.4, 73.0, 11.6),
        area(66.0, 22.4, 73.0, 23.6),
        turned(77.0, 17.0, 1.4, 3.6, 0.0),
        disc(51.6, 21.2, 0.7),
        // A tomb in the south transept.
        turned(59.0, 3.2, 3.0, 1.4, 0.0),
        // Confessionals.
        area(54.0, 28.0, 55.6, 31.0),
        area(62.8, 27.0, 64.0, 30.0),
    ]));
    for i in 0..32 {
        let (x, y) = (55.2 + 1.1 * (i % 8) as f32, 5.6 + 1.4 * (i / 8) as f32);
        shapes.push((turned(x, y, 0.55, 0.55, 20.0 * scatter(i, 3)), OCCUPIED));
    }
    // The garth with its arcade, well and trees.
    let garth = [(27.6, 39.6), (56.4, 39.6), (56.4, 52.4), (27.6, 52.4), (27.6, 39.6)].map(Vec2::from);
    shapes.extend(posts(&garth, 1.6, 0.28));
    shapes.extend(solid([disc(34.0, 44.0, 0.9), disc(49.0, 48.4, 1.3), disc(42.0, 46.0, 1.5)]));
    // Masons at work in the south walk, stone coffins in the west walk.
    shapes.extend(posts(&[Vec2::new(54.4, 34.4), Vec2::new(54.4, 39.6)], 1.3, 0.12));
    shapes.extend(solid([
        stroke([(52.0, 35.2), (52.0, 38.8)], 1.4),
        turned(48.0, 36.8, 3.0, 1.8, 20.0),
        turned(23.3, 50.6, 2.2, 1.0, 4.0),
        turned(26.4, 50.4, 2.2, 1.0, -6.0),
        turned(24.8, 47.0, 2.2, 1.0, 88.0),
        turned(61.4, 47.0, 3.0, 0.7, 90.0),
        turned(44.0, 57.6, 3.0, 0.7, 0.0),
        turned(33.0, 57.6, 3.0, 0.7, 0.0),
        // In the square and the lane.
        disc(8.0, 25.0, 1.6),
        disc(4.0, 57.2, 0.5),
        disc(11.0, 57.4, 0.5),
    ]));
    shapes.extend([car(3.4, 7.4, 90.0), car(6.2, 7.2, 88.0)]);
    Drawing {
        shapes,
        lot: "start = [19.0, 17.0, 0.0]\ngoal = [18.0, 55.1, 180.0]\nwall_height_m = 2.0\n",
        ..plain(
            "cathedral",
            "A cathedral: the nave between pews, the transept and two sides of the cloister.",
            (84.0, 60.0),
        )
    }
}

/// An airport terminal: check-in, security, shops and a gate.
fn airport_terminal() -> Drawing {
    let walk = [(1.0, 8.0), (70.8, 8.0), (70.8, 34.0), (58.0, 40.0), (44.0, 33.5), (30.0, 39.0), (1.0, 39.0)];
    let line = way(&walk, 7.0);
    let mut shapes = vec![
        (area(1.0, 2.3, 78.0, 22.0), FREE),
        (area(1.0, 26.5, 83.0, 49.0), FREE),
        (area(1.0, 12.2, 21.0, 22.0), OCCUPIED),
    ];
    // Columns with benches between them along the windows.
    for i in 0..8 {
        let x = 10.0 + 8.0 * i as f32;
        shapes.push((disc(x, 4.0, 0.5), OCCUPIED));
        shapes.push((turned(x + 2.9, 4.2, 2.6, 0.8, 3.0 * scatter(i, 1)), OCCUPIED));
        shapes.push((turned(x + 5.8, 3.9, 1.6, 1.1, 90.0 * scatter(i, 2)), OCCUPIED));
    }
    // Check-in islands and the belts of the queues.
    for i in 0..5 {
        let x = 27.0 + 8.4 * i as f32;
        shapes.push((turned(x, 17.6, 7.6, 1.0, 78.0), OCCUPIED));
        for k in 0..4 {
            let y = 15.0 + 1.7 * k as f32;
            let shift = 0.21 * (y - 17.6);
            shapes.push((turned(x + shift - 1.4, y, 1.0, 0.8, 78.0), OCCUPIED));
            shapes.push((turned(x + shift + 1.4, y, 1.0, 0.8, 78.0), OCCUPIED));
        }
    }
    let queue: Vec<Vec2> = (0..46).map(|i| Vec2::new(20.6 + i as f32, 12.0 + 0.7 * sin(0.33 * i as f32))).collect();
    shapes.extend(posts(&queue, 1.3, 0.1));
    shapes.extend(posts(&[Vec2::new(66.0, 12.0), Vec2::new(67.6, 21.8)], 1.3, 0.1));
    // Machines for tickets, people with luggage, a kiosk.
    shapes.extend(solid([
        turned(76.4, 4.0, 2.4, 4.0, 20.0),
        turned(77.4, 12.0, 0.9, 5.0, 0.0),
        disc(30.0, 10.8, 0.35),
        disc(30.8, 11.2, 0.3),
        disc(46.0, 5.4, 0.35),
        turned(46.9, 5.2, 0.7, 0.5, 40.0),
        disc(57.0, 10.4, 0.4),
        turned(4.0, 11.0, 4.0, 1.0, 4.0),
    ]));
    // Security: four lanes, one of them open.
    for (x, open) in [(70.8, true), (64.4, false), (58.2, false), (52.0, false)] {
        shapes.push((area(x - 1.75, 21.5, x + 1.75, 27.0), FREE));
        if !open {
            shapes.push((area(x - 1.75, 22.6, x + 1.75, 23.0), OCCUPIED));
        }
    }
    // Shelves of the shops, seats of the gate.
    let shelves = |low, high, heading_deg| Stock {
        low,
        high,
        pitch_m: (3.0, 1.9),
        size_m: (2.2, 0.8),
        heading_deg,
        loose_deg: 24.0,
        loose_m: 0.4,
        clear_m: (2.5, 3.1),
    };
    shapes.extend(shelves((26.0, 28.0), (50.0, 49.0), -12.0).put(&line));
    shapes.extend(shelves((50.0, 27.2), (66.0, 49.0), 25.0).put(&line));
    shapes.extend(shelves((66.0, 27.6), (83.0, 49.0), 80.0).put(&line));
    let seats =
        Stock { pitch_m: (5.4, 2.0), size_m: (4.2, 0.9), loose_deg: 0.0, ..shelves((1.5, 27.5), (26.0, 49.0), 0.0) };
    shapes.extend(seats.put(&line));
    for left_m in [3.0, -3.0] {
        shapes.extend(posts(&beside(&line[line.len() / 2..], left_m), 1.55, 0.18));
    }
    Drawing {
        shapes,
        lot: "start = [18.0, 8.0, 0.0]\ngoal = [18.0, 39.0, 180.0]\nwall_height_m = 0.5\n",
        ..plain(
            "airport-terminal",
            "An airport terminal: past check-in, through security and the shops to a gate.",
            (84.0, 50.0),
        )
    }
}

/// An engine shed round a turntable, with a workshop behind.
fn roundhouse() -> Drawing {
    const C: (f32, f32) = (46.0, 30.0);
    let mut shapes = vec![
        (area(1.0, 15.0, 46.0, 22.2), FREE),
        (disc(C.0, C.1, 14.8), FREE),
        (stroke(arc(C.0, C.1, 20.6, -78.0, 116.0), 13.6), FREE),
        (area(28.0, 0.0, 44.4, 15.0), OCCUPIED),
        (area(43.9, 55.0, 48.1, 60.5), FREE),
        (area(1.0, 59.5, 54.0, 69.5), FREE),
        (disc(C.0, C.1, 8.2), OCCUPIED),
        (disc(C.0, C.1, 7.8), UNKNOWN),
        (radial(C, -7.8, 7.8, 3.0, 122.0), OCCUPIED),
    ];
    // Engines in their stalls, some with a tender, and the posts of the gates.
    for i in 0..13 {
        let angle_deg = 106.0 - 16.0 * i as f32;
        if i != 1 {
            let (nose_m, wide_m) = (14.7 + 0.8 * scatter(i, 1), 2.75 + 0.25 * scatter(i, 2));
            shapes.push((radial(C, nose_m, nose_m + 7.2, wide_m, angle_deg), OCCUPIED));
            shapes.push((radial(C, nose_m + 7.6, 26.6 - scatter(i, 3), wide_m - 0.2, angle_deg), OCCUPIED));
        }
        if i > 1 {
            shapes.extend(discs([polar(C.0, C.1, 15.0, angle_deg - 8.0)], 0.3));
        }
    }
    // An engine that leaves the table, then coal and ash.
    shapes.push((radial(C, 6.5, 18.0, 2.9, 122.0), OCCUPIED));
    for (angle_deg, away_m, radius_m) in [
        (138.0, 12.1, 2.9),
        (154.0, 12.1, 2.6),
        (172.0, 12.1, 3.0),
        (190.0, 12.1, 2.7),
        (206.0, 12.2, 2.2),
        (203.0, 9.4, 1.2),
    ] {
        shapes.extend(discs([polar(C.0, C.1, away_m, angle_deg)], radius_m));
    }
    shapes.extend(solid([
        // Water crane, coal bunker, a wagon, a pile of sleepers.
        disc(29.0, 21.4, 0.5),
        stroke([(29.0, 21.4), (30.6, 20.8)], 0.3),
        area(3.0, 20.6, 11.0, 22.4),
        turned(20.0, 15.6, 8.0, 1.6, 0.0),
        turned(33.0, 15.4, 2.6, 1.4, 15.0),
        // Benches, lathes and presses in the workshop.
        turned(52.0, 64.5, 2.2, 9.0, 8.0),
        area(1.0, 59.5, 8.0, 60.6),
        turned(13.0, 60.5, 5.0, 1.4, 0.0),
        turned(30.0, 68.4, 6.0, 1.6, 2.0),
        disc(40.6, 68.6, 1.2),
        turned(46.0, 69.0, 5.0, 1.0, 0.0),
        turned(9.0, 68.6, 4.2, 1.8, -3.0),
    ]));
    // Wheel sets.
    for (x, y) in [(21.0, 61.0), (23.2, 60.9), (25.6, 61.1), (34.2, 60.8), (15.6, 68.2), (18.0, 68.3), (20.6, 68.1)] {
        shapes.push((turned(x, y, 0.3, 2.6, 0.0), OCCUPIED));
        shapes.extend([-0.9, 0.9].map(|dy| (turned(x, y + dy, 1.2, 0.3, 0.0), OCCUPIED)));
    }
    Drawing {
        shapes,
        lot: "start = [18.5, 18.8, 0.0]\ngoal = [18.0, 64.5, 180.0]\nwall_height_m = 2.0\n",
        ..plain(
            "roundhouse",
            "An engine shed: round the turntable, through an empty stall into the workshop.",
            (76.0, 71.0),
        )
    }
}

/// A wine cellar: galleries of barrels and a round hall.
fn wine_cellar() -> Drawing {
    let bend = [(44.0, 7.6), (63.0, 8.2), (64.5, 24.0), (54.0, 33.0), (46.0, 36.0)];
    let mut shapes = vec![
        (area(1.0, 4.0, 52.0, 11.4), FREE),
        (band(&bend, 7.5, 5.2), FREE),
        (disc(47.0, 36.0, 9.4), FREE),
        (area(1.0, 33.0, 40.0, 41.0), FREE),
    ];
    // Niches with great casks, behind grilles in the bend.
    for (x, y) in [(14.0, 12.6), (20.4, 12.6), (26.8, 12.6), (36.0, 2.6), (42.4, 2.6)] {
        shapes.push((turned(x, y, 4.4, 4.6, 90.0), FREE));
        let cask_y = y + (y - 7.7) * 0.06;
        shapes.extend(solid([turned(x, cask_y, 3.4, 2.3, 90.0), turned(x, cask_y, 2.2, 2.8, 90.0)]));
    }
    shapes.push((turned(69.0, 14.0, 7.0, 3.4, -4.0), FREE));
    shapes.push((turned(67.4, 14.1, 0.2, 3.4, -4.0), OCCUPIED));
    shapes.push((turned(58.0, 21.0, 7.0, 3.2, 30.0), FREE));
    shapes.push((turned(60.0, 22.2, 0.3, 3.4, 30.0), OCCUPIED));
    // Barrels along the walls, a few places empty.
    for i in 0..42 {
        let x = 2.0 + 1.05 * i as f32;
        let (dy, deg) = (0.12 * scatter(i, 1), 8.0 * (scatter(i, 2) - 0.5));
        if !(8..11).contains(&i) && x < 33.0 {
            shapes.push((turned(x, 4.7 + dy, 1.25, 0.9, 90.0 + deg), OCCUPIED));
        }
        if !(10.8..30.0).contains(&x) && i % 13 != 7 {
            shapes.push((turned(x, 10.8 - dy, 1.25, 0.9, 90.0 + deg), OCCUPIED));
        }
        if x < 37.0 && i % 9 != 4 {
            shapes.push((turned(x, 40.3 - dy, 1.25, 0.9, 90.0 + deg), OCCUPIED));
        }
    }
    // Pillars of the second gallery with barrels between them.
    for i in 0..7 {
        let x = 4.0 + 5.4 * i as f32;
        shapes.push((turned(x, 34.4, 1.1, 1.1, 0.0), OCCUPIED));
        shapes.push((disc(x + 1.7 + 0.3 * scatter(i, 4), 34.2, 0.5), OCCUPIED));
        shapes.push((turned(x + 3.4, 34.1, 1.2, 0.9, 30.0 * scatter(i, 5)), OCCUPIED));
    }
    // The hall: a tasting table, and barrels on end between it and the wall.
    shapes.extend(table(46.6, 38.6, 1.2, 7));
    shapes.extend(discs([(46.0, 41.6), (46.8, 43.4), (45.8, 44.6)], 0.55));
    for (count, from_deg, step_deg) in [(9, 30.0, 12.0), (5, 225.0, 13.0)] {
        shapes.extend(discs((0..count).map(|i| polar(47.0, 36.0, 8.9, from_deg + step_deg * i as f32)), 0.5));
    }
    Drawing {
        shapes,
        lot: "start = [18.5, 7.8, 0.0]\ngoal = [18.5, 37.4, 180.0]\nwall_height_m = 2.0\n",
        ..plain(
            "wine-cellar",
            "A wine cellar: a gallery with casks, a bend, a round hall and a gallery with pillars.",
            (74.0, 48.0),
        )
    }
}

/// A half demolished building with rubble and diggers.
fn demolition_site() -> Drawing {
    let points =
        [(12.0, 1.0), (12.0, 32.0), (34.0, 42.0), (41.0, 58.0), (23.0, 66.0), (13.0, 79.0), (28.0, 88.0), (58.0, 88.0)];
    let line = way(&points, 7.0);
    let mut shapes = vec![(area(1.0, 1.0, 58.0, 95.0), FREE)];
    shapes.extend(ruin(0, Vec2::new(18.0, 5.0), 0.0, (6, 5), &line));
    shapes.extend(ruin(1, Vec2::new(7.0, 38.0), 9.0, (8, 7), &line));
    shapes.extend(digger(6.0, 40.0, 35.0, 70.0));
    shapes.extend(digger(29.0, 54.0, 120.0, 170.0));
    shapes.extend(digger(48.0, 46.0, 20.0, 100.0));
    shapes.extend(solid([
        // Skips, a lorry, a cabin.
        turned(6.6, 24.0, 6.0, 2.4, 92.0),
        turned(17.2, 25.0, 6.0, 2.4, 80.0),
        turned(6.0, 9.0, 6.0, 2.5, 90.0),
        turned(40.0, 92.6, 8.0, 2.5, 4.0),
        turned(29.0, 80.0, 6.0, 2.4, 35.0),
    ]));
    shapes.extend(rubble(&line, (1.0, 1.0), (58.0, 95.0), 2.3, 5.6));
    Drawing {
        shapes,
        lot: "start = [12.0, 18.0, 90.0]\ngoal = [41.0, 88.0, 0.0]\nwall_height_m = 2.0\n",
        ..plain(
            "demolition-site",
            "A half demolished building with a way cleared through walls and rubble.",
            (59.0, 96.0),
        )
    }
}

/// A sawmill: log stacks, the saw hall and the timber yard.
fn sawmill() -> Drawing {
    let points = [(1.0, 40.0), (54.0, 40.0), (66.0, 33.0), (66.0, 8.0), (46.0, 8.0), (37.0, 16.0), (1.0, 16.0)];
    let line = way(&points, 7.0);
    let mut shapes = vec![(area(1.0, 1.0, 77.0, 49.0), FREE)];
    shapes.extend(log_stacks());
    // The hall with its saws.
    shapes.extend([
        (area(57.0, 13.6, 76.0, 29.6), OCCUPIED),
        (area(57.5, 14.1, 75.5, 29.1), FREE),
        (area(63.5, 13.0, 68.5, 30.0), FREE),
        (turned(59.7, 21.6, 13.0, 1.2, 90.0), OCCUPIED),
        (turned(61.0, 24.0, 2.2, 2.2, 0.0), OCCUPIED),
        (turned(61.2, 17.4, 2.4, 1.8, 10.0), OCCUPIED),
        (turned(72.6, 21.6, 12.4, 2.8, 90.0), OCCUPIED),
        (turned(70.6, 26.0, 2.4, 1.8, 0.0), OCCUPIED),
        (disc(70.0, 18.2, 0.9), OCCUPIED),
        // Conveyor to the heap of chips, a loader with logs, the drying kiln.
        (stroke([(57.0, 22.0), (49.0, 25.0)], 1.0), OCCUPIED),
        (disc(46.0, 26.0, 3.4), OCCUPIED),
        (disc(48.6, 28.4, 2.4), OCCUPIED),
        (turned(72.6, 42.0, 5.6, 2.6, 50.0), OCCUPIED),
        (turned(69.9, 38.9, 0.9, 4.4, 50.0), OCCUPIED),
        (turned(64.0, 46.6, 9.0, 2.4, 6.0), OCCUPIED),
        (area(72.0, 1.0, 77.0, 12.4), OCCUPIED),
        (area(1.0, 1.0, 9.0, 12.0), OCCUPIED),
    ]);
    let boards = |low, high, deg| Stock {
        low,
        high,
        pitch_m: (5.0, 2.3),
        size_m: (4.2, 1.3),
        heading_deg: deg,
        loose_deg: 8.0,
        loose_m: 0.4,
        clear_m: (2.4, 3.0),
    };
    shapes.extend(boards((1.0, 17.8), (46.0, 30.0), 0.0).put(&line));
    shapes.extend(boards((10.0, 1.0), (40.4, 13.8), 2.0).put(&line));
    shapes.extend(boards((40.2, 1.0), (72.0, 6.4), 0.0).put(&line));
    shapes.extend(boards((40.0, 10.0), (57.0, 22.0), 0.0).put(&line));
    shapes.extend(boards((46.0, 28.0), (61.5, 40.0), -35.0).put(&line));
    shapes.extend(boards((54.0, 42.0), (77.0, 49.0), -30.0).put(&line));
    shapes.extend(boards((69.0, 30.0), (77.0, 41.0), 80.0).put(&line));
    for (from, to, left_m) in [(0.72, 0.97, 2.9), (0.72, 0.97, -2.9), (0.3, 0.47, 3.2), (0.26, 0.42, -3.2)] {
        let part = |share: f32| (share * line.len() as f32) as usize;
        shapes.extend(posts(&beside(&line[part(from)..part(to)], left_m), 1.5, 0.25));
    }
    Drawing {
        shapes,
        lot: "start = [18.0, 40.0, 0.0]\ngoal = [18.0, 16.0, 180.0]\nwall_height_m = 2.0\n",
        ..plain(
            "sawmill",
            "A sawmill: along the log stacks, through the saw hall and past the stacked boards.",
            (78.0, 50.0),
        )
    }
}

/// Logs side by side in stacks, their ends ragged.
fn log_stacks() -> Shapes {
    let mut shapes = Vec::new();
    for (stack, (x, y, logs)) in [
        (3.0, 33.8, 14),
        (11.4, 34.4, 18),
        (21.8, 33.6, 11),
        (28.4, 34.2, 16),
        (37.8, 33.4, 19),
        (4.0, 46.2, 20),
        (15.2, 45.8, 15),
        (24.0, 46.0, 22),
        (36.6, 45.6, 17),
        (46.4, 46.0, 12),
    ]
    .into_iter()
    .enumerate()
    {
        for i in 0..logs {
            let (shift, long) = (0.9 * (scatter(i, stack) - 0.5), 5.4 + 0.8 * scatter(i, stack + 20));
            shapes.push((turned(x + 0.5 * i as f32, y + shift, long, 0.5, 90.0), OCCUPIED));
        }
    }
    shapes
}

/// A theatre: the foyer, the cross aisle of the stalls and the scene dock.
fn theatre() -> Drawing {
    const S: (f32, f32) = (66.0, 34.0);
    let mut shapes = vec![
        (stroke(arc(S.0, S.1, 21.4, 120.0, 240.0), 25.4), FREE),
        (disc(S.0, S.1, 9.4), FREE),
        (area(66.5, 0.0, 112.0, 78.0), OCCUPIED),
    ];
    // The side walls of the fan.
    for (angle_deg, side_deg) in [(121.5, -90.0), (238.5, 90.0)] {
        let (out, aside) = (polar(0.0, 0.0, 20.0, angle_deg), polar(0.0, 0.0, 9.0, angle_deg + side_deg));
        shapes.push((turned(S.0 + out.x + aside.x, S.1 + out.y + aside.y, 44.0, 18.0, angle_deg), OCCUPIED));
    }
    shapes.extend([
        (band(&[(103.0, 8.0), (67.1, 8.0), (55.5, 14.2), (50.0, 17.0)], 8.0, 5.0), FREE),
        (band(&[(111.0, 69.6), (76.0, 69.6), (66.0, 60.0), (55.5, 53.8), (50.0, 51.0)], 9.0, 5.0), FREE),
        (area(70.0, 3.4, 103.0, 12.0), FREE),
        (area(76.0, 65.0, 111.0, 75.4), FREE),
    ]);
    // Rows of seats before and behind the cross aisle, cut by narrow steps.
    for i in 0..19 {
        let radius_m = if i < 10 { 10.0 + 1.08 * i as f32 } else { 25.2 + 1.08 * (i - 10) as f32 };
        let ragged_deg = 3.0 * scatter(i, 1);
        let edge_deg = if i < 10 { 124.0 } else { 121.0 };
        shapes.push((
            stroke(arc(S.0, S.1, radius_m, edge_deg + ragged_deg, 361.0 - edge_deg - ragged_deg), 0.55),
            OCCUPIED,
        ));
    }
    for angle_deg in [152.0, 180.0, 208.0] {
        shapes.push((radial(S, 9.0, 19.4, 1.1, angle_deg), FREE));
        shapes.push((radial(S, 25.4, 33.8, 1.1, angle_deg), FREE));
    }
    // The mixing desk, the pit with music stands.
    shapes.push((radial(S, 25.0, 28.0, 4.4, 180.0), OCCUPIED));
    shapes.extend(posts(&arc(S.0, S.1, 8.6, 124.0, 236.0), 1.2, 0.15));
    shapes.extend(posts(&arc(S.0, S.1, 6.0, 130.0, 230.0), 1.4, 0.25));
    shapes.extend(posts(&arc(S.0, S.1, 4.0, 130.0, 230.0), 1.5, 0.25));
    // Foyer: columns, cloakroom counter, benches, a bar.
    for i in 0..8 {
        let x = 72.0 + 4.4 * i as f32;
        shapes.push((disc(x, 5.0, 0.45), OCCUPIED));
        shapes.push((turned(x + 2.1, 4.6, 2.2, 0.8, 8.0 * (scatter(i, 1) - 0.5)), OCCUPIED));
    }
    shapes.extend(solid([area(74.0, 10.8, 84.0, 12.0), turned(92.0, 11.4, 8.0, 1.2, 0.0), disc(87.0, 11.2, 0.4)]));
    // Scene dock: flats leaning at the sides, a cart, rolls of cloth, a piece of a stage house.
    for i in 0..14 {
        let x = 79.0 + 2.2 * i as f32;
        if i % 5 != 3 {
            shapes.push((turned(x, 74.0, 2.6, 0.3, 60.0 + 40.0 * scatter(i, 2)), OCCUPIED));
        }
        if i % 4 != 1 {
            shapes.push((turned(x, 66.0, 1.7, 0.3, 100.0 + 50.0 * scatter(i, 3)), OCCUPIED));
        }
    }
    shapes.extend(solid([
        turned(88.0, 73.4, 3.0, 2.2, 12.0),
        turned(101.0, 66.0, 4.0, 1.4, 3.0),
        turned(106.0, 73.6, 3.4, 2.0, -8.0),
        turned(77.0, 73.6, 1.2, 3.0, 0.0),
    ]));
    Drawing {
        shapes,
        lot: "start = [84.0, 8.0, 180.0]\ngoal = [92.0, 69.6, 0.0]\nwall_height_m = 2.0\n",
        ..plain(
            "theatre",
            "A theatre: from the foyer along the curved aisle between the seats into the scene dock.",
            (112.0, 78.0),
        )
    }
}
