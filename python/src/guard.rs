//! No panic leaves this library, nothing waits for threads that are not there, and errors are Python's.

use pyo3::exceptions::{PyRuntimeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use std::any::Any;
use std::ffi::CString;
use std::ops::RangeInclusive;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;

pyo3::create_exception!(
    lotpilot,
    EpisodeEnded,
    PyRuntimeError,
    "An environment was stepped after its episode had ended."
);

/// Bad input.
pub(crate) fn input(error: impl Into<anyhow::Error>) -> PyErr {
    PyValueError::new_err(storage::shortened(&format!("{:#}", error.into()), storage::ERROR_CHARS_MAX))
}

/// A whole number, as `check_whole` in Python takes it: pyo3 refuses those that do not fit their type with an `OverflowError`.
///
/// # Errors
/// If it is none, or out of range.
pub(crate) fn whole(what: &str, given: &Bound<'_, PyAny>, within: RangeInclusive<u64>) -> PyResult<u64> {
    let number = given.extract::<u64>().ok().filter(|number| within.contains(number));
    number.ok_or_else(|| {
        let (given, least, most) =
            (given.repr().map_or_else(|_| "it".to_owned(), |repr| repr.to_string()), within.start(), within.end());
        PyValueError::new_err(format!("{what}: {given} is not a whole number within {least} … {most}"))
    })
}

/// Says notes as warnings of the caller in Python.
///
/// # Errors
/// If the caller turns warnings into errors.
pub(crate) fn warn(py: Python<'_>, notes: &[String]) -> PyResult<()> {
    for note in notes {
        let note = CString::new(note.as_str())?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &note, 1)?;
    }
    Ok(())
}

/// Works without the interpreter's lock, in threads.
///
/// # Errors
/// Those of the work; a panic, which is a bug of lotpilot; a process that was forked after the threads had started: they
/// are not in the child, and it would wait for them forever.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> PyResult<T> + Send) -> PyResult<T> {
    static PROCESS: OnceLock<u32> = OnceLock::new();
    if *PROCESS.get_or_init(std::process::id) != std::process::id() {
        return Err(PyRuntimeError::new_err(
            "this process was forked after lotpilot had started its threads, which are not in the child; start \
             processes with multiprocessing's method \"spawn\" or \"forkserver\", or step with threads=1",
        ));
    }
    alone(py, work)
}

/// Works without the interpreter's lock, in the thread that calls.
///
/// # Errors
/// Those of the work; a panic, which is a bug of lotpilot.
pub(crate) fn alone<T: Send>(py: Python<'_>, work: impl FnOnce() -> PyResult<T> + Send) -> PyResult<T> {
    py.detach(|| caught(work))
}

/// Works; a panic becomes an error.
///
/// # Errors
/// Those of the work; a panic, which is a bug of lotpilot.
pub(crate) fn caught<T>(work: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(bug(&*panic)))
}

fn bug(panic: &(dyn Any + Send)) -> PyErr {
    let said = panic.downcast_ref::<String>().map(String::as_str);
    let said = said.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
    PyRuntimeError::new_err(format!("a bug in lotpilot, please report it: {said}"))
}
