//! Convex polygons laid over the view, and the ground hidden behind tall things.
//!
//! The label image was warped by a ground homography (paper), so a thing of height h at ground range r smears away
//! from the camera to r·H/(H − h), and to infinity for h ≥ H (methods.md 1.7).

use super::{BEV_PIXELS, CELL_PIXELS, GridGeometry, OccupancyGrid};
use crate::geometry::Vec2;

/// Longest smear, as a multiple of the range: from 2 m on it leaves the patch.
const FACTOR_MAX: f32 = 12.0;
/// Corners a polygon may have; an octagon's shadow has ten.
const CORNERS_MAX: usize = 12;

/// A convex polygon in the ego frame, without allocation.
#[derive(Debug, Clone, Copy)]
pub(super) struct ConvexInEgo {
    corners: [Vec2; CORNERS_MAX],
    n_corners: usize,
}

impl ConvexInEgo {
    pub(super) fn new(corners: impl IntoIterator<Item = Vec2>) -> Self {
        let mut polygon = Self { corners: [Vec2::ZERO; CORNERS_MAX], n_corners: 0 };
        for corner in corners {
            polygon.push(corner);
        }
        polygon
    }

    fn push(&mut self, corner: Vec2) {
        self.corners[self.n_corners] = corner;
        self.n_corners += 1;
    }

    /// Calls `span(row, first_col, last_col)` for every pixel row in which pixel centres lie inside the polygon.
    #[expect(clippy::needless_bitwise_bool, reason = "values instead of branches are computed for four rows at once")]
    pub(super) fn for_each_row(&self, geometry: &GridGeometry, mut span: impl FnMut(usize, usize, usize)) {
        let corners = &self.corners[..self.n_corners];
        let Some(box_) = self.pixel_box(geometry) else { return };
        let (pixel_m, pixels_per_m) = (geometry.pixel_m(), 1.0 / geometry.pixel_m());
        let half_m = 0.5 * geometry.side_m;
        let far_m = geometry.far_edge_ahead_m();
        // Walk the edges: each lends its crossing to the rows between its ends. Conditions are values here, not branches,
        // so that four rows are done at once.
        let mut right_m = [f32::INFINITY; BEV_PIXELS];
        let mut left_m = [f32::NEG_INFINITY; BEV_PIXELS];
        let mut a = corners[corners.len() - 1];
        for &b in corners {
            let (low, high) = if a.x <= b.x { (a, b) } else { (b, a) };
            // Rows with low.x <= ahead < high.x; one more on either side, then tested exactly.
            let rows = rows_between(geometry, low.x, high.x);
            let slope = (high.y - low.y) / (high.x - low.x);
            let first = rows.start.max(box_.rows.start);
            let rows = first..rows.end.min(box_.rows.end).max(first);
            let spans = right_m[rows.clone()].iter_mut().zip(&mut left_m[rows]);
            for (row, (right_m, left_m)) in (first as i32..).zip(spans) {
                let ahead_m = far_m - (row as f32 + 0.5) * pixel_m;
                let is_crossed = (low.x <= ahead_m) & (ahead_m < high.x);
                let y = low.y + (ahead_m - low.x) * slope;
                *right_m = if is_crossed & (y < *right_m) { y } else { *right_m };
                *left_m = if is_crossed & (y > *left_m) { y } else { *left_m };
            }
            a = b;
        }
        for row in box_.rows {
            if left_m[row] < right_m[row] {
                continue;
            }
            // Pixel centres: left = half − (col + ½)·pixel.
            let col_of = |y: f32| (half_m - y) * pixels_per_m - 0.5;
            let first = ceil(col_of(left_m[row]).clamp(0.0, BEV_PIXELS as f32)) as usize;
            let last = col_of(right_m[row]).min((BEV_PIXELS - 1) as f32);
            if last >= first as f32 {
                span(row, first, last as i32 as usize);
            }
        }
    }

    /// Pixel rows and columns around the part of the polygon that lies in the view.
    fn pixel_box(&self, geometry: &GridGeometry) -> Option<PixelBox> {
        let (low, high) = crate::distance_field::bounds(&self.corners[..self.n_corners]);
        let half_m = 0.5 * geometry.side_m;
        if low.y > half_m || high.y < -half_m {
            return None;
        }
        let rows = rows_between(geometry, low.x, high.x);
        let col_of = |y: f32| ((half_m - y) / geometry.pixel_m()).clamp(0.0, (BEV_PIXELS - 1) as f32) as usize;
        (!rows.is_empty()).then(|| PixelBox { rows, first_col: col_of(high.y), last_col: col_of(low.y) })
    }

    /// Marks every cell that holds a pixel of the polygon.
    pub(super) fn occupy(&self, geometry: &GridGeometry, grid: &mut OccupancyGrid) {
        // Most hidden ground lies beyond the lane, where everything is occupied already.
        let Some(box_) = self.pixel_box(geometry) else { return };
        let mask = bits_between(box_.first_col / CELL_PIXELS, box_.last_col / CELL_PIXELS);
        if (box_.rows.start / CELL_PIXELS..=(box_.rows.end - 1) / CELL_PIXELS).all(|row| grid.row(row) & mask == mask) {
            return;
        }
        self.for_each_row(geometry, |row, first, last| {
            grid.occupy_row(row / CELL_PIXELS, bits_between(first / CELL_PIXELS, last / CELL_PIXELS));
        });
    }
}

/// Smallest whole number at or above a non-negative value. `f32::ceil` is a library call on baseline x86-64.
fn ceil(value: f32) -> i32 {
    let truncated = value as i32;
    truncated + i32::from(value > truncated as f32)
}

struct PixelBox {
    rows: std::ops::Range<usize>,
    first_col: usize,
    last_col: usize,
}

/// Pixel rows whose centres may lie between two distances ahead; up to one row too many at either end.
fn rows_between(geometry: &GridGeometry, low_m: f32, high_m: f32) -> std::ops::Range<usize> {
    let row_of =
        |ahead_m: f32| ((geometry.far_edge_ahead_m() - ahead_m) / geometry.pixel_m()).clamp(-1.0, BEV_PIXELS as f32);
    let first = (row_of(high_m) - 1.0).max(0.0) as usize;
    let end = (row_of(low_m) + 1.0).clamp(0.0, BEV_PIXELS as f32) as usize;
    first..end
}

/// Bits `first..=last`.
fn bits_between(first: usize, last: usize) -> u32 {
    ((1_u32 << (last + 1)) - 1) & !((1_u32 << first) - 1)
}

/// The ground hidden behind a convex counter-clockwise outline, without the thing itself; `None` if it is beside or
/// behind the camera, which stands at (`camera_ahead_m`, 0).
pub(super) fn hidden_ground(
    outline_in_ego: &[Vec2],
    height_m: f32,
    camera_ahead_m: f32,
    camera_height_m: f32,
) -> Option<ConvexInEgo> {
    let camera = Vec2::new(camera_ahead_m, 0.0);
    let n = outline_in_ego.len();
    let from_camera = |i: usize| outline_in_ego[i % n] - camera;
    if (0..n).any(|i| from_camera(i).x <= 0.05) {
        return None;
    }
    // Edge a→b of a counter-clockwise outline faces the camera if the camera lies to its right.
    let faces_camera = |i: usize| from_camera(i).perp_dot(from_camera(i + 1)) < 0.0;
    // The far chain runs from the end of the facing edges to their start.
    let start = (0..n).find(|&i| faces_camera(i + n - 1) && !faces_camera(i))?;
    let end = (start + 1..=start + n).find(|&i| faces_camera(i))?;
    let factor = if height_m < camera_height_m {
        (camera_height_m / (camera_height_m - height_m)).min(FACTOR_MAX)
    } else {
        FACTOR_MAX
    };
    let near = [end, start].map(|i| camera + from_camera(i));
    Some(ConvexInEgo::new(near.into_iter().chain((start..=end).map(|i| camera + from_camera(i) * factor))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn box_ahead() -> [Vec2; 4] {
        crate::geometry::rectangle(crate::geometry::Pose::new(Vec2::new(8.0, 0.0), 0.0), 2.0, 2.0)
    }

    /// Hand-computed: camera at (1.6, 0), H 1.55, h 0.775 → factor 2. The box spans ranges 5.4–7.4 ahead of the camera,
    /// so its far side smears to 1.6 + 2 · 7.4 = 16.4 m ahead, between the bearings ±1/5.4 of its near corners.
    #[test]
    fn a_box_of_half_the_camera_height_doubles_its_range() {
        let geometry = GridGeometry::paper();
        let polygon = hidden_ground(&box_ahead(), 0.775, 1.6, 1.55).unwrap();
        let mut rows = vec![None; BEV_PIXELS];
        polygon.for_each_row(&geometry, |row, first, last| rows[row] = Some((first, last)));
        // 12 m ahead: the wedge is 2 · (12 − 1.6)/5.4 = 3.85 m wide → 64 pixels.
        let row = ((geometry.far_edge_ahead_m() - 12.0) / geometry.pixel_m()) as usize;
        let (first, last) = rows[row].unwrap();
        assert!((63..=65).contains(&(last - first + 1)), "{first}..={last}");
        // Nothing before the box.
        let row = ((geometry.far_edge_ahead_m() - 6.5) / geometry.pixel_m()) as usize;
        assert_eq!(rows[row], None);
        let mut grid = OccupancyGrid::free();
        polygon.occupy(&geometry, &mut grid);
        assert!(grid.is_occupied(3, 12) && grid.is_occupied(0, 12) && !grid.is_occupied(3, 0));
    }

    #[test]
    fn a_curb_smears_by_a_tenth_and_a_car_to_the_horizon() {
        let geometry = GridGeometry::paper();
        let reach = |height_m| {
            let mut first_row = BEV_PIXELS;
            let polygon = hidden_ground(&box_ahead(), height_m, 1.59, 1.55).unwrap();
            polygon.for_each_row(&geometry, |row, _, _| first_row = first_row.min(row));
            geometry.pixel_in_ego(first_row, 0).x
        };
        // Far side 9 m: range 7.41 · 1.107 = 8.20 → 9.79 m ahead.
        assert!((reach(0.15) - 9.79).abs() < 0.07, "{}", reach(0.15));
        assert!(reach(1.47) > 16.2);
    }

    #[test]
    fn things_beside_or_behind_the_camera_hide_nothing() {
        let beside = crate::geometry::rectangle(crate::geometry::Pose::new(Vec2::new(1.0, 3.0), 0.0), 2.0, 2.0);
        assert!(hidden_ground(&beside, 1.5, 1.59, 1.55).is_none());
    }
}
