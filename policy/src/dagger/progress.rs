//! Hooks, progress and outcome of a run.

use crate::checkpoint::Checkpoint;
use crate::dagger::iteration_row::IterationRow;
use crate::dagger::rollouts::RoundEpisode;
use crate::dataset::Collection;
use crate::files::FileError;
use crate::fit::{FitError, FitProgress, FitReport};
use crate::network::NetworkError;
use serde::{Deserialize, Serialize};
use sim::batch::NotFinite;
use sim::frame::Frame;
use std::ops::ControlFlow;

/// Why a round has no episodes.
pub type EpisodesError = Box<dyn std::error::Error + Send + Sync>;

/// Callbacks of `run`.
pub struct Hooks<'a> {
    /// The episodes of a round with their experts: 0 = behaviour cloning, then the iterations.
    pub episodes: &'a mut dyn FnMut(u32) -> Result<Vec<RoundEpisode>, EpisodesError>,
    /// Every frame while collecting: round, episode, frame.
    pub on_frame: &'a mut dyn FnMut(u32, usize, &Frame),
    /// Called often; a break ends the run at the next safe point. What was finished stays on disk.
    pub progress: &'a mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
}

/// How far a run is.
#[derive(Debug)]
pub enum Progress<'a> {
    /// A collection begins.
    Collecting {
        /// 0 = behaviour cloning.
        round: u32,
        /// Episodes driven in lock-step.
        episodes: usize,
    },
    /// A collection is on disk (or was found there).
    Collected {
        /// 0 = behaviour cloning.
        round: u32,
        /// What was collected.
        collection: &'a Collection,
        /// Samples in the data set now.
        dataset: usize,
    },
    /// A training step.
    Fitting {
        /// The round whose data were added last; `None` = the final training.
        round: Option<u32>,
        /// How much of the training of all networks of the round is done, 0…1, by steps: members of an ensemble and a critic
        /// come after the first one.
        share: f64,
        /// The step.
        fit: &'a FitProgress,
    },
    /// An iteration is on disk (or was found there).
    Finished {
        /// Its row of the table.
        row: &'a IterationRow,
        /// Its training.
        fit: &'a FitReport,
    },
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stop {
    /// η̂ > η: the network drives nearly always.
    EtaReached,
    /// The cap on iterations.
    IterationCap,
    /// The caller stopped it.
    Interrupted,
}

/// Result of a run.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The policy trained last; `None` if interrupted before behaviour cloning was done.
    pub policy: Option<Checkpoint>,
    /// One line per finished round, behaviour cloning first.
    pub rows: Vec<IterationRow>,
    /// Why it ended.
    pub stop: Stop,
}

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub enum DaggerError {
    /// A file cannot be read or written, or does not fit.
    #[error(transparent)]
    File(#[from] FileError),
    /// A training that cannot start or continue.
    #[error("{}: resumed unchanged, the run ends in the same error", training_of(*round))]
    Fit {
        /// Which round; `None`: the final training.
        round: Option<u32>,
        /// Why.
        source: FitError,
    },
    /// A round whose lots cannot be driven.
    #[error("round {round} cannot be driven")]
    Episodes {
        /// Which round.
        round: u32,
        /// Why.
        source: EpisodesError,
    },
    /// A network whose answer is not finite.
    #[error("round {round}, drive {}", source.episode)]
    Driving {
        /// Which round.
        round: u32,
        /// Where.
        source: NotFinite,
    },
    /// Driving that left the finite numbers.
    #[error("round {round}, drive {drive}, tick {tick}: {what} is not a finite number")]
    NotFinite {
        /// Which round.
        round: u32,
        /// Which of its drives, from 0.
        drive: u32,
        /// Which of its decisions, from 0.
        tick: u32,
        /// The label or the state of the car.
        what: &'static str,
    },
    /// Settings of the network that are impossible.
    #[error(transparent)]
    Network(#[from] NetworkError),
}

fn training_of(round: Option<u32>) -> String {
    round.map_or_else(|| "the final training".to_owned(), |round| format!("round {round}"))
}
