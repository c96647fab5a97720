//! The same episodes in Rust alone: how fast they are, and their results.

use crate::cars::check_threads;
use crate::course::{Course, SettingsFrom};
use crate::guard::{detached, input};
use experiment::drive::TrialBatch;
use experiment::drive_digest::DriveDigest;
use experiment::drivers::{DriverSpec, NamedDriver};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use sim::batch::{SeatedFleet, run_fleets_until};
use sim::driver::{Decision, Driver, LookAheadPoint, OneDriverEach, Situation, Source};
use sim::episode::Episode;
use sim::seed::RootSeed;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Steers at the middle of the lane: as cheap as a driver can be that gets there. The Python side of the benchmark does
/// the same with `Cars.route_points`.
#[derive(Debug, Clone, Copy)]
struct Centred {
    ahead_m: f32,
}

impl Driver for Centred {
    fn decide(&mut self, situation: &Situation<'_>) -> Decision {
        let truth = &situation.truth;
        let ahead = truth.map.path().pose_at(truth.progress_m + self.ahead_m).position();
        let in_ego = truth.vehicle.pose.world_from_ego().inverse_point(ahead);
        let look_ahead = LookAheadPoint { ahead_m: in_ego.x, left_m: in_ego.y };
        Decision { look_ahead, source: Source::Novice, spread: None, speed_limit_mps: None }
    }
}

/// The closed loop in Rust alone: the first `count` episodes again and again, steered at the route `ahead_m` further on.
///
/// Tick by tick, all cars of a thread have one driver, as those of a network: each tick is driven with every car before the
/// next. Otherwise each car has its own, as those of planners, and drives several ticks before the next car.
#[pyclass(module = "lotpilot._native")]
pub(crate) struct RustLoop {
    episodes: Vec<Episode>,
    ahead_m: f32,
    cars_each: usize,
    pool: ThreadPool,
}

#[pymethods]
impl RustLoop {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        py: Python<'_>,
        count: u64,
        lots: Vec<String>,
        trials: u32,
        noise: &str,
        settings: SettingsFrom,
        ahead_m: f32,
        threads: usize,
        tick_by_tick: bool,
    ) -> PyResult<Self> {
        check_threads(threads)?;
        let course = Course::new(settings, &lots, "both", Some(trials), noise).map_err(input)?;
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        let start = |number| course.start(RootSeed(1), number).map_err(input);
        let episodes = detached(py, || (0..count).map(start).collect::<PyResult<Vec<_>>>())?;
        let cars_each = if tick_by_tick { episodes.len().div_ceil(threads) } else { 1 };
        Ok(Self { episodes, ahead_m, cars_each, pool })
    }

    /// Drives for some seconds; returns the number of control steps.
    #[expect(clippy::disallowed_methods, reason = "a benchmark; nothing computed depends on it")]
    fn drive(&self, py: Python<'_>, seconds: f64) -> PyResult<u64> {
        let Self { episodes, ahead_m, cars_each, pool } = self;
        let drive = || {
            let (started, limit) = (Instant::now(), Duration::from_secs_f64(seconds));
            let mut steps = 0_u64;
            while started.elapsed() < limit {
                let seat = |cars: &[usize]| OneDriverEach(vec![Centred { ahead_m: *ahead_m }; cars.len()]);
                let fleet = |cars: &[usize]| Box::new(seat(cars)) as Box<_>;
                let fleets = SeatedFleet::in_all(episodes.clone(), *cars_each, fleet);
                let driven = run_fleets_until(fleets, &mut |_, _| {
                    steps += 1;
                    let is_over = steps.is_multiple_of(1024) && started.elapsed() >= limit;
                    if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                });
                driven.map_err(input)?;
            }
            Ok(steps)
        };
        detached(py, || pool.install(drive))
    }
}

/// SHA-256 of an episode as `cargo xtask evaluate` drives it with a named driver.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub(crate) fn drive_digest(
    py: Python<'_>,
    driver: &str,
    lots: Vec<String>,
    directions: &str,
    noise: &str,
    settings: SettingsFrom,
    seed: u64,
    number: u64,
) -> PyResult<String> {
    let course = Course::new(settings, &lots, directions, None, noise).map_err(input)?;
    detached(py, || {
        let driver: NamedDriver =
            driver.parse::<DriverSpec>().and_then(|spec| spec.load(&course.settings)).map_err(input)?;
        let (trial, map) = (course.trial(RootSeed(seed), number), course.map(RootSeed(seed), number).map_err(input)?);
        let noise = crate::course::noise(noise).map_err(input)?;
        let episode = &course.settings.episode;
        let batch =
            TrialBatch { episode, driver: &driver, trials: &[trial], maps: &[map], noise, seed: RootSeed(seed) };
        let mut digest = DriveDigest::default();
        batch
            .drive(&mut |_, frame| {
                digest.frame(frame);
                ControlFlow::Continue(())
            })
            .map_err(input)?;
        Ok(digest.hex())
    })
}
