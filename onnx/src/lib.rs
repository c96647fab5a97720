//! Networks as ONNX files: import as drivers, and export of ours.
//!
//! | module | what |
//! |---|---|
//! | [`network`] | reads a file, checks it, and answers grids |
//! | [`fleet`] | such a network at the wheel |
//! | [`mod@export`] | writes a trained network of ours |
//!
//! The format is in docs/formats.md, "Networks of others: ONNX". rten runs the networks: it is Rust all through, needs a
//! twelfth of the time that tract takes to compile, and writes the files as well.

mod about;
pub mod export;
pub mod fleet;
pub mod network;
mod wire;

pub use about::About;

/// Name of the only input: occupied cells, float32 `[batch, 1, 25, 25]`.
pub const INPUT: &str = "grid";
/// Name of the output: float32 `[batch, 2]`, `[batch, 4]`, or `[batch, 5 m]` of m modes.
pub const OUTPUT: &str = "point";
