//! What was seen of the ground around the car, moved along by odometry.
//!
//! A cell of the grid is occupied if any of its ground is, so a single grid makes obstacles up to a cell larger than they
//! are. Seen from many places, a point stays blocked only if every cell that it fell into was occupied: free ground counts
//! for more than occupied ground, and the map becomes finer than the grids that it is made of. It also outvotes noise that
//! comes and goes.

use sim::geometry::{Pose, Vec2};
use sim::sensing::{GRID_CELLS, GridGeometry, Observation, OccupancyGrid};

/// Side of a cell of the map, metres: a third of the paper's grid cell.
pub const CELL_M: f32 = 0.16;
/// Cells per side of the map, which follows the car; a power of two.
const SIDE: usize = 256;
/// Ground farther ahead of the rear axle than this is not remembered, metres: it is seen again from nearer by.
const REACH_M: f32 = 12.5;
/// What a cell seen occupied adds to the evidence, and what one seen free takes off.
const OCCUPIED: i8 = 1;
const FREE: i8 = 2;
/// Bounds of the evidence: how often a cell must be seen otherwise to change its state.
const EVIDENCE_MIN: i8 = -6;
const EVIDENCE_MAX: i8 = 6;

/// Remembered ground in the frame in which the car was put down.
#[derive(Debug, Clone)]
pub struct LocalMap {
    geometry: GridGeometry,
    car: Pose,
    /// Above 0 is blocked; by cell of the odometry frame, modulo [`SIDE`] in both directions.
    evidence: Vec<i8>,
    /// Lowest cell of the window, x and y.
    window: [i32; 2],
    last: OccupancyGrid,
    threshold: i8,
}

impl LocalMap {
    /// Nothing seen yet: all ground counts as free.
    pub fn new(geometry: GridGeometry) -> Self {
        let car = Pose::default();
        let window = window_around(car);
        Self {
            geometry,
            car,
            evidence: vec![0; SIDE * SIDE],
            window,
            last: OccupancyGrid::free(),
            threshold: crate::settings::env("S_THR", 0.0) as i8,
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.evidence.fill(0);
        self.car = Pose::default();
        self.window = window_around(self.car);
        self.last = OccupancyGrid::free();
    }

    /// The car in the map's frame.
    pub fn car(&self) -> Pose {
        self.car
    }

    /// Moves the car on and adds what it sees.
    pub fn update(&mut self, observation: &Observation) {
        self.car = self.car.followed_by(observation.odometry.since_last);
        self.scroll();
        // A dropped frame repeats the last grid, which was seen from elsewhere.
        if observation.grid != self.last {
            self.add(&observation.grid);
            self.last = observation.grid;
        }
    }

    /// Whether a point of the map's frame has been seen to be blocked.
    #[inline]
    pub fn is_blocked(&self, point: Vec2) -> bool {
        let [x, y] = cell_of(point);
        let is_inside =
            (x - self.window[0]).cast_unsigned() < SIDE as u32 && (y - self.window[1]).cast_unsigned() < SIDE as u32;
        is_inside && self.evidence[index(x, y)] > self.threshold
    }

    /// Forgets what has left the window around the car.
    fn scroll(&mut self) {
        let [from_x, from_y] = self.window;
        let to = window_around(self.car);
        let entered = |from: i32, to: i32| if to > from { from + SIDE as i32..to + SIDE as i32 } else { to..from };
        for x in entered(from_x, to[0]) {
            for y in 0..SIDE as i32 {
                self.evidence[index(x, y)] = 0;
            }
        }
        for y in entered(from_y, to[1]) {
            let row = index(0, y);
            self.evidence[row..row + SIDE].fill(0);
        }
        self.window = to;
    }

    fn add(&mut self, grid: &OccupancyGrid) {
        let GridGeometry { side_m, near_edge_ahead_m } = self.geometry;
        let half_m = 0.5 * side_m;
        let far_m = self.geometry.far_edge_ahead_m().min(REACH_M);
        let cells_per_m = 1.0 / self.geometry.cell_m();
        let ego = self.car.world_from_ego();
        let (cos, sin) = (ego.rotation.x, ego.rotation.y);
        let corners = [(near_edge_ahead_m, -half_m), (near_edge_ahead_m, half_m), (far_m, -half_m), (far_m, half_m)]
            .map(|(ahead_m, left_m)| ego.point(Vec2::new(ahead_m, left_m)));
        let low_y = corners.iter().map(|p| p.y).fold(f32::INFINITY, f32::min);
        let high_y = corners.iter().map(|p| p.y).fold(f32::NEG_INFINITY, f32::max);
        for y in (low_y / CELL_M).floor() as i32..=(high_y / CELL_M).floor() as i32 {
            // Along a row of the map, ahead and left are linear in x.
            let dy = (y as f32 + 0.5) * CELL_M - ego.translation.y;
            let (ahead_0, left_0) = (sin * dy - cos * ego.translation.x, cos * dy + sin * ego.translation.x);
            let (a_from, a_to) = within(ahead_0, cos, near_edge_ahead_m, far_m);
            let (l_from, l_to) = within(left_0, -sin, -half_m, half_m);
            let (from_m, to_m) = (a_from.max(l_from), a_to.min(l_to));
            if from_m >= to_m {
                continue;
            }
            let (first, end) = ((from_m / CELL_M - 0.5).ceil() as i32, (to_m / CELL_M - 0.5).ceil() as i32);
            for x in first..end {
                let x_m = (x as f32 + 0.5) * CELL_M;
                let (ahead_m, left_m) = (ahead_0 + cos * x_m, left_0 - sin * x_m);
                let row = GRID_CELLS as i32 - 1 - ((ahead_m - near_edge_ahead_m) * cells_per_m) as i32;
                let col = ((half_m - left_m) * cells_per_m) as i32;
                let (row, col) = (row.clamp(0, GRID_CELLS as i32 - 1), col.clamp(0, GRID_CELLS as i32 - 1));
                let evidence = &mut self.evidence[index(x, y)];
                *evidence = if grid.is_occupied(row as usize, col as usize) {
                    (*evidence + OCCUPIED).min(EVIDENCE_MAX)
                } else {
                    (*evidence - FREE).max(EVIDENCE_MIN)
                };
            }
        }
    }
}

/// Where `at_0 + slope · x` lies between two bounds.
fn within(at_0: f32, slope: f32, low: f32, high: f32) -> (f32, f32) {
    if slope.abs() < 1e-6 {
        return if (low..=high).contains(&at_0) { (f32::NEG_INFINITY, f32::INFINITY) } else { (0.0, 0.0) };
    }
    let (a, b) = ((low - at_0) / slope, (high - at_0) / slope);
    (a.min(b), a.max(b))
}

fn cell_of(point: Vec2) -> [i32; 2] {
    (point / CELL_M).floor().as_ivec2().to_array()
}

fn window_around(car: Pose) -> [i32; 2] {
    cell_of(car.position()).map(|cell| cell - SIDE as i32 / 2)
}

#[inline]
fn index(x: i32, y: i32) -> usize {
    let wrapped = |cell: i32| cell.cast_unsigned() as usize % SIDE;
    wrapped(y) * SIDE + wrapped(x)
}
