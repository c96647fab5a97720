//! Whether commands survive what computers do to them: each is killed, or an operation on its files fails; it is
//! continued as a user would continue it; and every byte is compared with what it writes when it is left alone.
//!
//! | module | what |
//! |---|---|
//! | [`cases`] | the commands, and how each is continued |
//! | [`faults`] | at the n-th operation on a file: death, a full disk or an input/output error (`faults.c`) |
//! | [`process`] | one process, undisturbed, struck or killed |
//! | [`trial`] | a command disturbed in every way, and the outcome |
#![allow(clippy::disallowed_methods, reason = "processes are killed by the clock; nothing computed depends on it")]

pub mod cases;
mod content;
pub mod faults;
pub mod process;
pub mod trial;
