//! Two tiny rounds on a bent lane: what lands on disk, and that an interrupted run continues to the same result.

use super::*;
use crate::checkpoint::Checkpoint;
use crate::conditions::Conditions;
use crate::dagger::gated_collector::{CollectorSeat, GatedCollector};
use crate::dagger::learned::{critic_folder, member_folder};
use crate::dataset::ValidationSplit;
use crate::dataset::store::Store;
use crate::decision_rule::{DecisionRule, Gate, GateTick, PAPER_TAU};
use crate::drivers::{NetFleet, NetPolicy};
use crate::fit::{Budget, FitReport, FitSettings};
use crate::network::{ConvLayer, InferenceSettings, NetworkArchitecture, Weights};
use crate::test_data::scratch;
use sim::batch::{NotFinite, run_lockstep};
use sim::driver::{Decision, Driver, Fleet, LookAheadPoint, OneDriverEach, SensorsOnly, Situation, Source};
use sim::episode::{Episode, EpisodeSettings};
use sim::frame::{Event, Frame};
use sim::geometry::{Pose, Vec2};
use sim::map::Map;
use sim::scenario::{Direction, LotNoise, NoiseLevel, Obstacle, ObstacleClass, ReferencePath, Scenario};
use sim::seed::{EpisodeIndex, RootSeed};
use sim::sensing::GridGeometry;
use sim::sensing::noise::NoiseSettings;
use std::cmp::Reverse;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use storage::sums;

/// Drives to the point of the route ten metres ahead.
struct RouteFollower;

impl Driver for RouteFollower {
    fn decide(&mut self, situation: &Situation<'_>) -> Decision {
        let truth = &situation.truth;
        let goal = truth.map.path().pose_at(truth.progress_m + 10.0).position();
        let in_ego = truth.vehicle.pose.world_from_ego().inverse_point(goal);
        let look_ahead = LookAheadPoint { ahead_m: in_ego.x.clamp(4.4, 16.0), left_m: in_ego.y.clamp(-6.0, 6.0) };
        Decision { look_ahead, source: Source::Expert, spread: None, speed_limit_mps: None }
    }
}

/// A lane 7 m wide: 25 m straight on, then 30° to the left.
fn episodes(count: usize) -> Vec<Episode> {
    episodes_among(count, Vec::new())
}

fn episodes_among(count: usize, obstacles: Vec<Obstacle>) -> Vec<Episode> {
    episodes_with(EpisodeSettings::paper(), count, obstacles)
}

fn episodes_with(settings: EpisodeSettings, count: usize, obstacles: Vec<Obstacle>) -> Vec<Episode> {
    let v = Vec2::new;
    let scenario = Scenario {
        name: "bent lane".to_string(),
        boundary: vec![v(-4.0, -3.5), v(26.0, -3.5), v(52.0, 11.5), v(48.5, 17.6), v(24.0, 3.5), v(-4.0, 3.5)],
        boundary_height_m: 0.0,
        reference_path: ReferencePath { points: vec![v(0.0, 0.0), v(25.0, 0.0), v(42.0, 9.8)], corner_radius_m: 12.0 },
        noise: LotNoise::default(),
        islands: Vec::new(),
        obstacles,
        speed_bumps: Vec::new(),
    };
    let map = Arc::new(Map::build(scenario, &settings.vehicle).unwrap());
    let settings = Arc::new(settings);
    (0..count).map(|i| Episode::new(Arc::clone(&settings), Arc::clone(&map), RootSeed(40 + i as u64))).collect()
}

fn of_round(round: u32, count: usize) -> Vec<RoundEpisode> {
    seated(round, episodes(count))
}

fn seated(round: u32, episodes: Vec<Episode>) -> Vec<RoundEpisode> {
    let seated = |(index, episode)| RoundEpisode {
        index,
        direction: Direction::Forward,
        episode,
        expert: Box::new(RouteFollower),
    };
    EpisodeIndex::of_round(round, episodes.len()).zip(episodes).map(seated).collect()
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
        network: NetworkArchitecture {
            conv1: ConvLayer { channels: 16, kernel: 3 },
            conv2: ConvLayer { channels: 16, kernel: 2 },
            residual1: 1,
            residual2: 1,
            hidden: 32,
            modes: 1,
            dropout_features: 0.0,
            dropout_hidden: 0.1,
        },
        inference: InferenceSettings { mirror_averaging: false, smoothing_ticks: 2.0 },
        // Loose enough that both novice and expert drive after so little training.
        rule: DecisionRule::AllBelow { tau: 0.25, chi: 1.0, chi_on: crate::decision_rule::ChiOn::StdPerAxis },
        cloning_budget: fit.budget,
        fit,
        ..DaggerSettings::paper()
    }
}

fn run_in(
    folder: &Path,
    settings: &DaggerSettings,
    progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Outcome, DaggerError> {
    run_of_seed(RootSeed(6), folder, settings, progress)
}

fn run_of_seed(
    seed: RootSeed,
    folder: &Path,
    settings: &DaggerSettings,
    progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Outcome, DaggerError> {
    let store = Store::open(folder).unwrap();
    let mut hooks = Hooks { episodes: &mut |round| Ok(of_round(round, 2)), on_frame: &mut |_, _, _| {}, progress };
    run(settings, &conditions(), &store, seed, &mut hooks)
}

/// Copies a folder of another run into a run, in place of its own.
fn replace(run: &Path, name: &str, other: &Path) {
    let (from, to) = (other.join(name), run.join(name));
    std::fs::remove_dir_all(&to).unwrap();
    std::fs::create_dir(&to).unwrap();
    for file in std::fs::read_dir(from).unwrap().map(Result::unwrap) {
        std::fs::copy(file.path(), to.join(file.file_name())).unwrap();
    }
}

fn conditions() -> Conditions {
    Conditions::of(&EpisodeSettings::paper())
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
        let (data, about) = store.read_round(round as u32).unwrap();
        assert_eq!(data.ticks.len(), data.samples.len());
        total += data.samples.len();
        assert_eq!((row.round, row.samples, row.dataset), (round as u32, data.samples.len(), total));
        let kept = if round == 0 { about.ticks } else { about.ticks - about.novice_ticks };
        assert_eq!(data.samples.len() as u64, kept, "round {round} keeps the expert's ticks");
        assert_eq!(data.noise_augmentations.len(), data.samples.len(), "one noise augmentation of each");
        let differ = data
            .samples
            .iter()
            .zip(&data.noise_augmentations)
            .filter(|(sample, augmented)| sample.grid != **augmented)
            .count();
        assert!(2 * differ > data.samples.len(), "{differ} of {} have noise of their own", data.samples.len());
        assert!(Checkpoint::exists(&store.round_folder(round as u32)).unwrap());
        assert_eq!(row.eta_hat.is_some(), round > 0);
    }
    assert!(store.read_round(0).unwrap().0.samples.iter().all(|sample| sample.tau_hat == 0.0));
    let last = Checkpoint::load(&store.round_folder(2)).unwrap();
    assert_eq!(outcome.policy, Some(last));
    std::fs::remove_dir_all(folder).unwrap();
}

/// Disturbances change where cars go in iterations, and nothing in behaviour cloning.
#[test]
fn only_iterations_are_disturbed() {
    let rounds_of = |name, disturbance| {
        let folder = scratch(name);
        run_in(&folder, &DaggerSettings { disturbance, iterations_max: 1, ..settings() }, &mut go_on).unwrap();
        let store = Store::open(&folder).unwrap();
        let rounds = [0, 1].map(|round| store.read_round(round).unwrap().0);
        std::fs::remove_dir_all(folder).unwrap();
        rounds
    };
    let often = DisturbanceSettings { pause_ticks: 20, ..DisturbanceSettings::quick() };
    let [plain, disturbed] = [rounds_of("plain", DisturbanceSettings::off()), rounds_of("disturbed", often)];
    assert_eq!(plain[0], disturbed[0]);
    assert_ne!(plain[1], disturbed[1]);
}

#[test]
fn an_interrupted_run_continues_to_the_same_end() {
    let (whole, parts) = (scratch("whole"), scratch("parts"));
    let at_once = run_in(&whole, &settings(), &mut go_on).unwrap();
    // Interrupted in the middle of the training of round 1, after its collection.
    let mut interrupt = |progress: &Progress<'_>| match progress {
        Progress::Fitting { round: Some(1), fit, .. } if fit.step == 5 => ControlFlow::Break(()),
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

/// The process was aborted; rounds before it stay, and go on.
#[test]
fn a_round_that_cannot_be_driven_is_an_error() {
    let folder = scratch("no-round");
    let store = Store::open(&folder).unwrap();
    let mut hooks = Hooks {
        episodes: &mut |round| if round == 0 { Ok(of_round(round, 2)) } else { Err("too narrow".into()) },
        on_frame: &mut |_, _, _| {},
        progress: &mut go_on,
    };
    let refused = run(&settings(), &conditions(), &store, RootSeed(6), &mut hooks).unwrap_err();
    assert!(matches!(&refused, DaggerError::Episodes { round: 1, source } if source.to_string() == "too narrow"));
    assert_eq!(run_in(&folder, &settings(), &mut go_on).unwrap().rows.len(), 3);
    std::fs::remove_dir_all(folder).unwrap();
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
        final_budget: Budget::Steps(3),
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

/// `final/` of another run was taken for the last network of this one, and never trained.
#[test]
fn a_network_of_another_run_is_not_taken_for_a_finished_training() {
    let (own, other) = (scratch("final"), scratch("final-of-another"));
    let settings = DaggerSettings { iterations_max: 0, final_budget: Budget::Steps(3), ..settings() };
    let again = || run_in(&own, &settings, &mut go_on).map(|outcome| outcome.policy).map_err(|error| error.to_string());
    let policy = again().unwrap();
    run_of_seed(RootSeed(7), &other, &settings, &mut go_on).unwrap();
    let files = ["final/fit.toml", "final/learning.csv", "final/model.toml", "final/model.safetensors"];
    // Its files are listed, the folder is not.
    let die_at_the_end = || {
        sums::unlist(&own, &["final/sha256sums"]).unwrap();
        sums::list(&own, &files).unwrap();
    };
    die_at_the_end();
    assert_eq!(again().unwrap(), policy);
    assert!(sums::verify(&own).faults.is_empty());
    die_at_the_end();
    std::fs::remove_file(own.join("final/sha256sums")).unwrap();
    assert_eq!(again().unwrap(), policy, "trained again, to the same");
    die_at_the_end();
    replace(&own, "final", &other);
    let refused = again().unwrap_err();
    assert!(refused.contains("is not the file that the run wrote"), "{refused}");
    sums::unlist(&own, &files).unwrap();
    let refused = again().unwrap_err();
    assert!(refused.contains("final") && refused.contains("this run did not train the network there"), "{refused}");
    std::fs::remove_dir_all(own.join("final")).unwrap();
    assert_eq!(again().unwrap(), policy);
    for folder in [own, other] {
        std::fs::remove_dir_all(folder).unwrap();
    }
}

/// A round was driven again with the networks of another run, each whole by its own list.
#[test]
fn a_round_is_not_driven_again_with_networks_of_another_run() {
    let (own, other) = (scratch("networks"), scratch("networks-of-another"));
    let rule = DecisionRule::named("thrifty_dagger").unwrap();
    let settings = DaggerSettings { rule, iterations_max: 0, samples_per_round: 150, ..settings() };
    run_in(&own, &settings, &mut go_on).unwrap();
    run_of_seed(RootSeed(7), &other, &settings, &mut go_on).unwrap();
    let store = Store::open(&own).unwrap();
    Learned::of_round(&settings, &store, 1).unwrap();
    let kept = scratch("networks-kept");
    for name in ["round-00", "round-00-member-1", "round-00-critic"] {
        std::fs::create_dir_all(kept.join(name)).unwrap();
        replace(&kept, name, &own);
        replace(&own, name, &other);
        let refused = Learned::of_round(&settings, &store, 1).unwrap_err().to_string();
        assert!(refused.contains(&format!("{name}/sha256sums: is damaged")), "{name}: {refused}");
        replace(&own, name, &kept);
    }
    Learned::of_round(&settings, &store, 1).unwrap();
    sums::unlist(&own, &["round-00-critic/sha256sums"]).unwrap();
    let refused = Learned::of_round(&settings, &store, 1).unwrap_err().to_string();
    assert!(refused.contains("this run did not train the network there"), "{refused}");
    for folder in [own, other, kept] {
        std::fs::remove_dir_all(folder).unwrap();
    }
}

#[test]
fn presets_survive_toml() {
    for settings in [DaggerSettings::paper(), DaggerSettings::quick()] {
        let text = toml::to_string(&settings).unwrap();
        assert_eq!(toml::from_str::<DaggerSettings>(&text).unwrap(), settings);
    }
}

/// In DAgger, in a fleet and alone, with its action smoothing and the reset when the car is put back.
#[test]
fn the_network_drives_the_same_whoever_seats_it() {
    let weights = Weights::init(settings().network, RootSeed(3), 0);
    let inference = InferenceSettings::smoothed();
    let checkpoint = Checkpoint { weights, conditions: conditions(), inference };
    let drive = |fleet: &mut dyn Fleet| {
        let mut driven = Vec::new();
        let reports = run_lockstep(episodes(2), fleet, &mut |episode, frame| driven.push((episode, frame.decision)));
        let reports = reports.unwrap();
        (driven, reports)
    };
    let (in_fleet, reports) = drive(&mut NetFleet::new(&checkpoint));
    let put_back = reports.iter().map(|report| report.metrics.near_collisions).sum::<u32>();
    assert!(put_back > 0, "nothing was reset: {reports:?}");
    let alone = |_| SensorsOnly(NetPolicy::new(&checkpoint));
    assert_eq!(drive(&mut OneDriverEach((0..2).map(alone).collect())).0, in_fleet);
    let mut overflowing = checkpoint.clone();
    overflowing.weights.parts_mut().fc2_weight.fill(f32::MAX);
    let refused = Rollouts::on_policy(&overflowing, of_round(0, 2)).drive(&mut |_, _| {}).err();
    assert_eq!(refused, Some(NotFinite { episode: 0, tick: 0, what: "the driver's answer" }));
    let mut driven = Vec::new();
    let rollouts = Rollouts::on_policy(&checkpoint, of_round(0, 2));
    let collected = rollouts.drive(&mut |episode, frame| driven.push((episode, frame.decision))).unwrap();
    assert_eq!(driven, in_fleet);
    assert_eq!(
        (collected.n_net, collected.round.samples.len()),
        (collected.n_tot, driven.len()),
        "every tick is labelled"
    );
    assert_eq!(collected.agreement, None, "at no τ");
    let plain = Checkpoint { inference: InferenceSettings { smoothing_ticks: 0.0, ..inference }, ..checkpoint };
    assert_ne!(drive(&mut NetFleet::new(&plain)).0, in_fleet, "smoothing matters");
}

/// Whoever drives an episode of a round again gets its samples: noise, disturbances, augmentations and all.
#[test]
fn one_episode_of_a_round_driven_again_is_the_same() {
    let folder = scratch("again");
    let settings = DaggerSettings { disturbance: DisturbanceSettings::quick(), iterations_max: 1, ..settings() };
    run_in(&folder, &settings, &mut go_on).unwrap();
    let store = Store::open(&folder).unwrap();
    for round in 0..2 {
        let (stored, _) = store.read_round(round).unwrap();
        let novice = (round > 0).then(|| Learned::of_round(&settings, &store, round).unwrap());
        let second = of_round(round, 2).pop().into_iter().collect();
        let again =
            Rollouts::of_round(&settings, RootSeed(6), novice.as_ref(), second).drive(&mut |_, _| {}).unwrap().round;
        let first = stored.ticks.iter().position(|tick| tick.episode == 1).unwrap();
        assert!(first > 0 && again.samples.len() > 50, "{first}");
        assert_eq!(again.samples, stored.samples[first..], "round {round}");
        assert_eq!(again.ticks, stored.ticks[first..], "round {round}");
        assert_eq!(again.noise_augmentations, stored.noise_augmentations[first..], "round {round}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

/// Samples were counted by the number of their drive in the round: of drives that are not all of it, that is beyond their records.
#[test]
fn some_drives_of_a_round_are_thinned_by_their_own_records() {
    let last_two = of_round(0, 3).into_iter().skip(1).collect();
    let collected = Rollouts::of_round(&settings(), RootSeed(6), None, last_two).drive(&mut |_, _| {}).unwrap();
    for at_most in [1, 2, 7, 150] {
        let thinned = collected.clone().thinned(at_most);
        let counted = [1, 2].map(|drive| thinned.round.ticks.iter().filter(|tick| tick.episode == drive).count());
        let recorded: Vec<usize> = thinned.episodes.iter().map(|episode| episode.samples).collect();
        assert_eq!(recorded, counted, "{at_most}");
        assert_eq!(counted.iter().sum::<usize>(), at_most);
    }
}

/// With the index of another, a member would be its copy, and the ensemble would agree with itself. Nothing is trained here:
/// every network is what its training begins with.
#[test]
fn members_of_an_ensemble_begin_with_weights_of_their_own_and_go_on_from_them() {
    let folder = scratch("members");
    let rule = DecisionRule::named("ensemble_dagger").unwrap();
    let mut settings = DaggerSettings { rule, iterations_max: 1, cloning_budget: Budget::Steps(0), ..settings() };
    settings.fit.budget = Budget::Steps(0);
    run_in(&folder, &settings, &mut go_on).unwrap();
    let store = Store::open(&folder).unwrap();
    let of_round = |round: u32| -> Vec<Weights> {
        let others = (1..rule.members()).map(|member| member_folder(&store, round, member));
        let folders = std::iter::once(store.round_folder(round)).chain(others);
        folders.map(|folder| Checkpoint::load(&folder).unwrap().weights).collect()
    };
    let [first, second] = [0, 1].map(of_round);
    assert_eq!(first.len(), 3);
    assert!(first[0] != first[1] && first[0] != first[2] && first[1] != first[2]);
    assert!(first == second, "trained from scratch, or from another's weights");
    std::fs::remove_dir_all(folder).unwrap();
}

/// Every row of `ticks.npz` is what the frame of that tick showed, and its sample is what that frame observed.
#[test]
fn ticks_say_where_and_when_samples_were_taken() {
    let settings = DaggerSettings { disturbance: DisturbanceSettings::quick(), ..settings() };
    let weights = Weights::init(settings.network, RootSeed(3), 0);
    let checkpoint = Checkpoint { weights, conditions: conditions(), inference: settings.inference };
    let mut frames: Vec<Vec<Frame>> = vec![Vec::new(); 2];
    let rollouts = Rollouts::of_round(&settings, RootSeed(6), Some(&Learned::alone(checkpoint)), of_round(1, 2));
    let collected = rollouts.drive(&mut |episode, frame| frames[episode].push(*frame)).unwrap();
    let Collected { round, episodes: records, reports, .. } = collected;
    assert_eq!(round.ticks.len(), round.samples.len());
    assert!(round.ticks.is_sorted_by_key(|tick| (tick.episode, tick.tick)));
    assert!(round.ticks.windows(2).all(|pair| pair[0].episode < pair[1].episode || pair[0].tick < pair[1].tick));
    for (tick, sample) in round.ticks.iter().zip(&round.samples) {
        let of_episode = &frames[tick.episode as usize];
        let frame = &of_episode[tick.tick as usize];
        assert_eq!((tick.x_m, tick.y_m), (frame.vehicle.pose.x_m, frame.vehicle.pose.y_m));
        assert_eq!((tick.heading_rad, tick.speed_mps), (frame.vehicle.pose.heading_rad, frame.vehicle.speed_mps));
        assert_eq!(tick.steering_rad, frame.vehicle.steering_rad);
        assert_eq!((tick.command_steering_rad, tick.command_speed_mps), {
            (frame.command.steering_rad, frame.command.speed_mps)
        });
        assert_eq!((tick.driver, sample.grid), (frame.decision.source, frame.observation.grid));
        let before_s = tick.tick.checked_sub(1).map_or(0.0, |before| of_episode[before as usize].time_s);
        assert_eq!(tick.time_s, before_s);
        // Between near-collisions, a tick takes 50 ms.
        assert!(tick.time_s >= 0.05 * tick.tick as f32 - 1e-3);
    }
    for (episode, (record, report)) in records.iter().zip(&reports).enumerate() {
        let of_episode = round.ticks.iter().filter(|tick| tick.episode as usize == episode).count();
        assert_eq!((record.samples, record.lot.as_str()), (of_episode, "bent lane"));
        assert_eq!(
            (record.near_collisions, record.driven_m),
            (report.metrics.near_collisions, report.metrics.driven_m)
        );
    }
}

/// Whatever a rule needs besides the network is trained, written and read back; rounds are thinned to equal samples. How long
/// it takes was estimated, and reported, as if the network were all.
#[test]
fn every_rule_of_the_family_trains_and_its_round_is_driven_again_as_it_was() {
    for name in ["vanilla", "safe_dagger", "ensemble_dagger", "hg_dagger", "lazy_dagger", "thrifty_dagger"] {
        let folder = scratch(name);
        let rule = DecisionRule::named(name).unwrap();
        let keep = Keep::EveryTick;
        let mut settings = DaggerSettings { rule, keep, iterations_max: 1, samples_per_round: 150, ..settings() };
        settings.network.modes = 2;
        let mut shares = Vec::new();
        let mut watch = |progress: &Progress<'_>| {
            if let Progress::Fitting { round: Some(1), share, .. } = progress {
                shares.push(*share);
            }
            ControlFlow::Continue(())
        };
        let outcome = run_in(&folder, &settings, &mut watch).unwrap();
        let is_done = shares.last().is_some_and(|last| (last - 1.0).abs() < 1e-9);
        assert!(is_done && shares.is_sorted(), "{name}: {shares:?}");
        let store = Store::open(&folder).unwrap();
        let (stored, about) = store.read_round(1).unwrap();
        let in_episodes: usize = about.episodes.iter().map(|episode| episode.samples).sum();
        assert_eq!((stored.samples.len(), in_episodes, outcome.rows[1].samples), (150, 150, 150), "{name}");
        let effort = about.effort.unwrap();
        assert_eq!(effort.expert_ticks, about.ticks - about.novice_ticks, "{name}");
        assert!(effort.interventions <= effort.expert_ticks && effort.queries <= about.ticks, "{name}: {effort:?}");
        if name == "vanilla" {
            // In round 1 the expert drives a tick with probability ½; in round 0 it would always.
            let share = about.novice_ticks as f64 / about.ticks as f64;
            assert!((0.4..0.6).contains(&share), "{share} of {} ticks", about.ticks);
        }
        let agreement = about.agreement.unwrap();
        assert_eq!(agreement.tau, f64::from(rule.tau().unwrap_or(PAPER_TAU)), "{name}");
        // A quarter of the ticks is at or below the first of the quantiles.
        let [first_quarter, ..] = agreement.tau_hat_quantiles;
        assert_eq!(agreement.within_tau >= 0.25, first_quarter < agreement.tau, "{name}: {agreement:?}");
        let parts = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
        let is_of_round = |part: &PathBuf| part.file_name().unwrap().to_string_lossy().starts_with("round-01");
        let mut trained: Vec<u32> =
            parts.filter(is_of_round).map(|part| FitReport::read(&part).unwrap().unwrap().steps).collect();
        trained.sort_unstable_by_key(|&steps| Reverse(steps));
        let planned: Vec<u32> = settings.fits_of_round(1).iter().map(|fit| fit.steps(0)).collect();
        assert_eq!((trained, planned.len()), (planned.clone(), rule.networks()), "{name}");
        // What a critic predicts has no sides.
        let modes_of = |part: &Path| Checkpoint::load(part).unwrap().weights.architecture().modes;
        assert_eq!(modes_of(&store.round_folder(1)), 2, "{name}");
        let critic = critic_folder(&store, 1);
        assert_eq!(Checkpoint::exists(&critic).unwrap(), rule.critic().is_some(), "{name}");
        assert!(rule.critic().is_none() || modes_of(&critic) == 1, "{name}");
        let novice = Learned::of_round(&settings, &store, 1).unwrap();
        let again =
            Rollouts::of_round(&settings, RootSeed(6), Some(&novice), of_round(1, 2)).drive(&mut |_, _| {}).unwrap();
        assert_eq!(
            (again.n_net, again.effort, again.agreement),
            (about.novice_ticks, effort, Some(agreement)),
            "{name}"
        );
        std::fs::remove_dir_all(folder).unwrap();
    }
}

/// The control: the expert drives on, and nothing but the amount of data differs from behaviour cloning.
#[test]
fn without_control_by_the_network_the_expert_is_never_interrupted() {
    let folder = scratch("control");
    let settings = DaggerSettings { rule: DecisionRule::ExpertOnly, iterations_max: 1, ..settings() };
    let outcome = run_in(&folder, &settings, &mut go_on).unwrap();
    let row = &outcome.rows[1];
    let effort = row.effort.unwrap();
    assert_eq!((row.eta_hat, effort.interventions), (Some(0.0), 2), "one per drive");
    assert_eq!((effort.queries, effort.expert_ticks), (row.samples as u64, row.samples as u64));
    assert!(row.agreement.is_some(), "the network answers, though nobody follows it");
    std::fs::remove_dir_all(folder).unwrap();
}

/// Put back onto the route, the car begins anew: whoever drives then has taken the wheel.
#[test]
fn an_expert_that_drives_on_after_a_reset_has_taken_the_wheel_again() {
    let settings = DaggerSettings { rule: DecisionRule::ExpertOnly, ..settings() };
    let pillar = Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(18.0, 1.0), 0.0));
    let weights = Weights::init(settings.network, RootSeed(3), 0);
    let checkpoint = Checkpoint { weights, conditions: conditions(), inference: settings.inference };
    let episodes = seated(1, episodes_among(2, vec![pillar]));
    let rollouts = Rollouts::of_round(&settings, RootSeed(6), Some(&Learned::alone(checkpoint)), episodes);
    let mut resets = 0;
    let collected = rollouts
        .drive(&mut |_, frame| resets += u64::from(matches!(frame.event, Event::NearCollision { .. })))
        .unwrap();
    assert!(resets > 0, "the route leads past the pillar");
    assert_eq!(collected.effort.interventions, 2 + resets);
}

/// Nor do the sensors of noise augmentations repeat what was seen before the car was put back.
#[test]
fn augmented_grids_after_a_reset_show_the_new_place() {
    let settings = DaggerSettings { noise_augmentations: 1, ..settings() };
    let noise = NoiseSettings { dropout: 1000.0, ..NoiseSettings::of(NoiseLevel::Paper) };
    let pillar = Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(18.0, 1.0), 0.0));
    let episodes = episodes_with(EpisodeSettings { noise, ..EpisodeSettings::paper() }, 1, vec![pillar]);
    let mut resets = Vec::new();
    let mut tick = 0;
    let mut watch = |_: usize, frame: &Frame| {
        tick += 1;
        if matches!(frame.event, Event::NearCollision { .. }) {
            resets.push(tick);
        }
    };
    // Behaviour cloning: every tick is kept.
    let collected = Rollouts::of_round(&settings, RootSeed(6), None, seated(0, episodes)).drive(&mut watch).unwrap();
    let grids = &collected.round.noise_augmentations;
    let first = resets[0];
    assert!(grids[..first].iter().all(|grid| *grid == grids[0]), "every frame is dropped");
    assert_ne!(grids[first], grids[0], "the pillar is behind the car");
}

/// A network that answers every grid with one point: all of its weights are 0 but the last biases.
fn constant(mean: [f32; 2]) -> Learned {
    let mut weights = Weights::zeros(settings().network);
    weights.parts_mut().fc2_bias.copy_from_slice(&[mean[0], mean[1], -4.6, -4.6]);
    Learned::alone(Checkpoint { weights, conditions: conditions(), inference: InferenceSettings::plain() })
}

/// An episode of two seconds.
fn short_episode() -> Vec<Episode> {
    let mut settings = EpisodeSettings::paper();
    settings.metrics.timeout_s = 2.0;
    episodes_with(settings, 1, Vec::new())
}

/// Points at the corner of the patch that is nearest to the right of the car.
struct AtTheCorner;

impl Driver for AtTheCorner {
    fn decide(&mut self, _: &Situation<'_>) -> Decision {
        let look_ahead = LookAheadPoint::from_image_fraction([1.0, 1.0], &GridGeometry::paper());
        Decision { look_ahead, source: Source::Expert, spread: None, speed_limit_mps: None }
    }
}

/// Opposite corners of the image are √2 apart: what is stored, for the weight, is clipped to 1; what is compared with τ, added
/// up and counted is not.
#[test]
fn a_discrepancy_beyond_one_is_stored_as_one_and_counted_as_it_is() {
    let settings = DaggerSettings { rule: DecisionRule::TauOnly { tau: 1.2 }, noise_augmentations: 0, ..settings() };
    let mut drives = seated(1, short_episode());
    drives[0].expert = Box::new(AtTheCorner);
    let rollouts = Rollouts::of_round(&settings, RootSeed(6), Some(&constant([0.0, 0.0])), drives);
    let collected = rollouts.drive(&mut |_, _| {}).unwrap();
    let apart = 2.0_f64.sqrt();
    assert_eq!((collected.n_tot, collected.n_net), (40, 0), "√2 is not below 1.2");
    assert_eq!(collected.round.samples.len(), 40);
    assert!(collected.round.samples.iter().all(|sample| (sample.label, sample.tau_hat) == ([1.0, 1.0], 1.0)));
    let agreement = collected.agreement.unwrap();
    assert!(agreement.tau_hat_quantiles.iter().all(|tau_hat| (tau_hat - apart).abs() < 1e-5), "{agreement:?}");
    // 40 ticks of 50 ms.
    assert!((collected.driven_s - 2.0).abs() < 1e-6, "{} s", collected.driven_s);
    let per_s = collected.record(1).tau_hat_per_s();
    assert!((per_s - apart / 0.05).abs() < 1e-3, "{per_s} per second");
}

/// HG-DAgger and the rules of critics were counted as if they asked at every tick. Here nothing warns, so that the network
/// drives under them and nobody is asked.
#[test]
fn the_expert_is_asked_while_it_drives_by_those_who_do_not_compare_with_its_answer() {
    for (name, always) in [
        ("all_below", true),
        ("any_below_literal", true),
        ("tau_only", true),
        ("expert_only", true),
        ("vanilla", true),
        ("ensemble_dagger", true),
        ("safe_dagger", false),
        ("hg_dagger", false),
        ("lazy_dagger", false),
        ("thrifty_dagger", false),
    ] {
        let rule = DecisionRule::named(name).unwrap();
        let settings = DaggerSettings { rule, noise_augmentations: 0, ..settings() };
        let straight = constant([0.5, 0.4]);
        let rollouts = Rollouts::of_round(&settings, RootSeed(6), Some(&straight), seated(1, short_episode()));
        let collected = rollouts.drive(&mut |_, _| {}).unwrap();
        assert_eq!(collected.effort.queries, if always { collected.n_tot } else { 0 }, "{name}");
        assert!(always || collected.n_net == collected.n_tot, "{name}: {} of {}", collected.n_net, collected.n_tot);
    }
}

/// Algorithm 1 goes on while η̂ ≤ η; and one network that passes η at once still makes as many iterations as are asked for.
#[test]
fn iterations_go_on_until_eta_is_passed_and_there_are_enough() {
    let of = |name: &str, eta: f64, iterations_min: u32| {
        let folder = scratch(name);
        let settings = DaggerSettings {
            eta,
            iterations_min,
            // The network always drives: η̂ = 1.
            rule: DecisionRule::TauOnly { tau: 2.0 },
            keep: Keep::EveryTick,
            noise_augmentations: 0,
            ..settings()
        };
        let outcome = run_in(&folder, &settings, &mut go_on).unwrap();
        std::fs::remove_dir_all(folder).unwrap();
        (outcome.stop, outcome.rows.len())
    };
    // Behaviour cloning and two iterations.
    assert_eq!(of("eta-met", 1.0, 1), (Stop::IterationCap, 3), "1 is not more than 1");
    assert_eq!(of("enough-iterations", 0.999, 2), (Stop::EtaReached, 3));
}

/// The same stream for all of them would make copies, and the data set no richer.
#[test]
fn noise_augmentations_of_a_sample_have_noise_of_their_own() {
    let settings = DaggerSettings { noise_augmentations: 2, ..settings() };
    let rollouts = Rollouts::of_round(&settings, RootSeed(6), None, of_round(0, 1));
    let round = rollouts.drive(&mut |_, _| {}).unwrap().round;
    let pairs = round.noise_augmentations.as_chunks::<2>().0;
    assert_eq!(pairs.len(), round.samples.len());
    let differ = pairs.iter().filter(|[one, other]| one != other).count();
    assert!(4 * differ > pairs.len(), "{differ} of {} pairs", pairs.len());
}

/// Has the expert drive, and counts how often it is told to forget.
struct Forgetting(Arc<AtomicU32>);

impl Gate for Forgetting {
    fn trusts_novice(&mut self, _: &GateTick<'_>) -> bool {
        false
    }

    fn reset(&mut self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// Follows the route, and counts how often it is told to forget.
struct ForgettingExpert(Arc<AtomicU32>);

impl Driver for ForgettingExpert {
    fn decide(&mut self, situation: &Situation<'_>) -> Decision {
        RouteFollower.decide(situation)
    }

    fn reset(&mut self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// A rule that remembered who had the wheel before would begin there with the expert.
#[test]
fn rule_and_expert_forget_the_past_when_the_car_is_put_back() {
    let pillar = Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(18.0, 1.0), 0.0));
    let forgot = [(); 2].map(|()| Arc::new(AtomicU32::new(0)));
    let [of_rule, of_expert] = forgot.each_ref().map(Arc::clone);
    let seat =
        CollectorSeat::new(Box::new(ForgettingExpert(of_expert)), Box::new(Forgetting(of_rule)), Vec::new(), None);
    let novice = constant([0.5, 0.4]).novice();
    let mut collector = GatedCollector::new(Some(novice), None, Keep::ExpertTicks, conditions().geometry(), vec![seat]);
    let reports = run_lockstep(episodes_among(1, vec![pillar]), &mut collector, &mut |_, _| {}).unwrap();
    let put_back = reports[0].metrics.near_collisions;
    assert!(put_back > 0 && reports[0].metrics.stuck == 0, "the route leads past the pillar: {reports:?}");
    // An episode begins with a reset as well.
    assert_eq!(forgot.map(|count| count.load(Ordering::Relaxed)), [1 + put_back; 2]);
}
