//! Fast max-pooling of a distance field: most cells are decided by one look-up.

use super::{CELL_PIXELS, GRID_CELLS, GridGeometry};
use crate::distance_field::{DistanceField, change_max_m};
use crate::geometry::{Pose, Vec2};

/// World positions of the pixel centres of one view. The only place where pixels are turned into world points, so
/// that the fast grid and the full view agree to the bit.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelLattice {
    /// Centre of pixel (0, 0).
    origin: Vec2,
    per_row: Vec2,
    per_col: Vec2,
    /// How much the field may change from the centre of a block of 2ⁱ × 2ⁱ pixels to any of them.
    all_within_m: [f32; LEVELS],
    /// From the centre of a cell to the corner of a world-aligned box around its pixel centres, and a millimetre more.
    half_cell: Vec2,
}

/// By how much rounding may change a distance, with a lot to spare, metres.
const ROUNDING_M: f32 = 1e-4;

/// Sizes of blocks: 1, 2, 4 and 8 pixels, a cell.
const LEVELS: usize = CELL_PIXELS.ilog2() as usize + 1;

/// Cells of a row, rounded up to what four at a time come to.
pub(super) const ROW_LANES: usize = GRID_CELLS.next_multiple_of(4);

/// Distance from the centre of a block of `side` × `side` pixels to the farthest pixel centre.
pub(super) fn to_corner_m(pixel_m: f32, side: usize) -> f32 {
    std::f32::consts::FRAC_1_SQRT_2 * pixel_m * (side - 1) as f32
}

impl PixelLattice {
    pub(super) fn new(geometry: &GridGeometry, pose: Pose) -> Self {
        let world_from_ego = pose.world_from_ego();
        let pixel_m = geometry.pixel_m();
        let ahead = world_from_ego.rotation;
        let (per_row, per_col) = (-ahead * pixel_m, -ahead.perp() * pixel_m);
        Self {
            origin: world_from_ego.point(geometry.pixel_in_ego(0, 0)),
            per_row,
            per_col,
            half_cell: (per_row.abs() + per_col.abs()) * (0.5 * (CELL_PIXELS - 1) as f32) + Vec2::splat(1e-3),
            all_within_m: std::array::from_fn(|level| change_max_m(to_corner_m(pixel_m, 1 << level))),
        }
    }

    /// World position at (fractional) pixel indices.
    #[inline]
    pub(super) fn point(&self, row: f32, col: f32) -> Vec2 {
        self.origin + self.per_row * row + self.per_col * col
    }

    /// World position of the centre of a cell.
    #[inline]
    pub(super) fn cell_centre(&self, row: usize, col: usize) -> Vec2 {
        let centre = |index: usize| (index * CELL_PIXELS) as f32 + 0.5 * (CELL_PIXELS - 1) as f32;
        self.point(centre(row), centre(col))
    }

    /// Signed distances at the nodes nearest to the centres of a row of cells; a few more than there are cells.
    #[inline]
    pub(super) fn nearest_nodes_of_row(&self, field: &DistanceField, row: usize) -> [f32; ROW_LANES] {
        let (mut xs, mut ys) = ([0.0; ROW_LANES], [0.0; ROW_LANES]);
        for col in 0..ROW_LANES {
            let centre = self.cell_centre(row, col);
            (xs[col], ys[col]) = (centre.x, centre.y);
        }
        field.at_nearest_nodes(&xs, &ys)
    }

    /// Whether any pixel of a cell has a signed distance of at most `threshold_m`. `centre_m`: at the node nearest to the
    /// cell's centre.
    ///
    /// A cell whose centre is far enough from the threshold is decided by that alone. Most others have such a pixel in a
    /// corner, or no such node around them; what remains is quartered.
    #[inline]
    pub(super) fn any_below(
        &self,
        field: &DistanceField,
        row: usize,
        col: usize,
        centre_m: f32,
        threshold_m: f32,
    ) -> bool {
        const LEVEL: usize = LEVELS - 1;
        const LAST: f32 = (CELL_PIXELS - 1) as f32;
        if let Some(is_below) = self.is_decided(LEVEL, centre_m, threshold_m) {
            return is_below;
        }
        let [first_row, first_col] = [row, col].map(|index| (index * CELL_PIXELS) as f32);
        let (last_row, last_col) = (first_row + LAST, first_col + LAST);
        let corners = [(first_row, first_col), (first_row, last_col), (last_row, first_col), (last_row, last_col)];
        if self.any_of_four_below(field, corners, threshold_m) {
            return true;
        }
        let centre = self.cell_centre(row, col);
        let (low, high) = (centre - self.half_cell, centre + self.half_cell);
        field.lowest_within(low, high) <= threshold_m + ROUNDING_M
            && self.any_quarter_below(field, first_row, first_col, LEVEL, threshold_m)
    }

    /// Whether one of four pixels, given as (row, column), has a signed distance of at most `threshold_m`.
    #[inline]
    fn any_of_four_below(&self, field: &DistanceField, pixels: [(f32, f32); 4], threshold_m: f32) -> bool {
        let points = pixels.map(|(row, col)| self.point(row, col));
        let distances_m = field.at_each(&points.map(|point| point.x), &points.map(|point| point.y));
        distances_m.into_iter().fold(false, |any, distance_m| any | (distance_m <= threshold_m))
    }

    /// Whether a block of 2ⁱ × 2ⁱ pixels has a pixel of at most `threshold_m`, if the distance at its centre tells.
    #[inline]
    fn is_decided(&self, level: usize, centre_m: f32, threshold_m: f32) -> Option<bool> {
        if centre_m > threshold_m + self.all_within_m[level] {
            Some(false)
        } else if centre_m < threshold_m - self.all_within_m[1] {
            // The four pixels around the centre.
            Some(true)
        } else {
            None
        }
    }

    fn any_quarter_below(&self, field: &DistanceField, row: f32, col: f32, level: usize, threshold_m: f32) -> bool {
        let half = (1 << (level - 1)) as f32;
        let to_centre = 0.5 * (half - 1.0);
        let corners = [(row, col), (row, col + half), (row + half, col), (row + half, col + half)];
        if level == 1 {
            return self.any_of_four_below(field, corners, threshold_m);
        }
        let points = corners.map(|(row, col)| self.point(row + to_centre, col + to_centre));
        let (xs, ys) = (points.map(|point| point.x), points.map(|point| point.y));
        let centres_m = field.at_nearest_nodes(&xs, &ys);
        corners.into_iter().zip(centres_m).any(|((row, col), centre_m)| {
            self.is_decided(level - 1, centre_m, threshold_m)
                .unwrap_or_else(|| self.any_quarter_below(field, row, col, level - 1, threshold_m))
        })
    }
}
