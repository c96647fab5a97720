//! Action smoothing: the point that is driven at is an exponential mean of a driver's answers (docs/methods.md 4.1).
//!
//! Answers to successive grids differ by sensor noise, and the car responds to each with a delay, which can build up to
//! weaving. A mean over some ticks damps it.

use crate::driver::{Decision, Fleet, LookAheadPoint, Seat};
use crate::maths;

/// The smoothing of one car.
#[derive(Debug, Clone)]
pub struct ActionSmoothing {
    /// Share of the way from the mean to a new answer, 0…1.
    gain: f32,
    mean: Option<Aim>,
}

/// A look-ahead point as pure pursuit drives it.
#[derive(Debug, Clone, Copy)]
struct Aim {
    curvature_per_m: f32,
    range_m: f32,
}

impl ActionSmoothing {
    /// A smoothing with a time constant in control ticks, 0 or more; 0 drives at the last answer alone.
    pub fn new(ticks: f32) -> Self {
        // The response to a step is 1 − exp(−t / time constant).
        let gain = if ticks > 0.0 { 1.0 - maths::exp(-1.0 / ticks) } else { 1.0 };
        Self { gain, mean: None }
    }

    /// Whether answers are changed at all.
    pub fn is_on(&self) -> bool {
        self.gain != 1.0
    }

    /// The exponential mean of curvature and range over the answers so far; the first is taken at once. A point behind the
    /// axle is taken for the one ahead that is as far on the same circle.
    pub fn smoothed(&mut self, answer: LookAheadPoint) -> LookAheadPoint {
        if !self.is_on() {
            return answer;
        }
        let aim = Aim::at(answer);
        let mean = self.mean.map_or(aim, |mean| mean.towards(aim, self.gain));
        self.mean = Some(mean);
        mean.point()
    }

    /// Forgets the past; to be called when the car was put back on the path.
    pub fn reset(&mut self) {
        self.mean = None;
    }
}

/// The smoothing of every car of a batch.
#[derive(Debug, Clone)]
pub struct FleetSmoothing {
    fresh: ActionSmoothing,
    by_episode: Vec<ActionSmoothing>,
}

impl FleetSmoothing {
    /// A smoothing with a time constant in control ticks, as for [`ActionSmoothing::new`].
    pub fn new(ticks: f32) -> Self {
        Self { fresh: ActionSmoothing::new(ticks), by_episode: Vec::new() }
    }

    /// That of the car at a seat, reset if the car was.
    pub fn of(&mut self, seat: &Seat<'_>) -> &mut ActionSmoothing {
        if self.by_episode.len() <= seat.episode {
            self.by_episode.resize(seat.episode + 1, self.fresh.clone());
        }
        let smoothing = &mut self.by_episode[seat.episode];
        if seat.was_reset {
            smoothing.reset();
        }
        smoothing
    }
}

/// A fleet whose answers are smoothed: what lets drivers be compared on equal terms.
#[derive(Debug, Clone)]
pub struct SmoothedFleet<F> {
    fleet: F,
    smoothing: FleetSmoothing,
}

impl<F: Fleet> SmoothedFleet<F> {
    /// A fleet with a time constant in control ticks, as for [`ActionSmoothing::new`].
    pub fn new(fleet: F, ticks: f32) -> Self {
        Self { fleet, smoothing: FleetSmoothing::new(ticks) }
    }
}

impl<F: Fleet> Fleet for SmoothedFleet<F> {
    fn decide(&mut self, seats: &[Seat<'_>], decisions: &mut Vec<Decision>) {
        let first = decisions.len();
        self.fleet.decide(seats, decisions);
        for (seat, decision) in seats.iter().zip(&mut decisions[first..]) {
            decision.look_ahead = self.smoothing.of(seat).smoothed(decision.look_ahead);
        }
    }
}

impl Aim {
    fn at(point: LookAheadPoint) -> Self {
        Self { curvature_per_m: point.curvature_per_m(), range_m: maths::hypot(point.ahead_m, point.left_m) }
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

    fn at(ahead_m: f32, left_m: f32) -> LookAheadPoint {
        LookAheadPoint { ahead_m, left_m }
    }

    #[test]
    fn without_smoothing_answers_stay_as_they_are_to_the_bit() {
        let mut smoothing = ActionSmoothing::new(0.0);
        let outside = at(-1.3, 7.1);
        assert_eq!([at(9.0, 1.0), outside].map(|answer| smoothing.smoothed(answer)), [at(9.0, 1.0), outside]);
    }

    #[test]
    fn a_step_is_followed_exponentially_and_a_constant_answer_exactly() {
        let mut smoothing = ActionSmoothing::new(8.0);
        let first = smoothing.smoothed(at(8.0, 0.0));
        assert!((first.ahead_m - 8.0).abs() < 1e-5 && first.left_m.abs() < 1e-5, "the first answer is taken at once");
        let reached_m = (0..8).map(|_| smoothing.smoothed(at(12.0, 0.0)).ahead_m).last().unwrap();
        // 8 + 4 · (1 − 1/e): one time constant later.
        assert!((reached_m - 10.5285).abs() < 1e-3, "{reached_m}");
        smoothing.reset();
        let again = smoothing.smoothed(at(6.0, -2.0));
        assert!((again.ahead_m - 6.0).abs() < 1e-4 && (again.left_m + 2.0).abs() < 1e-4, "{again:?}");
    }

    #[test]
    fn a_point_behind_the_axle_becomes_the_one_ahead_on_the_same_circle() {
        let ahead = ActionSmoothing::new(8.0).smoothed(at(-1.3, 7.1));
        assert!((ahead.ahead_m - 1.3).abs() < 1e-4 && (ahead.left_m - 7.1).abs() < 1e-4, "{ahead:?}");
    }
}
