use super::drive::{Detail, Drive};
use super::*;
use crate::drivers;
use planners::explanation::Explanation;
use protocol::{Clock, Dot, Moments, Pose, Strip};
use sim::driver::Driver;
use sim::frame::{Event, Frame};
use sim::vehicle::VehicleSettings;
use std::collections::{BTreeMap, BTreeSet};

/// Lot b with the obstacles of one trial.
pub(super) fn map() -> Map {
    let lots = Lot::parse_all(&["lot-b"]).unwrap();
    Map::build(lots[0].draw(RootSeed(1)).scenario, &VehicleSettings::hyundai_hg300()).unwrap()
}

/// The first ticks of a drive by whoever answers, with everything that is shown.
fn drive(ticks: u32, detail: Detail, driver: &mut dyn Driver) -> (Vec<Frame>, Moments, Vec<Mark>) {
    let settings = Settings::preset("smoke").unwrap();
    let mut episode = Episode::new(Arc::new(settings.episode.clone()), Arc::new(map()), RootSeed(2));
    let mut shown = Drive::new("me", &episode, &settings, detail);
    let always = shown.always();
    let (mut frames, mut marks) = (Vec::new(), Vec::new());
    while frames.len() < ticks as usize && episode.ending().is_none() {
        episode.observe();
        let decision = driver.decide(&episode.situation());
        let frame = episode.apply(decision);
        marks.push(shown.frame(&frame));
        frames.push(frame);
    }
    (frames, marks, always)
}

fn shape<'a>(marks: &'a [Mark], entity: &str) -> Option<&'a Shape> {
    marks.iter().find(|mark| mark.entity == entity).map(|mark| &mark.shape)
}

fn value(marks: &[Mark], signal: &str) -> f64 {
    match shape(marks, &format!("me/signals/{signal}")) {
        Some(Shape::Value(value)) => *value,
        other => panic!("{signal}: {other:?}"),
    }
}

#[test]
fn every_frame_is_shown_as_it_was() {
    let settings = Settings::preset("smoke").unwrap();
    let (frames, shown, _) = drive(60, Detail::Everything, &mut drivers::expert(&settings));
    let mut time_s = 0.0;
    for (frame, (clock, marks)) in frames.iter().zip(&shown) {
        assert_eq!(*clock, Clock::Episode { tick: i64::from(frame.tick), time_s });
        time_s = f64::from(frame.time_s);
        let pose = frame.vehicle.pose;
        let at = [pose.x_m, pose.y_m, 0.0];
        assert_eq!(shape(marks, "me/car"), Some(&Shape::Pose(Pose { at, yaw_rad: pose.heading_rad, scale: [1.0; 3] })));
        let Some(Shape::Pose(wheel)) = shape(marks, "me/car/wheels/front_left") else { panic!("no wheel") };
        assert_eq!(wheel.yaw_rad, frame.vehicle.steering_rad);
        let Some(Shape::Dots(dots)) = shape(marks, "me/car/look_ahead") else { panic!("no point") };
        let point = frame.decision.look_ahead;
        assert_eq!(dots[0].at[..2], [point.ahead_m, point.left_m]);
        assert_eq!(dots[0].colour, colours::EXPERT);
        assert_eq!(value(marks, "speed/actual"), f64::from(frame.vehicle.speed_mps));
        assert_eq!(value(marks, "distance/safe_ratio"), f64::from(frame.safe_ratio));
        assert_eq!(value(marks, "distance/clearance"), f64::from(frame.clearance_m));
        let plan = shape(marks, "me/expert_plan");
        assert_eq!(plan.is_some(), frame.tick % 4 == 0, "candidates come with the pictures");
        let grid = shape(marks, "me/sensors/grid");
        assert_eq!(grid.is_some(), frame.tick % 4 == 0, "pictures come five times a second");
        if let Some(Shape::Picture(picture)) = grid {
            let shown: Vec<(u8, u8)> = picture.pixels.iter().copied().zip(frame.observation.grid.cells()).collect();
            // Beyond the two right colours come the layers of noise: there the cell is shown wrongly, either way.
            assert!(shown.iter().all(|(pixel, cell)| *pixel > 1 || pixel == cell), "tick {}", frame.tick);
            assert!(shown.iter().filter(|(pixel, _)| *pixel > 1).count() < 200, "most of the grid is right");
        }
    }
}

/// Somebody who always heads a little to the left of straight on, and so into something.
struct Leftwards;

impl Driver for Leftwards {
    fn decide(&mut self, _: &sim::driver::Situation<'_>) -> sim::driver::Decision {
        let look_ahead = sim::driver::LookAheadPoint { ahead_m: 7.0, left_m: 1.5 };
        let spread = Some(sim::driver::Spread { ahead_m: 0.6, left_m: 1.2 });
        sim::driver::Decision { look_ahead, source: sim::driver::Source::Novice, spread }
    }
}

#[test]
fn a_network_is_compared_with_the_expert_and_its_failures_stay() {
    let (frames, shown, _) = drive(400, Detail::Everything, &mut Leftwards);
    let failed: Vec<usize> =
        (0..frames.len()).filter(|&i| matches!(frames[i].event, Event::NearCollision { .. })).collect();
    assert!(!failed.is_empty(), "it runs into something within 20 s");
    for (i, (_, marks)) in shown.iter().enumerate() {
        let Some(Shape::Dots(expert)) = shape(marks, "me/car/expert_point") else { panic!("no expert") };
        let apart_m = (expert[0].at[0] - 7.0).hypot(expert[0].at[1] - 1.5);
        assert!((value(marks, "discrepancy/tau_hat") - f64::from(apart_m / 12.0)).abs() < 1e-5, "τ̂ is a share of 12 m");
        assert!((value(marks, "doubt/across") - 0.1).abs() < 1e-6 && (value(marks, "doubt/ahead") - 0.05).abs() < 1e-6);
        let Some(Shape::Pose(spread)) = shape(marks, "me/car/spread") else { panic!("no ellipse") };
        assert_eq!((spread.at[..2].to_vec(), spread.scale), (vec![7.0, 1.5], [0.6, 1.2, 1.0]));
        let dots = match shape(marks, "me/near_collisions") {
            Some(Shape::Dots(dots)) => dots.len(),
            _ => 0,
        };
        let so_far = failed.iter().filter(|&&failed| failed <= i).count();
        assert_eq!(dots, if failed.contains(&i) { so_far } else { 0 }, "tick {i}");
    }
}

#[test]
fn frames_alone_cost_no_expert_and_no_views() {
    let settings = Settings::preset("smoke").unwrap();
    let (_, shown, _) = drive(20, Detail::Frames, &mut drivers::expert(&settings));
    let entities: BTreeSet<&str> =
        shown.iter().flat_map(|(_, marks)| marks.iter().map(|mark| mark.entity.as_str())).collect();
    assert!(entities.contains("me/car/look_ahead") && entities.contains("me/swept"));
    let is_dear = |entity: &str| entity.contains("expert") || entity.ends_with("clean") || entity.ends_with("noisy");
    assert!(!entities.iter().any(|entity| is_dear(entity)), "{entities:?}");
}

/// Every view of the first look shows something that is recorded, and an entity keeps its kind.
#[test]
fn the_first_look_shows_what_is_there() {
    let (_, shown, always) = drive(200, Detail::Everything, &mut Leftwards);
    let map = map();
    let lot = lot_marks(&map, legend::DRIVE);
    let mut kinds: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for mark in shown.iter().flat_map(|(_, marks)| marks) {
        let kind = format!("{:?}", std::mem::discriminant(&mark.shape));
        kinds.entry(&mark.entity).or_default().insert(kind);
    }
    assert!(kinds.values().all(|kinds| kinds.len() == 1), "{kinds:?}");
    let entities: BTreeSet<&str> =
        kinds.keys().copied().chain(lot.iter().chain(&always).map(|mark| mark.entity.as_str())).collect();
    let [alone, beside_others] =
        [1, 2].map(|drivers| layout::of_drives(&map, &vec!["me".to_owned(); drivers], Detail::Everything));
    for view in alone.views().into_iter().chain(beside_others.views()) {
        for shown in view.contents.iter().chain(&view.trails) {
            let path = shown.trim_start_matches('-').trim_end_matches("/**");
            let is_there = entities.iter().any(|entity| *entity == path || entity.starts_with(&format!("{path}/")));
            assert!(is_there, "view {:?} shows {shown}, which is not recorded", view.name);
        }
    }
}

#[test]
fn roots_mean_nothing_in_a_path() {
    assert_eq!(root_of("run:runs/a b/bc"), "run_runs_a_b_bc");
    assert_eq!(root_of("expert"), "expert");
    assert_eq!(roots_of(&["run:runs/a", "tuned:vvf", "net:runs/a/round-01"]), ["a", "tuned_vvf", "round-01"]);
    let colours = colours::of_drivers(&[Source::Expert, Source::Planner, Source::Novice, Source::Planner]);
    assert_eq!(colours, [colours::EXPERT, colours::PLANNER, colours::NOVICE, colours::PATCH]);
    assert_eq!(roots_of(&["run:runs/a/bc", "run:runs/b/bc"]), ["run_runs_a_bc", "run_runs_b_bc"]);
}

#[test]
fn shapes_are_small_enough_for_a_long_drive() {
    let (frames, shown, _) = drive(200, Detail::Everything, &mut Leftwards);
    let bytes: usize = shown
        .iter()
        .flat_map(|(_, marks)| marks)
        .map(|mark| match &mark.shape {
            Shape::Picture(_) => 1500, // measured as PNG
            Shape::Strips(strips) => strips.iter().map(|Strip { points, .. }| 12 * points.len() + 8).sum(),
            Shape::Dots(dots) => dots.iter().map(|Dot { label, .. }| 20 + label.len()).sum(),
            _ => 40,
        })
        .sum();
    let of_a_long_drive = bytes as f64 / frames.len() as f64 * 230.0 / 1.4 * 20.0;
    assert!(of_a_long_drive < 20e6, "230 m would take {:.1} MB before compression", of_a_long_drive / 1e6);
}

/// A folder as a training leaves it, two rounds of two points each.
#[test]
fn a_training_is_read_from_its_folder() {
    let run = std::env::temp_dir().join(format!("xtask-test-{}-visualise-run", std::process::id()));
    let _ = std::fs::remove_dir_all(&run);
    let settings = Settings::preset("smoke").unwrap();
    for round in 0..2 {
        let folder = run.join(format!("round-{round:02}"));
        std::fs::create_dir_all(&folder).unwrap();
        let collection = format!(
            "round = {round}\nsamples = {}\nticks = 1000\nnovice_ticks = {}\ntau_hat_sum = 1.0\ndriven_s = 50.0\n\
             near_collisions = 1\ndriven_m = 50.0\nepisodes = 2\n",
            500 - 100 * round,
            600 * round
        );
        std::fs::write(folder.join("round.toml"), collection).unwrap();
        let point = |step: u32| {
            format!(
                "[[curve]]\nstep = {step}\ntraining = {{ misfit = 1.5, log_variance = -2.0, total = -0.5 }}\n\
                 validation = {{ samples = 9, loss = -1.0, nll = -1.25, rmse_m = 0.75 }}\n"
            )
        };
        let head = "training_samples = 90\nvalidation_samples = 9\nsteps = 100\nkept_step = 100\nstopped = false\n";
        std::fs::write(folder.join("fit.toml"), format!("{head}{}{}", point(50), point(100))).unwrap();
    }
    std::fs::write(run.join("settings.toml"), settings.to_toml()).unwrap();
    std::fs::write(run.join("table1.md"), "| the table |").unwrap();

    let (always, moments) = training::read(&run).unwrap();
    std::fs::remove_dir_all(&run).unwrap();
    assert!(always.contains(&Mark::new("tables/table1", Shape::Document("| the table |".to_owned()))));
    let clocks: Vec<(i64, i64)> = moments
        .iter()
        .map(|(clock, _)| match *clock {
            Clock::Training { step, round } => (step, round),
            Clock::Episode { .. } => panic!("a training has steps"),
        })
        .collect();
    assert_eq!(clocks, [(0, 0), (50, 0), (100, 0), (100, 1), (150, 1), (200, 1)]);
    let value = |moment: usize, entity: &str| shape(&moments[moment].1, entity).cloned();
    assert_eq!(value(3, "rounds/eta_hat/eta_hat"), Some(Shape::Value(0.6)));
    assert_eq!(value(0, "rounds/eta_hat/eta_hat"), None, "behaviour cloning has none");
    assert_eq!(value(3, "rounds/samples/dataset"), Some(Shape::Value(900.0)));
    assert_eq!(value(0, "rounds/near_collisions"), Some(Shape::Value(2.0)), "per 100 m");
    assert_eq!(value(1, "training/loss/misfit"), Some(Shape::Value(1.5)));
    assert_eq!(value(5, "training/validation_error/rmse"), Some(Shape::Value(0.75)));
    let last = f64::from(settings.dagger.fit_iteration.learning_rate.at(99, 100));
    assert_eq!(value(5, "training/learning_rate"), Some(Shape::Value(last)));
    let entities: BTreeSet<&str> =
        moments.iter().flat_map(|(_, marks)| marks).chain(&always).map(|mark| mark.entity.as_str()).collect();
    for view in layout::of_training(true).views() {
        let path = view.contents[0].trim_end_matches("/**");
        assert!(entities.iter().any(|entity| entity.starts_with(path)), "{:?}", view.name);
    }
}

/// The paths drawn are those that were weighed: the chosen one is the cheapest, and leads where the planner steers.
#[test]
fn a_planner_shows_what_it_weighed() {
    let settings = Settings::preset("smoke").unwrap();
    for name in ["tentacle", "vvf", "apf"] {
        let contestant = &DriverSpec::parse_all(&[name.to_owned()]).unwrap()[0];
        let mut planner = contestant.planner(&settings).unwrap();
        let mut episode = Episode::new(Arc::new(settings.episode.clone()), Arc::new(map()), RootSeed(2));
        for _ in 0..10 {
            episode.observe();
            let observation = *episode.situation().observation;
            let decision = sim::driver::Policy::act(&mut planner, &observation);
            match planner.explain(&observation).unwrap() {
                Explanation::Paths(paths) => {
                    let chosen: Vec<_> = paths.iter().filter(|path| path.is_chosen).collect();
                    assert_eq!((paths.len(), chosen.len()), (81, 1));
                    assert!(paths.iter().all(|path| path.cost >= chosen[0].cost));
                    let end = chosen[0].points.last().unwrap();
                    let turns = decision.look_ahead.left_m.abs() > 0.5;
                    assert!(!turns || end.y.signum() == decision.look_ahead.left_m.signum(), "{end} {decision:?}");
                }
                Explanation::Field(samples) => {
                    assert!(samples.len() > 20 && samples.iter().all(|sample| sample.field.is_finite()));
                }
            }
            episode.apply(decision);
        }
    }
}
