//! The three lots of the paper, rebuilt: length, corners and difficulty are its, the drawing is ours.
//!
//! The paper prints only lengths and pictures; turns and widths are those with which a scripted expert reaches the
//! paper's safe ratios .83/.72/.91 (expert-findings.md 3). A lot's geometry is fixed, its obstacles are drawn anew for
//! every trial.

use crate::clutter::{self, ClutterPlan, Furniture};
use crate::corridor::{Blueprint, Bulge, CornerPlan, Corridor, LegPlan, Side, WidthStep, rounded_length_m};
use rand::RngExt as _;
use sim::scenario::{NoiseSettings, Scenario};
use sim::seed::{Rng, RootSeed, Stream};
use std::ops::RangeInclusive;

/// Which of the three.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ReferenceLot {
    /// 231 m, S-shaped; the lot the paper trains on.
    A,
    /// 139 m, Z-shaped, the narrowest.
    B,
    /// 149 m, U-shaped, the widest.
    C,
}

impl ReferenceLot {
    /// In the paper's order.
    pub const ALL: [Self; 3] = [Self::A, Self::B, Self::C];

    /// Name on the command line and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::A => "lot-a",
            Self::B => "lot-b",
            Self::C => "lot-c",
        }
    }

    /// Length of the reference path, metres (paper; a is derived from its event counts, methods.md 0).
    pub fn length_m(self) -> f32 {
        self.sheet().length_m
    }

    fn sheet(self) -> Sheet {
        use Side::{Left, Right};
        match self {
            Self::A => Sheet {
                length_m: 231.0,
                legs_m: &[62.0, 28.0, 58.0, 30.0, 53.0],
                turns: &[Right, Right, Left, Left],
                lane_m: 2.9..=3.5,
                free_gap_m: 2.7..=3.1,
                double_parked_share: 0.24,
            },
            Self::B => Sheet {
                length_m: 139.0,
                legs_m: &[45.0, 34.0, 60.0],
                turns: &[Left, Right],
                lane_m: 2.7..=3.0,
                free_gap_m: 2.6..=2.8,
                double_parked_share: 0.29,
            },
            Self::C => Sheet {
                length_m: 149.0,
                legs_m: &[58.0, 33.0, 58.0],
                turns: &[Right, Right],
                lane_m: 3.3..=4.0,
                free_gap_m: 3.0..=3.4,
                double_parked_share: 0.23,
            },
        }
    }
}

/// Seed of the fixed geometry. Another number gives other lots of the same kind, and other results.
const LAYOUT_SEED: RootSeed = RootSeed(2020);
/// Radius of the reference path at corners, metres (methods.md 11).
const PATH_RADIUS_M: f32 = 5.0;
/// The lane goes on this far behind the finish: the 12 m patch ahead of a bumper at the finish, plus the car's front.
const RUN_OUT_M: f32 = 18.0;
/// Intruders keep this far from start and finish: the car's front at 3.8 m, and room to get going.
const END_CLEAR_M: f32 = 9.0;
/// Legs longer than this have a bulge, metres.
const BULGE_FROM_LEG_M: f32 = 40.0;
const BULGE_LENGTH_M: f32 = 14.0;
/// One speed bump per this much route, metres (methods.md 11).
const SPEED_BUMP_EVERY_M: f32 = 60.0;

/// A row of the table in expert-findings.md 3.
struct Sheet {
    /// Of the rounded route.
    length_m: f32,
    legs_m: &'static [f32],
    turns: &'static [Side],
    /// Free lane between corners, re-drawn every 9–18 m.
    lane_m: RangeInclusive<f32>,
    /// Beside anything that narrows it.
    free_gap_m: RangeInclusive<f32>,
    double_parked_share: f32,
}

/// A reference lot with the obstacles of one trial.
pub fn lot(which: ReferenceLot, seed: RootSeed) -> Scenario {
    let sheet = which.sheet();
    let corridor = Corridor::draw(&blueprint(which));
    let plan = ClutterPlan {
        free_gap_m: sheet.free_gap_m,
        double_parked_share: sheet.double_parked_share,
        corner_clear_m: 8.0,
        opposite_clear_m: 8.0,
        end_clear_m: END_CLEAR_M,
        stall_occupancy: 0.85,
        nose_share: 0.03,
        furniture_per_100m: Furniture { cones: 2.5, bollards: 1.5, pillars: 2.5, carts: 1.5, people: 3.0 },
        closed_arms: true,
    };
    let mut rng = seed.rng(Stream::Obstacles, which as u64);
    let obstacles = clutter::place(&corridor, &plan, &[], &mut rng);
    let speed_bumps = clutter::speed_bumps(&corridor, SPEED_BUMP_EVERY_M);
    Scenario {
        name: which.name().to_owned(),
        boundary: corridor.boundary,
        reference_path: corridor.reference_path,
        noise: NoiseSettings::default(),
        islands: Vec::new(),
        obstacles,
        speed_bumps,
    }
}

/// The fixed geometry of a lot.
pub fn blueprint(which: ReferenceLot) -> Blueprint {
    let sheet = which.sheet();
    let corners: Vec<_> = sheet.turns.iter().map(|&side| CornerPlan::right_angle(side)).collect();
    // Rounded corners cut the route, bulges lengthen it: the legs make up for both, so that the length is the paper's.
    let nominal = draw_blueprint(which, &sheet, &corners, 0.0);
    let missing_m = sheet.length_m - rounded_length_m(&Corridor::draw(&nominal).reference_path);
    draw_blueprint(which, &sheet, &corners, missing_m / sheet.legs_m.len() as f32)
}

fn draw_blueprint(which: ReferenceLot, sheet: &Sheet, corners: &[CornerPlan], longer_m: f32) -> Blueprint {
    let corner_extent_m = CornerPlan::right_angle(Side::Left).extent_m();
    let legs = sheet
        .legs_m
        .iter()
        .enumerate()
        .map(|(i, nominal_m)| {
            // A stream per leg: a longer leg may draw one more width, which must not change the next leg's bulge.
            let mut rng = LAYOUT_SEED.rng(Stream::Layout, (which as u64) << 8 | i as u64);
            let length_m = nominal_m + longer_m;
            let has_corner_before = i > 0;
            let has_corner_after = i < corners.len();
            let from_m = if has_corner_before { corner_extent_m } else { END_CLEAR_M };
            let to_m = length_m - if has_corner_after { corner_extent_m } else { END_CLEAR_M };
            let bulge = (*nominal_m > BULGE_FROM_LEG_M).then(|| draw_bulge(from_m, to_m, &mut rng));
            let run_out = (if has_corner_before { 0.0 } else { -RUN_OUT_M }, length_m + RUN_OUT_M);
            let widths = draw_widths(&sheet.lane_m, run_out, &mut rng);
            LegPlan { length_m, widths, bulge, branches: Vec::new() }
        })
        .collect();
    Blueprint { legs, corners: corners.to_vec(), path_radius_m: PATH_RADIUS_M, run_out_m: RUN_OUT_M }
}

fn draw_bulge(from_m: f32, to_m: f32, rng: &mut Rng) -> Bulge {
    let half_m = 0.5 * BULGE_LENGTH_M;
    let fraction: f32 = rng.random();
    let side = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
    Bulge {
        centre_m: from_m + half_m + fraction * (to_m - from_m - BULGE_LENGTH_M),
        offset_m: side * rng.random_range(0.56..0.8),
        length_m: BULGE_LENGTH_M,
    }
}

/// A new width every 9–18 m.
fn draw_widths(lane_m: &RangeInclusive<f32>, (from_m, to_m): (f32, f32), rng: &mut Rng) -> Vec<WidthStep> {
    let mut widths = Vec::new();
    let mut at_m = from_m;
    while at_m < to_m {
        widths.push(WidthStep { from_m: at_m, width_m: rng.random_range(lane_m.clone()) });
        at_m += rng.random_range(9.0..18.0);
    }
    widths
}
