//! Who drives, and what they may see.
//!
//! A [`Policy`] receives an [`Observation`] and nothing else; only a [`Driver`] receives [`GroundTruth`]. A policy
//! that peeks does not compile.

use crate::map::Map;
use crate::sensing::{GridGeometry, Observation};
use crate::vehicle::VehicleState;
use serde::{Deserialize, Serialize};

/// The action of the paper: a point on the ground, in the ego frame (rear axle), metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LookAheadPoint {
    /// Ahead of the rear axle, metres.
    pub ahead_m: f32,
    /// Left of the vehicle axis, metres.
    pub left_m: f32,
}

impl LookAheadPoint {
    /// Image fractions `[u, w]` of the bird's-eye view: u 0 = left … 1 = right, w 0 = far … 1 = near
    /// (docs/methods.md 0; the paper's a_x and a_y). Not clipped.
    pub fn to_image_fraction(self, geometry: &GridGeometry) -> [f32; 2] {
        [0.5 - self.left_m / geometry.side_m, 1.0 - (self.ahead_m - geometry.near_edge_ahead_m) / geometry.side_m]
    }

    /// Inverse of [`Self::to_image_fraction`].
    pub fn from_image_fraction([u, w]: [f32; 2], geometry: &GridGeometry) -> Self {
        Self { ahead_m: geometry.near_edge_ahead_m + (1.0 - w) * geometry.side_m, left_m: (0.5 - u) * geometry.side_m }
    }

    /// Curvature of the circle through the rear axle, tangent to the vehicle axis, and this point: 2Y/(X²+Y²), 1/m.
    pub fn curvature_per_m(self) -> f32 {
        2.0 * self.left_m / (self.ahead_m * self.ahead_m + self.left_m * self.left_m).max(1e-6)
    }
}

/// One standard deviation of a look-ahead point per axis, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Along the vehicle axis, metres.
    pub ahead_m: f32,
    /// Across, metres.
    pub left_m: f32,
}

/// Whose answer is being driven.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// The scripted expert.
    Expert,
    /// The learned policy.
    Novice,
    /// A model-based planner.
    Planner,
}

impl Source {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Expert, Self::Novice, Self::Planner];

    /// Its name in legends.
    pub fn name(self) -> &'static str {
        match self {
            Self::Expert => "expert",
            Self::Novice => "network",
            Self::Planner => "planner",
        }
    }
}

/// What a driver answers at one control tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// Where to drive.
    pub look_ahead: LookAheadPoint,
    /// Who said so.
    pub source: Source,
    /// How sure they are, where they say.
    pub spread: Option<Spread>,
    /// The fastest that they would be driven, m/s; `None` leaves the speed to the controller's law. Never slower than the
    /// controller's slowest command.
    pub speed_limit_mps: Option<f32>,
}

impl Decision {
    /// Whether it can be driven by.
    pub fn is_finite(&self) -> bool {
        let spread = self.spread.map_or([0.0; 2], |spread| [spread.ahead_m, spread.left_m]);
        let [ahead_m, left_m] = [self.look_ahead.ahead_m, self.look_ahead.left_m];
        let numbers = [ahead_m, left_m, spread[0], spread[1], self.speed_limit_mps.unwrap_or(0.0)];
        numbers.iter().all(|value| value.is_finite())
    }
}

/// Noise-free surroundings, for the expert, the metrics and the collision check only.
#[derive(Debug, Clone, Copy)]
pub struct GroundTruth<'a> {
    /// The clean map.
    pub map: &'a Map,
    /// The true state of the vehicle.
    pub vehicle: VehicleState,
    /// Arc length along the reference path of the point nearest to the rear axle, metres. For the "no turning back"
    /// filter only.
    pub progress_m: f32,
}

/// Everything a driver can be shown at one control tick.
#[derive(Debug, Clone, Copy)]
pub struct Situation<'a> {
    /// The noisy grid.
    pub observation: &'a Observation,
    /// The truth.
    pub truth: GroundTruth<'a>,
}

/// A driver that could sit in a real car: it sees the noisy grid and nothing else.
pub trait Policy {
    /// Answers one observation.
    fn act(&mut self, observation: &Observation) -> Decision;

    /// Forgets the past; called when the car was put back on the path.
    fn reset(&mut self) {}
}

/// The driver of one episode.
pub trait Driver {
    /// Answers one situation.
    fn decide(&mut self, situation: &Situation<'_>) -> Decision;

    /// Forgets the past; called when the car was put back on the path.
    fn reset(&mut self) {}
}

/// Makes a [`Policy`] a [`Driver`] and withholds the truth from it.
#[derive(Debug, Clone)]
pub struct SensorsOnly<P>(pub P);

impl<P: Policy> Driver for SensorsOnly<P> {
    fn decide(&mut self, situation: &Situation<'_>) -> Decision {
        self.0.act(situation.observation)
    }

    fn reset(&mut self) {
        self.0.reset();
    }
}

/// One running episode of a lock-step batch, as its fleet sees it.
#[derive(Debug, Clone, Copy)]
pub struct Seat<'a> {
    /// Index of the episode within the batch, constant over its life.
    pub episode: usize,
    /// The car was put back on the path since the last decision: forget the past.
    pub was_reset: bool,
    /// What can be seen from this seat.
    pub situation: Situation<'a>,
}

/// Drives many episodes in lock-step, so that a network answers for all of them in one call.
///
/// The answer for one seat must not depend on which other seats are in the call.
pub trait Fleet {
    /// Pushes exactly one decision per seat, in order.
    fn decide(&mut self, seats: &[Seat<'_>], decisions: &mut Vec<Decision>);
}

impl<F: Fleet + ?Sized> Fleet for Box<F> {
    fn decide(&mut self, seats: &[Seat<'_>], decisions: &mut Vec<Decision>) {
        (**self).decide(seats, decisions);
    }
}

/// A fleet with one independent driver per episode, asked one after another.
pub struct OneDriverEach<D>(pub Vec<D>);

impl<D: Driver> Fleet for OneDriverEach<D> {
    fn decide(&mut self, seats: &[Seat<'_>], decisions: &mut Vec<Decision>) {
        for seat in seats {
            let driver = &mut self.0[seat.episode];
            if seat.was_reset {
                driver.reset();
            }
            decisions.push(driver.decide(&seat.situation));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec2;
    use crate::sensing::{BEV_PIXELS, GRID_CELLS};

    /// Everything else is measured in this frame, so a sign or an axis swapped here would agree with itself everywhere.
    #[test]
    fn image_fractions_run_from_the_far_left_corner_to_the_near_right_one() {
        let geometry = GridGeometry::paper();
        let places = [
            ([0.0, 0.0], 16.3, 6.0),
            ([1.0, 0.0], 16.3, -6.0),
            ([0.0, 1.0], 4.3, 6.0),
            ([0.5, 0.5], 10.3, 0.0),
            ([0.25, 1.25], 1.3, 3.0),
        ];
        for ([u, w], ahead_m, left_m) in places {
            let point = LookAheadPoint::from_image_fraction([u, w], &geometry);
            let error_m = (point.ahead_m - ahead_m).abs().max((point.left_m - left_m).abs());
            assert!(error_m < 1e-5, "({u}, {w}) is {point:?}");
            let back = LookAheadPoint { ahead_m, left_m }.to_image_fraction(&geometry);
            assert!((back[0] - u).abs().max((back[1] - w).abs()) < 1e-6, "({ahead_m}, {left_m}) is {back:?}");
        }
    }

    #[test]
    fn pixels_and_cells_lie_where_their_image_fractions_say() {
        let geometry = GridGeometry { side_m: 9.0, near_edge_ahead_m: 3.7 };
        let error = |centre: Vec2, row: usize, col: usize, count: usize| {
            let [u, w] = LookAheadPoint { ahead_m: centre.x, left_m: centre.y }.to_image_fraction(&geometry);
            let share = |index: usize| (index as f32 + 0.5) / count as f32;
            (u - share(col)).abs().max((w - share(row)).abs())
        };
        for (row, col) in (0..BEV_PIXELS).flat_map(|row| (0..BEV_PIXELS).map(move |col| (row, col))) {
            assert!(error(geometry.pixel_in_ego(row, col), row, col, BEV_PIXELS) < 1e-6, "pixel {row}, {col}");
        }
        for (row, col) in (0..GRID_CELLS).flat_map(|row| (0..GRID_CELLS).map(move |col| (row, col))) {
            assert!(error(geometry.cell_in_ego(row, col), row, col, GRID_CELLS) < 1e-6, "cell {row}, {col}");
        }
    }
}
