//! Tentacles (paper, "Tentacle Algorithm"; docs/methods.md 6): 81 candidate paths, the cheapest is driven.
//!
//! J = 1·V_clear + 0·V_flat + 0·V_traj + 0.3·V_fwd (paper). The flatness term needs probabilities and the trajectory term
//! a global path; the grid has neither, so they have no parameter here.
//!
//! - V_clear = "the proportion of obstacles around the candidate path": occupied cells over all cells whose centres lie
//!   within the detection range of the path. Cells before the lower edge of the patch are unseen and count as free;
//!   what lies outside the patch elsewhere counts neither way.
//! - V_fwd = |κ_k|/κ_max, "the least curvature".
//!
//! For every steering angle to start from, the cells around each path are tabulated once; a decision is 81 masked
//! popcounts.

use crate::context::{PlannerContext, WheelEstimate};
use crate::explanation::CandidatePath;
use crate::method::{Method, Reading, within};
use crate::search::{Dimension, Span};
use serde::{Deserialize, Serialize};
use sim::driver::{Decision, Policy};
use sim::geometry::{Pose, Vec2};
use sim::maths;
use sim::sensing::{GRID_CELLS, OccupancyGrid};
use sim::sensing::{GridGeometry, Observation};
use std::sync::Arc;

/// Candidate paths on each side of the middle one: 81 in all (paper).
const SIDE: usize = 40;
/// Tabulated steering angles to start from on each side of straight: 0.9° apart.
const STARTS: usize = 40;
/// Between two samples of a path, metres.
const SAMPLE_M: f32 = 0.2;
/// Samples from one point of a path in pictures to the next.
const SAMPLES_PER_M: usize = 5;

/// Half the body width (0.93 m) plus the paper's safety distance of 0.15 m. The paper says "0.35 m, which is the width of
/// the vehicle (0.2 m) plus the safety distance (0.15 m)"; 0.2 m is no car's width (docs/methods.md 6.4).
pub const DETECTION_RANGE_M: f32 = 1.08;
/// The paper's 0.35 m taken literally: narrower than the body, so the car hits what the path misses.
pub const DETECTION_RANGE_LITERAL_M: f32 = 0.35;

/// Parameters of the tentacles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Shape of the paths. Default clothoids: "the curvature of the candidate path gradually increases" (*paper*).
    pub set: TentacleSet,
    /// Which point of the car a path is the path of.
    pub path_origin: PathOrigin,
    /// Cells within this distance of a path are looked at, metres. 1.08 (*chosen*, see [`DETECTION_RANGE_M`]); the
    /// literal reading is [`DETECTION_RANGE_LITERAL_M`].
    pub detection_range_m: f32,
    /// Weight of V_fwd, that of V_clear being 1: 0.3 (*paper*).
    pub forward_weight: f32,
    /// Curvature of the outermost clothoid, 1/m: 0.251, full lock (*derived*). Unused by the arcs of 2008.
    pub curvature_max_per_m: f32,
    /// Length of the outermost clothoid, metres; the middle one is twice as long: 6.5 (*cited*: authors' helper). Unused
    /// by the arcs of 2008.
    pub length_min_m: f32,
    /// Speed at which a clothoid turns the wheels, m/s: 2.2, "a set of candidate paths for 2.2 m/s was used" (*paper*).
    /// Unused by the arcs of 2008.
    pub speed_mps: f32,
}

/// Which set of candidate paths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TentacleSet {
    /// From the present steering angle to one of 81 as fast as the wheels turn (docs/methods.md 6.4).
    ClothoidSteer,
    /// Circular arcs of speed set j = 0…15 of von Hundelshausen 2008 (docs/methods.md 6.1; growth of the radii and of the
    /// lengths *recalled*). The set nearest 2.2 m/s is j = 4; its tightest radius of 11.3 m takes no corner of a lot.
    Arc2008(u8),
}

/// Which point of the car a candidate path is the path of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PathOrigin {
    /// The middle of the front bumper (*chosen*): at full lock the rear axle never reaches the patch, so its path would be
    /// scored on unseen ground and win whenever the front is blocked (docs/methods.md 6.4).
    FrontBumper,
    /// The rear axle.
    RearAxle,
    /// A rear axle 1.0 m below the patch (*cited*: authors' helper).
    BelowPatch,
}

impl PathOrigin {
    const OPTIONS: [Self; 3] = [Self::FrontBumper, Self::RearAxle, Self::BelowPatch];
}

impl Params {
    /// The paper's parameters except for its detection range, which is taken literally.
    fn literal_range() -> Self {
        Self { detection_range_m: DETECTION_RANGE_LITERAL_M, ..Self::paper() }
    }

    /// Shorter paths, 4.5 m to 9 m: what of the lengths that were tried on lot a does best.
    fn short() -> Self {
        Self { length_min_m: 4.5, ..Self::paper() }
    }

    /// The arcs of 2008 whose speed is nearest the paper's 2.2 m/s.
    fn arcs_of_2008() -> Self {
        Self { set: TentacleSet::Arc2008(4), ..Self::paper() }
    }

    /// The final curvature and the length of each of the 81 paths, from the outermost right to the outermost left.
    fn paths(&self) -> Vec<(f32, f32)> {
        match self.set {
            TentacleSet::ClothoidSteer => spread_curvatures(SIDE as i32, self.curvature_max_per_m, 2.0)
                .into_iter()
                .zip(-(SIDE as i32)..)
                .map(|(curvature, k)| (curvature, self.length_min_m * (2.0 - k.abs() as f32 / SIDE as f32)))
                .collect(),
            TentacleSet::Arc2008(j) => {
                let q = f32::from(j) / 15.0;
                let outermost_m = 8.0 + 33.5 * maths::pow(q, 1.2); // l_j
                let curvature_max = 1.2 * std::f32::consts::FRAC_PI_2 * (1.0 - maths::pow(q, 0.9)) / outermost_m; // 1/R_j
                // k = 0 is the outermost and shortest, k = 40 straight.
                let path = |k: usize| {
                    let curvature = if k == SIDE { 0.0 } else { curvature_max / maths::pow(1.15, k as f32) };
                    (curvature, outermost_m + 20.0 * (k as f32 / SIDE as f32).sqrt())
                };
                let left = (0..SIDE).rev().map(path);
                let right = (0..=SIDE).map(|k| (-path(k).0, path(k).1));
                right.chain(left).collect()
            }
        }
    }
}

impl Method for Params {
    const NAME: &'static str = "tentacle";
    const ABOUT: &'static str =
        "81 clothoid paths, fewest occupied cells around and least curvature; the paper's parameters";
    const SEARCH: &'static [Dimension<Self>] = &[
        Dimension {
            name: "detection_range_m",
            span: Span::Linear(0.35, 1.8),
            get: |p| p.detection_range_m,
            set: |p, value| p.detection_range_m = value,
        },
        Dimension {
            name: "forward_weight",
            span: Span::Log(0.02, 2.0),
            get: |p| p.forward_weight,
            set: |p, value| p.forward_weight = value,
        },
        Dimension {
            name: "curvature_max_per_m",
            span: Span::Linear(0.15, 0.251),
            get: |p| p.curvature_max_per_m,
            set: |p, value| p.curvature_max_per_m = value,
        },
        Dimension {
            name: "length_min_m",
            span: Span::Linear(2.5, 9.0),
            get: |p| p.length_min_m,
            set: |p, value| p.length_min_m = value,
        },
        Dimension {
            name: "speed_mps",
            span: Span::Linear(0.2, 2.2),
            get: |p| p.speed_mps,
            set: |p, value| p.speed_mps = value,
        },
        Dimension {
            name: "path_origin",
            span: Span::Choice(3),
            get: |p| PathOrigin::OPTIONS.iter().position(|option| *option == p.path_origin).unwrap_or(0) as f32,
            set: |p, index| p.path_origin = PathOrigin::OPTIONS[index as usize],
        },
    ];
    const READINGS: &'static [Reading<Self>] = &[
        Reading { name: "short", about: "paths of 4.5 m at least, not 6.5 m", params: Params::short },
        Reading { name: "literal", about: "the detection range of 0.35 m as printed", params: Params::literal_range },
        Reading { name: "2008", about: "circular arcs of speed set 4 of 2008", params: Params::arcs_of_2008 },
    ];
    type Planner = Tentacles;

    fn paper() -> Self {
        Self {
            set: TentacleSet::ClothoidSteer,
            path_origin: PathOrigin::FrontBumper,
            detection_range_m: DETECTION_RANGE_M,
            forward_weight: 0.3,
            curvature_max_per_m: 0.251,
            length_min_m: 6.5,
            speed_mps: 2.2,
        }
    }

    fn check(&self) -> Result<(), String> {
        if let TentacleSet::Arc2008(j) = self.set {
            within("set.arc2008", f32::from(j), 0.0, 15.0)?;
        }
        within("detection_range_m", self.detection_range_m, 0.1, 4.0)?;
        within("forward_weight", self.forward_weight, 0.0, 100.0)?;
        within("curvature_max_per_m", self.curvature_max_per_m, 0.01, 0.5)?;
        within("length_min_m", self.length_min_m, 1.0, 20.0)?;
        within("speed_mps", self.speed_mps, 0.1, 10.0)
    }

    fn planner(&self, context: &PlannerContext) -> Tentacles {
        Tentacles::new(self, context)
    }
}

/// The cells within the detection range of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Around {
    /// Within the patch; bit = column.
    cells: [u32; GRID_CELLS],
    /// Number of all, unseen ones before the patch included.
    count: u32,
}

impl Around {
    /// V_clear: occupied cells over all cells.
    fn share_occupied(&self, grid: &OccupancyGrid) -> f32 {
        let occupied: u32 =
            self.cells.iter().enumerate().map(|(row, cells)| (cells & grid.row(row)).count_ones()).sum();
        occupied as f32 / self.count.max(1) as f32
    }

    fn mirrored(&self) -> Self {
        Self { cells: self.cells.map(|row| row.reverse_bits() >> (32 - GRID_CELLS)), count: self.count }
    }
}

/// Tentacles at the wheel.
#[derive(Debug, Clone)]
pub struct Tentacles {
    params: Params,
    context: Arc<PlannerContext>,
    /// Starting angles by candidate paths.
    around: Arc<Vec<Vec<Around>>>,
    /// Final curvature and weighted V_fwd of each candidate.
    candidates: Arc<Vec<(f32, f32)>>,
    wheel: WheelEstimate,
    previous: usize,
}

impl Tentacles {
    fn new(params: &Params, context: &PlannerContext) -> Self {
        let paths = params.paths();
        let outermost = paths[0].0.abs().max(f32::MIN_POSITIVE);
        let candidates = paths.iter().map(|(kappa, _)| (*kappa, params.forward_weight * kappa.abs() / outermost));
        let starts = if params.set == TentacleSet::ClothoidSteer { STARTS } else { 0 };
        let start_rad = |start: usize| context.vehicle.steering_max_rad * start as f32 / STARTS as f32;
        // To the left and straight; the right half is the mirror image, to the bit.
        let mut left: Vec<Vec<Around>> = (0..=starts)
            .map(|start| paths.iter().map(|path| around_path(params, context, start_rad(start), *path)).collect())
            .collect();
        for k in 0..SIDE {
            left[0][k] = left[0][2 * SIDE - k].mirrored();
        }
        let right = left[1..].iter().rev().map(|paths| paths.iter().rev().map(Around::mirrored).collect());
        let around = right.chain(left.iter().cloned()).collect();
        Self {
            params: params.clone(),
            context: Arc::new(context.clone()),
            around: Arc::new(around),
            candidates: Arc::new(candidates.collect()),
            wheel: WheelEstimate::new(context),
            previous: SIDE,
        }
    }

    /// Index of the tabulated starting angle nearest to a steering angle.
    fn start(&self, steering_rad: f32) -> usize {
        let straight = (self.around.len() / 2) as f32;
        // The wheel is commanded by the curvature of a path, which may ask for more than the car can.
        let share = (steering_rad / self.context.vehicle.steering_max_rad).clamp(-1.0, 1.0);
        (straight + (share * straight).round()) as usize
    }

    /// J of every candidate from a starting angle.
    fn costs<'a>(&'a self, grid: &'a OccupancyGrid, steering_rad: f32) -> impl Iterator<Item = f32> + 'a {
        let around = &self.around[self.start(steering_rad)];
        around.iter().zip(self.candidates.iter()).map(|(around, (_, forward))| around.share_occupied(grid) + forward)
    }

    /// The paths of the last answer with their costs.
    pub(crate) fn weighed(&self, grid: &OccupancyGrid) -> Vec<CandidatePath> {
        let start_rad = self.wheel.steering_rad;
        let straight = (self.around.len() / 2) as f32;
        let tabulated_rad = match straight {
            0.0 => start_rad,
            _ => (self.start(start_rad) as f32 - straight) / straight * self.context.vehicle.steering_max_rad,
        };
        let weighed = |(k, (path, cost)): (usize, ((f32, f32), f32))| {
            let points = points(&self.params, &self.context, tabulated_rad, path).step_by(SAMPLES_PER_M).collect();
            CandidatePath { points, cost, is_chosen: k == self.previous }
        };
        self.params.paths().into_iter().zip(self.costs(grid, start_rad)).enumerate().map(weighed).collect()
    }

    /// The cheapest; among equals the straightest, then the one driven last, then the left one.
    fn choose(&self, grid: &OccupancyGrid, steering_rad: f32) -> usize {
        let rank = |k: usize| (k.abs_diff(SIDE), usize::from(k != self.previous), usize::from(k < SIDE));
        let (mut best, mut best_cost) = (SIDE, f32::INFINITY);
        for (k, cost) in self.costs(grid, steering_rad).enumerate() {
            if cost < best_cost || (cost == best_cost && rank(k) < rank(best)) {
                (best, best_cost) = (k, cost);
            }
        }
        best
    }
}

impl Policy for Tentacles {
    fn act(&mut self, observation: &Observation) -> Decision {
        let steering_rad = self.wheel.advance();
        self.previous = self.choose(&observation.grid, steering_rad);
        let curvature_per_m = self.candidates[self.previous].0;
        self.wheel.command_rad = self.context.steering_rad(curvature_per_m);
        self.context.steer_along(curvature_per_m)
    }

    fn reset(&mut self) {
        self.wheel.reset();
        self.previous = SIDE;
    }
}

/// The cells around one path.
fn around_path(params: &Params, context: &PlannerContext, start_rad: f32, path: (f32, f32)) -> Around {
    let mut marks = Marks::new(&context.geometry, params.detection_range_m);
    points(params, context, start_rad, path).for_each(|point| marks.mark(point));
    marks.around()
}

/// One path in the ego frame. A clothoid turns the wheels from `start_rad` to the final curvature over the travel
/// s_r = v|δ_k − δ_0|/δ̇, at least 0.3 m.
fn points(
    params: &Params,
    context: &PlannerContext,
    start_rad: f32,
    (curvature_per_m, length_m): (f32, f32),
) -> impl Iterator<Item = Vec2> {
    let (start_per_m, ramp_m) = match params.set {
        TentacleSet::ClothoidSteer => {
            let turn_rad = (context.steering_rad(curvature_per_m) - start_rad).abs();
            let ramp_m = (params.speed_mps * turn_rad / context.vehicle.steering_rate_max_radps).max(0.3);
            (context.curvature_per_m(start_rad), ramp_m)
        }
        TentacleSet::Arc2008(_) => (curvature_per_m, 1.0),
    };
    let (axle_m, ahead_of_axle_m) = match params.path_origin {
        PathOrigin::FrontBumper => (0.0, context.vehicle.front_m()),
        PathOrigin::RearAxle => (0.0, 0.0),
        PathOrigin::BelowPatch => (context.geometry.near_edge_ahead_m - 1.0, 0.0),
    };
    let mut pose = Pose::new(Vec2::new(axle_m, 0.0), 0.0);
    let samples = (length_m / SAMPLE_M).round() as usize;
    (0..=samples).map(move |sample| {
        let point = pose.position() + ahead_of_axle_m * pose.ahead();
        let travelled = ((sample as f32 + 0.5) * SAMPLE_M / ramp_m).min(1.0);
        pose = pose.advanced_along_arc(start_per_m + (curvature_per_m - start_per_m) * travelled, SAMPLE_M);
        point
    })
}

/// Marks cells near points.
struct Marks<'a> {
    geometry: &'a GridGeometry,
    range_m: f32,
    /// Rows beyond the grid's are the unseen ones before the patch, as many as are needed.
    rows: Vec<u32>,
}

impl<'a> Marks<'a> {
    fn new(geometry: &'a GridGeometry, range_m: f32) -> Self {
        Self { geometry, range_m, rows: vec![0; GRID_CELLS] }
    }

    /// Marks all cells whose centres are within range of a point, unless the point has left the patch sideways or ahead.
    fn mark(&mut self, point: Vec2) {
        let (cell_m, half_m) = (self.geometry.cell_m(), 0.5 * self.geometry.side_m);
        let far_m = self.geometry.far_edge_ahead_m();
        if point.x > far_m || point.y.abs() > half_m {
            return;
        }
        // How many rows of cells lie between the far edge and a place.
        let rows_to = |ahead_m: f32| ((far_m - ahead_m) / cell_m) as usize;
        let (first, end) = (rows_to(point.x + self.range_m).saturating_sub(1), rows_to(point.x - self.range_m) + 1);
        self.rows.resize(self.rows.len().max(end), 0);
        for (row, cells) in self.rows.iter_mut().enumerate().take(end).skip(first) {
            let ahead_m = far_m - (row as f32 + 0.5) * cell_m - point.x;
            let left_sq = self.range_m * self.range_m - ahead_m * ahead_m;
            if left_sq < 0.0 {
                continue;
            }
            for col in 0..GRID_CELLS {
                let left_m = (0.5 * GRID_CELLS as f32 - 0.5 - col as f32) * cell_m - point.y;
                *cells |= u32::from(left_m * left_m <= left_sq) << col;
            }
        }
    }

    fn around(&self) -> Around {
        let mut cells = [0; GRID_CELLS];
        cells.copy_from_slice(&self.rows[..GRID_CELLS]);
        Around { cells, count: self.rows.iter().map(|row| row.count_ones()).sum() }
    }
}

/// Curvatures from −max to max, `2 · side + 1` of them, dense near zero: κ_k = κ_max·sgn(k)(|k|/side)^power.
fn spread_curvatures(side: i32, max_per_m: f32, power: f32) -> Vec<f32> {
    let share = |k: i32| maths::pow(k.abs() as f32 / side as f32, power);
    (-side..=side).map(|k| k.signum() as f32 * max_per_m * share(k)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{context, grid_with};

    fn paper() -> Tentacles {
        Params::paper().planner(&context())
    }

    /// Straight path of the bumper from X 3.80 on, range 1.08 m: 5 columns (|Y| ≤ 0.96) in all 25 rows; of the unseen
    /// rows at X 4.06 and 3.58 five cells each, at 3.10 (0.70 m behind the start) the three within 0.82 m, at 2.62 none.
    #[test]
    fn clearance_is_the_share_of_occupied_cells_around_the_path() {
        let planner = paper();
        let cost_of_straight = |grid: &OccupancyGrid| planner.costs(grid, 0.0).nth(SIDE).unwrap();
        assert_eq!(planner.around[STARTS][SIDE].count, 125 + 13);
        assert_eq!(cost_of_straight(&OccupancyGrid::free()), 0.0);
        // Columns 10…14 are around the path; two of these three cells lie in them.
        assert_eq!(cost_of_straight(&grid_with(&[(3, 12), (20, 10), (20, 9)])), 2.0 / 138.0);
        assert_eq!(cost_of_straight(&OccupancyGrid::occupied()), 125.0 / 138.0);
    }

    /// Paths may be tighter than the car can drive; to the left the table of starting angles ended before them.
    #[test]
    fn a_wheel_beyond_its_limit_starts_at_the_last_angle() {
        let planner = paper();
        let limit_rad = context().vehicle.steering_max_rad;
        assert_eq!(
            [-2.0, -1.0, 0.0, 1.0, 2.0].map(|share| planner.start(share * limit_rad)),
            [0, 0, STARTS, 2 * STARTS, 2 * STARTS]
        );
        let mut tight = Params { curvature_max_per_m: 0.5, ..Params::paper() }.planner(&context());
        let observation = Observation { grid: grid_with(&[(20, 12), (20, 13), (20, 14), (20, 15)]) };
        for _ in 0..200 {
            assert!(tight.act(&observation).look_ahead.ahead_m.is_finite());
        }
    }

    /// Of small cells, those behind the twenty-fourth row before the patch did not count.
    #[test]
    fn unseen_cells_count_however_small_they_are() {
        let mut context = context();
        context.geometry.side_m = 3.0;
        let params = Params { path_origin: PathOrigin::RearAxle, detection_range_m: 1.01, ..Params::paper() };
        let (cell_m, far_m) = (context.geometry.cell_m(), context.geometry.far_edge_ahead_m());
        let path: Vec<Vec2> =
            points(&params, &context, 0.0, params.paths()[SIDE]).filter(|point| point.x <= far_m).collect();
        let is_near = |&(row, col): &(u8, u8)| {
            let centre = Vec2::new(far_m - (f32::from(row) + 0.5) * cell_m, (12.0 - f32::from(col)) * cell_m);
            path.iter().any(|point| point.distance(centre) <= params.detection_range_m)
        };
        let n_near = (0..100).flat_map(|row| (0..GRID_CELLS as u8).map(move |col| (row, col))).filter(is_near).count();
        assert_eq!(params.planner(&context).around[STARTS][SIDE].count as usize, n_near);
    }

    #[test]
    fn forward_is_the_share_of_the_largest_curvature() {
        let planner = paper();
        let costs: Vec<f32> = planner.costs(&OccupancyGrid::free(), 0.0).collect();
        assert_eq!(costs.len(), 81);
        // 0.3·(k/40)² at k = 40, 20, 0.
        for (index, expected) in [(0, 0.3), (80, 0.3), (60, 0.075), (20, 0.075), (40, 0.0)] {
            assert!((costs[index] - expected).abs() < 1e-6, "{index}: {}", costs[index]);
        }
    }

    #[test]
    fn a_free_lane_is_driven_straight_and_a_block_is_passed() {
        let mut planner = paper();
        let answer = planner.act(&Observation { grid: OccupancyGrid::free() }).look_ahead;
        assert_eq!(answer.left_m, 0.0);
        // Everything to the right and a bit to the left of the axis is blocked, five metres ahead: to the left.
        let mut grid = OccupancyGrid::free();
        for row in 8..14 {
            grid.occupy_row(row, !0 << 11);
        }
        assert!(planner.act(&Observation { grid }).look_ahead.left_m > 0.5);
    }

    /// docs/methods.md 6.1: set j = 4 is 14.9 m long at the outermost path, whose radius is 11.3 m.
    #[test]
    fn arcs_of_2008_match_the_published_set() {
        let params = Params { set: TentacleSet::Arc2008(4), ..Params::paper() };
        let paths = params.paths();
        assert_eq!(paths.len(), 81);
        assert!((paths[80].0.recip() - 11.3).abs() < 0.05 && (paths[80].1 - 14.9).abs() < 0.05, "{:?}", paths[80]);
        assert_eq!(paths[40].0, 0.0);
        assert!((paths[40].1 - 34.9).abs() < 0.05);
        assert!((paths[79].0 * 1.15 - paths[80].0).abs() < 1e-6);
        assert_eq!(paths[0], (-paths[80].0, paths[80].1));
    }

    /// From wheels at full left lock, a clothoid to full right still swings left first: 2·35.5° at 19.7°/s take 3.6 s.
    #[test]
    fn a_clothoid_starts_with_the_present_steering() {
        let planner = paper();
        let rightmost_ahead = planner.around[STARTS][0];
        let rightmost_from_left = planner.around[2 * STARTS][0];
        let left_half = |around: &Around| around.cells.iter().map(|row| (row & 0xFFF).count_ones()).sum::<u32>();
        assert!(left_half(&rightmost_from_left) > left_half(&rightmost_ahead) + 20);
    }

    #[test]
    fn the_literal_range_looks_at_a_strip_narrower_than_the_body() {
        let planner = Params::literal_range().planner(&context());
        assert_eq!(planner.around[STARTS][SIDE].cells[10].count_ones(), 1);
    }
}
