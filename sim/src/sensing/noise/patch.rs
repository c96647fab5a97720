//! Patches of ground that are misread.

use super::layer::Layer;
use crate::geometry::{Circles, Vec2};

/// A convex patch of ground that is misread while it is alive.
#[derive(Debug, Clone)]
pub(in crate::sensing) struct Patch {
    pub(in crate::sensing) layer: Layer,
    pub(in crate::sensing) region: Region,
    pub(super) period_ticks: u32,
    pub(super) phase_ticks: u32,
    pub(super) life_ticks: u32,
}

/// What a misread patch looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::sensing) enum Reads {
    Occupied,
    Free,
}

/// Patches that look the same.
#[derive(Debug, Clone, Default)]
pub(in crate::sensing) struct Patches {
    pub(super) patches: Vec<Patch>,
    /// Circles around them, in their order.
    circles: Circles,
}

impl Patches {
    /// Computes the circles; call this after the last patch is added.
    pub(super) fn arrange(&mut self) {
        self.circles = self.patches.iter().map(|patch| (patch.region.centre, patch.region.radius_m)).collect();
    }

    /// Those whose circle overlaps a circle of the world and that are alive at a tick.
    pub(in crate::sensing) fn near(&self, centre: Vec2, radius_m: f32, tick: u32) -> impl Iterator<Item = &Patch> {
        let near = self.circles.overlapping(centre, radius_m).map(|index| &self.patches[index]);
        near.filter(move |patch| patch.is_alive(tick))
    }
}

/// A convex polygon in the world with a circle around it.
#[derive(Debug, Clone)]
pub(in crate::sensing) struct Region {
    pub(in crate::sensing) polygon: Vec<Vec2>,
    pub(in crate::sensing) centre: Vec2,
    pub(in crate::sensing) radius_m: f32,
}

impl Region {
    pub(super) fn new(polygon: Vec<Vec2>) -> Self {
        let centre = polygon.iter().sum::<Vec2>() / polygon.len() as f32;
        let radius_m = polygon.iter().map(|corner| corner.distance(centre)).fold(0.0, f32::max);
        Self { polygon, centre, radius_m }
    }
}

impl Patch {
    pub(super) fn lasting(layer: Layer, polygon: Vec<Vec2>) -> Self {
        Self { layer, region: Region::new(polygon), period_ticks: 1, phase_ticks: 0, life_ticks: 1 }
    }

    pub(in crate::sensing) fn is_alive(&self, tick: u32) -> bool {
        (tick + self.phase_ticks) % self.period_ticks < self.life_ticks
    }
}
