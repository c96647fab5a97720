//! The way ahead as an elastic band: a plan's way, pulled into the middle of the free space and straightened.
//!
//! The plans of the search are two arcs out of a few hundred. Which of them wins changes with centimetres, and so
//! would a label taken from the winner; no network could learn that from a grid of half-metre cells. The band forgets
//! which plan it came from: it is where a person would drive, and it lies still in the world while the car moves.

use crate::config::BandConfig;
use sim::distance_field::DistanceField;
use sim::geometry::Vec2;

/// Points of a band: 15 m.
pub(crate) const POINTS: usize = 26;
/// Distance between the points of a band, metres.
pub(crate) const SPACING_M: f32 = 0.6;
/// Reach of the central difference that finds the middle, metres: wide enough to round off the ridge of the distances.
const PROBE_M: f32 = 0.4;

/// Points of the rear axle's way, world, the first under the axle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Band {
    points: [Vec2; POINTS],
    /// Travel from the first point to each.
    travels_m: [f32; POINTS],
}

impl Band {
    /// A band along given points, [`SPACING_M`] apart, straight on where they end.
    pub(crate) fn along(way: impl Iterator<Item = Vec2>, ahead: Vec2) -> Self {
        let mut points = [Vec2::ZERO; POINTS];
        let mut n = 0;
        for point in way.take(POINTS) {
            points[n] = point;
            n += 1;
        }
        let step = if n >= 2 { points[n - 1] - points[n - 2] } else { ahead * SPACING_M };
        for i in n.max(1)..POINTS {
            points[i] = points[i - 1] + step;
        }
        let mut band = Self { points, travels_m: [0.0; POINTS] };
        band.measure();
        band
    }

    pub(crate) fn length_m(&self) -> f32 {
        self.travels_m[POINTS - 1]
    }

    fn measure(&mut self) {
        for i in 1..POINTS {
            self.travels_m[i] = self.travels_m[i - 1] + self.points[i].distance(self.points[i - 1]);
        }
    }

    /// Pulls the band into the middle of the free space and straightens it; its first point stays.
    pub(crate) fn relax(&mut self, field: &DistanceField, config: &BandConfig) {
        let stiff = (config.stiffness_m / SPACING_M).round() as usize;
        for _ in 0..config.iterations {
            for i in 1..POINTS {
                let here = self.points[i];
                let reach = stiff.min(i).min(POINTS - 1 - i);
                // Middle of its neighbours; at the free end, straight on.
                let (straight, along) = if reach > 0 {
                    let (before, after) = (self.points[i - reach], self.points[i + reach]);
                    (0.5 * (before + after), after - before)
                } else {
                    let (before, earlier) = (self.points[i - 1], self.points[i - 2]);
                    (before + (before - earlier), here - earlier)
                };
                let left = along.normalize_or_zero().perp();
                let push = |side: f32| {
                    let missing_m = (config.comfort_m - field.at(here + left * (side * PROBE_M))).max(0.0);
                    missing_m * missing_m
                };
                let to_middle = (push(-1.0) - push(1.0)) * (config.middle_gain / (4.0 * PROBE_M));
                let step = (straight - here) * config.straight_gain + left * to_middle;
                self.points[i] = here + step.clamp_length_max(config.step_max_m);
            }
        }
        self.measure();
    }

    /// Its points up to some travel.
    pub(crate) fn until(&self, travel_m: f32) -> impl Iterator<Item = Vec2> {
        let n = self.travels_m.partition_point(|&at_m| at_m < travel_m);
        self.points[..n].iter().copied()
    }

    /// Direction of the band around some travel, unit vector: over 2.4 m, so that no wiggle shows.
    pub(crate) fn heading_at(&self, travel_m: f32) -> Vec2 {
        (self.at(travel_m + 1.2) - self.at(travel_m - 1.2)).normalize_or_zero()
    }

    /// The point after some travel along the band; its end where the band is shorter.
    pub(crate) fn at(&self, travel_m: f32) -> Vec2 {
        // The first segment that does not end before the travel.
        let i = self.travels_m[1..POINTS - 1].partition_point(|&end_m| end_m < travel_m);
        let length_m = (self.travels_m[i + 1] - self.travels_m[i]).max(f32::MIN_POSITIVE);
        let share = ((travel_m - self.travels_m[i]) / length_m).clamp(0.0, 1.0);
        self.points[i].lerp(self.points[i + 1], share)
    }
}
