use super::*;
use sim::geometry::{Pose, Vec2};
use sim::scenario::{LotNoise, Obstacle, ObstacleClass, ReferencePath, Scenario};
use sim::vehicle::VehicleSettings;

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
        passes_again: Some(false),
        reversals_before: 5,
        free_width_m: 2.8,
        turn_deg: 30.0,
        since_resume_m: None,
    };
    let cause = |findings: Findings, noisy| findings.cause(noisy, &episode);
    assert_eq!(cause(all, true), Cause::NoiseInduced);
    assert_eq!(cause(all, false), Cause::Oscillation, "no noise to blame");
    let anyway = Findings { passes_again: Some(true), ..all };
    assert_eq!(cause(anyway, true), Cause::Oscillation, "it would have passed with the noise as well");
    let clean = Findings { passes_on_clean_grid: Some(false), ..all };
    assert_eq!(cause(clean, true), Cause::Oscillation);
    let steady = Findings { reversals_before: 4, ..clean };
    assert_eq!(cause(steady, true), Cause::NarrowPassage);
    let wide = Findings { free_width_m: 2.9, ..steady };
    assert_eq!(cause(wide, true), Cause::Corner);
    assert_eq!(cause(Findings { turn_deg: 29.0, ..wide }, true), Cause::Other);
    assert!(!is_again(None) && is_again(Some(-0.3)) && is_again(Some(4.9)) && !is_again(Some(5.1)));
}
