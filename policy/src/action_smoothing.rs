//! Action smoothing: the point that is driven at is an exponential mean of the network's answers.
//!
//! Answers to successive grids differ by sensor noise, and the car responds to each with a delay, which can build up to
//! weaving. A mean over some ticks damps it.

use crate::network::{InferenceSettings, Prediction};
use sim::driver::{LookAheadPoint, Seat};
use sim::sensing::GridGeometry;

/// The smoothing of one car.
#[derive(Debug, Clone)]
pub(crate) struct ActionSmoothing {
    /// Share of the way from the mean to a new answer, 0…1.
    gain: f32,
    geometry: GridGeometry,
    mean: Option<Aim>,
}

/// A look-ahead point as pure pursuit drives it.
#[derive(Debug, Clone, Copy)]
struct Aim {
    curvature_per_m: f32,
    range_m: f32,
}

impl ActionSmoothing {
    pub(crate) fn new(inference: InferenceSettings, geometry: GridGeometry) -> Self {
        // The response to a step is 1 − exp(−t / time constant).
        let gain = if inference.smoothing_ticks > 0.0 { 1.0 - (-1.0 / inference.smoothing_ticks).exp() } else { 1.0 };
        Self { gain, geometry, mean: None }
    }

    /// The exponential mean of curvature and range over the answers so far. The standard deviations are those of the last one.
    pub(crate) fn smoothed(&mut self, answer: Prediction) -> Prediction {
        if self.gain == 1.0 {
            return answer;
        }
        let aim = Aim::at(answer.look_ahead(self.geometry));
        let mean = self.mean.map_or(aim, |mean| mean.towards(aim, self.gain));
        self.mean = Some(mean);
        Prediction { mean: mean.point().to_image_fraction(&self.geometry), ..answer }
    }

    pub(crate) fn reset(&mut self) {
        self.mean = None;
    }
}

/// The smoothing of every car of a batch, by episode.
#[derive(Debug, Clone)]
pub(crate) struct FleetSmoothing {
    fresh: ActionSmoothing,
    of_episodes: Vec<ActionSmoothing>,
}

impl FleetSmoothing {
    pub(crate) fn new(inference: InferenceSettings, geometry: GridGeometry) -> Self {
        Self { fresh: ActionSmoothing::new(inference, geometry), of_episodes: Vec::new() }
    }

    /// Smooths the answer at every seat.
    pub(crate) fn smooth(&mut self, seats: &[Seat<'_>], answers: &mut [Prediction]) {
        for (seat, answer) in seats.iter().zip(answers) {
            if self.of_episodes.len() <= seat.episode {
                self.of_episodes.resize(seat.episode + 1, self.fresh.clone());
            }
            let smoothing = &mut self.of_episodes[seat.episode];
            if seat.was_reset {
                smoothing.reset();
            }
            *answer = smoothing.smoothed(*answer);
        }
    }
}

impl Aim {
    fn at(point: LookAheadPoint) -> Self {
        Self { curvature_per_m: point.curvature_per_m(), range_m: point.ahead_m.hypot(point.left_m) }
    }

    fn towards(self, other: Self, share: f32) -> Self {
        let between = |from: f32, to: f32| from + share * (to - from);
        Self {
            curvature_per_m: between(self.curvature_per_m, other.curvature_per_m),
            range_m: between(self.range_m, other.range_m),
        }
    }

    fn point(self) -> LookAheadPoint {
        // Pure pursuit: κ = 2 sin θ / L. A mean of two points ahead can at a far range be a circle that turns back.
        let sin = (0.5 * self.curvature_per_m * self.range_m).clamp(-0.99, 0.99);
        LookAheadPoint { ahead_m: self.range_m * (1.0 - sin * sin).sqrt(), left_m: self.range_m * sin }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ahead_m: f32, left_m: f32) -> Prediction {
        let mean = LookAheadPoint { ahead_m, left_m }.to_image_fraction(&GridGeometry::paper());
        Prediction { mean, sigma: [0.03, 0.05] }
    }

    fn smoothing(smoothing_ticks: f32) -> ActionSmoothing {
        ActionSmoothing::new(InferenceSettings { smoothing_ticks, ..InferenceSettings::plain() }, GridGeometry::paper())
    }

    #[test]
    fn without_smoothing_answers_stay_as_they_are_to_the_bit() {
        let mut smoothing = smoothing(0.0);
        let outside = Prediction { mean: [-0.1, 1.2], sigma: [0.03, 0.05] };
        assert_eq!([at(9.0, 1.0), outside].map(|answer| smoothing.smoothed(answer)), [at(9.0, 1.0), outside]);
    }

    #[test]
    fn a_step_is_followed_exponentially_and_a_constant_answer_exactly() {
        let mut smoothing = smoothing(8.0);
        let first = smoothing.smoothed(at(8.0, 0.0)).look_ahead(GridGeometry::paper());
        assert!((first.ahead_m - 8.0).abs() < 1e-5 && first.left_m.abs() < 1e-5, "the first answer is taken at once");
        let last = (0..8).map(|_| smoothing.smoothed(at(12.0, 0.0))).last().unwrap();
        let reached_m = last.look_ahead(GridGeometry::paper()).ahead_m;
        // 8 + 4 · (1 − 1/e): one time constant later.
        assert!((reached_m - 10.5285).abs() < 1e-3, "{reached_m}");
        assert_eq!(last.sigma, [0.03, 0.05]);
        smoothing.reset();
        let again = smoothing.smoothed(at(6.0, -2.0)).look_ahead(GridGeometry::paper());
        assert!((again.ahead_m - 6.0).abs() < 1e-4 && (again.left_m + 2.0).abs() < 1e-4, "{again:?}");
    }
}
