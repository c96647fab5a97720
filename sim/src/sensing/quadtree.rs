//! Fast max-pooling of a distance field: most cells are decided by one look-up.

use super::{CELL_PIXELS, GRID_CELLS, GridGeometry};
use crate::distance_field::{DistanceField, change_max_m};
use crate::geometry::{Pose, Vec2, mask};
use std::ops::Range;

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
    /// From the centre of a cell to its farthest pixel, metres.
    cell_corner_m: f32,
    /// How much the field may change from the centre of a cell to any of its pixels, metres.
    cell_within_m: f32,
    /// The same for a quarter of a cell.
    quarter_within_m: f32,
    /// The same for the four pixels around a centre.
    four_within_m: f32,
}

/// Pixels per side of a quarter of a cell.
const QUARTER_PIXELS: usize = CELL_PIXELS / 2;

/// Cells per side of a block of cells. Blocks are looked up first: most are on one side of every boundary.
pub(super) const BLOCK_CELLS: usize = 4;

/// Blocks per side of the view; the last ones reach beyond it.
pub(super) const BLOCKS: usize = GRID_CELLS.div_ceil(BLOCK_CELLS);

/// Blocks of a row, rounded up to what four at a time come to.
const BLOCK_LANES: usize = BLOCKS.next_multiple_of(4);

/// Cells of a row of blocks.
pub(super) const ROW_LANES: usize = BLOCKS * BLOCK_CELLS;

/// Distance from the centre of a block of `side` × `side` pixels to the farthest pixel centre.
pub(super) fn to_corner_m(pixel_m: f32, side: usize) -> f32 {
    std::f32::consts::FRAC_1_SQRT_2 * pixel_m * (side - 1) as f32
}

/// Pixels of a row or column of cells.
#[inline]
pub(super) fn pixels_of(cell: usize) -> Range<usize> {
    cell * CELL_PIXELS..(cell + 1) * CELL_PIXELS
}

/// Pixel index of the centre of a cell, along one axis.
#[inline]
fn centre_of_cell(index: f32) -> f32 {
    centre_of::<CELL_PIXELS>(index)
}

/// Pixel index of the centre of a block of `SIDE` × `SIDE` pixels, along one axis.
#[inline]
fn centre_of<const SIDE: usize>(index: f32) -> f32 {
    index * SIDE as f32 + 0.5 * (SIDE - 1) as f32
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
            cell_corner_m: to_corner_m(pixel_m, CELL_PIXELS),
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
        self.points(rows.map(|row| centre_of_cell(row as f32)), cols.map(|col| centre_of_cell(col as f32)))
    }

    /// World positions of the pixels of a row of pixels in a column of cells, x and y.
    #[inline]
    pub(super) fn pixels_of_cell(&self, row: usize, cell_col: usize) -> ([f32; CELL_PIXELS], [f32; CELL_PIXELS]) {
        let first_col = cell_col * CELL_PIXELS;
        self.points([row as f32; CELL_PIXELS], std::array::from_fn(|i| (first_col + i) as f32))
    }

    /// Signed distances at the nodes nearest to the centres of some cells of a row: of columns that are a multiple of 4 in
    /// number, into their places in `nodes_m`.
    #[inline]
    pub(super) fn nearest_nodes_of_cells(
        &self,
        field: &DistanceField,
        row: usize,
        cols: Range<usize>,
        nodes_m: &mut [f32; ROW_LANES],
    ) {
        let start = self.origin + self.per_row * centre_of_cell(row as f32);
        let (xs, ys) = (&self.to_cols.0[cols.clone()], &self.to_cols.1[cols.clone()]);
        field.at_many_nearest_nodes(start, xs, ys, &mut nodes_m[cols]);
    }

    /// Signed distances at the nodes nearest to the centres of a row of blocks.
    #[inline]
    pub(super) fn nearest_nodes_of_blocks(&self, field: &DistanceField, row: usize) -> [f32; BLOCK_LANES] {
        const SIDE: usize = BLOCK_CELLS * CELL_PIXELS;
        let cols = std::array::from_fn(|col| centre_of::<SIDE>(col as f32));
        let (xs, ys) = self.points([centre_of::<SIDE>(row as f32); BLOCK_LANES], cols);
        field.at_nearest_nodes(&xs, &ys)
    }

    /// Two distances, metres: a cell has no pixel of at most a threshold if its centre (the nearest node) is more than the
    /// first above it, and has one if its centre is more than the second below it.
    #[inline]
    pub(super) fn decided_m(&self) -> (f32, f32) {
        (self.cell_within_m, self.four_within_m)
    }

    /// How many of the cells with these distances at the centre (at the nearest node) have no pixel of at most
    /// `thresholds_m`, and which have one, as far as the centre tells; bit = index.
    #[inline]
    pub(super) fn are_decided<const N: usize>(&self, centres_m: &[f32; N], thresholds_m: &[f32; N]) -> (u32, u32) {
        let (above_m, below_m) = self.decided_m();
        (
            mask(std::array::from_fn::<_, N, _>(|i| centres_m[i] > thresholds_m[i] + above_m)),
            mask(std::array::from_fn::<_, N, _>(|i| centres_m[i] < thresholds_m[i] - below_m)),
        )
    }

    /// Whether any pixel of a cell has a signed distance of at most `threshold_m`. `centre_m`: the one at the node nearest to
    /// its centre.
    ///
    /// Most cells of which the centre does not tell ([`Self::are_decided`]) have such a pixel in a corner, or the field
    /// around them is nowhere as low; what remains is quartered.
    #[inline]
    pub(super) fn any_below(&self, field: &DistanceField, row: u32, col: u32, centre_m: f32, threshold_m: f32) -> bool {
        const LAST: f32 = (CELL_PIXELS - 1) as f32;
        let [first_row, first_col] = [row, col].map(|index| (index * CELL_PIXELS as u32) as f32);
        let (last_row, last_col) = (first_row + LAST, first_col + LAST);
        let (rows, cols) = ([first_row, first_row, last_row, last_row], [first_col, last_col, first_col, last_col]);
        let any_corner = || self.any_of_these_below(field, rows, cols, threshold_m);
        let may_be = || self.may_be_below::<CELL_PIXELS>(field, first_row, first_col, threshold_m);
        let any_quarter = || self.any_quarter_below(field, first_row, first_col, threshold_m);
        // First the question that is likely to settle it.
        if centre_m > threshold_m + self.cell_corner_m {
            may_be() && (any_corner() || any_quarter())
        } else {
            any_corner() || may_be() && any_quarter()
        }
    }

    /// Whether one of four pixels has a signed distance of at most `threshold_m`.
    #[inline]
    fn any_of_these_below(&self, field: &DistanceField, rows: [f32; 4], cols: [f32; 4], threshold_m: f32) -> bool {
        let (xs, ys) = self.points(rows, cols);
        field.at_each(&xs, &ys).into_iter().fold(f32::INFINITY, f32::min) <= threshold_m
    }

    /// World positions at pixel indices, x and y.
    #[inline]
    fn points<const N: usize>(&self, rows: [f32; N], cols: [f32; N]) -> ([f32; N], [f32; N]) {
        let (mut xs, mut ys) = ([0.0; N], [0.0; N]);
        for i in 0..N {
            let point = self.point(rows[i], cols[i]);
            (xs[i], ys[i]) = (point.x, point.y);
        }
        (xs, ys)
    }

    /// False only if no pixel of a block of `SIDE` × `SIDE` pixels can have a signed distance of at most `threshold_m`.
    #[inline(never)]
    fn may_be_below<const SIDE: usize>(&self, field: &DistanceField, row: f32, col: f32, threshold_m: f32) -> bool {
        /// A generous bound of rounding in single precision, metres.
        const ROUNDING_M: f32 = 1e-4;
        let (low, high) = self.box_around::<SIDE>(row, col, ROUNDING_M);
        field.lowest_within(low, high) <= threshold_m + ROUNDING_M
    }

    /// A box in the world, given by its lowest and highest coordinates, around the pixels of a cell.
    #[inline]
    pub(super) fn box_around_cell(&self, row: usize, col: usize) -> (Vec2, Vec2) {
        /// A generous bound of rounding in single precision a kilometre from the origin, metres.
        const ROUNDING_M: f32 = 1e-3;
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

    /// [`Self::any_below`] by quarters of the cell. `row`, `col`: its first pixel.
    fn any_quarter_below(&self, field: &DistanceField, row: f32, col: f32, threshold_m: f32) -> bool {
        const SIDE: f32 = QUARTER_PIXELS as f32;
        const TO_CENTRE: f32 = 0.5 * (SIDE - 1.0);
        let (rows, cols) = ([row, row, row + SIDE, row + SIDE], [col, col + SIDE, col, col + SIDE]);
        let (xs, ys) = self.points(rows.map(|row| row + TO_CENTRE), cols.map(|col| col + TO_CENTRE));
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
