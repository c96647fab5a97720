//! Whether commands survive what computers do to them: each is killed, or an operation on its files fails; it goes on as a
//! user would make it go on; and every byte is compared with what it writes when it is left alone.
//!
//! | module | what |
//! |---|---|
//! | [`cases`] | the commands, and how each goes on |
//! | [`faults`] | at the n-th operation on a file: death, a full disk or an input/output error (`faults.c`) |
//! | [`process`] | one process, undisturbed, struck or killed |
//! | [`trial`] | a command disturbed in every way, and what came of it |
#![allow(clippy::disallowed_methods, reason = "processes are killed by the clock; nothing computed depends on it")]

pub mod cases;
mod content;
pub mod faults;
pub mod process;
pub mod trial;
