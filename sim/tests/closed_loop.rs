//! The vehicle against closed forms, and stop–count–resume against a hand-computed scene.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

use sim::batch::{NotFinite, SeatedFleet, run_fleets_until, run_lockstep_until};
use sim::driver::{Decision, Driver, LookAheadPoint, OneDriverEach, Situation, Source};
use sim::episode::{self, Episode, EpisodeSettings};
use sim::frame::{Ending, Event, Frame};
use sim::geometry::{Pose, Vec2};
use sim::map::Map;
use sim::maths;
use sim::scenario::{NoiseLevel, Obstacle, ObstacleClass, Scenario};
use sim::seed::RootSeed;
use sim::sensing::Observation;
use sim::sensing::noise::NoiseSettings;
use sim::vehicle::{VehicleCommand, VehicleSettings, VehicleState, step, step_emergency_stop};
use std::ops::ControlFlow;
use std::sync::Arc;

fn drive(mut state: VehicleState, command: VehicleCommand, seconds: f32) -> VehicleState {
    for _ in 0..(seconds * 100.0).round() as u32 {
        state = step(&VehicleSettings::hyundai_hg300(), state, command, 0.01);
    }
    state
}

#[test]
fn constant_steering_drives_a_circle_of_radius_l_over_tan_delta() {
    let vehicle = VehicleSettings::hyundai_hg300();
    for steering_rad in [0.1_f32, -0.3, 0.6] {
        let start = VehicleState { steering_rad, speed_mps: 1.5, ..VehicleState::at_rest(Pose::default()) };
        let radius_m = vehicle.wheelbase_m / maths::tan(steering_rad);
        let mut state = start;
        for _ in 0..2000 {
            state = step(&vehicle, state, VehicleCommand { steering_rad, speed_mps: 1.5 }, 0.01);
            let off_circle_m = state.pose.position().distance(Vec2::new(0.0, radius_m)) - radius_m.abs();
            assert!(off_circle_m.abs() < 2e-3, "{off_circle_m} m off a circle of {radius_m} m");
        }
    }
}

/// At 4500 m a step of 5 mm is 20 units in the last place along the way, and across it less than one: the car went straight on.
#[test]
fn far_from_the_origin_a_car_drives_the_same_way() {
    let drive_from = |origin: Vec2, heading_rad: f32, speed_mps: f32| {
        let start = VehicleState { speed_mps, ..VehicleState::at_rest(Pose::new(origin, heading_rad)) };
        let command = VehicleCommand { steering_rad: 0.0, speed_mps };
        drive(start, command, 20.0 / speed_mps).pose.position() - origin
    };
    for (heading_deg, speed_mps) in [(2.5_f32, 0.5), (0.5, 2.0), (1.0, 0.5)] {
        let heading_rad = heading_deg.to_radians();
        let exact = 20.0 * maths::unit(heading_rad);
        for origin in [Vec2::ZERO, Vec2::new(250.0, 40.0), Vec2::new(3000.0, -2000.0), Vec2::new(4500.0, 8000.0)] {
            let driven = drive_from(origin, heading_rad, speed_mps);
            assert!(driven.distance(exact) < 5e-3, "{driven} instead of {exact} from {origin}");
        }
    }
}

#[test]
fn the_wheels_turn_no_faster_than_their_rate() {
    let command = VehicleCommand { steering_rad: 0.5, speed_mps: 0.0 };
    let state = drive(VehicleState::at_rest(Pose::default()), command, 1.0);
    assert!((state.steering_rad - 0.344).abs() < 1e-3);
    assert!((drive(state, command, 1.0).steering_rad - 0.5).abs() < 1e-6);
    let beyond = VehicleCommand { steering_rad: 2.0, speed_mps: 0.0 };
    assert!((drive(state, beyond, 3.0).steering_rad - 35.5_f32.to_radians()).abs() < 1e-6);
}

#[test]
fn the_speed_loop_settles_without_exceeding_its_limits() {
    let mut state = VehicleState::at_rest(Pose::default());
    let mut fastest_mps = 0.0_f32;
    for _ in 0..3000 {
        let before = state;
        state =
            step(&VehicleSettings::hyundai_hg300(), state, VehicleCommand { steering_rad: 0.0, speed_mps: 2.0 }, 0.01);
        assert!((-2.0..=1.0).contains(&state.accel_mps2));
        assert!((state.accel_demand_mps2 - before.accel_demand_mps2).abs() <= 0.02 + 1e-5);
        fastest_mps = fastest_mps.max(state.speed_mps);
    }
    assert!((state.speed_mps - 2.0).abs() < 0.02, "{} m/s", state.speed_mps);
    assert!(fastest_mps < 2.5, "overshoot to {fastest_mps} m/s");
}

#[test]
fn an_emergency_stop_takes_v_squared_over_2a() {
    let vehicle = VehicleSettings::hyundai_hg300();
    let mut state = VehicleState { speed_mps: 2.2, ..VehicleState::at_rest(Pose::default()) };
    while state.speed_mps > 0.0 {
        state = step_emergency_stop(&vehicle, state, 0.01);
    }
    assert!((state.pose.x_m - 2.2 * 2.2 / 6.0).abs() < 0.02, "{} m", state.pose.x_m);
}

/// Drives at a fixed point.
struct Fixed(LookAheadPoint);

impl Driver for Fixed {
    fn decide(&mut self, _: &Situation<'_>) -> Decision {
        Decision { look_ahead: self.0, source: Source::Expert, spread: None, speed_limit_mps: None }
    }
}

fn lane(length_m: f32, obstacles: Vec<Obstacle>) -> Arc<Map> {
    let scenario = Scenario::lane(-10.0..=length_m + 20.0, 8.0, 0.0..=length_m).with_obstacles(obstacles);
    Arc::new(Map::build(scenario, &VehicleSettings::hyundai_hg300()).unwrap())
}

fn settings() -> Arc<EpisodeSettings> {
    Arc::new(EpisodeSettings { noise: NoiseSettings::of(NoiseLevel::Clean), ..EpisodeSettings::paper() })
}

fn run(map: Arc<Map>, point: (f32, f32), settings: Arc<EpisodeSettings>) -> (episode::EpisodeReport, Vec<Frame>) {
    let mut frames = Vec::new();
    let mut driver = Fixed(LookAheadPoint { ahead_m: point.0, left_m: point.1 });
    let mut sink = |frame: &Frame| frames.push(*frame);
    let report = episode::run(Episode::new(settings, map, RootSeed(1)), &mut driver, &mut sink);
    (report, frames)
}

#[test]
fn a_free_lane_is_driven_to_its_end() {
    let (report, frames) = run(lane(50.0, vec![]), (16.3, 0.0), settings());
    assert_eq!(report.ending, Ending::ReachedEnd);
    assert_eq!((report.metrics.near_collisions, report.metrics.contacts, report.metrics.stuck), (0, 0, 0));
    assert!((report.metrics.driven_m - 50.0).abs() < 0.3, "{} m", report.metrics.driven_m);
    // Ahead 16.3 m → a_y 12.5 m → law A saturates at 2.2 m/s.
    assert!((frames.last().unwrap().vehicle.speed_mps - 2.2).abs() < 0.02);
    assert_eq!(report.metrics.safe_ratio, 1.0);
    assert!((report.metrics.clearance_min_m - 3.0).abs() < 0.05); // 4.0 − 0.93, capped at 3
}

/// A pillar's near face 30 m from the start: the bumper (3.80 m ahead of the axle) is stopped 0.5 m before it, so the
/// event is counted at x = 30 − 3.8 − 0.5 = 25.7 m, the car brakes for v²/2a, and resumes beyond the pillar.
#[test]
fn a_near_collision_is_counted_half_a_metre_before_the_obstacle() {
    let pillar = Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(30.35, 1.1), 0.0));
    // Off the centre line, so that the path itself is valid; its inner side (y 0.75) is in the body's way.
    // At 2.2 m/s the stop takes 2.2²/6 = 0.81 m, more than the 0.5 m left: a contact. At 1.0 m/s it takes 0.17 m.
    let (fast, _) = run(lane(60.0, vec![pillar.clone()]), (16.3, 0.0), settings());
    assert_eq!((fast.metrics.near_collisions, fast.metrics.contacts), (1, 1), "{fast:?}");
    let (report, frames) = run(lane(60.0, vec![pillar]), (6.04, 0.0), settings());
    assert_eq!((report.metrics.near_collisions, report.metrics.contacts), (1, 0), "{report:?}");
    // A contact while braking is a clearance below zero.
    assert!(fast.metrics.clearance_min_m < 0.0, "{} m", fast.metrics.clearance_min_m);
    let (tick, Event::NearCollision { at, .. }) = report.events[0] else { panic!("{report:?}") };
    assert!((at.x_m - 25.7).abs() < 0.03, "counted at {} m", at.x_m);
    // 0.5 m less the stop of 0.17 m and what the car drives in the time of one step.
    let stopped_m = frames[tick as usize].clearance_m;
    assert!((0.28..0.34).contains(&stopped_m), "{stopped_m} m");
    let after = &frames[tick as usize + 1];
    assert!(after.vehicle.speed_mps == 0.0 && after.vehicle.steering_rad == 0.0, "resumes at rest");
    // The first reference point from which the body passes: its tail (1.11 m behind the axle) beyond x = 30.7 m.
    assert!((31.8..32.4).contains(&after.vehicle.pose.x_m), "resumed at {} m", after.vehicle.pose.x_m);
    assert_eq!(report.ending, Ending::ReachedEnd);
}

/// Straight on until it is put back on the path, hard to the left from then on.
#[derive(Default)]
struct LeftAfterResume {
    resets: u32,
}

impl Driver for LeftAfterResume {
    fn decide(&mut self, _: &Situation<'_>) -> Decision {
        let left_m = if self.resets > 1 { 5.0 } else { 0.0 };
        Decision {
            look_ahead: LookAheadPoint { ahead_m: 6.0, left_m },
            source: Source::Expert,
            spread: None,
            speed_limit_mps: None,
        }
    }

    fn reset(&mut self) {
        self.resets += 1;
    }
}

/// A pillar in the way as above, and one more, 6 cm off the body's left side and 0.3 m ahead of the bumper where the car
/// resumes. Turning left, 0.5 m of arc meet it as soon as the wheels stand at 4° (0.2 s) and the car rolls at 0.05 m/s;
/// but nothing is counted in the first second.
#[test]
fn nothing_is_counted_in_the_first_second_after_a_resume() {
    let pillar = |x, y| Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(x, y), 0.0));
    let ticks_to_second_event = |refractory_s| {
        let mut settings = (*settings()).clone();
        settings.metrics.refractory_s = refractory_s;
        let map = lane(60.0, vec![pillar(30.35, 1.1), pillar(36.5, 0.93 + 0.06 + 0.35)]);
        let episode = Episode::new(Arc::new(settings), map, RootSeed(1));
        let report = episode::run(episode, &mut LeftAfterResume::default(), &mut |_: &Frame| ());
        report.events[1].0 - report.events[0].0
    };
    assert!((4..16).contains(&ticks_to_second_event(0.0)), "{} ticks", ticks_to_second_event(0.0));
    // 100 physics steps are 20 ticks; the first of them follows the tick in which the car was put back.
    assert!((20..=21).contains(&ticks_to_second_event(1.0)), "{} ticks", ticks_to_second_event(1.0));
}

/// The same scene, driven on from where the car was put back: it has what is left of its second, and no more.
#[test]
fn nothing_is_counted_under_way_in_what_is_left_of_the_first_second() {
    let pillar = |x, y| Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(x, y), 0.0));
    let map = lane(60.0, vec![pillar(30.35, 1.1), pillar(36.5, 0.93 + 0.06 + 0.35)]);
    let mut frames = Vec::new();
    let episode = Episode::new(settings(), Arc::clone(&map), RootSeed(1));
    let report = episode::run(episode, &mut LeftAfterResume::default(), &mut |frame: &Frame| frames.push(*frame));
    let met = &frames[report.events[0].0 as usize + 1];
    let tick_of_event = |refractory_s| {
        let (map, resumed) = (Arc::clone(&map), met.vehicle);
        let episode = Episode::under_way(settings(), map, RootSeed(1), resumed, met.progress_m, refractory_s);
        episode::run(episode, &mut LeftAfterResume { resets: 1 }, &mut |_: &Frame| ()).events[0].0
    };
    assert!((3..15).contains(&tick_of_event(0.0)), "tick {}", tick_of_event(0.0));
    assert!((19..=20).contains(&tick_of_event(1.0)), "tick {}", tick_of_event(1.0));
}

/// Straight on; remembers what it was shown, from reset to reset.
#[derive(Default)]
struct Watching(Vec<Vec<Observation>>);

impl Driver for Watching {
    fn decide(&mut self, situation: &Situation<'_>) -> Decision {
        self.0.last_mut().unwrap().push(*situation.observation);
        Decision {
            look_ahead: LookAheadPoint { ahead_m: 6.0, left_m: 0.0 },
            source: Source::Expert,
            spread: None,
            speed_limit_mps: None,
        }
    }

    fn reset(&mut self) {
        self.0.push(Vec::new());
    }
}

/// Even if its first frame there is dropped.
#[test]
fn a_car_that_was_put_back_does_not_see_the_place_from_before() {
    let mut settings = (*settings()).clone();
    settings.noise = NoiseSettings { dropout: 1000.0, ..NoiseSettings::of(NoiseLevel::Paper) };
    let map = lane(60.0, vec![Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(30.35, 1.1), 0.0))]);
    let mut watching = Watching::default();
    episode::run(Episode::new(Arc::new(settings), map, RootSeed(1)), &mut watching, &mut |_: &Frame| ());
    let [before, after] = &watching.0[..] else { panic!("{} stretches", watching.0.len()) };
    assert!(before.iter().all(|seen| *seen == before[0]), "every frame is dropped");
    assert_ne!(after[0], before[0], "the pillar is behind the car");
}

#[test]
fn a_parked_car_beside_the_path_is_no_near_collision() {
    // 0.3 m between the body (y −0.93) and the parked car (y −1.23 …): nothing lies on the arc.
    let parked = Obstacle::new(ObstacleClass::Sedan, Pose::new(Vec2::new(25.0, -1.23 - 0.925), 0.0));
    let (report, _) = run(lane(60.0, vec![parked]), (16.3, 0.0), settings());
    assert_eq!(report.metrics.near_collisions, 0);
    assert!((report.metrics.clearance_min_m - 0.3).abs() < 0.03, "{} m", report.metrics.clearance_min_m);
    assert!(report.metrics.safe_ratio < 1.0);
}

#[test]
fn a_car_that_does_not_advance_is_stuck_and_put_back() {
    // Full lock to the left within an 8 m lane is a circle that would leave the lane; a near-collision is counted, not
    // a stuck event. In a 60 m wide hall it circles on the spot instead.
    let scenario = Scenario::lane(-30.0..=90.0, 60.0, 0.0..=40.0);
    let map = Arc::new(Map::build(scenario, &VehicleSettings::hyundai_hg300()).unwrap());
    let mut short = (*settings()).clone();
    short.metrics.events_max = 3;
    let (report, _) = run(map, (4.3, 4.3), Arc::new(short));
    assert_eq!(report.ending, Ending::TooManyEvents);
    assert_eq!((report.metrics.stuck, report.metrics.near_collisions), (3, 0), "{report:?}");
}

/// It was put at the finish, wherever that was, and had reached it.
#[test]
fn a_car_that_cannot_be_put_back_anywhere_ahead_has_not_reached_the_end() {
    let in_the_way = |x_m| Obstacle::new(ObstacleClass::Sedan, Pose::new(Vec2::new(x_m, 1.2), 0.0));
    // Nose to tail from 30 m to beyond the finish.
    let cars: Vec<_> = (0..10).map(|i| in_the_way(32.0 + 4.0 * i as f32)).collect();
    let (report, _) = run(lane(60.0, cars), (16.3, 0.0), settings());
    assert_eq!((report.ending, report.metrics.near_collisions), (Ending::Blocked, 1), "{report:?}");
    // Past the one car, or over the line while it brakes for one behind the finish.
    for x_m in [32.0, 66.4] {
        let (report, _) = run(lane(60.0, vec![in_the_way(x_m)]), (16.3, 0.0), settings());
        assert_eq!((report.ending, report.metrics.near_collisions), (Ending::ReachedEnd, 1), "{x_m} m: {report:?}");
    }
}

/// It was put back where the search ended, 5 m ahead of where the tick began.
#[test]
fn a_car_that_brakes_for_long_is_put_back_where_it_came_to_rest() {
    let mut slow = (*settings()).clone();
    slow.vehicle.emergency_brake_mps2 = 0.2;
    let cone = Obstacle::new(ObstacleClass::Cone, Pose::new(Vec2::new(30.0, 0.9), 0.0));
    let (report, frames) = run(lane(60.0, vec![cone]), (16.3, 0.0), Arc::new(slow));
    assert_eq!(report.metrics.near_collisions, 1, "{report:?}");
    let braked = frames.iter().position(|frame| matches!(frame.event, Event::NearCollision { .. })).unwrap();
    let (before, after) = (&frames[braked], &frames[braked + 1]);
    assert!(before.driven_m > 6.0, "{} m", before.driven_m);
    assert!((after.progress_m - before.progress_m - before.driven_m).abs() < 0.6, "{before:?} {after:?}");
}

#[test]
fn a_run_times_out() {
    let mut short = (*settings()).clone();
    short.metrics.timeout_s = 2.0;
    let (report, frames) = run(lane(60.0, vec![]), (16.3, 0.0), Arc::new(short));
    assert_eq!(report.ending, Ending::TimedOut);
    assert_eq!(frames.len(), 40);
}

/// A command takes effect 61 ms after the observation: six physics steps of 10 ms.
#[test]
fn commands_reach_the_wheels_after_the_dead_time() {
    // The tick in which the wheels begin to turn, and for how many physics steps of it: they turn as fast as they can.
    let moved = |dead_time_s| {
        let mut settings = (*settings()).clone();
        settings.vehicle.dead_time_s = dead_time_s;
        let step_rad = 0.010 * settings.vehicle.steering_rate_max_radps;
        let mut episode = Episode::new(Arc::new(settings), lane(60.0, vec![]), RootSeed(1));
        let decision = Decision {
            look_ahead: LookAheadPoint { ahead_m: 8.0, left_m: 2.0 },
            source: Source::Expert,
            spread: None,
            speed_limit_mps: None,
        };
        (0..10)
            .find_map(|tick| {
                episode.observe();
                episode.apply(decision);
                let steering_rad = episode.vehicle().steering_rad;
                (steering_rad > 0.0).then(|| (tick, (steering_rad / step_rad).round() as u32))
            })
            .unwrap()
    };
    assert_eq!(moved(0.0), (0, 5));
    assert_eq!(moved(0.061), (1, 4));
    assert_eq!(moved(0.110), (2, 4));
}

/// The controller took a limit that is no number for none.
#[test]
#[should_panic(expected = "the decision is finite")]
fn a_speed_limit_that_is_no_number_is_not_driven_by() {
    let mut episode = Episode::new(settings(), lane(60.0, vec![]), RootSeed(1));
    episode.observe();
    let look_ahead = LookAheadPoint { ahead_m: 8.0, left_m: 0.0 };
    episode.apply(Decision { look_ahead, source: Source::Expert, spread: None, speed_limit_mps: Some(f32::NAN) });
}

#[test]
fn the_same_seed_gives_the_same_frames() {
    let noisy = Arc::new(EpisodeSettings::paper());
    let frames = || {
        let (_, frames) = run(lane(40.0, vec![]), (16.3, 0.1), Arc::clone(&noisy));
        frames.iter().map(|frame| (frame.observation, frame.vehicle)).collect::<Vec<_>>()
    };
    assert_eq!(frames(), frames());
}

#[test]
fn a_batch_can_be_stopped_and_keeps_what_has_ended() {
    let start = |length_m| Episode::new(settings(), lane(length_m, vec![]), RootSeed(1));
    let ahead = || Fixed(LookAheadPoint { ahead_m: 16.3, left_m: 0.0 });
    let mut fleet = OneDriverEach(vec![ahead(), ahead()]);
    let mut has_short_one_ended = false;
    let reports = run_lockstep_until(vec![start(20.0), start(60.0)], &mut fleet, &mut |episode, frame| {
        has_short_one_ended |= episode == 0 && frame.event == Event::ReachedEnd;
        if has_short_one_ended { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap();
    assert!(reports[0].as_ref().is_some_and(|report| report.ending == Ending::ReachedEnd));
    assert_eq!(reports[1], None);
}

/// Whether cars are driven by one fleet or by several, the same frames come in the same order, and a break stops them in
/// the same tick.
#[test]
fn fleets_of_their_own_drive_as_one_fleet() {
    let start = |(seed, length_m): (u64, f32)| Episode::new(settings(), lane(length_m, vec![]), RootSeed(seed));
    let episodes = || (1..).zip([20.0, 31.0, 20.0, 26.0, 35.0]).map(start).collect::<Vec<Episode>>();
    let ahead = |episode: usize| Fixed(LookAheadPoint { ahead_m: 10.0 + episode as f32, left_m: 0.0 });
    for stops_after in [7, 1200, u32::MAX] {
        let mut drives = Vec::new();
        for cars_each in [5, 1, 2] {
            let mut seen = Vec::new();
            let mut on_frame = |episode: usize, frame: &Frame| {
                seen.push((episode, frame.tick, frame.vehicle, frame.event));
                if seen.len() as u32 == stops_after { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let reports = if cars_each == 5 {
                let mut fleet = OneDriverEach((0..5).map(ahead).collect());
                run_lockstep_until(episodes(), &mut fleet, &mut on_frame)
            } else {
                // Dealt out one by one, as `SeatedFleet::in_all` does.
                let fleets = 5_usize.div_ceil(cars_each);
                let seated = |first: usize| {
                    let cars: Vec<(usize, Episode)> =
                        episodes().into_iter().enumerate().skip(first).step_by(fleets).collect();
                    let drivers = cars.iter().map(|&(index, _)| ahead(index)).collect();
                    SeatedFleet::new(Box::new(OneDriverEach(drivers)), cars)
                };
                run_fleets_until((0..fleets).map(seated).collect(), &mut on_frame)
            };
            drives.push((reports.unwrap(), seen));
        }
        assert_eq!(drives[0].0.iter().any(Option::is_none), stops_after != u32::MAX);
        assert!(drives[0].0.iter().any(Option::is_some) || stops_after == 7);
        assert_eq!(drives[0], drives[1], "stopped after {stops_after} frames, a car each");
        assert_eq!(drives[0], drives[2], "stopped after {stops_after} frames, two cars each");
    }
}

/// Answers with NaN from a tick on.
struct BreaksAt {
    tick: u32,
    answered: u32,
}

impl Driver for BreaksAt {
    fn decide(&mut self, situation: &Situation<'_>) -> Decision {
        let left_m = if self.answered < self.tick { 0.0 } else { f32::NAN };
        self.answered += 1;
        Fixed(LookAheadPoint { ahead_m: 16.3, left_m }).decide(situation)
    }
}

/// The first tick of the first episode counts, however cars are parted, so that the key to replay is always the same.
#[test]
fn an_answer_that_is_no_number_is_refused_where_it_is_given_first() {
    let episodes = || (1..=4).map(|seed| Episode::new(settings(), lane(60.0, vec![]), RootSeed(seed))).collect();
    let driver = |tick: u32| BreaksAt { tick, answered: 0 };
    let drivers = || [90, 37, 37, 40].map(driver);
    let expected = NotFinite { episode: 1, tick: 37, what: "the driver's answer" };
    for (stops_after, result) in [(u32::MAX, Err(expected)), (35, Ok(vec![None; 4]))] {
        let [mut in_lock_step, mut in_fleets] = [Vec::new(), Vec::new()];
        let seeing = |seen: &mut Vec<(usize, u32)>, episode, frame: &Frame| {
            seen.push((episode, frame.tick));
            if frame.tick < stops_after { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let mut fleet = OneDriverEach(drivers().into());
        let driven =
            run_lockstep_until(episodes(), &mut fleet, &mut |episode, frame| seeing(&mut in_lock_step, episode, frame));
        assert_eq!(driven, result, "stops after {stops_after}");
        let mut seats = drivers().into_iter();
        let parted = SeatedFleet::in_all(episodes(), 1, |_| Box::new(OneDriverEach(vec![seats.next().unwrap()])));
        let driven = run_fleets_until(parted, &mut |episode, frame| seeing(&mut in_fleets, episode, frame));
        assert_eq!(driven, result, "stops after {stops_after}");
        assert_eq!(in_lock_step, in_fleets, "every frame before it is passed on, and none after it");
        assert_eq!(in_lock_step.len(), 4 * if stops_after < 37 { 36 } else { 37 });
    }
}

/// The state was looked at before a tick, and so never after the last one: the drive ended like any other.
#[test]
fn a_car_that_is_nowhere_after_its_last_tick_is_refused() {
    let mut settings = EpisodeSettings::clone(&settings());
    settings.metrics.timeout_s = 0.01;
    let (settings, map) = (Arc::new(settings), lane(40.0, vec![]));
    // Its position is a number until the first step adds the rest to it; the drive has one tick.
    let start = VehicleState { position_rest_m: Vec2::NAN, ..VehicleState::at_rest(map.start()) };
    let episode = Episode::under_way(settings, map, RootSeed(1), start, 0.0, 0.0);
    let fleet = || OneDriverEach(vec![Fixed(LookAheadPoint { ahead_m: 16.3, left_m: 0.0 })]);
    let mut on_frame = |_: usize, _: &Frame| ControlFlow::Continue(());
    let expected = NotFinite { episode: 0, tick: 0, what: "the state of the car" };
    let in_lock_step = run_lockstep_until(vec![episode.clone()], &mut fleet(), &mut on_frame);
    assert_eq!(in_lock_step.unwrap_err(), expected);
    let seated = SeatedFleet::new(Box::new(fleet()), vec![(0, episode)]);
    assert_eq!(run_fleets_until(vec![seated], &mut on_frame).unwrap_err(), expected);
}

/// From a state met at 20 m the rest is driven as by the car that was met.
#[test]
fn an_episode_under_way_goes_on_from_its_state() {
    let map = lane(40.0, vec![]);
    let (_, frames) = run(Arc::clone(&map), (16.3, 0.0), settings());
    let met = frames.iter().find(|frame| frame.progress_m > 20.0).unwrap();
    let episode = Episode::under_way(settings(), map, RootSeed(1), met.vehicle, met.progress_m, 0.0);
    let mut driver = Fixed(LookAheadPoint { ahead_m: 16.3, left_m: 0.0 });
    let mut positions = Vec::new();
    let report = episode::run(episode, &mut driver, &mut |frame: &Frame| positions.push(frame.vehicle.pose.x_m));
    assert_eq!(report.ending, Ending::ReachedEnd);
    for (again, first) in positions.iter().zip(&frames[met.tick as usize..]) {
        assert!((again - first.vehicle.pose.x_m).abs() < 0.02, "{again} m, {} m", first.vehicle.pose.x_m);
    }
    assert_eq!(positions.len(), frames.len() - met.tick as usize);
}

/// Past the controller with what the controller said: the same trajectory, and a point that steers the same way.
#[test]
fn commands_drive_as_the_points_that_they_come_from() {
    let map = lane(60.0, Vec::new());
    let (_, by_points) = run(Arc::clone(&map), (7.0, 0.4), settings());
    let mut episode = Episode::new(settings(), map, RootSeed(1));
    for by_point in by_points {
        episode.observe();
        let by_command = episode.apply_command(by_point.command, Source::Planner);
        assert_eq!((by_command.vehicle, by_command.event), (by_point.vehicle, by_point.event));
        let [a, b] = [by_command, by_point].map(|frame| frame.decision.look_ahead.curvature_per_m());
        assert!((a - b).abs() < 1e-5, "{a} and {b} 1/m");
    }
    assert!(episode.ending().is_some());
}
