//! A scenario, validated and indexed: built once, immutable, shared by `Arc`.
//!
//! After [`Map::build`] succeeds nothing in this crate returns an error.

use crate::collision::CollisionWorld;
use crate::distance_field::DistanceField;
use crate::geometry::{Circles, Outline, Pose, Vec2};
use crate::path::Path;
use crate::scenario::{Scenario, ScenarioError};
use crate::validate::validate;
use crate::vehicle::VehicleSettings;

/// The clean world: what is drivable, what is solid, and the route.
#[derive(Debug)]
pub struct Map {
    scenario: Scenario,
    path: Path,
    distance: DistanceField,
    collision: CollisionWorld,
    occluders: Vec<Occluder>,
    occluder_circles: Circles,
}

/// A convex object that hides the ground behind it from the camera.
#[derive(Debug, Clone)]
pub struct Occluder {
    /// Convex outline in the world, counter-clockwise.
    pub outline: Vec<Vec2>,
    /// The same corners, arranged to be transformed together.
    pub(crate) corners: Outline,
    /// Centre of a circle around the outline, world.
    pub centre: Vec2,
    /// Radius of that circle, metres.
    pub radius_m: f32,
    /// Height above ground, metres.
    pub height_m: f32,
}

impl Map {
    /// Validates and indexes a scenario for a vehicle.
    ///
    /// # Errors
    /// The first thing wrong with the scenario, with its place and a remedy.
    pub fn build(scenario: Scenario, vehicle: &VehicleSettings) -> Result<Self, ScenarioError> {
        validate(&scenario, vehicle)?;
        let path = Path::new(&scenario.reference_path);
        let mut distance = DistanceField::of_boundary(&scenario.boundary);
        for island in &scenario.islands {
            distance.carve_polygon(&island.polygon);
        }
        for obstacle in &scenario.obstacles {
            let [length_m, width_m, _] = obstacle.size_m();
            let centre = obstacle.centre().position();
            let reach_m = 0.5 * length_m.hypot(width_m);
            // Wholly outside the drivable space: carving it would change nothing a car can reach.
            if distance.at(centre) < -reach_m {
                continue;
            }
            if obstacle.class.is_round() {
                distance.carve_disc(centre, 0.5 * length_m);
            } else {
                distance.carve_polygon(&obstacle.outline());
            }
        }
        let occluders: Vec<Occluder> = scenario
            .obstacles
            .iter()
            .map(|obstacle| {
                let [length_m, width_m, height_m] = obstacle.size_m();
                let centre = obstacle.centre().position();
                let outline = obstacle.outline();
                let corners = outline.iter().copied().collect();
                Occluder { outline, corners, centre, radius_m: 0.5 * length_m.hypot(width_m), height_m }
            })
            .collect();
        let occluder_circles = occluders.iter().map(|occluder| (occluder.centre, occluder.radius_m)).collect();
        let collision = CollisionWorld::new(&scenario);
        Ok(Self { scenario, path, distance, collision, occluders, occluder_circles })
    }

    /// What the map was built from.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The reference path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where an episode starts.
    pub fn start(&self) -> Pose {
        self.path.pose_at(0.0)
    }

    /// Signed distance to the nearest non-drivable point, metres: positive in drivable space, capped at ±3 m.
    #[inline]
    pub fn signed_distance_m(&self, point: Vec2) -> f32 {
        self.distance.at(point)
    }

    /// The raster behind [`Self::signed_distance_m`].
    pub fn distance_field(&self) -> &DistanceField {
        &self.distance
    }

    /// Everything that hides ground from the camera.
    pub fn occluders(&self) -> &[Occluder] {
        &self.occluders
    }

    /// Those of [`Self::occluders`] whose circle overlaps a circle of the world.
    pub(crate) fn occluders_near(&self, centre: Vec2, radius_m: f32) -> impl Iterator<Item = &Occluder> {
        self.occluder_circles.overlapping(centre, radius_m).map(|index| &self.occluders[index])
    }

    /// Exact intersection queries.
    pub fn collision(&self) -> &CollisionWorld {
        &self.collision
    }
}
