//! The search against the plain one, which follows every plan.

use super::*;
use crate::settings::Sees;
use proptest::prelude::*;
use sim::geometry::Pose;
use sim::map::Map;
use sim::scenario::{Obstacle, ObstacleClass, Scenario};
use sim::vehicle::{VehicleSettings, VehicleState};

/// A forecast of an arc to its end, one step after the other.
struct Followed {
    rollouts: Vec<Rollout>,
    offset: f32,
}

/// Follows an arc as long as it keeps its clearance.
fn follow(
    search: &Search<'_>,
    start: Rollout,
    curvature_per_m: f32,
    step_m: f32,
    clearance_m: impl Fn(Motion) -> f32,
    thresholds: Thresholds,
) -> Vec<Rollout> {
    let mut rollouts = vec![start];
    let mut rollout = start;
    while rollout.travel_m < search.settings.horizon_m {
        let motion = rollout.motion.step(curvature_per_m, search.change_per_step(step_m), step_m);
        let (travel_m, clearance_m) = (rollout.travel_m + step_m, clearance_m(motion));
        if clearance_m < thresholds.at(travel_m, search.settings) {
            break;
        }
        rollout = Rollout { motion, travel_m, load_m: rollout.load_m + search.load(clearance_m) * step_m };
        rollouts.push(rollout);
    }
    rollouts
}

/// [`Search::best_plan`] without pruning, sharing or probing.
fn best_plan_of_all(search: &Search<'_>, clearance_m: f32) -> Option<Plan> {
    let (settings, ground) = (search.settings, search.ground());
    let weights = &settings.weights;
    let thresholds = search.thresholds(clearance_m);
    let start = Rollout { motion: search.start, travel_m: 0.0, load_m: 0.0 };
    let firsts = search.arcs.first.arcs.each_ref().map(|arc| {
        let clearance_m = |motion| search.footprint.clearance_m(ground, motion);
        let rollouts = follow(search, start, arc.curvature_per_m, settings.first_step_m, clearance_m, thresholds);
        let free_m = rollouts[rollouts.len() - 1].travel_m.min(search.settings.horizon_m);
        let change = search.last_index.map_or(0.0, |last_index| (arc.index - last_index).abs());
        let offset = weights.first_free * free_m / weights.unit_m
            - weights.first_curvature * arc.index.abs()
            - weights.change * change;
        Followed { rollouts, offset }
    });
    let branches = |first: &Followed| -> Vec<Rollout> {
        let steps = settings.branch_travels_m.map(|travel_m| (travel_m / settings.first_step_m).round() as usize);
        steps.into_iter().map_while(|step| first.rollouts.get(step).copied()).collect()
    };
    // Of equal plans, that of the more promising first arc.
    let bound = |first: &Followed| first.offset + search.bound(branches(first).first().map_or(0.0, |at| at.load_m));
    let mut order: [usize; FIRST_ARCS] = std::array::from_fn(|i| i);
    order.sort_by(|&a, &b| bound(&firsts[b]).total_cmp(&bound(&firsts[a])));

    let mut best: Option<Plan> = None;
    for i in order {
        let whole = firsts[i].rollouts[firsts[i].rollouts.len() - 1];
        if whole.travel_m == 0.0 {
            continue;
        }
        let mut offer = |second, end: Rollout, penalty: f32| {
            let free_m = end.travel_m.min(search.settings.horizon_m);
            let score = search.worth(free_m, end.load_m) + firsts[i].offset - penalty;
            if best.is_none_or(|best| score > best.score) && search.makes_progress(end.motion, free_m) {
                best = Some(Plan { first: i, second, first_free_m: whole.travel_m, free_m, score });
            }
        };
        offer(None, whole, 0.0);
        for branch in branches(&firsts[i]).into_iter().rev() {
            for arc in &search.arcs.second.arcs {
                let clearance_m = |motion| search.footprint.coarse_clearance_m(ground, motion);
                let step_m = settings.second_step_m;
                let rollouts = follow(search, branch, arc.curvature_per_m, step_m, clearance_m, thresholds);
                let second = Some((branch.travel_m, arc.curvature_per_m));
                offer(second, rollouts[rollouts.len() - 1], search.penalty(arc));
            }
        }
    }
    best
}

/// A lane with cars on both sides of it; `None` if they stand on the route.
fn crowded_lane(cars: &[(f32, f32, f32)]) -> Option<Map> {
    let cars = cars.iter().map(|&(x_m, y_m, heading_rad)| {
        Obstacle::new(ObstacleClass::Sedan, Pose::new(Vec2::new(x_m, y_m), heading_rad))
    });
    let scenario = Scenario::lane(-20.0..=60.0, 9.0, -5.0..=50.0).with_obstacles(cars);
    Map::build(scenario, &VehicleSettings::hyundai_hg300()).ok()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn the_best_plan_is_the_best_of_all_plans(
        cars in prop::collection::vec((5.0_f32..18.0, prop_oneof![-4.0_f32..-1.8, 1.8_f32..4.0], -1.6_f32..1.6), 0..4),
        (left_m, heading_rad) in (-2.5_f32..2.5, -0.8_f32..0.8),
        (speed_mps, steering_rad) in (0.0_f32..2.2, -0.5_f32..0.5),
        last_index in prop::option::of(-1.0_f32..1.0),
        sees in prop_oneof![Just(Sees::WholeMap), Just(Sees::PatchOnly)],
    ) {
        let map = crowded_lane(&cars);
        prop_assume!(map.is_some());
        let map = map.unwrap();
        let settings = ExpertSettings { sees, ..ExpertSettings::half_points() };
        let episode = sim::episode::EpisodeSettings::paper();
        let context = ExpertContext::of(&episode);
        let footprint = Footprint::new(&episode.vehicle, settings.nose_margin_m, settings.disc_relief_m);
        let arcs = Arcs::new(&settings, footprint.nose_m());
        let pose = Pose::new(Vec2::new(0.0, left_m), heading_rad);
        let vehicle = VehicleState { speed_mps, steering_rad, ..VehicleState::at_rest(pose) };
        let route = Some((map.path(), map.path().project_m(pose.position())));
        let scene = Scene { field: map.distance_field(), vehicle, route };
        let sight = LineOfSight::new(sees, &map, pose, &context.sensing);
        let search = Search {
            settings: &settings,
            context: &context,
            footprint: &footprint,
            arcs: &arcs,
            scene: &scene,
            sight: &sight,
            start: Motion::new(pose, vehicle.curvature_per_m(&episode.vehicle)),
            start_progress_m: OnceCell::new(),
            last_index,
        };
        for clearance_m in settings.clearances_m {
            prop_assert_eq!(search.best_plan(clearance_m, None), best_plan_of_all(&search, clearance_m));
        }
    }
}
