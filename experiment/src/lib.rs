//! What an experiment is: its settings, who drives where, in which trials, and the folder that holds the result.
//!
//! | module | what |
//! |---|---|
//! | [`settings`] | preset → file → overrides, into one checked [`settings::Settings`] |
//! | [`lots`], [`drivers`] | what lots and drivers are called |
//! | [`trials`] | which obstacles and which noise a trial has |
//! | [`drive`] | the one loop: a driver on a batch of trials, frame by frame for an observer |
//! | [`replay_key`] | a short text that stands for exactly one run and a moment in it |
//! | [`training`], [`learning`] | behaviour cloning and DAgger into a run folder |
//! | [`run_dir`] | the folder of a run and how it is claimed |
//! | [`view_request`] | what the viewer program is asked to record |
//! | [`progress`] | how long work reports, and how it is cancelled |
//!
//! Nothing here prints or knows the command line.

pub mod drive;
pub mod drivers;
pub mod learning;
pub mod lots;
pub mod progress;
pub mod replay_key;
pub mod run_dir;
pub mod settings;
pub mod training;
pub mod trials;
pub mod view_request;
