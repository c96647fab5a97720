//! The drivable space as a raster of exact signed distances.
//!
//! Node values are distances to the exact polygons; between nodes they are interpolated bilinearly. That is exact
//! beside straight edges, within 3 cm beside corners, and up to 5 cm too small half-way between two things.

use crate::geometry::{Vec2, distance_to_segment, edges, polygon_contains};
use crate::vectors::{FourPoints, LANES, bounded, f32x4, i32x4, whole_and_part};

/// Spacing of the nodes, metres.
pub const NODE_M: f32 = 0.1;
/// Distances are capped here, metres: no caller needs more.
pub const CAP_M: f32 = 3.0;

/// How much [`DistanceField::at`] may differ, anywhere within `radius_m` of a place, from the value at the node nearest
/// to that place, metres.
///
/// Nodes hold distances, so they differ by no more than they are apart. An interpolated value is a mean of four of
/// them, whose weights w put the mean at the point p: for any node c, Σ w |n − c| ≤ √(|p − c|² + Σ w |n − p|²), and
/// the second term, f(1 − f) per axis, is at most half a squared spacing.
#[must_use]
pub fn change_max_m(radius_m: f32) -> f32 {
    let to_node_m = std::f32::consts::FRAC_1_SQRT_2 * NODE_M;
    (radius_m + to_node_m).hypot(std::f32::consts::FRAC_1_SQRT_2 * NODE_M) + ROUNDING_M
}

/// How much [`DistanceField::at`] may differ between two places that are `apart_m` apart, metres.
///
/// Neighbouring nodes differ by no more than they are apart, so it changes by no more than 1 m per metre along each axis.
#[must_use]
pub fn interpolated_change_max_m(apart_m: f32) -> f32 {
    std::f32::consts::SQRT_2 * apart_m + ROUNDING_M
}

/// A generous bound of rounding in single precision, metres.
const ROUNDING_M: f32 = 1e-4;

/// Bits of a distance far outside the lot, −[`CAP_M`].
const FAR_OUTSIDE: u32 = (-CAP_M).to_bits();

/// Signed distance to the non-drivable set, metres: positive in drivable space.
#[derive(Debug, Clone)]
pub struct DistanceField {
    origin: Vec2,
    cols: usize,
    rows: usize,
    /// Row by row, the bits of the distance, exclusive or [`FAR_OUTSIDE`]. Far outside is 0, as memory comes from the
    /// system: of a lot that fills little of its bounding box, most of the raster is never touched.
    nodes: Vec<u32>,
}

/// What is read beyond the last node when four neighbours are.
const SPARE_NODES: usize = LANES - 2;

impl DistanceField {
    /// Distances inside a boundary polygon: its outside is non-drivable.
    pub fn of_boundary(boundary: &[Vec2]) -> Self {
        let margin = Vec2::splat(CAP_M + 2.0 * NODE_M);
        let (low, high) = bounds(boundary);
        let origin = low - margin;
        let size = (high + margin - origin) / NODE_M;
        let (cols, rows) = (size.x.ceil() as usize + 1, size.y.ceil() as usize + 1);
        let mut field =
            Self { origin, cols, rows, nodes: vec![CAP_M.to_bits() ^ FAR_OUTSIDE; cols * rows + SPARE_NODES] };
        for (a, b) in edges(boundary) {
            let (low, high) = bounds(&[a, b]);
            field.lower_within(low, high, CAP_M, |point| distance_to_segment(point, a, b));
        }
        field.negate_outside(boundary);
        field
    }

    /// Carves a non-drivable polygon (any winding, need not be convex).
    pub fn carve_polygon(&mut self, polygon: &[Vec2]) {
        let (low, high) = bounds(polygon);
        self.lower_within(low, high, CAP_M, |point| {
            let distance_m =
                edges(polygon).map(|(a, b)| distance_to_segment(point, a, b)).fold(f32::INFINITY, f32::min);
            if polygon_contains(polygon, point) { -distance_m } else { distance_m }
        });
    }

    /// Carves a non-drivable disc.
    pub fn carve_disc(&mut self, centre: Vec2, radius_m: f32) {
        let half = Vec2::splat(radius_m);
        self.lower_within(centre - half, centre + half, CAP_M, |point| point.distance(centre) - radius_m);
    }

    /// Signed distance at a world point, metres, capped at ±[`CAP_M`]; outside the raster −[`CAP_M`].
    #[inline]
    pub fn at(&self, point: Vec2) -> f32 {
        let node = (point - self.origin) * (1.0 / NODE_M);
        let x = node.x.clamp(0.0, (self.cols - 2) as f32);
        let y = node.y.clamp(0.0, (self.rows - 2) as f32);
        // i32 first: a saturating cast to a 64-bit unsigned costs several instructions more.
        let (col, row) = (x as i32, y as i32);
        let (fx, fy) = ((x - col as f32).min(1.0), (y - row as f32).min(1.0));
        let base = row as usize * self.cols + col as usize;
        let [a, b] = [base, base + self.cols].map(|start| {
            let (left, right) = (self.node_m(start), self.node_m(start + 1));
            left + fx * (right - left)
        });
        a + fy * (b - a)
    }

    /// Signed distance at the nearest node, metres: within [`change_max_m`] of [`Self::at`] around it, and much faster.
    #[inline]
    pub fn at_nearest_node(&self, point: Vec2) -> f32 {
        let node = (point - self.origin) * (1.0 / NODE_M) + Vec2::splat(0.5);
        let col = node.x.clamp(0.0, (self.cols - 1) as f32) as i32;
        let row = node.y.clamp(0.0, (self.rows - 1) as f32) as i32;
        self.node_m(row as usize * self.cols + col as usize)
    }

    /// [`Self::at`] at four points, to the bit.
    #[expect(clippy::inline_always, reason = "called, it takes and returns vectors through memory: a tenth of the loop")]
    #[inline(always)]
    pub fn at_four(&self, points: FourPoints) -> f32x4 {
        let node = self.nodes_from_world(points);
        let (cols, into_x) = whole_and_part(bounded(node.x, count(self.cols - 2)));
        let (rows, into_y) = whole_and_part(bounded(node.y, count(self.rows - 2)));
        let near = self.indices(rows, cols);
        let across = |indices: [usize; LANES]| {
            let [left, right, ..] = f32x4::transpose(indices.map(|index| self.four_nodes_m(index)));
            left + into_x * (right - left)
        };
        let (near_m, far_m) = (across(near), across(near.map(|index| index + self.cols)));
        near_m + into_y * (far_m - near_m)
    }

    /// [`Self::at_nearest_node`] at four points; half-way between two nodes it may choose the other one.
    #[inline]
    pub fn at_four_nearest_nodes(&self, points: FourPoints) -> f32x4 {
        let node = self.nodes_from_world(points) + FourPoints::splat(Vec2::splat(0.5));
        let (cols, _) = whole_and_part(bounded(node.x, count(self.cols - 1)));
        let (rows, _) = whole_and_part(bounded(node.y, count(self.rows - 1)));
        f32x4::from(self.indices(rows, cols).map(|index| self.node_m(index)))
    }

    /// [`Self::at`] at the points (`xs[i]`, `ys[i]`), to the bit.
    #[inline]
    pub fn at_each<const N: usize>(&self, xs: &[f32; N], ys: &[f32; N]) -> [f32; N] {
        let mut distances_m = [0.0; N];
        let points = xs.chunks(LANES).zip(ys.chunks(LANES));
        for ((xs, ys), distances_m) in points.zip(distances_m.chunks_mut(LANES)) {
            let four = |values: &[f32]| f32x4::from(std::array::from_fn(|i| values[i.min(values.len() - 1)]));
            let of_four_m = self.at_four(FourPoints { x: four(xs), y: four(ys) }).to_array();
            distances_m.copy_from_slice(&of_four_m[..distances_m.len()]);
        }
        distances_m
    }

    /// A lower bound of [`Self::at`] in a box of at most 0.6 m by 0.6 m, but for rounding. Minus infinity if the box is
    /// larger or at the very end of the raster.
    ///
    /// Between nodes the field is bilinear, so it is lowest on a grid of points: nodes inside the box, and where their
    /// rows and columns meet its sides.
    #[inline]
    pub fn lowest_within(&self, low: Vec2, high: Vec2) -> f32 {
        let node = self.nodes_from_world([low, high, low, high].into());
        let (cols, into_x) = whole_and_part(bounded(node.x, count(self.cols - 2)));
        let (rows, into_y) = whole_and_part(bounded(node.y, count(self.rows - 2)));
        let ([first_col, last_col, ..], [first_row, last_row, ..]) = (cols.to_array(), rows.to_array());
        let ([into_first_col, into_last_col, ..], [into_first_row, into_last_row, ..]) =
            (into_x.to_array(), into_y.to_array());
        let row = |row: i32| self.eight_nodes_m(row as usize * self.cols + first_col as usize);
        let mixed = |near: [f32x4; 2], far: [f32x4; 2], share: f32| {
            [0, 1].map(|i| near[i] + f32x4::splat(share) * (far[i] - near[i]))
        };
        let lower = |a: [f32x4; 2], b: [f32x4; 2]| [a[0].fast_min(b[0]), a[1].fast_min(b[1])];
        let (Some(before_first), Some(after_first), Some(before_last), Some(after_last)) =
            (row(first_row), row(first_row + 1), row(last_row), row(last_row + 1))
        else {
            return f32::NEG_INFINITY;
        };
        let mut lowest_m =
            lower(mixed(before_first, after_first, into_first_row), mixed(before_last, after_last, into_last_row));
        for nodes_m in (first_row + 1..=last_row).map(row) {
            let Some(nodes_m) = nodes_m else { return f32::NEG_INFINITY };
            lowest_m = lower(lowest_m, nodes_m);
        }
        // Of these, across: the two sides and what is between them.
        let mut columns_m = [0.0; 2 * LANES];
        columns_m[..LANES].copy_from_slice(lowest_m[0].as_array());
        columns_m[LANES..].copy_from_slice(lowest_m[1].as_array());
        let between = (last_col - first_col) as usize;
        let Some(&[.., left_m, right_m]) = columns_m.get(..between + 2) else { return f32::NEG_INFINITY };
        let first_m = columns_m[0] + into_first_col * (columns_m[1] - columns_m[0]);
        let last_m = left_m + into_last_col * (right_m - left_m);
        columns_m[1..=between].iter().fold(first_m.min(last_m), |low, &value| if value < low { value } else { low })
    }

    /// Coordinates in nodes from the first one.
    #[inline]
    fn nodes_from_world(&self, points: FourPoints) -> FourPoints {
        (points - FourPoints::splat(self.origin)) * f32x4::splat(1.0 / NODE_M)
    }

    #[inline]
    fn indices(&self, rows: i32x4, cols: i32x4) -> [usize; LANES] {
        let (rows, cols) = (rows.to_array(), cols.to_array());
        std::array::from_fn(|i| rows[i] as u32 as usize * self.cols + cols[i] as u32 as usize)
    }

    #[inline]
    fn node_m(&self, index: usize) -> f32 {
        f32::from_bits(self.nodes[index] ^ FAR_OUTSIDE)
    }

    /// A node and the next three.
    #[inline]
    fn four_nodes_m(&self, index: usize) -> f32x4 {
        from_stored(self.nodes[index..index + LANES].first_chunk().expect("four"))
    }

    /// A node and the next seven; `None` at the very end of the raster.
    #[inline]
    fn eight_nodes_m(&self, index: usize) -> Option<[f32x4; 2]> {
        let nodes = self.nodes.get(index..index + 2 * LANES)?;
        let (first, second) = nodes.split_at(LANES);
        Some([first, second].map(|nodes| from_stored(nodes.first_chunk().expect("four"))))
    }

    /// Lower-left and upper-right corners of the raster, world metres.
    pub fn bounds(&self) -> (Vec2, Vec2) {
        (self.origin, self.origin + Vec2::new((self.cols - 1) as f32, (self.rows - 1) as f32) * NODE_M)
    }

    /// Takes the minimum with `distance_m` at every node within `reach_m` of a box.
    fn lower_within(&mut self, low: Vec2, high: Vec2, reach_m: f32, distance_m: impl Fn(Vec2) -> f32) {
        let first = ((low - Vec2::splat(reach_m) - self.origin) / NODE_M).floor().max(Vec2::ZERO);
        let last = ((high + Vec2::splat(reach_m) - self.origin) / NODE_M).ceil();
        let (col_end, row_end) =
            ((last.x.max(0.0) as usize + 1).min(self.cols), (last.y.max(0.0) as usize + 1).min(self.rows));
        for row in first.y as usize..row_end {
            for col in first.x as usize..col_end {
                let point = self.origin + Vec2::new(col as f32, row as f32) * NODE_M;
                let index = row * self.cols + col;
                let value = self.node_m(index).min(distance_m(point).max(-CAP_M));
                self.nodes[index] = value.to_bits() ^ FAR_OUTSIDE;
            }
        }
    }

    /// Even-odd scan conversion: nodes outside the polygon become negative.
    fn negate_outside(&mut self, polygon: &[Vec2]) {
        let mut crossings = Vec::new();
        for row in 0..self.rows {
            let y = self.origin.y + row as f32 * NODE_M;
            crossings.clear();
            crossings.extend(
                edges(polygon)
                    .filter(|(a, b)| (a.y > y) != (b.y > y))
                    .map(|(a, b)| a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x)),
            );
            crossings.sort_by(f32::total_cmp);
            let mut passed = 0;
            for col in 0..self.cols {
                let x = self.origin.x + col as f32 * NODE_M;
                while passed < crossings.len() && crossings[passed] <= x {
                    passed += 1;
                }
                if passed % 2 == 0 {
                    self.nodes[row * self.cols + col] = (-self.node_m(row * self.cols + col)).to_bits() ^ FAR_OUTSIDE;
                }
            }
        }
    }
}

/// A number of nodes as a coordinate; from 64 bits it takes several instructions.
#[inline]
fn count(nodes: usize) -> f32 {
    nodes as i32 as f32
}

/// Distances of four nodes.
#[inline]
fn from_stored(nodes: &[u32; LANES]) -> f32x4 {
    f32x4::from(nodes.map(|bits| f32::from_bits(bits ^ FAR_OUTSIDE)))
}

/// Smallest axis-aligned box around points.
pub fn bounds(points: &[Vec2]) -> (Vec2, Vec2) {
    points.iter().fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), &point| (low.min(point), high.max(point)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle() -> Vec<Vec2> {
        vec![Vec2::new(0.0, 0.0), Vec2::new(20.0, 0.0), Vec2::new(20.0, 8.0), Vec2::new(0.0, 8.0)]
    }

    #[test]
    fn distances_inside_a_rectangle_are_exact() {
        let field = DistanceField::of_boundary(&rectangle());
        for (x, y) in [(1.23, 4.0), (10.0, 0.77), (10.05, 7.31), (19.51, 4.44), (10.0, 4.0)] {
            let expected = [x, y, 20.0 - x, 8.0 - y, CAP_M].into_iter().fold(f32::INFINITY, f32::min);
            let got = field.at(Vec2::new(x, y));
            assert!((got - expected).abs() < 1e-3, "({x}, {y}): {got} m, expected {expected} m");
        }
        assert!((field.at(Vec2::new(10.0, -0.55)) + 0.55).abs() < 1e-3);
        assert!(field.at(Vec2::new(-500.0, 4.0)) <= -CAP_M + 1e-3);
    }

    #[test]
    fn carved_shapes_are_exact_to_centimetres() {
        let mut field = DistanceField::of_boundary(&rectangle());
        let tilted = crate::geometry::rectangle(crate::geometry::Pose::new(Vec2::new(9.0, 4.0), 0.3), 4.0, 1.8);
        field.carve_polygon(&tilted);
        field.carve_disc(Vec2::new(15.0, 4.0), 0.25);
        for i in 0..4000 {
            let point = Vec2::new(5.0 + 12.0 * (i % 80) as f32 / 80.0, 1.0 + 6.0 * (i / 80) as f32 / 50.0);
            let polygon_m = edges(&tilted).map(|(a, b)| distance_to_segment(point, a, b)).fold(f32::INFINITY, f32::min);
            let polygon_m = if polygon_contains(&tilted, point) { -polygon_m } else { polygon_m };
            let disc_m = point.distance(Vec2::new(15.0, 4.0)) - 0.25;
            let wall_m = point.y.min(8.0 - point.y).min(20.0 - point.x).min(point.x);
            let expected_m = polygon_m.min(disc_m).min(wall_m).min(CAP_M);
            let tolerance_m = if expected_m.abs() < 0.25 { 0.03 } else { 0.05 };
            assert!((field.at(point) - expected_m).abs() < tolerance_m, "{point}: {} vs {expected_m}", field.at(point));
        }
    }

    #[test]
    fn the_lowest_value_in_a_box_is_a_tight_bound() {
        let mut field = DistanceField::of_boundary(&rectangle());
        field.carve_disc(Vec2::new(6.0, 4.0), 0.5);
        let mut gap_max_m = 0.0_f32;
        for i in 0..600 {
            let low = Vec2::new(0.6 * (i % 40) as f32 - 2.0, 0.7 * (i / 40) as f32 - 1.0)
                + Vec2::splat(0.0137 * i as f32 % 0.1);
            let size = Vec2::new(0.07 + 0.001 * (i % 500) as f32, 0.55 - 0.0008 * i as f32);
            let bound_m = field.lowest_within(low, low + size);
            let sample = |k: usize| field.at(low + size * Vec2::new((k % 60) as f32, (k / 60) as f32) / 59.0);
            let lowest_m = (0..60 * 60).map(sample).fold(f32::INFINITY, f32::min);
            assert!(bound_m <= lowest_m + 1e-5, "{low} {size}: {bound_m} m, but {lowest_m} m");
            gap_max_m = gap_max_m.max(lowest_m - bound_m);
        }
        assert!(gap_max_m < 0.03, "{gap_max_m} m");
        assert_eq!(field.lowest_within(Vec2::ZERO, Vec2::splat(1.0)), f32::NEG_INFINITY);
    }
}
