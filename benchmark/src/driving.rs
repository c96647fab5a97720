//! The closed loop: control steps per second.

use crate::{Effort, Goal, NETWORK, Report, on_threads, rate, ratio};
use experiment::drive;
use experiment::drivers::DriverSpec;
use experiment::lots::Lot;
use experiment::settings::{NoiseChoice, Settings};
use experiment::trials::{self, Purpose, Trial};
use expert::{ExpertSettings, ScriptedExpert};
use rayon::prelude::*;
use sim::batch::{SeatedFleet, run_fleets, run_lockstep};
use sim::driver::{Decision, Driver, Fleet, LookAheadPoint, OneDriverEach, Situation, Source};
use sim::episode::{self, Episode};
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::{RootSeed, Stream};
use std::sync::Arc;

/// Cars of a fleet.
const FLEET: usize = 32;

/// What every driver here does.
const NUMBERS: &str = "it answers with finite numbers";

/// Steers at the middle of the lane: as cheap as a driver can be that gets there.
#[derive(Debug, Clone, Copy)]
struct Centred;

impl Driver for Centred {
    fn decide(&mut self, situation: &Situation<'_>) -> Decision {
        let truth = &situation.truth;
        let ahead = truth.map.path().pose_at(truth.progress_m + 6.0).position();
        let in_ego = truth.vehicle.pose.world_from_ego().inverse_point(ahead);
        let look_ahead = LookAheadPoint { ahead_m: in_ego.x, left_m: in_ego.y };
        Decision { look_ahead, source: Source::Planner, spread: None, speed_limit_mps: None }
    }

    fn reset(&mut self) {}
}

/// Trials on the three reference lots, both ways, and their maps.
struct Course {
    settings: Settings,
    lots: Vec<Lot>,
    maps: Vec<Arc<Map>>,
}

impl Course {
    fn new() -> anyhow::Result<Self> {
        let settings = Settings::preset("default")?;
        let lots = Lot::parse_all(&["lot-a", "lot-b", "lot-c"], &settings.episode.vehicle)?;
        let mut course = Self { settings, lots, maps: Vec::new() };
        course.maps = trials::maps(&course.trials(), &course.settings.episode)?;
        Ok(course)
    }

    fn trials(&self) -> Vec<Trial<'_>> {
        let both = &[Direction::Forward, Direction::Reverse];
        Trial::all(RootSeed(1), Purpose::Evaluation, &self.lots, FLEET as u32 / 6 + 1, both).take(FLEET).collect()
    }

    fn episodes(&self) -> Vec<Episode> {
        drive::start(&self.trials(), &self.maps, &self.settings.episode, NoiseChoice::Paper)
    }

    /// Control steps in lock-step, all together: of fleets of up to `cars_each` cars, as trials are driven.
    fn lock_step(&self, cars_each: usize, fleet: impl FnMut(&[usize]) -> Box<dyn Fleet + Send>) -> f64 {
        let mut steps = 0_u64;
        run_fleets(SeatedFleet::in_all(self.episodes(), cars_each, fleet), &mut |_, _| steps += 1).expect(NUMBERS);
        steps as f64
    }

    /// Control steps of drivers that each drive their episodes to the end, one after the other on every thread.
    fn by_episodes<D: Driver>(&self, driver: impl Fn() -> D + Sync) -> f64 {
        let steps = |episode: Episode| {
            let mut steps = 0_u64;
            episode::run(episode, &mut driver(), &mut |_: &sim::frame::Frame| steps += 1);
            steps
        };
        self.episodes().into_par_iter().map(steps).sum::<u64>() as f64
    }
}

/// Measures all of it.
///
/// # Errors
/// If a lot cannot be driven.
pub fn figures(effort: Effort, report: Report<'_>) -> anyhow::Result<()> {
    let course = Course::new()?;
    let steps = |what: &str, threads, goal, work: &mut (dyn FnMut() -> f64 + Send)| {
        on_threads(threads, || rate(effort, what, "steps/s", goal, work))
    };
    let one = steps("closed loop, cheap driver, one core", 1, Some(Goal::AtLeast(100_000.0)), &mut || {
        course.by_episodes(|| Centred)
    });
    report(one.clone());
    let two = steps("the same on two cores, by episodes", 2, None, &mut || course.by_episodes(|| Centred));
    report(ratio("two cores over one, by episodes", &two, &one, Goal::AtLeast(1.9)));
    report(two);
    let two = steps("the same on two cores, in lock-step", 2, None, &mut || {
        course.lock_step(1, |cars| Box::new(OneDriverEach(vec![Centred; cars.len()])))
    });
    report(ratio("two cores over one, in lock-step", &two, &one, Goal::AtLeast(1.9)));
    report(two);

    let settings = &course.settings;
    let network = NETWORK.parse::<DriverSpec>()?.load(settings)?;
    report(steps("one car with the network", 1, Some(Goal::AtLeast(15_000.0)), &mut || {
        let episodes = course.episodes().into_iter().take(1).collect();
        let mut steps = 0_u64;
        let mut fleet = network.seating(&settings.episode)(&[RootSeed(1)]);
        run_lockstep(episodes, &mut *fleet, &mut |_, _| steps += 1).expect(NUMBERS);
        steps as f64
    }));
    report(steps("fleet of 32 with the network, two cores", 2, Some(Goal::AtLeast(60_000.0)), &mut || {
        let seat = network.seating(&settings.episode);
        course.lock_step(network.cars_per_fleet(FLEET), |cars| seat(&vec![RootSeed(1); cars.len()]))
    }));
    report(steps("one car with the expert", 1, None, &mut || {
        let expert = || {
            ScriptedExpert::new(ExpertSettings::half_points(), &settings.episode, RootSeed(1).rng(Stream::Expert, 0))
        };
        let mut steps = 0_u64;
        let episode = course.episodes().swap_remove(0);
        episode::run(episode, &mut expert(), &mut |_: &sim::frame::Frame| steps += 1);
        steps as f64
    }));
    Ok(())
}
