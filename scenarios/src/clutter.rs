//! Parked cars and other obstacles, placed under rules that keep a lot drivable.
//!
//! Some obstacles stand outside the lane: they hide ground and make the place look like a parking lot. Others narrow the
//! lane. Each such [`LaneEncroachment`] leaves a free gap to the opposite edge and keeps away from corners and from
//! encroachments on the other side; the tests of [`mod@crate::reference`] measure that with rays across the route.

use crate::corridor::{Corridor, Leg, STALL_DEPTH_M, Side, Stall, hundredths, overlap, tenths, to_millimetres};
use rand::RngExt as _;
use sim::geometry::{Pose, Vec2, rectangle};
use sim::scenario::{Obstacle, ObstacleClass, SpeedBump};
use sim::seed::Rng;
use std::ops::RangeInclusive;

/// Distance of encroachments on the same side, metres; nearer ones belong to one cluster or row.
const SAME_SIDE_CLEAR_M: f32 = 2.0;
/// Distance between clusters of double-parked cars on the same side, metres.
const CLUSTER_CLEAR_M: f32 = 4.0;
/// An obstacle that reaches less far into the lane than this does not count as an encroachment, metres.
const PROTRUSION_MIN_M: f32 = 0.05;
/// A double-parked car stands at least this far from its stall line (docs/methods.md 11), metres: its width plus this is
/// the most it can take from the lane.
const KERB_GAP_M: f32 = 0.3;
/// Spacing of cones that close something, metres; the car is 1.86 m wide.
const CLOSING_CONES_M: f32 = 1.2;
/// How deep the ground behind a closed arm of a crossing is kept free of stalls, metres.
const CLOSED_ARM_DEPTH_M: f32 = 8.0;
/// Extent of a speed bump along the route, metres.
const SPEED_BUMP_LENGTH_M: f32 = 0.5;

/// How a lot is filled.
#[derive(Debug, Clone)]
pub struct ClutterPlan {
    /// Free gap beside anything that narrows the lane, metres.
    pub free_gap_m: RangeInclusive<f32>,
    /// Share of the route's length with a double-parked cluster beside it.
    pub double_parked_share: f32,
    /// Encroachments keep this far from the edge of the crossing aisle, metres.
    pub corner_clear_m: f32,
    /// Encroachments on opposite sides keep this far apart, metres along the lane.
    pub opposite_clear_m: f32,
    /// Encroachments keep this far from start and finish, metres.
    pub end_clear_m: f32,
    /// Double-parked cars stand up to this far from parallel, degrees.
    pub double_parked_yaw_deg: f32,
    /// Share of stalls with a car in it.
    pub stall_occupancy: f32,
    /// Share of parked cars whose nose stands 0.3–0.6 m in the lane where the gap allows.
    pub nose_share: f32,
    /// Small things per 100 m of route.
    pub furniture_per_100m: Furniture,
    /// Whether the two arms of a crossing that a right-angled corner leaves unused are shown closed by cones.
    pub closed_arms: bool,
}

/// Mean numbers of small things.
#[derive(Debug, Clone, Copy)]
pub struct Furniture {
    /// Groups of 1–3.
    pub cones: f32,
    /// Rows of 2–4.
    pub bollards: f32,
    /// Single ones.
    pub pillars: f32,
    /// Single ones.
    pub carts: f32,
    /// Single ones, standing.
    pub people: f32,
}

/// A stretch of lane that is narrowed from one side.
#[derive(Debug, Clone, Copy)]
pub struct LaneEncroachment {
    /// Index of the leg.
    pub leg: usize,
    /// Side of the lane that it is on.
    pub side: Side,
    /// Stretch, metres along the leg.
    pub from_m: f32,
    /// See [`Self::from_m`].
    pub to_m: f32,
    /// How far it reaches into the lane, metres.
    pub protrusion_m: f32,
}

/// The obstacles of a lot.
#[derive(Debug, Clone)]
pub struct Clutter {
    /// The obstacles, in the lane and outside.
    pub obstacles: Vec<Obstacle>,
    /// The stretches they narrow, reserved ones included.
    pub encroachments: Vec<LaneEncroachment>,
}

/// Fills a corridor. `reserved` stretches (islands) count as encroachments.
pub fn place(corridor: &Corridor, plan: &ClutterPlan, reserved: &[LaneEncroachment], rng: &mut Rng) -> Clutter {
    let arms = if plan.closed_arms { closed_arms(corridor) } else { Vec::new() };
    let reserved_ground: Vec<_> = arms.iter().map(|arm| arm.ground).collect();
    let mut placement = Placement { corridor, plan, encroachments: reserved.to_vec(), things: Vec::new() };
    for leg in 0..corridor.legs.len() {
        close_branches(&mut placement, leg);
    }
    for &cone in arms.iter().flat_map(|arm| &arm.cones) {
        placement.stand(ObstacleClass::Cone, Pose::new(cone, 0.0));
    }
    place_double_parked(&mut placement, rng);
    for stall in corridor.stalls(&reserved_ground) {
        place_parked(&mut placement, &stall, rng);
    }
    place_furniture(&mut placement, rng);
    let obstacles = placement.things.into_iter().map(|thing| thing.obstacle).collect();
    Clutter { obstacles, encroachments: placement.encroachments }
}

/// One speed bump per `every_m` of route, each in a leg's lane, across its whole width.
pub fn speed_bumps(corridor: &Corridor, every_m: f32) -> Vec<SpeedBump> {
    let route_m: f32 = corridor.legs.iter().map(|leg| leg.length_m).sum();
    let count = (route_m / every_m) as usize;
    (0..count)
        .map(|k| {
            let mut s_m = (k as f32 + 0.5) * route_m / count as f32;
            let mut leg = &corridor.legs[0];
            for next in &corridor.legs[1..] {
                if s_m <= leg.length_m {
                    break;
                }
                s_m -= leg.length_m;
                leg = next;
            }
            let s_m = s_m.clamp(leg.lane_from_m.max(6.0), leg.lane_to_m.min(leg.length_m - 6.0));
            let centre = to_millimetres(leg.world(s_m, leg.centre_m(s_m)));
            SpeedBump {
                x_m: centre.x,
                y_m: centre.y,
                heading_deg: tenths(leg.origin.heading_rad.to_degrees()),
                length_m: SPEED_BUMP_LENGTH_M,
                width_m: hundredths(leg.width_m(s_m)),
            }
        })
        .collect()
}

/// The obstacles placed so far.
struct Placement<'a> {
    corridor: &'a Corridor,
    plan: &'a ClutterPlan,
    encroachments: Vec<LaneEncroachment>,
    things: Vec<Thing>,
}

struct Thing {
    obstacle: Obstacle,
    outline: Vec<Vec2>,
}

impl Thing {
    fn new(class: ObstacleClass, centre: Pose) -> Self {
        let position = to_millimetres(centre.position());
        let obstacle = Obstacle {
            x_m: position.x,
            y_m: position.y,
            heading_deg: tenths(centre.heading_rad.to_degrees()),
            ..Obstacle::new(class, centre)
        };
        Self { outline: obstacle.outline(), obstacle }
    }
}

impl Placement<'_> {
    fn leg(&self, index: usize) -> &Leg {
        &self.corridor.legs[index]
    }

    fn stand(&mut self, class: ObstacleClass, centre: Pose) {
        self.things.push(Thing::new(class, centre));
    }

    fn is_free(&self, outline: &[Vec2]) -> bool {
        !self.things.iter().any(|thing| overlap(&thing.outline, outline))
    }

    /// Where encroachments may stand in a leg, metres along it.
    fn usable(&self, leg: usize) -> (f32, f32) {
        let clear_m = |corner: usize| {
            let corner = &self.corridor.corners[corner];
            (0.5 * corner.width_m + self.plan.corner_clear_m).max(corner.extent_m())
        };
        let length_m = self.leg(leg).length_m;
        let from_m = leg.checked_sub(1).map_or(self.plan.end_clear_m, clear_m);
        let to_m = length_m - if leg < self.corridor.corners.len() { clear_m(leg) } else { self.plan.end_clear_m };
        (from_m, to_m)
    }

    fn may_intrude(&self, leg: usize, side: Side, from_m: f32, to_m: f32) -> bool {
        let (usable_from_m, usable_to_m) = self.usable(leg);
        let keeps_apart = |other: &LaneEncroachment| {
            let clear_m = if other.side == side { SAME_SIDE_CLEAR_M } else { self.plan.opposite_clear_m };
            other.leg != leg || other.to_m + clear_m <= from_m || to_m + clear_m <= other.from_m
        };
        usable_from_m <= from_m && to_m <= usable_to_m && self.encroachments.iter().all(keeps_apart)
    }

    /// The place of a thing at `s_m` whose nearest point to the lane protrudes by `protrusion_m` (negative: stands
    /// back), or less where that would leave less than `gap_m` free.
    fn against_edge(&self, leg: usize, side: Side, body: Body, wish: Protrusion) -> Placed {
        let leg = self.leg(leg);
        let outline_at = |d_m: f32| -> (Pose, Vec<Vec2>) {
            let heading_rad = sim::geometry::wrap_angle(leg.origin.heading_rad + body.heading_in_leg_rad);
            let thing = Thing::new(body.class, Pose::new(leg.world(body.s_m, d_m), heading_rad));
            (thing.obstacle.centre(), thing.outline)
        };
        let (_, on_axis) = outline_at(0.0);
        let fit = fit_in_lane(leg, side, &on_axis);
        let outward_m = (fit.protrusion_m - wish.wanted_m).max(wish.gap_m - fit.gap_m);
        let (centre, outline) = outline_at(side.sign() * outward_m);
        Placed { centre, outline, protrusion_m: fit.protrusion_m - outward_m, from_m: fit.from_m, to_m: fit.to_m }
    }
}

/// A thing and its place along a leg.
#[derive(Clone, Copy)]
struct Body {
    class: ObstacleClass,
    s_m: f32,
    heading_in_leg_rad: f32,
}

#[derive(Clone, Copy)]
struct Protrusion {
    wanted_m: f32,
    gap_m: f32,
}

struct Placed {
    centre: Pose,
    outline: Vec<Vec2>,
    protrusion_m: f32,
    from_m: f32,
    to_m: f32,
}

impl Placed {
    fn encroachment(&self, leg: usize, side: Side) -> LaneEncroachment {
        LaneEncroachment { leg, side, from_m: self.from_m, to_m: self.to_m, protrusion_m: self.protrusion_m }
    }
}

/// How an outline sits in the lane: both extremes are exact, since everything is piecewise linear in `s`.
#[allow(clippy::struct_field_names, reason = "the postfix is the unit")]
struct Fit {
    /// Smallest distance across the lane from the outline to the opposite edge, metres.
    gap_m: f32,
    /// How far the outline reaches over its own edge, metres.
    protrusion_m: f32,
    from_m: f32,
    to_m: f32,
}

fn fit_in_lane(leg: &Leg, side: Side, outline: &[Vec2]) -> Fit {
    // Mirrored so that the own edge lies at positive e.
    let local: Vec<Vec2> = outline.iter().map(|&p| leg.local(p)).map(|p| Vec2::new(p.x, side.sign() * p.y)).collect();
    let (from_m, to_m) =
        local.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), p| (low.min(p.x), high.max(p.x)));
    let bends = Side::BOTH.iter().flat_map(|&side| leg.profile(side)).map(|p| p.x);
    let at_m = local.iter().map(|p| p.x).chain(bends.filter(|s_m| (from_m..=to_m).contains(s_m)));
    let mut fit = Fit { gap_m: f32::INFINITY, protrusion_m: f32::NEG_INFINITY, from_m, to_m };
    for s_m in at_m {
        let inner_m = inner_extent_m(&local, s_m);
        fit.gap_m = fit.gap_m.min(inner_m - side.sign() * leg.edge_m(side.opposite(), s_m));
        fit.protrusion_m = fit.protrusion_m.max(side.sign() * leg.edge_m(side, s_m) - inner_m);
    }
    fit
}

/// The smallest second coordinate of a convex outline at a first coordinate within its range.
fn inner_extent_m(outline: &[Vec2], s_m: f32) -> f32 {
    sim::geometry::edges(outline)
        .filter(|(a, b)| a.x.min(b.x) <= s_m && s_m <= a.x.max(b.x))
        .map(
            |(a, b)| {
                if (b.x - a.x).abs() < 1e-6 { a.y.min(b.y) } else { a.y + (s_m - a.x) / (b.x - a.x) * (b.y - a.y) }
            },
        )
        .fold(f32::INFINITY, f32::min)
}

struct Cluster {
    side: Side,
    classes: Vec<ObstacleClass>,
    /// Bumper to bumper, one fewer than cars, metres.
    spaces_m: Vec<f32>,
}

impl Cluster {
    fn draw(side: Side, cars: usize, rng: &mut Rng) -> Self {
        Self {
            side,
            classes: (0..cars).map(|_| draw_car(rng)).collect(),
            spaces_m: (1..cars).map(|_| rng.random_range(0.6..1.4)).collect(),
        }
    }

    fn length_m(&self) -> f32 {
        self.classes.iter().map(|class| class.default_size_m()[0]).sum::<f32>() + self.spaces_m.iter().sum::<f32>()
    }
}

/// Clusters of 1–3 cars parallel to the lane until the planned share of the route has one beside it. What does not fit
/// into one leg is owed by the next.
fn place_double_parked(placement: &mut Placement<'_>, rng: &mut Rng) {
    let legs = placement.corridor.legs.len();
    let usable_m = |placement: &Placement<'_>, leg: usize| {
        let (from_m, to_m) = placement.usable(leg);
        (to_m - from_m).max(0.0)
    };
    let total_usable_m: f32 = (0..legs).map(|leg| usable_m(placement, leg)).sum();
    let route_m: f32 = placement.corridor.legs.iter().map(|leg| leg.length_m).sum();
    let wanted_m = placement.plan.double_parked_share * route_m;
    let mut owed_m = 0.0;
    for leg in 0..legs {
        owed_m += wanted_m * usable_m(placement, leg) / total_usable_m.max(1.0);
        let clusters = draw_clusters(placement, leg, owed_m, rng);
        owed_m -= clusters.iter().map(Cluster::length_m).sum::<f32>();
        spread_clusters(placement, leg, &clusters, rng);
    }
}

/// Clusters for one leg: about `wanted_m` in sum, and no more than its usable length holds.
fn draw_clusters(placement: &Placement<'_>, leg: usize, wanted_m: f32, rng: &mut Rng) -> Vec<Cluster> {
    const TYPICAL_CAR_M: f32 = 4.7;
    let (from_m, to_m) = placement.usable(leg);
    let mut clusters: Vec<Cluster> = Vec::new();
    let (mut missing_m, mut room_m) = (wanted_m, to_m - from_m);
    // Half a car too many is as good as half a car too few.
    while missing_m > 0.5 * TYPICAL_CAR_M {
        let cars = rng.random_range(1..=3).min((missing_m / TYPICAL_CAR_M).round().max(1.0) as usize);
        let side = if rng.random_bool(0.5) { Side::Left } else { Side::Right };
        let mut cluster = Cluster::draw(side, cars, rng);
        let needed_m = |cluster: &Cluster| {
            let apart_m =
                clusters.last().map_or(0.0, |last| clearance_between(last.side, cluster.side, placement.plan));
            apart_m + cluster.length_m()
        };
        if needed_m(&cluster) > room_m
            && let Some(last) = clusters.last()
        {
            // The same side again takes less room than a slalom.
            cluster = Cluster::draw(last.side, 1, rng);
        }
        let needed_m = needed_m(&cluster);
        if needed_m > room_m {
            break;
        }
        room_m -= needed_m;
        missing_m -= cluster.length_m();
        clusters.push(cluster);
    }
    clusters
}

fn clearance_between(a: Side, b: Side, plan: &ClutterPlan) -> f32 {
    // The extra decimetres keep a car's yaw from eating into the rule.
    if a == b { CLUSTER_CLEAR_M } else { plan.opposite_clear_m + 0.2 }
}

/// Puts clusters into a leg in their order, the slack shared out at random.
fn spread_clusters(placement: &mut Placement<'_>, leg: usize, clusters: &[Cluster], rng: &mut Rng) {
    let (from_m, to_m) = placement.usable(leg);
    let apart_m = |i: usize| match i {
        0 => 0.0,
        _ => clearance_between(clusters[i - 1].side, clusters[i].side, placement.plan),
    };
    let needed_m: f32 = clusters.iter().enumerate().map(|(i, cluster)| apart_m(i) + cluster.length_m()).sum();
    let slack_m = to_m - from_m - needed_m;
    let mut shifts_m: Vec<f32> = clusters.iter().map(|_| rng.random_range(0.0..=slack_m.max(0.0))).collect();
    shifts_m.sort_by(f32::total_cmp);
    let apart_m: Vec<f32> = (0..clusters.len()).map(apart_m).collect();
    let mut packed_m = from_m;
    for ((cluster, shift_m), apart_m) in clusters.iter().zip(shifts_m).zip(apart_m) {
        packed_m += apart_m;
        let mut front_m = packed_m + shift_m;
        for (i, &class) in cluster.classes.iter().enumerate() {
            let length_m = class.default_size_m()[0];
            place_double_parked_car(placement, leg, cluster.side, class, front_m + 0.5 * length_m, rng);
            front_m += length_m + cluster.spaces_m.get(i).copied().unwrap_or(0.0);
        }
        packed_m += cluster.length_m();
    }
}

fn place_double_parked_car(
    placement: &mut Placement<'_>,
    leg: usize,
    side: Side,
    class: ObstacleClass,
    s_m: f32,
    rng: &mut Rng,
) {
    let gap_m = rng.random_range(placement.plan.free_gap_m.clone());
    let heading_in_leg_rad = yaw_rad(rng, placement.plan.double_parked_yaw_deg)
        + if rng.random_bool(0.8) { 0.0 } else { std::f32::consts::PI };
    let body = Body { class, s_m, heading_in_leg_rad };
    // As far into the lane as the gap allows, but no farther from its own edge than people park.
    let wish = Protrusion { wanted_m: class.default_size_m()[1] + KERB_GAP_M, gap_m };
    let mut placed = placement.against_edge(leg, side, body, wish);
    if placed.protrusion_m < PROTRUSION_MIN_M {
        // The lane is hardly wider than the drawn gap here: any gap of the range will do.
        let wish = Protrusion { wanted_m: PROTRUSION_MIN_M, gap_m: *placement.plan.free_gap_m.start() };
        placed = placement.against_edge(leg, side, body, wish);
    }
    // Reserved stretches (islands, branches) come first; the car's own cluster does not count.
    let blocked = placement.encroachments.iter().any(|other| {
        let clear_m = if other.side == side { 0.0 } else { placement.plan.opposite_clear_m };
        other.leg == leg && placed.from_m < other.to_m + clear_m && other.from_m < placed.to_m + clear_m
    });
    if !blocked && placement.is_free(&placed.outline) {
        placement.stand(class, placed.centre);
        placement.encroachments.push(placed.encroachment(leg, side));
    }
}

/// A car in a stall, or a wheel stop in an empty one.
fn place_parked(placement: &mut Placement<'_>, stall: &Stall, rng: &mut Rng) {
    // All draws come first: obstacles elsewhere must not shift the random stream of the next stall.
    let occupied = rng.random_bool(f64::from(placement.plan.stall_occupancy));
    let class = draw_car(rng);
    let nose_m = if rng.random_bool(f64::from(placement.plan.nose_share)) { rng.random_range(0.3..0.6) } else { 0.0 };
    let nose_gap_m = rng.random_range(placement.plan.free_gap_m.clone());
    let set_back_m = rng.random_range(0.1..0.4);
    let towards_lane_rad = -stall.side.sign() * std::f32::consts::FRAC_PI_2;
    let backed_in = rng.random_bool(0.3);
    let heading_in_leg_rad = yaw_rad(rng, 4.0) + if backed_in { towards_lane_rad } else { -towards_lane_rad };
    let s_m = stall.centre_m + rng.random_range(-0.1..0.1);
    if !occupied {
        let leg = placement.leg(stall.leg);
        let d_m = stall.front_m + stall.side.sign() * (STALL_DEPTH_M - 0.8);
        let heading_rad = sim::geometry::wrap_angle(leg.origin.heading_rad + std::f32::consts::FRAC_PI_2);
        // Its length lies across the stall.
        let across = Pose::new(leg.world(stall.centre_m, d_m), heading_rad + std::f32::consts::FRAC_PI_2);
        let stop = Thing::new(ObstacleClass::WheelStop, across);
        if placement.is_free(&stop.outline) {
            placement.things.push(stop);
        }
        return;
    }
    let body = Body { class, s_m, heading_in_leg_rad };
    let nose = placement.against_edge(stall.leg, stall.side, body, Protrusion { wanted_m: nose_m, gap_m: nose_gap_m });
    let reaches_out = nose_m > 0.0
        && nose.protrusion_m >= 0.1
        && placement.may_intrude(stall.leg, stall.side, nose.from_m, nose.to_m)
        && placement.is_free(&nose.outline);
    if reaches_out {
        placement.stand(class, nose.centre);
        placement.encroachments.push(nose.encroachment(stall.leg, stall.side));
        return;
    }
    let wish = Protrusion { wanted_m: -set_back_m, gap_m: 0.0 };
    let placed = placement.against_edge(stall.leg, stall.side, body, wish);
    if placement.is_free(&placed.outline) && !placement.corridor.touches_lane(&placed.outline) {
        placement.stand(class, placed.centre);
    }
}

fn place_furniture(placement: &mut Placement<'_>, rng: &mut Rng) {
    use ObstacleClass::{Bollard, Cart, Cone, Person, Pillar};
    let route_m: f32 = placement.corridor.legs.iter().map(|leg| leg.length_m).sum();
    let Furniture { cones, bollards, pillars, carts, people } = placement.plan.furniture_per_100m;
    // Class, groups per 100 m, members of a group, their spacing, deepest protrusion.
    let kinds = [
        (Pillar, pillars, 1..=1, 0.0, 0.35),
        (Bollard, bollards, 2..=4, 1.5, 0.15),
        (Cone, cones, 1..=3, 1.6, 0.4),
        (Cart, carts, 1..=1, 0.0, 0.5),
        (Person, people, 1..=1, 0.0, 0.5),
    ];
    for (class, per_100m, members, spacing_m, deepest_m) in kinds {
        let wanted = per_100m * route_m / 100.0;
        // The fraction decides by chance, so that the mean is right for short lots too.
        let groups = wanted as usize + usize::from(rng.random_bool(f64::from(wanted.fract())));
        for _ in 0..groups {
            let members = rng.random_range(members.clone());
            place_group(placement, &Group { class, members, spacing_m, deepest_m }, rng);
        }
    }
}

struct Group {
    class: ObstacleClass,
    members: usize,
    spacing_m: f32,
    deepest_m: f32,
}

/// A row at the edge of the lane where the rules allow it, else behind the edge.
fn place_group(placement: &mut Placement<'_>, group: &Group, rng: &mut Rng) {
    const TRIES: usize = 24;
    for attempt in 0..TRIES {
        let index = rng.random_range(0..placement.corridor.legs.len());
        let side = if rng.random_bool(0.5) { Side::Left } else { Side::Right };
        let intrudes = attempt < TRIES / 2;
        let (from_m, to_m) = if intrudes { placement.usable(index) } else { (0.0, placement.leg(index).length_m) };
        let length_m = (group.members - 1) as f32 * group.spacing_m;
        let firsts_m = from_m + 0.5..to_m - length_m - 0.5;
        if firsts_m.is_empty() {
            continue;
        }
        let first_m = rng.random_range(firsts_m);
        let wanted_m = if intrudes { rng.random_range(0.1..group.deepest_m) } else { -rng.random_range(0.1..0.8) };
        let gap_m = rng.random_range(placement.plan.free_gap_m.clone());
        let turn_rad = if group.class == ObstacleClass::Pillar { 0.0 } else { yaw_rad(rng, 90.0) };
        let row: Vec<Placed> = (0..group.members)
            .map(|k| {
                let s_m = first_m + k as f32 * group.spacing_m;
                let body = Body { class: group.class, s_m, heading_in_leg_rad: turn_rad };
                placement.against_edge(index, side, body, Protrusion { wanted_m, gap_m })
            })
            .collect();
        let from_m = row.iter().map(|placed| placed.from_m).fold(f32::INFINITY, f32::min);
        let to_m = row.iter().map(|placed| placed.to_m).fold(f32::NEG_INFINITY, f32::max);
        let fits = row.iter().all(|placed| {
            placement.is_free(&placed.outline)
                && if intrudes {
                    placed.protrusion_m >= PROTRUSION_MIN_M
                } else {
                    !placement.corridor.touches_lane(&placed.outline)
                }
        });
        if fits && (!intrudes || placement.may_intrude(index, side, from_m, to_m)) {
            for placed in &row {
                placement.stand(group.class, placed.centre);
            }
            if intrudes {
                let protrusion_m = row.iter().map(|placed| placed.protrusion_m).fold(0.0, f32::max);
                placement.encroachments.push(LaneEncroachment { leg: index, side, from_m, to_m, protrusion_m });
            }
            return;
        }
    }
}

/// Cones across the mouths of a leg's side branches, on the line of the lane's edge.
fn close_branches(placement: &mut Placement<'_>, index: usize) {
    for branch in placement.leg(index).branches().to_vec() {
        let leg = placement.leg(index);
        let (from_m, to_m) = (branch.centre_m - 0.5 * branch.width_m, branch.centre_m + 0.5 * branch.width_m);
        let cones = (branch.width_m / CLOSING_CONES_M).ceil() as usize;
        // The row stands just behind the line, so that the lane keeps its width.
        let centres: Vec<_> = (0..cones)
            .map(|k| {
                let s_m = from_m + (k as f32 + 0.5) * branch.width_m / cones as f32;
                leg.world(s_m, leg.edge_m(branch.side, s_m) + branch.side.sign() * 0.25)
            })
            .collect();
        for centre in centres {
            placement.stand(ObstacleClass::Cone, Pose::new(centre, 0.0));
        }
        placement.encroachments.push(LaneEncroachment {
            leg: index,
            side: branch.side,
            from_m,
            to_m,
            protrusion_m: 0.0,
        });
    }
}

/// An arm of a crossing that the route does not take.
struct Arm {
    ground: [Vec2; 4],
    cones: Vec<Vec2>,
}

/// The arms straight on and behind at right-angled corners: "cones close side branches at intersections" (paper).
/// They lie outside the boundary; the cones stand 0.3 m behind the outer edge.
fn closed_arms(corridor: &Corridor) -> Vec<Arm> {
    let mut arms = Vec::new();
    for (i, corner) in corridor.corners.iter().enumerate() {
        if (corner.turn_rad.abs() - std::f32::consts::FRAC_PI_2).abs() > 0.01 {
            continue;
        }
        let (before, after) = (&corridor.legs[i], &corridor.legs[i + 1]);
        let half_m = 0.5 * corner.width_m;
        for (leg, vertex_m, outward) in [(before, before.length_m, 1.0), (after, 0.0, -1.0)] {
            let at = |beyond_m: f32, d_m: f32| leg.world(vertex_m + outward * (half_m + beyond_m), d_m);
            let centre = Pose::new(at(0.1 + 0.5 * CLOSED_ARM_DEPTH_M, 0.0), leg.origin.heading_rad);
            let ground = rectangle(centre, CLOSED_ARM_DEPTH_M, corner.width_m);
            if !corridor.touches_lane(&ground) {
                let cones = (corner.width_m / CLOSING_CONES_M) as usize;
                let offset = |k: usize| (k as f32 + 0.5) * corner.width_m / cones as f32 - half_m;
                arms.push(Arm { ground, cones: (0..cones).map(|k| at(0.3, offset(k))).collect() });
            }
        }
    }
    arms
}

/// What stands in a stall.
pub(crate) fn draw_car(rng: &mut Rng) -> ObstacleClass {
    // Roughly a Korean apartment lot; the paper gives no shares.
    match rng.random_range(0..100) {
        0..50 => ObstacleClass::Sedan,
        50..75 => ObstacleClass::Suv,
        75..90 => ObstacleClass::Compact,
        90..97 => ObstacleClass::Van,
        _ => ObstacleClass::Truck,
    }
}

/// Up to so many degrees to either side, in radians.
pub(crate) fn yaw_rad(rng: &mut Rng, limit_deg: f32) -> f32 {
    rng.random_range(-limit_deg..=limit_deg).to_radians()
}
