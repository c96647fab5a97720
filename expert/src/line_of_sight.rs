//! Which ground the expert knows.
//!
//! What it does not know it takes for free, as planners of unknown terrain do (the free-space assumption: Zelinsky 1992;
//! Koenig & Likhachev 2002). A way that leaves the patch then goes on; one that is seen to end does not, though it may be
//! longer within the patch.

use crate::settings::Sees;
use sim::distance_field::{self, DistanceField};
use sim::geometry::{Pose, Vec2, WorldFromEgo};
use sim::map::{Map, Occluder};
use sim::maths;
use sim::sensing::{GridGeometry, SensingSettings};
use sim::vectors::{FourPoints, f32x4};

/// Bearings into which the half plane ahead of the camera is divided.
const BEARINGS: usize = 128;
/// A thing that hides the ground up to this many times its range or farther hides all ground behind it within the
/// patch (docs/methods.md 1.7): from 1.2 m on for a camera at 1.55 m. Lower things hide little more than themselves.
const OCCLUSION_FACTOR_MIN: f32 = 4.4;
/// What is not this far ahead of the camera hides nothing, metres.
const AHEAD_MIN_M: f32 = 0.1;

/// Which ground is known at one decision: all of it, or what the patch shows.
#[derive(Debug, Clone)]
pub(crate) struct LineOfSight(Option<VisiblePatch>);

impl LineOfSight {
    pub(crate) fn new(sees: Sees, map: &Map, pose: Pose, sensing: &SensingSettings) -> Self {
        match sees {
            Sees::WholeMap => Self::of_everything(),
            Sees::PatchOnly => Self(Some(VisiblePatch::new(map, pose, sensing))),
        }
    }

    /// All ground is known.
    pub(crate) fn of_everything() -> Self {
        Self(None)
    }

    /// The patch as it lies before a car at the origin, with nothing hidden.
    pub(crate) fn of_patch(geometry: GridGeometry) -> Self {
        Self(Some(VisiblePatch {
            geometry,
            camera: Vec2::ZERO,
            world_from_ego: Pose::default().world_from_ego(),
            range_squared: [f32::INFINITY; BEARINGS],
        }))
    }

    /// Whether a world point is known ground.
    #[inline]
    pub(crate) fn knows(&self, in_world: Vec2) -> bool {
        self.0.as_ref().is_none_or(|patch| patch.knows(in_world))
    }
}

/// Distances to what is not drivable, as far as is known: on unknown ground, none is near.
#[derive(Debug, Clone, Copy)]
pub(crate) struct KnownGround<'a> {
    pub(crate) field: &'a DistanceField,
    pub(crate) sight: &'a LineOfSight,
}

impl KnownGround<'_> {
    /// As [`DistanceField::at_four`], metres.
    #[inline]
    pub(crate) fn at_four(self, points: FourPoints) -> f32x4 {
        self.where_known(points, self.field.at_four(points))
    }

    /// As [`DistanceField::at_four_nearest_nodes`], metres.
    #[inline]
    pub(crate) fn at_four_nearest_nodes(self, points: FourPoints) -> f32x4 {
        self.where_known(points, self.field.at_four_nearest_nodes(points))
    }

    #[inline]
    fn where_known(self, points: FourPoints, distances_m: f32x4) -> f32x4 {
        let Some(patch) = &self.sight.0 else { return distances_m };
        let (x, y, distances_m) = (points.x.to_array(), points.y.to_array(), distances_m.to_array());
        let known_m = |lane: usize| {
            let is_known = patch.knows(Vec2::new(x[lane], y[lane]));
            if is_known { distances_m[lane] } else { distance_field::CAP_M }
        };
        std::array::from_fn(known_m).into()
    }
}

/// The patch without what tall things hide in it.
#[derive(Debug, Clone)]
pub(crate) struct VisiblePatch {
    geometry: GridGeometry,
    /// Ego frame, metres.
    camera: Vec2,
    world_from_ego: WorldFromEgo,
    /// Range from the camera at which sight ends, metres, squared, by bearing from right to left.
    range_squared: [f32; BEARINGS],
}

impl VisiblePatch {
    fn new(map: &Map, pose: Pose, sensing: &SensingSettings) -> Self {
        let geometry = sensing.geometry;
        let mut patch = Self {
            geometry,
            camera: Vec2::new(sensing.camera_ahead_m, 0.0),
            world_from_ego: pose.world_from_ego(),
            range_squared: [f32::INFINITY; BEARINGS],
        };
        if !sensing.occlusion {
            return patch;
        }
        let tall_m = sensing.camera_height_m * (1.0 - 1.0 / OCCLUSION_FACTOR_MIN);
        let reach_m = maths::hypot(geometry.far_edge_ahead_m(), 0.5 * geometry.side_m);
        let near = map.occluders_near(pose.position(), reach_m);
        for occluder in near.filter(|occluder| occluder.height_m >= tall_m) {
            patch.cast_shadow(occluder);
        }
        patch
    }

    #[inline]
    fn knows(&self, in_world: Vec2) -> bool {
        let in_ego = self.world_from_ego.inverse_point(in_world);
        if in_ego.x < self.geometry.near_edge_ahead_m {
            return true;
        }
        let from_camera = in_ego - self.camera;
        self.geometry.contains(in_ego) && from_camera.length_squared() <= self.range_squared[bearing_bin(from_camera)]
    }

    /// The line of sight ends, by bearing, where a ray from the camera enters the outline.
    fn cast_shadow(&mut self, occluder: &Occluder) {
        let (world_from_ego, camera) = (self.world_from_ego, self.camera);
        let from_camera = |in_world: Vec2| world_from_ego.inverse_point(in_world) - camera;
        for (a, b) in sim::geometry::edges(&occluder.outline) {
            let (a, b) = (from_camera(a), from_camera(b));
            if a.x < AHEAD_MIN_M && b.x < AHEAD_MIN_M {
                continue;
            }
            // Of what reaches back beside the camera, the part ahead.
            let cut = |from: Vec2, to: Vec2| from.lerp(to, ((AHEAD_MIN_M - from.x) / (to.x - from.x)).max(0.0));
            let (a, b) = (if a.x < AHEAD_MIN_M { cut(a, b) } else { a }, if b.x < AHEAD_MIN_M { cut(b, a) } else { b });
            let (a, b) = if bearing_bin(a) <= bearing_bin(b) { (a, b) } else { (b, a) };
            for bin in bearing_bin(a)..=bearing_bin(b) {
                let ray = bin_centre(bin);
                // ray · t = a + (b − a) · s, with s kept on the edge at its two end bins.
                let edge = b - a;
                let s = (-ray.perp_dot(a) / ray.perp_dot(edge)).clamp(0.0, 1.0);
                let meets = if s.is_finite() { a + edge * s } else { a };
                self.range_squared[bin] = self.range_squared[bin].min(meets.length_squared());
            }
        }
    }
}

/// Bin of a bearing within ±90° of straight ahead. Bins divide y/(x + |y|) evenly instead of the angle: no arctangent.
#[inline]
fn bearing_bin(from_camera: Vec2) -> usize {
    let share = 0.5 + 0.5 * from_camera.y / (from_camera.x + from_camera.y.abs());
    ((share * BEARINGS as f32).max(0.0) as usize).min(BEARINGS - 1)
}

/// Direction through the middle of a bin.
fn bin_centre(bin: usize) -> Vec2 {
    let y = (2.0 * (bin as f32 + 0.5) / BEARINGS as f32) - 1.0;
    Vec2::new(1.0 - y.abs(), y).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::scenario::{Obstacle, ObstacleClass, Scenario};

    /// What is known at the origin beside a car whose right side is at y = 1.57, from x = 7.65 to 12.35.
    fn knows(sensing: &SensingSettings, x: f32, y: f32) -> bool {
        let scenario = Scenario::lane(-40.0..=40.0, 40.0, -20.0..=20.0)
            .with_obstacles([Obstacle::new(ObstacleClass::Sedan, Pose::new(Vec2::new(10.0, 2.5), 0.0))]);
        let map = Map::build(scenario, &sim::vehicle::VehicleSettings::hyundai_hg300()).unwrap();
        LineOfSight::new(Sees::PatchOnly, &map, Pose::default(), sensing).knows(Vec2::new(x, y))
    }

    #[test]
    fn ground_beyond_the_patch_and_behind_a_car_is_unknown() {
        let knows = |x, y| knows(&SensingSettings::paper(), x, y);
        assert!(knows(8.0, 0.0) && knows(16.0, 0.0) && knows(7.0, -5.9), "in the patch");
        assert!(!knows(16.4, 0.0) && !knows(8.0, 6.1), "beyond the patch");
        assert!(knows(0.0, 9.0) && knows(-9.0, 0.0), "beside and behind the car");
        // Past the far right corner at (12.35, 1.57) one sees what is below y/(x − 1.59) = .146.
        assert!(!knows(14.0, 4.0) && !knows(14.0, 2.1) && knows(14.0, 1.5), "behind the car and past it");
    }

    /// A wall that reaches back beside the camera hid nothing, though the sensor shows what is behind it as hidden.
    #[test]
    fn a_wall_beside_the_camera_hides_what_is_behind_it() {
        let wall = Obstacle {
            length_m: Some(25.0),
            width_m: Some(0.2),
            height_m: Some(3.0),
            ..Obstacle::new(ObstacleClass::Wall, Pose::new(Vec2::new(2.0, 1.8), 0.0))
        };
        let scenario = Scenario::lane(-40.0..=40.0, 40.0, -20.0..=20.0).with_obstacles([wall]);
        let map = Map::build(scenario, &sim::vehicle::VehicleSettings::hyundai_hg300()).unwrap();
        let sight = LineOfSight::new(Sees::PatchOnly, &map, Pose::default(), &SensingSettings::paper());
        assert!(!sight.knows(Vec2::new(6.0, 4.0)) && !sight.knows(Vec2::new(12.0, 3.0)), "behind the wall");
        assert!(sight.knows(Vec2::new(6.0, 1.0)) && sight.knows(Vec2::new(12.0, -4.0)), "before it");
    }

    #[test]
    fn ground_is_hidden_from_the_camera_of_the_sensor() {
        let paper = SensingSettings::paper();
        assert!(!knows(&paper, 14.0, 1.9));
        // From x = 7, the line past the corner has a slope of .294, and the point lies at .271.
        assert!(knows(&SensingSettings { camera_ahead_m: 7.0, ..paper.clone() }, 14.0, 1.9), "farther ahead");
        assert!(knows(&SensingSettings { camera_height_m: 9.0, ..paper.clone() }, 14.0, 4.0), "above the car");
        assert!(knows(&SensingSettings { occlusion: false, ..paper }, 14.0, 4.0), "no occlusion");
    }
}
