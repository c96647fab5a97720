//! Convex polygons laid over the view, and the ground hidden behind tall things.
//!
//! The label image was warped by a ground homography (paper), so an object of height h at ground range r covers
//! the ground behind it up to range r·H/(H − h), and to infinity for h ≥ H (docs/methods.md 1.7).

use super::quadtree::pixels_of;
use super::{BEV_PIXELS, CELL_PIXELS, GRID_CELLS, GridGeometry, OccupancyGrid};
use crate::geometry::{Outline, Vec2};
use crate::vectors::{FourPoints, LANES, bounded, counted_from, f32x4};
use std::ops::Range;

/// Longest occlusion, as a multiple of the range: from 2 m on it leaves the patch.
const FACTOR_MAX: f32 = 12.0;
/// Corners a polygon may have; the shadow of an octagon that is cut has eleven.
const CORNERS_MAX: usize = 12;
/// What is not this far ahead of the camera hides nothing, metres.
const AHEAD_MIN_M: f32 = 0.05;
/// Where what is left of an outline begins that reaches back beside the camera, metres ahead of it: a little more than
/// the above, so that the part counts as ahead.
const PART_FROM_M: f32 = 2.0 * AHEAD_MIN_M;

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
    pub(super) fn for_each_row(&self, geometry: &GridGeometry, mut span: impl FnMut(usize, usize, usize)) {
        let Some(spans) = self.all_spans(geometry) else { return };
        for row in spans.rows.clone() {
            let (first, end) = (spans.first[row] as usize, spans.end[row] as usize);
            if first < end {
                span(row, first, end - 1);
            }
        }
    }

    /// Marks every cell that holds a pixel of the polygon.
    pub(super) fn occupy(&self, geometry: &GridGeometry, grid: &mut OccupancyGrid) {
        let Some(spans) = self.spans_of_free_cells(geometry, grid) else { return };
        for row in spans.cell_rows() {
            grid.occupy_row(row, spans.touched_cells(row));
        }
    }

    /// Its pixels; `None` if it is out of view.
    pub(super) fn all_spans(&self, geometry: &GridGeometry) -> Option<Spans> {
        self.spans(geometry, &(0..BEV_PIXELS))
    }

    /// Its pixels, without rows in which a grid is occupied anyway.
    pub(super) fn spans_of_free_cells(&self, geometry: &GridGeometry, grid: &OccupancyGrid) -> Option<Spans> {
        let (low, high) = self.bounds();
        let free = CellBox::around(geometry, low, high)?.without_full_rows(grid);
        if free.is_empty() { None } else { self.spans(geometry, &(free.start * CELL_PIXELS..free.end * CELL_PIXELS)) }
    }

    fn bounds(&self) -> (Vec2, Vec2) {
        crate::geometry::bounds(&self.corners[..self.n_corners])
    }

    /// The pixels whose centres lie inside the polygon, in some of the rows; `None` if it is out of view.
    fn spans(&self, geometry: &GridGeometry, rows: &Range<usize>) -> Option<Spans> {
        let (low, high) = self.bounds();
        let half_m = 0.5 * geometry.side_m;
        let fours = fours(&common(&rows_between(geometry, low.x, high.x), rows));
        if fours.is_empty() || low.y > half_m || high.y < -half_m {
            return None;
        }
        let (pixel_m, pixels_per_m) = (f32x4::splat(geometry.pixel_m()), f32x4::splat(1.0 / geometry.pixel_m()));
        let far_m = f32x4::splat(geometry.far_edge_ahead_m());
        // Walk the edges: each lends its crossing to the rows between its ends.
        let mut right_m = [f32x4::splat(f32::INFINITY); BEV_PIXELS / LANES];
        let mut left_m = [f32x4::splat(f32::NEG_INFINITY); BEV_PIXELS / LANES];
        for first in (0..self.n_corners).step_by(LANES) {
            let edges = FourEdges::new(self, first, geometry, &fours);
            for lane in 0..LANES.min(self.n_corners - first) {
                let edge = |of: &f32x4| f32x4::splat(of.as_array()[lane]);
                let (low_x, high_x, low_y) = (edge(&edges.low.x), edge(&edges.high.x), edge(&edges.low.y));
                let slope = edge(&edges.slopes);
                // Rows with low.x <= ahead < high.x; one more on either side, then tested exactly.
                for four in edges.first_fours[lane] as usize..edges.end_fours[lane] as usize {
                    let ahead_m = far_m - (counted_from(four * LANES) + f32x4::HALF) * pixel_m;
                    let is_crossed = low_x.simd_le(ahead_m) & ahead_m.simd_lt(high_x);
                    let y = low_y + (ahead_m - low_x) * slope;
                    right_m[four] = is_crossed.select(y.fast_min(right_m[four]), right_m[four]);
                    left_m[four] = is_crossed.select(y.fast_max(left_m[four]), left_m[four]);
                }
            }
        }
        // Pixel centres: left = half − (col + ½)·pixel.
        let col_of = |y: f32x4| (f32x4::splat(half_m) - y) * pixels_per_m - f32x4::HALF;
        let rows = fours.start * LANES..fours.end * LANES;
        let mut spans = Spans { first: [0; BEV_PIXELS], end: [0; BEV_PIXELS], rows };
        for four in fours {
            let first = ceil(bounded(col_of(left_m[four]), BEV_PIXELS as f32));
            let last = col_of(right_m[four]).fast_min(f32x4::splat((BEV_PIXELS - 1) as f32));
            let is_empty = left_m[four].simd_lt(right_m[four]) | last.simd_lt(first);
            let end = (last + f32x4::ONE).fast_trunc_int();
            let columns = |of: f32x4| (!is_empty & of).fast_trunc_int().to_array().map(|col| col as u8);
            let rows = four * LANES..(four + 1) * LANES;
            spans.first[rows.clone()].copy_from_slice(&columns(first));
            spans.end[rows].copy_from_slice(&columns(f32x4::from_i32x4(end)));
        }
        Some(spans)
    }
}

/// Four edges of a polygon.
struct FourEdges {
    /// The ends that are less far ahead, and the others.
    low: FourPoints,
    high: FourPoints,
    /// Left per ahead.
    slopes: f32x4,
    /// The fours of rows between their ends, one row more on either side.
    first_fours: [i32; LANES],
    end_fours: [i32; LANES],
}

impl FourEdges {
    /// The edges that end in four corners from one on, as far as they lie in some fours of rows.
    fn new(polygon: &ConvexInEgo, first: usize, geometry: &GridGeometry, fours: &Range<usize>) -> Self {
        let n = polygon.n_corners;
        let from = FourPoints::from(std::array::from_fn(|i| polygon.corners[(first + i + n - 1) % n]));
        let to = FourPoints::from(std::array::from_fn(|i| polygon.corners[(first + i) % n]));
        let is_from_low = from.x.simd_le(to.x);
        let lower = |a: FourPoints, b: FourPoints| FourPoints {
            x: is_from_low.select(a.x, b.x),
            y: is_from_low.select(a.y, b.y),
        };
        let (low, high) = (lower(from, to), lower(to, from));
        let row_of = |ahead_m: f32x4| {
            (f32x4::splat(geometry.far_edge_ahead_m()) - ahead_m) * f32x4::splat(1.0 / geometry.pixel_m())
        };
        let index = |fours_of_rows: f32x4| {
            let within = fours_of_rows.fast_max(f32x4::splat(fours.start as f32));
            within.fast_min(f32x4::splat(fours.end as f32)).fast_trunc_int().to_array()
        };
        let per_four = f32x4::splat(1.0 / LANES as f32);
        Self {
            low,
            high,
            slopes: (high.y - low.y) / (high.x - low.x),
            first_fours: index((row_of(high.x) - f32x4::ONE) * per_four),
            end_fours: index((row_of(low.x) + f32x4::ONE) * per_four + f32x4::ONE),
        }
    }
}

/// The pixels of a convex polygon, row by row.
pub(super) struct Spans {
    /// First column of each row.
    first: [u8; BEV_PIXELS],
    /// The column after the last; equal to the first where there is none.
    end: [u8; BEV_PIXELS],
    /// The rows that were computed.
    rows: Range<usize>,
}

impl Spans {
    /// Rows of cells that may hold pixels.
    pub(super) fn cell_rows(&self) -> Range<usize> {
        self.rows.start / CELL_PIXELS..self.rows.end.div_ceil(CELL_PIXELS)
    }

    /// The cells of a row of cells that hold pixels, bit = column.
    #[inline]
    pub(super) fn touched_cells(&self, cell_row: usize) -> u32 {
        const PIXELS: u32 = CELL_PIXELS as u32;
        let rows = pixels_of(cell_row);
        let spans = self.first[rows.clone()].iter().zip(&self.end[rows]);
        // A span without pixels is 0..0, whose bits are none.
        let cells = spans.map(|(&first, &end)| {
            let (first, end) = (u32::from(first) / PIXELS, u32::from(end).div_ceil(PIXELS));
            (1 << end) - (1 << first)
        });
        cells.fold(0, |all, cells| all | cells)
    }

    /// The pixels of a row of pixels in a column of cells, bit = column within.
    #[inline]
    pub(super) fn pixels_of_cell(&self, row: usize, cell_col: usize) -> u8 {
        let start = (cell_col * CELL_PIXELS) as u8;
        let [first, end] = [self.first[row], self.end[row]].map(|col| col.saturating_sub(start).min(CELL_PIXELS as u8));
        ((1_u32 << end) - (1 << first)) as u8
    }
}

/// A rectangle of cells.
pub(super) struct CellBox {
    rows: Range<usize>,
    /// Bit = column.
    mask: u32,
}

impl CellBox {
    /// The cells that may hold pixels of a box in the ego frame; `None` if it is out of view.
    pub(super) fn around(geometry: &GridGeometry, low: Vec2, high: Vec2) -> Option<Self> {
        let half_m = 0.5 * geometry.side_m;
        let rows = rows_between(geometry, low.x, high.x);
        if rows.is_empty() || low.y > half_m || high.y < -half_m {
            return None;
        }
        let cols_per_m = 1.0 / geometry.cell_m();
        let col_of = |y: f32| between((half_m - y) * cols_per_m, 0.0, (GRID_CELLS - 1) as f32) as i32 as usize;
        Some(Self {
            rows: rows.start / CELL_PIXELS..rows.end.div_ceil(CELL_PIXELS),
            mask: bits_between(col_of(high.y), col_of(low.y)),
        })
    }

    /// Whether a grid is occupied in all of it.
    pub(super) fn is_full(&self, grid: &OccupancyGrid) -> bool {
        self.rows.clone().all(|row| self.is_full_in(grid, row))
    }

    /// Its rows from the first to the last that a grid does not occupy.
    fn without_full_rows(&self, grid: &OccupancyGrid) -> Range<usize> {
        let is_free = |&row: &usize| !self.is_full_in(grid, row);
        let first = self.rows.clone().find(is_free);
        let last = self.rows.clone().rev().find(is_free);
        first.zip(last).map_or(0..0, |(first, last)| {
            let end = last + 1;
            first..end
        })
    }

    fn is_full_in(&self, grid: &OccupancyGrid, row: usize) -> bool {
        grid.row(row) & self.mask == self.mask
    }
}

/// Smallest whole numbers at or above values that are not negative.
#[inline]
fn ceil(values: f32x4) -> f32x4 {
    let whole = f32x4::from_i32x4(values.fast_trunc_int());
    whole + (whole.simd_lt(values) & f32x4::ONE)
}

/// Bounds a value, like `clamp`, by values instead of branches.
#[inline]
fn between(value: f32, low: f32, high: f32) -> f32 {
    let value = if value > low { value } else { low };
    if value < high { value } else { high }
}

/// What two ranges have in common; empty, but in the first, if nothing.
#[inline]
fn common(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    let start = a.start.max(b.start);
    start..a.end.min(b.end).max(start)
}

/// The fours that hold a range of rows.
#[inline]
fn fours(rows: &Range<usize>) -> Range<usize> {
    rows.start / LANES..rows.end.div_ceil(LANES)
}

/// Pixel rows whose centres may lie between two distances ahead; up to one row too many at either end.
fn rows_between(geometry: &GridGeometry, low_m: f32, high_m: f32) -> Range<usize> {
    let row_of = |ahead_m: f32| (geometry.far_edge_ahead_m() - ahead_m) / geometry.pixel_m();
    let index = |row: f32| between(row, 0.0, BEV_PIXELS as f32) as i32 as usize;
    index(row_of(high_m) - 1.0)..index(row_of(low_m) + 1.0)
}

/// Bits `first..=last`.
fn bits_between(first: usize, last: usize) -> u32 {
    ((1_u32 << (last + 1)) - 1) & !((1_u32 << first) - 1)
}

/// Where the camera is: ahead of the rear axle and above ground, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Camera {
    pub(super) ahead_m: f32,
    pub(super) height_m: f32,
}

/// A convex object of some height, seen from the camera.
pub(super) struct TallObject {
    /// Counter-clockwise; relative to the camera, ahead and left.
    outline: Outline,
    /// Range up to which ground is hidden, as a multiple of the object's range.
    factor: f32,
    camera: Vec2,
}

impl TallObject {
    /// `outline_in_ego`: convex and counter-clockwise, or the two ends of a wall.
    #[inline]
    pub(super) fn new(outline_in_ego: &Outline, height_m: f32, camera: Camera) -> Self {
        let factor = if height_m < camera.height_m {
            (camera.height_m / (camera.height_m - height_m)).min(FACTOR_MAX)
        } else {
            FACTOR_MAX
        };
        let camera = Vec2::new(camera.ahead_m, 0.0);
        Self { outline: part_ahead(&outline_in_ego.moved(-camera)), factor, camera }
    }

    /// A box in the ego frame around the thing, as far as it is ahead of the camera, and the ground hidden behind it;
    /// `None` if nothing of it is ahead.
    #[inline]
    pub(super) fn hidden_box(&self) -> Option<(Vec2, Vec2)> {
        let (low, high) = self.outline.bounds();
        let is_ahead = low.x > AHEAD_MIN_M;
        is_ahead.then(|| (self.camera + low.min(low * self.factor), self.camera + high.max(high * self.factor)))
    }

    /// The ground hidden behind it, without the thing itself; `None` if nothing of it is ahead of the camera.
    pub(super) fn hidden_ground(&self) -> Option<ConvexInEgo> {
        let n = self.outline.n_corners();
        let from_camera = |i: usize| self.outline.corner(i % n);
        if self.outline.bounds().0.x <= AHEAD_MIN_M {
            return None;
        }
        // Edge a→b of a counter-clockwise outline faces the camera if the camera lies to its right.
        let faces_camera = |i: usize| from_camera(i).perp_dot(from_camera(i + 1)) < 0.0;
        // The far chain runs from the end of the facing edges to their start.
        let start = (0..n).find(|&i| faces_camera(i + n - 1) && !faces_camera(i))?;
        let end = (start + 1..=start + n).find(|&i| faces_camera(i))?;
        let near = [end, start].map(|i| self.camera + from_camera(i));
        let far = (start..=end).map(|i| self.camera + from_camera(i) * self.factor);
        Some(ConvexInEgo::new(near.into_iter().chain(far)))
    }
}

/// The part of a convex outline, or of a piece of a wall, relative to the camera, that is ahead of it: what the car passes
/// reaches back beside the camera, and hides from there on. An outline that is not ahead at all stays as it is.
fn part_ahead(outline: &Outline) -> Outline {
    let (low, high) = outline.bounds();
    if low.x > AHEAD_MIN_M || high.x <= PART_FROM_M {
        return *outline;
    }
    let n = outline.n_corners();
    // A wall of two ends has one side, whose way back is the same line.
    let sides = if n == 2 { 1 } else { n };
    let first = (n == 2).then(|| outline.corner(0)).filter(|first| first.x > PART_FROM_M);
    let of_side = |i: usize| {
        let (a, b) = (outline.corner(i), outline.corner((i + 1) % n));
        let is_crossing = (a.x > PART_FROM_M) != (b.x > PART_FROM_M);
        let meets = || Vec2::new(PART_FROM_M, a.y + (PART_FROM_M - a.x) / (b.x - a.x) * (b.y - a.y));
        is_crossing.then(meets).into_iter().chain(Some(b).filter(|b| b.x > PART_FROM_M))
    };
    first.into_iter().chain((0..sides).flat_map(of_side)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera { ahead_m: 1.59, height_m: 1.55 };

    fn hidden_ground(outline: &[Vec2], height_m: f32, camera: Camera) -> Option<ConvexInEgo> {
        TallObject::new(&outline.iter().copied().collect(), height_m, camera).hidden_ground()
    }

    fn box_ahead() -> [Vec2; 4] {
        crate::geometry::rectangle(crate::geometry::Pose::new(Vec2::new(8.0, 0.0), 0.0), 2.0, 2.0)
    }

    /// Hand-computed: camera at (1.6, 0), H 1.55, h 0.775 → factor 2. The box spans ranges 5.4–7.4 ahead of the camera,
    /// so it hides ground up to 1.6 + 2 · 7.4 = 16.4 m ahead, between the bearings ±1/5.4 of its near corners.
    #[test]
    fn a_box_of_half_the_camera_height_doubles_its_range() {
        let geometry = GridGeometry::paper();
        let polygon = hidden_ground(&box_ahead(), 0.775, Camera { ahead_m: 1.6, ..CAMERA }).unwrap();
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
    fn a_curb_hides_a_tenth_of_its_range_and_a_car_everything_behind_it() {
        let geometry = GridGeometry::paper();
        let reach = |height_m| {
            let mut first_row = BEV_PIXELS;
            let polygon = hidden_ground(&box_ahead(), height_m, CAMERA).unwrap();
            polygon.for_each_row(&geometry, |row, _, _| first_row = first_row.min(row));
            geometry.pixel_in_ego(first_row, 0).x
        };
        // Far side 9 m: range 7.41 · 1.107 = 8.20 → 9.79 m ahead.
        assert!((reach(0.15) - 9.79).abs() < 0.07, "{}", reach(0.15));
        assert!(reach(1.47) > 16.2);
    }

    /// A wall 2 m to the left, from behind the camera to 6 m ahead of it: ground beyond it is hidden as far as lines of
    /// sight meet it, and the order of its ends does not matter.
    #[test]
    fn a_wall_beside_the_camera_hides_what_is_beyond_it() {
        let geometry = GridGeometry::paper();
        let camera = CAMERA.ahead_m;
        for ends in [[(-3.0, 2.0), (6.0, 2.0)], [(6.0, 2.0), (-3.0, 2.0)]] {
            let wall = ends.map(|(x, y)| Vec2::new(camera + x, y));
            let polygon = hidden_ground(&wall, 2.0, CAMERA).unwrap();
            let mut view = vec![[false; BEV_PIXELS]; BEV_PIXELS];
            polygon.for_each_row(&geometry, |row, first, last| view[row][first..=last].fill(true));
            for (row, pixels) in view.iter().enumerate() {
                for (col, &is_hidden) in pixels.iter().enumerate() {
                    let pixel = geometry.pixel_in_ego(row, col);
                    let (ahead_m, left_m) = (pixel.x - camera, pixel.y);
                    // The line of sight crosses y = 2 at x = 2·ahead/left, which must lie on the wall.
                    let margin_m = (left_m - 2.0).min(6.0 * left_m - 2.0 * ahead_m);
                    assert!(is_hidden == (margin_m > 0.0) || margin_m.abs() < 0.1, "({ahead_m}, {left_m})");
                }
            }
        }
    }

    /// Passing a long wall, a parked car or a round thing as high as the camera, which reach back beside it: what is hidden
    /// is what lines of sight that meet the part ahead would reach, pixel by pixel. They hid nothing once a corner was level
    /// with the camera.
    #[test]
    fn what_reaches_back_beside_the_camera_hides_what_is_behind_its_part_ahead() {
        use crate::geometry::{Pose, polygon_contains, rectangle};
        let geometry = GridGeometry::paper();
        let camera = Vec2::new(CAMERA.ahead_m, 0.0);
        let wall = rectangle(Pose::new(Vec2::new(2.0, 1.8), 0.02), 25.0, 0.2).to_vec();
        let car = rectangle(Pose::new(Vec2::new(2.5, -2.6), -0.05), 4.7, 1.9).to_vec();
        let octagon = |centre: Vec2| {
            (0..8).map(move |k| centre + 0.4 * crate::maths::unit(0.3 + k as f32 * std::f32::consts::FRAC_PI_4))
        };
        let round = octagon(Vec2::new(CAMERA.ahead_m + 0.33, 1.4)).collect::<Vec<_>>();
        for outline in [wall, car, round] {
            assert!(crate::geometry::bounds(&outline).0.x < camera.x, "it reaches back");
            let polygon = hidden_ground(&outline, 3.0, CAMERA).unwrap();
            let mut view = vec![[false; BEV_PIXELS]; BEV_PIXELS];
            polygon.for_each_row(&geometry, |row, first, last| view[row][first..=last].fill(true));
            let mut n_hidden = 0;
            for (row, pixels) in view.iter().enumerate() {
                for (col, &is_hidden) in pixels.iter().enumerate() {
                    let pixel = geometry.pixel_in_ego(row, col);
                    // Beside an edge of what is hidden either answer is right.
                    let near = [Vec2::ZERO, Vec2::X, -Vec2::X, Vec2::Y, -Vec2::Y].map(|by| pixel + 0.1 * by);
                    let is_met = |point: Vec2| {
                        let on_line = |i: u16| camera.lerp(point, f32::from(i) / 800.0);
                        (0..800).map(on_line).any(|at| at.x > camera.x + 0.1 && polygon_contains(&outline, at))
                    };
                    if polygon_contains(&outline, pixel) || near.iter().any(|&point| is_met(point) != is_met(pixel)) {
                        continue;
                    }
                    n_hidden += usize::from(is_hidden);
                    assert_eq!(is_hidden, is_met(pixel), "{pixel} behind {outline:?}");
                }
            }
            assert!(n_hidden > 50, "{n_hidden} of {outline:?}");
        }
    }

    #[test]
    fn things_that_end_beside_or_behind_the_camera_hide_nothing() {
        let beside = crate::geometry::rectangle(crate::geometry::Pose::new(Vec2::new(0.6, 3.0), 0.0), 2.0, 2.0);
        assert!(hidden_ground(&beside, 1.5, CAMERA).is_none());
    }
}
