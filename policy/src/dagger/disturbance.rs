//! Disturbance injection while collecting (DART, Laskey et al. 2017), so that the states after a mistake are labelled.
//!
//! With the paper's rule the expert takes over before the network's mistakes have consequences, so a car that is off the
//! middle and turned towards an obstacle is hardly ever seen. Disturbing whoever drives produces such states. The label
//! is the expert's answer, never the disturbed one.

use rand::RngExt as _;
use serde::{Deserialize, Serialize};
use sim::driver::LookAheadPoint;
use sim::maths;
use sim::seed::Rng;

/// How often, how long and how hard the steering is disturbed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DisturbanceSettings {
    /// Whether there are disturbances at all.
    pub enabled: bool,
    /// Mean time from the end of a disturbance to the start of the next, ticks.
    pub pause_ticks: u32,
    /// Length of a disturbance, ticks.
    pub duration_ticks: u32,
    /// Largest change of the steered curvature, 1/m. Each disturbance draws its own uniformly from minus this to this.
    pub curvature_max_per_m: f32,
}

impl DisturbanceSettings {
    /// None (paper).
    pub fn off() -> Self {
        Self { enabled: false, ..Self::quick() }
    }

    /// One second every six: at 1.4 m/s the car is then up to 8° and a few decimetres off (all chosen).
    pub fn quick() -> Self {
        Self { enabled: true, pause_ticks: 100, duration_ticks: 20, curvature_max_per_m: 0.1 }
    }
}

/// The disturbances of one episode.
#[derive(Debug)]
pub(crate) struct Disturbance {
    settings: DisturbanceSettings,
    rng: Rng,
    ticks_left: u32,
    curvature_per_m: f32,
}

impl Disturbance {
    pub(crate) fn new(settings: DisturbanceSettings, rng: Rng) -> Self {
        Self { settings, rng, ticks_left: 0, curvature_per_m: 0.0 }
    }

    /// The point that is driven at instead in this tick.
    pub(crate) fn disturb(&mut self, point: LookAheadPoint) -> LookAheadPoint {
        if self.ticks_left == 0 {
            let begins = self.rng.random_range(0..self.settings.pause_ticks.max(1)) == 0;
            if !begins {
                return point;
            }
            let max_per_m = self.settings.curvature_max_per_m;
            self.curvature_per_m = self.rng.random_range(-max_per_m..=max_per_m);
            self.ticks_left = self.settings.duration_ticks.max(1);
        }
        self.ticks_left -= 1;
        turned(point, self.curvature_per_m)
    }
}

/// The point at the same distance on an arc whose curvature is larger by `curvature_per_m`.
fn turned(point: LookAheadPoint, curvature_per_m: f32) -> LookAheadPoint {
    let range_m = maths::hypot(point.ahead_m, point.left_m);
    // Pure pursuit: κ = 2 sin θ / L.
    let sin = (0.5 * range_m * (point.curvature_per_m() + curvature_per_m)).clamp(-0.95, 0.95);
    LookAheadPoint { ahead_m: range_m * (1.0 - sin * sin).sqrt(), left_m: range_m * sin }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::seed::{RootSeed, Stream};

    #[test]
    fn a_disturbance_adds_its_curvature_and_keeps_the_range() {
        let point = LookAheadPoint { ahead_m: 8.0, left_m: 1.0 };
        let disturbed = turned(point, 0.05);
        assert!((disturbed.curvature_per_m() - point.curvature_per_m() - 0.05).abs() < 1e-6, "{disturbed:?}");
        assert!((maths::hypot(disturbed.ahead_m, disturbed.left_m) - 65.0_f32.sqrt()).abs() < 1e-5, "{disturbed:?}");
        assert!(turned(point, 9.0).ahead_m > 0.0, "never behind the car");
    }

    /// In 100 000 ticks about 100 000 / (100 + 20 − 1) · 20 are disturbed, to both sides, each at one strength.
    #[test]
    fn disturbances_come_as_often_and_last_as_long_as_they_should() {
        let straight = LookAheadPoint { ahead_m: 10.0, left_m: 0.0 };
        let mut disturbance = Disturbance::new(DisturbanceSettings::quick(), RootSeed(1).rng(Stream::Disturbance, 0));
        let steered: Vec<f32> = (0..100_000).map(|_| disturbance.disturb(straight).left_m).collect();
        let disturbed = steered.iter().filter(|&&left_m| left_m != 0.0).count();
        assert!((15_500..18_100).contains(&disturbed), "{disturbed}");
        let lefts = steered.iter().filter(|&&left_m| left_m > 0.0).count();
        assert!((0.4..0.6).contains(&(lefts as f64 / disturbed as f64)), "{lefts} of {disturbed}");
        let strengths = steered.chunk_by(|a, b| a == b).filter(|pulse| pulse[0] != 0.0);
        assert!(strengths.clone().all(|pulse| pulse.len().is_multiple_of(20)) && strengths.count() > 700);
    }
}
