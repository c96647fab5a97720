//! How a round was collected: `round.toml`.

use crate::agreement::Agreement;
use crate::files::{self, FileError, Format};
use serde::{Deserialize, Serialize};
use sim::scenario::Direction;
use std::path::Path;

/// How a round was collected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Collection {
    /// 0 = behaviour cloning.
    pub round: u32,
    /// Samples kept.
    pub samples: usize,
    /// Noise augmentations of each sample.
    pub noise_augmentations: usize,
    /// Executed actions, `n_tot`.
    pub ticks: u64,
    /// Executed actions of the network, `n_net`.
    pub novice_ticks: u64,
    /// Sum of τ̂ over all ticks.
    pub tau_hat_sum: f64,
    /// Ticks in seconds: control periods, without the time that near-collisions take to brake.
    pub driven_s: f64,
    /// Near-collisions while collecting.
    pub near_collisions: u32,
    /// Metres driven.
    pub driven_m: f64,
    /// What it cost the expert and the car; `None` in rounds of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort: Option<Effort>,
    /// How network and expert agree; `None` in behaviour cloning and in rounds of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub agreement: Option<Agreement>,
    /// Episodes driven, in the order that `ticks.npz` numbers them.
    pub episodes: Vec<EpisodeRecord>,
}

/// What a collection costs: the expert's time, and the car.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Effort {
    /// Ticks at which the method asks the expert, to decide who drives or to label. The simulator's expert answers all.
    pub queries: u64,
    /// Times the expert takes the wheel.
    pub interventions: u64,
    /// Ticks the expert drives.
    pub expert_ticks: u64,
    /// Contacts: the body touches something.
    pub contacts: u32,
}

/// One episode of a round.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EpisodeRecord {
    /// Name of the lot.
    pub lot: String,
    /// Which way it was driven.
    pub direction: Direction,
    /// Samples kept.
    pub samples: usize,
    /// Near-collisions while collecting.
    pub near_collisions: u32,
    /// Metres driven.
    pub driven_m: f32,
}

impl Format for Collection {
    const NAME: &'static str = "round.toml";
    const SCHEMA: u32 = 2;
}

impl Collection {
    /// Reads `round.toml` of a folder; `None` if there is none.
    ///
    /// # Errors
    /// If the file is of another schema, or is not what it should be.
    pub fn read(folder: &Path) -> Result<Option<Self>, FileError> {
        files::read_if_finished(folder)
    }

    /// Writes `round.toml` into a folder.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), FileError> {
        files::write(folder, self)
    }

    /// η̂ = `n_net` / `n_tot` (Algorithm 2, line 19).
    pub fn eta_hat(&self) -> f64 {
        self.novice_ticks as f64 / self.ticks.max(1) as f64
    }

    /// Σ τ̂ per second of driving: the paper's "effect" row compares two of these.
    pub fn tau_hat_per_s(&self) -> f64 {
        self.tau_hat_sum / self.driven_s.max(f64::MIN_POSITIVE)
    }
}
