//! Shadows, parts of which are taken for obstacles.

use super::patch::Region;
use super::value::value_noise_raster;
use crate::geometry::Vec2;
use crate::vectors::{FourPoints, LANES, bounded, f32x4, whole_and_part};
use std::sync::OnceLock;

/// Cell of the shadow raster, metres.
const SHADOW_CELL_M: f32 = 0.12;

/// A convex shadow; a pixel of it is misread where the rank of the local noise exceeds a breathing threshold.
#[derive(Debug, Clone)]
pub(in crate::sensing) struct Shadow {
    pub(in crate::sensing) region: Region,
    seed: u64,
    /// Distance from the centre of a grid cell to its farthest pixel, metres.
    cell_radius_m: f32,
    origin: Vec2,
    cols: usize,
    rows: usize,
    /// Drawn when first seen: it takes longer than all else that a sensor draws in advance.
    ranks: OnceLock<Ranks>,
}

/// Rank of the local noise within the box around a shadow, 0…255: a threshold is then a share of the area of the box. By
/// raster cells.
#[derive(Debug, Clone)]
struct Ranks {
    own: Vec<u8>,
    /// Lowest and highest rank that any pixel of a grid cell centred here can have.
    lowest_around: Vec<u8>,
    highest_around: Vec<u8>,
}

impl Shadow {
    pub(super) fn new(polygon: Vec<Vec2>, seed: u64, cell_radius_m: f32) -> Self {
        let (low, high) = crate::geometry::bounds(&polygon);
        let size = ((high - low) / SHADOW_CELL_M).ceil();
        let (cols, rows) = (size.x as usize + 1, size.y as usize + 1);
        let ranks = OnceLock::new();
        Self { region: Region::new(polygon), seed, cell_radius_m, origin: low, cols, rows, ranks }
    }

    fn ranks(&self) -> &Ranks {
        self.ranks.get_or_init(|| {
            // Two octaves, correlation 1.2 m.
            let octave = |seed: u64, spacing_m: f32| {
                let along = |origin: f32, count: usize| {
                    (0..count).map(|i| (origin + i as f32 * SHADOW_CELL_M) / spacing_m).collect::<Vec<f32>>()
                };
                value_noise_raster(seed, &along(self.origin.x, self.cols), &along(self.origin.y, self.rows))
            };
            let (first, second) = (octave(self.seed, 1.2), octave(self.seed ^ 1, 0.6));
            let noise: Vec<f32> = first.iter().zip(second).map(|(first, second)| first + 0.5 * second).collect();
            let own = ranks(&noise);
            // Both the centre and the pixel are rounded to a raster cell.
            let reach = (self.cell_radius_m / SHADOW_CELL_M + 1.0) as usize;
            let lowest_around = joined_around(&own, self.cols, reach, u8::min);
            let highest_around = joined_around(&own, self.cols, reach, u8::max);
            Ranks { own, lowest_around, highest_around }
        })
    }

    #[inline]
    pub(in crate::sensing) fn is_misread(&self, point: Vec2, threshold: u8) -> bool {
        self.ranks().own[self.index(point)] >= threshold
    }

    /// [`Self::is_misread`] at four points, bit = index.
    #[inline]
    pub(in crate::sensing) fn are_misread(&self, points: FourPoints, threshold: u8) -> u32 {
        let cell = (points - FourPoints::splat(self.origin)) * f32x4::splat(1.0 / SHADOW_CELL_M)
            + FourPoints::splat(Vec2::splat(0.5));
        let (cols, _) = whole_and_part(bounded(cell.x, (self.cols - 1) as f32));
        let (rows, _) = whole_and_part(bounded(cell.y, (self.rows - 1) as f32));
        let (cols, rows) = (cols.to_array(), rows.to_array());
        let ranks = &self.ranks().own;
        let is_misread = |i: usize| ranks[rows[i] as usize * self.cols + cols[i] as usize] >= threshold;
        (0..LANES).fold(0, |bits, i| bits | u32::from(is_misread(i)) << i)
    }

    /// Whether pixels of the shadow in the grid cell around a point are misread: none of them, all of them, or (`None`)
    /// one must look.
    #[inline]
    pub(in crate::sensing) fn are_misread_around(&self, point: Vec2, threshold: u8) -> Option<bool> {
        let (ranks, index) = (self.ranks(), self.index(point));
        let (low, high) = (ranks.lowest_around[index], ranks.highest_around[index]);
        if high < threshold {
            Some(false)
        } else if low >= threshold {
            Some(true)
        } else {
            None
        }
    }

    /// False only if no pixel of the shadow in a box, given by its lowest and highest coordinates, is misread.
    #[inline]
    pub(in crate::sensing) fn may_be_misread_within(&self, low: Vec2, high: Vec2, threshold: u8) -> bool {
        let ((first_row, first_col), (last_row, last_col)) = (self.cell(low), self.cell(high));
        let ranks = &self.ranks().own;
        (first_row..=last_row).any(|row| {
            let start = row * self.cols;
            ranks[start + first_col..=start + last_col].iter().any(|&rank| rank >= threshold)
        })
    }

    #[inline]
    fn index(&self, point: Vec2) -> usize {
        let (row, col) = self.cell(point);
        row * self.cols + col
    }

    /// Row and column of the raster cell around a point, or of the nearest one.
    #[inline]
    fn cell(&self, point: Vec2) -> (usize, usize) {
        let cell = (point - self.origin) * (1.0 / SHADOW_CELL_M) + Vec2::splat(0.5);
        let col = (cell.x.max(0.0) as i32 as usize).min(self.cols - 1);
        let row = (cell.y.max(0.0) as i32 as usize).min(self.rows - 1);
        (row, col)
    }
}

/// The share of other values below each value, 0…255.
fn ranks(values: &[f32]) -> Vec<u8> {
    let mut order: Vec<(f32, u32)> = values.iter().copied().zip(0..).collect();
    order.sort_unstable_by(|(a, _), (b, _)| a.total_cmp(b));
    let mut ranks = vec![0; values.len()];
    let mut n_below = 0;
    for (i, &(value, index)) in order.iter().enumerate() {
        if value > order[n_below].0 {
            n_below = i;
        }
        ranks[index as usize] = (n_below * 255 / values.len()) as u8;
    }
    ranks
}

/// What `join` makes of all values within `reach` cells along both axes of every cell of a raster.
fn joined_around(values: &[u8], cols: usize, reach: usize, join: impl Fn(u8, u8) -> u8) -> Vec<u8> {
    let rows = values.len() / cols;
    let join_all = |joined: &mut [u8], others: &[u8]| {
        for (value, &other) in joined.iter_mut().zip(others) {
            *value = join(*value, other);
        }
    };
    // Along the rows, then along the columns.
    let mut in_rows = values.to_vec();
    for (joined, values) in in_rows.chunks_mut(cols).zip(values.chunks(cols)) {
        for offset in 1..=reach.min(cols - 1) {
            join_all(joined, &values[offset..]);
            join_all(&mut joined[offset..], values);
        }
    }
    let mut joined = in_rows.clone();
    for offset in 1..=reach.min(rows - 1) {
        join_all(&mut joined, &in_rows[offset * cols..]);
        join_all(&mut joined[offset * cols..], &in_rows);
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_count_what_is_below_and_reach_around() {
        let values = [0.5, -1.0, 0.5, 3.0, 2.0, -1.0];
        let below = |value: f32| values.iter().filter(|&&other| other < value).count();
        let own = ranks(&values);
        assert_eq!(own, values.map(|value| (below(value) * 255 / 6) as u8));
        // Three rows of two, one cell to either side.
        let lowest = joined_around(&own, 2, 1, u8::min);
        let highest = joined_around(&own, 2, 1, u8::max);
        assert_eq!(lowest, [own[1], own[1], own[1], own[1], own[5], own[5]]);
        assert_eq!(highest, [own[3], own[3], own[3], own[3], own[3], own[3]]);
    }
}
