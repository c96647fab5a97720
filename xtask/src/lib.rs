//! The bench: parse → resolve → call → report. No algorithm lives here.
//!
//! | file | what |
//! |---|---|
//! | [`cli`] | the command line, nothing else |
//! | [`settings`] | preset → file → `--set` → flags, into one checked [`settings::Settings`] |
//! | [`train`], [`evaluate`], [`reproduce`], [`generate`], [`pixel_accuracy`], [`metres`], [`tune`], [`listing`], [`render`] | the commands |
//! | [`plots`] | plots as SVG |
//! | [`run_report`], [`learning`] | `report.html` and `learning.csv` of a run |
//! | [`lots`], [`drivers`] | what can be named on the command line |
//! | [`trials`] | which obstacles and which noise a trial has |
//! | [`failures`], [`replay_key`] | near-collisions one by one, and how to see one again |
//! | [`table1`], [`summary`], [`report`], [`page`], [`paper`] | what is printed and written |
//! | [`run_dir`] | the folder of a run and how it is claimed |
//! | [`visualise`], [`recorder`] | recordings for Rerun's viewer |
//! | [`progress`], [`interrupt`] | bars, Ctrl-C |
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "printing is what a command does")]
#![allow(clippy::disallowed_methods, reason = "wall time is shown to people here; nothing computed depends on it")]

pub mod cli;
pub mod drivers;
pub mod evaluate;
pub mod failures;
pub mod generate;
pub mod interrupt;
pub mod learning;
pub mod listing;
pub mod lots;
pub mod metres;
pub mod page;
pub mod paper;
pub mod pixel_accuracy;
pub mod plots;
pub mod progress;
pub mod recorder;
pub mod render;
pub mod replay_key;
pub mod report;
pub mod reproduce;
pub mod run_dir;
pub mod run_report;
pub mod settings;
pub mod summary;
pub mod table1;
pub mod train;
pub mod trials;
pub mod tune;
pub mod visualise;
