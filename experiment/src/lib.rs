//! An experiment: its settings, its drivers, lots and trials, the loop that drives them, and its run folder.
//!
//! | module | what |
//! |---|---|
//! | [`settings`] | preset → file → overrides, into one checked [`settings::Settings`] |
//! | [`lots`], [`drivers`] | names of lots and drivers, and what they stand for |
//! | [`notes`] | notes about lots from files |
//! | [`trials`] | seeds of trials: their obstacles and their noise |
//! | [`shard`] | a machine's share of the trials |
//! | [`drive`] | the one loop: a driver on a batch of trials, with an observer of every frame |
//! | [`drive_digest`] | SHA-256 of a drive: whether two are the same, bit for bit |
//! | [`replay_key`] | a short text that identifies one run and a tick in it |
//! | [`training`] | behaviour cloning and DAgger into a run folder |
//! | [`inputs`] | digests of the files that a run reads, so that it continues with the same |
//! | [`run_dir`] | the run folder, and how it is claimed |
//! | [`manifest`] | what a run says of itself: what made it, from which inputs, and its outcome |
//! | [`command_line`] | commands, as a shell can be given them |
//! | [`trained`] | the networks that runs have trained |
//! | [`view_request`] | what the viewer program is asked to record |
//! | [`progress`] | how long tasks report progress and are cancelled |
//!
//! Nothing here prints or parses command lines.

pub mod command_line;
pub mod drive;
pub mod drive_digest;
pub mod drivers;
pub mod inputs;
pub mod lots;
pub mod manifest;
pub mod notes;
pub mod progress;
pub mod replay_key;
pub mod run_dir;
pub mod settings;
pub mod shard;
#[cfg(test)]
mod test_runs;
pub mod trained;
pub mod training;
pub mod trials;
pub mod view_request;
