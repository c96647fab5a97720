//! Fast max-pooling of a distance field: most cells are decided by one look-up.

use super::{BEV_PIXELS, CELL_PIXELS, GridGeometry};
use crate::distance_field::{DistanceField, LIPSCHITZ, NEAREST_NODE_M};
use crate::geometry::{Pose, Vec2};

/// World positions of the pixel centres of one view. The only place where pixels are turned into world points, so
/// that the fast grid and the full view agree to the bit.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelLattice {
    /// Centre of pixel (0, 0).
    origin: Vec2,
    per_row: Vec2,
    per_col: Vec2,
    pixel_m: f32,
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
            pixel_m,
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
    /// The interpolated field changes by at most [`LIPSCHITZ`] per metre, so a block of pixels whose centre is far
    /// enough from the threshold is decided by one look-up; the others are quartered.
    #[inline]
    pub(super) fn any_below(&self, field: &DistanceField, row: usize, col: usize, threshold_m: f32) -> bool {
        let first = |index: usize| (index * CELL_PIXELS) as f32;
        self.block_below(field, first(row), first(col), CELL_PIXELS, threshold_m)
    }

    fn block_below(&self, field: &DistanceField, row: f32, col: f32, size: usize, threshold_m: f32) -> bool {
        if size == 1 {
            return field.at(self.point(row, col)) <= threshold_m;
        }
        // √2 of the gradient times √2/2 of the diagonal: the side itself bounds the change towards a corner pixel.
        let bound_m = |side_pixels: usize| LIPSCHITZ * LIPSCHITZ * 0.5 * self.pixel_m * side_pixels as f32;
        let to_centre = 0.5 * (size - 1) as f32;
        let centre_m = field.at_nearest_node(self.point(row + to_centre, col + to_centre));
        if centre_m > threshold_m + bound_m(size - 1) + NEAREST_NODE_M {
            return false;
        }
        if centre_m < threshold_m - bound_m(1) - NEAREST_NODE_M {
            return true;
        }
        let half = size / 2;
        let quarters = [(0, 0), (0, half), (half, 0), (half, half)];
        quarters.into_iter().any(|(r, c)| self.block_below(field, row + r as f32, col + c as f32, half, threshold_m))
    }
}
