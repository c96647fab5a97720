//! Arcs to steer at, and forecasts along all of them.

use crate::rollout::{HalfTurn, Motion};
use sim::geometry::{Pose, Vec2, WorldFromEgo};
use sim::maths;
use sim::vectors::{FourPoints, f32x4};

/// Points per arc at which its forecast can be probed, in fours.
const PROBE_FOURS: usize = 4;
/// Steps between them.
const PROBE_STEPS: usize = 4;

/// Arcs to steer at, straight on first and then ever tighter, left before right.
#[derive(Debug, Clone)]
pub(crate) struct Fan<const N: usize> {
    pub(crate) arcs: [Arc; N],
    /// Indices of the arcs, from the rightmost to the leftmost.
    from_right: [usize; N],
    /// Step of forecasts, metres.
    pub(crate) step_m: f32,
}

/// One curvature to steer at.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arc {
    pub(crate) curvature_per_m: f32,
    /// Index relative to the tightest arc, −1…1.
    pub(crate) index: f32,
    /// The half turn of one step along the arc.
    half_turn: HalfTurn,
    /// Where the nose gets to every [`PROBE_STEPS`] after the arc was entered, ego frame then.
    probes: [FourPoints; PROBE_FOURS],
}

/// What is carried along an arc.
pub(crate) trait Forecast: Copy {
    /// Where it has got to.
    fn motion(&self) -> Motion;
}

/// A forecast up to where its arc leaves the ramp, or farther.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Entry<F> {
    pub(crate) forecast: F,
    /// Whether it can continue.
    pub(crate) is_free: bool,
}

impl<const N: usize> Fan<N> {
    /// Arcs up to ±`max_per_m`, spaced by a power of their index. `nose_m` is where they are probed, ahead of the axle.
    pub(crate) fn new(max_per_m: f32, exponent: f32, step_m: f32, nose_m: f32) -> Self {
        let arcs = std::array::from_fn(|i: usize| {
            let side = if i.is_multiple_of(2) { -1.0 } else { 1.0 };
            let index = i.div_ceil(2) as f32 / (N / 2) as f32;
            let curvature_per_m = side * max_per_m * maths::pow(index, exponent);
            let half_turn = HalfTurn::new(curvature_per_m + curvature_per_m, step_m);
            let mut motion = Motion::new(Pose::default(), curvature_per_m);
            let probes = std::array::from_fn(|_| {
                let four: [Vec2; 4] = std::array::from_fn(|_| {
                    motion = (0..PROBE_STEPS).fold(motion, |motion, _| motion.turn(half_turn, step_m));
                    motion.on_axis(nose_m)
                });
                FourPoints::from(four)
            });
            Arc { curvature_per_m, index: side * index, half_turn, probes }
        });
        let mut from_right = std::array::from_fn(|i| i);
        from_right.sort_by(|&a: &usize, &b: &usize| arcs[a].curvature_per_m.total_cmp(&arcs[b].curvature_per_m));
        Self { arcs, from_right, step_m }
    }

    /// Forecasts from one start until a step gets to the curvature of their arc, by index of the arc.
    ///
    /// Arcs to the same side begin alike, with the wheels turning as fast as they can. This ramp is followed once for all
    /// of them, and each arc leaves it where its curvature is reached.
    ///
    /// `drive_on` moves a forecast to the next motion, or returns that it ends before.
    pub(crate) fn follow_ramps<F: Forecast>(
        &self,
        start: F,
        change_per_m: f32,
        drive_on: impl Fn(&mut F, Motion) -> bool,
    ) -> [Entry<F>; N] {
        let start = Entry { forecast: start, is_free: true };
        let present_per_m = start.forecast.motion().curvature_per_m;
        let n_right = self.from_right.partition_point(|&i| self.arcs[i].curvature_per_m < present_per_m);
        // To either side, ever farther from the present curvature.
        let mut order = self.from_right;
        order[..n_right].reverse();
        let (right, left) = order.split_at(n_right);
        let mut entries = [start; N];
        for side in [right, left] {
            let mut ramp = start;
            for &i in side {
                let curvature_per_m = self.arcs[i].curvature_per_m;
                while ramp.is_free && !ramp.forecast.motion().reaches(curvature_per_m, change_per_m) {
                    let next = ramp.forecast.motion().step(curvature_per_m, change_per_m, self.step_m);
                    ramp.is_free = drive_on(&mut ramp.forecast, next);
                }
                entries[i] = ramp;
            }
        }
        entries
    }

    /// The step that leaves the ramp for an arc.
    pub(crate) fn enter(&self, i: usize, ramp: Motion) -> Motion {
        ramp.step(self.arcs[i].curvature_per_m, f32::INFINITY, self.step_m)
    }

    /// Where the nose gets to along an arc every few steps after it was entered, with the travels there from the ramp, in
    /// fours.
    pub(crate) fn probes(&self, i: usize, entered: Motion) -> impl Iterator<Item = (f32x4, FourPoints)> {
        let world_from_ego = WorldFromEgo { rotation: entered.ahead, translation: entered.position };
        self.arcs[i].probes.iter().enumerate().map(move |(four, &in_ego)| {
            let travels_m = [1, 2, 3, 4].map(|i| (1 + (4 * four + i) * PROBE_STEPS) as f32 * self.step_m);
            (travels_m.into(), world_from_ego.four_points(in_ego))
        })
    }

    /// Follows an arc from the ramp for as long as `drive_on` moves the forecast.
    pub(crate) fn follow<F: Forecast>(
        &self,
        i: usize,
        entry: &mut Entry<F>,
        drive_on: impl Fn(&mut F, Motion) -> bool,
    ) {
        let mut next = self.enter(i, entry.forecast.motion());
        while entry.is_free {
            entry.is_free = drive_on(&mut entry.forecast, next);
            next = next.turn(self.arcs[i].half_turn, self.step_m);
        }
    }
}
