//! Statistics of drivers: intervals, comparisons, sample sizes (docs/methods.md 8.3).
//!
//! | file | question |
//! |---|---|
//! | [`poisson`] | how uncertain is a rate, what does a count of zero bound, do events come in clusters |
//! | [`comparison`] | do two rates differ, if the events were independent |
//! | [`bootstrap`] | do two drivers differ, whatever the events depend on |
//! | [`student`] | what do a few trainings say of other ones |
//! | [`sample_size`] | how far must be driven to see a difference |
//!
//! Distributions come from `statrs`; every function is tested against published values.

pub mod bootstrap;
pub mod comparison;
pub mod poisson;
pub mod sample_size;
pub mod student;
