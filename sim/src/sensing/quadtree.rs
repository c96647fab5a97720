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
    /// From there to the centres of the columns of cells, x and y.
    to_cols: ([f32; ROW_LANES], [f32; ROW_LANES]),
    /// How much the field may change from the centre of a cell to any of its pixels, metres.
    cell_within_m: f32,
    /// The same for a quarter of a cell.
    quarter_within_m: f32,
    /// The same for the four pixels around a centre.
    four_within_m: f32,
}

/// Pixels per side of a quarter of a cell.
const QUARTER_PIXELS: usize = CELL_PIXELS / 2;

/// Cells of a row, rounded up to what four at a time come to.
pub(super) const ROW_LANES: usize = GRID_CELLS.next_multiple_of(4);

/// Distance from the centre of a block of `side` × `side` pixels to the farthest pixel centre.
pub(super) fn to_corner_m(pixel_m: f32, side: usize) -> f32 {
    std::f32::consts::FRAC_1_SQRT_2 * pixel_m * (side - 1) as f32
}

/// Pixel index of the centre of a cell, along one axis.
#[inline]
fn centre_of_cell(index: f32) -> f32 {
    index * CELL_PIXELS as f32 + 0.5 * (CELL_PIXELS - 1) as f32
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
            to_cols: (
                std::array::from_fn(|col| per_col.x * centre_of_cell(col as f32)),
                std::array::from_fn(|col| per_col.y * centre_of_cell(col as f32)),
            ),
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

    /// World position of the centre of a cell.
    #[inline]
    pub(super) fn cell_centre(&self, row: usize, col: usize) -> Vec2 {
        self.point(centre_of_cell(row as f32), centre_of_cell(col as f32))
    }

    /// World positions of the centres of cells, given as rows and columns, x and y.
    #[inline]
    pub(super) fn cell_centres<const N: usize>(&self, rows: &[u32; N], cols: &[u32; N]) -> ([f32; N], [f32; N]) {
        let (mut xs, mut ys) = ([0.0; N], [0.0; N]);
        for i in 0..N {
            let centre = self.point(centre_of_cell(rows[i] as f32), centre_of_cell(cols[i] as f32));
            (xs[i], ys[i]) = (centre.x, centre.y);
        }
        (xs, ys)
    }

    /// World positions of four pixels of a row, x and y.
    #[inline]
    pub(super) fn four_pixels(&self, row: usize, first_col: usize) -> ([f32; 4], [f32; 4]) {
        let (mut xs, mut ys) = ([0.0; 4], [0.0; 4]);
        for i in 0..4 {
            let pixel = self.point(row as f32, (first_col + i) as f32);
            (xs[i], ys[i]) = (pixel.x, pixel.y);
        }
        (xs, ys)
    }

    /// Signed distances at the nodes nearest to the centres of a row of cells; a few more than there are cells.
    #[inline]
    pub(super) fn nearest_nodes_of_row(&self, field: &DistanceField, row: usize) -> [f32; ROW_LANES] {
        let start = self.origin + self.per_row * centre_of_cell(row as f32);
        let (mut xs, mut ys) = ([0.0; ROW_LANES], [0.0; ROW_LANES]);
        for col in 0..ROW_LANES {
            (xs[col], ys[col]) = (start.x + self.to_cols.0[col], start.y + self.to_cols.1[col]);
        }
        let mut nodes_m = [0.0; ROW_LANES];
        field.at_many_nearest_nodes(&xs, &ys, &mut nodes_m);
        nodes_m
    }

    /// How many of the cells with these distances at the centre (at the nearest node) have no pixel of at most
    /// `thresholds_m`, and which have one, as far as the centre tells; bit = index.
    #[inline]
    pub(super) fn are_decided<const N: usize>(&self, centres_m: &[f32; N], thresholds_m: &[f32; N]) -> (u32, u32) {
        let [above_m, below_m] = [self.cell_within_m, self.four_within_m];
        let (mut is_above, mut is_below) = (0, 0);
        for i in 0..N {
            is_above |= u32::from(centres_m[i] > thresholds_m[i] + above_m) << i;
            is_below |= u32::from(centres_m[i] < thresholds_m[i] - below_m) << i;
        }
        (is_above, is_below)
    }

    /// Whether any pixel of a cell has a signed distance of at most `threshold_m`.
    ///
    /// Most cells of which the centre does not tell ([`Self::are_decided`]) have such a pixel in a corner, or the field
    /// around them is nowhere as low; what remains is quartered.
    #[inline]
    pub(super) fn any_below(&self, field: &DistanceField, row: u32, col: u32, threshold_m: f32) -> bool {
        const LAST: f32 = (CELL_PIXELS - 1) as f32;
        let [first_row, first_col] = [row, col].map(|index| (index * CELL_PIXELS as u32) as f32);
        let (last_row, last_col) = (first_row + LAST, first_col + LAST);
        let rows = [first_row, first_row, last_row, last_row];
        let cols = [first_col, last_col, first_col, last_col];
        self.any_of_these_below(field, rows, cols, threshold_m)
            || self.may_be_below::<CELL_PIXELS>(field, first_row, first_col, threshold_m)
                && self.any_quarter_below(field, first_row, first_col, threshold_m)
    }

    /// Whether one of four pixels has a signed distance of at most `threshold_m`.
    #[inline]
    fn any_of_these_below(&self, field: &DistanceField, rows: [f32; 4], cols: [f32; 4], threshold_m: f32) -> bool {
        let (mut xs, mut ys) = ([0.0; 4], [0.0; 4]);
        for i in 0..4 {
            let point = self.point(rows[i], cols[i]);
            (xs[i], ys[i]) = (point.x, point.y);
        }
        let distances_m = field.at_each(&xs, &ys);
        distances_m.into_iter().fold(f32::INFINITY, f32::min) <= threshold_m
    }

    /// False only if no pixel of a block of `SIDE` × `SIDE` pixels can have a signed distance of at most `threshold_m`.
    #[inline(never)]
    fn may_be_below<const SIDE: usize>(&self, field: &DistanceField, row: f32, col: f32, threshold_m: f32) -> bool {
        /// Rounding of single precision, with a lot to spare, metres.
        const ROUNDING_M: f32 = 1e-4;
        let to_centre = 0.5 * (SIDE - 1) as f32;
        let centre = self.point(row + to_centre, col + to_centre);
        let half = (self.per_row.abs() + self.per_col.abs()) * to_centre + Vec2::splat(ROUNDING_M);
        field.lowest_within(centre - half, centre + half) <= threshold_m + ROUNDING_M
    }

    /// [`Self::any_below`] by quarters of the cell. `row`, `col`: its first pixel.
    fn any_quarter_below(&self, field: &DistanceField, row: f32, col: f32, threshold_m: f32) -> bool {
        const SIDE: f32 = QUARTER_PIXELS as f32;
        const TO_CENTRE: f32 = 0.5 * (SIDE - 1.0);
        let (rows, cols) = ([row, row, row + SIDE, row + SIDE], [col, col + SIDE, col, col + SIDE]);
        let (mut xs, mut ys) = ([0.0; 4], [0.0; 4]);
        for i in 0..4 {
            let centre = self.point(rows[i] + TO_CENTRE, cols[i] + TO_CENTRE);
            (xs[i], ys[i]) = (centre.x, centre.y);
        }
        let centres_m = field.at_nearest_nodes(&xs, &ys);
        (0..4).any(|i| {
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
        let cols = [col, col + 1.0, col + 2.0, col + 3.0];
        (0..QUARTER_PIXELS).any(|i| self.any_of_these_below(field, [row + i as f32; 4], cols, threshold_m))
    }
}
