//! Open ground: parked cars, planters, pillars and pieces of wall stand about so close to each other that they leave one
//! way; walls face the driver where the way turns.

use super::course::{Course, first_apart};
use super::parts::{RUN_OUT_M, lot, things_on};
use super::strip::{Strip, is_on, line_length_m, point_at};
use super::things::{self, Rules, Things, facing_rad, side};
use super::walls::{Wall, yard};
use crate::clutter::{draw_car, yaw_rad};
use crate::corridor::to_millimetres;
use rand::RngExt as _;
use sim::geometry::{Pose, Vec2, polygon_contains, rectangle};
use sim::maths;
use sim::scenario::{Island, Obstacle, ObstacleClass, Scenario};
use sim::seed::Rng;
use std::ops::Range;

/// The centre line between the run-outs, metres.
const LENGTH_M: Range<f32> = 85.0..170.0;
const WIDTH_M: Range<f32> = 4.5..10.0;
const RADIUS_M: Range<f32> = 9.0..25.0;
/// Between two things at the edge of the way; the car is 1.86 m wide.
const GAP_M: Range<f32> = 0.4..1.4;
/// Things stand back from the edge by up to this much, metres.
const SET_BACK_M: f32 = 0.5;
/// Open ground around the way, metres.
const AROUND_M: Range<f32> = 6.0..15.0;
/// The edge counts as one as far as it turns by less than this at a vertex, radians.
const SHARP_RAD: f32 = 0.5;

/// What stands along a stretch of the edge.
#[derive(Clone, Copy)]
enum Kind {
    ParkedAlong,
    ParkedAcross,
    Planter,
    Wall,
    Pillar,
    Cone,
}

/// One of them.
#[derive(Clone, Copy)]
struct Item {
    kind: Kind,
    class: ObstacleClass,
    /// Along the edge, metres.
    length_m: f32,
    /// Away from it, metres.
    depth_m: f32,
}

impl Item {
    fn draw(kind: Kind, rng: &mut Rng) -> Self {
        let class = match kind {
            Kind::ParkedAlong | Kind::ParkedAcross => draw_car(rng),
            Kind::Planter | Kind::Wall => ObstacleClass::Wall,
            Kind::Pillar => ObstacleClass::Pillar,
            Kind::Cone => ObstacleClass::Cone,
        };
        let [class_length_m, class_width_m, _] = class.default_size_m();
        let (length_m, depth_m) = match kind {
            Kind::ParkedAcross => (class_width_m, class_length_m),
            Kind::Planter => (rng.random_range(1.0..6.0), rng.random_range(0.8..2.5)),
            Kind::Wall => (rng.random_range(2.0..9.0), class_width_m),
            Kind::ParkedAlong | Kind::Pillar | Kind::Cone => (class_length_m, class_width_m),
        };
        Self { kind, class, length_m, depth_m }
    }
}

/// An area beside the way, in which planters are raised.
struct Ground<'a> {
    things: Things<'a>,
    wall: Wall,
}

pub(super) fn draw(layout: &mut Rng, obstacles: &mut Rng) -> Option<(Scenario, Strip)> {
    let strip = first_apart(layout, 3.0, course)?;
    let outline = strip.outline(0.0);
    let boundary = yard(&outline, AROUND_M, layout);
    let wall = if layout.random_bool(0.6) { Wall::tall(layout) } else { Wall::low(layout) };
    let mut ground = Ground { things: things_on(&strip), wall };
    for stretch in stretches(&outline) {
        ground.line(&stretch, obstacles);
    }
    on_the_way(&mut ground.things, &strip, obstacles);
    ground.scatter(&outline, &boundary, obstacles);
    Some((lot(&strip, boundary, ground.things), strip))
}

fn course(rng: &mut Rng) -> Course {
    let mut course = Course::new(rng.random_range(WIDTH_M));
    let until_m = RUN_OUT_M + rng.random_range(LENGTH_M);
    course.straight(RUN_OUT_M + rng.random_range(8.0..30.0));
    while course.length_m() < until_m {
        if rng.random_bool(0.6) {
            let turn_rad = course.turn_rad(rng, 50.0..100.0, 160.0);
            course.corner(turn_rad, rng.random_range(0.0..2.5), None);
        } else {
            let turn_rad = course.turn_rad(rng, 30.0..120.0, 160.0);
            course.bend(rng.random_range(RADIUS_M), turn_rad);
        }
        course.straight(rng.random_range(14.0..40.0));
    }
    course.straight(RUN_OUT_M);
    course
}

/// The outline, cut at its sharp corners.
fn stretches(outline: &[Vec2]) -> Vec<Vec<Vec2>> {
    let count = outline.len();
    let turn_rad = |k: usize| {
        let (before, at, after) = (outline[(k + count - 1) % count], outline[k], outline[(k + 1) % count]);
        (at - before).angle_to(after - at).abs()
    };
    let first = (0..count).find(|&k| turn_rad(k) > SHARP_RAD).unwrap_or(0);
    let mut stretches = Vec::new();
    let mut stretch = vec![outline[first]];
    for k in 1..=count {
        let index = (first + k) % count;
        stretch.push(outline[index]);
        if turn_rad(index) > SHARP_RAD || k == count {
            stretches.push(std::mem::replace(&mut stretch, vec![outline[index]]));
        }
    }
    stretches
}

impl Ground<'_> {
    /// Things one behind the other along a stretch of the outline.
    fn line(&mut self, stretch: &[Vec2], rng: &mut Rng) {
        use Kind::{Cone, ParkedAcross, ParkedAlong, Pillar, Planter, Wall};
        let palette: &[Kind] = match rng.random_range(0..6) {
            0 => &[ParkedAlong, ParkedAlong, Pillar],
            1 => &[ParkedAcross, ParkedAcross, Planter],
            2 => &[Wall],
            3 => &[Planter, Planter, Pillar, Wall],
            4 => &[Pillar, Cone],
            _ => &[ParkedAlong, ParkedAcross, Planter, Wall, Pillar, Cone],
        };
        let length_m = line_length_m(stretch);
        let mut at_m = rng.random_range(0.0..0.5);
        while length_m - at_m > 0.5 {
            let mut item = Item::draw(palette[rng.random_range(0..palette.len())], rng);
            if item.length_m > length_m - at_m {
                item = Item { length_m: length_m - at_m, ..Item::draw(Wall, rng) };
            }
            let (a, b) = (point_at(stretch, at_m), point_at(stretch, at_m + item.length_m));
            let set_back_m = rng.random_range(0.0..SET_BACK_M);
            if !self.put(&item, a, b, set_back_m, rng) {
                // Something else stands there; a wall closes what it leaves.
                let walls = self.wall.straight(a, b);
                self.things.obstacles.extend(walls);
            }
            at_m += item.length_m + rng.random_range(GAP_M);
        }
    }

    /// Puts a thing outside of the edge from `a` to `b`; whether there was room.
    fn put(&mut self, item: &Item, a: Vec2, b: Vec2, set_back_m: f32, rng: &mut Rng) -> bool {
        let along = (b - a).normalize();
        let centre = 0.5 * (a + b) - along.perp() * (set_back_m + 0.5 * item.depth_m);
        let heading_rad = maths::angle_rad(along);
        match item.kind {
            Kind::ParkedAlong | Kind::ParkedAcross => {
                let is_across = matches!(item.kind, Kind::ParkedAcross);
                let across_rad = if is_across { std::f32::consts::FRAC_PI_2 } else { 0.0 };
                let heading_rad = heading_rad + across_rad + yaw_rad(rng, 2.0) + facing_rad(rng);
                self.things.stand(things::obstacle(item.class, centre, heading_rad))
            }
            Kind::Planter => self.plant(Pose::new(centre, heading_rad), [item.length_m, item.depth_m], rng),
            Kind::Wall => {
                let outward = -along.perp() * set_back_m;
                let walls = self.wall.straight(a + outward, b + outward);
                walls.into_iter().all(|wall| self.things.stand(wall))
            }
            Kind::Pillar | Kind::Cone => self.things.stand(things::obstacle(item.class, centre, heading_rad)),
        }
    }

    /// A planter, some with a tree.
    fn plant(&mut self, pose: Pose, size_m: [f32; 2], rng: &mut Rng) -> bool {
        let polygon = rectangle(pose, size_m[0], size_m[1]).map(to_millimetres).to_vec();
        let has_tree = rng.random_bool(0.4);
        let is_free = self.things.reserve(polygon.clone());
        if is_free {
            self.things.islands.push(Island { polygon, height_m: 0.15 });
            if has_tree {
                let trunk = things::obstacle(ObstacleClass::Pillar, pose.position(), 0.0);
                let size_m = Some(0.3);
                self.things.obstacles.push(Obstacle { length_m: size_m, width_m: size_m, ..trunk });
            }
        }
        is_free
    }

    /// More of the same on the ground around.
    fn scatter(&mut self, outline: &[Vec2], boundary: &[Vec2], rng: &mut Rng) {
        use Kind::{Cone, ParkedAcross, ParkedAlong, Pillar, Planter, Wall};
        let (low, high) = (boundary[0], boundary[2]);
        let area_m2 = (high - low).element_product();
        for _ in 0..(area_m2 / rng.random_range(100.0..400.0)) as usize {
            let kind = [ParkedAlong, ParkedAcross, Planter, Wall, Pillar, Cone][rng.random_range(0..6)];
            let item = Item::draw(kind, rng);
            let at = Vec2::new(rng.random_range(low.x..high.x), rng.random_range(low.y..high.y));
            let along = maths::unit(rng.random_range(-std::f32::consts::PI..std::f32::consts::PI));
            let (a, b) = (at - 0.5 * item.length_m * along, at + 0.5 * item.length_m * along);
            // A little larger than the thing.
            let centre = at - along.perp() * 0.5 * item.depth_m;
            let reach = rectangle(Pose::new(centre, maths::angle_rad(along)), item.length_m + 1.0, item.depth_m + 1.0);
            let is_inside = reach.iter().all(|&corner| polygon_contains(boundary, corner));
            if is_inside && !is_on(outline, &reach) {
                self.put(&item, a, b, 0.0, rng);
            }
        }
    }
}

/// Things that stand at the edge of the way.
fn on_the_way(things: &mut Things<'_>, strip: &Strip, rng: &mut Rng) {
    let rules = Rules { gap_m: rng.random_range(2.8..3.6), apart_m: 9.0, corner_clear_m: 7.0 };
    for _ in 0..rng.random_range(0..10) {
        let s_m = rng.random_range(0.0..strip.length_m());
        let side = side(rng);
        let class = match rng.random_range(0..6) {
            0 => ObstacleClass::Cone,
            1 => ObstacleClass::Bollard,
            2 => ObstacleClass::Pillar,
            3 => ObstacleClass::Person,
            _ => draw_car(rng),
        };
        let protrusion_m = class.default_size_m()[1] + rng.random_range(0.0..0.3);
        let yaw_rad = yaw_rad(rng, 4.0) + facing_rad(rng);
        let thing = things.beside(class, side, s_m, protrusion_m, yaw_rad);
        things.narrow(thing, side, s_m, &rules);
    }
}
