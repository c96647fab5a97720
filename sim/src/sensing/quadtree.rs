//! Fast max-pooling of a distance field: most cells are decided by one look-up.

use super::{BEV_PIXELS, CELL_PIXELS, GridGeometry};
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
}

/// Sizes of blocks: 1, 2, 4 and 8 pixels, a cell.
const LEVELS: usize = CELL_PIXELS.ilog2() as usize + 1;

/// Distance from the centre of a block of `side` × `side` pixels to the farthest pixel centre.
pub(super) fn to_corner_m(pixel_m: f32, side: usize) -> f32 {
    std::f32::consts::FRAC_1_SQRT_2 * pixel_m * (side - 1) as f32
}

impl PixelLattice {
    pub(super) fn new(geometry: &GridGeometry, pose: Pose) -> Self {
        let world_from_ego = pose.world_from_ego();
        let pixel_m = geometry.pixel_m();
        let ahead = world_from_ego.rotation;
        Self {
            origin: world_from_ego.point(geometry.pixel_in_ego(0, 0)),
            per_row: -ahead * pixel_m,
            per_col: -ahead.perp() * pixel_m,
            all_within_m: std::array::from_fn(|level| change_max_m(to_corner_m(pixel_m, 1 << level))),
        }
    }

    /// World position at (fractional) pixel indices.
    #[inline]
    pub(super) fn point(&self, row: f32, col: f32) -> Vec2 {
        debug_assert!(row < BEV_PIXELS as f32 && col < BEV_PIXELS as f32, "pixel indices lie in the view");
        self.origin + self.per_row * row + self.per_col * col
    }

    /// World position of the centre of a cell.
    #[inline]
    pub(super) fn cell_centre(&self, row: usize, col: usize) -> Vec2 {
        let centre = |index: usize| (index * CELL_PIXELS) as f32 + 0.5 * (CELL_PIXELS - 1) as f32;
        self.point(centre(row), centre(col))
    }

    /// Whether any pixel of a cell has a signed distance of at most `threshold_m`.
    ///
    /// Most cells on a boundary have such a pixel in the corner that is nearest to it. Elsewhere, a block of pixels whose
    /// centre is far enough from the threshold is decided by one look-up; the others are quartered.
    #[inline]
    pub(super) fn any_below(&self, field: &DistanceField, row: usize, col: usize, threshold_m: f32) -> bool {
        let [first_row, first_col] = [row, col].map(|index| (index * CELL_PIXELS) as f32);
        let away = field.away_at_nearest_node(self.cell_centre(row, col));
        let last = (CELL_PIXELS - 1) as f32;
        let corner_row = if away.dot(self.per_row) < 0.0 { first_row + last } else { first_row };
        let corner_col = if away.dot(self.per_col) < 0.0 { first_col + last } else { first_col };
        field.at(self.point(corner_row, corner_col)) <= threshold_m
            || self.block_below(field, first_row, first_col, LEVELS - 1, threshold_m)
    }

    fn block_below(&self, field: &DistanceField, row: f32, col: f32, level: usize, threshold_m: f32) -> bool {
        if level == 0 {
            return field.at(self.point(row, col)) <= threshold_m;
        }
        let to_centre = 0.5 * ((1 << level) - 1) as f32;
        let centre_m = field.at_nearest_node(self.point(row + to_centre, col + to_centre));
        if centre_m > threshold_m + self.all_within_m[level] {
            return false;
        }
        // The four pixels around the centre.
        if centre_m < threshold_m - self.all_within_m[1] {
            return true;
        }
        let half = (1 << (level - 1)) as f32;
        let quarters = [(0.0, 0.0), (0.0, half), (half, 0.0), (half, half)];
        quarters.into_iter().any(|(r, c)| self.block_below(field, row + r, col + c, level - 1, threshold_m))
    }
}
