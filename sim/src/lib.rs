//! Closed-loop parking-lot simulator: vocabulary, motion, sensing, the loop and its metrics.
//!
//! A [`scenario::Scenario`] is compiled into a [`map::Map`]; an [`episode::Episode`] on that map shows the driver an
//! [`sensing::Observation`]; the driver answers with a [`driver::LookAheadPoint`]; the [`controller`] turns it into a
//! [`vehicle::VehicleCommand`]; the vehicle moves; the result is a [`frame::Frame`]. Metrics, data sets and
//! recordings read frames only; nothing flows backwards.
//!
//! This crate knows no sibling, no burn, no rerun, no clap and no files.
//!
//! | module | |
//! |---|---|
//! | [`scenario`], [`validate`] | what a lot consists of, and what is refused |
//! | [`map`], [`path`], [`distance_field`], [`collision`] | a lot as it is driven on: its route, distances, exact collisions |
//! | [`sensing`] | what the car sees: view, occlusion, noise, grid |
//! | [`driver`], [`action_smoothing`] | who drives, and the mean over a driver's answers |
//! | [`controller`], [`vehicle`] | from the answer to the command, and from the command to the motion |
//! | [`episode`], [`batch`], [`frame`] | the closed loop of one car or many, and what it puts out |
//! | [`metrics`] | what is measured |
//! | [`seed`] | named random streams |
//! | [`limits`] | the largest inputs |
//! | [`geometry`], [`maths`], [`vectors`] | points and poses, functions that round alike everywhere, four numbers at a time |

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
