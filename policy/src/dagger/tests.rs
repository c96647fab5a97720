//! Two tiny rounds on a bent lane: what lands on disk, and that an interrupted run continues as if nothing had been.

use super::*;
use crate::dataset::ValidationSplit;
use crate::dataset::store::tests::scratch;
use crate::drivers::{NetFleet, NetPolicy};
use crate::fit::Budget;
use crate::network::ConvConfig;
use sim::driver::{Decision, Fleet, LookAheadPoint, OneDriverEach, SensorsOnly, Situation, Source};
use sim::episode::EpisodeSettings;
use sim::map::Map;
use sim::scenario::Scenario;
use std::sync::Arc;

/// Drives to the point of the route ten metres ahead.
struct RouteFollower;

impl Driver for RouteFollower {
    fn decide(&mut self, situation: &Situation<'_>) -> Decision {
        let truth = &situation.truth;
        let goal = truth.map.path().pose_at(truth.progress_m + 10.0).position();
        let in_ego = truth.vehicle.pose.world_from_ego().inverse_point(goal);
        let look_ahead = LookAheadPoint { ahead_m: in_ego.x.clamp(4.4, 16.0), left_m: in_ego.y.clamp(-6.0, 6.0) };
        Decision { look_ahead, source: Source::Expert, spread: None }
    }
}

/// A lane 7 m wide: 25 m straight on, then 30° to the left.
fn episodes(count: usize) -> Vec<Episode> {
    let settings = EpisodeSettings::paper();
    let boundary = [(-4.0, -3.5), (26.0, -3.5), (52.0, 11.5), (48.5, 17.6), (24.0, 3.5), (-4.0, 3.5)];
    let scenario =
        Scenario::new("bent lane", boundary, [(0.0, 0.0), (25.0, 0.0), (42.0, 9.8)]).with_corner_radius_m(12.0);
    let map = Arc::new(Map::build(scenario, &settings.vehicle).unwrap());
    let settings = Arc::new(settings);
    (0..count).map(|i| Episode::new(Arc::clone(&settings), Arc::clone(&map), RootSeed(40 + i as u64))).collect()
}

fn settings() -> DaggerSettings {
    let fit = FitSettings {
        budget: Budget::Steps(25),
        batch: 32,
        validation: ValidationSplit { block: 25, every: 5 },
        validate_every: 25,
        ..FitSettings::quick(25)
    };
    DaggerSettings {
        eta: 0.999,
        iterations_max: 2,
        noise_augmentations: 1,
        start: StartFrom::Previous,
        network: LookAheadNetConfig {
            conv1: ConvConfig { channels: 16, kernel: 3 },
            conv2: ConvConfig { channels: 16, kernel: 2 },
            hidden: 32,
            dropout_features: 0.0,
            dropout_hidden: 0.1,
            mirror_averaging: false,
            smoothing_ticks: 2.0,
        },
        // Loose enough that both novice and expert drive after so little training.
        rule: DecisionRule::AllBelow { tau: 0.25, chi: 1.0, chi_on: crate::decision_rule::ChiOn::StdPerAxis },
        fit_cloning: fit.clone(),
        fit_iteration: fit,
        ..DaggerSettings::paper()
    }
}

fn run_in(
    folder: &Path,
    settings: &DaggerSettings,
    progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Outcome, DaggerError> {
    let store = Store::open(folder).unwrap();
    let mut hooks = Hooks {
        episodes: &mut |_| episodes(2),
        expert: &mut |_, _| Box::new(RouteFollower),
        on_frame: &mut |_, _, _| {},
        progress,
    };
    run(settings, &store, RootSeed(6), &mut hooks)
}

fn go_on(_: &Progress<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

#[test]
fn a_run_leaves_data_and_policy_of_every_round() {
    let folder = scratch("dagger");
    let outcome = run_in(&folder, &settings(), &mut go_on).unwrap();
    assert_eq!(outcome.stop, Stop::IterationCap);
    assert_eq!(outcome.rows.len(), 3);
    let store = Store::open(&folder).unwrap();
    let mut total = 0;
    for (round, row) in outcome.rows.iter().enumerate() {
        let (data, about) = store.read_round::<Collection>(round as u32).unwrap();
        total += data.samples.len();
        assert_eq!((row.round, row.samples, row.dataset), (round as u32, data.samples.len(), total));
        let kept = if round == 0 { about.ticks } else { about.ticks - about.novice_ticks };
        assert_eq!(data.samples.len() as u64, kept, "round {round} keeps the expert's ticks");
        assert_eq!(data.noise_augmentations.len(), data.samples.len(), "one further look at each");
        let differ = data
            .samples
            .iter()
            .zip(&data.noise_augmentations)
            .filter(|(sample, relook)| sample.grid != **relook)
            .count();
        assert!(2 * differ > data.samples.len(), "{differ} of {} have noise of their own", data.samples.len());
        assert!(Checkpoint::exists(&store.round_folder(round as u32)));
        assert_eq!(row.eta_hat.is_some(), round > 0);
    }
    assert!(store.read_round::<Collection>(0).unwrap().0.samples.iter().all(|sample| sample.tau_hat == 0.0));
    let last = Checkpoint::load(&store.round_folder(2)).unwrap();
    assert_eq!(outcome.policy, Some(last));
    std::fs::remove_dir_all(folder).unwrap();
}

/// Nudges change where cars go in iterations, and nothing in behaviour cloning.
#[test]
fn only_iterations_are_nudged() {
    let rounds_of = |name, disturbance| {
        let folder = scratch(name);
        run_in(&folder, &DaggerSettings { disturbance, iterations_max: 1, ..settings() }, &mut go_on).unwrap();
        let store = Store::open(&folder).unwrap();
        let rounds = [0, 1].map(|round| store.read_round::<Collection>(round).unwrap().0);
        std::fs::remove_dir_all(folder).unwrap();
        rounds
    };
    let nudges = super::DisturbanceSettings { pause_ticks: 20, lasts_ticks: 20, curvature_max_per_m: 0.1 };
    let [plain, nudged] = [rounds_of("plain", None), rounds_of("nudged", Some(nudges))];
    assert_eq!(plain[0], nudged[0]);
    assert_ne!(plain[1], nudged[1]);
}

#[test]
fn an_interrupted_run_continues_to_the_same_end() {
    let (whole, parts) = (scratch("whole"), scratch("parts"));
    let at_once = run_in(&whole, &settings(), &mut go_on).unwrap();
    // Interrupted in the middle of the training of round 1, after its collection.
    let mut interrupt = |progress: &Progress<'_>| match progress {
        Progress::Fitting { round: Some(1), fit } if fit.step == 5 => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    };
    let first = run_in(&parts, &settings(), &mut interrupt).unwrap();
    assert_eq!((first.stop, first.rows.len()), (Stop::Interrupted, 1));
    assert_eq!(first.policy, Some(Checkpoint::load(&parts.join("round-00")).unwrap()));
    let second = run_in(&parts, &settings(), &mut go_on).unwrap();
    assert_eq!(second.rows, at_once.rows);
    assert_eq!(second.policy, at_once.policy);
    std::fs::remove_dir_all(whole).unwrap();
    std::fs::remove_dir_all(parts).unwrap();
}

#[test]
fn a_folder_is_continued_only_with_its_own_settings() {
    let folder = scratch("claimed");
    let mut stop = |_: &Progress<'_>| ControlFlow::Break(());
    let outcome = run_in(&folder, &settings(), &mut stop).unwrap();
    assert_eq!((outcome.stop, outcome.policy), (Stop::Interrupted, None));
    let other = DaggerSettings { eta: 0.5, ..settings() };
    let error = run_in(&folder, &other, &mut go_on).unwrap_err().to_string();
    assert!(error.contains("dagger.toml") && error.contains("other settings"), "{error}");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn eta_ends_the_iterations_and_a_final_fit_follows() {
    let folder = scratch("eta");
    let settings = DaggerSettings {
        // The network always drives: η̂ = 1.
        rule: DecisionRule::TauOnly { tau: 2.0 },
        keep: Keep::EveryTick,
        fit_final: Some(FitSettings { budget: Budget::Steps(3), ..settings().fit_iteration }),
        ..settings()
    };
    let outcome = run_in(&folder, &settings, &mut go_on).unwrap();
    assert_eq!(outcome.stop, Stop::EtaReached);
    assert_eq!(outcome.rows.len(), 2, "line 8 still trains on what line 6 collected");
    assert_eq!(outcome.rows[1].eta_hat, Some(1.0));
    assert!(outcome.rows[1].samples > 0, "every tick is kept");
    assert_eq!(outcome.policy, Some(Checkpoint::load(&folder.join("final")).unwrap()));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn presets_survive_toml() {
    for settings in [DaggerSettings::paper(), DaggerSettings::quick()] {
        let text = toml::to_string(&settings).unwrap();
        assert_eq!(toml::from_str::<DaggerSettings>(&text).unwrap(), settings);
    }
}

/// In DAgger, in a fleet and alone, with its memory and what it forgets when the car is put back.
#[test]
fn the_network_drives_the_same_whoever_seats_it() {
    let network = LookAheadNetConfig { mirror_averaging: true, smoothing_ticks: 8.0, ..settings().network };
    let checkpoint = Checkpoint { weights: Weights::init(network, RootSeed(3), 0), geometry: GridGeometry::paper() };
    let drive = |fleet: &mut dyn Fleet| {
        let mut driven = Vec::new();
        let reports = run_lockstep(episodes(2), fleet, &mut |episode, frame| driven.push((episode, frame.decision)));
        (driven, reports)
    };
    let device = DeviceChoice::Cpu;
    let (in_fleet, reports) = drive(&mut NetFleet::new(checkpoint.clone(), device));
    let put_back = reports.iter().map(|report| report.metrics.near_collisions).sum::<u32>();
    assert!(put_back > 0, "nothing was forgotten: {reports:?}");
    let alone = |_| SensorsOnly(NetPolicy::new(checkpoint.clone(), device));
    assert_eq!(drive(&mut OneDriverEach((0..2).map(alone).collect())).0, in_fleet);
    let novice = Predictor::new(checkpoint.weights.clone(), device);
    let experts: Vec<Box<dyn Driver + Send>> = vec![Box::new(RouteFollower), Box::new(RouteFollower)];
    let always = DecisionRule::TauOnly { tau: 9.0 };
    let mut collector = GatedCollector::new(Some(novice), experts, always, Keep::EveryTick, checkpoint.geometry);
    assert_eq!(drive(&mut collector).0, in_fleet);
    let forgetful = LookAheadNetConfig { smoothing_ticks: 0.0, ..network };
    let weights = Weights::init(forgetful, RootSeed(3), 0);
    assert_ne!(drive(&mut NetFleet::new(Checkpoint { weights, ..checkpoint }, device)).0, in_fleet, "memory matters");
}
