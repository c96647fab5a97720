//! Procedural lots, each verified to be drivable in both directions.
//!
//! A lot is a function of its seed. A draw that is invalid or that [`crate::solver`] cannot drive is rejected and the next
//! draw of the same seed is taken; [`Generated::attempts`] counts them.

use crate::families;
use crate::solver;
use crate::split::{Family, Split};
use sim::scenario::{Direction, Scenario};
use sim::seed::Stream;
use sim::validate::validate;
use sim::vehicle::VehicleSettings;

/// A generated lot.
#[derive(Debug, Clone)]
pub struct Generated {
    /// Valid and solvable in both directions.
    pub scenario: Scenario,
    /// Draws up to and including this one: the rejection rate is `1 − 1/mean`.
    pub attempts: u32,
}

/// Generates a lot. It is drivable for the paper's vehicle; it does not depend on the vehicle that will drive it, because
/// its name fixes it.
///
/// # Panics
/// If 1000 draws in a row are rejected. About one draw in five is.
pub fn generate(split: &Split, index: u64, family: Family) -> Generated {
    let seed = split.seed(family, index);
    let vehicle = VehicleSettings::hyundai_hg300();
    for attempt in 0..1000 {
        let mut layout_rng = seed.rng(Stream::Layout, attempt);
        let mut obstacle_rng = seed.rng(Stream::Obstacles, attempt);
        let drawn = families::draw(family, &mut layout_rng, &mut obstacle_rng);
        let named = drawn.map(|scenario| Scenario { name: format!("{split}-{}-{index}", family.name()), ..scenario });
        if let Some(scenario) = named.filter(|scenario| is_drivable(scenario, family, &vehicle)) {
            return Generated { scenario, attempts: attempt as u32 + 1 };
        }
    }
    panic!(
        "none of 1000 draws of {split}-{}-{index} can be driven; the generator's rules contradict each other",
        family.name()
    );
}

/// Valid and solvable in both directions.
fn is_drivable(scenario: &Scenario, family: Family, vehicle: &VehicleSettings) -> bool {
    let clearance_m = families::clearance_m(family);
    let ways = Direction::BOTH.map(|direction| direction.of(scenario.clone()));
    ways.iter().all(|way| validate(way, vehicle).is_ok())
        && ways.iter().all(|way| solver::solve(way, vehicle, clearance_m).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::collision::{BodyBox, ObstacleSet};
    use sim::map::Map;
    use sim::path::Path;

    /// Number of lots of every family in every split.
    const LOTS: u64 = 6;

    fn of_every_family() -> impl Iterator<Item = (Family, u64, Generated)> {
        let numbers = Split::OPEN.into_iter().flat_map(|split| (0..LOTS).map(move |index| (split.clone(), index)));
        numbers.flat_map(|(split, index)| Family::EVERY.map(|family| (family, index, generate(&split, index, family))))
    }

    /// Solvability is checked with the simulator's own near-collision rule on its exact colliders, which the solver
    /// does not use.
    #[test]
    fn every_lot_validates_and_can_be_driven_both_ways() {
        let vehicle = VehicleSettings::hyundai_hg300();
        let body = BodyBox::new(&vehicle);
        for (family, _, lot) in of_every_family() {
            let name = &lot.scenario.name;
            let length_m = Path::new(&lot.scenario.reference_path).length_m();
            assert!((75.0..210.0).contains(&length_m), "{name}: {length_m} m");
            for direction in Direction::BOTH {
                let way = direction.of(lot.scenario.clone());
                validate(&way, &vehicle).unwrap_or_else(|error| panic!("{name} {direction:?}: {error}"));
                let solution = solver::solve(&way, &vehicle, families::clearance_m(family))
                    .unwrap_or_else(|| panic!("{name} is unsolved"));
                let collision = sim::collision::CollisionWorld::new(&way);
                for waypoint in &solution.waypoints {
                    let ahead = waypoint.pose.advanced_along_arc(waypoint.curvature_per_m, 0.5);
                    for pose in [waypoint.pose, ahead] {
                        let hits = collision.body_hits(&body, pose, ObstacleSet::NonDrivable);
                        assert!(!hits, "{name} {direction:?}: near-collision at {pose:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn few_draws_are_rejected() {
        let mut attempts = std::collections::BTreeMap::new();
        for (family, _, lot) in of_every_family() {
            *attempts.entry(family).or_insert(0) += lot.attempts;
        }
        for (family, attempts) in attempts {
            let rejected = 1.0 - (3 * LOTS) as f32 / attempts as f32;
            assert!(rejected < 0.4, "{family:?}: {:.0} % of the draws are rejected", 100.0 * rejected);
        }
    }

    /// After a near-collision the car is put back onto the route: nearly everywhere it must stand free there.
    #[test]
    fn the_route_is_free_ground_for_the_whole_car() {
        let vehicle = VehicleSettings::hyundai_hg300();
        let body = BodyBox::new(&vehicle);
        for family in Family::EVERY {
            let (mut poses, mut blocked) = (0, 0);
            for index in 0..8 {
                let scenario = generate(&Split::Validation, index, family).scenario;
                for direction in Direction::BOTH {
                    let map = Map::build(direction.of(scenario.clone()), &vehicle).expect("a valid lot");
                    let hits = |pose: &&sim::geometry::Pose| {
                        map.collision().body_hits(&body, **pose, ObstacleSet::NonDrivable)
                    };
                    poses += map.path().poses().len();
                    blocked += map.path().poses().iter().filter(hits).count();
                }
            }
            let share = blocked as f32 / poses as f32;
            assert!(share < 0.02, "{family:?}: {:.1} % of the route is blocked", 100.0 * share);
        }
    }

    #[test]
    fn lots_are_pinned_by_their_names() {
        const GOLDENS: [(Family, u64); 15] = [
            (Family::Easy, 0x5fb3_c679_5bd3_b164),
            (Family::Medium, 0x4aaa_e7b9_51d2_0f84),
            (Family::Hard, 0x3fd6_8fa8_99fe_f9dd),
            (Family::Lane, 0xec3e_f3d8_87c7_1aca),
            (Family::Rooms, 0x1e96_069f_81a6_9e3e),
            (Family::Street, 0xf700_6f64_77d0_b112),
            (Family::Aisles, 0x7814_58e1_35ad_86b2),
            (Family::Track, 0x4d3a_ebf9_0c4a_9f48),
            (Family::Open, 0x26fc_9b9c_1f17_f76f),
            (Family::Halls, 0x18e3_c5d3_12d4_a4b2),
            (Family::Yards, 0x9894_4e05_dcbb_f870),
            (Family::Chicanes, 0x2cdc_d994_bef8_ed39),
            (Family::Cones, 0xb8ff_47d9_d34f_bef9),
            (Family::Slanted, 0x1ded_a7bc_6274_af42),
            (Family::Mixed, 0x385f_0fee_e3d3_bfc7),
        ];
        let hashed = Family::EVERY.map(|family| {
            let lot = generate(&Split::Test, 7, family).scenario;
            assert_eq!(lot, generate(&Split::Test, 7, family).scenario);
            assert_ne!(lot.boundary, generate(&Split::Train, 7, family).scenario.boundary);
            (family, crate::fnv1a(&crate::load::to_toml(&lot)))
        });
        assert!(
            hashed == GOLDENS,
            "lots changed, and with them every result on such lots. Intended? Put these here and say why: {hashed:#x?}"
        );
    }
}
