//! A scenario, validated and indexed: built once, immutable, shared by `Arc`.
//!
//! After [`Map::build`] succeeds nothing in this crate returns an error.

use crate::collision::CollisionWorld;
use crate::distance_field::DistanceField;
use crate::geometry::{Circles, Outline, Pose, Vec2, edges, signed_area_m2};
use crate::maths;
use crate::path::Path;
use crate::scenario::{KERB_MAX_M, Obstacle, Scenario, ScenarioError};
use crate::validate::validate;
use crate::vehicle::VehicleSettings;

/// Walls are cut into pieces of at most this length, metres: a circle around a piece then tells well whether it is near.
const WALL_PIECE_M: f32 = 8.0;

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

/// A convex object, or a piece of a wall, that hides the ground behind it from the camera.
#[derive(Debug, Clone)]
pub struct Occluder {
    /// Convex outline in the world, counter-clockwise; the two ends of a piece of a wall.
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

impl Occluder {
    /// Whether it is the far side of a wall that is no lower than the camera: what it hides, the near side hides as well.
    #[inline]
    pub(crate) fn is_far_side(&self, camera: Vec2, camera_height_m: f32) -> bool {
        let &[from, to] = &self.outline[..] else { return false };
        self.height_m >= camera_height_m && (from - camera).perp_dot(to - camera) >= 0.0
    }

    /// Whether it is a piece of the outline of something solid, not a thing by itself.
    pub(crate) fn is_wall(&self) -> bool {
        self.outline.len() == 2
    }

    fn of_obstacle(obstacle: &Obstacle) -> Self {
        let [length_m, width_m, height_m] = obstacle.size_m();
        let centre = obstacle.centre().position();
        let outline = obstacle.outline();
        let corners = outline.iter().copied().collect();
        Self { outline, corners, centre, radius_m: 0.5 * maths::hypot(length_m, width_m), height_m }
    }

    fn of_wall(from: Vec2, to: Vec2, height_m: f32) -> Self {
        let outline = vec![from, to];
        let corners = outline.iter().copied().collect();
        Self { outline, corners, centre: from.midpoint(to), radius_m: 0.5 * from.distance(to), height_m }
    }
}

/// The outlines of everything higher than a kerb, in short pieces with free ground to their right. What an outline hides
/// is what the solid within it hides: every line of sight that meets the solid meets its outline first.
fn walls(scenario: &Scenario) -> impl Iterator<Item = Occluder> {
    let boundary = std::iter::once((&scenario.boundary, scenario.boundary_height_m, true));
    let islands = scenario.islands.iter().map(|island| (&island.polygon, island.height_m, false));
    let high = boundary.chain(islands).filter(|&(_, height_m, _)| height_m > KERB_MAX_M);
    high.flat_map(|(outline, height_m, is_free_inside)| {
        let is_counter_clockwise = signed_area_m2(outline) > 0.0;
        edges(outline).flat_map(move |(a, b)| {
            let (from, to) = if is_counter_clockwise == is_free_inside { (b, a) } else { (a, b) };
            let n_pieces = (from.distance(to) / WALL_PIECE_M).ceil().max(1.0) as usize;
            let end = move |i: usize| from.lerp(to, i as f32 / n_pieces as f32);
            (0..n_pieces).map(move |i| Occluder::of_wall(end(i), end(i + 1), height_m))
        })
    })
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
            let reach_m = 0.5 * maths::hypot(length_m, width_m);
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
        let occluders: Vec<Occluder> =
            scenario.obstacles.iter().map(Occluder::of_obstacle).chain(walls(&scenario)).collect();
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
    pub fn occluders_near(&self, centre: Vec2, radius_m: f32) -> impl Iterator<Item = &Occluder> {
        self.occluder_circles.overlapping(centre, radius_m).map(|index| &self.occluders[index])
    }

    /// Exact intersection queries.
    pub fn collision(&self) -> &CollisionWorld {
        &self.collision
    }
}
