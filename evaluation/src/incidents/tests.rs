use super::*;
use experiment::drivers::NamedDriver;
use experiment::lots::Lot;
use experiment::settings::Settings;
use experiment::trials::{Purpose, Trial};
use sim::driver::{Decision, LookAheadPoint, Source};
use sim::geometry::Vec2;
use sim::scenario::Direction;
use sim::scenario::{LotNoise, Obstacle, ObstacleClass, ReferencePath, Scenario};
use sim::seed::RootSeed;
use sim::sensing::Observation;
use sim::vehicle::{VehicleCommand, VehicleSettings};

/// 40 m straight on in a lane 4 m wide, then left; at 20 m two pillars leave 2.7 m.
fn map() -> Map {
    let points = |points: &[(f32, f32)]| points.iter().map(|&(x, y)| Vec2::new(x, y)).collect::<Vec<_>>();
    let pillar = |y| Obstacle {
        length_m: Some(0.6),
        width_m: Some(0.6),
        ..Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(20.0, y), 0.0))
    };
    let scenario = Scenario {
        name: "bend".into(),
        boundary: points(&[(-5.0, -2.0), (45.0, -2.0), (45.0, 40.0), (38.0, 40.0), (38.0, 2.0), (-5.0, 2.0)]),
        boundary_height_m: 0.0,
        reference_path: ReferencePath {
            points: points(&[(0.0, 0.0), (41.5, 0.0), (41.5, 30.0)]),
            corner_radius_m: 5.0,
        },
        noise: LotNoise::default(),
        islands: vec![],
        obstacles: vec![pillar(1.65), pillar(-1.65)],
        speed_bumps: vec![],
    };
    Map::build(scenario, &VehicleSettings::hyundai_hg300()).unwrap()
}

#[test]
fn widths_and_turns_are_those_of_the_drawing() {
    let map = map();
    assert!((free_width_m(&map, 10.0) - 4.0).abs() < 0.15, "{} m in the lane", free_width_m(&map, 10.0));
    assert!((free_width_m(&map, 18.0) - 2.7).abs() < 0.15, "{} m at the pillars", free_width_m(&map, 18.0));
    assert!(turn_deg(&map, 20.0) < 1.0);
    // The arc of 5 m radius is 7.85 m long; 5 m before and after its middle all of its 90° are seen.
    let middle_m = 36.5 + 0.25 * std::f32::consts::PI * 5.0;
    assert!((turn_deg(&map, middle_m) - 90.0).abs() < 3.0, "{}°", turn_deg(&map, middle_m));
}

#[test]
fn the_first_rule_that_holds_is_the_cause() {
    let episode = EpisodeSettings::paper();
    // 1.86 m of car and 0.5 m on both sides are 2.86 m.
    let all = Findings {
        passes_on_clean_grid: Some(true),
        reversals_before: 5,
        free_width_m: 2.8,
        turn_deg: 30.0,
        since_resume_m: None,
    };
    let cause = |findings: Findings, noisy| findings.cause(noisy, &episode);
    assert_eq!(cause(all, true), Cause::NoiseInduced);
    assert_eq!(cause(all, false), Cause::Oscillation, "no noise to blame");
    let clean = Findings { passes_on_clean_grid: Some(false), ..all };
    assert_eq!(cause(clean, true), Cause::Oscillation);
    let steady = Findings { reversals_before: 4, ..clean };
    assert_eq!(cause(steady, true), Cause::NarrowPassage);
    let wide = Findings { free_width_m: 2.9, ..steady };
    assert_eq!(cause(wide, true), Cause::Corner);
    assert_eq!(cause(Findings { turn_deg: 29.0, ..wide }, true), Cause::Other);
    assert!(!is_again(None) && is_again(Some(-0.3)) && is_again(Some(4.9)) && !is_again(Some(5.1)));
}

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
    assert!((incidents[0].earlier.1 - 0.1 * 79.0).abs() < 1e-4, "{:?}", incidents[0]);
    // The last 100 ticks hold five half-periods; the first change of direction is where the count starts.
    assert_eq!(incidents[0].reversals_before, 3);
    assert_eq!((incidents[1].earlier.1, incidents[1].reversals_before), (20.0, 0));
    // Put back at 20.0 m of route, the second one happens at 1.0 m (as written above).
    assert_eq!((incidents[0].since_resume_m, incidents[1].since_resume_m), (None, Some(-19.0)));
}

/// The expert does not look at the grid, so noise cannot be blamed: put where it was in a run of its own, it passes
/// again. Turned to a wall, it does not.
#[test]
fn a_driver_that_can_pass_passes_on_the_clean_grid() {
    let settings = Settings::preset("smoke").unwrap();
    let lots = Lot::parse_all(&["lot-b"], &settings.episode.vehicle).unwrap();
    let trials: Vec<Trial<'_>> =
        Trial::all(RootSeed(1), Purpose::Evaluation, &lots, 1, &[Direction::Forward]).collect();
    let maps = trials::maps(&trials, &settings.episode).unwrap();
    let driver = NamedDriver::expert(&settings.expert);
    let noise = NoiseChoice::Paper;
    let batch = TrialBatch {
        episode: &settings.episode,
        driver: &driver,
        trials: &trials,
        maps: &maps,
        noise,
        seed: RootSeed(1),
    };

    let mut met = None;
    let driven = batch.drive(&mut |_, frame| {
        assert_eq!(frame.event, Event::Drove, "a seed on which the expert drives well");
        if frame.progress_m < 24.0 {
            return ControlFlow::Continue(());
        }
        met = Some((frame.vehicle, frame.progress_m));
        ControlFlow::Break(())
    });
    driven.unwrap();
    let (vehicle, progress_m) = met.unwrap();
    let incident = |vehicle: VehicleState| Incident {
        episode: 0,
        tick: 500,
        at: vehicle.pose,
        route_m: 30.0,
        speed_mps: 1.0,
        reversals_before: 0,
        since_resume_m: None,
        earlier: (vehicle, progress_m),
        earlier_s: 6.0,
    };
    let heading_rad = vehicle.pose.heading_rad + std::f32::consts::FRAC_PI_2;
    let across = VehicleState::at_rest(Pose { heading_rad, ..vehicle.pose });
    let explained = explain(&batch, &[incident(vehicle), incident(across)]).unwrap();
    assert_eq!(explained[0].0, Cause::NoiseInduced, "{explained:?}");
    assert_eq!(explained[1].1.passes_on_clean_grid, Some(false), "it faces a wall: {explained:?}");
}
