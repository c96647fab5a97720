//! A strip of ground along a centre line of straight pieces, arcs and sharp corners.
//!
//! Its axis is the centre line with the corners rounded, for a car has to round them: `s` metres along the axis, `d` metres
//! to the left of it. Edges are those of the centre line as it is, sharp corners included.

use crate::corridor::{Side, segments_cross, to_millimetres};
use sim::geometry::{Pose, Vec2, bounds, edges, polygon_contains, wrap_angle};
use sim::maths;

/// Radius with which the axis rounds a sharp corner, metres.
const CORNER_RADIUS_M: f32 = 5.0;
/// An arc is drawn in chords that stray from it by this much, metres.
const SAGITTA_M: f32 = 0.02;

/// A piece of the centre line.
#[derive(Debug, Clone, Copy)]
pub(super) enum Piece {
    /// Straight on.
    Straight { length_m: f32, width_m: f32 },
    /// A bend of constant width. `turn_rad` is positive to the left.
    Arc { radius_m: f32, turn_rad: f32, width_m: f32 },
    /// A sharp corner between two straight pieces.
    Corner(Corner),
}

/// How two straight pieces meet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    /// Positive to the left, radians.
    pub(super) turn_rad: f32,
    /// How much of each inner edge is cut off, metres.
    pub(super) chamfer_m: f32,
    /// A dead end beside the way; at right angles only.
    pub(super) stub: Option<Stub>,
}

/// One of the two pieces goes on beyond a corner.
#[derive(Debug, Clone, Copy)]
pub(super) enum Stub {
    /// The piece before the corner, straight on, by so many metres.
    Ahead(f32),
    /// The piece behind the corner, to the other side, by so many metres.
    Behind(f32),
}

impl Corner {
    fn outer_side(&self) -> Side {
        if self.turn_rad > 0.0 { Side::Right } else { Side::Left }
    }

    /// What the rounding of the axis takes from each of the two pieces, metres.
    fn tangent_m(&self) -> f32 {
        CORNER_RADIUS_M * maths::tan(0.5 * self.turn_rad.abs())
    }

    /// Where an edge leaves the piece before and where it joins the piece behind, metres from the corner along each.
    fn joint_m(&self, side: Side, before_half_m: f32, after_half_m: f32, extra_m: f32) -> (f32, f32) {
        match self.stub.filter(|_| side == self.outer_side()) {
            Some(Stub::Ahead(depth_m)) => (after_half_m + depth_m, before_half_m),
            Some(Stub::Behind(depth_m)) => (-after_half_m, -before_half_m - depth_m),
            None => {
                let (sin, cos) = maths::sin_cos(self.turn_rad);
                let x_m = side.sign() * (cos * before_half_m - after_half_m) / sin;
                let along_after_m = x_m * cos + side.sign() * before_half_m * sin;
                let half_tan = maths::tan(0.5 * self.turn_rad.abs());
                // Edges that are moved outward by `extra_m` cut off less.
                let spared_m = extra_m * (half_tan - maths::tan(0.25 * self.turn_rad.abs()));
                let chamfer_m = if side == self.outer_side() { 0.0 } else { (self.chamfer_m - spared_m).max(0.0) };
                (x_m - chamfer_m, along_after_m + chamfer_m)
            }
        }
    }
}

/// A recess of the edge of a straight piece, or something that juts out of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Notch {
    /// Which edge.
    pub(super) side: Side,
    /// Along the axis, metres.
    pub(super) from_m: f32,
    /// Along the axis, metres.
    pub(super) to_m: f32,
    /// Positive outward, metres.
    pub(super) depth_m: f32,
}

/// Where a deep notch or a stub leaves the strip.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mouth {
    /// One end; out of the strip is to the right of the way from here to the other.
    pub(super) a: Vec2,
    /// The other end.
    pub(super) b: Vec2,
    /// How far the ground goes on behind it, metres.
    pub(super) depth_m: f32,
}

impl Mouth {
    /// The direction out of the strip, of unit length.
    pub(super) fn outward(&self) -> Vec2 {
        -(self.b - self.a).normalize().perp()
    }
}

/// A piece in the world.
#[derive(Debug, Clone)]
struct Leg {
    /// Start of the piece on the centre line, corners not rounded.
    start: Pose,
    length_m: f32,
    /// 0 if straight, 1/m, positive to the left.
    curvature_per_m: f32,
    half_width_m: f32,
    corner_after: Option<Corner>,
    /// `s` is `axis_offset_m` plus the distance from `start`.
    axis_offset_m: f32,
}

/// A piece of the axis.
#[derive(Debug, Clone, Copy)]
struct Span {
    start: Pose,
    curvature_per_m: f32,
    from_m: f32,
    half_width_m: f32,
    is_corner: bool,
}

/// See the [module](self).
#[derive(Debug, Clone)]
pub(super) struct Strip {
    legs: Vec<Leg>,
    spans: Vec<Span>,
    length_m: f32,
    /// The notches of both edges.
    pub(super) notches: Vec<Notch>,
}

impl Strip {
    /// Lays pieces one behind the other from a pose on; `None` if a straight piece is too short for its corners.
    pub(super) fn new(start: Pose, pieces: &[Piece]) -> Option<Self> {
        let mut strip = Self { legs: Vec::new(), spans: Vec::new(), length_m: 0.0, notches: Vec::new() };
        let mut pose = start;
        let mut cut_m = 0.0;
        for (i, piece) in pieces.iter().enumerate() {
            match *piece {
                Piece::Straight { length_m, width_m } => {
                    let corner_after = pieces.get(i + 1).and_then(|next| match next {
                        Piece::Corner(corner) => Some(*corner),
                        Piece::Straight { .. } | Piece::Arc { .. } => None,
                    });
                    let kept_m = length_m - cut_m - corner_after.map_or(0.0, |corner| corner.tangent_m());
                    if kept_m <= 0.0 {
                        return None;
                    }
                    let axis_offset_m = strip.length_m - cut_m;
                    strip.add_leg(pose, 0.0, length_m, width_m, corner_after, axis_offset_m);
                    strip.add_span(pose.advanced_along_arc(0.0, cut_m), 0.0, kept_m, 0.5 * width_m, false);
                    pose = pose.advanced_along_arc(0.0, length_m);
                    cut_m = 0.0;
                }
                Piece::Arc { radius_m, turn_rad, width_m } => {
                    let (curvature_per_m, length_m) = (turn_rad.signum() / radius_m, radius_m * turn_rad.abs());
                    strip.add_leg(pose, curvature_per_m, length_m, width_m, None, strip.length_m);
                    strip.add_span(pose, curvature_per_m, length_m, 0.5 * width_m, false);
                    pose = pose.advanced_along_arc(curvature_per_m, length_m);
                }
                Piece::Corner(corner) => {
                    cut_m = corner.tangent_m();
                    let half_width_m = strip.spans.last()?.half_width_m;
                    let from = pose.advanced_along_arc(0.0, -cut_m);
                    let curvature_per_m = corner.turn_rad.signum() / CORNER_RADIUS_M;
                    strip.add_span(from, curvature_per_m, CORNER_RADIUS_M * corner.turn_rad.abs(), half_width_m, true);
                    pose = Pose::new(pose.position(), wrap_angle(pose.heading_rad + corner.turn_rad));
                }
            }
        }
        Some(strip)
    }

    fn add_leg(
        &mut self,
        start: Pose,
        curvature_per_m: f32,
        length_m: f32,
        width_m: f32,
        corner_after: Option<Corner>,
        axis_offset_m: f32,
    ) {
        let half_width_m = 0.5 * width_m;
        self.legs.push(Leg { start, length_m, curvature_per_m, half_width_m, corner_after, axis_offset_m });
    }

    fn add_span(&mut self, start: Pose, curvature_per_m: f32, length_m: f32, half_width_m: f32, is_corner: bool) {
        self.spans.push(Span { start, curvature_per_m, from_m: self.length_m, half_width_m, is_corner });
        self.length_m += length_m;
    }

    /// Length of the axis, metres.
    pub(super) fn length_m(&self) -> f32 {
        self.length_m
    }

    fn span(&self, s_m: f32) -> usize {
        self.spans.partition_point(|span| span.from_m <= s_m).max(1) - 1
    }

    fn span_end_m(&self, index: usize) -> f32 {
        self.spans.get(index + 1).map_or(self.length_m, |next| next.from_m)
    }

    /// The pose on the axis, headed along it.
    pub(super) fn pose(&self, s_m: f32) -> Pose {
        let span = self.spans[self.span(s_m)];
        span.start.advanced_along_arc(span.curvature_per_m, s_m - span.from_m)
    }

    /// World point of `s` and `d`.
    pub(super) fn point(&self, s_m: f32, d_m: f32) -> Vec2 {
        self.pose(s_m).world_from_ego().point(Vec2::new(0.0, d_m))
    }

    /// `s` and `d` of a point that is at most a few metres away from `s_m` along the axis.
    pub(super) fn local(&self, point: Vec2, near_m: f32) -> Vec2 {
        let mut s_m = near_m;
        let mut in_frame = Vec2::ZERO;
        for _ in 0..5 {
            in_frame = self.pose(s_m).world_from_ego().inverse_point(point);
            s_m += in_frame.x;
        }
        Vec2::new(s_m, in_frame.y)
    }

    /// Curvature of the axis, 1/m.
    pub(super) fn curvature_per_m(&self, s_m: f32) -> f32 {
        self.spans[self.span(s_m)].curvature_per_m
    }

    /// Half of the width, notches left out, metres.
    pub(super) fn half_width_m(&self, s_m: f32) -> f32 {
        self.spans[self.span(s_m)].half_width_m
    }

    /// Whether the axis rounds a sharp corner within a distance.
    pub(super) fn is_near_corner(&self, from_m: f32, to_m: f32, distance_m: f32) -> bool {
        self.spans.iter().enumerate().any(|(i, span)| {
            span.is_corner && span.from_m - distance_m < to_m && from_m < self.span_end_m(i) + distance_m
        })
    }

    /// Straight stretches of the axis, `s` in metres.
    pub(super) fn straights(&self) -> Vec<(f32, f32)> {
        let is_straight = |&(_, span): &(usize, &Span)| span.curvature_per_m == 0.0;
        self.spans.iter().enumerate().filter(is_straight).map(|(i, span)| (span.from_m, self.span_end_m(i))).collect()
    }

    /// Outline of the strip, counter-clockwise, its edges moved outward by `extra_m`.
    pub(super) fn outline(&self, extra_m: f32) -> Vec<Vec2> {
        let mut outline = self.edge(Side::Right, extra_m);
        outline.extend(self.edge(Side::Left, extra_m).into_iter().rev());
        without_doubles(outline)
    }

    /// One edge from the first piece to the last, moved outward by `extra_m`; notches that are no deeper vanish.
    pub(super) fn edge(&self, side: Side, extra_m: f32) -> Vec<Vec2> {
        let mut points = Vec::new();
        let mut from_m = 0.0;
        for (i, leg) in self.legs.iter().enumerate() {
            let half_m = leg.half_width_m + extra_m;
            let d_m = side.sign() * half_m;
            let frame = leg.start.world_from_ego();
            let next = self.legs.get(i + 1);
            let joint = leg.corner_after.zip(next).map(|(corner, next)| {
                let (end_m, start_m) = corner.joint_m(side, half_m, next.half_width_m + extra_m, extra_m);
                (corner, leg.length_m + end_m, start_m)
            });
            if leg.curvature_per_m != 0.0 {
                points.extend(leg.arc().map(|pose| pose.world_from_ego().point(Vec2::new(0.0, d_m))));
                continue;
            }
            let to_m = joint.map_or(leg.length_m, |(_, end_m, _)| end_m);
            points.push(frame.point(Vec2::new(from_m, d_m)));
            for notch in self.notches_of(leg, side).filter(|notch| notch.depth_m > extra_m || extra_m == 0.0) {
                let (start_m, end_m) =
                    (notch.from_m - leg.axis_offset_m - extra_m, notch.to_m - leg.axis_offset_m + extra_m);
                let deep_m = d_m + side.sign() * notch.depth_m;
                let corners = [(start_m, d_m), (start_m, deep_m), (end_m, deep_m), (end_m, d_m)];
                points.extend(corners.map(|(x_m, y_m)| frame.point(Vec2::new(x_m, y_m))));
            }
            points.push(frame.point(Vec2::new(to_m, d_m)));
            from_m = 0.0;
            if let Some((corner, end_m, start_m)) = joint {
                from_m = start_m;
                match corner.stub.filter(|_| side == corner.outer_side()) {
                    Some(Stub::Ahead(_)) => points.push(frame.point(Vec2::new(end_m, -d_m))),
                    Some(Stub::Behind(depth_m)) => {
                        points.push(frame.point(Vec2::new(end_m, d_m + side.sign() * depth_m)));
                    }
                    None => {}
                }
            }
        }
        without_doubles(points.into_iter().map(to_millimetres).collect())
    }

    /// The notches of a leg on one side, in the order of the edge.
    fn notches_of(&self, leg: &Leg, side: Side) -> impl Iterator<Item = Notch> {
        let on_axis = leg.axis_offset_m..leg.axis_offset_m + leg.length_m;
        let is_of = move |notch: &Notch| notch.side == side && on_axis.contains(&(0.5 * (notch.from_m + notch.to_m)));
        let mut notches: Vec<Notch> = self.notches.iter().copied().filter(is_of).collect();
        notches.sort_by(|a, b| a.from_m.total_cmp(&b.from_m));
        notches.into_iter()
    }

    /// Mouth of a notch.
    pub(super) fn mouth(&self, notch: &Notch) -> Mouth {
        let d_m = notch.side.sign() * self.half_width_m(0.5 * (notch.from_m + notch.to_m));
        let (from, to) = (self.point(notch.from_m, d_m), self.point(notch.to_m, d_m));
        let (a, b) = if notch.side == Side::Left { (to, from) } else { (from, to) };
        Mouth { a, b, depth_m: notch.depth_m }
    }

    /// Mouths of the stubs.
    pub(super) fn stub_mouths(&self) -> Vec<Mouth> {
        let pairs = self.legs.iter().zip(self.legs.iter().skip(1));
        let mouth = |(leg, next): (&Leg, &Leg)| {
            let corner = leg.corner_after?;
            let (half_m, next_half_m) = (leg.half_width_m, next.half_width_m);
            let d_m = corner.outer_side().sign() * half_m;
            let (depth_m, ends) = match corner.stub? {
                Stub::Ahead(depth_m) => (depth_m, [(next_half_m, -half_m), (next_half_m, half_m)]),
                // Its left and right end as seen from the strip.
                Stub::Behind(depth_m) => {
                    (depth_m, [(next_half_m.copysign(d_m), d_m), (-next_half_m.copysign(d_m), d_m)])
                }
            };
            let frame = leg.start.world_from_ego();
            let [a, b] = ends.map(|(x_m, y_m)| frame.point(Vec2::new(leg.length_m + x_m, y_m)));
            Some(Mouth { a, b, depth_m })
        };
        pairs.filter_map(mouth).collect()
    }

    /// Whether the strip keeps apart from itself by twice a distance.
    pub(super) fn keeps_apart(&self, distance_m: f32) -> bool {
        is_simple(&self.outline(0.0)) && is_simple(&self.outline(distance_m))
    }
}

impl Leg {
    fn arc(&self) -> impl Iterator<Item = Pose> {
        let chord_m = (8.0 * SAGITTA_M / self.curvature_per_m.abs()).sqrt();
        let chords = (self.length_m / chord_m).ceil().max(1.0) as usize;
        (0..=chords)
            .map(move |k| self.start.advanced_along_arc(self.curvature_per_m, self.length_m * k as f32 / chords as f32))
    }
}

/// Without points that repeat the one before.
fn without_doubles(mut points: Vec<Vec2>) -> Vec<Vec2> {
    const SAME_M: f32 = 0.02;
    points.dedup_by(|b, a| a.distance(*b) < SAME_M);
    while points.len() > 1 && points[0].distance(points[points.len() - 1]) < SAME_M {
        points.pop();
    }
    points
}

/// A point of a polyline by its distance from the beginning, clamped.
pub(super) fn point_at(line: &[Vec2], at_m: f32) -> Vec2 {
    let mut left_m = at_m.max(0.0);
    for pair in line.windows(2) {
        let length_m = pair[0].distance(pair[1]);
        if left_m <= length_m {
            return pair[0].lerp(pair[1], left_m / length_m);
        }
        left_m -= length_m;
    }
    line[line.len() - 1]
}

/// Length of a polyline, metres.
pub(super) fn line_length_m(line: &[Vec2]) -> f32 {
    line.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
}

/// Whether a thing is on ground with an outline, wholly or in part.
pub(super) fn is_on(ground: &[Vec2], thing: &[Vec2]) -> bool {
    edges(ground).any(|(c, d)| edges(thing).any(|(e, f)| segments_cross(c, d, e, f)))
        || polygon_contains(ground, thing[0])
}

/// Whether no two edges of a closed polygon cross.
pub(super) fn is_simple(polygon: &[Vec2]) -> bool {
    let sides: Vec<_> = edges(polygon).map(|(a, b)| (a, b, bounds(&[a, b]))).collect();
    let count = sides.len();
    (0..count).all(|i| {
        let (a, b, (low, high)) = sides[i];
        let last = if i == 0 { count - 1 } else { count };
        (i + 2..last).all(|j| {
            let (c, d, (other_low, other_high)) = sides[j];
            let is_apart = low.cmpgt(other_high).any() || other_low.cmpgt(high).any();
            is_apart || !segments_cross(a, b, c, d)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_2;

    fn straight(length_m: f32, width_m: f32) -> Piece {
        Piece::Straight { length_m, width_m }
    }

    fn corner(chamfer_m: f32, stub: Option<Stub>) -> Piece {
        Piece::Corner(Corner { turn_rad: FRAC_PI_2, chamfer_m, stub })
    }

    fn strip(pieces: &[Piece]) -> Strip {
        Strip::new(Pose::default(), pieces).expect("long enough for its corners")
    }

    fn outline(pieces: &[Piece]) -> Vec<(f32, f32)> {
        strip(pieces).outline(0.0).into_iter().map(|p| (p.x, p.y)).collect()
    }

    /// An L to the left of a 4 m and a 6 m corridor, in closed form.
    #[test]
    fn corridors_of_different_widths_meet_in_a_corner() {
        let ell = [(0.0, -2.0), (23.0, -2.0), (23.0, 20.0), (17.0, 20.0), (17.0, 2.0), (0.0, 2.0)];
        assert_eq!(outline(&[straight(20.0, 4.0), corner(0.0, None), straight(20.0, 6.0)]), ell);
        let cut = [(0.0, -2.0), (23.0, -2.0), (23.0, 20.0), (17.0, 20.0), (17.0, 3.0), (16.0, 2.0), (0.0, 2.0)];
        assert_eq!(outline(&[straight(20.0, 4.0), corner(1.0, None), straight(20.0, 6.0)]), cut);
    }

    #[test]
    fn stubs_go_on_beyond_a_corner() {
        let ahead = outline(&[straight(20.0, 4.0), corner(0.0, Some(Stub::Ahead(5.0))), straight(20.0, 6.0)]);
        assert_eq!(ahead[1..4], [(28.0, -2.0), (28.0, 2.0), (23.0, 2.0)]);
        let behind = outline(&[straight(20.0, 4.0), corner(0.0, Some(Stub::Behind(5.0))), straight(20.0, 6.0)]);
        assert_eq!(behind[1..5], [(17.0, -2.0), (17.0, -7.0), (23.0, -7.0), (23.0, 20.0)]);
    }

    #[test]
    fn a_notch_is_cut_into_its_edge() {
        let mut strip = strip(&[straight(20.0, 4.0)]);
        strip.notches.push(Notch { side: Side::Left, from_m: 8.0, to_m: 10.0, depth_m: 1.0 });
        let left: Vec<_> = strip.edge(Side::Left, 0.0).into_iter().map(|p| (p.x, p.y)).collect();
        assert_eq!(left, [(0.0, 2.0), (8.0, 2.0), (8.0, 3.0), (10.0, 3.0), (10.0, 2.0), (20.0, 2.0)]);
        assert_eq!(strip.edge(Side::Left, 1.5).len(), 2, "too shallow to show in an edge moved by 1.5 m");
    }

    #[test]
    fn a_bend_keeps_its_width() {
        let bend = Piece::Arc { radius_m: 9.0, turn_rad: -2.0, width_m: 3.0 };
        let strip = strip(&[straight(5.0, 3.0), bend, straight(5.0, 3.0)]);
        let centre = Vec2::new(5.0, -9.0);
        for (side, radius_m) in [(Side::Left, 10.5), (Side::Right, 7.5)] {
            let edge = strip.edge(side, 0.0);
            let on_arc = &edge[1..edge.len() - 1];
            assert!(
                on_arc.len() > 10 && on_arc.iter().all(|p| (p.distance(centre) - radius_m).abs() < 2e-3),
                "{edge:?}"
            );
        }
    }

    /// The axis rounds corners; places are found again by `s` and `d` on every piece.
    #[test]
    fn the_axis_is_smooth_and_local_is_the_inverse_of_point() {
        let bend = Piece::Arc { radius_m: 9.0, turn_rad: 2.0, width_m: 3.0 };
        let strip = strip(&[straight(20.0, 4.0), corner(0.0, None), straight(20.0, 6.0), bend]);
        assert!((strip.length_m() - (15.0 + 2.5 * std::f32::consts::PI + 15.0 + 18.0)).abs() < 1e-3);
        let mut before = strip.pose(0.0);
        for k in 1..600 {
            let s_m = k as f32 * 0.09;
            let pose = strip.pose(s_m);
            assert!(wrap_angle(pose.heading_rad - before.heading_rad).abs() < 0.02, "a kink at {s_m} m");
            for d_m in [-1.5, 0.0, 1.5] {
                let at = strip.local(strip.point(s_m, d_m), s_m + 1.0);
                assert!(at.distance(Vec2::new(s_m, d_m)) < 5e-3, "{at} instead of {s_m}, {d_m}");
            }
            before = pose;
        }
    }

    #[test]
    fn a_strip_that_meets_itself_is_told() {
        let bend = |turn_rad| Piece::Arc { radius_m: 6.0, turn_rad, width_m: 4.0 };
        let back = strip(&[straight(20.0, 4.0), bend(std::f32::consts::PI), straight(20.0, 4.0)]);
        assert!(back.keeps_apart(3.9) && !back.keeps_apart(4.1), "8 m of ground are between its edges");
        let round = strip(&[straight(20.0, 4.0), bend(4.5), straight(20.0, 4.0)]);
        assert!(!round.keeps_apart(0.1));
    }
}
