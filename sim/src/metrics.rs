//! What is measured on a run (docs/methods.md 8): always on the clean map.

use crate::collision::ObstacleSet;
use crate::distance_field::{DistanceField, change_max_m, interpolated_change_max_m};
use crate::driver::Source;
use crate::frame::{Event, Frame};
use crate::geometry::{Pose, Vec2, bounds, edges};
use crate::vectors::{FourPoints, LANES, Picked, f32x4};
use crate::vehicle::VehicleSettings;
use serde::{Deserialize, Serialize};

/// Definitions of the metrics and of stop–count–resume.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MetricsSettings {
    /// A near-collision is something within this travel along the present arc, metres (paper: 0.5 m).
    pub near_collision_m: f32,
    /// What counts as something. Safe ratio and clearance are of all that is not drivable, whatever this says.
    pub obstacle_set: ObstacleSet,
    /// Width of the safe-distance range around the bumper, metres (paper: 1.0 m).
    pub safe_range_m: f32,
    /// Which part of the range.
    pub safe_range: SafeRange,
    /// After a resume no near-collision is counted for this long, seconds.
    pub refractory_s: f32,
    /// A run is given up after this many near-collisions and stuck events.
    pub events_max: u32,
    /// Less progress than this …, metres
    pub stuck_progress_m: f32,
    /// … within this time counts as stuck, seconds.
    pub stuck_after_s: f32,
    /// A run is given up after this time, seconds.
    pub timeout_s: f32,
    /// A resume needs this much free path ahead, metres.
    pub resume_free_m: f32,
}

impl MetricsSettings {
    /// The paper's definitions where it gives them, docs/methods.md 8 elsewhere.
    pub fn paper() -> Self {
        Self {
            near_collision_m: 0.5,
            obstacle_set: ObstacleSet::NonDrivable,
            safe_range_m: 1.0,
            safe_range: SafeRange::Full,
            refractory_s: 1.0,
            events_max: 60,
            stuck_progress_m: 0.5,
            stuck_after_s: 10.0,
            timeout_s: 900.0,
            resume_free_m: 3.0,
        }
    }
}

/// Where the safe-distance range lies. The paper says "from the end of the bumper" and draws a ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SafeRange {
    /// All around the body.
    #[default]
    Full,
    /// Only what lies ahead of the front bumper.
    FrontOnly,
}

/// The pixels within the safe range of the body, in the ego frame: N_ran of the paper.
///
/// They are looked up by squares: where the centre of a square is far from any boundary, all or none of it is drivable;
/// of others, the quarters are looked up.
#[derive(Debug, Clone)]
pub struct SafeRing {
    /// Four by four, blocks of 4×4 pixels.
    blocks: Vec<FourSquares>,
    /// The quarters of each block.
    quarters: Vec<FourSquares>,
    /// The pixels of each quarter.
    pixels: Vec<FourSquares>,
    n_pixels: u32,
    pixel_m: f32,
}

/// The squares of a [`SafeRing`] whose centre does not tell whether they are drivable. A car keeps it from tick to tick: it
/// has room for all of them.
#[derive(Debug, Clone)]
pub struct Undecided {
    blocks: Picked,
    quarters: Picked,
}

/// Four squares of pixels, of which only those in the range count.
#[derive(Debug, Clone, Copy)]
struct FourSquares {
    centres: FourPoints,
    n_pixels: f32x4,
}

/// Pixels per side of a block.
const BLOCK: u8 = 4;
/// Pixels per side of a quarter of a block.
const QUARTER: u8 = BLOCK / 2;

impl FourSquares {
    /// Number of pixels that are drivable because the centres of their squares, at these distances, are farther from any
    /// boundary than `sure_m`; and the squares of which the centre does not tell, bit = lane.
    #[inline]
    fn surely_drivable(&self, centres_m: f32x4, sure_m: f32x4) -> (f32x4, u32) {
        let is_drivable = centres_m.simd_gt(sure_m);
        (is_drivable & self.n_pixels, !(is_drivable | centres_m.simd_lt(-sure_m)).to_bitmask())
    }
}

impl SafeRing {
    /// The ring (body ⊕ disc) minus body, at a pixel size.
    pub fn new(vehicle: &VehicleSettings, settings: &MetricsSettings, pixel_m: f32) -> Self {
        let body = vehicle.body_in_ego();
        let front_m = if settings.safe_range == SafeRange::Full { f32::NEG_INFINITY } else { vehicle.front_m() };
        let in_range = |points: FourPoints| {
            let is_near = |(a, b)| points.distance_to_segment_m(a, b).simd_le(f32x4::splat(settings.safe_range_m));
            let is_near = edges(&body).map(is_near).fold(f32x4::ZERO, |any, near| any | near);
            let is_ahead = points.x.simd_ge(f32x4::splat(front_m));
            is_near & is_ahead & !points.are_inside(&body) & f32x4::ONE
        };
        let block_m = pixel_m * f32::from(BLOCK);
        let (low, high) = bounds(&body);
        let reach = Vec2::splat(settings.safe_range_m);
        let first = ((low - reach) / block_m).floor().as_ivec2() - 1;
        let last = ((high + reach) / block_m).floor().as_ivec2();
        let mut ring = Self { blocks: Vec::new(), quarters: Vec::new(), pixels: Vec::new(), n_pixels: 0, pixel_m };
        let mut blocks = Vec::new();
        for (row, col) in (first.x..=last.x).flat_map(|row| (first.y..=last.y).map(move |col| (row, col))) {
            // A pixel centre lies on the axle, so that neither the body's sides nor the ring's fall on centres.
            let corner = Vec2::new(row as f32, col as f32) * block_m;
            let centre_of = |side: u8, row: u8, col: u8| {
                let to_centre = 0.5 * (f32::from(side) - 1.0);
                corner + (Vec2::new(f32::from(row), f32::from(col)) + to_centre) * pixel_m
            };
            let firsts = [(0, 0), (0, QUARTER), (QUARTER, 0), (QUARTER, QUARTER)];
            let pixels = firsts.map(|(row, col)| {
                let centres = [0, 1, 2, 3].map(|i| centre_of(1, row + i / QUARTER, col + i % QUARTER)).into();
                FourSquares { centres, n_pixels: in_range(centres) }
            });
            let quarters = FourSquares {
                centres: firsts.map(|(row, col)| centre_of(QUARTER, row, col)).into(),
                n_pixels: pixels.map(|pixels| pixels.n_pixels.reduce_add()).into(),
            };
            let n_pixels = quarters.n_pixels.reduce_add();
            if n_pixels > 0.0 {
                blocks.push((centre_of(BLOCK, 0, 0), n_pixels));
                ring.quarters.push(quarters);
                ring.pixels.extend(pixels);
                ring.n_pixels += n_pixels as u32;
            }
        }
        // What fills up the last four has no pixels.
        let no_pixels = FourSquares { centres: FourPoints::splat(Vec2::ZERO), n_pixels: f32x4::ZERO };
        blocks.resize(blocks.len().next_multiple_of(LANES), (Vec2::ZERO, 0.0));
        ring.quarters.resize(blocks.len(), no_pixels);
        ring.pixels.resize(blocks.len() * LANES, no_pixels);
        let four = |four: &[(Vec2, f32); LANES]| FourSquares {
            centres: four.map(|(centre, _)| centre).into(),
            n_pixels: four.map(|(_, n_pixels)| n_pixels).into(),
        };
        ring.blocks = blocks.as_chunks().0.iter().map(four).collect();
        ring
    }

    /// Number of pixels in the range.
    pub fn n_pixels(&self) -> u32 {
        self.n_pixels
    }

    /// Room for any of its squares to be left undecided.
    pub fn undecided(&self) -> Undecided {
        Undecided { blocks: Picked::up_to(self.quarters.len()), quarters: Picked::up_to(self.pixels.len()) }
    }

    /// Share of the range that is drivable, 0…1: N_dri / N_ran; 1 of a range that holds no pixel. What `undecided` held
    /// before does not count.
    pub fn safe_ratio(&self, distance: &DistanceField, pose: Pose, undecided: &mut Undecided) -> f32 {
        let (world_from_ego, pixel_m) = (pose.world_from_ego(), self.pixel_m);
        // Where the centre is farther from a boundary than the pixels are from it, one look-up decides.
        let to_corner_m = |side: u8| std::f32::consts::FRAC_1_SQRT_2 * pixel_m * (f32::from(side) - 1.0);
        let block_m = f32x4::splat(change_max_m(to_corner_m(BLOCK)));
        let quarter_m = f32x4::splat(interpolated_change_max_m(to_corner_m(QUARTER)));
        let mut n_drivable = f32x4::ZERO;
        let Undecided { blocks: unsure_blocks, quarters: unsure_quarters } = undecided;
        unsure_blocks.clear();
        unsure_quarters.clear();
        for (i, blocks) in self.blocks.iter().enumerate() {
            let centres_m = distance.at_four_nearest_nodes(world_from_ego.four_points(blocks.centres));
            let (n_pixels, unsure) = blocks.surely_drivable(centres_m, block_m);
            n_drivable += n_pixels;
            unsure_blocks.pick(i * LANES, unsure);
        }
        for block in unsure_blocks.iter() {
            let quarters = &self.quarters[block];
            let centres_m = distance.at_four(world_from_ego.four_points(quarters.centres));
            let (n_pixels, unsure) = quarters.surely_drivable(centres_m, quarter_m);
            n_drivable += n_pixels;
            unsure_quarters.pick(block * LANES, unsure);
        }
        for quarter in unsure_quarters.iter() {
            let FourSquares { centres, n_pixels } = self.pixels[quarter];
            let distances_m = distance.at_four(world_from_ego.four_points(centres));
            n_drivable += distances_m.simd_gt(f32x4::ZERO) & n_pixels;
        }
        if self.n_pixels == 0 { 1.0 } else { n_drivable.reduce_add() / self.n_pixels as f32 }
    }
}

/// Everything measured on one run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct EpisodeMetrics {
    /// Control ticks with a decision.
    pub ticks: u32,
    /// Ticks driven by the learned policy.
    pub novice_ticks: u32,
    /// Simulated time, seconds, braking included.
    pub duration_s: f32,
    /// Way driven by the rear axle, metres.
    pub driven_m: f32,
    /// Length of the reference path, metres: the denominator of the collision rate (paper).
    pub reference_m: f32,
    /// Near-collisions counted.
    pub near_collisions: u32,
    /// Times the body touched something.
    pub contacts: u32,
    /// Times the car got stuck.
    pub stuck: u32,
    /// Mean over ticks of the drivable share of the safe range, 0…1.
    pub safe_ratio: f32,
    /// Smallest distance between body and non-drivable space, metres, capped at 3 m, negative where they overlap; infinite
    /// before the first tick. Sampled at every observation and where an emergency stop ends; at most 0 once there was a
    /// contact, wherever that fell.
    pub clearance_min_m: f32,
    /// Changes of the steering direction by more than 2° of road-wheel angle: the steering reversals of SAE J2944, with
    /// a gap (chosen) that ignores the response to noise. Wheels straightened by a resume do not count.
    pub steering_reversals: u32,
    /// Road-wheel angle steered, radians: the sum of all changes from tick to tick (chosen), without resumes.
    pub steering_effort_rad: f32,
}

impl EpisodeMetrics {
    /// Driven way per simulated time, m/s.
    pub fn mean_speed_mps(&self) -> f32 {
        self.driven_m / self.duration_s.max(f32::MIN_POSITIVE)
    }
}

/// Accumulates frames into metrics.
#[derive(Debug, Clone, Default)]
pub struct MetricsAccumulator {
    metrics: EpisodeMetrics,
    safe_ratio_sum: f64,
    driven_m: f64,
    steering_effort_rad: f64,
    steering: Steering,
}

/// Follows the road-wheel angle from one standstill on the path to the next.
#[derive(Debug, Clone, Default)]
struct Steering {
    last_rad: f32,
    /// Sign of the direction in which the wheels are being turned, 0 before the first real movement.
    turning: f32,
    /// The farthest angle in that direction.
    extreme_rad: f32,
}

/// Hysteresis of steering reversals, radians.
const REVERSAL_RAD: f32 = 2.0 * std::f32::consts::PI / 180.0;

impl MetricsAccumulator {
    /// An empty accumulator for a route of this length.
    pub fn new(reference_m: f32) -> Self {
        let metrics = EpisodeMetrics { reference_m, clearance_min_m: f32::INFINITY, ..EpisodeMetrics::default() };
        Self { metrics, ..Self::default() }
    }

    /// Of a drive that begins with the wheels at an angle, radians.
    #[must_use]
    pub(crate) fn with_wheels_at(self, steering_rad: f32) -> Self {
        Self { steering: Steering { last_rad: steering_rad, turning: 0.0, extreme_rad: steering_rad }, ..self }
    }

    /// Takes one frame into account.
    pub fn frame(&mut self, frame: &Frame) {
        let metrics = &mut self.metrics;
        metrics.ticks += 1;
        metrics.novice_ticks += u32::from(frame.decision.source == Source::Novice);
        metrics.duration_s = frame.time_s;
        // A contact may fall between two samples, and the raster that they are read from is rounded at corners.
        let clearance_m = if frame.contacts > 0 { frame.clearance_m.min(0.0) } else { frame.clearance_m };
        metrics.clearance_min_m = metrics.clearance_min_m.min(clearance_m);
        metrics.contacts += frame.contacts;
        match frame.event {
            Event::NearCollision { .. } => metrics.near_collisions += 1,
            Event::Stuck { .. } => metrics.stuck += 1,
            Event::Drove | Event::ReachedEnd => {}
        }
        self.safe_ratio_sum += f64::from(frame.safe_ratio);
        self.driven_m += f64::from(frame.driven_m);
        self.steer(frame.vehicle.steering_rad);
        if matches!(frame.event, Event::NearCollision { .. } | Event::Stuck { .. }) {
            // The next frame shows a car that was put back with straight wheels: nobody steered that.
            self.steering = Steering::default();
        }
    }

    fn steer(&mut self, steering_rad: f32) {
        let steering = &mut self.steering;
        self.steering_effort_rad += f64::from((steering_rad - steering.last_rad).abs());
        steering.last_rad = steering_rad;
        let since_extreme = steering_rad - steering.extreme_rad;
        if steering.turning * since_extreme > 0.0 {
            steering.extreme_rad = steering_rad;
        } else if since_extreme.abs() > REVERSAL_RAD {
            self.metrics.steering_reversals += u32::from(steering.turning != 0.0);
            steering.turning = since_extreme.signum();
            steering.extreme_rad = steering_rad;
        }
    }

    /// The metrics so far.
    pub fn metrics(&self) -> EpisodeMetrics {
        EpisodeMetrics {
            safe_ratio: (self.safe_ratio_sum / f64::from(self.metrics.ticks.max(1))) as f32,
            driven_m: self.driven_m as f32,
            steering_effort_rad: self.steering_effort_rad as f32,
            ..self.metrics.clone()
        }
    }
}

/// Steering reversals in a sequence of road-wheel angles (radians, one per tick), counted as in
/// [`EpisodeMetrics::steering_reversals`].
pub fn steering_reversals(angles_rad: impl IntoIterator<Item = f32>) -> u32 {
    let mut angles_rad = angles_rad.into_iter();
    let mut accumulator = MetricsAccumulator::default().with_wheels_at(angles_rad.next().unwrap_or_default());
    angles_rad.for_each(|angle| accumulator.steer(angle));
    accumulator.metrics.steering_reversals
}

/// Near-collisions per 100 m of reference path (paper, collision rate): events and metres pooled over runs. NaN of no runs.
pub fn near_collisions_per_100m<'a>(runs: impl IntoIterator<Item = &'a EpisodeMetrics>) -> f64 {
    let (events, metres) = runs.into_iter().fold((0.0, 0.0), |(events, metres), run| {
        (events + f64::from(run.near_collisions), metres + f64::from(run.reference_m))
    });
    100.0 * events / metres
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::{Decision, LookAheadPoint};
    use crate::sensing::Observation;
    use crate::vehicle::{VehicleCommand, VehicleState};

    fn ring() -> SafeRing {
        SafeRing::new(&VehicleSettings::hyundai_hg300(), &MetricsSettings::paper(), 0.06)
    }

    #[test]
    fn the_ring_has_the_area_of_methods_8_2() {
        // 2·(4.91 + 1.86)·1 + π·1² = 16.68 m² = 4634 pixels of 0.06 m, except for whole pixels at its edges.
        let n = ring().n_pixels();
        assert!(n.abs_diff(4634) < 4634 / 50, "{n} pixels");
    }

    /// Ahead of the bumper: 1.86·1 + π·1²/2 = 3.43 m² = 953 pixels.
    #[test]
    fn the_front_of_the_ring_is_a_rectangle_and_two_quarter_discs() {
        let settings = MetricsSettings { safe_range: SafeRange::FrontOnly, ..MetricsSettings::paper() };
        let n = SafeRing::new(&VehicleSettings::hyundai_hg300(), &settings, 0.06).n_pixels();
        assert!(n.abs_diff(953) < 953 / 30, "{n} pixels");
    }

    /// 3 in 200 m and 1 in 300 m are 0.8 per 100 m, not the mean of 1.5 and 0.33; 30 m in 20 s are 1.5 m/s.
    #[test]
    fn rates_pool_events_and_metres() {
        let run = |near_collisions, reference_m| EpisodeMetrics { reference_m, near_collisions, ..Default::default() };
        assert!((near_collisions_per_100m([&run(3, 200.0), &run(1, 300.0)]) - 0.8).abs() < 1e-9);
        let moved = EpisodeMetrics { driven_m: 30.0, duration_s: 20.0, ..EpisodeMetrics::default() };
        assert_eq!(moved.mean_speed_mps(), 1.5);
    }

    /// A centred car in a straight lane: docs/methods.md 8.2 lists .53, .69, .84, 1.0 for 2.6, 3.0, 3.4, ≥ 4.0 m.
    #[test]
    fn straight_lanes_give_the_derived_ratios() {
        for (width_m, expected) in [(2.6, 0.53), (3.0, 0.69), (3.4, 0.84), (4.2, 1.0)] {
            let half = 0.5 * width_m;
            let lane = [Vec2::new(-30.0, -half), Vec2::new(30.0, -half), Vec2::new(30.0, half), Vec2::new(-30.0, half)];
            let distance = DistanceField::of_boundary(&lane);
            let ratio = ring().safe_ratio(&distance, Pose::default(), &mut ring().undecided());
            assert!((ratio - expected).abs() < 0.02, "{width_m} m: {ratio}, expected {expected}");
        }
    }

    #[test]
    fn skipping_blocks_changes_no_pixel() {
        let lane = [Vec2::new(-9.0, -1.3), Vec2::new(9.0, -1.6), Vec2::new(8.0, 1.7), Vec2::new(-9.0, 1.4)];
        let distance = DistanceField::of_boundary(&lane);
        // Small pixels make more than ten thousand blocks; from 8192 on others were looked at.
        let of_pixels = |pixel_m| SafeRing::new(&VehicleSettings::hyundai_hg300(), &MetricsSettings::paper(), pixel_m);
        let mut rings = [0.06, 0.01].map(|pixel_m| {
            let ring = of_pixels(pixel_m);
            let undecided = ring.undecided();
            (ring, undecided)
        });
        assert!(rings[1].0.quarters.len() > 8192, "{} blocks", rings[1].0.quarters.len());
        for i in 0..40 {
            let (ring, undecided) = &mut rings[i % 2];
            let pose = Pose::new(Vec2::new(-4.0 + 0.2 * i as f32, 0.1), 0.02 * i as f32);
            let world_from_ego = pose.world_from_ego();
            let pixels = ring.pixels.iter().flat_map(|FourSquares { centres, n_pixels }| {
                let (xs, ys, n_pixels) = (centres.x.to_array(), centres.y.to_array(), n_pixels.to_array());
                (0..LANES).filter(move |&i| n_pixels[i] == 1.0).map(move |i| Vec2::new(xs[i], ys[i]))
            });
            let brute = pixels.filter(|&pixel| distance.at(world_from_ego.point(pixel)) > 0.0).count();
            assert_eq!(ring.safe_ratio(&distance, pose, undecided), brute as f32 / ring.n_pixels() as f32);
        }
    }

    #[test]
    fn a_range_without_a_pixel_is_wholly_drivable_and_no_nan() {
        let settings = MetricsSettings { safe_range_m: 0.001, ..MetricsSettings::paper() };
        let ring = SafeRing::new(&VehicleSettings::hyundai_hg300(), &settings, 0.06);
        let lane = [Vec2::new(-9.0, -1.3), Vec2::new(9.0, -1.3), Vec2::new(9.0, 1.3), Vec2::new(-9.0, 1.3)];
        assert_eq!(ring.n_pixels(), 0);
        let distance = DistanceField::of_boundary(&lane);
        assert_eq!(ring.safe_ratio(&distance, Pose::default(), &mut ring.undecided()), 1.0);
    }

    #[test]
    fn reversals_are_counted_with_hysteresis() {
        let count = |angles_deg: &[f32]| steering_reversals(angles_deg.iter().map(|angle| angle.to_radians()));
        assert_eq!(count(&[0.0, 5.0, 10.0, 15.0]), 0);
        assert_eq!(count(&[0.0, 5.0, 4.0, 5.0, 4.0]), 0); // within 2°
        assert_eq!(count(&[0.0, 5.0, 0.0, 5.0]), 2);
        assert_eq!(count(&[20.0, 15.0, 10.0]), 0, "the first angle is where it starts");
    }

    fn frame(tick: u32, steering_deg: f32, event: Event) -> Frame {
        let vehicle =
            VehicleState { steering_rad: steering_deg.to_radians(), ..VehicleState::at_rest(Pose::default()) };
        let decision = Decision {
            look_ahead: LookAheadPoint { ahead_m: 8.0, left_m: 0.0 },
            source: if tick == 0 { Source::Novice } else { Source::Expert },
            spread: None,
            speed_limit_mps: None,
        };
        Frame {
            tick,
            time_s: 0.05 * (tick + 1) as f32,
            vehicle,
            observation: Observation::default(),
            decision,
            command: VehicleCommand::default(),
            progress_m: 0.0,
            safe_ratio: 0.5 + 0.1 * tick as f32,
            clearance_m: 1.0 - 0.25 * tick as f32,
            driven_m: 0.1,
            contacts: u32::from(tick == 2),
            event,
        }
    }

    /// Between two samples the body touched a corner and left it: with a contact counted, a few centimetres were said to be
    /// left.
    #[test]
    fn where_something_was_touched_no_clearance_was_left() {
        let least_m = |contacts_at: u32| {
            let mut accumulator = MetricsAccumulator::new(200.0);
            for tick in 0..3 {
                let contacts = u32::from(tick == contacts_at);
                accumulator.frame(&Frame { clearance_m: 0.03, contacts, ..frame(tick, 0.0, Event::Drove) });
            }
            accumulator.metrics().clearance_min_m
        };
        assert_eq!((least_m(1), least_m(9)), (0.0, 0.03));
    }

    /// Five frames added up by hand: 10° and back are 20° and one reversal; a near-collision; what the resume
    /// straightens (3°) is nobody's steering; 4° more after it.
    #[test]
    fn metrics_are_the_sum_of_their_frames() {
        let near = Event::NearCollision { at: Pose::default(), progress_m: 0.0 };
        let stuck = Event::Stuck { at: Pose::default(), progress_m: 0.0 };
        let frames = [(10.0, Event::Drove), (0.0, Event::Drove), (-3.0, near), (0.0, stuck), (4.0, Event::ReachedEnd)];
        let mut accumulator = MetricsAccumulator::new(200.0);
        for (tick, (steering_deg, event)) in frames.into_iter().enumerate() {
            accumulator.frame(&frame(tick as u32, steering_deg, event));
        }
        let metrics = accumulator.metrics();
        assert_eq!((metrics.ticks, metrics.novice_ticks), (5, 1));
        assert_eq!((metrics.near_collisions, metrics.stuck, metrics.contacts), (1, 1, 1));
        assert_eq!(metrics.steering_reversals, 1);
        assert!((metrics.steering_effort_rad.to_degrees() - 27.0).abs() < 1e-3, "{metrics:?}");
        assert!((metrics.safe_ratio - 0.7).abs() < 1e-6 && metrics.clearance_min_m == 0.0, "{metrics:?}");
        assert!((metrics.driven_m - 0.5).abs() < 1e-6 && (metrics.duration_s - 0.25).abs() < 1e-6, "{metrics:?}");
        assert!((metrics.mean_speed_mps() - 2.0).abs() < 1e-5);
        assert!((near_collisions_per_100m([&metrics, &metrics]) - 0.5).abs() < 1e-9, "two in 400 m");
    }
}
