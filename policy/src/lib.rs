//! Drivers that see only the grid, and how to train one.
//!
//! | file | part of the paper |
//! |---|---|
//! | [`network`] | the driving policy network: two convolutions with pooling, 1000, 4 |
//! | [`loss`] | equations for the loss: Gaussian log-likelihood with the gain (1 + α τ̂) |
//! | [`dataset`] | the data set D = `D_BC` ∪ `D_1` ∪ …, in memory and on disk |
//! | [`fit`] | "train policy `π_net` on D": behaviour cloning is one call, a `DAgger` iteration another |
//! | [`decision_rule`] | Algorithm 2, line 9: may the network drive this tick? And the rules of other methods |
//! | [`agreement`] | what η̂ is to be read with: a constant answer, τ scaled as the labels are, quantiles of τ̂ |
//! | [`dagger`] | Algorithms 1 and 2, top to bottom |
//! | [`drivers`], [`action_smoothing`] | the trained network at the wheel, its answers smoothed |
//! | [`checkpoint`] | a trained network on disk |
//! | [`conditions`] | controller and sensor that it was trained with |
//! | [`files`] | files of a run: errors, schema versions |
//!
//! Images: u = column fraction (0 = left, 1 = right), w = row fraction (0 = far, 1 = near), as in docs/methods.md 0.

pub mod action_smoothing;
pub mod agreement;
pub mod checkpoint;
pub mod conditions;
pub mod dagger;
pub mod dataset;
pub mod decision_rule;
pub mod drivers;
pub mod files;
pub mod fit;
pub mod loss;
pub mod network;
mod string_or_table;
#[cfg(test)]
mod test_data;
