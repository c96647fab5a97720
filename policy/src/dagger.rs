//! `DAgger` with the paper's data-sampling function.
//!
//! | module | what |
//! |---|---|
//! | `algorithm` | Algorithm 1, and Algorithm 2 for one round ([`run`]) |
//! | `rollouts` | how the drives of a round are set up ([`Rollouts`]), in a training and anywhere else |
//! | `gated_collector` | Algorithm 2 tick by tick: who drives, and what is stored |
//! | `disturbance` | disturbance injection |
//! | `critic` | a network that warns of states that the first one does not master |
//! | `learned` | the network with what its rule needs besides: an ensemble, a critic ([`Learned`]) |

mod algorithm;
mod critic;
mod disturbance;
mod gated_collector;
mod iteration_row;
mod learned;
mod progress;
mod rollouts;
mod run_file;
mod settings;

pub use algorithm::run;
pub use disturbance::{Aim, DisturbanceSettings};
pub use gated_collector::Keep;
pub use iteration_row::IterationRow;
pub use learned::Learned;
pub use progress::{DaggerError, EpisodesError, Hooks, Outcome, Progress, Stop};
pub use rollouts::{Collected, Rollouts, RoundEpisode};
pub use settings::{DaggerSettings, StartFrom};

#[cfg(test)]
mod tests;
