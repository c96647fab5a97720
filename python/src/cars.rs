//! Many environments, stepped in parallel without the interpreter's lock.

use crate::arrays::{SeenArrays, Target, pairs, points};
use crate::car::{ACTION, ActionKind, Car, INFO, Outcome, Seen};
use crate::course::{Course, SettingsFrom};
use crate::guard::{EpisodeEnded, alone, detached, input, warn};
use crate::reward::Reward;
use numpy::{Ix2, PyArray, PyArray3, PyArrayMethods as _};
use pyo3::exceptions::{PyIndexError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::prelude::*;
use rayon::{Scope, ThreadPool, ThreadPoolBuilder};
use report::pictures::drawing::Drawing;
use report::pictures::grids;
use report::pictures::lot::{self, View};
use serde::Serialize;
use sim::episode::Episode;
use sim::frame::{Ending, Event};
use sim::geometry::Vec2;
use sim::limits::THREADS_MAX;
use sim::metrics::EpisodeMetrics;
use sim::seed::RootSeed;
use sim::sensing::GRID_CELLS;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Environments that step together at most; a car takes some kilobytes, and its lot more.
const COUNT_MAX: usize = 65_536;

/// When an episode that has ended is followed by the next (gymnasium's `AutoresetMode`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Autoreset {
    /// In the next step, whose action is ignored.
    NextStep,
    /// In the same step.
    SameStep,
    /// When it is reset.
    Disabled,
}

/// Environments on the lots, noise and settings of the command line.
///
/// Car i of n drives the episodes i, i + n, i + 2n, … of its seed; episode k is trial k // (lots * directions).
#[pyclass(module = "lotpilot._native")]
#[expect(clippy::struct_field_names, reason = "it holds cars")]
pub(crate) struct Cars {
    course: Course,
    cars: Vec<Car>,
    kind: ActionKind,
    autoreset: Autoreset,
    reward: Reward,
    threads: Threads,
}

/// A car, its action, where it writes what it sees now, and where what it saw last before a new episode.
type Stepped<'c, 's> = (((&'c mut Car, [f32; ACTION]), Seen<'s>), Option<Seen<'s>>);

/// Who steps the cars.
enum Threads {
    /// The caller's thread.
    Caller,
    /// One per core, shared with everything else in this process.
    AllCores,
    /// So many of their own.
    Own(ThreadPool),
}

impl Threads {
    fn new(py: Python<'_>, count: usize, threads: Option<usize>) -> PyResult<Self> {
        threads.map_or(Ok(()), check_threads)?;
        match threads {
            // These threads are of this process, and in none that is forked from it.
            Some(threads) if threads > 1 && count > 1 => detached(py, || {
                let pool = ThreadPoolBuilder::new().num_threads(threads).build();
                Ok(Self::Own(pool.map_err(|error| PyRuntimeError::new_err(error.to_string()))?))
            }),
            None if count > 1 => Ok(Self::AllCores),
            _ => Ok(Self::Caller),
        }
    }

    /// Does something to each, without the interpreter's lock; results come in order.
    fn each<T: Send, R: Send>(
        &self,
        py: Python<'_>,
        all: impl Iterator<Item = T>,
        work: impl Fn(T) -> PyResult<R> + Sync + Send,
    ) -> PyResult<Vec<R>> {
        let all: Vec<T> = all.collect();
        match self {
            Self::Caller => alone(py, || all.into_iter().map(work).collect()),
            Self::AllCores => detached(py, || all.into_par_iter().map(work).collect()),
            Self::Own(pool) => detached(py, || pool.install(|| all.into_par_iter().map(work).collect())),
        }
    }

    /// Does something to each that may take seconds, as [`Self::each`]. After Ctrl-C the rest is left as it was.
    fn each_unless_interrupted<T: Send>(
        &self,
        py: Python<'_>,
        all: impl Iterator<Item = T>,
        work: impl Fn(T) -> PyResult<()> + Sync + Send,
    ) -> PyResult<()> {
        let is_interrupted = AtomicBool::new(false);
        let work = |one| if is_interrupted.load(Ordering::Relaxed) { Ok(()) } else { work(one) };
        let all: Vec<T> = all.collect();
        match self {
            Self::Caller => alone(py, || all.into_iter().try_for_each(|one| signals().and_then(|()| work(one)))),
            // One of the threads would wait for itself, and is told of no signal anyway.
            Self::AllCores if rayon::current_thread_index().is_some() => {
                detached(py, || all.into_par_iter().try_for_each(work))
            }
            Self::AllCores => {
                detached(py, || rayon::in_place_scope(|scope| watched(scope, all, &work, &is_interrupted)))
            }
            Self::Own(pool) => {
                detached(py, || pool.in_place_scope(|scope| watched(scope, all, &work, &is_interrupted)))
            }
        }
    }
}

/// Lets the threads of a scope work while the caller asks for signals, of which Python tells its main thread alone.
fn watched<'scope, T: Send + 'scope>(
    scope: &Scope<'scope>,
    all: Vec<T>,
    work: &'scope (impl Fn(T) -> PyResult<()> + Sync),
    is_interrupted: &AtomicBool,
) -> PyResult<()> {
    let (done, results) = mpsc::channel();
    scope.spawn(move |_| drop(done.send(all.into_par_iter().try_for_each(work))));
    let mut interrupted = Ok(());
    loop {
        match results.recv_timeout(SIGNALS_EVERY) {
            Ok(result) => return interrupted.and(result),
            // A panic: the scope passes it on.
            Err(RecvTimeoutError::Disconnected) => return interrupted,
            Err(RecvTimeoutError::Timeout) if interrupted.is_ok() => {
                interrupted = signals();
                is_interrupted.store(interrupted.is_err(), Ordering::Relaxed);
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// Refuses so many threads.
pub(crate) fn check_threads(threads: usize) -> PyResult<()> {
    if (1..=usize::from(THREADS_MAX)).contains(&threads) {
        return Ok(());
    }
    Err(PyValueError::new_err(format!("threads: {threads} is not within 1 … {THREADS_MAX}")))
}

/// How long work goes on after Ctrl-C before it is noticed.
const SIGNALS_EVERY: Duration = Duration::from_millis(50);

/// What the interpreter's handlers of signals raise: after Ctrl-C, `KeyboardInterrupt`.
fn signals() -> PyResult<()> {
    Python::attach(|py| py.check_signals())
}

#[pymethods]
impl Cars {
    #[new]
    #[pyo3(signature = (count, *, lots, directions, trials, noise, settings, seed, action, autoreset, reward, threads, digests))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        py: Python<'_>,
        count: usize,
        lots: Vec<String>,
        directions: &str,
        trials: Option<u32>,
        noise: &str,
        settings: SettingsFrom,
        seed: u64,
        action: &str,
        autoreset: &str,
        reward: BTreeMap<String, f64>,
        threads: Option<usize>,
        digests: bool,
    ) -> PyResult<Self> {
        let wrong = |problem: String| Err(PyValueError::new_err(problem));
        if !(1..=COUNT_MAX).contains(&count) {
            return wrong(format!("{count} environments are not within 1 … {COUNT_MAX}"));
        }
        let kind = match action {
            "look_ahead" => ActionKind::LookAhead,
            "steering" => ActionKind::Steering,
            _ => return wrong(format!("no action {action:?}; there are look_ahead and steering")),
        };
        let autoreset = match autoreset {
            "next_step" => Autoreset::NextStep,
            "same_step" => Autoreset::SameStep,
            "disabled" => Autoreset::Disabled,
            _ => return wrong(format!("no autoreset {autoreset:?}; there are next_step, same_step and disabled")),
        };
        let course = alone(py, || Course::new(settings, &lots, directions, trials, noise).map_err(input))?;
        warn(py, &course.notes())?;
        let cars = (0..count as u64).map(|index| Car::new(RootSeed(seed), index, count as u64, digests)).collect();
        Ok(Self {
            course,
            cars,
            kind,
            autoreset,
            reward: Reward::of(reward).map_err(input)?,
            threads: Threads::new(py, count, threads)?,
        })
    }

    /// Names of the columns of `info`.
    #[classattr]
    #[pyo3(name = "INFO")]
    fn info() -> Vec<&'static str> {
        INFO.to_vec()
    }

    /// Lowest and highest useful action: ((a, b), (a, b)).
    fn action_bounds(&self) -> [[f32; ACTION]; 2] {
        let episode = &self.course.settings.episode;
        match self.kind {
            ActionKind::LookAhead => {
                let geometry = &episode.sensing.geometry;
                let aside_m = 0.5 * geometry.side_m;
                [[geometry.near_edge_ahead_m, -aside_m], [geometry.far_edge_ahead_m(), aside_m]]
            }
            ActionKind::Steering => {
                let steering_rad = episode.vehicle.steering_max_rad;
                [[-steering_rad, 0.0], [steering_rad, episode.controller.speed_max_mps]]
            }
        }
    }

    /// Lowest and highest state: ((speed, steering), (speed, steering)).
    fn state_bounds(&self) -> [[f32; 2]; 2] {
        let episode = &self.course.settings.episode;
        // The speed loop overshoots its fastest command a little.
        let (fastest_mps, steering_rad) = (2.0 * episode.controller.speed_max_mps, episode.vehicle.steering_max_rad);
        [[0.0, -steering_rad], [fastest_mps, steering_rad]]
    }

    /// Control period, seconds.
    fn control_period_s(&self) -> f32 {
        self.course.settings.episode.control_period_s()
    }

    /// Starts the next episodes of the cars in `mask` and writes what they see into `seen`. `seeds` and `numbers` say
    /// which episodes come first; cars without one continue. After Ctrl-C some may have started and others not.
    fn reset(
        &mut self,
        py: Python<'_>,
        mask: Vec<bool>,
        seeds: Option<Vec<Option<u64>>>,
        numbers: Option<Vec<Option<u64>>>,
        seen: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let n = self.cars.len();
        for (name, found) in [
            ("reset_mask", Some(mask.len())),
            ("seed", seeds.as_ref().map(Vec::len)),
            ("episode", numbers.as_ref().map(Vec::len)),
        ] {
            if let Some(found) = found.filter(|&found| found != n) {
                return Err(PyValueError::new_err(format!("{name}: {found} values for {n} environments")));
            }
        }
        let mut arrays = SeenArrays::of(seen, n)?;
        let rows = arrays.rows()?;
        for (index, car) in self.cars.iter_mut().enumerate().filter(|(index, _)| mask[*index]) {
            if let Some(seed) = seeds.as_ref().and_then(|seeds| seeds[index]) {
                (car.seed, car.next) = (RootSeed(seed), index as u64);
            }
            if let Some(number) = numbers.as_ref().and_then(|numbers| numbers[index]) {
                car.next = number;
            }
        }
        let Self { course, cars, threads, .. } = self;
        let reset = |((car, mut seen), mask): ((&mut Car, Seen<'_>), bool)| {
            if mask {
                car.reset(course).map_err(input)?;
            }
            car.write(&mut seen);
            Ok(())
        };
        threads.each_unless_interrupted(py, cars.iter_mut().zip(rows).zip(mask), reset)
    }

    /// Drives one control tick with every car. Writes what they see then into `seen`; under `same_step`, what ended
    /// episodes saw last goes into `last`.
    #[expect(clippy::too_many_arguments, reason = "one array each")]
    fn step(
        &mut self,
        py: Python<'_>,
        actions: &Bound<'_, PyAny>,
        seen: &Bound<'_, PyAny>,
        rewards: &Bound<'_, PyAny>,
        terminated: &Bound<'_, PyAny>,
        truncated: &Bound<'_, PyAny>,
        last: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let n = self.cars.len();
        if let Some(index) = self.cars.iter().position(|car| car.episode().is_none()) {
            return Err(EpisodeEnded::new_err(format!("environment {index} was never reset; call reset first")));
        }
        let waiting = self.cars.iter().position(|car| !car.is_driving());
        if let (Autoreset::Disabled, Some(index)) = (self.autoreset, waiting) {
            let problem = format!("the episode of environment {index} has ended; reset it before the next step");
            return Err(EpisodeEnded::new_err(problem));
        }
        let actions = pairs(actions, n, |index| self.cars[index].is_driving())?;
        let mut arrays = SeenArrays::of(seen, n)?;
        let rows = arrays.rows()?;
        let mut last = last.map(|last| SeenArrays::of(last, n)).transpose()?;
        let last: Vec<Option<Seen<'_>>> = match &mut last {
            Some(last) => last.rows()?.into_iter().map(Some).collect(),
            None => std::iter::repeat_with(|| None).take(n).collect(),
        };
        let mut rewards = Target::<f64>::of(rewards, "rewards", &[n])?;
        let mut terminated = Target::<bool>::of(terminated, "terminated", &[n])?;
        let mut truncated = Target::<bool>::of(truncated, "truncated", &[n])?;
        let outcomes = (rewards.values()?, terminated.values()?, truncated.values()?);

        let Self { course, cars, kind, autoreset, reward, threads } = self;
        let (kind, autoreset, reward) = (*kind, *autoreset, *reward);
        let step = |(((car, action), mut seen), last): Stepped<'_, '_>| {
            let mut outcome = Outcome::default();
            if car.is_driving() {
                outcome = car.step(kind, action, &reward, course);
                if autoreset == Autoreset::SameStep && !car.is_driving() {
                    if let Some(mut last) = last {
                        car.write(&mut last);
                    }
                    car.reset(course).map_err(input)?;
                }
            } else {
                car.reset(course).map_err(input)?;
            }
            car.write(&mut seen);
            Ok(outcome)
        };
        let stepped = threads.each(py, cars.iter_mut().zip(actions).zip(rows).zip(last), step)?;
        for (index, outcome) in stepped.into_iter().enumerate() {
            outcomes.0[index] = outcome.reward;
            outcomes.1[index] = outcome.terminated;
            outcomes.2[index] = outcome.truncated;
        }
        Ok(())
    }

    /// The expert's actions now, float32 [n, 2]; NaN where the episode has ended.
    fn expert_actions<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyArray<f32, Ix2>>> {
        let Self { course, cars, kind, threads, .. } = self;
        let (kind, course) = (*kind, &*course);
        let label = |car: &mut Car| Ok(car.label(kind, course).unwrap_or([f32::NAN; ACTION]));
        points(py, threads.each(py, cars.iter_mut(), label)?)
    }

    /// Where the route is `ahead_m` further on, in the frame of the rear axle, float32 [n, 2]: ahead and left, metres.
    fn route_points<'py>(&self, py: Python<'py>, ahead_m: f32) -> PyResult<Bound<'py, PyArray<f32, Ix2>>> {
        if !ahead_m.is_finite() {
            return Err(PyValueError::new_err(format!("ahead_m: {ahead_m} is not a finite number")));
        }
        points(py, self.cars.iter().map(|car| car.route_point(ahead_m).unwrap_or([f32::NAN; 2])))
    }

    /// Lot, direction, trial and seed of every car's episode: what the command line names it by.
    fn places(&self) -> Vec<(String, &'static str, u32, u64)> {
        let place = |car: &Car| {
            let (seed, number) = car.place();
            let trial = self.course.trial(seed, number);
            (trial.lot.spec(), trial.direction.name(), trial.index, seed.0)
        };
        self.cars.iter().map(place).collect()
    }

    /// Number of lots that are driven.
    fn lot_count(&self) -> usize {
        self.course.lot_count()
    }

    /// What was measured on a car's episode so far, as JSON; `ending` is null while it is under way.
    fn report(&self, index: usize) -> PyResult<String> {
        /// As [`EpisodeReport`](sim::episode::EpisodeReport), before the end as well.
        #[derive(Serialize)]
        struct Report<'a> {
            ending: Option<Ending>,
            metrics: EpisodeMetrics,
            events: &'a [(u32, Event)],
        }
        let episode = self.episode(index)?;
        let (ending, metrics, events) = (episode.ending(), episode.metrics(), episode.events());
        serde_json::to_string(&Report { ending, metrics, events }).map_err(input)
    }

    /// SHA-256 of a car's episode so far, if digests are kept.
    fn digest(&self, index: usize) -> PyResult<Option<String>> {
        self.episode(index)?;
        Ok(self.cars[index].digest())
    }

    /// The lot around a car and the grid that it sees, uint8 [side_px, 2 * side_px, 3].
    fn picture<'py>(&self, py: Python<'py>, index: usize, side_px: u16) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let episode = self.episode(index)?;
        let point = self.cars[index].last().map(|frame| frame.decision.look_ahead);
        let side_px = f32::from(side_px);
        let drawn = alone(py, || {
            let (vehicle, geometry) = (&episode.settings().vehicle, &episode.settings().sensing.geometry);
            let (map, pose) = (episode.map(), episode.vehicle().pose);
            let view = View::around(pose.position() + 4.0 * pose.ahead(), 40.0, side_px);
            let mut picture = Drawing::new(Vec2::new(2.0 * side_px, side_px), lot::GROUND).map_err(input)?;
            let mut above = Drawing::new(Vec2::splat(side_px), lot::GROUND).map_err(input)?;
            lot::draw_ground(&mut above, &view, map);
            lot::draw_obstacles(&mut above, &view, map);
            lot::draw_finish(&mut above, &view, map);
            lot::draw_car(&mut above, &view, vehicle, pose, lot::ROUTE, 3.0);
            picture.inset(above, Vec2::ZERO);
            let cell_px = (side_px / GRID_CELLS as f32).floor();
            let grid = &episode.situation().observation.grid;
            let mut grid = grids::grid(grid, cell_px, |_, _| None).map_err(input)?;
            if let Some(point) = point {
                grids::draw_prediction(&mut grid, point, None, geometry);
            }
            picture.inset(grid, Vec2::new(side_px, 0.0));
            Ok(picture.pixmap())
        })?;
        let rgb: Vec<u8> = drawn.data().chunks_exact(4).flat_map(|rgba| [rgba[0], rgba[1], rgba[2]]).collect();
        PyArray::from_vec(py, rgb).reshape([drawn.height() as usize, drawn.width() as usize, 3])
    }
}

impl Cars {
    fn episode(&self, index: usize) -> PyResult<&Episode> {
        let car = self.cars.get(index);
        let car = car.ok_or_else(|| PyIndexError::new_err(format!("no environment {index} of {}", self.cars.len())))?;
        car.episode()
            .ok_or_else(|| EpisodeEnded::new_err(format!("environment {index} was never reset; call reset first")))
    }
}
