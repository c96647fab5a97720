//! The transform from the frame of a map to that of the lot.

use sim::geometry::{Pose, Vec2, wrap_angle};

/// A lot that starts farther than this from the origin of its map gets an origin of its own, metres in the lot. Single
/// precision resolves half a millimetre up to here, and UTM coordinates reach 10⁷ m.
const FAR_M: f64 = 5000.0;

/// The lot is the map, moved and enlarged: lot = scale · (map − origin).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    /// Origin of the lot, in the map's frame, metres: (0, 0) unless that is too far away.
    pub(super) origin: [f64; 2],
    scale: f64,
}

impl Frame {
    /// The frame of a lot that starts at a place of the map, metres.
    pub(super) fn around(start: [f64; 2], scale: f64) -> Self {
        let is_far = start.iter().any(|metres| (metres * scale).abs() > FAR_M);
        // Whole metres are easily subtracted by people.
        Self { origin: if is_far { start.map(f64::round) } else { [0.0; 2] }, scale }
    }

    /// Whether the lot has an origin of its own.
    pub(super) fn is_recentred(&self) -> bool {
        self.origin != [0.0; 2]
    }

    /// A point of the map in the lot.
    pub(super) fn in_lot(&self, [x, y]: [f64; 2]) -> Vec2 {
        Vec2::new(((x - self.origin[0]) * self.scale) as f32, ((y - self.origin[1]) * self.scale) as f32)
    }

    /// A pose of the map, its heading in degrees, in the lot.
    pub(super) fn pose_in_lot(&self, [x, y, heading_deg]: [f64; 3]) -> Pose {
        Pose::new(self.in_lot([x, y]), wrap_angle((heading_deg as f32).to_radians()))
    }

    /// A point of the lot in the map.
    pub(super) fn in_map(&self, point: Vec2) -> [f64; 2] {
        let Vec2 { x, y } = point;
        [f64::from(x) / self.scale + self.origin[0], f64::from(y) / self.scale + self.origin[1]]
    }

    /// What coordinates of the lot are to somebody who knows the map; `None` if they are the same.
    pub(super) fn explained(&self) -> Option<String> {
        let [x, y] = self.origin;
        let is_scaled = (self.scale - 1.0).abs() >= f64::EPSILON;
        match (self.is_recentred(), is_scaled) {
            (false, false) => None,
            (false, true) => Some(format!("coordinates are the map's times {}", self.scale)),
            (true, false) => Some(format!("coordinates are the map's less ({x}, {y})")),
            (true, true) => Some(format!("coordinates are the map's less ({x}, {y}), times {}", self.scale)),
        }
    }

    /// A point of the lot in the map, in words.
    pub(super) fn said(&self, point: Vec2) -> String {
        let [x, y] = self.in_map(point);
        format!("({x:.2}, {y:.2})")
    }
}
