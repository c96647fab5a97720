//! Things that stand about, in the strip and beside it, and how much they leave of it.

use super::strip::Strip;
use crate::corridor::{Side, hundredths, overlap, tenths, to_millimetres};
use rand::RngExt as _;
use sim::geometry::{Pose, Vec2, wrap_angle};
use sim::maths;
use sim::scenario::{Island, Obstacle, ObstacleClass};
use sim::seed::Rng;
use std::f32::consts::TAU;

/// A stretch of the strip that is narrowed from one side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Narrowing {
    pub(super) side: Side,
    /// Along the axis, metres.
    pub(super) from_m: f32,
    /// Along the axis, metres.
    pub(super) to_m: f32,
    /// How far it reaches from the edge into the strip, metres.
    pub(super) protrusion_m: f32,
}

/// What must be left free.
#[derive(Debug, Clone, Copy)]
#[allow(clippy::struct_field_names, reason = "the postfix is the unit")]
pub(super) struct Rules {
    /// The free gap beside anything that stands in the strip, metres.
    pub(super) gap_m: f32,
    /// Distance along the axis between things on opposite sides that leave less than the gap between them, metres.
    pub(super) apart_m: f32,
    /// Distance from sharp corners, metres.
    pub(super) corner_clear_m: f32,
}

/// Something with the ground that it takes.
pub(super) enum Thing {
    Obstacle(Obstacle),
    Island(Island),
}

impl Thing {
    pub(super) fn outline(&self) -> Vec<Vec2> {
        match self {
            Self::Obstacle(obstacle) => obstacle.outline(),
            Self::Island(island) => island.polygon.clone(),
        }
    }
}

impl From<Obstacle> for Thing {
    fn from(obstacle: Obstacle) -> Self {
        Self::Obstacle(obstacle)
    }
}

impl From<Island> for Thing {
    fn from(island: Island) -> Self {
        Self::Island(island)
    }
}

/// Obstacles of a lot while it is drawn.
pub(super) struct Things<'a> {
    strip: &'a Strip,
    /// The stretch of the axis on which things may stand in the way, metres.
    usable_m: (f32, f32),
    pub(super) obstacles: Vec<Obstacle>,
    pub(super) islands: Vec<Island>,
    pub(super) outlines: Vec<Vec<Vec2>>,
    pub(super) narrowings: Vec<Narrowing>,
}

impl<'a> Things<'a> {
    /// Nothing may stand in the strip outside of the stretch.
    pub(super) fn new(strip: &'a Strip, usable_m: (f32, f32)) -> Self {
        Self {
            strip,
            usable_m,
            obstacles: Vec::new(),
            islands: Vec::new(),
            outlines: Vec::new(),
            narrowings: Vec::new(),
        }
    }

    /// Puts something where nothing else stands, without checking whether it is in the way.
    pub(super) fn stand(&mut self, thing: impl Into<Thing>) -> bool {
        let thing = thing.into();
        let is_free = self.reserve(thing.outline());
        if is_free {
            match thing {
                Thing::Obstacle(obstacle) => self.obstacles.push(obstacle),
                Thing::Island(island) => self.islands.push(island),
            }
        }
        is_free
    }

    /// Keeps ground free of other things, unless some stand there: then it is `false`.
    pub(super) fn reserve(&mut self, outline: Vec<Vec2>) -> bool {
        let is_free = !self.outlines.iter().any(|other| overlap(other, &outline));
        if is_free {
            self.outlines.push(outline);
        }
        is_free
    }

    /// Puts something into the strip on one side, if rules and other things allow. On its way around the thing the route
    /// keeps to the other side.
    pub(super) fn narrow(&mut self, thing: impl Into<Thing>, side: Side, near_m: f32, rules: &Rules) -> bool {
        let thing = thing.into();
        let narrowing = self.narrowing_by(&thing.outline(), side, near_m);
        self.allows(&narrowing, rules) && self.stand(thing) && {
            self.narrowings.push(narrowing);
            true
        }
    }

    fn narrowing_by(&self, outline: &[Vec2], side: Side, near_m: f32) -> Narrowing {
        let mut narrowing =
            Narrowing { side, from_m: f32::INFINITY, to_m: f32::NEG_INFINITY, protrusion_m: f32::NEG_INFINITY };
        for (a, b) in sim::geometry::edges(outline) {
            for point in [a, 0.5 * (a + b)] {
                let at = self.strip.local(point, near_m);
                narrowing.from_m = narrowing.from_m.min(at.x);
                narrowing.to_m = narrowing.to_m.max(at.x);
                let protrusion_m = self.strip.half_width_m(at.x) - side.sign() * at.y;
                narrowing.protrusion_m = narrowing.protrusion_m.max(protrusion_m);
            }
        }
        narrowing
    }

    fn allows(&self, narrowing: &Narrowing, rules: &Rules) -> bool {
        let Narrowing { side, from_m, to_m, protrusion_m } = *narrowing;
        let width_m = 2.0 * self.strip.half_width_m(from_m).min(self.strip.half_width_m(to_m));
        let is_blocked = |other: &Narrowing| {
            let is_near = from_m < other.to_m + rules.apart_m && other.from_m < to_m + rules.apart_m;
            other.side != side && is_near && width_m - protrusion_m - other.protrusion_m < rules.gap_m
        };
        self.usable_m.0 <= from_m
            && to_m <= self.usable_m.1
            && width_m - protrusion_m >= rules.gap_m - 0.01
            && !self.strip.is_near_corner(from_m, to_m, rules.corner_clear_m)
            && !self.narrowings.iter().any(is_blocked)
    }

    /// Something of a class with its length along the strip, turned by `yaw_rad`, that takes `protrusion_m` from the strip
    /// if it stands parallel to it.
    pub(super) fn beside(
        &self,
        class: ObstacleClass,
        side: Side,
        s_m: f32,
        protrusion_m: f32,
        yaw_rad: f32,
    ) -> Obstacle {
        let [_, width_m, _] = class.default_size_m();
        let pose = self.strip.pose(s_m);
        let d_m = side.sign() * (self.strip.half_width_m(s_m) - protrusion_m + 0.5 * width_m);
        obstacle(class, self.strip.point(s_m, d_m), pose.heading_rad + yaw_rad)
    }
}

/// An obstacle at a place rounded to millimetres and tenths of a degree.
pub(super) fn obstacle(class: ObstacleClass, at: Vec2, heading_rad: f32) -> Obstacle {
    let heading_deg = tenths(wrap_angle(heading_rad).to_degrees());
    Obstacle { heading_deg, ..Obstacle::new(class, Pose::new(to_millimetres(at), 0.0)) }
}

/// The same of another size, `[length, width, height]` in metres, rounded to centimetres.
pub(super) fn sized(class: ObstacleClass, at: Vec2, heading_rad: f32, size_m: [f32; 3]) -> Obstacle {
    let [length_m, width_m, height_m] = size_m.map(|value| Some(hundredths(value)));
    Obstacle { length_m, width_m, height_m, ..obstacle(class, at, heading_rad) }
}

/// A round bed or basin.
pub(super) fn round_bed(at: Vec2, radius_m: f32, height_m: f32) -> Island {
    const CORNERS: u8 = 12;
    let corner = |k: u8| at + radius_m * maths::unit(TAU * f32::from(k) / f32::from(CORNERS));
    Island { polygon: (0..CORNERS).map(|k| to_millimetres(corner(k))).collect(), height_m }
}

/// Either way a parked car may face.
pub(super) fn facing_rad(rng: &mut Rng) -> f32 {
    if rng.random_bool(0.7) { 0.0 } else { std::f32::consts::PI }
}

/// A side of the road.
pub(super) fn side(rng: &mut Rng) -> Side {
    if rng.random_bool(0.5) { Side::Left } else { Side::Right }
}
