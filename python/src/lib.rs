//! The native half of the Python package `lotpilot`: many episodes stepped at once into arrays of the caller.
//!
//! | module | what |
//! |---|---|
//! | [`course`] | lots × directions × trials: episodes by number, their maps |
//! | [`car`] | one environment: its episode, its expert, its reward |
//! | [`cars`] | many of them, stepped in parallel without the interpreter's lock |
//! | [`arrays`] | numpy arrays as what cars write into |
//! | [`reward`] | the terms of the reward and their weights |
//! | [`lot`] | a lot with the obstacles of a trial, for looking at |
//! | [`evaluate`], [`callback`] | evaluations, with functions in Python as drivers, and their files |
//! | [`data`] | rounds of training data |
//! | [`rate`] | how fast the same episodes are in Rust alone, and the digest of a drive |
//! | [`guard`] | no panic leaves this library |
//!
//! Every episode here is driven by [`sim::episode::Episode`], tick by tick, as everywhere in lotpilot.

#![allow(clippy::needless_pass_by_value, reason = "PyO3 hands arguments over by value")]
#![allow(clippy::redundant_closure_for_method_calls, reason = "a method of `Python<'py>` is of one lifetime")]

mod arrays;
mod callback;
mod car;
mod cars;
mod course;
mod data;
mod evaluate;
mod guard;
mod lot;
mod rate;
mod reward;

/// As in the command line: allocation is hot where lots are drawn.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// The native half of the package; see `lotpilot` for what is meant to be used.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use crate::cars::Cars;
    #[pymodule_export]
    use crate::data::{count_rounds, read_round};
    #[pymodule_export]
    use crate::evaluate::{evaluate, merge, read_finished};
    #[pymodule_export]
    use crate::guard::EpisodeEnded;
    #[pymodule_export]
    use crate::lot::{Lot, check_generate, drivers, generate, lots, settings};
    #[pymodule_export]
    use crate::rate::{RustLoop, drive_digest};
}
