//! Junctions: places where a way leaves a route and goes on. Drivers never see the route, so a driver may turn off there;
//! it is not wrong, but the lot then measures luck.
//!
//! The ground on which the middle of the car has room is measured from the route on, around walls. What lies far enough
//! from it is on a branch, whose mouth is where the shortest way back comes near the route.

use crate::neighbours;
use crate::open_list::Open;
use sim::geometry::{Vec2, distance_to_segment};
use sim::map::Map;
use sim::maths;
use sim::scenario::{Island, KERB_MAX_M, Scenario};
use sim::vehicle::VehicleSettings;
use std::collections::BinaryHeap;

/// Spacing of the raster, metres.
const CELL_M: f32 = 0.25;
/// Beyond half of the car's width, metres: where the middle of the car has room.
const ROOM_M: f32 = 0.05;
/// Ground up to this far from the route belongs to it, metres: half of a wide aisle.
const BESIDE_M: f32 = 4.0;
/// A way that goes on for more than this is a branch, metres: longer than a stall, or the other half of a wide hall.
const GOES_ON_M: f32 = 12.0;
/// Ways that leave within this distance of the start or finish only go on where the route does not, metres.
const AT_END_M: f32 = 2.0;
/// Mouths nearer to each other than this are one, metres.
const SAME_MOUTH_M: f32 = 8.0;
/// Longest kerb that closes a branch, metres.
const KERB_LENGTH_MAX_M: f32 = 25.0;
/// Its width, metres.
const KERB_WIDTH_M: f32 = 0.3;
/// What is left open at its ends so that it does not touch the boundary, metres.
const KERB_GAP_M: f32 = 0.3;
/// A kerb stays this far from the route, metres.
const KERB_BESIDE_M: f32 = 2.5;
/// Directions in which a kerb is tried.
const KERB_DIRECTIONS: u8 = 36;
/// Kerbs that are tried are this far from each other, metres.
const KERBS_APART_M: f32 = 1.0;
/// Kerbs that are laid at most; a lot that needs more is open ground.
const KERBS_MAX: usize = 40;

/// A way that leaves the route.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Branch {
    /// Where it leaves, world metres.
    pub(crate) mouth: Vec2,
    /// Where along the route, metres from the start.
    arc_length_m: f32,
    /// The way from beside the route on, world metres.
    way: Vec<Vec2>,
}

/// The ways that leave the route of a valid lot and go on, in order of the route.
pub(crate) fn find(map: &Map, vehicle: &VehicleSettings) -> Vec<Branch> {
    let ground = GroundFromRoute::measure(map, vehicle);
    let mut branches: Vec<Branch> = Vec::new();
    for branch in ground.ends().into_iter().map(|cell| ground.branch_to(cell)) {
        if branches.iter().all(|other| other.mouth.distance(branch.mouth) > SAME_MOUTH_M) {
            branches.push(branch);
        }
    }
    branches.sort_by(|a, b| a.arc_length_m.total_cmp(&b.arc_length_m));
    branches
}

/// Closes the branches of a valid lot with kerbs, as far as walls on both sides are near enough. Returns where.
pub(crate) fn close(lot: &mut Scenario, vehicle: &VehicleSettings) -> Vec<Vec2> {
    let mut closed = Vec::new();
    // Branches that no kerb closes, and how many were closed when they were last tried.
    let (mut open, mut closed_before) = (Vec::<Vec2>::new(), 0);
    while closed.len() < KERBS_MAX
        && let Ok(map) = Map::build(lot.clone(), vehicle)
    {
        // A kerb may close several ways: look again after each. Every kerb that is tried costs a map.
        let closing = find(&map, vehicle).into_iter().find_map(|branch| {
            if open.iter().any(|mouth| is_same_mouth(*mouth, branch.mouth)) {
                return None;
            }
            let with_kerb = kerbs(&map, &branch).find(|lot| closes(lot, &branch, vehicle));
            if with_kerb.is_none() {
                open.push(branch.mouth);
            }
            Some((branch.mouth, with_kerb?))
        });
        if let Some((mouth, with_kerb)) = closing {
            *lot = with_kerb;
            closed.push(mouth);
        } else if closed.len() > closed_before {
            // A kerb may end at another one that was not there before.
            closed_before = closed.len();
            open.clear();
        } else {
            break;
        }
    }
    closed
}

fn is_same_mouth(a: Vec2, b: Vec2) -> bool {
    a.distance(b) <= 0.5 * SAME_MOUTH_M
}

/// Whether a branch is none of a lot's any more.
fn closes(with_kerb: &Scenario, branch: &Branch, vehicle: &VehicleSettings) -> bool {
    Map::build(with_kerb.clone(), vehicle)
        .is_ok_and(|map| find(&map, vehicle).iter().all(|other| !is_same_mouth(other.mouth, branch.mouth)))
}

/// The lot with a kerb across a branch, for each place along it, shortest kerb first.
fn kerbs<'a>(map: &'a Map, branch: &Branch) -> impl Iterator<Item = Scenario> + use<'a> {
    let route: Vec<Vec2> = map.path().poses().iter().map(|pose| pose.position()).collect();
    let keeps_off_route =
        |&(a, b): &(Vec2, Vec2)| route.iter().all(|&point| distance_to_segment(point, a, b) > KERB_BESIDE_M);
    let by_length = |a: &(Vec2, Vec2), b: &(Vec2, Vec2)| a.0.distance(a.1).total_cmp(&b.0.distance(b.1));
    let shortest_at = |&point: &Vec2| {
        (0..KERB_DIRECTIONS).filter_map(|k| chord(map, point, k)).filter(keeps_off_route).min_by(by_length)
    };
    let mut sorted: Vec<_> = branch.way.iter().filter_map(shortest_at).collect();
    sorted.sort_by(by_length);
    let mut chords: Vec<(Vec2, Vec2)> = Vec::new();
    for (a, b) in sorted {
        if chords.iter().all(|&(c, d)| a.midpoint(b).distance(c.midpoint(d)) > KERBS_APART_M) {
            chords.push((a, b));
        }
    }
    let with_kerb = |(a, b): (Vec2, Vec2)| {
        let along = (b - a).normalize_or_zero();
        let (a, b, half) = (a + KERB_GAP_M * along, b - KERB_GAP_M * along, 0.5 * KERB_WIDTH_M * along.perp());
        let polygon = [a - half, b - half, b + half, a + half].map(crate::corridor::to_millimetres).to_vec();
        let mut lot = map.scenario().clone();
        lot.islands.push(Island { polygon, height_m: KERB_MAX_M });
        lot
    };
    chords.into_iter().map(with_kerb)
}

/// The chord from wall to wall through a point.
fn chord(map: &Map, point: Vec2, direction: u8) -> Option<(Vec2, Vec2)> {
    const STEP_M: f32 = 0.1;
    let along = maths::unit(std::f32::consts::PI * f32::from(direction) / f32::from(KERB_DIRECTIONS));
    let steps = (KERB_LENGTH_MAX_M / STEP_M) as usize;
    let wall = |along: Vec2| {
        let points = (0..steps).map(|k| point + k as f32 * STEP_M * along);
        points.into_iter().find(|&point| map.signed_distance_m(point) <= 0.0)
    };
    let (a, b) = (wall(-along)?, wall(along)?);
    (a.distance(b) < KERB_LENGTH_MAX_M).then_some((a, b))
}

/// How far the ground on which the middle of the car has room is from the route.
struct GroundFromRoute {
    low: Vec2,
    cols: usize,
    cells: Vec<Cell>,
    spacing_m: f32,
    n_stations: usize,
}

#[derive(Clone, Copy)]
struct Cell {
    /// Around walls; infinite where there is no way.
    from_route_m: f32,
    /// Towards the route.
    parent: usize,
    /// Index of the nearest pose of the route.
    station: usize,
}

impl GroundFromRoute {
    fn measure(map: &Map, vehicle: &VehicleSettings) -> Self {
        let (low, high) = sim::geometry::bounds(&map.scenario().boundary);
        let size = ((high - low) / CELL_M).ceil();
        let (cols, rows) = (size.x as usize + 1, size.y as usize + 1);
        let path = map.path();
        let nowhere = Cell { from_route_m: f32::INFINITY, parent: usize::MAX, station: 0 };
        let mut ground = Self {
            low,
            cols,
            cells: vec![nowhere; cols * rows],
            spacing_m: path.spacing_m(),
            n_stations: path.poses().len(),
        };
        let mut open = BinaryHeap::new();
        for (station, pose) in path.poses().iter().enumerate() {
            let at = ((pose.position() - low) / CELL_M).max(Vec2::ZERO);
            let cell = (at.y as usize).min(rows - 1) * cols + (at.x as usize).min(cols - 1);
            if ground.cells[cell].from_route_m > 0.0 {
                ground.cells[cell] = Cell { from_route_m: 0.0, parent: cell, station };
                open.push(Open { estimate: 0.0, node: cell as u32 });
            }
        }
        let room_m = 0.5 * vehicle.width_m + ROOM_M;
        while let Some(Open { estimate: from_route_m, node }) = open.pop() {
            let cell = node as usize;
            if from_route_m > ground.cells[cell].from_route_m {
                continue;
            }
            for (next, cells) in neighbours::around(cell, cols, rows) {
                let total_m = from_route_m + CELL_M * cells;
                if total_m < ground.cells[next].from_route_m && map.signed_distance_m(ground.centre(next)) >= room_m {
                    ground.cells[next] =
                        Cell { from_route_m: total_m, parent: cell, station: ground.cells[cell].station };
                    open.push(Open { estimate: total_m, node: next as u32 });
                }
            }
        }
        ground
    }

    fn centre(&self, cell: usize) -> Vec2 {
        self.low + (Vec2::new((cell % self.cols) as f32, (cell / self.cols) as f32) + 0.5) * CELL_M
    }

    fn arc_length_m(&self, cell: usize) -> f32 {
        self.cells[cell].station as f32 * self.spacing_m
    }

    /// The first cells that are far from the route and do not go on from one of its ends.
    fn ends(&self) -> Vec<usize> {
        let far_m = BESIDE_M + GOES_ON_M;
        let length_m = (self.n_stations - 1) as f32 * self.spacing_m;
        let is_end = |&cell: &usize| {
            let Cell { from_route_m, parent, .. } = self.cells[cell];
            let between = AT_END_M..=length_m - AT_END_M;
            from_route_m.is_finite()
                && from_route_m > far_m
                && self.cells[parent].from_route_m <= far_m
                && between.contains(&self.arc_length_m(cell))
        };
        (0..self.cells.len()).filter(is_end).collect()
    }

    fn branch_to(&self, end: usize) -> Branch {
        let (mut way, mut mouth) = (vec![end], end);
        while let Some(&cell) = way.last()
            && self.cells[cell].from_route_m > KERB_BESIDE_M
        {
            if self.cells[cell].from_route_m > BESIDE_M {
                mouth = cell;
            }
            way.push(self.cells[cell].parent);
        }
        let way: Vec<Vec2> = way.into_iter().rev().map(|cell| self.centre(cell)).collect();
        Branch { mouth: self.centre(mouth), arc_length_m: self.arc_length_m(end), way }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car() -> VehicleSettings {
        VehicleSettings::hyundai_hg300()
    }

    /// An aisle of 6 m along x; others of 5 m lead off it: at x = 30 upwards, as long as is said, and at x = 50 downwards
    /// for 6 m, a stall.
    fn aisle(branch_m: f32) -> Scenario {
        let boundary = [
            (-10.0, -3.0),
            (47.5, -3.0),
            (47.5, -9.0),
            (52.5, -9.0),
            (52.5, -3.0),
            (90.0, -3.0),
            (90.0, 3.0),
            (32.5, 3.0),
            (32.5, 3.0 + branch_m),
            (27.5, 3.0 + branch_m),
            (27.5, 3.0),
            (-10.0, 3.0),
        ];
        Scenario::new("aisle", boundary, [(0.0, 0.0), (70.0, 0.0)])
    }

    fn mouths(lot: &Scenario) -> Vec<Vec2> {
        let map = Map::build(lot.clone(), &car()).unwrap();
        find(&map, &car()).into_iter().map(|branch| branch.mouth).collect()
    }

    #[test]
    fn a_side_aisle_is_a_junction_and_a_stall_or_what_lies_beyond_the_ends_is_none() {
        assert_eq!(mouths(&aisle(7.0)), []);
        let [mouth] = mouths(&aisle(25.0))[..] else { panic!("one junction") };
        assert!(mouth.distance(Vec2::new(30.0, 4.0)) < 2.5, "{mouth}");
    }

    /// The way through the next aisle begins and ends at the route; a thin wall between the two is not a way.
    #[test]
    fn both_mouths_of_a_way_round_are_found() {
        let mut lot = Scenario::new(
            "two aisles",
            [(-10.0, -3.0), (90.0, -3.0), (90.0, 12.0), (-10.0, 12.0)],
            [(0.0, 0.0), (70.0, 0.0)],
        );
        let wall = |from: f32, to: f32| Island {
            polygon: [(from, 3.0), (to, 3.0), (to, 3.3), (from, 3.3)].map(Vec2::from).to_vec(),
            height_m: KERB_MAX_M,
        };
        lot.islands = vec![wall(-9.9, 15.0), wall(20.0, 55.0), wall(60.0, 89.9)];
        let found = mouths(&lot);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0].x - 17.5).abs() < 3.0 && (found[1].x - 57.5).abs() < 3.0, "{found:?}");
        let closed = close(&mut lot, &car());
        assert_eq!(closed.len(), 2, "{closed:?}");
        assert_eq!(mouths(&lot), []);
    }

    #[test]
    fn a_closed_branch_is_closed_beside_the_route() {
        let mut lot = aisle(25.0);
        assert_eq!(close(&mut lot, &car()).len(), 1);
        assert_eq!(mouths(&lot), []);
        let [kerb] = &lot.islands[..] else { panic!("{:?}", lot.islands) };
        for corner in &kerb.polygon {
            assert!((27.5..=32.5).contains(&corner.x) && (2.8..16.0).contains(&corner.y), "{corner}");
        }
        assert_eq!(close(&mut lot, &car()), [], "once is enough");
    }
}
