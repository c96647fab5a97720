//! How vectors are used: four numbers at a time, said with [`wide::f32x4`], wherever one thing is done for many places.
//!
//! - Four lanes of 32 bits are what every x86-64 and every ARM64 has, so one build serves all machines. Compiling for
//!   newer ones changes the instructions, never a result: the lanes of a vector compute what numbers compute one by one,
//!   and nothing here multiplies and adds in one rounding (`mul_add`).
//! - A condition of four lanes is a mask: `a.simd_gt(b) & counts` keeps the counts where it holds, and `to_bitmask` makes
//!   bits of it, bit = lane.
//! - What does not come in fours repeats its last element, or carries a mask.
//! - What is asked next depends on what was found, for one lane or the other. A branch per lane that cannot be foreseen
//!   costs more than several look-ups, so the lanes to be looked at more closely are picked first, then done together.
//! - A look-up takes one lane at a time: indices leave a vector by `to_array`, what they name comes back by `from`.

use glam::Vec2;
use std::ops::{Add, Mul, Sub};
pub use wide::f32x4;
use wide::i16x8;
pub(crate) use wide::i32x4;

/// Numbers done at once.
pub(crate) const LANES: usize = 4;

/// The bits of a mask.
pub(crate) const ALL_LANES: u32 = (1 << LANES) - 1;

/// Four points, or four vectors, of the plane.
#[derive(Debug, Clone, Copy)]
pub struct FourPoints {
    /// First coordinates: world x, or ahead of the vehicle.
    pub x: f32x4,
    /// Second coordinates: world y, or left of the vehicle.
    pub y: f32x4,
}

impl FourPoints {
    /// The same point four times.
    #[inline]
    pub fn splat(point: Vec2) -> Self {
        Self { x: f32x4::splat(point.x), y: f32x4::splat(point.y) }
    }

    /// Points in fours; the last one is repeated.
    pub fn all(points: &[Vec2]) -> Vec<Self> {
        points.chunks(LANES).map(Self::up_to_four).collect()
    }

    /// One to four points; the last one is repeated.
    pub(crate) fn up_to_four(points: &[Vec2]) -> Self {
        std::array::from_fn(|i| points[i.min(points.len() - 1)]).into()
    }
}

impl From<[Vec2; LANES]> for FourPoints {
    #[inline]
    fn from(points: [Vec2; LANES]) -> Self {
        Self { x: points.map(|point| point.x).into(), y: points.map(|point| point.y).into() }
    }
}

impl Add for FourPoints {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y }
    }
}

impl Sub for FourPoints {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y }
    }
}

impl Mul<f32x4> for FourPoints {
    type Output = Self;

    #[inline]
    fn mul(self, factors: f32x4) -> Self {
        Self { x: self.x * factors, y: self.y * factors }
    }
}

/// Numbers of lanes that are picked without branching.
#[derive(Debug, Clone, Default)]
pub(crate) struct Picked {
    numbers: Vec<i32>,
    n_picked: usize,
}

/// The set bits of every mask, lowest first, and how many there are.
const SET_LANES: [([i32; LANES], usize); 1 << LANES] = {
    let mut table = [([0; LANES], 0); 1 << LANES];
    let mut i = 0;
    while i < LANES << LANES {
        let (mask, lane) = (i / LANES, i % LANES);
        if mask >> lane & 1 == 1 {
            let (lanes, n_set) = &mut table[mask];
            lanes[*n_set] = lane as i32;
            *n_set += 1;
        }
        i += 1;
    }
    table
};

impl Picked {
    /// Nothing picked, with room for what may be.
    pub(crate) fn up_to(n_lanes: usize) -> Self {
        Self { numbers: vec![0; n_lanes + LANES], n_picked: 0 }
    }

    /// Forgets what was picked.
    pub(crate) fn clear(&mut self) {
        self.n_picked = 0;
    }

    /// Picks those of four consecutive numbers whose bits are set.
    #[inline]
    pub(crate) fn pick(&mut self, first: usize, lanes: u32) {
        let (set_lanes, n_set) = SET_LANES[(lanes & ALL_LANES) as usize];
        let numbers = i32x4::splat(first as i32) + i32x4::from(set_lanes);
        // More are written than are picked: they are overwritten next.
        self.numbers[self.n_picked..self.n_picked + LANES].copy_from_slice(numbers.as_array());
        self.n_picked += n_set;
    }

    /// Picks a number, or not.
    #[inline]
    pub(crate) fn pick_if(&mut self, is_picked: bool, number: usize) {
        self.numbers[self.n_picked] = number as i32;
        self.n_picked += usize::from(is_picked);
    }

    /// One of the numbers that were picked.
    #[inline]
    pub(crate) fn get(&self, index: usize) -> usize {
        self.numbers[index] as usize
    }

    /// What was picked, four at a time, in order; the last one is repeated. With each, the lanes that repeat nothing.
    #[inline]
    pub(crate) fn fours(&self) -> impl Iterator<Item = ([usize; LANES], u32)> + '_ {
        let picked = &self.numbers[..self.n_picked];
        picked.chunks(LANES).map(|four| {
            let numbers = std::array::from_fn(|i| four[i.min(four.len() - 1)] as usize);
            (numbers, ALL_LANES >> (LANES - four.len()))
        })
    }

    /// What was picked, in order.
    #[inline]
    pub(crate) fn iter(&self) -> impl ExactSizeIterator<Item = usize> + '_ {
        self.numbers[..self.n_picked].iter().map(|&number| number as usize)
    }
}

/// An index as a coordinate; from 64 bits it takes several instructions.
#[inline]
pub(crate) fn coordinate(index: usize) -> f32 {
    index as i32 as f32
}

/// A number and the next three.
#[inline]
pub(crate) fn counted_from(first: usize) -> f32x4 {
    f32x4::splat(coordinate(first)) + f32x4::from([0.0, 1.0, 2.0, 3.0])
}

/// Bounds coordinates to 0…`last`.
#[inline]
pub(crate) fn bounded(coordinates: f32x4, last: f32) -> f32x4 {
    coordinates.fast_max(f32x4::ZERO).fast_min(f32x4::splat(last))
}

/// Coordinates that are not negative, as whole numbers and what is left, 0…1.
#[inline]
pub(crate) fn whole_and_part(coordinates: f32x4) -> (i32x4, f32x4) {
    let whole = coordinates.fast_trunc_int();
    (whole, coordinates - f32x4::from_i32x4(whole))
}

/// Rows and columns as indices into a raster, row by row. Of whole numbers, every x86-64 multiplies 16 bits at once.
#[inline]
pub(crate) fn indices(rows: i32x4, cols: i32x4, n_cols: i16) -> [usize; LANES] {
    let rows_and_cols: i16x8 = bytemuck::cast(rows | cols << 16_u32);
    let indices = rows_and_cols.dot(i16x8::from([n_cols, 1, n_cols, 1, n_cols, 1, n_cols, 1]));
    indices.to_array().map(|index| index as u32 as usize)
}

/// The lowest lane.
#[inline]
pub(crate) fn lowest(values: f32x4) -> f32 {
    let [a, b, c, d] = values.to_array();
    a.min(b).min(c.min(d))
}

/// The highest lane.
#[inline]
pub(crate) fn highest(values: f32x4) -> f32 {
    let [a, b, c, d] = values.to_array();
    a.max(b).max(c.max(d))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picked_lanes_are_those_that_are_set_in_order() {
        let mut picked = Picked::up_to(64);
        let mut expected = Vec::new();
        for mask in 0..16_u32 {
            let first = 4 * mask as usize;
            // Bits beyond the lanes do not count.
            picked.pick(first, mask | 0xF0);
            expected.extend((0..LANES).filter(|lane| mask >> lane & 1 == 1).map(|lane| first + lane));
        }
        picked.pick_if(false, 70);
        picked.pick_if(true, 71);
        expected.push(71);
        assert_eq!(picked.iter().collect::<Vec<usize>>(), expected);
        assert_eq!((picked.get(5), picked.fours().count()), (expected[5], expected.len().div_ceil(4)));
        assert_eq!(picked.fours().last(), Some(([71; LANES], 0b0001)), "33 are eight fours and one");
    }

    #[test]
    fn indices_go_row_by_row_up_to_the_largest_raster() {
        let (rows, cols) = ([0, 3, 5000, 32_000], [7, 4999, 0, 32_766]);
        let expected = std::array::from_fn(|i| (rows[i] * 32_767 + cols[i]) as usize);
        assert_eq!(indices(i32x4::from(rows), i32x4::from(cols), 32_767), expected);
    }
}
