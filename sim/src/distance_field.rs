//! The drivable space as a raster of exact signed distances.
//!
//! Node values are distances to the exact polygons; between nodes they are interpolated bilinearly. That is exact
//! beside straight edges, within 3 cm beside corners, and up to 5 cm too small half-way between two things.

use crate::geometry::{Vec2, distance_to_segment, edges, polygon_contains};

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
    /// A generous bound of rounding in single precision.
    const ROUNDING_M: f32 = 1e-4;
    let to_node_m = std::f32::consts::FRAC_1_SQRT_2 * NODE_M;
    (radius_m + to_node_m).hypot(std::f32::consts::FRAC_1_SQRT_2 * NODE_M) + ROUNDING_M
}

/// Signed distance to the non-drivable set, metres: positive in drivable space.
#[derive(Debug, Clone)]
pub struct DistanceField {
    origin: Vec2,
    cols: usize,
    rows: usize,
    values_m: Vec<f32>,
}

impl DistanceField {
    /// Distances inside a boundary polygon: its outside is non-drivable.
    pub fn of_boundary(boundary: &[Vec2]) -> Self {
        let margin = Vec2::splat(CAP_M + 2.0 * NODE_M);
        let (low, high) = bounds(boundary);
        let origin = low - margin;
        let size = (high + margin - origin) / NODE_M;
        let (cols, rows) = (size.x.ceil() as usize + 1, size.y.ceil() as usize + 1);
        let mut field = Self { origin, cols, rows, values_m: vec![CAP_M; cols * rows] };
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
            let &[left, right] = self.values_m[start..].first_chunk::<2>().expect("clamped to the raster");
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
        self.values_m[row as usize * self.cols + col as usize]
    }

    /// [`Self::at`] at the points (`xs[i]`, `ys[i]`), to the bit. All but the look-ups is done for several points at once.
    #[inline]
    pub fn at_each<const N: usize>(&self, xs: &[f32; N], ys: &[f32; N]) -> [f32; N] {
        let (last_x, last_y) = (count(self.cols - 2), count(self.rows - 2));
        let stride = self.cols as u32;
        let (mut nodes, mut fxs, mut fys) = ([0; N], [0.0; N], [0.0; N]);
        for i in 0..N {
            let x = clamp_to_raster((xs[i] - self.origin.x) * (1.0 / NODE_M), last_x);
            let y = clamp_to_raster((ys[i] - self.origin.y) * (1.0 / NODE_M), last_y);
            let (floor_x, floor_y) = (floor(x), floor(y));
            (fxs[i], fys[i]) = (x - floor_x, y - floor_y);
            nodes[i] = to_index(floor_y) * stride + to_index(floor_x);
        }
        // The four nodes around each point, near and far pair; one bounds check for both.
        let stride = stride as usize;
        let (mut near, mut far) = ([[0.0; 2]; N], [[0.0; 2]; N]);
        for i in 0..N {
            let base = nodes[i] as usize;
            let nodes_m = &self.values_m[base..base + stride + 2];
            near[i] = [nodes_m[0], nodes_m[1]];
            far[i] = [nodes_m[stride], nodes_m[stride + 1]];
        }
        std::array::from_fn(|i| {
            let [near, far] = [near[i], far[i]].map(|[left, right]| left + fxs[i] * (right - left));
            near + fys[i] * (far - near)
        })
    }

    /// [`Self::at_nearest_node`] at the points (`xs[i]`, `ys[i]`); half-way between two nodes it may choose the other one.
    /// All but the look-ups is done for several points at once.
    #[inline]
    pub fn at_nearest_nodes<const N: usize>(&self, xs: &[f32; N], ys: &[f32; N]) -> [f32; N] {
        let (last_x, last_y) = (count(self.cols - 1), count(self.rows - 1));
        let stride = self.cols as u32;
        let mut nodes = [0; N];
        for i in 0..N {
            let x = clamp_to_raster((xs[i] - self.origin.x) * (1.0 / NODE_M), last_x);
            let y = clamp_to_raster((ys[i] - self.origin.y) * (1.0 / NODE_M), last_y);
            nodes[i] = to_nearest_index(y) * stride + to_nearest_index(x);
        }
        std::array::from_fn(|i| self.values_m[nodes[i] as usize])
    }

    /// [`Self::at_nearest_nodes`] at the points `start` + (`xs[i]`, `ys[i]`): as many as there is room for in `values_m`, a
    /// multiple of 4 up to 32.
    // Not inlined: on its own and of unknown length, the first loop is compiled to instructions that take four points.
    #[inline(never)]
    pub fn at_many_nearest_nodes(&self, start: Vec2, xs: &[f32], ys: &[f32], values_m: &mut [f32]) {
        let (last_x, last_y) = (count(self.cols - 1), count(self.rows - 1));
        let stride = self.cols as u32;
        let mut nodes = [0; 32];
        for ((node, &x), &y) in nodes.iter_mut().zip(xs).zip(ys) {
            let x = clamp_to_raster((start.x + x - self.origin.x) * (1.0 / NODE_M), last_x);
            let y = clamp_to_raster((start.y + y - self.origin.y) * (1.0 / NODE_M), last_y);
            *node = to_nearest_index(y) * stride + to_nearest_index(x);
        }
        for (four_m, nodes) in values_m.as_chunks_mut::<4>().0.iter_mut().zip(nodes.as_chunks::<4>().0) {
            *four_m = nodes.map(|node| self.values_m[node as usize]);
        }
    }

    /// A lower bound of [`Self::at`] in a box of at most 0.6 m by 0.6 m, but for rounding. Minus infinity if the box is
    /// larger or at the very end of the raster.
    ///
    /// Between nodes the field is bilinear, so it is lowest on a grid of points: nodes inside the box, and where their
    /// rows and columns meet its sides.
    #[inline]
    pub fn lowest_within(&self, low: Vec2, high: Vec2) -> f32 {
        /// Nodes along one side of the largest box.
        const LANES: usize = 8;
        let last = Vec2::new(count(self.cols - 2), count(self.rows - 2));
        let node = |point: Vec2| {
            let node = (point - self.origin) * (1.0 / NODE_M);
            Vec2::new(clamp_to_raster(node.x, last.x), clamp_to_raster(node.y, last.y))
        };
        let (low, high) = (node(low), node(high));
        let [low_cell, high_cell] = [low, high].map(|node| Vec2::new(floor(node.x), floor(node.y)));
        let (into_low, into_high) = (low - low_cell, high - high_cell);
        let [(first_col, first_row), (last_col, last_row)] =
            [low_cell, high_cell].map(|cell| (to_index(cell.x) as usize, to_index(cell.y) as usize));
        let nodes_m = |row: usize| self.values_m[row * self.cols + first_col..].first_chunk::<LANES>();
        let around_sides = (nodes_m(first_row), nodes_m(first_row + 1), nodes_m(last_row), nodes_m(last_row + 1));
        let (Some(below_lower), Some(above_lower), Some(below_upper), Some(above_upper)) = around_sides else {
            return f32::NEG_INFINITY;
        };
        let mut lowest_m = mixed(below_lower, above_lower, into_low.y);
        lower_each(&mut lowest_m, &mixed(below_upper, above_upper, into_high.y));
        for row in first_row + 1..=last_row {
            let Some(nodes_m) = nodes_m(row) else { return f32::NEG_INFINITY };
            lower_each(&mut lowest_m, nodes_m);
        }
        // Of these, across: the two sides and what is between them.
        let n = last_col - first_col;
        let Some(&[.., left_m, right_m]) = lowest_m.get(..n + 2) else { return f32::NEG_INFINITY };
        let first_m = lowest_m[0] + into_low.x * (lowest_m[1] - lowest_m[0]);
        let last_m = left_m + into_high.x * (right_m - left_m);
        let sides_m = if first_m < last_m { first_m } else { last_m };
        lowest_m[1..=n].iter().fold(sides_m, |low, &value| if value < low { value } else { low })
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
                let value = &mut self.values_m[row * self.cols + col];
                *value = value.min(distance_m(point).max(-CAP_M));
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
                    self.values_m[row * self.cols + col] *= -1.0;
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

/// Each value moved by a share of the way to the other one.
#[inline]
fn mixed<const N: usize>(values: &[f32; N], others: &[f32; N], share: f32) -> [f32; N] {
    std::array::from_fn(|i| values[i] + share * (others[i] - values[i]))
}

/// Lowers each value to the other one.
#[inline]
fn lower_each<const N: usize>(values: &mut [f32; N], others: &[f32; N]) {
    for (value, &other) in values.iter_mut().zip(others) {
        *value = if other < *value { other } else { *value };
    }
}

/// Bounds a coordinate to the raster, like `clamp`; what is not a number becomes 0.
#[inline]
pub(crate) fn clamp_to_raster(node: f32, last: f32) -> f32 {
    let node = if node > 0.0 { node } else { 0.0 };
    if node < last { node } else { last }
}

/// From here on, single precision holds whole numbers only.
const WHOLE_FROM: f32 = (1 << 23) as f32;

/// Largest whole number at or below a coordinate of the raster. Unlike casts and `f32::floor`, which is a library call
/// on baseline x86-64, this compiles to instructions that take four numbers at once.
#[inline]
pub(crate) fn floor(node: f32) -> f32 {
    let rounded = (node + WHOLE_FROM) - WHOLE_FROM;
    rounded - if rounded > node { 1.0 } else { 0.0 }
}

/// A whole coordinate of the raster as an index.
#[inline]
pub(crate) fn to_index(whole: f32) -> u32 {
    to_nearest_index(whole)
}

/// The index nearest to a coordinate of the raster, the even one half-way between two: adding rounds.
#[inline]
fn to_nearest_index(node: f32) -> u32 {
    (node + WHOLE_FROM).to_bits() - WHOLE_FROM.to_bits()
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
