//! Plots as SVG text: data in, picture out; nothing here reads a file or knows a command.
//!
//! | function | what it shows |
//! |---|---|
//! | [`learning`] | validation error and losses over optimiser steps, round after round |
//! | [`eta`] | η̂ per iteration beside the paper's |
//! | [`rates`] | near-collisions per 100 m with intervals, a row per driver |
//! | [`rates_against_noise`] | the same over the noise level |
//! | [`rates_against_lots`] | the same over the number of different lots that were trained on |
//! | [`safe_ratios`] | distribution of the safe ratio over runs, a row per driver |
//! | [`bars`] | a quantity by lot and driver, the paper's beside ours |
//! | [`calibration`] | whether the network's σ is as large as its errors |
//!
//! All share one [`style`]: a palette that colour-blind people can tell apart, shapes beside colours, units on the axes,
//! [`style::WIDTH_PX`] wide so that text stays legible in a README and on a phone.

mod bars;
mod calibration;
mod driving;
pub mod style;
mod training;

pub use bars::{Bar, BarGroup, bars};
pub use calibration::calibration;
pub use driving::{
    Distribution, RatePoint, RateRow, RateSeries, rates, rates_against_effort, rates_against_lots, rates_against_noise,
    safe_ratios,
};
pub use training::{EtaSeries, eta, learning};

#[cfg(test)]
mod tests;
