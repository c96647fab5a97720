use super::*;
use sim::driver::{Decision, LookAheadPoint, Source};
use sim::geometry::Vec2;
use sim::sensing::Observation;
use sim::vehicle::VehicleCommand;

fn frame(tick: u32, steering_deg: f32, event: Event) -> Frame {
    let pose = Pose::new(Vec2::new(0.1 * tick as f32, 0.0), 0.0);
    let vehicle = VehicleState { steering_rad: steering_deg.to_radians(), ..VehicleState::at_rest(pose) };
    let look_ahead = LookAheadPoint { ahead_m: 8.0, left_m: 0.0 };
    Frame {
        tick,
        time_s: 0.05 * (tick + 1) as f32,
        vehicle,
        observation: Observation::default(),
        decision: Decision { look_ahead, source: Source::Planner, spread: None, speed_limit_mps: None },
        command: VehicleCommand::default(),
        progress_m: 0.1 * tick as f32,
        safe_ratio: 1.0,
        clearance_m: 1.0,
        driven_m: 0.1,
        contacts: 0,
        event,
    }
}

#[test]
fn the_monitor_looks_back_six_seconds_and_not_beyond_a_resume() {
    let near = Event::NearCollision { at: Pose::default(), progress_m: 1.0 };
    let mut monitor = IncidentMonitor::new(2, &EpisodeSettings::paper());
    // 200 ticks of weaving with a period of 40 ticks = 2 s: two reversals in each.
    for tick in 0..200 {
        let steering_deg = if tick / 20 % 2 == 0 { 5.0 } else { -5.0 };
        monitor.frame(1, &frame(tick, steering_deg, if tick == 199 { near } else { Event::Drove }));
    }
    monitor.frame(1, &frame(200, 0.0, Event::Drove));
    monitor.frame(1, &frame(201, 0.0, near));
    let incidents = monitor.into_incidents();
    assert_eq!(incidents.iter().map(|incident| incident.tick).collect::<Vec<_>>(), [199, 201]);
    // 6 s are 120 ticks before the last one.
    assert!((incidents[0].before[LOOK_BACK].progress_m - 0.1 * 79.0).abs() < 1e-4, "{:?}", incidents[0]);
    // There are 10 s of frames; 2 s are 40, and the second one has but two ticks behind it.
    assert!((incidents[0].before[4].progress_m - 0.1 * 159.0).abs() < 1e-4, "{:?}", incidents[0]);
    assert_eq!(incidents[1].before.map(|before| before.before_s), [0.1; 7]);
    // The last 100 ticks hold five half-periods; the first change of direction is where the count starts.
    assert_eq!(incidents[0].reversals_before, 3);
    assert_eq!((incidents[1].before[LOOK_BACK].progress_m, incidents[1].reversals_before), (20.0, 0));
    // Put back at 20.0 m of route, the second one happens at 1.0 m (as written above).
    assert_eq!((incidents[0].since_resume_m, incidents[1].since_resume_m), (None, Some(-19.0)));
}

/// Driven on from just after a resume, a near-collision counted that the drive itself had not counted.
#[test]
fn what_is_left_of_the_time_in_which_nothing_counts_is_remembered() {
    let near = Event::NearCollision { at: Pose::default(), progress_m: 1.0 };
    let refractory_s = |first: u32, second: u32| {
        let mut monitor = IncidentMonitor::new(1, &EpisodeSettings::paper());
        for tick in 0..=second {
            monitor.frame(0, &frame(tick, 0.0, if [first, second].contains(&tick) { near } else { Event::Drove }));
        }
        let incidents = monitor.into_incidents();
        incidents.iter().map(|incident| incident.before.map(|before| before.refractory_s)).collect::<Vec<_>>()
    };
    // In the 30th frame since it was put back: in the first of them all of 1 s is left, in the 10th .55 s, in the 20th .05 s.
    let [never, soon] = refractory_s(9, 39)[..] else { panic!("two") };
    assert_eq!(never, [0.0; 7]);
    for (left_s, expected_s) in soon.into_iter().zip([1.0, 1.0, 1.0, 1.0, 1.0, 0.55, 0.05]) {
        assert!((left_s - expected_s).abs() < 1e-5, "{soon:?}");
    }
    // 30 s after it, and so nowhere.
    assert_eq!(refractory_s(9, 609)[1], [0.0; 7]);
}

/// A near-collision soon after the car had been stuck was one more at the place of another that had never been.
#[test]
fn only_a_resume_after_a_near_collision_makes_one_more_at_the_same_place() {
    let at = |tick: u32| (Pose::default(), 0.1 * tick as f32);
    let near = |tick| {
        let (at, progress_m) = at(tick);
        Event::NearCollision { at, progress_m }
    };
    let stuck = |tick| {
        let (at, progress_m) = at(tick);
        Event::Stuck { at, progress_m }
    };
    let since_resume_m = |events: &[(u32, Event)]| -> Vec<Option<f32>> {
        let mut monitor = IncidentMonitor::new(1, &EpisodeSettings::paper());
        for tick in 0..40 {
            let event = events.iter().find(|(of, _)| *of == tick).map_or(Event::Drove, |(_, event)| *event);
            monitor.frame(0, &frame(tick, 0.0, event));
        }
        monitor.into_incidents().iter().map(|incident| incident.since_resume_m).collect()
    };
    assert_eq!(since_resume_m(&[(9, stuck(9)), (30, near(30))]), [None]);
    // Put back in tick 10, at 1 m; that it gets stuck on its way to the next one changes nothing.
    let expected = 0.1 * 30.0 - 0.1 * 10.0;
    for events in [vec![(9, near(9)), (30, near(30))], vec![(9, near(9)), (20, stuck(20)), (30, near(30))]] {
        assert_eq!(since_resume_m(&events), [None, Some(expected)]);
    }
}
