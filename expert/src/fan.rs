//! Arcs to steer at, and forecasts along all of them.

use crate::rollout::{HalfTurn, Motion};
use sim::geometry::{Pose, Vec2};

/// Points per arc at which its forecast can be probed.
const PROBES: usize = 10;
/// Steps between them.
const PROBE_STEPS: usize = 5;

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
    /// Of one step along the arc.
    half_turn: HalfTurn,
    probes: [Vec2; PROBES],
}

impl<const N: usize> Fan<N> {
    /// Arcs up to ±`max_per_m`, spaced by a power of their index. `nose_m` is where they are probed, ahead of the axle.
    pub(crate) fn new(max_per_m: f32, exponent: f32, step_m: f32, nose_m: f32) -> Self {
        let arcs = std::array::from_fn(|i: usize| {
            let side = if i.is_multiple_of(2) { -1.0 } else { 1.0 };
            let index = i.div_ceil(2) as f32 / (N / 2) as f32;
            let curvature_per_m = side * max_per_m * index.powf(exponent);
            let half_turn = HalfTurn::new(curvature_per_m + curvature_per_m, step_m);
            let mut motion = Motion::new(Pose::default(), curvature_per_m);
            let probes = std::array::from_fn(|_| {
                motion = (0..PROBE_STEPS).fold(motion, |motion, _| motion.turn(half_turn, step_m));
                motion.on_axis(nose_m)
            });
            Arc { curvature_per_m, index: side * index, half_turn, probes }
        });
        let mut from_right = std::array::from_fn(|i| i);
        from_right.sort_by(|&a: &usize, &b: &usize| arcs[a].curvature_per_m.total_cmp(&arcs[b].curvature_per_m));
        Self { arcs, from_right, step_m }
    }

    /// Follows every arc from one start, and returns how far each forecast got, by index of the arc.
    ///
    /// Arcs to the same side begin alike, with the wheels turning as fast as they can. This ramp is followed once for all
    /// of them, and each arc leaves it where its curvature is reached.
    ///
    /// `drive_on` moves a forecast to the next motion, or returns that it ends before. It is told the arc, or `None` on a
    /// ramp. A forecast that `is_hopeless` ends where it gets to the curvature of its arc.
    pub(crate) fn follow<F: Copy>(
        &self,
        start: F,
        change_per_m: f32,
        motion_of: impl Fn(&F) -> Motion,
        drive_on: impl Fn(&mut F, Motion, Option<usize>) -> bool,
        is_hopeless: impl Fn(&F, &Arc) -> bool,
    ) -> [F; N] {
        let mut ends = [start; N];
        let mut follow_side = |side: &mut dyn Iterator<Item = usize>| {
            let (mut ramp, mut is_free) = (start, true);
            for i in side {
                let arc = &self.arcs[i];
                let &Arc { curvature_per_m, half_turn, .. } = arc;
                let step = |forecast: &F| motion_of(forecast).step(curvature_per_m, change_per_m, self.step_m);
                while is_free && !motion_of(&ramp).reaches(curvature_per_m, change_per_m) {
                    let next = step(&ramp);
                    is_free = drive_on(&mut ramp, next, None);
                }
                ends[i] = ramp;
                let own = &mut ends[i];
                let mut next = step(own);
                if is_free && drive_on(own, next, Some(i)) && !is_hopeless(own, arc) {
                    next = next.turn(half_turn, self.step_m);
                    while drive_on(own, next, Some(i)) {
                        next = next.turn(half_turn, self.step_m);
                    }
                }
            }
        };
        let present_per_m = motion_of(&start).curvature_per_m;
        let n_right = self.from_right.partition_point(|&i| self.arcs[i].curvature_per_m < present_per_m);
        let (right, left) = self.from_right.split_at(n_right);
        follow_side(&mut right.iter().rev().copied());
        follow_side(&mut left.iter().copied());
        ends
    }
}

impl Arc {
    /// Where the nose gets to along the arc every few steps of `step_m`, and the travel there.
    pub(crate) fn probes(&self, from: Motion, step_m: f32) -> impl Iterator<Item = (f32, Vec2)> {
        self.probes.iter().enumerate().map(move |(i, &in_ego)| {
            let travel_m = ((i + 1) * PROBE_STEPS) as f32 * step_m;
            (travel_m, from.position + from.ahead.rotate(in_ego))
        })
    }
}
