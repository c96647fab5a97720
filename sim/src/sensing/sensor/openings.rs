//! Ground mistaken for road.

use crate::distance_field::DistanceField;
use crate::geometry::bits;
use crate::sensing::GRID_CELLS;
use crate::sensing::occlusion::Spans;
use crate::sensing::quadtree::{PixelLattice, pixels_of};
use crate::vectors::{LANES, f32x4};
use std::ops::Range;

/// Openings in one view.
pub(super) struct Openings {
    polygons: Vec<Spans>,
    /// Rows of cells that may hold open pixels.
    cell_rows: Range<usize>,
    /// The cells of each row of cells that hold open pixels, bit = column.
    touched: [u32; GRID_CELLS],
    /// Those of which every pixel is open.
    whole: [u32; GRID_CELLS],
}

impl Openings {
    pub(super) fn new(polygons: Vec<Spans>) -> Self {
        let first = polygons.iter().map(|polygon| polygon.cell_rows().start).min().unwrap_or(0);
        let end = polygons.iter().map(|polygon| polygon.cell_rows().end).max().unwrap_or(0);
        let mut openings = Self { polygons, cell_rows: first..end, touched: [0; GRID_CELLS], whole: [0; GRID_CELLS] };
        for row in first..end {
            let touched = openings.polygons.iter().fold(0, |cells, polygon| cells | polygon.touched_cells(row));
            // Several polygons may open a cell altogether.
            let is_whole = |&col: &usize| pixels_of(row).all(|row| openings.pixels_of_cell(row, col) == u8::MAX);
            openings.whole[row] = bits(touched).filter(is_whole).fold(0, |cells, col| cells | 1 << col);
            openings.touched[row] = touched;
        }
        openings
    }

    /// The cells of a row of cells that hold open pixels, bit = column.
    #[inline]
    pub(super) fn touched_cells(&self, row: usize) -> u32 {
        self.touched[row]
    }

    /// The cells of a row of cells of which every pixel is open, bit = column.
    #[inline]
    pub(super) fn whole_cells(&self, row: usize) -> u32 {
        self.whole[row]
    }

    /// The cells that hold both open and closed pixels: rows of cells, and which of their cells, bit = column.
    pub(super) fn parted_cells(&self) -> impl Iterator<Item = (usize, u32)> + '_ {
        self.cell_rows.clone().map(|row| (row, self.touched[row] & !self.whole[row]))
    }

    /// Whether a cell keeps a pixel with a signed distance of at most `threshold_m` that is not open.
    pub(super) fn any_closed_pixel_below(
        &self,
        field: &DistanceField,
        lattice: &PixelLattice,
        row: usize,
        col: usize,
        threshold_m: f32,
    ) -> bool {
        pixels_of(row).any(|row| {
            let opened = self.pixels_of_cell(row, col);
            if opened == u8::MAX {
                return false;
            }
            let [left, right] = lattice
                .pixels_of_cell(row, col)
                .map(|pixels| field.at_four(pixels).simd_le(f32x4::splat(threshold_m)).to_bitmask());
            (left | right << LANES) & !u32::from(opened) != 0
        })
    }

    /// The open pixels of a row of pixels in a column of cells, bit = column within.
    fn pixels_of_cell(&self, row: usize, cell_col: usize) -> u8 {
        self.polygons.iter().fold(0, |open, polygon| open | polygon.pixels_of_cell(row, cell_col))
    }
}
