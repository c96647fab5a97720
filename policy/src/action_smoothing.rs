//! Action smoothing of predictions: the mean that is driven at is smoothed, the standard deviations are those of the last
//! answer.

use crate::network::Prediction;
use sim::action_smoothing::{ActionSmoothing, FleetSmoothing};
use sim::driver::Seat;
use sim::sensing::GridGeometry;

/// Smooths an answer of one car.
pub(crate) fn smoothed(smoothing: &mut ActionSmoothing, answer: Prediction, geometry: GridGeometry) -> Prediction {
    if !smoothing.is_on() {
        return answer;
    }
    Prediction { mean: smoothing.smoothed(answer.look_ahead(geometry)).to_image_fraction(&geometry), ..answer }
}

/// Smooths the answer at every seat.
pub fn smooth_all(
    smoothing: &mut FleetSmoothing,
    seats: &[Seat<'_>],
    answers: &mut [Prediction],
    geometry: GridGeometry,
) {
    for (seat, answer) in seats.iter().zip(answers) {
        *answer = smoothed(smoothing.of(seat), *answer, geometry);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::driver::LookAheadPoint;

    #[test]
    fn without_smoothing_predictions_stay_as_they_are_and_with_it_keep_their_spread() {
        let geometry = GridGeometry::paper();
        let outside = Prediction { mean: [-0.1, 1.2], sigma: [0.03, 0.05] };
        assert_eq!(smoothed(&mut ActionSmoothing::new(0.0), outside, geometry), outside);
        let mut smoothing = ActionSmoothing::new(8.0);
        let at = |ahead_m| {
            let mean = LookAheadPoint { ahead_m, left_m: 0.0 }.to_image_fraction(&geometry);
            Prediction { mean, sigma: [0.03, 0.05] }
        };
        smoothed(&mut smoothing, at(8.0), geometry);
        let second = smoothed(&mut smoothing, at(12.0), geometry);
        assert_eq!(second.sigma, [0.03, 0.05]);
        // 8 + 4 · (1 − exp(−1/8))
        assert!((second.look_ahead(geometry).ahead_m - 8.47).abs() < 1e-3, "{second:?}");
    }
}
