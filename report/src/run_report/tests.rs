use super::*;
use evaluation::incidents::{Cause, Findings};
use experiment::drive::Replay;
use experiment::manifest::MANIFEST_SCHEMA;
use experiment::replay_key::ReplayKey;
use sim::frame::Event;
use sim::scenario::Direction;
use std::ops::ControlFlow;

fn failure(driver: &str, lot: &str, speed_mps: f32) -> FailureRecord {
    FailureRecord {
        header: RecordHeader {
            schema: records::SCHEMA,
            driver: driver.to_owned(),
            lot: lot.to_owned(),
            direction: Direction::Forward,
            trial: 0,
            noise: NoiseChoice::Paper,
        },
        tick: 10,
        route_m: 3.0,
        x_m: 0.0,
        y_m: 0.0,
        heading_deg: 0.0,
        speed_mps,
        cause: Cause::Corner,
        findings: Findings {
            passes_on_clean_grid: None,
            passes_again: None,
            reversals_before: 0,
            free_width_m: 4.0,
            turn_deg: 90.0,
            since_resume_m: None,
        },
        replay: format!("{driver}@{lot}@forward@0@paper@1@10"),
    }
}

/// The manifest of an evaluation that reads nothing from elsewhere.
fn manifest(words: &[&str]) -> Manifest {
    Manifest {
        schema: MANIFEST_SCHEMA,
        program: "lotpilot".to_owned(),
        command: "evaluate".to_owned(),
        command_line: words.iter().copied().map(str::to_owned).collect(),
        preset: "smoke".to_owned(),
        root_seed: 1,
        evaluation_seed: 1,
        git_revision: None,
        git_dirty: None,
        git_changes: None,
        rustc_version: String::new(),
        threads: 1,
        target: String::new(),
        processor: None,
        processor_features: Vec::new(),
        libraries: Vec::new(),
        arguments: toml::Table::new(),
        inputs: BTreeMap::new(),
    }
}

#[test]
fn the_fastest_are_the_worst_and_no_driver_fills_the_list() {
    let mut failures: Vec<FailureRecord> = (0..9).map(|i| failure("tentacle", "lot-a", 1.0 + 0.1 * i as f32)).collect();
    failures.push(failure("run:x", "lot-a", 0.4));
    failures.push(failure("tentacle", "lot-b", 0.3));
    let mut worst = Worst::default();
    for failure in failures {
        worst.add(failure);
    }
    let speeds: Vec<f32> = worst.0.iter().map(|failure| failure.speed_mps).collect();
    assert_eq!(speeds, [1.8, 1.7, 0.4, 0.3]);
}

#[test]
fn commands_can_be_pasted_into_a_shell() {
    let words = ["evaluate", "--set", "training.lots=[\"lot-a\"]", "--out", "my runs/it's"];
    let written = manifest(&words);
    let expected = r#"cargo xtask evaluate --set 'training.lots=["lot-a"]' --out 'my runs/it'\''s'"#;
    assert_eq!(command_line(&written), expected);
    let runs = Path::new("runs/x");
    assert_eq!(
        visualise("run:runs/y@lot-a@forward@0@paper@1@5", runs),
        "cargo xtask visualise replay run:runs/y@lot-a@forward@0@paper@1@5 --config runs/x/settings.toml",
        "not the settings of its training"
    );
    let spaced = visualise("vvf@my lot@forward@0@paper@1@5", Path::new("my runs"));
    assert!(spaced.ends_with("'vvf@my lot@forward@0@paper@1@5' --config 'my runs/settings.toml'"), "{spaced}");
}

/// A near-collision of a planner that has many, found by driving, and replayed for its pictures.
#[test]
fn a_near_collision_plays_and_stands_still_at_its_moment() {
    let settings = Settings::preset("default").unwrap();
    let key: ReplayKey = "tentacle@lot-b@forward@0@paper@1@0".parse().unwrap();
    let replay = Replay::new(&key, &settings.episode).unwrap();
    let driver = key.driver.clone().load(&settings).unwrap();
    let mut tick = None;
    let driven = replay.drive(&settings.episode, &driver, |frame| {
        tick = matches!(frame.event, Event::NearCollision { .. }).then_some(frame.tick);
        if tick.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    driven.unwrap();
    let key = ReplayKey { tick: tick.unwrap(), ..key }.to_string();
    let nothing_read = manifest(&[]);
    let player = moments::player(&key, &settings, &nothing_read).unwrap();
    let shows = |frame: &(String, String)| frame.1.contains(">1 near-collision</text>");
    let shown = player.frames.iter().position(shows);
    assert_eq!(shown, Some(player.still), "counted from its moment on");
    assert!(player.frames.len() > player.still + 5, "and what follows: {}", player.frames.len());
    let bytes: usize = player.frames.iter().map(|(_, elements)| elements.len()).sum();
    assert!(bytes + player.background.len() < 1_000_000, "{bytes} bytes: six must fit into 6 MB");

    let missed =
        moments::player("tentacle@lot-b@forward@0@paper@1@3", &settings, &nothing_read).unwrap_err().to_string();
    assert!(missed.contains("it does not happen"), "{missed}");
    assert!(moments::player("nobody@lot-b@forward@0@paper@1@3", &settings, &nothing_read).is_err());
}

#[test]
fn runs_are_of_their_lot_or_of_its_kind() {
    for (lot, lots) in [("lot-b", "lot-b"), ("test-hard-12", "test-hard (13 lots)"), ("test-hard-0", "test-hard")] {
        assert!(is_in(lot, lots), "{lot} {lots}");
    }
    for (lot, lots) in [("lot-b", "all"), ("test-hard-0", "test-hard-1"), ("test-hardest-0", "test-hard (2 lots)")] {
        assert!(!is_in(lot, lots), "{lot} {lots}");
    }
    let by_lot = [("garage", 0.5), ("garage-2", 0.75), ("test-hard-0", 0.25)];
    let by_lot = by_lot.map(|(lot, ratio)| (lot.to_owned(), vec![ratio])).into();
    assert_eq!(of_row(&by_lot, "garage"), [0.5], "not of garage-2");
    assert_eq!(of_row(&by_lot, "test-hard"), [0.25]);
}
