//! SHA-256 of a drive: two drives with the same digest are the same, bit for bit.

use sha2::{Digest as _, Sha256};
use sim::frame::{Event, Frame};
use sim::geometry::Pose;
use sim::sensing::GRID_CELLS;
use storage::sums;

/// Takes the frames of one drive in, from the first on.
#[derive(Debug, Clone, Default)]
pub struct DriveDigest(Sha256);

impl DriveDigest {
    /// Takes one frame in: what was seen, decided, commanded, driven and measured, but not who decided.
    pub fn frame(&mut self, frame: &Frame) {
        for row in 0..GRID_CELLS {
            self.0.update(frame.observation.grid.row(row).to_le_bytes());
        }
        let (point, command, vehicle) = (frame.decision.look_ahead, frame.command, &frame.vehicle);
        self.floats(&[point.ahead_m, point.left_m, command.steering_rad, command.speed_mps]);
        self.pose(vehicle.pose);
        self.floats(&[vehicle.speed_mps, vehicle.steering_rad, vehicle.accel_mps2, frame.driven_m]);
        self.floats(&[frame.time_s, frame.progress_m, frame.safe_ratio, frame.clearance_m]);
        self.0.update(frame.contacts.to_le_bytes());
        match frame.event {
            Event::Drove => self.0.update([0]),
            Event::ReachedEnd => self.0.update([1]),
            Event::NearCollision { at, .. } => {
                self.0.update([2]);
                self.pose(at);
            }
            Event::Stuck { at, .. } => {
                self.0.update([3]);
                self.pose(at);
            }
        }
    }

    /// The digest of the frames so far, 64 hexadecimal digits.
    pub fn hex(&self) -> String {
        sums::hex(&self.0.clone().finalize())
    }

    fn floats(&mut self, values: &[f32]) {
        for value in values {
            self.0.update(value.to_bits().to_le_bytes());
        }
    }

    fn pose(&mut self, pose: Pose) {
        self.floats(&[pose.x_m, pose.y_m, pose.heading_rad]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::driver::{Decision, LookAheadPoint, Source};
    use sim::geometry::Vec2;
    use sim::sensing::Observation;
    use sim::vehicle::{VehicleCommand, VehicleState};
    use std::collections::BTreeSet;

    fn digest(change: fn(&mut Frame)) -> String {
        let look_ahead = LookAheadPoint { ahead_m: 8.0, left_m: 0.5 };
        let mut frame = Frame {
            tick: 0,
            time_s: 0.05,
            vehicle: VehicleState::at_rest(Pose::default()),
            observation: Observation::default(),
            decision: Decision { look_ahead, source: Source::Novice, spread: None, speed_limit_mps: None },
            command: VehicleCommand::default(),
            progress_m: 0.0,
            safe_ratio: 0.5,
            clearance_m: 0.25,
            driven_m: 0.0,
            contacts: 0,
            event: Event::Drove,
        };
        change(&mut frame);
        let mut digest = DriveDigest::default();
        digest.frame(&frame);
        digest.hex()
    }

    /// What a digest leaves out may differ on another machine, and nobody is told.
    #[test]
    fn whatever_differs_between_two_drives_shows_but_who_decided() {
        let changes: [fn(&mut Frame); 23] = [
            |_| {},
            |frame| frame.observation.grid.set_occupied(24, 24),
            |frame| frame.decision.look_ahead.ahead_m += 1.0,
            |frame| frame.decision.look_ahead.left_m += 1.0,
            |frame| frame.command.steering_rad += 1.0,
            |frame| frame.command.speed_mps += 1.0,
            |frame| frame.vehicle.pose.x_m += 1.0,
            |frame| frame.vehicle.pose.y_m += 1.0,
            |frame| frame.vehicle.pose.heading_rad += 1.0,
            |frame| frame.vehicle.speed_mps += 1.0,
            |frame| frame.vehicle.steering_rad += 1.0,
            |frame| frame.vehicle.accel_mps2 += 1.0,
            |frame| frame.driven_m += 1.0,
            |frame| frame.time_s += 1.0,
            |frame| frame.progress_m += 1.0,
            |frame| frame.safe_ratio += 1.0,
            |frame| frame.clearance_m += 1.0,
            |frame| frame.contacts += 1,
            |frame| frame.event = Event::ReachedEnd,
            |frame| frame.event = Event::NearCollision { at: Pose::default(), progress_m: 0.0 },
            |frame| frame.event = Event::NearCollision { at: Pose::new(Vec2::ONE, 0.0), progress_m: 0.0 },
            |frame| frame.event = Event::Stuck { at: Pose::default(), progress_m: 0.0 },
            |frame| frame.event = Event::Stuck { at: Pose::new(Vec2::ONE, 0.0), progress_m: 0.0 },
        ];
        assert_eq!(changes.map(digest).into_iter().collect::<BTreeSet<_>>().len(), changes.len());
        // A network and a function that answers the same drive the same.
        assert_eq!(digest(|frame| frame.decision.source = Source::Planner), digest(|_| {}));
    }
}
