//! Closed-loop parking-lot simulator: vocabulary, motion, sensing, the loop and its metrics.
//!
//! A [`scenario::Scenario`] is compiled into a [`map::Map`]; an [`episode::Episode`] on that map shows the driver an
//! [`sensing::Observation`]; the driver answers with a [`driver::LookAheadPoint`]; the [`controller`] turns it into a
//! [`vehicle::VehicleCommand`]; the vehicle moves; the result is a [`frame::Frame`]. Metrics, data sets and
//! recordings read frames only; nothing flows backwards.
//!
//! This crate knows no sibling, no burn, no rerun, no clap and no files.

pub mod action_smoothing;
pub mod batch;
pub mod collision;
pub mod controller;
pub mod distance_field;
pub mod driver;
pub mod episode;
pub mod frame;
pub mod geometry;
pub mod limits;
pub mod map;
pub mod maths;
pub mod metrics;
pub mod path;
pub mod scenario;
pub mod seed;
pub mod sensing;
pub mod validate;
pub mod vectors;
pub mod vehicle;
