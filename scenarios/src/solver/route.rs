//! Finds a route where none is given: from pose to pose, or around a loop.
//!
//! The search of [`super::solve`] with a tight goal. If it fails, the error gives the reason and its place.

use super::{CURVATURE_SHARE, DistanceToGo, Goal, NONE, Scene, Search, Waypoint};
use crate::neighbours;
use crate::open_list::Open;
use geo::{Coord, LineString, Simplify as _};
use sim::geometry::{Pose, Vec2};
use sim::maths;
use sim::scenario::{ReferencePath, Scenario};
use sim::vehicle::VehicleSettings;
use std::collections::{BTreeSet, BinaryHeap};

/// Gives up after this many expansions: ten times what a generated lot may take, a few seconds.
const EXPANSIONS_MAX: usize = 200_000;
/// The route ends beside the goal, at most this far, or up to two metres beyond it.
pub const GOAL_BESIDE_M: f32 = 1.0;
/// Cosine of the largest angle between the end of the route and the goal: 20°.
const GOAL_HEADING_COS: f32 = 0.94;
/// How far behind its start a loop ends, metres: farther than the goal's depth, so that the start is not a finish.
pub const LOOP_GAP_M: f32 = 2.5;
/// The gate that makes a loop go round stands this far ahead of the start, metres: between rear and front axle.
const GATE_AHEAD_M: f32 = 1.6;
/// A passage narrower than this counts as a wall, metres: the raster of distances resolves nothing finer.
const WALL_M: f32 = 0.5;
/// Waypoints that lie this near the chord of their neighbours are left out of the route, metres.
const ROUTE_TOLERANCE_M: f64 = 0.02;
/// Rounds the chords of the route into arcs again, metres: about the tightest the search drives.
const ROUTE_RADIUS_M: f32 = 5.0;

/// Where a route ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Finish {
    /// At a pose of the rear axle, within [`GOAL_BESIDE_M`] and 20°.
    At(Pose),
    /// Where it began, after a way round.
    Start,
}

/// Why there is no route. Places are world metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoRoute {
    /// The car with its clearance does not stand free at the start.
    StartBlocked,
    /// Nor at the goal.
    GoalBlocked,
    /// The goal is reached at the start.
    Arrived,
    /// No free ground joins start and goal; the way would break through here.
    Walled {
        /// Where.
        at: Vec2,
    },
    /// The widest way is too narrow here.
    Narrow {
        /// Where.
        at: Vec2,
        /// About how wide, metres.
        width_m: f32,
    },
    /// The car gets to the goal, but not in its direction.
    Askew {
        /// Where.
        at: Vec2,
        /// How far it is off at best, degrees.
        off_deg: f32,
    },
    /// Wide enough everywhere, but no drive forwards was found.
    Tight {
        /// The point of the search nearest the goal.
        reached: Vec2,
        /// Distance from there to the goal, roughly, metres.
        to_go_m: f32,
    },
}

/// Searches a drive over the ground of a scenario, whose own reference path is ignored, that keeps `clearance_m` around
/// the body, and returns it as a reference path of the rear axle.
///
/// Everything in the scenario but its reference path must be valid.
///
/// # Errors
/// Why there is none, with the place.
pub fn find(
    ground: &Scenario,
    start: Pose,
    finish: Finish,
    vehicle: &VehicleSettings,
    clearance_m: f32,
) -> Result<ReferencePath, NoRoute> {
    let scene = Scene::for_clearance(ground, vehicle, clearance_m);
    let goal_pose = match finish {
        Finish::At(pose) => pose,
        Finish::Start => Pose::new(start.position() - LOOP_GAP_M * start.ahead(), start.heading_rad),
    };
    let goal = Goal {
        point: goal_pose.position(),
        direction: goal_pose.ahead(),
        reach_m: GOAL_BESIDE_M,
        heading_cos: GOAL_HEADING_COS,
    };
    let (closed, gate) = match finish {
        Finish::At(_) => (BTreeSet::new(), None),
        Finish::Start => {
            let (closed, ends) = gate(&scene, start);
            (closed, Some(ends))
        }
    };
    let to_go = DistanceToGo::new(&scene, &goal, vehicle, &closed);
    let mut search = Search { gate, ..Search::new(&scene, &goal, &to_go, vehicle, clearance_m) };
    if !search.is_free(start, 0.0) {
        return Err(NoRoute::StartBlocked);
    }
    if goal.is_reached(start) {
        return Err(NoRoute::Arrived);
    }
    if let Some(solution) = search.run(start, EXPANSIONS_MAX) {
        return Ok(reference_path(&solution.waypoints, &goal));
    }
    let front = |pose: Pose| search.front(pose);
    let (at, room_m) = bottleneck(&scene, front(start), goal_pose.position(), &closed);
    let width_m = 2.0 * room_m;
    if width_m < WALL_M {
        return Err(NoRoute::Walled { at });
    }
    if !search.body.is_free(&scene, goal_pose) {
        return Err(NoRoute::GoalBlocked);
    }
    // Measured at the middles of cells: it may be wider by one.
    if width_m + Scene::NODE_M < vehicle.width_m + 2.0 * clearance_m {
        return Err(NoRoute::Narrow { at, width_m });
    }
    let at_goal = search.nodes.iter().filter(|node| goal.is_in_reach(node.pose));
    if let Some(best) = at_goal.max_by(|a, b| goal.heading_cos_of(a.pose).total_cmp(&goal.heading_cos_of(b.pose))) {
        let off_deg = maths::acos(goal.heading_cos_of(best.pose).clamp(-1.0, 1.0)).to_degrees();
        return Err(NoRoute::Askew { at: best.pose.position(), off_deg });
    }
    let from_front = |node: &super::Node| (to_go.at(front(node.pose)), front(node.pose));
    let (to_go_m, reached) = search
        .nodes
        .iter()
        .map(from_front)
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap_or((front(start).distance(goal.point), front(start)));
    Err(NoRoute::Tight { reached, to_go_m })
}

/// Tightest radius of the rear axle that the search drives, metres.
pub fn radius_min_m(vehicle: &VehicleSettings) -> f32 {
    1.0 / (CURVATURE_SHARE * vehicle.curvature_max_per_m())
}

/// Cells of the clearance raster across the free ground just ahead of the start, and the right and the left end of the line
/// through them.
fn gate(scene: &Scene, start: Pose) -> (BTreeSet<usize>, [Vec2; 2]) {
    let centre = start.position() + GATE_AHEAD_M * start.ahead();
    let step_m = 0.5 * Scene::NODE_M;
    let mut cells = BTreeSet::new();
    let ends = [-1.0, 1.0].map(|side| {
        let across = side * start.ahead().perp();
        let mut beside_m = 0.0;
        loop {
            let point = centre + beside_m * across;
            // Up to the edge: a gap beside the gate would be taken for a passage.
            if scene.clearance_m(point) < Scene::SLACK_M {
                break point;
            }
            // Two cells thick, so that no diagonal step passes.
            for ahead_m in [-Scene::NODE_M, 0.0, Scene::NODE_M] {
                cells.insert(scene.clearance_m.index(point + ahead_m * start.ahead()));
            }
            beside_m += step_m;
        }
    });
    (cells, ends)
}

/// The narrowest place of the widest way between two points, and the distance to the nearest edge there, metres. Of a
/// way through a wall, the place where it meets it.
fn bottleneck(scene: &Scene, from: Vec2, to: Vec2, closed: &BTreeSet<usize>) -> (Vec2, f32) {
    let room = &scene.clearance_m;
    let (first, last) = (room.index(from), room.index(to));
    let mut parent = vec![NONE; room.values.len()];
    // The queue gives the smallest estimate first: the widest way is the one with the smallest negative room.
    let mut open = BinaryHeap::from([Open { estimate: -room.values[first], node: first as u32 }]);
    parent[first] = first as u32;
    while let Some(Open { estimate, node }) = open.pop() {
        let node = node as usize;
        if node == last {
            break;
        }
        for next in neighbours::beside(node, room.cols, room.rows) {
            if parent[next] == NONE && !closed.contains(&next) {
                parent[next] = node as u32;
                open.push(Open { estimate: estimate.max(-room.values[next]), node: next as u32 });
            }
        }
    }
    if parent[last] == NONE {
        return (from, 0.0);
    }
    let mut way = vec![last];
    while let Some(&cell) = way.last()
        && cell != first
    {
        way.push(parent[cell] as usize);
    }
    // From the start: what lies behind the narrowest place need only be as wide as that.
    way.reverse();
    let wall = way.iter().copied().find(|&cell| room.values[cell] < 0.5 * WALL_M);
    let narrowest = way.into_iter().min_by(|&a, &b| room.values[a].total_cmp(&room.values[b])).unwrap_or(first);
    let place = wall.unwrap_or(narrowest);
    (room.centre(place % room.cols, place / room.cols), room.values[narrowest].max(0.0))
}

/// The waypoints up to the first that has reached the goal as few points, whole millimetres.
fn reference_path(waypoints: &[Waypoint], goal: &Goal) -> ReferencePath {
    let beyond = waypoints.iter().rev().take_while(|waypoint| goal.is_reached(waypoint.pose)).count();
    let kept = waypoints.len() - beyond.saturating_sub(1);
    let drive: LineString<f64> = waypoints[..kept]
        .iter()
        .map(|waypoint| Coord { x: f64::from(waypoint.pose.x_m), y: f64::from(waypoint.pose.y_m) })
        .collect();
    let points = drive
        .simplify(ROUTE_TOLERANCE_M)
        .coords()
        .map(|point| crate::corridor::to_millimetres(Vec2::new(point.x as f32, point.y as f32)))
        .collect();
    ReferencePath { points, corner_radius_m: ROUTE_RADIUS_M }
}
