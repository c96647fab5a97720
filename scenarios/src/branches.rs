//! Junctions: places where a way leaves a route and goes on. Drivers never see the route, so a driver may turn off there;
//! it is not wrong, but the lot then measures luck.
//!
//! The ground on which the middle of the car has room is measured from the route on, around walls. What lies far enough
//! from it is on a branch, whose mouth is where the shortest way back comes near the route. Where ground that was reached
//! from one place of the route meets ground reached from another, a way joins the two; one that is much shorter than the
//! route between them is a short cut.

use crate::neighbours;
use crate::open_list::Open;
use sim::geometry::{Pose, Vec2, distance_to_segment_m};
use sim::map::Map;
use sim::maths;
use sim::scenario::{Island, KERB_MAX_M, Scenario};
use sim::vehicle::VehicleSettings;
use std::collections::{BTreeMap, BinaryHeap};

/// Spacing of the raster, metres.
const CELL_M: f32 = 0.25;
/// Beyond half of the car's width, metres: where the middle of the car has room.
const ROOM_M: f32 = 0.05;
/// Ground up to this far from the route belongs to it, metres: half of a wide aisle.
const BESIDE_M: f32 = 4.0;
/// A way that goes on for more than this is a branch, metres: longer than a stall, or the other half of a wide hall.
const GOES_ON_M: f32 = 12.0;
/// Ground farther than this from the route is on a branch, metres.
const FAR_M: f32 = BESIDE_M + GOES_ON_M;
/// A way back to the route is a short cut if it saves more than this, metres: as much as a branch goes on. The two ways past
/// an obstacle, and a bend and its open inside, differ by less: where a route turns by a right angle, ways across that stay
/// within [`FAR_M`] of it save less than 10 m.
const SAVES_M: f32 = FAR_M;
/// Lengths in the raster jump from cell to cell: a short cut is all ground that touches and on which ways save this share of
/// [`SAVES_M`].
const SAVES_SHARE: f32 = 0.5;
/// Ways that leave within this distance of the start or finish only go on where the route does not, metres. One that leads
/// from the finish on to the start is no short cut.
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
pub(crate) const KERBS_MAX: usize = 40;

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

/// A way that leads from the route back to it and is much shorter than the route between.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ShortCut {
    /// Its middle, world metres.
    pub(crate) middle: Vec2,
    /// The places of the route that it joins, metres from the start, the nearer one first.
    pub(crate) joins_m: [f32; 2],
    /// The way from beside the route to beside the route, world metres.
    way: Vec<Vec2>,
}

/// What a driver may take for the route, in order of the route.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Ways {
    pub(crate) branches: Vec<Branch>,
    pub(crate) short_cuts: Vec<ShortCut>,
}

/// The ways that leave the route of a valid lot and go on, or lead back to it soon.
pub(crate) fn find(map: &Map, vehicle: &VehicleSettings) -> Ways {
    let ground = GroundFromRoute::measure(map, vehicle);
    let mut branches: Vec<Branch> = Vec::new();
    for branch in ground.ends().into_iter().map(|cell| ground.branch_to(cell)) {
        if branches.iter().all(|other| other.mouth.distance(branch.mouth) > SAME_MOUTH_M) {
            branches.push(branch);
        }
    }
    branches.sort_by(|a, b| a.arc_length_m.total_cmp(&b.arc_length_m));
    let mut short_cuts = ground.short_cuts();
    short_cuts.sort_by(|a, b| a.joins_m[0].total_cmp(&b.joins_m[0]));
    Ways { branches, short_cuts }
}

/// Closes the branches of a valid lot, and then its short cuts, with kerbs, as far as walls on both sides are near enough.
/// Returns where.
pub(crate) fn close(lot: &mut Scenario, vehicle: &VehicleSettings) -> Vec<Vec2> {
    let mut closed = Vec::new();
    // What no kerb closes, and how many were closed when that was last tried.
    let (mut open, mut closed_before) = (Vec::<Opening>::new(), 0);
    // Every kerb that is tried costs a map and a look at its ways: those of the kerb that is laid are kept.
    let seen = |lot: &Scenario| {
        let map = Map::build(lot.clone(), vehicle).ok()?;
        let ways = find(&map, vehicle);
        Some((map, ways))
    };
    let mut present = seen(lot);
    while closed.len() < KERBS_MAX
        && let Some((map, ways)) = &present
    {
        // A kerb may close several ways: look again after each.
        let branches = ways.branches.iter().map(|branch| (Opening::Branch(branch.mouth), &branch.way));
        let short_cuts = ways.short_cuts.iter().map(|short_cut| (Opening::ShortCut(short_cut.middle), &short_cut.way));
        let closing = branches.chain(short_cuts).find_map(|(opening, way)| {
            if open.iter().any(|other| other.is_same_as(opening)) {
                return None;
            }
            let closes = |lot: Scenario| {
                let after = seen(&lot).filter(|(_, after)| opening.is_closed(ways, after))?;
                Some((lot, after))
            };
            let closing = kerbs(map, way).find_map(closes);
            if closing.is_none() {
                open.push(opening);
            }
            Some((opening.place(), closing?))
        });
        if let Some((place, (with_kerb, after))) = closing {
            *lot = with_kerb;
            present = Some(after);
            closed.push(place);
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

/// What a kerb is to close, and where.
#[derive(Clone, Copy)]
enum Opening {
    /// A branch, at its mouth.
    Branch(Vec2),
    /// A short cut, at its middle.
    ShortCut(Vec2),
}

impl Opening {
    fn place(self) -> Vec2 {
        let (Self::Branch(place) | Self::ShortCut(place)) = self;
        place
    }

    fn is_same_as(self, other: Self) -> bool {
        match (self, other) {
            (Self::Branch(a), Self::Branch(b)) | (Self::ShortCut(a), Self::ShortCut(b)) => is_same_place(a, b),
            _ => false,
        }
    }

    /// Whether a kerb closed it, by the ways before and those that are left.
    fn is_closed(self, before: &Ways, left: &Ways) -> bool {
        match self {
            Self::Branch(mouth) => left.branches.iter().all(|other| !is_same_place(other.mouth, mouth)),
            // Across wide ground a kerb only moves the way, and across a long way it may leave a dead end that is a branch.
            Self::ShortCut(_) => {
                left.short_cuts.len() < before.short_cuts.len() && left.branches.len() <= before.branches.len()
            }
        }
    }
}

fn is_same_place(a: Vec2, b: Vec2) -> bool {
    a.distance(b) <= 0.5 * SAME_MOUTH_M
}

/// The lot with a kerb across a way, for each place along it, shortest kerb first.
fn kerbs<'a>(map: &'a Map, way: &[Vec2]) -> impl Iterator<Item = Scenario> + use<'a> {
    let route: Vec<Vec2> = map.path().poses().iter().map(|pose| pose.position()).collect();
    let keeps_off_route =
        |&(a, b): &(Vec2, Vec2)| route.iter().all(|&point| distance_to_segment_m(point, a, b) > KERB_BESIDE_M);
    let by_length = |a: &(Vec2, Vec2), b: &(Vec2, Vec2)| a.0.distance(a.1).total_cmp(&b.0.distance(b.1));
    let shortest_at = |&point: &Vec2| {
        (0..KERB_DIRECTIONS).filter_map(|k| chord(map, point, k)).filter(keeps_off_route).min_by(by_length)
    };
    let mut sorted: Vec<_> = way.iter().filter_map(shortest_at).collect();
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
    /// From the finish of a loop on to its start, metres; infinite if the route is none.
    finish_to_start_m: f32,
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

/// Two neighbouring cells that were reached from different places of the route.
#[derive(Clone, Copy)]
struct Link {
    cells: [usize; 2],
    /// How much longer the route between the two places is than the way through the cells, metres.
    saves_m: f32,
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
            finish_to_start_m: finish_to_start_m(path.poses()),
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
            // Nothing is asked of what lies farther away than where branches end; the cells just beyond must be final.
            if from_route_m > FAR_M + 2.0 * CELL_M {
                break;
            }
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

    /// The cells around one, and how far each is from it, metres.
    fn neighbours(&self, cell: usize) -> impl Iterator<Item = (usize, f32)> {
        let around = neighbours::around(cell, self.cols, self.cells.len() / self.cols);
        around.map(|(next, cells)| (next, CELL_M * cells))
    }

    fn arc_length_m(&self, cell: usize) -> f32 {
        self.cells[cell].station as f32 * self.spacing_m
    }

    fn length_m(&self) -> f32 {
        (self.n_stations - 1) as f32 * self.spacing_m
    }

    /// Whether a cell was reached from one of the route's ends.
    fn is_at_end(&self, cell: usize) -> bool {
        !(AT_END_M..=self.length_m() - AT_END_M).contains(&self.arc_length_m(cell))
    }

    /// The first cells that are far from the route and do not go on from one of its ends.
    fn ends(&self) -> Vec<usize> {
        let is_end = |&cell: &usize| {
            let Cell { from_route_m, parent, .. } = self.cells[cell];
            from_route_m.is_finite()
                && from_route_m > FAR_M
                && self.cells[parent].from_route_m <= FAR_M
                && !self.is_at_end(cell)
        };
        (0..self.cells.len()).filter(is_end).collect()
    }

    fn branch_to(&self, end: usize) -> Branch {
        let way = self.way_to(end);
        let mouth = way.iter().copied().find(|&cell| self.cells[cell].from_route_m > BESIDE_M).unwrap_or(end);
        let way = way.into_iter().map(|cell| self.centre(cell)).collect();
        Branch { mouth: self.centre(mouth), arc_length_m: self.arc_length_m(end), way }
    }

    /// The shortest way from beside the route to a cell.
    fn way_to(&self, cell: usize) -> Vec<usize> {
        let mut way = vec![cell];
        while let Some(&last) = way.last()
            && self.cells[last].from_route_m > KERB_BESIDE_M
        {
            way.push(self.cells[last].parent);
        }
        way.reverse();
        way
    }

    /// The ways back to the route that save much and that no branch is part of, each where it saves most.
    fn short_cuts(&self) -> Vec<ShortCut> {
        let link_of = |cell: usize| Some((cell, self.link(cell)?));
        let mut links: BTreeMap<usize, Link> = (0..self.cells.len()).filter_map(link_of).collect();
        let mut short_cuts = Vec::new();
        while let Some((first, mut best)) = links.pop_first() {
            let mut touching = vec![first];
            while let Some(cell) = touching.pop() {
                for (next, _) in self.neighbours(cell) {
                    if let Some(link) = links.remove(&next) {
                        touching.push(next);
                        best = if link.saves_m > best.saves_m { link } else { best };
                    }
                }
            }
            if best.saves_m > SAVES_M {
                short_cuts.push(self.short_cut(best));
            }
        }
        short_cuts
    }

    /// Where a cell meets one that was reached from another place of the route, if that may be part of a short cut.
    fn link(&self, cell: usize) -> Option<Link> {
        let from_route_m = self.cells[cell].from_route_m;
        if from_route_m > FAR_M {
            return None;
        }
        let links = self.neighbours(cell).filter_map(|(next, step_m)| {
            let back_m = self.cells[next].from_route_m;
            let saves_m = self.along_route_m(cell, next) - (from_route_m + step_m + back_m);
            let is_link =
                back_m <= FAR_M && saves_m > SAVES_SHARE * SAVES_M && !(self.is_at_end(cell) && self.is_at_end(next));
            is_link.then_some(Link { cells: [cell, next], saves_m })
        });
        links.max_by(|a, b| a.saves_m.total_cmp(&b.saves_m))
    }

    /// How long the route is between the places that two cells were reached from, metres: of a loop, the shorter way round.
    fn along_route_m(&self, a: usize, b: usize) -> f32 {
        let between_m = (self.arc_length_m(a) - self.arc_length_m(b)).abs();
        between_m.min(self.length_m() - between_m + self.finish_to_start_m)
    }

    fn short_cut(&self, Link { cells: [a, b], .. }: Link) -> ShortCut {
        let mut joins_m = [a, b].map(|cell| self.arc_length_m(cell));
        joins_m.sort_by(f32::total_cmp);
        let across = self.way_to(a).into_iter().chain(self.way_to(b).into_iter().rev());
        let cells: Vec<Vec2> = across.map(|cell| self.centre(cell)).collect();
        // Half-way between cells as well: the walls beside a gap may be thinner than a cell.
        let way = cells.windows(2).flat_map(|pair| [pair[0], pair[0].midpoint(pair[1])]).collect();
        ShortCut { middle: self.centre(a).midpoint(self.centre(b)), joins_m, way }
    }
}

/// From the finish of a loop on to its start, metres: not farther than ground belongs to a route, and in about the same
/// direction. Infinite if the route is none.
fn finish_to_start_m(poses: &[Pose]) -> f32 {
    let (start, finish) = (poses[0], poses[poses.len() - 1]);
    let apart_m = finish.position().distance(start.position());
    let is_loop = apart_m <= BESIDE_M && finish.ahead().dot(start.ahead()) > 0.0;
    if is_loop { apart_m } else { f32::INFINITY }
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
        find(&map, &car()).branches.into_iter().map(|branch| branch.mouth).collect()
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

    fn short_cuts(lot: &Scenario) -> Vec<ShortCut> {
        let map = Map::build(lot.clone(), &car()).unwrap();
        find(&map, &car()).short_cuts
    }

    fn block(low: (f32, f32), high: (f32, f32)) -> Island {
        let polygon = [low, (high.0, low.1), high, (low.0, high.1)].map(Vec2::from).to_vec();
        Island { polygon, height_m: KERB_MAX_M }
    }

    /// A route through a rectangle of ground, with corners of 5 m.
    fn in_rectangle<const N: usize>(low: (f32, f32), high: (f32, f32), route: [(f32, f32); N]) -> Scenario {
        let boundary = [low, (high.0, low.1), high, (low.0, high.1)];
        Scenario::new("rectangle", boundary, route).with_corner_radius_m(5.0)
    }

    /// Two legs 12 m apart, joined at x = 60, and walls between them.
    fn two_legs(walls: &[(f32, f32)]) -> Scenario {
        let route = [(0.0, 0.0), (60.0, 0.0), (60.0, 12.0), (0.0, 12.0)];
        let mut lot = in_rectangle((-10.0, -4.0), (66.0, 16.0), route);
        lot.islands = walls.iter().map(|&(from, to)| block((from, 5.8), (to, 6.2))).collect();
        lot
    }

    /// It leads back to the route, so that nothing on it is far away: it was not found.
    #[test]
    fn a_gap_between_two_legs_is_a_short_cut_and_a_wall_without_one_is_none() {
        assert_eq!(short_cuts(&two_legs(&[(-9.7, 55.0)])), []);
        let lot = two_legs(&[(-9.7, 25.0), (30.0, 55.0)]);
        assert_eq!(mouths(&lot), [], "it is no branch");
        let found = short_cuts(&lot);
        let [short_cut] = &found[..] else { panic!("{found:?}") };
        assert!(short_cut.middle.distance(Vec2::new(27.5, 6.0)) < 2.0, "{}", short_cut.middle);
        // The route has 55 m, a bend of 17.7 m and 55 m.
        let [from_m, to_m] = short_cut.joins_m;
        assert!((from_m - 27.5).abs() < 2.5 && (to_m - (127.7 - 27.5)).abs() < 2.5, "{from_m} {to_m}");
    }

    #[test]
    fn every_gap_is_a_short_cut_of_its_own() {
        let lot = two_legs(&[(-9.7, 10.0), (15.0, 30.0), (35.0, 55.0)]);
        let found = short_cuts(&lot);
        let [a, b] = &found[..] else { panic!("{found:?}") };
        assert!((a.middle.x - 12.5).abs() < 2.0 && (b.middle.x - 32.5).abs() < 2.0, "{found:?}");
    }

    /// The inside of a bend is none until it is long enough that turning early saves 16 m; then it is one, not many.
    #[test]
    fn the_open_inside_of_a_hairpin_is_one_short_cut() {
        assert_eq!(short_cuts(&two_legs(&[(-9.7, 51.0)])), []);
        assert_eq!(short_cuts(&two_legs(&[])).len(), 1);
    }

    #[test]
    fn an_island_in_a_wide_road_is_no_short_cut_on_either_side() {
        for end in [40.0, 60.0] {
            let route = [(0.0, 0.0), (22.0, 0.0), (30.0, 4.5), (end, 4.5), (end + 8.0, 0.0), (80.0, 0.0)];
            let mut lot = in_rectangle((-10.0, -7.0), (100.0, 7.0), route);
            lot.islands = vec![block((30.0, -2.0), (end, 2.0))];
            assert_eq!(short_cuts(&lot), [], "{end}");
        }
    }

    /// A way of more than 32 m is two branches, and is named once.
    #[test]
    fn a_long_way_between_two_legs_is_two_branches_and_no_short_cut() {
        let mut lot = in_rectangle((-10.0, -4.0), (86.0, 54.0), [(0.0, 0.0), (80.0, 0.0), (80.0, 50.0), (0.0, 50.0)]);
        lot.islands = vec![block((-9.7, 5.0), (25.0, 45.0)), block((30.0, 5.0), (75.0, 45.0))];
        assert_eq!(mouths(&lot).len(), 2);
        assert_eq!(short_cuts(&lot), []);
    }

    /// The finish of a loop is beside its start, and a long route between them.
    #[test]
    fn a_loop_is_no_short_cut_from_its_finish_to_its_start() {
        let around = [(25.0, 0.0), (50.0, 0.0), (50.0, 30.0), (0.0, 30.0), (0.0, 0.0), (22.5, 0.0)];
        let mut lot = in_rectangle((-6.0, -6.0), (56.0, 36.0), around);
        lot.islands = vec![block((6.0, 6.0), (44.0, 24.0))];
        assert_eq!(short_cuts(&lot), []);
        // It starts in the middle of a bend, whose open inside joins what comes soon after the start and before the finish.
        let from_bend = [(0.0, 7.0), (0.0, 0.0), (50.0, 0.0), (50.0, 14.0), (0.0, 14.0), (0.0, 9.5)];
        let mut lot = in_rectangle((-4.0, -4.0), (54.0, 18.0), from_bend);
        lot.islands = vec![block((8.0, 4.0), (46.0, 10.0))];
        assert_eq!(short_cuts(&lot), []);
        // A gap across the middle is one.
        lot.islands = vec![block((8.0, 4.0), (24.0, 10.0)), block((29.0, 4.0), (46.0, 10.0))];
        assert_eq!(short_cuts(&lot).len(), 1);
    }

    /// Beyond the finish nothing is driven, so that a ring road may go on there to the start.
    #[test]
    fn what_joins_finish_and_start_is_no_short_cut() {
        let route = [(10.0, 0.0), (40.0, 0.0), (40.0, 14.0), (0.0, 14.0), (0.0, 5.0)];
        let mut lot = in_rectangle((-4.0, -4.0), (44.0, 18.0), route);
        lot.islands = vec![block((4.0, 4.0), (36.0, 10.0))];
        assert_eq!(short_cuts(&lot), []);
    }

    #[test]
    fn a_gap_is_closed_by_a_kerb_and_open_ground_by_none() {
        let mut lot = two_legs(&[(-9.7, 25.0), (30.0, 55.0)]);
        let walls = lot.islands.len();
        assert_eq!(close(&mut lot, &car()).len(), 1);
        assert_eq!((short_cuts(&lot), mouths(&lot)), (vec![], vec![]));
        let [kerb] = &lot.islands[walls..] else { panic!("{:?}", lot.islands) };
        for corner in &kerb.polygon {
            assert!((25.0..=30.0).contains(&corner.x) && (5.0..=7.0).contains(&corner.y), "{corner}");
        }
        let mut lot = two_legs(&[]);
        assert_eq!(close(&mut lot, &car()), []);
        assert_eq!((short_cuts(&lot).len(), lot.islands.len()), (1, 0));
    }
}
