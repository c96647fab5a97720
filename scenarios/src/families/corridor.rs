//! Corridors with corners, bends, bulges, islands and closed side branches between parked cars, in three difficulties.

use super::route::smoothest_within;
use crate::clutter::{self, ClutterPlan, Furniture, LaneEncroachment};
use crate::corridor::{Blueprint, Branch, Bulge, CornerPlan, Corridor, Leg, LegPlan, Side, WidthStep, to_millimetres};
use rand::RngExt as _;
use sim::maths;
use sim::scenario::{Island, LotNoise, Obstacle, ObstacleClass, ReferencePath, Scenario};
use sim::seed::Rng;
use std::ops::Range;

/// What a difficulty means.
pub(super) struct DifficultySettings {
    lane_m: Range<f32>,
    corner_width_m: Range<f32>,
    inner_radius_m: Range<f32>,
    free_gap_m: Range<f32>,
    double_parked_share: Range<f32>,
    double_parked_yaw_deg: f32,
    opposite_clear_m: f32,
    nose_share: f32,
    bulge_m: Range<f32>,
    furniture: f32,
}

impl DifficultySettings {
    pub(super) fn easy() -> Self {
        Self {
            lane_m: 3.8..7.0,
            corner_width_m: 6.0..7.0,
            inner_radius_m: 3.0..5.0,
            free_gap_m: 3.3..3.8,
            double_parked_share: 0.05..0.15,
            double_parked_yaw_deg: 2.0,
            opposite_clear_m: 12.0,
            nose_share: 0.03,
            bulge_m: 0.4..1.0,
            furniture: 0.7,
        }
    }

    pub(super) fn medium() -> Self {
        Self {
            lane_m: 3.2..6.0,
            corner_width_m: 5.7..6.5,
            inner_radius_m: 3.0..4.0,
            free_gap_m: 2.9..3.4,
            double_parked_share: 0.12..0.25,
            double_parked_yaw_deg: 4.0,
            opposite_clear_m: 10.0,
            nose_share: 0.05,
            bulge_m: 0.5..1.2,
            furniture: 1.0,
        }
    }

    /// Gaps are those of the narrow reference lots; the solver's 0.25 m clearance needs 2.4 m and more beside a car parked
    /// at an angle, which is what most rejected draws lack.
    pub(super) fn hard() -> Self {
        Self {
            lane_m: 2.8..4.2,
            corner_width_m: 5.5..6.0,
            inner_radius_m: 2.5..3.5,
            free_gap_m: 2.65..2.95,
            double_parked_share: 0.2..0.32,
            double_parked_yaw_deg: 6.0,
            opposite_clear_m: 8.0,
            nose_share: 0.08,
            bulge_m: 0.6..1.4,
            furniture: 1.4,
        }
    }
}

/// Sum of the legs, metres; rounded corners shorten the route by up to 9 m.
const LEGS_M: Range<f32> = 88.0..200.0;
/// A leg shorter than this has no room between its corners, metres.
const LEG_MIN_M: f32 = 28.0;
/// See [`crate::reference`].
const RUN_OUT_M: f32 = 18.0;
const END_CLEAR_M: f32 = 9.0;
/// More than in the reference lots: these lanes are wider, and encroachments reach farther into them.
const CORNER_CLEAR_M: f32 = 10.0;
const PATH_RADIUS_M: f32 = 5.0;
const SPEED_BUMP_EVERY_M: f32 = 60.0;

const BULGE_LENGTH_M: f32 = 14.0;
/// The widened piece of lane around an island.
const ISLAND_PIECE_M: f32 = 17.0;
const ISLAND_LANE_M: Range<f32> = 6.4..7.0;
const ISLAND_WIDTH_M: Range<f32> = 1.0..1.5;
/// Between island and lane edge: too narrow for the car.
const ISLAND_FROM_EDGE_M: f32 = 0.6;

/// Lane geometry with its islands.
struct Layout {
    blueprint: Blueprint,
    islands: Vec<IslandPlan>,
}

/// A kerbed island beside the edge of a widened lane.
struct IslandPlan {
    leg: usize,
    side: Side,
    from_m: f32,
    to_m: f32,
    width_m: f32,
}

pub(super) fn draw(settings: &DifficultySettings, layout_rng: &mut Rng, obstacle_rng: &mut Rng) -> Scenario {
    let layout = draw_layout(settings, layout_rng);
    let corridor = Corridor::draw(&layout.blueprint);
    let plan = ClutterPlan {
        free_gap_m: settings.free_gap_m.start..=settings.free_gap_m.end,
        double_parked_share: obstacle_rng.random_range(settings.double_parked_share.clone()),
        corner_clear_m: CORNER_CLEAR_M,
        opposite_clear_m: settings.opposite_clear_m,
        end_clear_m: END_CLEAR_M,
        double_parked_yaw_deg: settings.double_parked_yaw_deg,
        stall_occupancy: obstacle_rng.random_range(0.6..0.95),
        nose_share: settings.nose_share,
        furniture_per_100m: Furniture {
            cones: 3.0 * settings.furniture,
            bollards: 1.5 * settings.furniture,
            pillars: 2.5 * settings.furniture,
            carts: 2.0 * settings.furniture,
            people: 3.0 * settings.furniture,
        },
        closed_arms: true,
    };
    let reserved: Vec<_> = layout
        .islands
        .iter()
        .map(|island| LaneEncroachment {
            leg: island.leg,
            side: island.side,
            from_m: island.from_m,
            to_m: island.to_m,
            protrusion_m: ISLAND_FROM_EDGE_M + island.width_m,
        })
        .collect();
    let clutter = clutter::place(&corridor, &plan, &reserved, obstacle_rng);
    let mut obstacles = clutter.obstacles;
    obstacles.extend(layout.islands.iter().map(|plan| tree(&corridor, plan)));
    Scenario {
        name: String::new(),
        reference_path: route_around(&corridor, &clutter.encroachments),
        noise: LotNoise::default(),
        islands: layout.islands.iter().map(|plan| island(&corridor, plan)).collect(),
        obstacles,
        speed_bumps: clutter::speed_bumps(&corridor, SPEED_BUMP_EVERY_M),
        boundary: corridor.boundary,
        boundary_height_m: 0.0,
    }
}

fn draw_layout(settings: &DifficultySettings, rng: &mut Rng) -> Layout {
    let total_m = rng.random_range(LEGS_M);
    let most_corners = (total_m / LEG_MIN_M) as usize - 1;
    let legs = 1 + rng.random_range(1..=most_corners.min(4));
    // Shares of what is left after every leg has its minimum.
    let shares: Vec<f32> = (0..legs).map(|_| rng.random_range(0.2..1.0)).collect();
    let spare_m = (total_m - legs as f32 * LEG_MIN_M) / shares.iter().sum::<f32>();
    let corners = draw_corners(settings, legs - 1, rng);
    let mut islands = Vec::new();
    let legs = shares
        .iter()
        .enumerate()
        .map(|(i, share)| {
            let ends = (i.checked_sub(1).map(|before| &corners[before]), corners.get(i));
            draw_leg(settings, i, LEG_MIN_M + share * spare_m, ends, &mut islands, rng)
        })
        .collect();
    let blueprint = Blueprint { legs, corners, path_radius_m: PATH_RADIUS_M, run_out_m: RUN_OUT_M };
    Layout { blueprint, islands }
}

/// Mostly right angles, otherwise bends of 30–80°. The turns never add up to more than 180°, so the route rarely meets
/// itself.
fn draw_corners(settings: &DifficultySettings, count: usize, rng: &mut Rng) -> Vec<CornerPlan> {
    let mut turned_deg = 0.0_f32;
    (0..count)
        .map(|_| {
            let bend_deg = if rng.random_bool(0.65) { 90.0 } else { rng.random_range(30.0_f32..80.0).round() };
            let wanted = if rng.random_bool(0.5) { Side::Left } else { Side::Right };
            let side = if (turned_deg + wanted.sign() * bend_deg).abs() > 181.0 { wanted.opposite() } else { wanted };
            turned_deg += side.sign() * bend_deg;
            let gentle = bend_deg < 60.0;
            CornerPlan {
                turn_rad: side.sign() * bend_deg.to_radians(),
                width_m: rng.random_range(settings.corner_width_m.clone()) - if gentle { 1.0 } else { 0.0 },
                reach_m: if gentle { 3.5 } else { 5.0 },
                taper_m: rng.random_range(4.5..5.5),
                inner_radius_m: rng.random_range(settings.inner_radius_m.clone()),
            }
        })
        .collect()
}

fn draw_leg(
    settings: &DifficultySettings,
    index: usize,
    length_m: f32,
    (before, after): (Option<&CornerPlan>, Option<&CornerPlan>),
    islands: &mut Vec<IslandPlan>,
    rng: &mut Rng,
) -> LegPlan {
    let mut widths = draw_widths(settings, length_m, rng);
    let clear_m = |corner: Option<&CornerPlan>| {
        corner.map_or(END_CLEAR_M, |corner| corner.extent_m().max(0.5 * corner.width_m + CORNER_CLEAR_M))
    };
    let (from_m, to_m) = (clear_m(before), length_m - clear_m(after));
    let (mut bulge, mut branches) = (None, Vec::new());
    // One feature per 20 m of free lane, at most two.
    let slots = (((to_m - from_m) / 20.0).ceil() as usize).min(2);
    for slot in 0..slots {
        let slot_m = (to_m - from_m) / slots as f32;
        let slot_from_m = from_m + slot as f32 * slot_m;
        let side = if rng.random_bool(0.5) { Side::Left } else { Side::Right };
        let kind = rng.random_range(0..10);
        let place: f32 = rng.random();
        let size: f32 = rng.random();
        let start_of = |feature_m: f32| slot_from_m + place * (slot_m - feature_m);
        match kind {
            0..=3 if bulge.is_none() && slot_m > BULGE_LENGTH_M => {
                let offset_m = side.sign() * lerp(&settings.bulge_m, size);
                let centre_m = start_of(BULGE_LENGTH_M) + 0.5 * BULGE_LENGTH_M;
                bulge = Some(Bulge { centre_m, offset_m, length_m: BULGE_LENGTH_M });
            }
            4..=6 if slot_m > ISLAND_PIECE_M => {
                let piece_from_m = start_of(ISLAND_PIECE_M);
                widen(&mut widths, piece_from_m, lerp(&ISLAND_LANE_M, size));
                islands.push(IslandPlan {
                    leg: index,
                    side,
                    from_m: piece_from_m + 5.0,
                    to_m: piece_from_m + ISLAND_PIECE_M - 5.0,
                    width_m: lerp(&ISLAND_WIDTH_M, place),
                });
            }
            7..=8 => {
                let width_m = 5.0 + size;
                if slot_m > width_m {
                    let centre_m = start_of(width_m) + 0.5 * width_m;
                    branches.push(Branch { side, centre_m, width_m, depth_m: 4.0 + 3.0 * size });
                }
            }
            _ => {}
        }
    }
    LegPlan { length_m, widths, bulge, branches }
}

/// A new width every 9–18 m.
fn draw_widths(settings: &DifficultySettings, length_m: f32, rng: &mut Rng) -> Vec<WidthStep> {
    let mut widths = Vec::new();
    let mut at_m = -RUN_OUT_M;
    while at_m < length_m + RUN_OUT_M {
        widths.push(WidthStep { from_m: at_m, width_m: rng.random_range(settings.lane_m.clone()) });
        at_m += rng.random_range(9.0..18.0);
    }
    widths
}

/// Gives the lane one width along a piece as long as an island needs, and then its own again.
fn widen(widths: &mut Vec<WidthStep>, from_m: f32, width_m: f32) {
    let to_m = from_m + ISLAND_PIECE_M;
    // The last width that began before the end of the piece goes on behind it.
    let after_m = widths.iter().rev().find(|step| step.from_m <= to_m).map_or(width_m, |step| step.width_m);
    // Its neighbours' ramps must not reach into the piece.
    widths.retain(|step| step.from_m < from_m - 3.0 || step.from_m > to_m + 3.0);
    widths.extend([WidthStep { from_m, width_m }, WidthStep { from_m: to_m, width_m: after_m }]);
    widths.sort_by(|a, b| a.from_m.total_cmp(&b.from_m));
}

fn lerp(range: &Range<f32>, t: f32) -> f32 {
    range.start + t * (range.end - range.start)
}

/// `d` of an island's middle, metres.
fn island_middle_m(leg: &Leg, plan: &IslandPlan) -> f32 {
    let at_m = 0.5 * (plan.from_m + plan.to_m);
    leg.edge_m(plan.side, at_m) - plan.side.sign() * (ISLAND_FROM_EDGE_M + 0.5 * plan.width_m)
}

/// A hexagon with its tips along the lane.
fn island(corridor: &Corridor, plan: &IslandPlan) -> Island {
    const TIP_M: f32 = 0.7;
    let leg = &corridor.legs[plan.leg];
    let (middle_m, half_m) = (island_middle_m(leg, plan), 0.5 * plan.width_m);
    let corners = [
        (plan.from_m, 0.0),
        (plan.from_m + TIP_M, -half_m),
        (plan.to_m - TIP_M, -half_m),
        (plan.to_m, 0.0),
        (plan.to_m - TIP_M, half_m),
        (plan.from_m + TIP_M, half_m),
    ];
    let polygon = corners.map(|(s_m, d_m)| to_millimetres(leg.world(s_m, middle_m + d_m))).to_vec();
    Island { polygon, height_m: 0.15 }
}

/// A post on an island, as high as a lamp: it hides little, but is visible.
fn tree(corridor: &Corridor, plan: &IslandPlan) -> Obstacle {
    let leg = &corridor.legs[plan.leg];
    let at = to_millimetres(leg.world(0.5 * (plan.from_m + plan.to_m), island_middle_m(leg, plan)));
    Obstacle {
        class: ObstacleClass::Pillar,
        x_m: at.x,
        y_m: at.y,
        heading_deg: 0.0,
        length_m: Some(0.3),
        width_m: Some(0.3),
        height_m: None,
    }
}

/// A smooth line through what encroachments leave free: a car put back onto the route finds free ground, whichever way
/// it is headed.
fn route_around(corridor: &Corridor, encroachments: &[LaneEncroachment]) -> ReferencePath {
    let mut points = Vec::new();
    for (index, leg) in corridor.legs.iter().enumerate() {
        // A rounded corner takes at most half of the segments beside it.
        let straight_m = |corner: Option<&CornerPlan>| {
            corner.map_or(0.0, |corner| 2.0 * PATH_RADIUS_M * maths::tan(0.5 * corner.turn_rad.abs()) + 0.5)
        };
        let from_m = straight_m(index.checked_sub(1).map(|before| &corridor.corners[before]));
        let to_m = leg.length_m - straight_m(corridor.corners.get(index));
        let pieces = (to_m - from_m).floor();
        let at_m: Vec<f32> = (0..=pieces as usize).map(|k| from_m + k as f32 * (to_m - from_m) / pieces).collect();
        let room: Vec<_> = at_m.iter().map(|&s_m| room_for_route(leg, index, encroachments, s_m)).collect();
        let way = smoothest_within(&room);
        points.push(leg.world(0.0, 0.0));
        let bends = (1..way.len() - 1).filter(|&k| (way[k - 1] + way[k + 1] - 2.0 * way[k]).abs() > FLAT_M);
        points.extend(bends.map(|k| leg.world(at_m[k], way[k])));
    }
    let last = &corridor.legs[corridor.legs.len() - 1];
    points.push(last.world(last.length_m, 0.0));
    let points = points.into_iter().map(to_millimetres).collect();
    ReferencePath { points, corner_radius_m: PATH_RADIUS_M }
}

/// Bends of the route smaller than this are drawn straight, metres.
const FLAT_M: f32 = 2e-3;

/// Lowest and highest `d` of the rear axle, metres, such that the body stands free in either direction of driving.
fn room_for_route(leg: &Leg, index: usize, encroachments: &[LaneEncroachment], s_m: f32) -> (f32, f32) {
    /// The body reaches 3.8 m ahead of the rear axle, and its corners farther aside the more the route slopes.
    const REACH_M: f32 = 2.5;
    /// Half the car's width and a margin for the slope of the route.
    const ASIDE_M: f32 = 1.1;
    let limit_m = |side: Side| {
        let edge_m = |t_m: f32| side.sign() * leg.edge_m(side, t_m);
        let narrowest_m = (-3..=3).map(|k| edge_m(s_m + k as f32 * REACH_M / 3.0)).fold(f32::INFINITY, f32::min);
        encroachments
            .iter()
            .filter(|other| other.leg == index && other.side == side)
            .filter(|other| other.from_m - REACH_M < s_m && s_m < other.to_m + REACH_M)
            .map(|other| edge_m(s_m.clamp(other.from_m, other.to_m)) - other.protrusion_m)
            .fold(narrowest_m, f32::min)
            - ASIDE_M
    };
    let (low_m, high_m) = (-limit_m(Side::Right), limit_m(Side::Left));
    if low_m <= high_m { (low_m, high_m) } else { (0.5 * (low_m + high_m), 0.5 * (low_m + high_m)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generator::generate;
    use crate::split::{Family, Split};
    use sim::geometry::polygon_contains;
    use sim::seed::Stream;

    const LOTS: u64 = 30;

    fn difficulties() -> [DifficultySettings; 3] {
        [DifficultySettings::easy(), DifficultySettings::medium(), DifficultySettings::hard()]
    }

    /// The kinds of things the paper names all occur.
    #[test]
    fn lots_are_varied() {
        let (mut bends, mut right_angles, mut islands, mut bumps) = (0, 0, 0, 0);
        let mut in_lane = std::collections::BTreeMap::new();
        let (mut narrowest_m, mut widest_m) = (f32::INFINITY, 0.0_f32);
        for index in 0..LOTS {
            for (family, settings) in Family::CORRIDORS.into_iter().zip(difficulties()) {
                let seed = Split::Train.seed(family, index);
                let layout = draw_layout(&settings, &mut seed.rng(Stream::Layout, 0));
                for corner in &layout.blueprint.corners {
                    let is_right_angle = corner.turn_rad.abs() > 1.57;
                    right_angles += usize::from(is_right_angle);
                    bends += usize::from(!is_right_angle);
                }
                for leg in Corridor::draw(&layout.blueprint).legs {
                    for s_m in [leg.lane_from_m, 0.5 * (leg.lane_from_m + leg.lane_to_m), leg.lane_to_m] {
                        narrowest_m = narrowest_m.min(leg.width_m(s_m));
                        widest_m = widest_m.max(leg.width_m(s_m));
                    }
                }
                let scenario = generate(&Split::Train, index, family).scenario;
                islands += scenario.islands.len();
                bumps += scenario.speed_bumps.len();
                for obstacle in &scenario.obstacles {
                    let inside = obstacle.outline().iter().any(|&p| polygon_contains(&scenario.boundary, p));
                    *in_lane.entry(obstacle.class).or_insert(0) += usize::from(inside);
                }
            }
        }
        assert!(right_angles > 80 && bends > 30, "{right_angles} right angles, {bends} bends");
        assert!(islands > 15 && bumps > 100, "{islands} islands, {bumps} speed bumps");
        assert!(narrowest_m < 3.2 && widest_m > 6.5, "lanes of {narrowest_m} to {widest_m} m");
        for class in ObstacleClass::ALL {
            let count = in_lane.get(&class).copied().unwrap_or_default();
            let stays_outside = matches!(class, ObstacleClass::Curb | ObstacleClass::WheelStop | ObstacleClass::Wall);
            assert!(count > 3 || stays_outside, "{class:?}: {count} in the lanes of 90 lots");
        }
    }

    /// A closed branch: no gap between its cones, or between a cone and the lane's edge, lets the car through.
    #[test]
    fn cones_close_side_branches() {
        let branch = Branch { side: Side::Left, centre_m: 30.0, width_m: 5.7, depth_m: 6.0 };
        let widths = vec![WidthStep { from_m: 0.0, width_m: 5.0 }];
        let leg = LegPlan { length_m: 60.0, widths, bulge: None, branches: vec![branch] };
        let blueprint = Blueprint { legs: vec![leg], corners: Vec::new(), path_radius_m: 5.0, run_out_m: RUN_OUT_M };
        let corridor = Corridor::draw(&blueprint);
        assert!(polygon_contains(&corridor.boundary, sim::geometry::Vec2::new(30.0, 8.0)), "the branch is drivable");
        assert!(!polygon_contains(&corridor.boundary, sim::geometry::Vec2::new(30.0, 8.6)), "and ends");
        let none = Furniture { cones: 0.0, bollards: 0.0, pillars: 0.0, carts: 0.0, people: 0.0 };
        let plan = ClutterPlan {
            free_gap_m: 3.0..=3.2,
            double_parked_share: 0.0,
            corner_clear_m: CORNER_CLEAR_M,
            opposite_clear_m: 8.0,
            end_clear_m: END_CLEAR_M,
            double_parked_yaw_deg: 2.0,
            stall_occupancy: 0.0,
            nose_share: 0.0,
            furniture_per_100m: none,
            closed_arms: false,
        };
        let mut rng = sim::seed::RootSeed(1).rng(Stream::Obstacles, 0);
        let mut cones: Vec<f32> = clutter::place(&corridor, &plan, &[], &mut rng)
            .obstacles
            .iter()
            .filter(|obstacle| obstacle.class == ObstacleClass::Cone)
            .map(|cone| cone.x_m)
            .collect();
        cones.extend([30.0 - 2.85, 30.0 + 2.85]);
        cones.sort_by(f32::total_cmp);
        let widest_m = cones.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f32::max);
        assert!(cones.len() > 4 && widest_m < 1.5, "{cones:?}");
    }
}
