use super::*;
use crate::incidents::{self, Cause};
use experiment::drivers::Callback;
use experiment::lots::Lot;
use experiment::trials::{Purpose, Trial};
use sim::driver::{Decision, Fleet, LookAheadPoint, Seat, Source};
use sim::geometry::{Pose, wrap_angle};
use sim::scenario::Direction;
use sim::seed::RootSeed;
use sim::vehicle::VehicleState;

/// A near-collision 2 m farther on, before which the car was always in this state.
fn incident(vehicle: VehicleState, progress_m: f32) -> Incident {
    let before = |before_s| Before { vehicle, progress_m, before_s, refractory_s: 0.0 };
    Incident {
        episode: 0,
        tick: 500,
        at: Pose::default(),
        route_m: progress_m + 2.0,
        speed_mps: 1.0,
        reversals_before: 0,
        since_resume_m: None,
        before: LOOK_BACKS_S.map(before),
    }
}

/// Always straight on.
struct Straight;

impl Fleet for Straight {
    fn decide(&mut self, seats: &[Seat<'_>], decisions: &mut Vec<Decision>) {
        let look_ahead = LookAheadPoint { ahead_m: 8.0, left_m: 0.0 };
        let straight = Decision { look_ahead, source: Source::Novice, spread: None, speed_limit_mps: None };
        decisions.extend(seats.iter().map(|_| straight));
    }
}

impl Callback for Straight {
    fn fleet(&self, _: usize) -> Box<dyn Fleet + Send> {
        Box::new(Straight)
    }
}

/// The expert passes whatever is replaced: it looks neither at the grid nor at the clock. Who always goes straight on does
/// not pass a bend until the expert takes the wheel. Turned to a wall, nobody passes.
#[test]
fn what_is_passed_depends_on_who_drives_on_and_from_where() {
    let settings = Settings::preset("smoke").unwrap();
    let lots = Lot::parse_all(&["lot-b"], &settings.episode.vehicle).unwrap();
    let trials: Vec<Trial<'_>> =
        Trial::all(RootSeed(1), Purpose::Evaluation, &lots, 1, &[Direction::Forward]).collect();
    let maps = trials::maps(&trials, &settings.episode).unwrap();
    let expert = NamedDriver::expert(&settings.expert);
    let (episode, seed) = (&settings.episode, RootSeed(1));
    let batch = TrialBatch { episode, driver: &expert, trials: &trials, maps: &maps, noise: NoiseChoice::Paper, seed };

    // Before the first bend of lot b.
    let bend_m = (0..100_u8).map(f32::from).find(|&s_m| {
        let turn_rad = wrap_angle(maps[0].path().pose_at(s_m + 5.0).heading_rad - maps[0].start().heading_rad);
        turn_rad.abs() > 1.0
    });
    let bend_m = bend_m.unwrap();
    let mut met = None;
    let driven = batch.drive(&mut |_, frame| {
        assert_eq!(frame.event, Event::Drove, "a seed on which the expert drives well");
        if frame.progress_m < bend_m {
            return ControlFlow::Continue(());
        }
        met = Some((frame.vehicle, frame.progress_m));
        ControlFlow::Break(())
    });
    driven.unwrap();
    let (vehicle, progress_m) = met.unwrap();
    let heading_rad = vehicle.pose.heading_rad + std::f32::consts::FRAC_PI_2;
    let across = VehicleState::at_rest(Pose { heading_rad, ..vehicle.pose });
    let incidents = [incident(vehicle, progress_m), incident(across, progress_m)];
    let straight = NamedDriver::callback("straight", Arc::new(Straight));
    for replaced in Substitution::all() {
        let passed = |driver| {
            let batch = TrialBatch { driver, ..batch };
            Substitutes::new(driver, &settings).passes(&batch, &incidents, replaced).unwrap()
        };
        assert_eq!(passed(&expert), [true, false], "{}", replaced.name());
        let is_expert = matches!(replaced, Substitution::ExpertOfPatch | Substitution::Expert(_));
        assert_eq!(passed(&straight), [is_expert, false], "{}", replaced.name());
    }

    // What passes with the noise as well is not put down to it, and each verdict stands by its near-collision.
    let [passed, across] = incidents;
    let explained = incidents::explain(&batch, &[passed, across, passed]).unwrap();
    let found: Vec<_> = explained.iter().map(|(_, found)| (found.passes_on_clean_grid, found.passes_again)).collect();
    assert_eq!(found, [(Some(true), Some(true)), (Some(false), None), (Some(true), Some(true))]);
    assert!(explained.iter().all(|(cause, _)| *cause != Cause::NoiseInduced), "{explained:?}");
}

/// A car that was put back close to something counts nothing for a second; driven on from there, it counted at once.
#[test]
fn what_is_left_of_the_time_in_which_nothing_counts_holds_when_driven_on() {
    let settings = Settings::preset("smoke").unwrap();
    let lots = Lot::parse_all(&["lot-b"], &settings.episode.vehicle).unwrap();
    let trials: Vec<Trial<'_>> =
        Trial::all(RootSeed(1), Purpose::Evaluation, &lots, 1, &[Direction::Forward]).collect();
    let maps = trials::maps(&trials, &settings.episode).unwrap();
    let straight = NamedDriver::callback("straight", Arc::new(Straight));
    let (episode, seed, noise) = (&settings.episode, RootSeed(1), NoiseChoice::Clean);
    let batch = TrialBatch { episode, driver: &straight, trials: &trials, maps: &maps, noise, seed };
    // Along the edge of the lane, which is 2.7 to 3 m wide: 2 m off its middle the body reaches across it.
    let on_route = maps[0].path().pose_at(10.0);
    let on_edge = Pose::new(on_route.position() + 2.0 * on_route.ahead().perp(), on_route.heading_rad);
    let counts = incident(VehicleState::at_rest(on_edge), 10.0);
    let mut counts_nothing = counts;
    // As long as the drive lasts.
    counts_nothing.before.iter_mut().for_each(|before| before.refractory_s = 100.0);
    assert_eq!(passes(&batch, &[counts, counts_nothing], LOOK_BACK).unwrap(), [false, true]);
}

/// It was a panic: incidents are driven on from in chunks of as many as there are trials.
#[test]
fn of_no_trials_nothing_is_driven_on() {
    let settings = Settings::preset("smoke").unwrap();
    let expert = NamedDriver::expert(&settings.expert);
    let (episode, seed, noise) = (&settings.episode, RootSeed(1), NoiseChoice::Paper);
    let batch = TrialBatch { episode, driver: &expert, trials: &[], maps: &[], noise, seed };
    assert!(passes(&batch, &[], LOOK_BACK).unwrap().is_empty());
}
