//! Proves that a lot can be driven: a hybrid A* of the kinematic car, forward only.
//!
//! Independent of the expert, of the map and of the collision queries it will be judged with: it reads the scenario and
//! has its own exact footprint test. A waypoint is free when the body, larger by a clearance all round, stands free there,
//! and the body 0.5 m farther along the present arc too (with a margin): the near-collision rule looks that far ahead.

use crate::corridor::segments_cross;
use crate::neighbours;
use crate::open_list::Open;
use sim::geometry::{Pose, Vec2, distance_to_segment_m, edges};
use sim::maths;
use sim::scenario::Scenario;
use sim::vehicle::VehicleSettings;
use std::collections::{BTreeSet, BinaryHeap};

pub mod route;

/// Clearance that generated lots must leave around the body, metres (docs/methods.md 11).
pub const CLEARANCE_M: f32 = 0.25;
/// Look-ahead of the near-collision rule, metres (docs/methods.md 8.1).
const SWEEP_AHEAD_M: f32 = 0.5;
/// Share of the clearance that is kept there too.
const SWEEP_CLEARANCE_SHARE: f32 = 0.4;
/// Travel between two decisions, metres, driven in two halves: the steering changes in the first.
const STEP_M: f32 = 1.0;
/// Steering positions to either side.
const STEERING_LEVELS: i8 = 4;
/// Largest change per step. Two of four levels are 0.29 rad: the car's 0.344 rad/s allows that at 1.18 m/s.
const STEERING_CHANGE_MAX: i8 = 2;
/// Share of the car's tightest curvature that is used; policies cannot ask for more than 0.215 /m either.
const CURVATURE_SHARE: f32 = 0.92;
/// Poses closer than this count as one: metres and radians.
const SAME_PLACE_M: f32 = 0.3;
const SAME_HEADING_RAD: f32 = 4.0 * std::f32::consts::PI / 180.0;
/// Greedy on purpose: any path will do, not the shortest.
const HEURISTIC_WEIGHT: f32 = 1.8;
/// Gives up after this many expansions. Solvable lots take a few hundred to a few thousand.
const EXPANSIONS_MAX: usize = 20_000;
/// Spacing of the waypoints returned, metres.
const WAYPOINT_M: f32 = 0.25;

/// A drivable route.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Waypoints from start to finish, 0.25 m apart.
    pub waypoints: Vec<Waypoint>,
    /// Search effort.
    pub expansions: usize,
}

/// A pose of the rear axle and the arc driven there.
#[derive(Debug, Clone, Copy)]
pub struct Waypoint {
    /// Rear-axle pose in the world.
    pub pose: Pose,
    /// Positive to the left, 1/m.
    pub curvature_per_m: f32,
}

/// Searches a drive from the start of the reference path to its finish that keeps `clearance_m` around the body.
///
/// `None` when there is none, or none was found within the budget. The scenario must be valid.
pub fn solve(scenario: &Scenario, vehicle: &VehicleSettings, clearance_m: f32) -> Option<Solution> {
    let scene = Scene::for_clearance(scenario, vehicle, clearance_m);
    let goal = Goal::new(scenario);
    let to_go = DistanceToGo::new(&scene, &goal, vehicle, &BTreeSet::new());
    Search::new(&scene, &goal, &to_go, vehicle, clearance_m).run(start_pose(scenario), EXPANSIONS_MAX)
}

fn start_pose(scenario: &Scenario) -> Pose {
    let points = &scenario.reference_path.points;
    Pose::new(points[0], maths::angle_rad(points[1] - points[0]))
}

/// The finish line.
struct Goal {
    point: Vec2,
    direction: Vec2,
    /// Half the length of the line, metres.
    reach_m: f32,
    /// Cosine of the largest angle between the car and the direction.
    heading_cos: f32,
}

impl Goal {
    fn new(scenario: &Scenario) -> Self {
        let points = &scenario.reference_path.points;
        let last = points.len() - 1;
        let direction = (points[last] - points[last - 1]).normalize();
        Self { point: points[last], direction, reach_m: 4.0, heading_cos: 0.5 }
    }

    fn is_reached(&self, pose: Pose) -> bool {
        self.is_in_reach(pose) && self.heading_cos_of(pose) > self.heading_cos
    }

    /// Whether a car is where it is to arrive, whatever its heading.
    fn is_in_reach(&self, pose: Pose) -> bool {
        let from_goal = pose.position() - self.point;
        let past_m = from_goal.dot(self.direction);
        (0.0..2.0 * STEP_M).contains(&past_m) && from_goal.perp_dot(self.direction).abs() < self.reach_m
    }

    fn heading_cos_of(&self, pose: Pose) -> f32 {
        pose.ahead().dot(self.direction)
    }
}

/// One state of the search.
struct Node {
    pose: Pose,
    steering: i8,
    cost: f32,
    parent: u32,
    /// Next node of the same place, for the duplicate test.
    next_here: u32,
}

const NONE: u32 = u32::MAX;

struct Search<'a> {
    scene: &'a Scene,
    goal: &'a Goal,
    to_go: &'a DistanceToGo,
    vehicle: &'a VehicleSettings,
    /// The right and the left end of a line that the front axle does not drive over backwards, if there is one.
    gate: Option<[Vec2; 2]>,
    body: Footprint,
    swept_body: Footprint,
    nodes: Vec<Node>,
    open: BinaryHeap<Open>,
    places: Raster<u32>,
}

impl<'a> Search<'a> {
    fn new(
        scene: &'a Scene,
        goal: &'a Goal,
        to_go: &'a DistanceToGo,
        vehicle: &'a VehicleSettings,
        clearance_m: f32,
    ) -> Self {
        Self {
            scene,
            goal,
            to_go,
            vehicle,
            gate: None,
            body: Footprint::new(vehicle, clearance_m),
            swept_body: Footprint::new(vehicle, SWEEP_CLEARANCE_SHARE * clearance_m),
            nodes: Vec::new(),
            open: BinaryHeap::new(),
            places: Raster::covering(scene.low, scene.high, SAME_PLACE_M, NONE),
        }
    }

    fn run(&mut self, start: Pose, expansions_max: usize) -> Option<Solution> {
        if !self.is_free(start, 0.0) {
            return None;
        }
        self.push(start, 0, 0.0, NONE);
        let mut expansions = 0;
        while let Some(Open { node, .. }) = self.open.pop() {
            if self.goal.is_reached(self.nodes[node as usize].pose) {
                return Some(Solution { waypoints: self.trace(node), expansions });
            }
            expansions += 1;
            if expansions > expansions_max {
                return None;
            }
            self.expand(node);
        }
        None
    }

    fn expand(&mut self, parent: u32) {
        let Node { pose, steering, cost, .. } = self.nodes[parent as usize];
        for next in steering - STEERING_CHANGE_MAX..=steering + STEERING_CHANGE_MAX {
            if next.abs() > STEERING_LEVELS {
                continue;
            }
            let [(middle, first_curvature), (end, curvature)] = self.halves(pose, steering, next);
            if self.turns_back_at_gate(pose, middle) || self.turns_back_at_gate(middle, end) {
                continue;
            }
            if self.is_free(middle, first_curvature) && self.is_free(end, curvature) {
                // Small costs: prefer few and gentle movements of the wheel, and the middle of the free space.
                let effort = 0.02 * f32::from((next - steering).abs()) + 0.01 * f32::from(next.abs());
                let closeness = 0.2 * (1.8 - self.scene.clearance_m(end.position())).max(0.0);
                self.push(end, next, cost + STEP_M * (1.0 + effort + closeness), parent);
            }
        }
    }

    /// Poses and curvatures at the middle and end of a step that changes the steering.
    fn halves(&self, pose: Pose, from: i8, to: i8) -> [(Pose, f32); 2] {
        let first = self.curvature_per_m(0.5 * (f32::from(from) + f32::from(to)));
        let second = self.curvature_per_m(f32::from(to));
        let middle = pose.advanced_along_arc(first, 0.5 * STEP_M);
        [(middle, first), (middle.advanced_along_arc(second, 0.5 * STEP_M), second)]
    }

    /// Levels are equally spaced in the steering angle.
    fn curvature_per_m(&self, level: f32) -> f32 {
        let wheelbase_m = self.vehicle.wheelbase_m;
        let largest_rad = maths::atan(CURVATURE_SHARE * self.vehicle.curvature_max_per_m() * wheelbase_m);
        maths::tan(largest_rad * level / f32::from(STEERING_LEVELS)) / wheelbase_m
    }

    /// Where the front axle is.
    fn front(&self, pose: Pose) -> Vec2 {
        pose.position() + pose.ahead() * self.vehicle.wheelbase_m
    }

    /// Whether the front axle drives over the gate backwards between two poses half a step apart. The cells that are closed for
    /// [`DistanceToGo`] are passed within a step, which looks at them at its ends only.
    fn turns_back_at_gate(&self, from: Pose, to: Pose) -> bool {
        self.gate.is_some_and(|[right, left]| {
            let (from, to) = (self.front(from), self.front(to));
            (left - right).perp_dot(to - from) > 0.0 && segments_cross(from, to, right, left)
        })
    }

    fn is_free(&self, pose: Pose, curvature_per_m: f32) -> bool {
        self.body.is_free(self.scene, pose)
            && self.swept_body.is_free(self.scene, pose.advanced_along_arc(curvature_per_m, SWEEP_AHEAD_M))
    }

    /// Adds a state unless an equal one is known. The first one found is kept: the search is greedy anyway.
    fn push(&mut self, pose: Pose, steering: i8, cost: f32, parent: u32) {
        // Measured at the front axle, which leads the car through a corner as its driver would.
        let to_go_m = self.to_go.at(self.front(pose));
        if !to_go_m.is_finite() {
            return;
        }
        let heading = |pose: Pose| (pose.heading_rad / SAME_HEADING_RAD).round() as i32;
        let here = self.places.at_mut(pose.position());
        let mut known = *here;
        while known != NONE {
            let node = &self.nodes[known as usize];
            if node.steering == steering && heading(node.pose) == heading(pose) {
                return;
            }
            known = node.next_here;
        }
        let index = self.nodes.len() as u32;
        self.nodes.push(Node { pose, steering, cost, parent, next_here: *here });
        *here = index;
        self.open.push(Open { estimate: cost + HEURISTIC_WEIGHT * to_go_m, node: index });
    }

    fn trace(&self, last: u32) -> Vec<Waypoint> {
        let mut chain = vec![last];
        while let Some(&node) = chain.last()
            && self.nodes[node as usize].parent != NONE
        {
            chain.push(self.nodes[node as usize].parent);
        }
        chain.reverse();
        let first = &self.nodes[chain[0] as usize];
        let mut waypoints = vec![Waypoint { pose: first.pose, curvature_per_m: 0.0 }];
        for pair in chain.windows(2) {
            let (from, to) = (&self.nodes[pair[0] as usize], &self.nodes[pair[1] as usize]);
            let mut pose = from.pose;
            for (_, curvature_per_m) in self.halves(from.pose, from.steering, to.steering) {
                for _ in 0..(0.5 * STEP_M / WAYPOINT_M) as usize {
                    pose = pose.advanced_along_arc(curvature_per_m, WAYPOINT_M);
                    waypoints.push(Waypoint { pose, curvature_per_m });
                }
            }
        }
        waypoints
    }
}

/// A rectangle around the body, tested exactly against every edge of the scene.
#[allow(clippy::struct_field_names, reason = "the postfix is the unit")]
struct Footprint {
    rear_m: f32,
    front_m: f32,
    half_width_m: f32,
    disc_centres_m: [f32; Self::DISCS],
    disc_radius_m: f32,
}

impl Footprint {
    const DISCS: usize = 5;

    fn new(vehicle: &VehicleSettings, inflation_m: f32) -> Self {
        let (rear_m, front_m) = (-vehicle.rear_overhang_m - inflation_m, vehicle.front_m() + inflation_m);
        let half_width_m = 0.5 * vehicle.width_m + inflation_m;
        let piece_m = (front_m - rear_m) / Self::DISCS as f32;
        Self {
            rear_m,
            front_m,
            half_width_m,
            disc_centres_m: std::array::from_fn(|i| rear_m + (i as f32 + 0.5) * piece_m),
            disc_radius_m: maths::hypot(0.5 * piece_m, half_width_m),
        }
    }

    fn is_free(&self, scene: &Scene, pose: Pose) -> bool {
        let (origin, ahead) = (pose.position(), pose.ahead());
        let clearances_m = self.disc_centres_m.map(|x_m| scene.clearance_m(origin + ahead * x_m));
        // The raster is within its slack of the truth: most poses are decided without looking at an edge.
        if clearances_m.iter().all(|&clearance_m| clearance_m > self.disc_radius_m + Scene::SLACK_M) {
            return true;
        }
        // How far the rectangle reaches around each centre on all sides: the first and last are near its ends.
        let within_m = |x_m: f32| self.half_width_m.min(x_m - self.rear_m).min(self.front_m - x_m);
        let mut discs = self.disc_centres_m.iter().zip(&clearances_m);
        if discs.any(|(&x_m, &clearance_m)| clearance_m < within_m(x_m) - Scene::SLACK_M) {
            return false;
        }
        let ego = pose.world_from_ego();
        !scene.any_edge_near(&self.corners(pose), |a, b| self.meets_segment(ego.inverse_point(a), ego.inverse_point(b)))
    }

    fn corners(&self, pose: Pose) -> [Vec2; 4] {
        let world_from_ego = pose.world_from_ego();
        [(self.front_m, 1.0), (self.rear_m, 1.0), (self.rear_m, -1.0), (self.front_m, -1.0)]
            .map(|(x_m, side)| world_from_ego.point(Vec2::new(x_m, side * self.half_width_m)))
    }

    /// Liang–Barsky: whether any part of a segment, given in the ego frame, lies in the rectangle.
    fn meets_segment(&self, a: Vec2, b: Vec2) -> bool {
        let ab = b - a;
        let (mut enter, mut leave) = (0.0_f32, 1.0_f32);
        for (from, step, low, high) in
            [(a.x, ab.x, self.rear_m, self.front_m), (a.y, ab.y, -self.half_width_m, self.half_width_m)]
        {
            if step == 0.0 {
                if from < low || from > high {
                    return false;
                }
            } else {
                let (t, u) = ((low - from) / step, (high - from) / step);
                enter = enter.max(t.min(u));
                leave = leave.min(t.max(u));
            }
        }
        enter <= leave
    }
}

/// Everything solid as edges, with a coarse raster of distances and buckets of edges.
struct Scene {
    low: Vec2,
    high: Vec2,
    edges: Vec<(Vec2, Vec2)>,
    /// Distances, up to [`Self::cap_m`].
    clearance_m: Raster<f32>,
    cap_m: f32,
    buckets: Raster<Vec<u32>>,
}

impl Scene {
    const NODE_M: f32 = 0.25;
    /// A look-up returns the value of the nearest node.
    const SLACK_M: f32 = Self::NODE_M * std::f32::consts::FRAC_1_SQRT_2;
    /// Distances are measured at least up to here: where there is more room, no way costs less.
    const CAP_MIN_M: f32 = 2.2;
    const BUCKET_M: f32 = 2.0;
    /// More than the ends of a piece of an edge are off the edge.
    const ROUNDED_M: f32 = 0.01;

    /// The scene for a body that keeps a clearance: distances reach as far as its discs. What is farther away than a raster
    /// can say would count as near.
    fn for_clearance(scenario: &Scenario, vehicle: &VehicleSettings, clearance_m: f32) -> Self {
        let reach_m = Footprint::new(vehicle, clearance_m).disc_radius_m + Self::SLACK_M + Self::NODE_M;
        Self::new(scenario, reach_m.max(Self::CAP_MIN_M))
    }

    fn new(scenario: &Scenario, cap_m: f32) -> Self {
        let (low, high) = sim::geometry::bounds(&scenario.boundary);
        let margin = Vec2::splat(1.0);
        let (low, high) = (low - margin, high + margin);
        let mut scene = Self {
            low,
            high,
            edges: Vec::new(),
            clearance_m: Raster::covering(low, high, Self::NODE_M, cap_m),
            cap_m,
            buckets: Raster::covering(low, high, Self::BUCKET_M, Vec::new()),
        };
        scene.add_outline(&scenario.boundary);
        scene.clearance_m.negate_outside(&scenario.boundary);
        for island in &scenario.islands {
            scene.add_outline(&island.polygon);
        }
        for obstacle in &scenario.obstacles {
            let [length_m, width_m, _] = obstacle.size_m();
            // The circumscribed octagon of a round thing reaches 8 % farther than its radius.
            let reach_m = 0.55 * maths::hypot(length_m, width_m) + Self::SLACK_M;
            // Else it is wholly behind the boundary, whose edges come first. Off the raster, the nearest point of it is looked
            // at, which is no farther from the boundary.
            if scene.clearance_m.at(obstacle.centre().position()) > -reach_m {
                scene.add_outline(&obstacle.outline());
            }
        }
        scene
    }

    fn add_outline(&mut self, outline: &[Vec2]) {
        for (a, b) in edges(outline) {
            let index = self.edges.len() as u32;
            self.edges.push((a, b));
            // Piece by piece: the box around a long slanted edge is mostly far from it.
            let pieces = ((b - a).abs().min_element() / Self::BUCKET_M).ceil().max(1.0) as u32;
            let end = |piece: u32| if piece == pieces { b } else { a.lerp(b, piece as f32 / pieces as f32) };
            for piece in 0..pieces {
                let (low, high) = (end(piece).min(end(piece + 1)), end(piece).max(end(piece + 1)));
                self.clearance_m.for_each_within(low, high, self.cap_m + Self::ROUNDED_M, |centre, value| {
                    let distance_m = distance_to_segment_m(centre, a, b);
                    // What is outside the boundary stays negative.
                    if distance_m < value.abs() {
                        *value = distance_m.copysign(*value);
                    }
                });
                self.buckets.for_each_within(low, high, Self::ROUNDED_M, |_, bucket| {
                    if bucket.last() != Some(&index) {
                        bucket.push(index);
                    }
                });
            }
        }
    }

    /// Distance to the nearest edge, metres, negative outside the boundary (insides of obstacles are not marked: the
    /// car cannot get there without crossing an edge).
    fn clearance_m(&self, point: Vec2) -> f32 {
        self.clearance_m.at(point)
    }

    fn any_edge_near(&self, corners: &[Vec2; 4], test: impl Fn(Vec2, Vec2) -> bool) -> bool {
        let (low, high) = sim::geometry::bounds(corners);
        self.buckets.any_within(low, high, |bucket| {
            bucket.iter().any(|&index| {
                let (a, b) = self.edges[index as usize];
                test(a, b)
            })
        })
    }
}

/// Distance to the finish along free ground, with a cost for narrow passages; infinite where there is no way.
struct DistanceToGo(Raster<f32>);

impl DistanceToGo {
    /// `closed` are cells of the clearance raster that count as solid.
    fn new(scene: &Scene, goal: &Goal, vehicle: &VehicleSettings, closed: &BTreeSet<usize>) -> Self {
        let half_width_m = 0.5 * vehicle.width_m;
        let mut to_go = Raster::covering(scene.low, scene.high, Scene::NODE_M, f32::INFINITY);
        // The front axle is at the source when the rear axle reaches the finish.
        let beyond = goal.point + goal.direction * vehicle.wheelbase_m;
        let source = if scene.clearance_m(beyond) > half_width_m { beyond } else { goal.point };
        let mut open = BinaryHeap::new();
        let first = to_go.index(source);
        to_go.values[first] = 0.0;
        open.push(Open { estimate: 0.0, node: first as u32 });
        while let Some(Open { estimate, node }) = open.pop() {
            let node = node as usize;
            if estimate > to_go.values[node] {
                continue;
            }
            for (next, cells) in neighbours::around(node, to_go.cols, to_go.rows) {
                let clearance_m = scene.clearance_m.values[next];
                if clearance_m < half_width_m - Scene::SLACK_M || closed.contains(&next) {
                    continue;
                }
                let total = estimate + Scene::NODE_M * cells * (1.0 + 0.4 * (1.8 - clearance_m).max(0.0));
                if total < to_go.values[next] {
                    to_go.values[next] = total;
                    open.push(Open { estimate: total, node: next as u32 });
                }
            }
        }
        Self(to_go)
    }

    fn at(&self, point: Vec2) -> f32 {
        self.0.at(point)
    }
}

/// Values on square cells.
struct Raster<T> {
    low: Vec2,
    cell_m: f32,
    cols: usize,
    rows: usize,
    values: Vec<T>,
}

impl<T: Clone> Raster<T> {
    fn covering(low: Vec2, high: Vec2, cell_m: f32, value: T) -> Self {
        let size = ((high - low) / cell_m).ceil();
        let (cols, rows) = (size.x as usize + 1, size.y as usize + 1);
        Self { low, cell_m, cols, rows, values: vec![value; cols * rows] }
    }

    /// Cell of a point; points outside count to the nearest border cell.
    fn cell(&self, point: Vec2) -> (usize, usize) {
        let cell = (point - self.low) / self.cell_m;
        ((cell.x.max(0.0) as usize).min(self.cols - 1), (cell.y.max(0.0) as usize).min(self.rows - 1))
    }

    fn index(&self, point: Vec2) -> usize {
        let (col, row) = self.cell(point);
        row * self.cols + col
    }

    fn at_mut(&mut self, point: Vec2) -> &mut T {
        let index = self.index(point);
        &mut self.values[index]
    }

    fn centre(&self, col: usize, row: usize) -> Vec2 {
        self.low + (Vec2::new(col as f32, row as f32) + 0.5) * self.cell_m
    }

    /// Every cell that meets a box widened by a margin.
    fn for_each_within(&mut self, low: Vec2, high: Vec2, margin_m: f32, mut visit: impl FnMut(Vec2, &mut T)) {
        let (first, last) = (self.cell(low - margin_m), self.cell(high + margin_m));
        for row in first.1..=last.1 {
            for col in first.0..=last.0 {
                let centre = self.centre(col, row);
                visit(centre, &mut self.values[row * self.cols + col]);
            }
        }
    }

    fn any_within(&self, low: Vec2, high: Vec2, test: impl Fn(&T) -> bool) -> bool {
        let (first, last) = (self.cell(low), self.cell(high));
        (first.1..=last.1)
            .any(|row| self.values[row * self.cols + first.0..=row * self.cols + last.0].iter().any(&test))
    }
}

impl Raster<f32> {
    fn at(&self, point: Vec2) -> f32 {
        self.values[self.index(point)]
    }

    fn negate_outside(&mut self, polygon: &[Vec2]) {
        for row in 0..self.rows {
            // One ray per row: where it crosses the polygon, inside and outside change.
            let y_m = self.centre(0, row).y;
            let mut crossings: Vec<f32> = edges(polygon)
                .filter(|(a, b)| (a.y > y_m) != (b.y > y_m))
                .map(|(a, b)| a.x + (y_m - a.y) / (b.y - a.y) * (b.x - a.x))
                .collect();
            crossings.sort_by(f32::total_cmp);
            let mut next = 0;
            for col in 0..self.cols {
                let x_m = self.centre(col, row).x;
                while next < crossings.len() && crossings[next] <= x_m {
                    next += 1;
                }
                if next % 2 == 0 {
                    let value = &mut self.values[row * self.cols + col];
                    *value = -value.abs();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{self, ReferenceLot};
    use geo::{Contains, Intersects, LineString, Polygon};
    use sim::scenario::{Direction, Obstacle, ObstacleClass};
    use sim::seed::RootSeed;

    fn car() -> VehicleSettings {
        VehicleSettings::hyundai_hg300()
    }

    /// A wall square behind the rear bumper counted as a collision up to 0.46 m away.
    #[test]
    fn a_car_may_stand_with_its_tail_near_a_wall() {
        let scene = Scene::for_clearance(&lane(6.0, &[]), &car(), 0.25);
        let footprint = Footprint::new(&car(), 0.25);
        let with_tail_at = |metres: f32| Pose::new(Vec2::new(car().rear_overhang_m + metres, 0.0), 0.0);
        for metres in [0.27, 0.3, 0.4, 0.5, 0.7, 1.0, 2.0] {
            assert!(footprint.is_free(&scene, with_tail_at(metres)), "{metres} m behind the bumper");
        }
        for metres in [-0.1, 0.1, 0.23] {
            assert!(!footprint.is_free(&scene, with_tail_at(metres)), "{metres} m behind the bumper");
        }
    }

    /// A straight lane of a width, 70 m long, driven from x = 10 to x = 50.
    fn lane(width_m: f32, obstacles: &[(ObstacleClass, f32, f32)]) -> Scenario {
        let things =
            obstacles.iter().map(|&(class, x_m, y_m)| Obstacle::new(class, Pose { x_m, y_m, heading_rad: 0.0 }));
        Scenario::lane(0.0..=70.0, width_m, 10.0..=50.0).with_corner_radius_m(5.0).with_obstacles(things)
    }

    /// An L of two aisles of a width with a sharp inner corner.
    fn sharp_corner(width_m: f32) -> Scenario {
        let half_m = 0.5 * width_m;
        let boundary = [
            (0.0, -half_m),
            (40.0 + half_m, -half_m),
            (40.0 + half_m, 40.0),
            (40.0 - half_m, 40.0),
            (40.0 - half_m, half_m),
            (0.0, half_m),
        ];
        Scenario::new("corner", boundary, [(10.0, 0.0), (40.0, 0.0), (40.0, 20.0)]).with_corner_radius_m(5.0)
    }

    #[test]
    fn solvable_and_unsolvable_lots_are_told_apart() {
        use ObstacleClass::{Cone, Sedan};
        let row = [(Cone, 25.0, -1.2), (Cone, 25.0, 0.0), (Cone, 25.0, 1.2)];
        let across = |y_m| Obstacle {
            length_m: Some(12.0),
            ..Obstacle::new(ObstacleClass::Wall, Pose { x_m: 25.0, y_m, heading_rad: std::f32::consts::FRAC_PI_2 })
        };
        // The car is 1.86 m wide and keeps 0.25 m to either side: 2.36 m.
        let table = [
            ("an empty lane", lane(3.0, &[]), true),
            ("a lane hardly wider than the car with its clearance", lane(2.4, &[]), true),
            ("a lane narrower than that", lane(2.3, &[]), false),
            ("a row of cones", lane(5.0, &row), false),
            ("the same row in a wider lane", lane(9.0, &row), true),
            ("a double-parked car", lane(5.0, &[(Sedan, 25.0, 1.5)]), true),
            ("a double-parked car that leaves 2.3 m", lane(5.0, &[(Sedan, 25.0, 0.725)]), false),
            ("a slalom with 10 m between the cars", lane(5.5, &[(Sedan, 22.65, 1.8), (Sedan, 37.35, -1.8)]), true),
            ("two cars side by side", lane(5.0, &[(Sedan, 25.0, 1.5), (Sedan, 27.0, -1.5)]), false),
            // docs/methods.md 11: a sharp right angle needs at least 4.1–4.2 m, 4.6–4.7 m with 0.3 m clearance.
            ("a wall across it whose middle is far outside", lane(5.0, &[]).with_obstacles([across(6.0)]), false),
            ("a wall that ends at its edge", lane(5.0, &[]).with_obstacles([across(8.55)]), true),
            ("a sharp corner of two 5 m aisles", sharp_corner(5.0), true),
            ("a sharp corner of two 4 m aisles", sharp_corner(4.0), false),
        ];
        for (what, scenario, is_solvable) in table {
            for direction in Direction::BOTH {
                let solution = solve(&direction.of(scenario.clone()), &car(), CLEARANCE_M);
                assert_eq!(solution.is_some(), is_solvable, "{what}, {direction:?}");
            }
        }
    }

    /// From 1.45 m on every place counted as blocked: distances were measured up to 2.2 m, and half of the car with its
    /// clearance reaches farther.
    #[test]
    fn a_clearance_of_up_to_two_metres_is_kept_where_there_is_room_for_it() {
        for clearance_m in [0.6, 1.2, 1.45, 1.5, 2.0] {
            let need_m = 1.86 + 2.0 * clearance_m;
            for (room_m, is_solvable) in [(0.1, true), (-0.1, false)] {
                let solution = solve(&lane(need_m + room_m, &[]), &car(), clearance_m);
                assert_eq!(solution.is_some(), is_solvable, "{clearance_m} m in {:.2} m", need_m + room_m);
            }
        }
    }

    /// Judged by a polygon library that neither the solver nor the simulator uses.
    #[test]
    fn solutions_are_collision_free_by_exact_polygons() {
        for which in ReferenceLot::ALL {
            for (seed, direction) in (0..3).flat_map(|seed| Direction::BOTH.map(|direction| (seed, direction))) {
                let scenario = direction.of(reference::lot(which, RootSeed(seed)));
                // Lot b has gaps of 2.6 m: 0.37 m to either side at best, and less beside a car that stands askew.
                let solution = solve(&scenario, &car(), 0.12).unwrap_or_else(|| panic!("{} seed {seed}", which.name()));
                let ground = polygon(&scenario.boundary);
                let solid: Vec<_> = scenario.obstacles.iter().map(|obstacle| polygon(&obstacle.outline())).collect();
                for waypoint in &solution.waypoints {
                    let world_from_ego = waypoint.pose.world_from_ego();
                    let body = polygon(&car().body_in_ego().map(|corner| world_from_ego.point(corner)));
                    let at = waypoint.pose;
                    assert!(ground.contains(&body), "{} seed {seed}: off the ground at {at:?}", which.name());
                    assert!(!solid.iter().any(|other| other.intersects(&body)), "{} seed {seed}: {at:?}", which.name());
                }
            }
        }
    }

    fn polygon(outline: &[Vec2]) -> Polygon<f64> {
        let ring: Vec<_> = outline.iter().map(|p| (f64::from(p.x), f64::from(p.y))).collect();
        Polygon::new(LineString::from(ring), Vec::new())
    }

    /// Waypoints form one drive that the car can steer: arcs within its limits, joined without jumps.
    #[test]
    fn solutions_obey_the_kinematics() {
        let scenario = reference::lot(ReferenceLot::A, RootSeed(5));
        let solution = solve(&scenario, &car(), 0.2).expect("solvable");
        let first = &solution.waypoints[0];
        assert!(first.pose.position().distance(scenario.reference_path.points[0]) < 1e-3);
        let mut length_m = 0.0;
        for pair in solution.waypoints.windows(2) {
            let (from, to) = (&pair[0], &pair[1]);
            let reached = from.pose.advanced_along_arc(to.curvature_per_m, WAYPOINT_M);
            assert!(reached.position().distance(to.pose.position()) < 2e-3, "a jump before {:?}", to.pose);
            assert!(to.curvature_per_m.abs() < car().curvature_max_per_m());
            length_m += WAYPOINT_M;
        }
        // Steering changes at half steps of 0.5 m by at most one level of four.
        let steering = |waypoint: &Waypoint| maths::atan(waypoint.curvature_per_m * car().wheelbase_m);
        let largest =
            solution.waypoints.windows(2).map(|w| (steering(&w[1]) - steering(&w[0])).abs()).fold(0.0, f32::max);
        assert!(largest < 0.15, "the wheels turn by {largest} rad within half a metre");
        // Some metres less than the reference path: the wide corners may be cut.
        assert!((215.0..240.0).contains(&length_m), "{length_m} m for a lot of 231 m");
    }

    #[test]
    fn a_start_that_is_not_free_has_no_solution() {
        assert!(solve(&lane(5.0, &[(ObstacleClass::Cone, 12.0, 0.5)]), &car(), CLEARANCE_M).is_none());
    }
}
