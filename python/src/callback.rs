//! Functions in Python as drivers: asked for all cars of a batch at once.

use crate::arrays::pairs;
use experiment::drivers::Callback;
use experiment::progress::{Elapsed, Progress};
use numpy::{PyArray, PyArrayMethods as _};
use pyo3::prelude::*;
use sim::driver::{Decision, Fleet, LookAheadPoint, Seat, Source};
use sim::sensing::GRID_CELLS;
use std::sync::{Arc, Mutex, PoisonError};

/// The first exception: the loop has no room for one, so it is cancelled and this is raised afterwards.
#[derive(Debug, Clone, Default)]
pub(crate) struct Failure(Arc<Mutex<Option<PyErr>>>);

impl Failure {
    pub(crate) fn note(&self, error: PyErr) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }

    fn is_noted(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// The exception, if there was one.
    pub(crate) fn take(&self) -> Option<PyErr> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// A function `(grids, cars, was_reset) -> points`: uint8 [n, 25, 25], int64 [n], bool [n] → float32 [n, 2].
pub(crate) struct Function {
    pub(crate) function: Py<PyAny>,
    pub(crate) failure: Failure,
}

impl Callback for Function {
    fn fleet(&self, _cars: usize) -> Box<dyn Fleet + Send> {
        let function = Python::attach(|py| self.function.clone_ref(py));
        Box::new(Self { function, failure: self.failure.clone() })
    }
}

impl Function {
    fn ask(&self, py: Python<'_>, seats: &[Seat<'_>]) -> PyResult<Vec<[f32; 2]>> {
        let n = seats.len();
        let cells: Vec<u8> = seats.iter().flat_map(|seat| seat.situation.observation.grid.cells()).collect();
        let grids = PyArray::from_vec(py, cells).reshape([n, GRID_CELLS, GRID_CELLS])?;
        let cars = PyArray::from_vec(py, seats.iter().map(|seat| seat.episode as i64).collect());
        let was_reset = PyArray::from_vec(py, seats.iter().map(|seat| seat.was_reset).collect());
        pairs(&self.function.bind(py).call1((grids, cars, was_reset))?, n, |_| true)
    }
}

impl Fleet for Function {
    fn decide(&mut self, seats: &[Seat<'_>], decisions: &mut Vec<Decision>) {
        let answers = if self.failure.is_noted() { None } else { Some(Python::attach(|py| self.ask(py, seats))) };
        let points = match answers {
            Some(Ok(points)) => points,
            Some(Err(error)) => {
                self.failure.note(error);
                Vec::new()
            }
            None => Vec::new(),
        };
        // After an exception the cars roll on until the loop is cancelled.
        let point = |seat: usize| points.get(seat).copied().unwrap_or([8.0, 0.0]);
        decisions.extend((0..seats.len()).map(|seat| {
            let [ahead_m, left_m] = point(seat);
            let look_ahead = LookAheadPoint { ahead_m, left_m };
            Decision { look_ahead, source: Source::Novice, spread: None, speed_limit_mps: None }
        }));
    }
}

/// Cancels at an exception and at Ctrl-C.
#[derive(Debug)]
pub(crate) struct Watch {
    pub(crate) failure: Failure,
}

impl Progress for Watch {
    fn begin(&self, _: &'static str, _: &str) {}

    fn at(&self, _: f64, _: &mut dyn FnMut(Elapsed) -> String) {}

    fn end(&self, _: &str) {}

    fn is_cancelled(&self) -> bool {
        if let Err(signal) = Python::attach(|py| py.check_signals()) {
            self.failure.note(signal);
        }
        self.failure.is_noted()
    }
}
