//! Which ground is known to the expert.

use crate::config::Sees;
use sim::geometry::{Pose, Vec2, WorldFromEgo};
use sim::map::{Map, Occluder};
use sim::sensing::GridGeometry;

/// Bearings into which the half plane ahead of the camera is divided.
const BEARINGS: usize = 128;
/// The camera, ahead of the rear axle, metres (methods.md 9.2).
const CAMERA_AHEAD_M: f32 = 1.59;
/// Things at least this high hide the ground behind them out of the patch: their shadow is 4.4 times as long as
/// their range (methods.md 1.7, camera height 1.55 m). Lower things hide little more than themselves.
const TALL_M: f32 = 1.2;

/// Which ground is known at one decision.
#[derive(Debug, Clone)]
pub(crate) enum Sight {
    /// All of it.
    WholeMap,
    /// What the patch shows.
    Patch(PatchSight),
}

impl Sight {
    pub(crate) fn new(sees: Sees, map: &Map, pose: Pose, geometry: &GridGeometry) -> Self {
        match sees {
            Sees::WholeMap => Self::WholeMap,
            Sees::PatchOnly => Self::Patch(PatchSight::new(map, pose, geometry)),
        }
    }

    /// Whether a world point is known ground.
    #[inline]
    pub(crate) fn knows(&self, in_world: Vec2) -> bool {
        match self {
            Self::WholeMap => true,
            Self::Patch(patch) => patch.knows(in_world),
        }
    }
}

/// The patch and the shadows of tall things in it.
#[derive(Debug, Clone)]
pub(crate) struct PatchSight {
    geometry: GridGeometry,
    world_from_ego: WorldFromEgo,
    /// Range from the camera at which sight ends, metres, by bearing from right to left.
    range_m: [f32; BEARINGS],
}

impl PatchSight {
    fn new(map: &Map, pose: Pose, geometry: &GridGeometry) -> Self {
        let mut sight =
            Self { geometry: *geometry, world_from_ego: pose.world_from_ego(), range_m: [f32::INFINITY; BEARINGS] };
        let reach_m = geometry.far_edge_ahead_m().hypot(0.5 * geometry.side_m);
        for occluder in map.occluders() {
            let is_near = occluder.centre.distance(pose.position()) < reach_m + occluder.radius_m;
            if is_near && occluder.height_m >= TALL_M {
                sight.cast_shadow(occluder);
            }
        }
        sight
    }

    fn knows(&self, in_world: Vec2) -> bool {
        let in_ego = self.world_from_ego.inverse_point(in_world);
        if in_ego.x < self.geometry.near_edge_ahead_m {
            return true;
        }
        let from_camera = in_ego - Vec2::new(CAMERA_AHEAD_M, 0.0);
        self.geometry.contains(in_ego) && from_camera.length() <= self.range_m[bearing_bin(from_camera)]
    }

    /// Sight ends, by bearing, where a ray from the camera enters the outline.
    fn cast_shadow(&mut self, occluder: &Occluder) {
        let camera = Vec2::new(CAMERA_AHEAD_M, 0.0);
        let from_camera = |in_world: Vec2| self.world_from_ego.inverse_point(in_world) - camera;
        for (a, b) in sim::geometry::edges(&occluder.outline) {
            let (a, b) = (from_camera(a), from_camera(b));
            if a.x < 0.1 || b.x < 0.1 {
                continue;
            }
            let (a, b) = if bearing_bin(a) <= bearing_bin(b) { (a, b) } else { (b, a) };
            for bin in bearing_bin(a)..=bearing_bin(b) {
                let ray = Vec2::from_angle(bin_centre_rad(bin));
                // ray · t = a + (b − a) · s, with s kept on the edge at its two end bins.
                let edge = b - a;
                let s = (-ray.perp_dot(a) / ray.perp_dot(edge)).clamp(0.0, 1.0);
                let range_m = if s.is_finite() { (a + edge * s).length() } else { a.length().min(b.length()) };
                self.range_m[bin] = self.range_m[bin].min(range_m);
            }
        }
    }
}

/// Bin of a bearing within ±90° of straight ahead.
fn bearing_bin(from_camera: Vec2) -> usize {
    let share = 0.5 + from_camera.y.atan2(from_camera.x) / std::f32::consts::PI;
    ((share * BEARINGS as f32).max(0.0) as usize).min(BEARINGS - 1)
}

fn bin_centre_rad(bin: usize) -> f32 {
    ((bin as f32 + 0.5) / BEARINGS as f32 - 0.5) * std::f32::consts::PI
}
