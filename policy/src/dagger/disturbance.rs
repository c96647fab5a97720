//! Disturbance injection while collecting (DART, Laskey et al. 2017), so that the states after a mistake are labelled.
//!
//! With the paper's rule the expert takes over before the network's mistakes have consequences, so a car that is off the
//! middle and turned towards an obstacle is hardly ever seen. Disturbing whoever drives produces such states. The label
//! is the expert's answer, never the disturbed one.
//!
//! Disturbances can be aimed at what is dangerous instead, as in SAFE-GIL (Ciftci et al. 2024): the same strengths, always
//! towards the side on which the car would come closer to what it must not touch.

use rand::RngExt as _;
use serde::{Deserialize, Serialize};
use sim::driver::{GroundTruth, LookAheadPoint};
use sim::maths;
use sim::seed::Rng;
use sim::vehicle::VehicleSettings;

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
    /// The side to which the steering is disturbed.
    pub aim: Aim,
}

/// The side to which the steering is disturbed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Aim {
    /// Either (DART).
    Random,
    /// Where less room is left (SAFE-GIL).
    Danger,
}

impl DisturbanceSettings {
    /// None (paper).
    pub fn off() -> Self {
        Self { enabled: false, ..Self::quick() }
    }

    /// As [`Self::quick`], towards danger: 706 near-collisions on development lots became 649 (docs/notebook/earlier.md).
    pub fn aimed() -> Self {
        Self { aim: Aim::Danger, ..Self::quick() }
    }

    /// One second every six: at 1.4 m/s the car is then up to 8° and a few decimetres off (all chosen).
    pub fn quick() -> Self {
        Self { enabled: true, pause_ticks: 100, duration_ticks: 20, curvature_max_per_m: 0.1, aim: Aim::Random }
    }
}

/// The disturbances of one episode.
#[derive(Debug)]
pub(crate) struct Disturbance {
    settings: DisturbanceSettings,
    /// Distance from the rear axle to the bumper, metres.
    nose_m: f32,
    rng: Rng,
    ticks_left: u32,
    curvature_per_m: f32,
}

impl Disturbance {
    pub(crate) fn new(settings: DisturbanceSettings, vehicle: &VehicleSettings, rng: Rng) -> Self {
        // To the centimetre: that of the paper's car is 3.8 m then, and not a rounding beside it.
        let nose_m = (100.0 * vehicle.front_m()).round() / 100.0;
        Self { settings, nose_m, rng, ticks_left: 0, curvature_per_m: 0.0 }
    }

    /// The point that is driven at instead in this tick.
    pub(crate) fn disturb(&mut self, point: LookAheadPoint, truth: &GroundTruth<'_>) -> LookAheadPoint {
        if self.ticks_left == 0 {
            let begins = self.rng.random_range(0..self.settings.pause_ticks.max(1)) == 0;
            if !begins {
                return point;
            }
            let max_per_m = self.settings.curvature_max_per_m;
            let drawn_per_m = self.rng.random_range(-max_per_m..=max_per_m);
            self.curvature_per_m = match self.settings.aim {
                Aim::Random => drawn_per_m,
                Aim::Danger => towards_danger(drawn_per_m, point, self.nose_m, truth),
            };
            self.ticks_left = self.settings.duration_ticks.max(1);
        }
        self.ticks_left -= 1;
        turned(point, self.curvature_per_m)
    }
}

/// The curvature or its opposite, whichever leaves less room around the nose on an arc to the point.
fn towards_danger(curvature_per_m: f32, point: LookAheadPoint, nose_m: f32, truth: &GroundTruth<'_>) -> f32 {
    /// Farther than a disturbance lasts, so that what comes next counts, metres.
    const AHEAD_M: f32 = 4.0;
    const STEPS: u8 = 8;
    let room_m = |added_per_m: f32| {
        let arc_per_m = point.curvature_per_m() + added_per_m;
        (1..=STEPS)
            .map(|k| nose_m + AHEAD_M * f32::from(k) / f32::from(STEPS))
            .map(|travel_m| {
                truth.map.signed_distance_m(truth.vehicle.pose.advanced_along_arc(arc_per_m, travel_m).position())
            })
            .fold(f32::INFINITY, f32::min)
    };
    if room_m(-curvature_per_m) < room_m(curvature_per_m) { -curvature_per_m } else { curvature_per_m }
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
    use sim::geometry::{Pose, Vec2};
    use sim::map::Map;
    use sim::scenario::{LotNoise, ReferencePath, Scenario};
    use sim::seed::{RootSeed, Stream};
    use sim::vehicle::VehicleState;

    #[test]
    fn a_disturbance_adds_its_curvature_and_keeps_the_range() {
        let point = LookAheadPoint { ahead_m: 8.0, left_m: 1.0 };
        let disturbed = turned(point, 0.05);
        assert!((disturbed.curvature_per_m() - point.curvature_per_m() - 0.05).abs() < 1e-6, "{disturbed:?}");
        assert!((maths::hypot(disturbed.ahead_m, disturbed.left_m) - 65.0_f32.sqrt()).abs() < 1e-5, "{disturbed:?}");
        assert!(turned(point, 9.0).ahead_m > 0.0, "never behind the car");
    }

    /// How far to the left the point is that is steered at instead of one straight ahead, in 100 000 ticks at a standstill
    /// beside the wall of a road that is 6 m wide.
    fn steered(settings: DisturbanceSettings, left_m: f32) -> Vec<f32> {
        let v = Vec2::new;
        let road = Scenario {
            name: "road".to_string(),
            boundary: vec![v(-4.0, -3.0), v(60.0, -3.0), v(60.0, 3.0), v(-4.0, 3.0)],
            boundary_height_m: 0.0,
            reference_path: ReferencePath { points: vec![v(0.0, 0.0), v(50.0, 0.0)], corner_radius_m: 10.0 },
            noise: LotNoise::default(),
            islands: Vec::new(),
            obstacles: Vec::new(),
            speed_bumps: Vec::new(),
        };
        let map = Map::build(road, &VehicleSettings::hyundai_hg300()).unwrap();
        let pose = Pose::new(map.start().position() + Vec2::new(10.0, left_m), 0.0);
        let truth = GroundTruth { map: &map, vehicle: VehicleState::at_rest(pose), progress_m: 10.0 };
        let straight = LookAheadPoint { ahead_m: 10.0, left_m: 0.0 };
        let rng = RootSeed(1).rng(Stream::Disturbance, 0);
        let mut disturbance = Disturbance::new(settings, &VehicleSettings::hyundai_hg300(), rng);
        assert_eq!(disturbance.nose_m, 3.8, "what trainings of before had");
        (0..100_000).map(|_| disturbance.disturb(straight, &truth).left_m).collect()
    }

    #[test]
    fn disturbances_can_be_aimed_at_the_nearer_wall() {
        let aimed = DisturbanceSettings { aim: Aim::Danger, ..DisturbanceSettings::quick() };
        assert!(steered(aimed, 1.0).iter().all(|&left_m| left_m >= 0.0));
        assert!(steered(aimed, -1.0).iter().all(|&left_m| left_m <= 0.0));
        let strengths =
            |steered: Vec<f32>| steered.into_iter().map(|left_m| left_m.abs().to_bits()).collect::<Vec<_>>();
        assert_eq!(strengths(steered(aimed, 1.0)), strengths(steered(DisturbanceSettings::quick(), 1.0)), "as strong");
    }

    /// In 100 000 ticks about 100 000 / (100 + 20 − 1) · 20 are disturbed, to both sides, each at one strength.
    #[test]
    fn disturbances_come_as_often_and_last_as_long_as_they_should() {
        let steered = steered(DisturbanceSettings::quick(), 0.0);
        let disturbed = steered.iter().filter(|&&left_m| left_m != 0.0).count();
        assert!((15_500..18_100).contains(&disturbed), "{disturbed}");
        let lefts = steered.iter().filter(|&&left_m| left_m > 0.0).count();
        assert!((0.4..0.6).contains(&(lefts as f64 / disturbed as f64)), "{lefts} of {disturbed}");
        let strengths = steered.chunk_by(|a, b| a == b).filter(|pulse| pulse[0] != 0.0);
        assert!(strengths.clone().all(|pulse| pulse.len().is_multiple_of(20)) && strengths.count() > 700);
    }
}
