//! Walls and kerbs along outlines, with free ground behind them.

use crate::corridor::{hundredths, tenths, to_millimetres};
use rand::RngExt as _;
use sim::geometry::{Pose, Vec2, bounds, distance_to_segment_m, edges};
use sim::maths;
use sim::scenario::{Obstacle, ObstacleClass};
use sim::seed::Rng;

/// Longer walls are made of several, metres (obstacles are at most 30 m long).
const LENGTH_MAX_M: f32 = 25.0;
/// Walls that meet overlap by this much, metres: no gap is left by rounding.
const OVERLAP_M: f32 = 0.02;

/// What walls are made of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wall {
    class: ObstacleClass,
    thickness_m: f32,
    height_m: f32,
}

/// A gap in a wall.
#[derive(Debug, Clone, Copy)]
pub(super) struct Opening {
    /// Its middle, on the line of the wall.
    pub(super) centre: Vec2,
    pub(super) width_m: f32,
}

impl Wall {
    /// As high as a storey: hides what is behind.
    pub(super) fn tall(rng: &mut Rng) -> Self {
        Self { class: ObstacleClass::Wall, thickness_m: thickness_m(rng), height_m: 3.0 }
    }

    /// Hides little or nothing.
    pub(super) fn low(rng: &mut Rng) -> Self {
        let height_m = tenths(rng.random_range(0.3..1.0));
        Self { class: ObstacleClass::Wall, thickness_m: thickness_m(rng), height_m }
    }

    pub(super) fn kerb() -> Self {
        Self { class: ObstacleClass::Curb, thickness_m: 0.2, height_m: 0.15 }
    }

    /// Stands outside a counter-clockwise outline, its inner face on the line.
    pub(super) fn around(&self, outline: &[Vec2], openings: &[Opening]) -> Vec<Obstacle> {
        let mut walls = Vec::new();
        let sides: Vec<_> = edges(outline).collect();
        for (i, &(a, b)) in sides.iter().enumerate() {
            let (before, after) = (sides[(i + sides.len() - 1) % sides.len()], sides[(i + 1) % sides.len()]);
            let along = (b - a).normalize();
            // Outward corners are filled; where the wall bends inward its pieces overlap by themselves.
            let beyond_m = |turn_rad: f32| {
                if turn_rad > 0.0 { self.thickness_m * maths::tan(0.5 * turn_rad).min(2.0) + OVERLAP_M } else { 0.0 }
            };
            let from_m = -beyond_m((before.1 - before.0).angle_to(b - a));
            let to_m = a.distance(b) + beyond_m((b - a).angle_to(after.1 - after.0));
            let outward = -0.5 * self.thickness_m * along.perp();
            for (from_m, to_m) in closed_stretches(a, b, (from_m, to_m), openings) {
                walls.extend(self.straight(a + outward + along * from_m, a + outward + along * to_m));
            }
        }
        walls
    }

    /// A straight wall from one point to another.
    pub(super) fn straight(&self, from: Vec2, to: Vec2) -> Vec<Obstacle> {
        let along = to - from;
        let pieces = (along.length() / LENGTH_MAX_M).ceil().max(1.0);
        (0..pieces as usize)
            .map(|k| {
                let centre = to_millimetres(from + along * (k as f32 + 0.5) / pieces);
                let round = |value: f32| (value * 1000.0).round() / 1000.0;
                Obstacle {
                    length_m: Some(round(along.length() / pieces)),
                    width_m: Some(round(self.thickness_m)),
                    height_m: Some(self.height_m),
                    heading_deg: round(maths::angle_rad(along).to_degrees()),
                    ..Obstacle::new(self.class, Pose::new(centre, 0.0))
                }
            })
            .collect()
    }
}

fn thickness_m(rng: &mut Rng) -> f32 {
    hundredths(rng.random_range(0.1..0.3))
}

/// What openings leave of an edge, metres from its first point.
fn closed_stretches(a: Vec2, b: Vec2, (from_m, to_m): (f32, f32), openings: &[Opening]) -> Vec<(f32, f32)> {
    let along = (b - a).normalize();
    let mut gaps: Vec<(f32, f32)> = openings
        .iter()
        .filter(|opening| distance_to_segment_m(opening.centre, a, b) < 0.05)
        .map(|opening| {
            let at_m = (opening.centre - a).dot(along);
            (at_m - 0.5 * opening.width_m, at_m + 0.5 * opening.width_m)
        })
        .collect();
    gaps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut stretches = Vec::new();
    let mut at_m = from_m;
    for (gap_from_m, gap_to_m) in gaps {
        stretches.push((at_m, gap_from_m));
        at_m = gap_to_m;
    }
    stretches.push((at_m, to_m));
    stretches.retain(|(from_m, to_m)| to_m - from_m > 0.05);
    stretches
}

/// A rectangle of ground around an outline, with a margin of its own on every side, metres.
pub(super) fn yard(outline: &[Vec2], margin_m: std::ops::Range<f32>, rng: &mut Rng) -> Vec<Vec2> {
    let (low, high) = bounds(outline);
    let mut margin = || rng.random_range(margin_m.clone());
    let low = low - Vec2::new(margin(), margin());
    let high = high + Vec2::new(margin(), margin());
    [low, Vec2::new(high.x, low.y), high, Vec2::new(low.x, high.y)].map(to_millimetres).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::strip::{Corner, Piece, Strip};
    use sim::geometry::polygon_contains;

    const WALL: Wall = Wall { class: ObstacleClass::Wall, thickness_m: 0.1, height_m: 3.0 };

    /// A straight piece, a corner, a bend.
    fn outline() -> Vec<Vec2> {
        let width_m = 4.0;
        let corner = Corner { turn_rad: -std::f32::consts::FRAC_PI_2, chamfer_m: 1.0, stub: None };
        let pieces = [
            Piece::Straight { length_m: 30.0, width_m },
            Piece::Corner(corner),
            Piece::Straight { length_m: 20.0, width_m: 5.0 },
            Piece::Arc { radius_m: 8.0, turn_rad: 2.5, width_m: 5.0 },
            Piece::Straight { length_m: 10.0, width_m },
        ];
        Strip::new(Pose::default(), &pieces).expect("long enough for its corner").outline(0.0)
    }

    /// Points a quarter and three quarters into the wall, all along the line.
    fn points_within(outline: &[Vec2]) -> Vec<Vec2> {
        edges(outline)
            .flat_map(|(a, b)| {
                let steps = (a.distance(b) / 0.05).ceil() as usize;
                let outward = -(b - a).normalize().perp() * WALL.thickness_m;
                (0..=steps).flat_map(move |k| {
                    let on_line = a.lerp(b, k as f32 / steps as f32);
                    [on_line + 0.25 * outward, on_line + 0.75 * outward]
                })
            })
            .collect()
    }

    #[test]
    fn walls_have_no_holes_and_leave_the_ground_free() {
        let outline = outline();
        let walls: Vec<_> = WALL.around(&outline, &[]).iter().map(Obstacle::outline).collect();
        for point in points_within(&outline) {
            let is_wall = walls.iter().any(|wall| polygon_contains(wall, point));
            assert!(is_wall || polygon_contains(&outline, point), "a hole at {point}");
        }
        for corner in walls.iter().flatten() {
            let nearest_m =
                edges(&outline).map(|(a, b)| distance_to_segment_m(*corner, a, b)).fold(f32::INFINITY, f32::min);
            let reaches_in = polygon_contains(&outline, *corner) && nearest_m > 2e-3;
            assert!(!reaches_in, "a wall reaches {nearest_m} m into the ground at {corner}");
        }
    }

    #[test]
    fn an_opening_is_as_wide_as_asked_for() {
        let outline = outline();
        let door = Opening { centre: Vec2::new(15.0, 2.0), width_m: 1.2 };
        let walls: Vec<_> = WALL.around(&outline, &[door]).iter().map(Obstacle::outline).collect();
        let is_open = |x_m: f32| !walls.iter().any(|wall| polygon_contains(wall, Vec2::new(x_m, 2.05)));
        let open_m = (0..3000).filter(|&k| is_open(k as f32 * 0.01)).count() as f32 * 0.01;
        assert!((open_m - 1.2).abs() < 0.03, "{open_m} m");
        assert!(is_open(15.0) && !is_open(14.3) && !is_open(15.7));
    }
}
