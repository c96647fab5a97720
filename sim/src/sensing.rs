//! What the car sees: a bird's-eye view of 200×200 pixels, reduced to a 25×25 occupancy grid (docs/methods.md 1).

pub mod noise;
mod occlusion;
mod quadtree;
mod sensor;

pub use sensor::{Inspection, SensingSettings, Sensor};

use crate::geometry::Vec2;
use serde::{Deserialize, Serialize};

/// Cells per side of the grid.
pub const GRID_CELLS: usize = 25;
/// Pixels per side of one cell.
pub const CELL_PIXELS: usize = 8;
/// Pixels per side of the bird's-eye view.
pub const BEV_PIXELS: usize = GRID_CELLS * CELL_PIXELS;

/// Where the square patch lies in the ego frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridGeometry {
    /// Side of the patch, metres (R in docs/methods.md; 12.0 m from the authors' constants).
    pub side_m: f32,
    /// Distance from the rear axle to the lower edge of the patch, metres.
    pub near_edge_ahead_m: f32,
}

impl GridGeometry {
    /// 12 m patch that starts 4.30 m ahead of the rear axle, 0.5 m ahead of the bumper (docs/methods.md 1.3–1.4).
    pub fn paper() -> Self {
        Self { side_m: 12.0, near_edge_ahead_m: 4.30 }
    }

    /// Side of one pixel, metres.
    pub fn pixel_m(&self) -> f32 {
        self.side_m / BEV_PIXELS as f32
    }

    /// Side of one cell, metres.
    pub fn cell_m(&self) -> f32 {
        self.side_m / GRID_CELLS as f32
    }

    /// Distance from the rear axle to the far edge of the patch, metres.
    pub fn far_edge_ahead_m(&self) -> f32 {
        self.near_edge_ahead_m + self.side_m
    }

    /// Centre of a pixel in the ego frame: row 0 = far, column 0 = left.
    #[inline]
    pub fn pixel_in_ego(&self, row: usize, col: usize) -> Vec2 {
        let half = 0.5 * BEV_PIXELS as f32 - 0.5;
        let pixel_m = self.pixel_m();
        Vec2::new(self.near_edge_ahead_m + (2.0 * half + 0.5 - row as f32) * pixel_m, (half - col as f32) * pixel_m)
    }

    /// Centre of a cell in the ego frame: row 0 = far, column 0 = left.
    #[inline]
    pub fn cell_in_ego(&self, row: usize, col: usize) -> Vec2 {
        let cell_m = self.cell_m();
        Vec2::new(
            self.near_edge_ahead_m + (GRID_CELLS as f32 - 0.5 - row as f32) * cell_m,
            (0.5 * GRID_CELLS as f32 - 0.5 - col as f32) * cell_m,
        )
    }

    /// Whether an ego point (ahead, left) lies inside the patch.
    #[inline]
    pub fn contains(&self, in_ego: Vec2) -> bool {
        in_ego.x >= self.near_edge_ahead_m && in_ego.x <= self.far_edge_ahead_m() && in_ego.y.abs() <= 0.5 * self.side_m
    }
}

/// 25×25 cells, row 0 farthest ahead, column 0 leftmost; a set bit is a non-drivable cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct OccupancyGrid {
    /// One row per word, bit `c` = column `c`.
    rows: [u32; GRID_CELLS],
}

impl OccupancyGrid {
    /// The bits of one row that exist.
    pub const ROW_MASK: u32 = (1 << GRID_CELLS) - 1;

    /// Every cell free.
    pub fn free() -> Self {
        Self::default()
    }

    /// Every cell occupied.
    pub fn occupied() -> Self {
        Self { rows: [Self::ROW_MASK; GRID_CELLS] }
    }

    /// Whether a cell is non-drivable.
    #[inline]
    pub fn is_occupied(&self, row: usize, col: usize) -> bool {
        self.rows[row] >> col & 1 == 1
    }

    /// Marks a cell non-drivable.
    #[inline]
    pub fn set_occupied(&mut self, row: usize, col: usize) {
        self.rows[row] |= 1 << col;
    }

    /// Marks every cell of `mask` (bit = column) in a row non-drivable.
    #[inline]
    pub fn occupy_row(&mut self, row: usize, mask: u32) {
        self.rows[row] |= mask & Self::ROW_MASK;
    }

    /// The cells of a row, bit = column.
    #[inline]
    pub fn row(&self, row: usize) -> u32 {
        self.rows[row]
    }

    /// The same scene seen in a mirror: left and right swapped.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self { rows: self.rows.map(|row| row.reverse_bits() >> (32 - GRID_CELLS)) }
    }

    /// Number of occupied cells.
    pub fn count_occupied(&self) -> u32 {
        self.rows.iter().map(|row| row.count_ones()).sum()
    }

    /// Cells in row-major order, 1 = non-drivable.
    pub fn cells(&self) -> impl Iterator<Item = u8> + '_ {
        self.rows.iter().flat_map(|&row| (0..GRID_CELLS).map(move |col| (row >> col & 1) as u8))
    }

    /// Inverse of [`Self::cells`]; anything but 0 is occupied.
    ///
    /// # Panics
    /// If there are not exactly 625 cells.
    pub fn from_cells(cells: &[u8]) -> Self {
        assert_eq!(cells.len(), GRID_CELLS * GRID_CELLS, "a grid has 25×25 cells");
        let mut grid = Self::free();
        for (index, &cell) in cells.iter().enumerate() {
            if cell != 0 {
                grid.set_occupied(index / GRID_CELLS, index % GRID_CELLS);
            }
        }
        grid
    }
}

impl std::fmt::Display for OccupancyGrid {
    /// ASCII art, `#` = non-drivable, farthest row first.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for row in 0..GRID_CELLS {
            for col in 0..GRID_CELLS {
                f.write_str(if self.is_occupied(row, col) { "#" } else { "." })?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

/// All a policy is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Observation {
    /// The perceived scene.
    pub grid: OccupancyGrid,
}

/// The bird's-eye view in full resolution, for pictures and calibration: row 0 = far, column 0 = left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BirdsEyeView {
    pixels: Vec<bool>,
}

impl BirdsEyeView {
    /// A view computed pixel by pixel; `true` = non-drivable.
    pub fn from_fn(mut non_drivable: impl FnMut(usize, usize) -> bool) -> Self {
        let pixels = (0..BEV_PIXELS * BEV_PIXELS).map(|i| non_drivable(i / BEV_PIXELS, i % BEV_PIXELS)).collect();
        Self { pixels }
    }

    /// Whether a pixel is non-drivable.
    pub fn is_occupied(&self, row: usize, col: usize) -> bool {
        self.pixels[row * BEV_PIXELS + col]
    }

    /// Max-pool of 8×8 pixels: a cell is free only if all its 64 pixels are (paper, occupancy grid).
    pub fn to_grid(&self) -> OccupancyGrid {
        let mut grid = OccupancyGrid::free();
        for (index, &occupied) in self.pixels.iter().enumerate() {
            if occupied {
                grid.set_occupied(index / BEV_PIXELS / CELL_PIXELS, index % BEV_PIXELS / CELL_PIXELS);
            }
        }
        grid
    }

    /// Share of pixels that agree with another view, 0…1.
    pub fn pixel_accuracy(&self, other: &Self) -> f32 {
        let agree = self.pixels.iter().zip(&other.pixels).filter(|(a, b)| a == b).count();
        agree as f32 / self.pixels.len() as f32
    }
}
