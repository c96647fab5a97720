//! Exact intersection of the car body with the scene. The only file that names rapier2d and parry2d.
//!
//! A static scene needs one query, which parry2d's bounding-volume tree would answer without rapier2d. rapier2d stays
//! because moving bodies come later, and behind this file, so that nothing else depends on it.

use crate::distance_field::DistanceField;
use crate::geometry::{Pose, Vec2, edges};
use crate::maths;
use crate::scenario::Scenario;
use crate::vectors::{FourPoints, f32x4, lowest};
use crate::vehicle::{VehicleSettings, VehicleState};
use parry2d::shape::Cuboid;
use rapier2d::geometry::{ColliderBuilder, Group, InteractionGroups, InteractionTestMode};
use rapier2d::math::{Pose as Isometry, Rotation};
use rapier2d::pipeline::{PhysicsWorld, QueryFilter};
use serde::{Deserialize, Serialize};

/// What counts as something to collide with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObstacleSet {
    /// Everything that is not drivable: the outside of the boundary, islands and solid objects.
    #[default]
    NonDrivable,
    /// Obstacles alone: the boundary and islands, whatever their height, may be crossed.
    Solid,
}

/// Distance between two poses of the body within a sweep, metres. The body is far longer than this, so all that is
/// missed between two poses is a sliver of at most `0.125² · κ / 8` = 0.5 mm beside the front corners.
const SWEEP_STEP_M: f32 = 0.125;
/// Discs that cover the body, lengthwise.
const BODY_DISCS: usize = 5;
/// The distance raster is this exact at corners; a body closer than that is tested exactly.
const RASTER_SLACK_M: f32 = 0.05;
/// Clearance below which the outline of the body is looked at more closely, metres.
const FINE_BELOW_M: f32 = 0.3;

const OUTLINES: Group = Group::GROUP_1;
const SOLIDS: Group = Group::GROUP_2;

/// Static colliders of one map.
pub struct CollisionWorld {
    world: PhysicsWorld,
}

impl std::fmt::Debug for CollisionWorld {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "CollisionWorld({} colliders)", self.world.colliders.len())
    }
}

impl CollisionWorld {
    /// Boundary and islands as segments, obstacles as convex solids.
    pub fn new(scenario: &Scenario) -> Self {
        let mut world = PhysicsWorld::new();
        let outlines = std::iter::once(&scenario.boundary).chain(scenario.islands.iter().map(|island| &island.polygon));
        for (a, b) in outlines.flat_map(|outline| edges(outline)) {
            insert(&mut world, ColliderBuilder::segment(a, b), OUTLINES);
        }
        for obstacle in &scenario.obstacles {
            let [length_m, width_m, _] = obstacle.size_m();
            let shape = if obstacle.class.is_round() {
                ColliderBuilder::ball(0.5 * length_m)
            } else {
                ColliderBuilder::cuboid(0.5 * length_m, 0.5 * width_m)
            };
            insert(&mut world, shape.position(isometry(obstacle.centre())), SOLIDS);
        }
        Self { world }
    }

    /// Whether the body overlaps the scene at a pose. Exact.
    pub fn body_hits(&self, body: &BodyBox, pose: Pose, set: ObstacleSet) -> bool {
        let members = match set {
            ObstacleSet::NonDrivable => OUTLINES | SOLIDS,
            ObstacleSet::Solid => SOLIDS,
        };
        let groups = InteractionGroups::new(Group::ALL, members, InteractionTestMode::And);
        let query = self.world.query_pipeline_with_filter(QueryFilter::new().groups(groups));
        let centre = Pose::new(pose.position() + pose.ahead() * body.centre_ahead_m, pose.heading_rad);
        query.intersect_shape(isometry(centre), &body.cuboid).next().is_some()
    }
}

/// The rectangle of the car body, prepared for queries.
#[derive(Debug, Clone)]
pub struct BodyBox {
    cuboid: Cuboid,
    centre_ahead_m: f32,
    discs_in_ego: Vec<FourPoints>,
    disc_radius_m: f32,
    /// Distance from the rear axle to the farthest centre of a disc, metres.
    disc_reach_m: f32,
    /// Points of the outline 0.2 m apart.
    outline_in_ego: Vec<FourPoints>,
    /// The same, 0.05 m apart.
    fine_outline_in_ego: Vec<FourPoints>,
}

impl BodyBox {
    /// The body of a vehicle.
    pub fn new(vehicle: &VehicleSettings) -> Self {
        let cuboid = Cuboid::new(Vec2::new(0.5 * vehicle.length_m, 0.5 * vehicle.width_m));
        let segment_m = vehicle.length_m / BODY_DISCS as f32;
        let discs = (0..BODY_DISCS).map(|i| Vec2::new((i as f32 + 0.5) * segment_m - vehicle.rear_overhang_m, 0.0));
        let discs: Vec<Vec2> = discs.collect();
        let disc_radius_m = maths::hypot(0.5 * segment_m, 0.5 * vehicle.width_m);
        let corners = vehicle.body_in_ego();
        let outline = |spacing_m: f32| {
            let points = edges(&corners).flat_map(move |(a, b)| {
                let pieces = ((b - a).length() / spacing_m).ceil() as usize;
                (0..pieces).map(move |i| a.lerp(b, i as f32 / pieces as f32))
            });
            FourPoints::all(&points.collect::<Vec<_>>())
        };
        Self {
            cuboid,
            centre_ahead_m: 0.5 * vehicle.length_m - vehicle.rear_overhang_m,
            discs_in_ego: FourPoints::all(&discs),
            disc_radius_m,
            disc_reach_m: discs.iter().map(|disc| disc.length()).fold(0.0, f32::max),
            outline_in_ego: outline(0.2),
            fine_outline_in_ego: outline(0.05),
        }
    }

    /// Whether the body, swept along an arc from `pose` over `travel_m`, meets the scene (docs/methods.md 8.1).
    ///
    /// Free space is recognised on the distance raster first; only a body close to something is tested exactly.
    pub fn sweep_hits(
        &self,
        distance: &DistanceField,
        collision: &CollisionWorld,
        set: ObstacleSet,
        pose: Pose,
        curvature_per_m: f32,
        travel_m: f32,
    ) -> bool {
        let coarse_steps = sweep_steps(travel_m) / 2;
        let pose_at = |i: usize, n: usize| pose.advanced_along_arc(curvature_per_m, travel_m * i as f32 / n as f32);
        if (0..=coarse_steps).all(|i| self.is_surely_free(distance, pose_at(i, coarse_steps))) {
            return false;
        }
        let steps = sweep_steps(travel_m);
        // Farthest first: that is where a car that drives ahead meets something.
        (0..=steps).rev().any(|i| collision.body_hits(self, pose_at(i, steps), set))
    }

    /// Whether [`Self::sweep_hits`] is surely false after each of the steps that a vehicle makes within `duration_s`, however
    /// it is steered: at the poses of the sweep from here, the covering discs keep their distance by more than they can
    /// move.
    pub fn stays_clear(
        &self,
        distance: &DistanceField,
        vehicle: &VehicleSettings,
        state: &VehicleState,
        travel_m: f32,
        duration_s: f32,
    ) -> bool {
        let accel_mps2 = state.accel_mps2.max(vehicle.accel_max_mps2);
        let driven_m = (state.speed_mps + accel_mps2 * duration_s) * duration_s;
        let curvature_per_m = state.curvature_per_m(vehicle);
        // The wheel swings on or back, a fast one to the other side.
        let steering_rad = state.steering_rad.abs();
        let swing_rad = vehicle.steering_rate_max_radps * duration_s;
        let limit_rad = vehicle.steering_max_rad.max(steering_rad);
        let (on_rad, back_rad) =
            ((steering_rad + swing_rad).min(limit_rad), (steering_rad - swing_rad).max(-limit_rad));
        let [on_per_m, back_per_m] = [on_rad, back_rad].map(|rad| maths::tan(rad) / vehicle.wheelbase_m);
        let curvature_max_per_m = on_per_m.max(-back_per_m);
        // Driving on before the sweep changes heading and position of its poses, and so does another curvature.
        let bent_per_m = (on_per_m - curvature_per_m.abs()).max(curvature_per_m.abs() - back_per_m);
        let bent_over_m = driven_m + travel_m;
        let turned_rad = curvature_max_per_m * driven_m + bent_per_m * bent_over_m;
        let moved_m = driven_m + 0.5 * bent_per_m * bent_over_m * bent_over_m + self.disc_reach_m * turned_rad;
        let steps = sweep_steps(travel_m);
        (0..=steps).all(|i| {
            let pose = state.pose.advanced_along_arc(curvature_per_m, travel_m * i as f32 / steps as f32);
            self.is_surely_free_by(distance, pose, moved_m)
        })
    }

    /// Conservative test of a pose by covering discs on the distance raster.
    fn is_surely_free(&self, distance: &DistanceField, pose: Pose) -> bool {
        self.is_surely_free_by(distance, pose, 0.0)
    }

    /// [`Self::is_surely_free`], also after every disc has moved by up to `margin_m`.
    fn is_surely_free_by(&self, distance: &DistanceField, pose: Pose, margin_m: f32) -> bool {
        let world_from_ego = pose.world_from_ego();
        let keep_m = f32x4::splat(self.disc_radius_m + RASTER_SLACK_M + margin_m);
        self.discs_in_ego.iter().all(|&discs| distance.at_four(world_from_ego.four_points(discs)).simd_gt(keep_m).all())
    }

    /// Distance from the body outline to the nearest non-drivable point, metres, capped at 3 m; negative where something
    /// reaches across the outline, but not for what is wholly beneath the body. Measured at outline points, hence too large
    /// where a corner points between two of them: by 10 cm at most, and by 2.5 cm where it is below 0.3 m; beside corners the
    /// raster adds up to 3 cm.
    pub fn clearance_m(&self, distance: &DistanceField, pose: Pose) -> f32 {
        let world_from_ego = pose.world_from_ego();
        let lowest_of = |outline: &[FourPoints]| {
            let distances_m = outline.iter().map(|&points| distance.at_four(world_from_ego.four_points(points)));
            lowest(distances_m.fold(f32x4::splat(f32::INFINITY), f32x4::fast_min))
        };
        let coarse_m = lowest_of(&self.outline_in_ego);
        if coarse_m < FINE_BELOW_M { lowest_of(&self.fine_outline_in_ego) } else { coarse_m }
    }
}

/// Into how many steps a sweep is divided, an even number.
fn sweep_steps(travel_m: f32) -> usize {
    2 * (travel_m / (2.0 * SWEEP_STEP_M)).ceil().max(1.0) as usize
}

/// Puts a collider where queries find it: its box into their tree. `PhysicsWorld::detect_collisions`, which would do so for
/// all, first lists every two that overlap: gigabytes where thousands lie in one place.
fn insert(world: &mut PhysicsWorld, collider: ColliderBuilder, member: Group) {
    let groups = InteractionGroups::new(member, Group::ALL, InteractionTestMode::And);
    let handle = world.insert_collider(collider.collision_groups(groups), None);
    let aabb = world.colliders[handle].compute_broad_phase_aabb(&world.integration_parameters, &world.bodies);
    world.broad_phase.set_aabb(&world.integration_parameters, handle, aabb);
}

fn isometry(pose: Pose) -> Isometry {
    // Its own `new` asks the platform for sine and cosine.
    let (sin, cos) = maths::sin_cos(pose.heading_rad);
    Isometry::from_parts(pose.position(), Rotation::from_cos_sin_unchecked(cos, sin))
}

#[cfg(test)]
mod tests {
    use super::ObstacleSet::{NonDrivable, Solid};
    use super::*;
    use crate::limits::OBSTACLES_MAX;
    use crate::scenario::{Island, Obstacle, ObstacleClass};
    use crate::vehicle::VehicleCommand;

    #[test]
    fn the_body_hits_what_it_overlaps_and_nothing_else() {
        let scenario = Scenario::lane(-10.0..=60.0, 8.0, 0.0..=40.0).with_obstacles([
            Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(30.35, 1.1), 0.0)),
            Obstacle::new(ObstacleClass::Person, Pose::new(Vec2::new(10.0, 0.0), 0.0)),
        ]);
        let world = CollisionWorld::new(&scenario);
        let body = BodyBox::new(&VehicleSettings::hyundai_hg300());
        let hits = |x: f32, y: f32, heading: f32, set| world.body_hits(&body, Pose::new(Vec2::new(x, y), heading), set);
        // Front bumper 3.80 m ahead of the axle; the pillar's near face is at x = 30.0.
        assert!(!hits(26.19, 0.0, 0.0, NonDrivable) && hits(26.21, 0.0, 0.0, NonDrivable));
        // Its inner side is at y = 0.75, the body's side at y + 0.93.
        assert!(!hits(28.0, -0.19, 0.0, NonDrivable) && hits(28.0, -0.17, 0.0, NonDrivable));
        // A person of 0.5 m diameter: 3.80 m + 0.25 m ahead.
        assert!(!hits(5.94, 0.0, 0.0, NonDrivable) && hits(5.96, 0.0, 0.0, NonDrivable));
        // The boundary counts as non-drivable, not as solid.
        assert!(hits(45.0, 3.08, 0.0, NonDrivable) && !hits(45.0, 3.08, 0.0, Solid) && hits(28.0, 0.0, 0.0, Solid));
    }

    /// Every two of them were listed as overlapping, 400 MB: that `detect_collisions` stays away is for clippy to see
    /// (`.clippy.toml`), that they are found all the same is tested here.
    #[test]
    fn ten_thousand_obstacles_may_lie_in_one_place() {
        let pillar = Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(30.35, 1.1), 0.0));
        let scenario =
            Scenario::lane(-10.0..=60.0, 8.0, 0.0..=40.0).with_obstacles(std::iter::repeat_n(pillar, OBSTACLES_MAX));
        let world = CollisionWorld::new(&scenario);
        let body = BodyBox::new(&VehicleSettings::hyundai_hg300());
        let hits = |x: f32| world.body_hits(&body, Pose::new(Vec2::new(x, 0.0), 0.0), Solid);
        assert!(!hits(26.19) && hits(26.21));
    }

    /// However it is steered and driven: the clear car sweeps into nothing in any step of the tick.
    #[test]
    fn what_stays_clear_for_a_tick_sweeps_into_nothing() {
        let usual = VehicleSettings::hyundai_hg300();
        // Within a tick the fast wheel could turn past a right angle; then everything counted as clear.
        let fast = VehicleSettings { steering_rate_max_radps: 20.0, ..usual.clone() };
        let clear = [&usual, &fast].map(clear_and_hits);
        assert!(clear[0].0 > 100 && clear.iter().all(|(_, n_hits)| *n_hits > 100), "{clear:?}");
    }

    /// Corners of a pillar that point at the side of the body between two of its points: up to 10 cm too much, and more than
    /// nothing on contact.
    #[test]
    fn a_corner_that_points_at_the_body_is_as_near_as_it_is() {
        let vehicle = VehicleSettings::hyundai_hg300();
        let body = BodyBox::new(&vehicle);
        let half_m = 0.5 * vehicle.width_m;
        for step in 0..20_u8 {
            let x = 10.0 + 0.03 * f32::from(step);
            for gap_m in [0.0, 0.02, 0.1, 0.2] {
                let tip = Vec2::new(x, half_m + gap_m);
                let pillar = [tip, tip + Vec2::new(0.4, 0.4), tip + Vec2::new(0.0, 0.8), tip + Vec2::new(-0.4, 0.4)];
                let mut scenario = Scenario::lane(-10.0..=40.0, 8.0, 0.0..=30.0);
                scenario.islands.push(Island { polygon: pillar.to_vec(), height_m: 0.15 });
                let map = crate::map::Map::build(scenario, &vehicle).unwrap();
                let clearance_m = body.clearance_m(map.distance_field(), Pose::new(Vec2::new(8.0, 0.0), 0.0));
                assert!((clearance_m - gap_m).abs() < 0.05, "{clearance_m} m for {gap_m} m at {x}");
            }
        }
    }

    /// How many of 600 states stay clear, and how many steps from the others sweep into something; no step from a clear
    /// one may.
    fn clear_and_hits(vehicle: &VehicleSettings) -> (u32, u32) {
        let pillar = |x, y| Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(x, y), 0.4));
        let scenario =
            Scenario::lane(-10.0..=60.0, 6.0, 0.0..=40.0).with_obstacles([pillar(14.0, 1.9), pillar(25.0, -1.8)]);
        let map = crate::map::Map::build(scenario, vehicle).unwrap();
        let (distance, world, body) = (map.distance_field(), map.collision(), BodyBox::new(vehicle));
        let (mut n_clear, mut n_hits) = (0, 0);
        for i in 0..600_u32 {
            let share = |k: u32| (i * k % 97) as f32 / 96.0;
            let pose = Pose::new(Vec2::new(0.05 * i as f32, 2.4 * share(5) - 1.2), 0.6 * share(7) - 0.3);
            let start = VehicleState {
                speed_mps: 2.4 * share(11),
                steering_rad: 1.2 * share(13) - 0.6,
                accel_mps2: share(17),
                accel_demand_mps2: share(17),
                ..VehicleState::at_rest(pose)
            };
            let is_clear = body.stays_clear(distance, vehicle, &start, 0.5, 0.05);
            n_clear += u32::from(is_clear);
            for (steering_rad, speed_mps) in [(-0.62, 2.2), (0.62, 2.2), (0.0, 9.0), (0.62, 0.0)] {
                let mut state = start;
                for _ in 0..5 {
                    state = crate::vehicle::step(vehicle, state, VehicleCommand { steering_rad, speed_mps }, 0.01);
                    let curvature = state.curvature_per_m(vehicle);
                    let hits = body.sweep_hits(distance, world, NonDrivable, state.pose, curvature, 0.5);
                    assert!(!(is_clear && hits), "from {start:?} to {state:?}");
                    n_hits += u32::from(hits);
                }
            }
        }
        (n_clear, n_hits)
    }
}
