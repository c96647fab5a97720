//! A lot without intersections: straight legs and corners, one lane whose width changes along the way.
//!
//! Everything is described in leg coordinates: `s` metres along a leg from its first vertex, `d` metres to the left of
//! its axis. The lane's two edges are piecewise linear functions of `s`; the boundary polygon and every question about
//! gaps are answered from the same breakpoints, so they cannot disagree.

use sim::geometry::{Pose, Vec2, bounds, edges, polygon_contains, rectangle};
use sim::maths;
use sim::scenario::ReferencePath;

/// Longest piece of a curve that is drawn as a straight line, metres.
const CURVE_STEP_M: f32 = 1.0;
/// Length over which the lane goes from one width to the next, metres.
const WIDTH_RAMP_M: f32 = 3.0;
/// Chords per right angle of a rounded inner corner (3 m radius: 4 cm inside the arc).
const CHORDS_PER_RIGHT_ANGLE: f32 = 6.0;

/// Depth and width of a right-angle stall, metres (Seoul 1990, docs/methods.md 11).
pub const STALL_DEPTH_M: f32 = 5.0;
/// See [`STALL_DEPTH_M`].
pub const STALL_WIDTH_M: f32 = 2.3;

/// A side of the lane, seen in the direction of the route.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Positive `d`.
    Left,
    /// Negative `d`.
    Right,
}

impl Side {
    /// Left first.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// +1 for left, −1 for right: the sign of `d` and of a turn towards this side.
    pub fn sign(self) -> f32 {
        match self {
            Self::Left => 1.0,
            Self::Right => -1.0,
        }
    }

    /// The other one.
    #[must_use]
    pub fn opposite(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }
}

/// What a corridor is drawn from.
#[derive(Debug, Clone)]
pub struct Blueprint {
    /// Straight pieces in driving order; one more than there are corners.
    pub legs: Vec<LegPlan>,
    /// Corners between them.
    pub corners: Vec<CornerPlan>,
    /// Radius of the reference path at corners, metres.
    pub path_radius_m: f32,
    /// Length of straight lane before the start and behind the finish, metres, so that no wall is close there.
    pub run_out_m: f32,
}

/// One straight piece.
#[derive(Debug, Clone)]
pub struct LegPlan {
    /// Length from vertex to vertex (start and finish count as vertices), metres.
    pub length_m: f32,
    /// Lane widths, each valid from its `from_m` on; the first one also before it. Ascending.
    pub widths: Vec<WidthStep>,
    /// At most one sideways bow of the whole lane.
    pub bulge: Option<Bulge>,
    /// Mouths of side branches.
    pub branches: Vec<Branch>,
}

/// The lane width from a place on.
#[derive(Debug, Clone, Copy)]
pub struct WidthStep {
    /// Metres along the leg.
    pub from_m: f32,
    /// Metres.
    pub width_m: f32,
}

/// A raised-cosine bow: the lane leaves its axis and comes back.
#[derive(Debug, Clone, Copy)]
pub struct Bulge {
    /// Where it is widest, metres along the leg.
    pub centre_m: f32,
    /// Largest sideways offset, metres, positive to the left.
    pub offset_m: f32,
    /// Over which length, metres.
    pub length_m: f32,
}

/// A stub of a crossing aisle; its mouth is closed by cones, see [`crate::clutter`].
#[derive(Debug, Clone, Copy)]
pub struct Branch {
    /// Which side it leaves to.
    pub side: Side,
    /// Centre of its mouth, metres along the leg.
    pub centre_m: f32,
    /// Width of the mouth, metres.
    pub width_m: f32,
    /// How deep the drivable stub is, metres.
    pub depth_m: f32,
}

/// A corner between two legs.
#[derive(Debug, Clone, Copy)]
pub struct CornerPlan {
    /// Positive to the left, radians.
    pub turn_rad: f32,
    /// Lane width at the corner, metres.
    pub width_m: f32,
    /// The lane has that width at least this far from the vertex, metres.
    pub reach_m: f32,
    /// Length over which it then narrows to the lane, metres.
    pub taper_m: f32,
    /// Radius of the inner edge, metres; the outer edge stays sharp.
    pub inner_radius_m: f32,
}

impl CornerPlan {
    /// The right-angled corner of the reference lots (docs/methods.md E3).
    pub fn right_angle(side: Side) -> Self {
        Self {
            turn_rad: side.sign() * std::f32::consts::FRAC_PI_2,
            width_m: 6.0,
            reach_m: 5.0,
            taper_m: 5.0,
            inner_radius_m: 3.0,
        }
    }

    /// The side the route turns to.
    pub fn inner_side(&self) -> Side {
        if self.turn_rad > 0.0 { Side::Left } else { Side::Right }
    }

    /// Distance from the vertex to the foot of the inner rounding, metres.
    fn inner_reach_m(&self) -> f32 {
        (0.5 * self.width_m + self.inner_radius_m) * maths::tan(0.5 * self.turn_rad.abs())
    }

    /// Distance from the vertex to where the lane has its own width again, on either side, metres.
    pub fn extent_m(&self) -> f32 {
        self.reach_m.max(self.inner_reach_m()) + self.taper_m
    }
}

/// A straight piece in the world, with its two lane edges.
#[derive(Debug, Clone)]
pub struct Leg {
    /// First vertex, heading along the leg.
    pub origin: Pose,
    /// Length from vertex to vertex, metres.
    pub length_m: f32,
    /// Where the straight lane begins and ends behind corner widenings, metres along the leg (includes the run-outs).
    pub lane_from_m: f32,
    /// See [`Self::lane_from_m`].
    pub lane_to_m: f32,
    left: Vec<Vec2>,
    right: Vec<Vec2>,
    bulge: Option<Bulge>,
    branches: Vec<Branch>,
}

impl Leg {
    /// World point of leg coordinates.
    pub fn world(&self, s_m: f32, d_m: f32) -> Vec2 {
        self.origin.world_from_ego().point(Vec2::new(s_m, d_m))
    }

    /// Leg coordinates of a world point.
    pub fn local(&self, point: Vec2) -> Vec2 {
        self.origin.world_from_ego().inverse_point(point)
    }

    /// `d` of a lane edge, metres.
    pub fn edge_m(&self, side: Side, s_m: f32) -> f32 {
        interpolated_m(self.profile(side), s_m)
    }

    /// Breakpoints `(s, d)` of a lane edge.
    pub fn profile(&self, side: Side) -> &[Vec2] {
        match side {
            Side::Left => &self.left,
            Side::Right => &self.right,
        }
    }

    /// Width of the lane, metres.
    pub fn width_m(&self, s_m: f32) -> f32 {
        self.edge_m(Side::Left, s_m) - self.edge_m(Side::Right, s_m)
    }

    /// `d` of the middle of the lane, metres.
    pub fn centre_m(&self, s_m: f32) -> f32 {
        0.5 * (self.edge_m(Side::Left, s_m) + self.edge_m(Side::Right, s_m))
    }

    /// Side branches of this leg.
    pub fn branches(&self) -> &[Branch] {
        &self.branches
    }
}

/// A lot: legs in the world, boundary and route.
#[derive(Debug, Clone)]
pub struct Corridor {
    /// The legs in driving order.
    pub legs: Vec<Leg>,
    /// The corners between them.
    pub corners: Vec<CornerPlan>,
    /// Outline of the drivable ground, counter-clockwise.
    pub boundary: Vec<Vec2>,
    /// Route of the rear axle along the middle of the lane.
    pub reference_path: ReferencePath,
    boundary_edges: EdgeList,
}

/// A parking place.
#[derive(Debug, Clone, Copy)]
pub struct Stall {
    /// Index of the leg it lies at.
    pub leg: usize,
    /// Side of the lane.
    pub side: Side,
    /// Middle of its front, metres along the leg.
    pub centre_m: f32,
    /// `d` of its front line, metres: the outermost edge of the lane along the stall.
    pub front_m: f32,
}

impl Corridor {
    /// Draws a blueprint, the first leg along world +x from the origin.
    ///
    /// # Panics
    /// When there is not exactly one corner between two legs, or a leg is too short for the corners at its ends.
    pub fn draw(blueprint: &Blueprint) -> Self {
        assert_eq!(blueprint.legs.len(), blueprint.corners.len() + 1, "one corner between two legs");
        let mut legs = Vec::with_capacity(blueprint.legs.len());
        let mut origin = Pose::default();
        for (i, plan) in blueprint.legs.iter().enumerate() {
            let before = i.checked_sub(1).map(|before| blueprint.corners[before]);
            let after = blueprint.corners.get(i).copied();
            legs.push(draw_leg(plan, origin, before, after, blueprint.run_out_m));
            let end = origin.world_from_ego().point(Vec2::new(plan.length_m, 0.0));
            let turn_rad = after.map_or(0.0, |corner| corner.turn_rad);
            origin = Pose::new(end, sim::geometry::wrap_angle(origin.heading_rad + turn_rad));
        }
        let mut boundary = outline_of_side(&legs, &blueprint.corners, Side::Right);
        boundary.extend(outline_of_side(&legs, &blueprint.corners, Side::Left).into_iter().rev());
        let boundary: Vec<_> = boundary.into_iter().map(to_millimetres).collect();
        let reference_path =
            ReferencePath { points: route(&legs, blueprint), corner_radius_m: blueprint.path_radius_m };
        let boundary_edges = EdgeList::new(&boundary);
        Self { legs, corners: blueprint.corners.clone(), boundary, reference_path, boundary_edges }
    }

    /// Whether a convex outline reaches into the drivable ground.
    pub fn touches_lane(&self, outline: &[Vec2]) -> bool {
        self.boundary_edges.crosses(outline) || polygon_contains(&self.boundary, outline[0])
    }

    /// Stalls along both sides of every leg, none of which overlaps the lane, another stall or a `reserved` outline.
    /// The row follows the lane edge, as painted stall lines do.
    pub fn stalls(&self, reserved: &[[Vec2; 4]]) -> Vec<Stall> {
        let mut taken: Vec<[Vec2; 4]> = reserved.to_vec();
        let mut stalls = Vec::new();
        for (index, leg) in self.legs.iter().enumerate() {
            for side in Side::BOTH {
                let profile = leg.profile(side);
                let (from_m, to_m) = (profile[0].x, profile[profile.len() - 1].x);
                let count = ((to_m - from_m) / STALL_WIDTH_M) as usize;
                // The row is centred between its ends.
                let first_m = 0.5 * (from_m + to_m - count as f32 * STALL_WIDTH_M);
                for k in 0..count {
                    let stall_from_m = first_m + k as f32 * STALL_WIDTH_M;
                    let front_m = outermost_m(leg, side, stall_from_m, stall_from_m + STALL_WIDTH_M);
                    let stall = Stall { leg: index, side, centre_m: stall_from_m + 0.5 * STALL_WIDTH_M, front_m };
                    // A hair smaller than painted: neighbours share a line, and the front line lies on the lane edge.
                    let outline = self.stall_outline(&stall, 0.02);
                    if !self.touches_lane(&outline) && !taken.iter().any(|other| overlap(other, &outline)) {
                        taken.push(outline);
                        stalls.push(stall);
                    }
                }
            }
        }
        stalls
    }

    /// The ground of a stall, shrunk by a margin on every side.
    pub fn stall_outline(&self, stall: &Stall, margin_m: f32) -> [Vec2; 4] {
        let leg = &self.legs[stall.leg];
        let centre_d_m = stall.front_m + stall.side.sign() * 0.5 * STALL_DEPTH_M;
        let pose = Pose::new(leg.world(stall.centre_m, centre_d_m), leg.origin.heading_rad);
        rectangle(pose, STALL_WIDTH_M - 2.0 * margin_m, STALL_DEPTH_M - 2.0 * margin_m)
    }
}

/// The edge of the lane farthest from its middle within a range, `d` in metres.
fn outermost_m(leg: &Leg, side: Side, from_m: f32, to_m: f32) -> f32 {
    let inside = leg.profile(side).iter().filter(|p| from_m < p.x && p.x < to_m).map(|p| p.y);
    let ends = [leg.edge_m(side, from_m), leg.edge_m(side, to_m)];
    side.sign() * inside.chain(ends).map(|d_m| d_m * side.sign()).fold(f32::NEG_INFINITY, f32::max)
}

/// The length of a polyline whose interior vertices are rounded with a radius, metres (closed form).
pub fn rounded_length_m(path: &ReferencePath) -> f32 {
    let straight_m: f32 = path.points.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let saved_m: f32 = path
        .points
        .windows(3)
        .map(|three| {
            let turn_rad = (three[1] - three[0]).angle_to(three[2] - three[1]).abs();
            path.corner_radius_m * (2.0 * maths::tan(0.5 * turn_rad) - turn_rad)
        })
        .sum();
    straight_m - saved_m
}

/// Whole millimetres: what a lot file shows, so that a lot survives the way through a file unchanged.
pub fn to_millimetres(point: Vec2) -> Vec2 {
    (point * 1000.0).round() / 1000.0
}

/// A number rounded to tenths.
pub(crate) fn tenths(value: f32) -> f32 {
    (value * 10.0).round() / 10.0
}

/// A number rounded to hundredths.
pub(crate) fn hundredths(value: f32) -> f32 {
    (value * 100.0).round() / 100.0
}

fn draw_leg(
    plan: &LegPlan,
    origin: Pose,
    before: Option<CornerPlan>,
    after: Option<CornerPlan>,
    run_out_m: f32,
) -> Leg {
    let lane_from_m = before.map_or(-run_out_m, |corner| corner.extent_m());
    let lane_to_m = plan.length_m + after.map_or(run_out_m, |corner| -corner.extent_m());
    assert!(lane_from_m < lane_to_m, "a leg of {} m is too short for its corners", plan.length_m);
    let edge = |side: Side| -> Vec<Vec2> {
        let mut profile = Vec::new();
        if let Some(corner) = before {
            profile.extend(corner_edge(&corner, side).map(|(s_m, half_m)| Vec2::new(s_m, side.sign() * half_m)));
        }
        for s_m in lane_breakpoints(plan, lane_from_m, lane_to_m) {
            let d_m = bow_m(plan.bulge, s_m) + side.sign() * 0.5 * lane_width_m(&plan.widths, s_m);
            profile.push(Vec2::new(s_m, d_m));
        }
        if let Some(corner) = after {
            let mirrored = corner_edge(&corner, side).into_iter().rev();
            profile.extend(mirrored.map(|(u_m, half_m)| Vec2::new(plan.length_m - u_m, side.sign() * half_m)));
        }
        profile
    };
    Leg {
        origin,
        length_m: plan.length_m,
        lane_from_m,
        lane_to_m,
        left: edge(Side::Left),
        right: edge(Side::Right),
        bulge: plan.bulge,
        branches: plan.branches.clone(),
    }
}

/// Distance from the vertex and half-width at the two ends of a corner's wide piece on one side.
fn corner_edge(corner: &CornerPlan, side: Side) -> [(f32, f32); 2] {
    let half_m = 0.5 * corner.width_m;
    if side == corner.inner_side() {
        let foot_m = corner.inner_reach_m();
        // A wide piece that ends before the rounding's foot would be a notch; it is never shorter than 1 cm.
        [(foot_m, half_m), (corner.reach_m.max(foot_m + 0.01), half_m)]
    } else {
        [(-half_m * maths::tan(0.5 * corner.turn_rad.abs()), half_m), (corner.reach_m, half_m)]
    }
}

/// Where an edge bends within the lane, metres along the leg, ascending.
fn lane_breakpoints(plan: &LegPlan, from_m: f32, to_m: f32) -> Vec<f32> {
    let mut at_m = vec![from_m, to_m];
    for step in plan.widths.iter().skip(1) {
        at_m.extend([step.from_m - 0.5 * WIDTH_RAMP_M, step.from_m + 0.5 * WIDTH_RAMP_M]);
    }
    if let Some(bulge) = plan.bulge {
        let pieces = (bulge.length_m / CURVE_STEP_M).ceil() as usize;
        let start_m = bulge.centre_m - 0.5 * bulge.length_m;
        at_m.extend((0..=pieces).map(|k| start_m + k as f32 * bulge.length_m / pieces as f32));
    }
    at_m.retain(|s_m| (from_m..=to_m).contains(s_m));
    at_m.sort_by(f32::total_cmp);
    at_m.dedup_by(|b, a| *b - *a < 0.05);
    at_m
}

/// Sideways offset of the lane, metres.
fn bow_m(bulge: Option<Bulge>, s_m: f32) -> f32 {
    bulge.map_or(0.0, |bulge| {
        let phase = ((s_m - bulge.centre_m) / bulge.length_m).clamp(-0.5, 0.5);
        0.5 * bulge.offset_m * (1.0 + maths::cos(std::f32::consts::TAU * phase))
    })
}

/// Width of the lane, metres: steps joined by linear ramps.
fn lane_width_m(widths: &[WidthStep], s_m: f32) -> f32 {
    let mut width_m = widths[0].width_m;
    for step in &widths[1..] {
        let t = ((s_m - step.from_m) / WIDTH_RAMP_M + 0.5).clamp(0.0, 1.0);
        width_m += t * (step.width_m - width_m);
    }
    width_m
}

/// One side of the whole lot from the first run-out to the last, in driving direction.
fn outline_of_side(legs: &[Leg], corners: &[CornerPlan], side: Side) -> Vec<Vec2> {
    let mut outline: Vec<Vec2> = Vec::new();
    for (i, leg) in legs.iter().enumerate() {
        let mut profile = leg.profile(side).to_vec();
        for branch in leg.branches.iter().filter(|branch| branch.side == side) {
            cut_branch(&mut profile, leg, branch);
        }
        let points = profile.into_iter().map(|p| leg.world(p.x, p.y));
        // The sharp outer vertex of a corner ends one leg and begins the next.
        let repeats_vertex = i > 0 && side != corners[i - 1].inner_side();
        outline.extend(points.skip(usize::from(repeats_vertex)));
        if let Some(corner) = corners.get(i).filter(|corner| corner.inner_side() == side) {
            outline.extend(inner_rounding(leg, corner));
        }
    }
    outline
}

/// Opens the edge towards a side branch.
fn cut_branch(profile: &mut Vec<Vec2>, leg: &Leg, branch: &Branch) {
    let (from_m, to_m) = (branch.centre_m - 0.5 * branch.width_m, branch.centre_m + 0.5 * branch.width_m);
    let bottom_m = outermost_m(leg, branch.side, from_m, to_m) + branch.side.sign() * branch.depth_m;
    profile.retain(|p| p.x < from_m - 0.05 || p.x > to_m + 0.05);
    let mouth = [
        Vec2::new(from_m, leg.edge_m(branch.side, from_m)),
        Vec2::new(from_m, bottom_m),
        Vec2::new(to_m, bottom_m),
        Vec2::new(to_m, leg.edge_m(branch.side, to_m)),
    ];
    let at = profile.partition_point(|p| p.x < from_m);
    profile.splice(at..at, mouth);
}

/// Chords of the rounded inner edge, without its two feet (they belong to the legs).
fn inner_rounding(leg: &Leg, corner: &CornerPlan) -> Vec<Vec2> {
    let chords = (CHORDS_PER_RIGHT_ANGLE * corner.turn_rad.abs() / std::f32::consts::FRAC_PI_2).ceil().max(1.0);
    let side = corner.inner_side().sign();
    let foot = leg.world(leg.length_m - corner.inner_reach_m(), side * 0.5 * corner.width_m);
    let start = Pose::new(foot, leg.origin.heading_rad);
    (1..chords as usize)
        .map(|k| {
            let turned_m = corner.inner_radius_m * corner.turn_rad.abs() * k as f32 / chords;
            start.advanced_along_arc(side / corner.inner_radius_m, turned_m).position()
        })
        .collect()
}

/// The middle of the lane from start to finish.
fn route(legs: &[Leg], blueprint: &Blueprint) -> Vec<Vec2> {
    let mut points = vec![legs[0].world(0.0, 0.0)];
    for (leg, plan) in legs.iter().zip(&blueprint.legs) {
        if let Some(bulge) = leg.bulge {
            let bow = lane_breakpoints(&LegPlan { widths: Vec::new(), ..plan.clone() }, 0.0, leg.length_m);
            // Without the two ends of the leg.
            points.extend(bow[1..bow.len() - 1].iter().map(|&s_m| leg.world(s_m, bow_m(Some(bulge), s_m))));
        }
        points.push(leg.world(leg.length_m, 0.0));
    }
    points.into_iter().map(to_millimetres).collect()
}

fn interpolated_m(profile: &[Vec2], s_m: f32) -> f32 {
    let next = profile.partition_point(|p| p.x <= s_m).clamp(1, profile.len() - 1);
    let (a, b) = (profile[next - 1], profile[next]);
    a.y + ((s_m - a.x) / (b.x - a.x)).clamp(0.0, 1.0) * (b.y - a.y)
}

/// Edges with their bounding boxes, for the question whether a small outline crosses any.
#[derive(Debug, Clone)]
struct EdgeList(Vec<(Vec2, Vec2)>);

impl EdgeList {
    fn new(polygon: &[Vec2]) -> Self {
        Self(edges(polygon).collect())
    }

    fn crosses(&self, outline: &[Vec2]) -> bool {
        let (low, high) = bounds(outline);
        self.0.iter().any(|&(a, b)| {
            a.max(b).cmpge(low).all()
                && a.min(b).cmple(high).all()
                && (contains_convex(outline, a) || edges(outline).any(|(c, d)| segments_cross(a, b, c, d)))
        })
    }
}

/// Whether two convex outlines share ground (separating axes; touching does not count).
pub fn overlap(a: &[Vec2], b: &[Vec2]) -> bool {
    let separated_by_edge_of = |a: &[Vec2], b: &[Vec2]| {
        edges(a).any(|(from, to)| {
            let outward = -(to - from).perp();
            let reach = a.iter().map(|&p| outward.dot(p - from)).fold(f32::NEG_INFINITY, f32::max);
            b.iter().all(|&p| outward.dot(p - from) >= reach)
        })
    };
    !separated_by_edge_of(a, b) && !separated_by_edge_of(b, a)
}

/// Whether a point lies in a convex counter-clockwise outline.
fn contains_convex(outline: &[Vec2], point: Vec2) -> bool {
    edges(outline).all(|(a, b)| (b - a).perp_dot(point - a) >= 0.0)
}

/// Whether two segments share a point.
pub(crate) fn segments_cross(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> bool {
    let side = |p: Vec2, q: Vec2, r: Vec2| (q - p).perp_dot(r - p);
    let (of_c, of_d, of_a, of_b) = (side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b));
    if [of_c, of_d, of_a, of_b] == [0.0; 4] {
        // On one line, no side tells: they share a point where the boxes around them do.
        return a.min(b).cmple(c.max(d)).all() && c.min(d).cmple(a.max(b)).all();
    }
    of_c * of_d <= 0.0 && of_a * of_b <= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two on one line counted as crossing however far apart they are.
    #[test]
    fn segments_cross_where_they_share_a_point() {
        let table = [
            ("in the middle", [(0.0, 0.0), (2.0, 2.0), (0.0, 2.0), (2.0, 0.0)], true),
            ("an end on the other", [(0.0, 0.0), (2.0, 0.0), (1.0, 0.0), (1.0, 3.0)], true),
            ("parallel", [(0.0, 0.0), (2.0, 0.0), (0.0, 1.0), (2.0, 1.0)], false),
            ("beyond the end of one", [(0.0, 0.0), (2.0, 0.0), (3.0, -1.0), (3.0, 1.0)], false),
            ("on one line, apart", [(0.0, 0.0), (2.0, 1.0), (4.0, 2.0), (6.0, 3.0)], false),
            ("on one line, end to end", [(0.0, 0.0), (2.0, 1.0), (2.0, 1.0), (6.0, 3.0)], true),
            ("one within the other", [(0.0, 0.0), (6.0, 0.0), (2.0, 0.0), (4.0, 0.0)], true),
            ("a point on it", [(1.0, 0.0), (1.0, 0.0), (0.0, 0.0), (2.0, 0.0)], true),
            ("a point before it", [(-1.0, 0.0), (-1.0, 0.0), (0.0, 0.0), (2.0, 0.0)], false),
        ];
        for (what, points, expected) in table {
            let [a, b, c, d] = points.map(Vec2::from);
            for (a, b, c, d) in [(a, b, c, d), (b, a, c, d), (a, b, d, c), (c, d, a, b)] {
                assert_eq!(segments_cross(a, b, c, d), expected, "{what}");
            }
        }
    }
}
