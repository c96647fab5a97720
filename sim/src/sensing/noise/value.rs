//! Smooth noise on a lattice in space and time, without a state: a pure function of seed, place and time.

use crate::geometry::Vec2;
use crate::vectors::{FourPoints, LANES, f32x4};

/// Scales smoothly interpolated uniform noise from −1…1 to unit variance: 1/√(1/3 · 0.743²), the variance of a corner times
/// what the cubic fade keeps of it along either axis. It is also the largest value.
pub(super) const VALUE_NOISE_MAX: f32 = 2.33;

/// Smooth noise of about unit variance (averaged over places) on a unit lattice in space and time.
pub(super) fn value_noise(seed: u64, place: Vec2, time: f32) -> f32 {
    let (cell, t0) = (place.floor(), time.floor());
    let (fx, fy, ft) = (fade(place.x - cell.x), fade(place.y - cell.y), fade(time - t0));
    let corner = |dx: i32, dy: i32, dt: i32| unit(hash(seed, cell.x as i32 + dx, cell.y as i32 + dy, t0 as i32 + dt));
    let plane = |dt: i32| {
        let near = corner(0, 0, dt) + fx * (corner(1, 0, dt) - corner(0, 0, dt));
        let far = corner(0, 1, dt) + fx * (corner(1, 1, dt) - corner(0, 1, dt));
        near + fy * (far - near)
    };
    let value = if ft == 0.0 { plane(0) } else { plane(0) * (1.0 - ft) + plane(1) * ft };
    (2.0 * value - 1.0) * VALUE_NOISE_MAX
}

/// [`value_noise`] at time 0 on a raster of places, to the bit; row by row.
pub(super) fn value_noise_raster(seed: u64, xs: &[f32], ys: &[f32]) -> Vec<f32> {
    let key = key(seed, 0);
    // On the lines of the lattice, at every x.
    let line = |y: i32| -> Vec<f32> {
        let mut drawn: Option<(i32, f32, f32)> = None;
        let at = |&x: &f32| {
            let cell = x.floor() as i32;
            let (_, left, right) = drawn.filter(|&(drawn, ..)| drawn == cell).unwrap_or_else(|| {
                let nodes = [cell, cell + 1].map(|x| unit(mix(key, x, y)));
                (cell, nodes[0], nodes[1])
            });
            drawn = Some((cell, left, right));
            left + fade(x - x.floor()) * (right - left)
        };
        xs.iter().map(at).collect()
    };
    let (Some(&low), Some(&high)) = (ys.first(), ys.last()) else { return Vec::new() };
    let first = low.floor() as i32;
    let lines: Vec<Vec<f32>> = (first..=high.floor() as i32 + 1).map(line).collect();
    let mut values = Vec::with_capacity(xs.len() * ys.len());
    for &y in ys {
        let (cell, share) = (y.floor(), fade(y - y.floor()));
        let above = (cell as i32 - first) as usize;
        let value = |(&near, &far): (&f32, &f32)| (2.0 * (near + share * (far - near)) - 1.0) * VALUE_NOISE_MAX;
        values.extend(lines[above].iter().zip(&lines[above + 1]).map(value));
    }
    values
}

/// Uniform in [0, 1).
#[inline]
pub(super) fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 / (1 << 24) as f32
}

/// Mixes a lattice point into 32 random bits (the finaliser of `SplitMix64`).
#[inline]
pub(super) fn hash(seed: u64, x: i32, y: i32, t: i32) -> u32 {
    mix(key(seed, t), x, y)
}

/// What [`mix`] needs of a seed and a time.
#[inline]
fn key(seed: u64, t: i32) -> u64 {
    seed ^ u64::from(t as u32).wrapping_add(1).wrapping_mul(0xD6E8_FEB8_6659_FD93)
}

#[inline]
fn mix(key: u64, x: i32, y: i32) -> u32 {
    let place = u64::from(x as u32) | u64::from(y as u32) << 32;
    let mut z = key ^ place.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (z >> 32) as u32 ^ z as u32
}

/// Value noise around a place at one instant.
#[derive(Debug, Clone)]
pub(super) struct Lattice {
    seed: u64,
    spacing_m: f32,
    per_m: f32,
    amplitude: f32,
    view: LatticeView,
    /// Nodes per side.
    n_nodes: usize,
    /// World position of the first node.
    origin: Vec2,
    /// What was drawn at an even and at an odd tick of the noise, one of them the last and one the next.
    draws: [LatticeDraws; 2],
    /// Values at the nodes, row by row, and what is read beyond the last when four neighbours are.
    nodes: Vec<f32>,
}

/// What the nodes of a [`Lattice`] depend on: where it lies and when.
#[derive(Debug, Clone, Copy, PartialEq)]
struct LatticeView {
    /// Indices of the first node, whole numbers.
    first: Vec2,
    /// Last tick of the noise.
    tick: i32,
    /// Progress from this tick to the next, faded, 0…1.
    phase: f32,
}

impl Lattice {
    pub(super) fn new(seed: u64, spacing_m: f32, amplitude: f32) -> Self {
        Self {
            seed,
            spacing_m,
            per_m: 1.0 / spacing_m,
            amplitude,
            origin: Vec2::NAN,
            // Equal to none.
            view: LatticeView { first: Vec2::NAN, tick: 0, phase: 0.0 },
            n_nodes: 0,
            draws: std::array::from_fn(|_| LatticeDraws::new(0)),
            nodes: Vec::new(),
        }
    }

    /// Turns to a circle of the world at a time, in ticks of the noise; what is drawn stays if it is the same as before.
    pub(super) fn look_at(&mut self, centre: Vec2, radius_m: f32, time: f32) {
        let first = ((centre - Vec2::splat(radius_m)) / self.spacing_m).floor();
        // From the node before the circle to the one after it.
        let n_nodes = (2.0 * radius_m * self.per_m).ceil() as usize + 3;
        if n_nodes != self.n_nodes {
            self.n_nodes = n_nodes;
            self.nodes = vec![0.0; (n_nodes * n_nodes + LANES).next_multiple_of(LANES)];
            self.draws = std::array::from_fn(|_| LatticeDraws::new(self.nodes.len()));
            self.view = LatticeView { first: Vec2::NAN, ..self.view };
        }
        let view = LatticeView { first, tick: time as i32, phase: fade(time.fract()) };
        if view == self.view || self.amplitude == 0.0 {
            return;
        }
        (self.view, self.origin) = (view, first * self.spacing_m);
        let LatticeView { tick, phase, .. } = view;
        self.draws[parity(tick)].look_at(first, n_nodes, key(self.seed, tick));
        if phase != 0.0 {
            self.draws[parity(tick + 1)].look_at(first, n_nodes, key(self.seed, tick + 1));
        }
        let [last, next] = [tick, tick + 1].map(|tick| self.draws[parity(tick)].nodes.as_chunks::<LANES>().0);
        for ((nodes, &last), &next) in self.nodes.as_chunks_mut::<LANES>().0.iter_mut().zip(last).zip(next) {
            let (last, next) = (f32x4::from(last), f32x4::from(next));
            let mixed = last * f32x4::splat(1.0 - phase) + next * f32x4::splat(phase);
            let drawn = if phase == 0.0 { last } else { mixed };
            let centred = f32x4::splat(2.0) * drawn - f32x4::ONE;
            *nodes = (f32x4::splat(self.amplitude) * centred * f32x4::splat(VALUE_NOISE_MAX)).to_array();
        }
    }

    /// Values at four places.
    #[inline]
    pub(super) fn at_four(&self, places: FourPoints) -> f32x4 {
        if self.amplitude == 0.0 {
            return f32x4::ZERO;
        }
        let nodes = (places - FourPoints::splat(self.origin)) * f32x4::splat(self.per_m);
        let last = (self.n_nodes - 2) as f32;
        let ((cols, into_x), (rows, into_y)) = (lattice_cells(nodes.x, last), lattice_cells(nodes.y, last));
        let firsts = (rows * f32x4::splat(self.n_nodes as f32) + cols).fast_trunc_int().to_array();
        // Of each place the near nodes and the far ones, and what lies between.
        let around = firsts.map(|first| &self.nodes[first as u32 as usize..][..self.n_nodes + LANES]);
        let across = |nodes: [f32x4; LANES]| {
            let [left, right, ..] = f32x4::transpose(nodes);
            left + into_x * (right - left)
        };
        let near = across(around.map(|nodes| f32x4::from(*nodes.first_chunk().expect("four"))));
        let far = across(around.map(|nodes| f32x4::from(*nodes.last_chunk().expect("four"))));
        near + into_y * (far - near)
    }
}

/// 0 for even ticks, 1 for odd ones.
fn parity(tick: i32) -> usize {
    (tick & 1) as usize
}

/// What the nodes of a [`Lattice`] draw at one tick of the noise. Several ticks of the simulation make one of the noise.
#[derive(Debug, Clone)]
struct LatticeDraws {
    /// Indices of the first node, whole numbers.
    first: Vec2,
    /// The key of the seed and the tick.
    key: u64,
    /// Uniform numbers in [0, 1) at the nodes, row by row.
    nodes: Vec<f32>,
}

impl LatticeDraws {
    fn new(n_stored: usize) -> Self {
        Self { first: Vec2::NAN, key: 0, nodes: vec![0.0; n_stored] }
    }

    /// Turns to so many nodes a side at a place and a tick; what is drawn stays if they are the same as before.
    fn look_at(&mut self, first: Vec2, n_nodes: usize, key: u64) {
        if (first, key) == (self.first, self.key) {
            return;
        }
        (self.first, self.key) = (first, key);
        for (y, row) in (first.y as i32..).zip(self.nodes[..n_nodes * n_nodes].chunks_mut(n_nodes)) {
            for (x, node) in (first.x as i32..).zip(row) {
                *node = unit(mix(key, x, y));
            }
        }
    }
}

/// The cells of a [`Lattice`], up to the `last`, that hold coordinates, whole numbers, and the faded progress through them,
/// 0…1.
#[inline]
fn lattice_cells(nodes: f32x4, last: f32) -> (f32x4, f32x4) {
    let nodes = nodes.fast_max(f32x4::ZERO).fast_min(f32x4::splat(last + 1.0));
    let cells = f32x4::from_i32x4(nodes.fast_trunc_int()).fast_min(f32x4::splat(last));
    let progress = nodes - cells;
    (cells, progress * progress * (f32x4::splat(3.0) - f32x4::splat(2.0) * progress))
}

/// Cubic fade from 0 to 1.
#[inline]
fn fade(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maths;

    /// Also of what a lattice keeps from the views before.
    #[test]
    fn a_lattice_is_value_noise() {
        let (spacing_m, amplitude) = (1.5, 0.4);
        let mut lattice = Lattice::new(5, spacing_m, amplitude);
        // On wide patches it grew with the cube of the distance: by metres at 16 m, kilometres at 20 m.
        for (view, radius_m) in (0..60_u32).zip([8.0, 8.0, 8.0, 24.0, 24.0, 60.0].into_iter().cycle()) {
            // Standing still now and then, both in time and in place.
            let centre = Vec2::new((view / 7) as f32 * 1.1 - 3.0, (view / 11) as f32 * 0.9);
            let time = (view / 2) as f32 / 3.0;
            lattice.look_at(centre, radius_m, time);
            let place = |i: usize| centre + radius_m * i as f32 / 32.0 * maths::unit(2.4 * i as f32);
            for i in 0..32 {
                let value = lattice.at_four(FourPoints::splat(place(i))).to_array()[i % 4];
                let expected = amplitude * value_noise(5, place(i) / spacing_m, time);
                assert!((value - expected).abs() < 1e-4, "view {view}, {}: {value}, not {expected}", place(i));
            }
        }
    }

    #[test]
    fn a_raster_of_value_noise_is_value_noise() {
        let along = |from: f32, count: usize| (0..count).map(|i| from + 0.1 * i as f32).collect::<Vec<f32>>();
        let (xs, ys) = (along(-1.75, 43), along(-0.2, 31));
        let raster = value_noise_raster(9, &xs, &ys);
        for (i, value) in raster.into_iter().enumerate() {
            let place = Vec2::new(xs[i % xs.len()], ys[i / xs.len()]);
            assert_eq!(value.to_bits(), value_noise(9, place, 0.0).to_bits(), "at {place}");
        }
    }

    #[test]
    fn value_noise_has_about_unit_variance_and_keeps_its_bound() {
        let place = |i: usize| Vec2::new((i % 200) as f32, (i / 200) as f32) * 0.237;
        let samples: Vec<f32> = (0..40_000).map(|i| value_noise(3, place(i), 0.0)).collect();
        let mean = samples.iter().sum::<f32>() / samples.len() as f32;
        let variance = samples.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / samples.len() as f32;
        assert!(mean.abs() < 0.1 && (0.8..1.2).contains(&variance), "mean {mean}, variance {variance}");
        assert!(samples.iter().all(|v| v.abs() <= VALUE_NOISE_MAX));
    }
}
