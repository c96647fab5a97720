//! Points, poses and frames.
//!
//! | frame | definition |
//! |---|---|
//! | world | right-handed metres, heading counter-clockwise from +x, radians |
//! | ego   | origin at the rear-axle centre on the ground; x = ahead, y = left |
//!
//! Transforms are named `target_from_source`, so that adjacent names match when they are chained.

use crate::maths;
use crate::vectors::{FourPoints, LANES, f32x4, highest, lowest};
pub use glam::Vec2;
use serde::{Deserialize, Serialize};

/// Position and heading of a body in the world frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// World x, metres.
    pub x_m: f32,
    /// World y, metres.
    pub y_m: f32,
    /// Heading, counter-clockwise from the world x axis, radians: of cars and routes in (−π, π], of obstacles as written.
    pub heading_rad: f32,
}

impl Pose {
    /// A pose at a world point.
    pub fn new(position: Vec2, heading_rad: f32) -> Self {
        Self { x_m: position.x, y_m: position.y, heading_rad }
    }

    /// Position in the world frame, metres.
    pub fn position(self) -> Vec2 {
        Vec2::new(self.x_m, self.y_m)
    }

    /// Unit vector pointing ahead, world frame.
    pub fn ahead(self) -> Vec2 {
        maths::unit(self.heading_rad)
    }

    /// The transform that takes ego coordinates (ahead, left) to world coordinates.
    pub fn world_from_ego(self) -> WorldFromEgo {
        WorldFromEgo { rotation: maths::unit(self.heading_rad), translation: self.position() }
    }

    /// The pose after `travel_m` along an arc of curvature `curvature_per_m` (exact; negative travel drives back).
    ///
    /// `x += (sin(θ+Δθ) − sin θ)/κ`, `y −= (cos(θ+Δθ) − cos θ)/κ` (docs/methods.md 2.2), written with half angles so
    /// that it stays accurate as κ → 0.
    #[must_use]
    pub fn advanced_along_arc(self, curvature_per_m: f32, travel_m: f32) -> Self {
        let (chord, heading_rad) = self.chord_of_arc(curvature_per_m, travel_m);
        Self::new(self.position() + chord, heading_rad)
    }

    /// How far [`Self::advanced_along_arc`] goes, world metres, and the heading at its end.
    pub(crate) fn chord_of_arc(self, curvature_per_m: f32, travel_m: f32) -> (Vec2, f32) {
        let half_turn = 0.5 * curvature_per_m * travel_m;
        // chord = travel · sin(Δθ/2)/(Δθ/2), along the mean heading.
        let chord_m = if half_turn.abs() < 1e-4 { travel_m } else { travel_m * maths::sin(half_turn) / half_turn };
        let direction = maths::unit(self.heading_rad + half_turn);
        (direction * chord_m, wrap_angle(self.heading_rad + 2.0 * half_turn))
    }
}

/// Rigid transform from the ego frame to the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorldFromEgo {
    /// Cosine and sine of the heading.
    pub rotation: Vec2,
    /// World position of the rear axle, metres.
    pub translation: Vec2,
}

impl WorldFromEgo {
    /// Maps a point given as (ahead, left) to the world.
    #[inline]
    pub fn point(&self, in_ego: Vec2) -> Vec2 {
        self.translation + self.rotation.rotate(in_ego)
    }

    /// [`Self::point`] of four points, to the bit.
    #[inline]
    pub fn four_points(&self, in_ego: FourPoints) -> FourPoints {
        let FourPoints { x: cos, y: sin } = FourPoints::splat(self.rotation);
        let rotated = FourPoints { x: cos * in_ego.x - sin * in_ego.y, y: sin * in_ego.x + cos * in_ego.y };
        FourPoints::splat(self.translation) + rotated
    }

    /// [`Self::inverse_point`] of four points, to the bit.
    #[inline]
    pub fn inverse_four_points(&self, in_world: FourPoints) -> FourPoints {
        let FourPoints { x: cos, y: sin } = FourPoints::splat(self.rotation);
        let FourPoints { x, y } = in_world - FourPoints::splat(self.translation);
        FourPoints { x: cos * x + sin * y, y: cos * y - sin * x }
    }

    /// Maps a world point to (ahead, left).
    #[inline]
    pub fn inverse_point(&self, in_world: Vec2) -> Vec2 {
        Vec2::new(self.rotation.x, -self.rotation.y).rotate(in_world - self.translation)
    }

    /// [`Self::inverse_point`] of every corner.
    #[inline]
    pub(crate) fn inverse_outline(&self, in_world: &Outline) -> Outline {
        let corners = in_world.corners.map(|corners| self.inverse_four_points(corners));
        Outline { corners, ..*in_world }
    }
}

/// Corners an [`Outline`] may have: an octagon that a line cuts has nine.
const CORNERS: usize = 12;

/// A polygon of 1 to 12 corners, in vectors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Outline {
    /// Unused corners repeat the last one.
    corners: [FourPoints; CORNERS / LANES],
    n_corners: usize,
}

impl Outline {
    /// Number of its corners.
    pub(crate) fn n_corners(&self) -> usize {
        self.n_corners
    }

    /// One of its corners.
    #[inline]
    pub(crate) fn corner(&self, index: usize) -> Vec2 {
        let FourPoints { x, y } = &self.corners[index / LANES];
        Vec2::new(x.as_array()[index % LANES], y.as_array()[index % LANES])
    }

    /// Each corner moved by the same vector.
    #[inline]
    #[must_use]
    pub(crate) fn moved(&self, by: Vec2) -> Self {
        Self { corners: self.corners.map(|corners| corners + FourPoints::splat(by)), ..*self }
    }

    /// Smallest axis-aligned box around it: lowest and highest coordinates.
    #[inline]
    pub(crate) fn bounds(&self) -> (Vec2, Vec2) {
        let [a, b, c] = self.corners;
        let low = |a: f32x4, b: f32x4, c: f32x4| lowest(a.fast_min(b).fast_min(c));
        let high = |a: f32x4, b: f32x4, c: f32x4| highest(a.fast_max(b).fast_max(c));
        (Vec2::new(low(a.x, b.x, c.x), low(a.y, b.y, c.y)), Vec2::new(high(a.x, b.x, c.x), high(a.y, b.y, c.y)))
    }
}

impl FromIterator<Vec2> for Outline {
    /// # Panics
    /// If there are no corners or more than 12.
    fn from_iter<T: IntoIterator<Item = Vec2>>(corners: T) -> Self {
        let (mut all, mut n_corners) = ([Vec2::ZERO; CORNERS], 0);
        for corner in corners {
            assert!(n_corners < CORNERS, "an outline of more than {CORNERS} corners");
            all[n_corners] = corner;
            n_corners += 1;
        }
        assert!(n_corners > 0, "an outline without corners");
        let four = |i: usize| FourPoints::up_to_four(&all[(i * LANES).min(n_corners - 1)..n_corners]);
        Self { corners: std::array::from_fn(four), n_corners }
    }
}

/// Many circles, tested four at a time. Circles that follow each other should lie near each other: circles around four of
/// them are tested first.
#[derive(Debug, Clone, Default)]
pub struct Circles {
    circles: Vec<FourCircles>,
    around_four: Vec<FourCircles>,
}

#[derive(Debug, Clone, Copy)]
struct FourCircles {
    centres: FourPoints,
    radii_m: f32x4,
}

impl FourCircles {
    /// What fills up the last four overlaps nothing.
    fn new(circles: &[(Vec2, f32)]) -> Self {
        let circle = |i: usize| *circles.get(i).unwrap_or(&(Vec2::INFINITY, 0.0));
        Self {
            centres: std::array::from_fn(|i| circle(i).0).into(),
            radii_m: std::array::from_fn(|i| circle(i).1).into(),
        }
    }

    /// Those that overlap a circle, bit = lane.
    #[inline]
    fn overlapping(&self, centre: Vec2, radius_m: f32) -> u32 {
        let FourPoints { x, y } = self.centres - FourPoints::splat(centre);
        let reach_m = f32x4::splat(radius_m) + self.radii_m;
        (x * x + y * y).simd_lt(reach_m * reach_m).to_bitmask()
    }
}

impl Circles {
    /// Indices of the circles that overlap a circle, lowest first.
    pub fn overlapping(&self, centre: Vec2, radius_m: f32) -> impl Iterator<Item = usize> + '_ {
        let indices = move |circles: &[FourCircles], i: usize| {
            bits(circles[i].overlapping(centre, radius_m)).map(move |lane| i * LANES + lane)
        };
        let fours = (0..self.around_four.len()).flat_map(move |i| indices(&self.around_four, i));
        fours.flat_map(move |i| indices(&self.circles, i))
    }
}

impl FromIterator<(Vec2, f32)> for Circles {
    /// Circles as (centre, radius in metres).
    fn from_iter<T: IntoIterator<Item = (Vec2, f32)>>(circles: T) -> Self {
        let circles: Vec<(Vec2, f32)> = circles.into_iter().collect();
        let around_four: Vec<(Vec2, f32)> = circles.chunks(LANES).map(around).collect();
        let fours = |circles: &[(Vec2, f32)]| circles.chunks(LANES).map(FourCircles::new).collect();
        Self { circles: fours(&circles), around_four: fours(&around_four) }
    }
}

/// A circle around circles, given and returned as (centre, radius in metres).
fn around(circles: &[(Vec2, f32)]) -> (Vec2, f32) {
    /// A generous bound of rounding in single precision, metres.
    const ROUNDING_M: f32 = 1e-3;
    let middle = circles.iter().map(|&(centre, _)| centre).sum::<Vec2>() / circles.len() as f32;
    let reach_m = circles.iter().map(|&(centre, radius_m)| centre.distance(middle) + radius_m).fold(0.0, f32::max);
    (middle, reach_m + ROUNDING_M)
}

/// Indices of the set bits, lowest first.
#[inline]
pub(crate) fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then(|| mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        bit
    })
}

/// Wraps an angle to (−π, π].
pub fn wrap_angle(angle_rad: f32) -> f32 {
    use std::f32::consts::{PI, TAU};
    let wrapped = angle_rad.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

/// Area of a closed polygon without crossings, m²: positive if its vertices go round it counter-clockwise.
pub fn signed_area_m2(polygon: &[Vec2]) -> f32 {
    // Seen from its first vertex: far from the origin the products would leave nothing of a small area.
    let from = polygon.first().copied().unwrap_or_default();
    0.5 * edges(polygon).map(|(a, b)| (a - from).perp_dot(b - from)).sum::<f32>()
}

/// Even-odd test of a point against a closed polygon (the last vertex joins the first).
pub fn polygon_contains(polygon: &[Vec2], point: Vec2) -> bool {
    let mut inside = false;
    for (a, b) in edges(polygon) {
        if (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x) {
            inside = !inside;
        }
    }
    inside
}

/// Smallest axis-aligned box around points: its lower left and upper right corners.
pub fn bounds(points: &[Vec2]) -> (Vec2, Vec2) {
    points.iter().fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), &point| (low.min(point), high.max(point)))
}

/// The edges of a closed polygon, the last joining its last vertex to its first.
pub fn edges(polygon: &[Vec2]) -> impl Iterator<Item = (Vec2, Vec2)> + '_ {
    (0..polygon.len()).map(|i| (polygon[i], polygon[(i + 1) % polygon.len()]))
}

/// Distance from a point to a segment, metres.
pub fn distance_to_segment_m(point: Vec2, a: Vec2, b: Vec2) -> f32 {
    let ab = b - a;
    let t = ((point - a).dot(ab) / ab.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    (point - a - ab * t).length()
}

impl FourPoints {
    /// [`distance_to_segment_m`] of each, to the bit, metres.
    #[inline]
    pub(crate) fn distance_to_segment_m(self, a: Vec2, b: Vec2) -> f32x4 {
        self.squared_distance_to_segment(a, b).sqrt()
    }

    /// Square of [`Self::distance_to_segment_m`].
    #[inline]
    pub(crate) fn squared_distance_to_segment(self, a: Vec2, b: Vec2) -> f32x4 {
        let ab = b - a;
        let from_a = self - Self::splat(a);
        let along = Self::splat(ab);
        let dot = from_a.x * along.x + from_a.y * along.y;
        let share = (dot / f32x4::splat(ab.length_squared().max(f32::MIN_POSITIVE))).fast_max(f32x4::ZERO);
        let apart = from_a - along * share.fast_min(f32x4::ONE);
        apart.x * apart.x + apart.y * apart.y
    }

    /// [`polygon_contains`] of each, as a mask.
    #[inline]
    pub(crate) fn are_inside(self, polygon: &[Vec2]) -> f32x4 {
        edges(polygon).fold(f32x4::ZERO, |are_inside, (a, b)| {
            let is_across = f32x4::splat(a.y).simd_gt(self.y) ^ f32x4::splat(b.y).simd_gt(self.y);
            let crossing =
                f32x4::splat(a.x) + (self.y - f32x4::splat(a.y)) / f32x4::splat(b.y - a.y) * f32x4::splat(b.x - a.x);
            are_inside ^ (is_across & self.x.simd_lt(crossing))
        })
    }
}

/// The four corners of a rectangle, counter-clockwise from its front left corner.
pub fn rectangle(centre: Pose, length_m: f32, width_m: f32) -> [Vec2; 4] {
    let world_from_body = centre.world_from_ego();
    let (l, w) = (0.5 * length_m, 0.5 * width_m);
    [Vec2::new(l, w), Vec2::new(-l, w), Vec2::new(-l, -w), Vec2::new(l, -w)].map(|p| world_from_body.point(p))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_wrap_to_less_than_half_a_turn_and_half_a_turn_is_positive() {
        use std::f32::consts::PI;
        for (half_turns, expected) in [(0.3, 0.3), (1.0, 1.0), (-1.0, 1.0), (1.5, -0.5), (-1.5, 0.5), (-7.25, 0.75)] {
            let wrapped_rad = wrap_angle(half_turns * PI);
            assert!((wrapped_rad - expected * PI).abs() < 1e-5, "{half_turns} half turns: {wrapped_rad}");
        }
    }

    /// The sensor and its brute-force check share this culling, so only this test would see it go wrong.
    #[test]
    fn circles_that_overlap_are_all_found_and_no_others() {
        let circles: Vec<(Vec2, f32)> = (0..21)
            .map(|i| (Vec2::new((i * 7 % 13) as f32 - 6.0, (i * 5 % 11) as f32 - 5.0), 0.3 * (i % 4) as f32))
            .collect();
        let arranged: Circles = circles.iter().copied().collect();
        for (x, y, radius_m) in [(0.0, 0.0, 3.1), (-6.0, -5.0, 0.7), (4.5, 2.2, 20.0), (30.0, 0.0, 1.0)] {
            let place = Vec2::new(x, y);
            let expected: Vec<usize> =
                (0..21).filter(|&i| circles[i].0.distance(place) < radius_m + circles[i].1).collect();
            assert_eq!(arranged.overlapping(place, radius_m).collect::<Vec<_>>(), expected, "{place} {radius_m}");
        }
        assert_eq!(Circles::default().overlapping(Vec2::ZERO, 9.0).count(), 0);
    }

    /// Along a lane most blocks are skipped.
    #[test]
    fn circles_along_a_lane_are_found_from_anywhere_beside_it() {
        let circle = |i: usize| (Vec2::new(2.4 * i as f32, (i % 2) as f32), 0.2 + 0.3 * (i % 5) as f32);
        let arranged: Circles = (0..50).map(circle).collect();
        for i in 0..400 {
            let (place, radius_m) = (Vec2::new(0.31 * i as f32 - 2.0, (i % 7) as f32 - 3.0), 0.05 * (i % 60) as f32);
            let expected: Vec<usize> =
                (0..50).filter(|&i| circle(i).0.distance(place) < radius_m + circle(i).1).collect();
            assert_eq!(arranged.overlapping(place, radius_m).collect::<Vec<_>>(), expected, "{place} {radius_m}");
        }
    }

    #[test]
    fn an_outline_moves_like_its_corners() {
        let world_from_ego = Pose::new(Vec2::new(-1.5, 2.0), 2.1).world_from_ego();
        for n_corners in 3..=8 {
            let angle_rad = |i: usize| std::f32::consts::TAU * i as f32 / n_corners as f32;
            let corners = (0..n_corners).map(|i| Vec2::new(3.0, -7.0) + 2.3 * maths::unit(angle_rad(i)));
            let in_ego = world_from_ego.inverse_outline(&corners.clone().collect());
            let expected: Vec<Vec2> = corners.map(|corner| world_from_ego.inverse_point(corner)).collect();
            assert_eq!((0..in_ego.n_corners()).map(|i| in_ego.corner(i)).collect::<Vec<_>>(), expected);
            assert_eq!(in_ego.bounds(), bounds(&expected));
        }
    }

    #[test]
    fn four_points_are_each_point() {
        let frame = Pose::new(Vec2::new(3.0, -8.0), 0.7).world_from_ego();
        let polygon = [Vec2::new(-2.0, -1.0), Vec2::new(3.0, -2.0), Vec2::new(1.0, 0.5), Vec2::new(0.5, 3.0)];
        for i in 0..300 {
            let point =
                |k: usize| Vec2::new(0.031 * (i * (k + 1) % 200) as f32 - 3.0, 0.043 * (i + 7 * k) as f32 - 4.0);
            let points: [Vec2; LANES] = std::array::from_fn(point);
            let four = FourPoints::from(points);
            let (there, back) = (frame.four_points(four), frame.inverse_four_points(four));
            let to_edge_m = four.distance_to_segment_m(polygon[0], polygon[1]).to_array();
            let are_inside = four.are_inside(&polygon).to_bitmask();
            for (k, &point) in points.iter().enumerate() {
                let lane = |four: FourPoints| Vec2::new(four.x.as_array()[k], four.y.as_array()[k]);
                assert_eq!((lane(there), lane(back)), (frame.point(point), frame.inverse_point(point)));
                assert_eq!(to_edge_m[k].to_bits(), distance_to_segment_m(point, polygon[0], polygon[1]).to_bits());
                assert_eq!(are_inside >> k & 1 == 1, polygon_contains(&polygon, point), "{point}");
            }
        }
    }
}
