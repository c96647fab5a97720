//! What the loop puts out: one [`Frame`] per control tick. Metrics, data sets and recordings read nothing else.

use crate::driver::Decision;
use crate::geometry::Pose;
use crate::sensing::Observation;
use crate::vehicle::{VehicleCommand, VehicleState};
use serde::{Deserialize, Serialize};

/// What happened in one tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Event {
    /// Nothing.
    Drove,
    /// The car headed at something within `near_collision_m` of the metrics; it was stopped and, unless the run ends
    /// [`Ending::Blocked`], put back on the path.
    NearCollision {
        /// Rear-axle pose when it was counted.
        at: Pose,
        /// Progress along the reference path then, metres.
        progress_m: f32,
    },
    /// Too little progress for `stuck_after_s` of the metrics; the car was put back on the path, likewise.
    Stuck {
        /// Rear-axle pose when it was counted.
        at: Pose,
        /// Progress along the reference path then, metres.
        progress_m: f32,
    },
    /// The finish.
    ReachedEnd,
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// The car reached the finish, or was put back there.
    ReachedEnd,
    /// Given up because there is no place ahead on the route from which the car could drive on.
    Blocked,
    /// Given up after too many near-collisions and stuck events.
    TooManyEvents,
    /// Given up after too long a time.
    TimedOut,
}

/// One control tick.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Index of the decision, from 0.
    pub tick: u32,
    /// Simulated time at the end of the tick, seconds.
    pub time_s: f32,
    /// The vehicle when it was observed.
    pub vehicle: VehicleState,
    /// What was seen.
    pub observation: Observation,
    /// What was answered.
    pub decision: Decision,
    /// What the controller made of it.
    pub command: VehicleCommand,
    /// Progress along the reference path when observed, metres.
    pub progress_m: f32,
    /// Drivable share of the safe range when observed, 0…1.
    pub safe_ratio: f32,
    /// Distance between body and non-drivable space when observed, or after an emergency stop in this tick if that is
    /// less, metres.
    pub clearance_m: f32,
    /// Way driven in this tick, metres.
    pub driven_m: f32,
    /// Times the body began to touch something in this tick.
    pub contacts: u32,
    /// What happened.
    pub event: Event,
}

/// Receives frames. It cannot influence the episode.
pub trait FrameSink {
    /// Takes one frame.
    fn frame(&mut self, frame: &Frame);
}

impl FrameSink for () {
    fn frame(&mut self, _frame: &Frame) {}
}

impl<F: FnMut(&Frame)> FrameSink for F {
    fn frame(&mut self, frame: &Frame) {
        self(frame);
    }
}
