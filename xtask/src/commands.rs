//! The commands, one file each: arguments → settings → call → what is printed.

pub(crate) mod bench;
pub(crate) mod completions;
pub(crate) mod deviations;
pub(crate) mod drivers;
pub(crate) mod evaluate;
pub(crate) mod export;
pub(crate) mod generate;
pub(crate) mod guard;
pub(crate) mod lots;
pub(crate) mod merge;
mod perform;
pub(crate) mod pixel_accuracy;
pub(crate) mod render;
mod render_animation;
pub(crate) mod replay;
pub(crate) mod reproduce;
pub(crate) mod rules;
pub(crate) mod sample_size;
pub(crate) mod scaling;
pub(crate) mod settings;
pub(crate) mod torture;
pub(crate) mod train;
mod trainings;
pub(crate) mod tune;
pub(crate) mod verify;
pub(crate) mod visualise;
mod within;
