//! Fast max-pooling of a distance field: most cells are decided by one look-up.

use super::{CELL_PIXELS, GRID_CELLS, GridGeometry};
use crate::distance_field::{DistanceField, change_max_m};
use crate::geometry::{Pose, Vec2};
use crate::vectors::{FourPoints, LANES, coordinate, counted_from, f32x4, lowest};
use std::ops::Range;

/// World positions of the pixel centres of one view. The only place where pixels are turned into world points, so
/// that the fast grid and the full view agree to the bit.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelLattice {
    /// Centre of pixel (0, 0).
    origin: Vec2,
    per_row: Vec2,
    per_col: Vec2,
    /// Offsets from there to the centres of the columns of cells, by columns of blocks.
    to_cols: [FourPoints; BLOCKS],
    /// How much the field may change from the centre of a cell to any of its pixels, metres.
    cell_within_m: f32,
    /// The same for a quarter of a cell.
    quarter_within_m: f32,
    /// The same for the four pixels around a centre.
    four_within_m: f32,
}

/// Pixels per side of a quarter of a cell.
const QUARTER_PIXELS: usize = CELL_PIXELS / 2;

/// Cells per side of a block of cells. Blocks are looked up first: most are on one side of every boundary. The cells of
/// one row of a block are looked up together.
pub(super) const BLOCK_CELLS: usize = LANES;

/// Blocks per side of the view; the last ones reach beyond it.
pub(super) const BLOCKS: usize = GRID_CELLS.div_ceil(BLOCK_CELLS);

/// A generous bound of rounding in single precision as far from the origin as lots may lie, metres: numbers are half a
/// millimetre apart there.
const ROUNDING_M: f32 = 2e-3;

/// Distance from the centre of a block of `side` × `side` pixels to the farthest pixel centre.
pub(super) fn to_corner_m(pixel_m: f32, side: usize) -> f32 {
    std::f32::consts::FRAC_1_SQRT_2 * pixel_m * (side - 1) as f32
}

/// Pixels of a row or column of cells.
#[inline]
pub(super) fn pixels_of(cell: usize) -> Range<usize> {
    cell * CELL_PIXELS..(cell + 1) * CELL_PIXELS
}

/// Index of the first pixel of a cell, along one axis.
#[inline]
fn first_pixel(cell: usize) -> f32 {
    coordinate(cell * CELL_PIXELS)
}

/// Pixel indices of the centres of cells, along one axis.
#[inline]
fn centres_of_cells(indices: f32x4) -> f32x4 {
    centres_of::<CELL_PIXELS>(indices)
}

/// Pixel indices of the centres of blocks of `SIDE` × `SIDE` pixels, along one axis.
#[inline]
fn centres_of<const SIDE: usize>(indices: f32x4) -> f32x4 {
    indices * f32x4::splat(SIDE as f32) + f32x4::splat(0.5 * (SIDE - 1) as f32)
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
            to_cols: std::array::from_fn(|block| {
                FourPoints::splat(per_col) * centres_of_cells(counted_from(block * BLOCK_CELLS))
            }),
            cell_within_m: change_max_m(to_corner_m(pixel_m, CELL_PIXELS)),
            quarter_within_m: change_max_m(to_corner_m(pixel_m, QUARTER_PIXELS)),
            four_within_m: change_max_m(to_corner_m(pixel_m, 2)),
        }
    }

    /// World position at (fractional) pixel indices.
    #[inline]
    pub(super) fn point(&self, row: f32, col: f32) -> Vec2 {
        self.origin + self.per_row * row + self.per_col * col
    }

    /// World positions at pixel indices.
    #[inline]
    fn points(&self, rows: f32x4, cols: f32x4) -> FourPoints {
        FourPoints::splat(self.origin) + FourPoints::splat(self.per_row) * rows + FourPoints::splat(self.per_col) * cols
    }

    /// World position of the centre of a cell.
    #[inline]
    pub(super) fn cell_centre(&self, row: usize, col: usize) -> Vec2 {
        let centre = |index: usize| (index * CELL_PIXELS) as f32 + 0.5 * (CELL_PIXELS - 1) as f32;
        self.point(centre(row), centre(col))
    }

    /// World positions of the centres of cells.
    #[inline]
    pub(super) fn cell_centres(&self, rows: f32x4, cols: f32x4) -> FourPoints {
        self.points(centres_of_cells(rows), centres_of_cells(cols))
    }

    /// World positions of the pixels of a row of pixels in a column of cells.
    #[inline]
    pub(super) fn pixels_of_cell(&self, row: usize, cell_col: usize) -> [FourPoints; CELL_PIXELS / LANES] {
        let row = f32x4::splat(row as f32);
        std::array::from_fn(|i| self.points(row, counted_from(cell_col * CELL_PIXELS + i * LANES)))
    }

    /// Signed distances at the nodes nearest to the centres of the cells of a row in a column of blocks.
    #[inline]
    pub(super) fn nearest_nodes_of_cells(&self, field: &DistanceField, row: usize, block_col: usize) -> f32x4 {
        let start = self.origin + self.per_row * (row as f32 * CELL_PIXELS as f32 + 0.5 * (CELL_PIXELS - 1) as f32);
        field.at_four_nearest_nodes(FourPoints::splat(start) + self.to_cols[block_col])
    }

    /// Signed distances at the nodes nearest to the centres of four blocks in a row of blocks.
    #[inline]
    pub(super) fn nearest_nodes_of_blocks(&self, field: &DistanceField, row: usize, first_col: usize) -> f32x4 {
        const SIDE: usize = BLOCK_CELLS * CELL_PIXELS;
        let (rows, cols) = (centres_of::<SIDE>(f32x4::splat(row as f32)), centres_of::<SIDE>(counted_from(first_col)));
        field.at_four_nearest_nodes(self.points(rows, cols))
    }

    /// Two distances, metres: a cell has no pixel of at most a threshold if its centre (the nearest node) is more than the
    /// first above it, and has one if its centre is more than the second below it.
    #[inline]
    pub(super) fn decided_m(&self) -> (f32, f32) {
        (self.cell_within_m, self.four_within_m)
    }

    /// Which of the cells with these distances at the centre (at the nearest node) have no pixel of at most
    /// `thresholds_m`, and which have one, as far as the centre tells; bit = index.
    #[inline]
    pub(super) fn are_decided(&self, centres_m: f32x4, thresholds_m: f32x4) -> (u32, u32) {
        let (above_m, below_m) = self.decided_m();
        let are_above = centres_m.simd_gt(thresholds_m + f32x4::splat(above_m));
        let are_below = centres_m.simd_lt(thresholds_m - f32x4::splat(below_m));
        (are_above.to_bitmask(), are_below.to_bitmask())
    }

    /// Whether a pixel in a corner of a cell has a signed distance of at most `threshold_m`.
    #[inline]
    pub(super) fn any_corner_below(&self, field: &DistanceField, row: usize, col: usize, threshold_m: f32) -> bool {
        const LAST: f32 = (CELL_PIXELS - 1) as f32;
        let [row, col] = [row, col].map(first_pixel);
        let rows = f32x4::splat(row) + f32x4::from([0.0, 0.0, LAST, LAST]);
        let cols = f32x4::splat(col) + f32x4::from([0.0, LAST, 0.0, LAST]);
        self.any_of_these_below(field, rows, cols, threshold_m)
    }

    /// Whether any pixel of a cell has a signed distance of at most `threshold_m`: by a bound for all of them, then by
    /// quarters of the cell.
    #[inline]
    pub(super) fn any_below(&self, field: &DistanceField, row: usize, col: usize, threshold_m: f32) -> bool {
        let [row, col] = [row, col].map(first_pixel);
        self.may_be_below::<CELL_PIXELS>(field, row, col, threshold_m)
            && self.any_quarter_below(field, row, col, threshold_m)
    }

    /// Whether one of four pixels has a signed distance of at most `threshold_m`.
    #[inline]
    fn any_of_these_below(&self, field: &DistanceField, rows: f32x4, cols: f32x4, threshold_m: f32) -> bool {
        lowest(field.at_four(self.points(rows, cols))) <= threshold_m
    }

    /// False only if no pixel of a block of `SIDE` × `SIDE` pixels can have a signed distance of at most `threshold_m`.
    #[inline]
    fn may_be_below<const SIDE: usize>(&self, field: &DistanceField, row: f32, col: f32, threshold_m: f32) -> bool {
        let (low, high) = self.box_around::<SIDE>(row, col, ROUNDING_M);
        field.lowest_within(low, high) <= threshold_m + ROUNDING_M
    }

    /// A box in the world, given by its lowest and highest coordinates, around the pixels of a cell.
    #[inline]
    pub(super) fn box_around_cell(&self, row: usize, col: usize) -> (Vec2, Vec2) {
        self.box_around::<CELL_PIXELS>((row * CELL_PIXELS) as f32, (col * CELL_PIXELS) as f32, ROUNDING_M)
    }

    /// A box in the world, with a margin, around a block of `SIDE` × `SIDE` pixels, of which the first is given.
    #[inline]
    fn box_around<const SIDE: usize>(&self, row: f32, col: f32, margin_m: f32) -> (Vec2, Vec2) {
        let to_centre = 0.5 * (SIDE - 1) as f32;
        let centre = self.point(row + to_centre, col + to_centre);
        let half = (self.per_row.abs() + self.per_col.abs()) * to_centre + Vec2::splat(margin_m);
        (centre - half, centre + half)
    }

    /// Whether any pixel of a quarter of a cell has a signed distance of at most `threshold_m`. `row`, `col`: the first
    /// pixel of the cell.
    fn any_quarter_below(&self, field: &DistanceField, row: f32, col: f32, threshold_m: f32) -> bool {
        const SIDE: f32 = QUARTER_PIXELS as f32;
        let to_centre = f32x4::splat(0.5 * (SIDE - 1.0));
        let rows = f32x4::splat(row) + f32x4::from([0.0, 0.0, SIDE, SIDE]);
        let cols = f32x4::splat(col) + f32x4::from([0.0, SIDE, 0.0, SIDE]);
        let centres_m = field.at_four_nearest_nodes(self.points(rows + to_centre, cols + to_centre)).to_array();
        let (rows, cols) = (rows.to_array(), cols.to_array());
        (0..LANES).any(|i| {
            if centres_m[i] > threshold_m + self.quarter_within_m {
                false
            } else if centres_m[i] < threshold_m - self.four_within_m {
                true
            } else {
                self.may_be_below::<QUARTER_PIXELS>(field, rows[i], cols[i], threshold_m)
                    && self.any_pixel_of_quarter_below(field, rows[i], cols[i], threshold_m)
            }
        })
    }

    fn any_pixel_of_quarter_below(&self, field: &DistanceField, row: f32, col: f32, threshold_m: f32) -> bool {
        let cols = f32x4::splat(col) + counted_from(0);
        (0..QUARTER_PIXELS).any(|i| self.any_of_these_below(field, f32x4::splat(row + i as f32), cols, threshold_m))
    }
}
