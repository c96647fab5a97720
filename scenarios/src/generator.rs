//! Procedural lots: corridors with corners, bends, bulges, islands, closed side branches and everything that stands
//! about, each verified to be drivable in both directions.
//!
//! A lot's seed decides all of it. A draw that is invalid or that [`crate::solver`] cannot drive is thrown away and the
//! next one of the same seed taken; [`Generated::attempts`] says how many it took.

use crate::clutter::{self, ClutterPlan, Furniture, Intruder};
use crate::corridor::{Blueprint, Branch, Bulge, CornerPlan, Corridor, Leg, LegPlan, Side, WidthStep, to_millimetres};
use crate::solver::{self, CLEARANCE_M};
use crate::split::{Difficulty, Split};
use rand::RngExt as _;
use sim::geometry::Vec2;
use sim::scenario::{Direction, Island, NoiseSettings, Obstacle, ObstacleClass, ReferencePath, Scenario};
use sim::seed::{Rng, Stream};
use sim::validate::validate;
use sim::vehicle::VehicleParams;
use std::ops::Range;

/// A lot and what it took.
#[derive(Debug, Clone)]
pub struct Generated {
    /// Valid and solvable in both directions.
    pub scenario: Scenario,
    /// Draws until this one, itself included: `1 − 1/mean` is the rejection rate.
    pub attempts: u32,
}

/// A lot of a split.
///
/// # Panics
/// When 1000 draws in a row are rejected; about one in ten is.
pub fn generate(split: Split, index: u64, difficulty: Difficulty) -> Generated {
    let seed = split.seed(difficulty, index);
    let vehicle = VehicleParams::hyundai_hg300();
    for attempt in 0..1000 {
        let name = format!("{}-{}-{index}", split.name(), difficulty.name());
        let mut layout_rng = seed.rng(Stream::Layout, attempt);
        let mut obstacle_rng = seed.rng(Stream::Obstacles, attempt);
        let scenario = draw(name, &Sheet::of(difficulty), &mut layout_rng, &mut obstacle_rng);
        if is_drivable(&scenario, &vehicle) {
            return Generated { scenario, attempts: attempt as u32 + 1 };
        }
    }
    panic!(
        "none of 1000 draws of {split:?} {difficulty:?} {index} can be driven; the generator's rules contradict each other"
    );
}

/// Valid and solvable in both directions.
fn is_drivable(scenario: &Scenario, vehicle: &VehicleParams) -> bool {
    let ways = Direction::BOTH.map(|direction| direction.of(scenario.clone()));
    ways.iter().all(|way| validate(way, vehicle).is_ok())
        && ways.iter().all(|way| solver::solve(way, vehicle, CLEARANCE_M).is_some())
}

/// What a difficulty means.
struct Sheet {
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

impl Sheet {
    /// Lane and gap of `Hard` are those of reference lots a and b; the solver's 0.25 m clearance needs gaps of 2.4 m.
    fn of(difficulty: Difficulty) -> Self {
        match difficulty {
            Difficulty::Easy => Self {
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
            },
            Difficulty::Medium => Self {
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
            },
            Difficulty::Hard => Self {
                lane_m: 3.0..4.6,
                corner_width_m: 5.5..6.0,
                inner_radius_m: 2.5..3.5,
                free_gap_m: 2.7..3.0,
                double_parked_share: 0.2..0.32,
                double_parked_yaw_deg: 6.0,
                opposite_clear_m: 8.0,
                nose_share: 0.08,
                bulge_m: 0.6..1.4,
                furniture: 1.4,
            },
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
const CORNER_CLEAR_M: f32 = 8.0;
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

fn draw(name: String, sheet: &Sheet, layout_rng: &mut Rng, obstacle_rng: &mut Rng) -> Scenario {
    let layout = draw_layout(sheet, layout_rng);
    let corridor = Corridor::draw(&layout.blueprint);
    let plan = ClutterPlan {
        free_gap_m: sheet.free_gap_m.start..=sheet.free_gap_m.end,
        double_parked_share: obstacle_rng.random_range(sheet.double_parked_share.clone()),
        corner_clear_m: CORNER_CLEAR_M,
        opposite_clear_m: sheet.opposite_clear_m,
        end_clear_m: END_CLEAR_M,
        double_parked_yaw_deg: sheet.double_parked_yaw_deg,
        stall_occupancy: obstacle_rng.random_range(0.6..0.95),
        nose_share: sheet.nose_share,
        furniture_per_100m: Furniture {
            cones: 3.0 * sheet.furniture,
            bollards: 1.5 * sheet.furniture,
            pillars: 2.5 * sheet.furniture,
            carts: 2.0 * sheet.furniture,
            people: 3.0 * sheet.furniture,
        },
        closed_arms: true,
    };
    let reserved: Vec<_> = layout
        .islands
        .iter()
        .map(|island| Intruder {
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
        name,
        reference_path: route_around(&corridor, &clutter.intruders),
        noise: NoiseSettings::default(),
        islands: layout.islands.iter().map(|plan| island(&corridor, plan)).collect(),
        obstacles,
        speed_bumps: clutter::speed_bumps(&corridor, SPEED_BUMP_EVERY_M),
        boundary: corridor.boundary,
    }
}

fn draw_layout(sheet: &Sheet, rng: &mut Rng) -> Layout {
    let total_m = rng.random_range(LEGS_M);
    let most_corners = (total_m / LEG_MIN_M) as usize - 1;
    let legs = 1 + rng.random_range(1..=most_corners.min(4));
    // Shares of what is left after every leg has its minimum.
    let shares: Vec<f32> = (0..legs).map(|_| rng.random_range(0.2..1.0)).collect();
    let spare_m = (total_m - legs as f32 * LEG_MIN_M) / shares.iter().sum::<f32>();
    let corners = draw_corners(sheet, legs - 1, rng);
    let mut islands = Vec::new();
    let legs = shares
        .iter()
        .enumerate()
        .map(|(i, share)| {
            let ends = (i.checked_sub(1).map(|before| &corners[before]), corners.get(i));
            draw_leg(sheet, i, LEG_MIN_M + share * spare_m, ends, &mut islands, rng)
        })
        .collect();
    let blueprint = Blueprint { legs, corners, path_radius_m: PATH_RADIUS_M, run_out_m: RUN_OUT_M };
    Layout { blueprint, islands }
}

/// Right angles mostly, else bends of 30–80°. The route never turns by more than 180° in sum, so that it does not
/// bite its own tail too often.
fn draw_corners(sheet: &Sheet, count: usize, rng: &mut Rng) -> Vec<CornerPlan> {
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
                width_m: rng.random_range(sheet.corner_width_m.clone()) - if gentle { 1.0 } else { 0.0 },
                reach_m: if gentle { 3.5 } else { 5.0 },
                taper_m: rng.random_range(4.5..5.5),
                inner_radius_m: rng.random_range(sheet.inner_radius_m.clone()),
            }
        })
        .collect()
}

fn draw_leg(
    sheet: &Sheet,
    index: usize,
    length_m: f32,
    (before, after): (Option<&CornerPlan>, Option<&CornerPlan>),
    islands: &mut Vec<IslandPlan>,
    rng: &mut Rng,
) -> LegPlan {
    let mut widths = draw_widths(sheet, length_m, rng);
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
                let offset_m = side.sign() * lerp(&sheet.bulge_m, size);
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
fn draw_widths(sheet: &Sheet, length_m: f32, rng: &mut Rng) -> Vec<WidthStep> {
    let mut widths = Vec::new();
    let mut at_m = -RUN_OUT_M;
    while at_m < length_m + RUN_OUT_M {
        widths.push(WidthStep { from_m: at_m, width_m: rng.random_range(sheet.lane_m.clone()) });
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

/// A post on an island, as high as a lamp: it hides little, but it is seen.
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

/// The middle of what intruders leave free: a car put back onto the route stands on free ground.
fn route_around(corridor: &Corridor, intruders: &[Intruder]) -> ReferencePath {
    const SAMPLE_M: f32 = 1.0;
    /// Bends of the route smaller than this are drawn straight, metres.
    const FLAT_M: f32 = 2e-3;
    let mut points = Vec::new();
    for (index, leg) in corridor.legs.iter().enumerate() {
        let (from_m, to_m) = (leg.lane_from_m.max(0.0), leg.lane_to_m.min(leg.length_m));
        let samples = ((to_m - from_m) / SAMPLE_M).floor() as usize;
        let way: Vec<Vec2> = (0..=samples)
            .map(|k| from_m + k as f32 * (to_m - from_m) / samples as f32)
            .map(|s_m| Vec2::new(s_m, leg.centre_m(s_m) + evasion_m(leg, index, intruders, s_m)))
            .collect();
        points.push(leg.world(0.0, if index == 0 { way[0].y } else { 0.0 }));
        let bends = way.windows(3).filter(|three| (three[0] + three[2] - 2.0 * three[1]).y.abs() > FLAT_M);
        points.extend(bends.map(|three| leg.world(three[1].x, three[1].y)));
        if index + 1 == corridor.legs.len() {
            points.push(leg.world(leg.length_m, way[samples].y));
        }
    }
    let points = points.into_iter().map(to_millimetres).collect();
    ReferencePath { points, corner_radius_m: PATH_RADIUS_M }
}

/// How far the route leaves the middle of the lane to share what is free beside intruders, metres to the left.
fn evasion_m(leg: &Leg, index: usize, intruders: &[Intruder], s_m: f32) -> f32 {
    /// Before and behind an intruder, metres. Intruders on opposite sides are at least 8 m apart.
    const RAMP_M: f32 = 7.0;
    /// Nothing is gained by more room than this to the side of the rear axle, metres.
    const ENOUGH_M: f32 = 1.6;
    Side::BOTH
        .iter()
        .map(|&side| {
            let largest_m = intruders
                .iter()
                .filter(|other| other.leg == index && other.side == side)
                .map(|other| {
                    let beside_m = (other.from_m - s_m).max(s_m - other.to_m).max(0.0);
                    let fade = 1.0 - (beside_m / RAMP_M).min(1.0);
                    // Smoothstep: no kink at either end.
                    let fade = fade * fade * (3.0 - 2.0 * fade);
                    let width_m = leg.width_m(s_m.clamp(other.from_m, other.to_m));
                    let wanted_m = (0.5 * (width_m - other.protrusion_m)).min(ENOUGH_M);
                    fade * (wanted_m - (0.5 * width_m - other.protrusion_m)).max(0.0)
                })
                .fold(0.0, f32::max);
            -side.sign() * largest_m
        })
        .sum()
}
