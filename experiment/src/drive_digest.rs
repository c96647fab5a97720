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
