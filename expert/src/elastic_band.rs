//! The way ahead as an elastic band (Quinlan & Khatib 1993): a plan's way, pulled into the middle of the free space and
//! straightened.
//!
//! A plan of the search is two arcs out of a few hundred. Centimetres decide which plan wins, and so would a label taken
//! from the winner; no network could learn that from a grid of half-metre cells. The relaxed band hardly depends on the
//! plan it came from: it lies where a person would drive, and stays in place while the car moves.

use crate::line_of_sight::KnownGround;
use crate::settings::ElasticBandSettings;
use sim::geometry::Vec2;
use sim::vectors::{FourPoints, f32x4};

/// Points of a band: 15 m.
pub(crate) const POINTS: usize = 26;
/// Distance between the points of a band, metres.
pub const SPACING_M: f32 = 0.6;
/// Reach of the central difference that finds the middle, metres: wide enough to round off the ridge of the distances.
const PROBE_M: f32 = 0.4;

/// Points of the rear axle's way, world, the first under the axle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ElasticBand {
    points: [Vec2; POINTS],
    /// Travel from the first point to each.
    travels_m: [f32; POINTS],
}

impl ElasticBand {
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
    ///
    /// Each round goes from the first point to the last, and a point looks `stiff` points back, where this round has
    /// been, and as many ahead, where only the round before has. So while this round is at one point, the next can be
    /// `stiff + 1` points behind it, and so on: those are moved side by side, four at a time.
    pub(crate) fn relax(&mut self, ground: KnownGround<'_>, settings: &ElasticBandSettings) {
        let stiff = ((settings.stiffness_m / SPACING_M).round() as usize).max(1);
        let (apart, last) = (stiff + 1, POINTS - 1);
        let rounds = settings.iterations as usize;
        for tick in 1..(last + apart * rounds).saturating_sub(stiff) {
            // The rounds under way. Point of a round: tick - round * apart.
            let from = tick.saturating_sub(last).div_ceil(apart);
            let to = rounds.min((tick - 1) / apart + 1);
            for first in (from..to).step_by(4) {
                let four = std::array::from_fn(|lane| tick - (first + lane).min(to - 1) * apart);
                self.move_four(four, stiff, ground, settings);
            }
        }
        self.measure();
    }

    /// One step of four points towards the middle of the free space and straightness.
    fn move_four(&mut self, four: [usize; 4], stiff: usize, ground: KnownGround<'_>, settings: &ElasticBandSettings) {
        let here = four.map(|i| self.points[i]);
        let (mut straight, mut along) = ([Vec2::ZERO; 4], [Vec2::ZERO; 4]);
        for (lane, i) in four.into_iter().enumerate() {
            let reach = stiff.min(i).min(POINTS - 1 - i);
            // Middle of its neighbours; at the free end, straight on.
            (straight[lane], along[lane]) = if reach > 0 {
                let (before, after) = (self.points[i - reach], self.points[i + reach]);
                (0.5 * (before + after), after - before)
            } else {
                let (before, earlier) = (self.points[i - 1], self.points[i - 2]);
                (before + (before - earlier), here[lane] - earlier)
            };
        }
        let (here, straight) = (FourPoints::from(here), FourPoints::from(straight));
        let left = left_of(along.into());
        let push = |side: f32| {
            let at_m = ground.at_four(here + left * f32x4::splat(side * PROBE_M));
            let missing_m = (f32x4::splat(settings.comfort_m) - at_m).fast_max(f32x4::ZERO);
            missing_m * missing_m
        };
        let to_middle = (push(-1.0) - push(1.0)) * f32x4::splat(settings.middle_gain / (4.0 * PROBE_M));
        let step = (straight - here) * f32x4::splat(settings.straight_gain) + left * to_middle;
        let there = here + shortened(step, settings.step_max_m);
        let (x, y) = (there.x.to_array(), there.y.to_array());
        for (lane, i) in four.into_iter().enumerate() {
            self.points[i] = Vec2::new(x[lane], y[lane]);
        }
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

/// Unit vectors to the left of four vectors; of those without a direction, zero.
#[inline]
fn left_of(along: FourPoints) -> FourPoints {
    let per_length = f32x4::ONE / (along.x * along.x + along.y * along.y).sqrt();
    let has_direction = per_length.simd_lt(f32x4::splat(f32::INFINITY)) & per_length.simd_gt(f32x4::ZERO);
    let unit = along * (per_length & has_direction);
    FourPoints { x: -unit.y, y: unit.x }
}

/// Four vectors, none longer than `length_max_m`.
#[inline]
fn shortened(vectors: FourPoints, length_max_m: f32) -> FourPoints {
    let square = vectors.x * vectors.x + vectors.y * vectors.y;
    let length_max_m = f32x4::splat(length_max_m);
    let is_long = square.simd_gt(length_max_m * length_max_m);
    if is_long.none() {
        return vectors;
    }
    let length_m = square.sqrt();
    let shortened = |of_axis: f32x4| is_long.select(length_max_m * (of_axis / length_m), of_axis);
    FourPoints { x: shortened(vectors.x), y: shortened(vectors.y) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ExpertSettings;
    use crate::line_of_sight::LineOfSight;
    use sim::distance_field::DistanceField;

    /// One point after the other, one round after the other: what moving points side by side must equal to the bit.
    fn relax_in_order(band: &mut ElasticBand, field: &DistanceField, settings: &ElasticBandSettings) {
        let stiff = ((settings.stiffness_m / SPACING_M).round() as usize).max(1);
        for _ in 0..settings.iterations {
            for i in 1..POINTS {
                let here = band.points[i];
                let reach = stiff.min(i).min(POINTS - 1 - i);
                let (straight, along) = if reach > 0 {
                    let (before, after) = (band.points[i - reach], band.points[i + reach]);
                    (0.5 * (before + after), after - before)
                } else {
                    let (before, earlier) = (band.points[i - 1], band.points[i - 2]);
                    (before + (before - earlier), here - earlier)
                };
                let left = along.normalize_or_zero().perp();
                let push = |side: f32| {
                    let missing_m = (settings.comfort_m - field.at(here + left * (side * PROBE_M))).max(0.0);
                    missing_m * missing_m
                };
                let to_middle = (push(-1.0) - push(1.0)) * (settings.middle_gain / (4.0 * PROBE_M));
                let step = (straight - here) * settings.straight_gain + left * to_middle;
                band.points[i] = here + step.clamp_length_max(settings.step_max_m);
            }
        }
        band.measure();
    }

    #[test]
    fn points_moved_side_by_side_end_where_they_would_in_order() {
        let lane = [(-3.0, -1.4), (30.0, -1.9), (30.0, 1.2), (-3.0, 1.6)].map(|(x, y)| Vec2::new(x, y));
        let mut field = DistanceField::of_boundary(&lane);
        field.carve_disc(Vec2::new(6.0, 1.1), 0.5);
        field.carve_disc(Vec2::new(11.0, -1.2), 0.6);
        for (rounds, stiffness_m) in [(0, 0.6), (1, 0.6), (7, 1.2), (60, 0.6), (60, 3.0), (5, 9.0)] {
            let settings =
                ElasticBandSettings { iterations: rounds, stiffness_m, ..ExpertSettings::half_points().elastic_band };
            let way = (0..20).map(|i| Vec2::new(0.6 * i as f32, 0.02 * (i * i % 17) as f32));
            let (mut band, mut expected) = (ElasticBand::along(way.clone(), Vec2::X), ElasticBand::along(way, Vec2::X));
            let sight = LineOfSight::of_everything();
            band.relax(KnownGround { field: &field, sight: &sight }, &settings);
            relax_in_order(&mut expected, &field, &settings);
            assert_eq!(band.points, expected.points, "{rounds} rounds, stiffness {stiffness_m} m");
            assert_eq!(band.travels_m, expected.travels_m);
        }
    }
}
