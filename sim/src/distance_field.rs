//! The drivable space as a raster of exact signed distances.
//!
//! Node values are distances to the exact polygons; between nodes they are interpolated bilinearly. That is exact
//! beside straight edges, within 3 cm beside corners, up to 5 cm too small half-way between two things, and up to 5 cm too large
//! within things thinner than 0.1 m: one of less may lie between two rows of nodes, and nothing shows that it is there.

use crate::geometry::{Vec2, bounds, edges};
use crate::maths;
use crate::vectors::{FourPoints, LANES, bounded, coordinate, counted_from, f32x4, indices, whole_and_part};
use std::ops::Range;

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
    maths::hypot(radius_m + to_node_m, std::f32::consts::FRAC_1_SQRT_2 * NODE_M) + ROUNDING_M
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

/// Polygons of more edges are carved by the edges near each node, which takes a raster of its own.
const FEW_EDGES: usize = 12;

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
const SPARE_NODES: usize = LANES;

impl DistanceField {
    /// Distances inside a boundary polygon: its outside is non-drivable.
    ///
    /// # Panics
    /// If the polygon is more than 3.2 km across.
    pub fn of_boundary(boundary: &[Vec2]) -> Self {
        Self::filled(bounds(boundary), 0).with_polygon(boundary)
    }

    /// Open ground: drivable wherever nothing is carved, also beyond the raster. What is carved must lie within a box.
    ///
    /// # Panics
    /// If the box is more than 3.2 km across.
    pub fn of_open_ground(low: Vec2, high: Vec2) -> Self {
        Self::filled((low, high), CAP_M.to_bits() ^ FAR_OUTSIDE)
    }

    /// The same everywhere: in a box, as far around it as things in it are near, and beyond.
    fn filled((low, high): (Vec2, Vec2), node: u32) -> Self {
        let margin = Vec2::splat(CAP_M + 2.0 * NODE_M);
        let origin = low - margin;
        let size = (high + margin - origin) / NODE_M;
        let (cols, rows) = (size.x.ceil() as usize + 1, size.y.ceil() as usize + 1);
        assert!(i16::try_from(cols.max(rows)).is_ok(), "a raster of {cols} x {rows} nodes takes gigabytes");
        Self { origin, cols, rows, nodes: vec![node; cols * rows + SPARE_NODES] }
    }

    /// A field that is far outside everywhere with the inside of a polygon.
    fn with_polygon(mut self, polygon: &[Vec2]) -> Self {
        self.fill(polygon);
        for (a, b) in edges(polygon) {
            self.bring_near(a, b);
        }
        self
    }

    /// Makes this a copy of another field, in the memory that it has.
    pub fn copy_from(&mut self, other: &Self) {
        (self.origin, self.cols, self.rows) = (other.origin, other.cols, other.rows);
        self.nodes.clone_from(&other.nodes);
    }

    /// Carves a non-drivable polygon (any winding, need not be convex).
    pub fn carve_polygon(&mut self, polygon: &[Vec2]) {
        if polygon.len() <= FEW_EDGES { self.carve_by_every_edge(polygon) } else { self.carve_by_near_edges(polygon) }
    }

    /// Each node from every edge.
    fn carve_by_every_edge(&mut self, polygon: &[Vec2]) {
        self.carve(bounds(polygon), |points, is_in_box| {
            let squared = edges(polygon).map(|(a, b)| points.squared_distance_to_segment(a, b));
            let distances_m = squared.fold(f32x4::splat(f32::INFINITY), f32x4::fast_min).sqrt();
            let are_inside = if is_in_box { points.are_inside(polygon) } else { f32x4::ZERO };
            are_inside.select(-distances_m, distances_m)
        });
    }

    /// Each node from the edges near it: the polygon's own field, turned inside out, on the same nodes. To the bit what
    /// [`Self::carve_by_every_edge`] carves.
    fn carve_by_near_edges(&mut self, polygon: &[Vec2]) {
        let island = Self { nodes: vec![0; self.nodes.len()], ..*self }.with_polygon(polygon);
        let (low, high) = bounds(polygon);
        for row in self.rows_within(low.y - CAP_M, high.y + CAP_M) {
            let cols = self.cols;
            self.for_each_four(row, low.x - CAP_M, high.x + CAP_M, |col, _, nodes_m| {
                Some(nodes_m.fast_min(-island.four_nodes_m(row * cols + col)))
            });
        }
    }

    /// Carves a non-drivable disc.
    pub fn carve_disc(&mut self, centre: Vec2, radius_m: f32) {
        let half = Vec2::splat(radius_m);
        self.carve((centre - half, centre + half), |points, _| {
            let FourPoints { x, y } = points - FourPoints::splat(centre);
            (x * x + y * y).sqrt() - f32x4::splat(radius_m)
        });
    }

    /// Signed distance at a world point, metres, capped at ±[`CAP_M`]; beyond the raster as at its rim: −[`CAP_M`], and
    /// [`CAP_M`] on open ground.
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
    #[expect(
        clippy::inline_always,
        reason = "called, it takes and returns vectors through memory: a tenth of the loop"
    )]
    #[inline(always)]
    pub fn at_four(&self, points: FourPoints) -> f32x4 {
        let node = self.nodes_from_world(points);
        let (cols, into_x) = whole_and_part(bounded(node.x, coordinate(self.cols - 2)));
        let (rows, into_y) = whole_and_part(bounded(node.y, coordinate(self.rows - 2)));
        let around = indices(rows, cols, self.n_cols()).map(|index| &self.nodes[index..index + self.cols + LANES]);
        let near = around.map(|nodes| as_lanes(nodes.first_chunk().expect("a row and four")));
        let far = around.map(|nodes| as_lanes(nodes.last_chunk().expect("a row and four")));
        let across = |stored: [f32x4; LANES]| {
            let [left_m, right_m, ..] = f32x4::transpose(stored).map(from_stored);
            left_m + into_x * (right_m - left_m)
        };
        let (near_m, far_m) = (across(near), across(far));
        near_m + into_y * (far_m - near_m)
    }

    /// [`Self::at_nearest_node`] at four points; half-way between two nodes it may choose the other one.
    #[inline]
    pub fn at_four_nearest_nodes(&self, points: FourPoints) -> f32x4 {
        let node = self.nodes_from_world(points) + FourPoints::splat(Vec2::splat(0.5));
        let (cols, _) = whole_and_part(bounded(node.x, coordinate(self.cols - 1)));
        let (rows, _) = whole_and_part(bounded(node.y, coordinate(self.rows - 1)));
        from_stored(as_lanes(&indices(rows, cols, self.n_cols()).map(|index| self.nodes[index])))
    }

    /// A lower bound of [`Self::at`] in a box of at most 0.6 m by 0.6 m, except for rounding. Minus infinity if the box
    /// is larger or at the very end of the raster.
    ///
    /// Between nodes the field is bilinear, so it is lowest on a grid of points: nodes inside the box, and where their
    /// rows and columns meet its sides.
    #[inline]
    pub fn lowest_within(&self, low: Vec2, high: Vec2) -> f32 {
        let node = self.nodes_from_world([low, high, low, high].into());
        let (cols, into_x) = whole_and_part(bounded(node.x, coordinate(self.cols - 2)));
        let (rows, into_y) = whole_and_part(bounded(node.y, coordinate(self.rows - 2)));
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
    fn n_cols(&self) -> i16 {
        self.cols as i16
    }

    #[inline]
    fn node_m(&self, index: usize) -> f32 {
        f32::from_bits(self.nodes[index] ^ FAR_OUTSIDE)
    }

    /// A node and the next three.
    #[inline]
    fn four_nodes_m(&self, index: usize) -> f32x4 {
        from_stored(as_lanes(self.nodes[index..index + LANES].first_chunk().expect("four")))
    }

    /// A node and the next seven; `None` at the very end of the raster.
    #[inline]
    fn eight_nodes_m(&self, index: usize) -> Option<[f32x4; 2]> {
        let nodes = self.nodes.get(index..index + 2 * LANES)?;
        let (first, second) = nodes.split_at(LANES);
        Some([first, second].map(|nodes| from_stored(as_lanes(nodes.first_chunk().expect("four")))))
    }

    /// Lower-left and upper-right corners of the raster, world metres.
    pub fn bounds(&self) -> (Vec2, Vec2) {
        (self.origin, self.origin + Vec2::new((self.cols - 1) as f32, (self.rows - 1) as f32) * NODE_M)
    }

    /// Memory of the raster, bytes. Of a lot that fills little of its bounding box, most of it is never touched.
    pub fn size_bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }

    /// Even-odd scan conversion: nodes inside the polygon are as far from its boundary as can be.
    fn fill(&mut self, polygon: &[Vec2]) {
        let mut crossings: Vec<(usize, f32)> = Vec::new();
        for (a, b) in edges(polygon) {
            for row in self.rows_within(a.y.min(b.y), a.y.max(b.y)) {
                let y = self.node_y(row);
                if (a.y > y) != (b.y > y) {
                    crossings.push((row, a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x)));
                }
            }
        }
        crossings.sort_by(|(row, x), (other_row, other_x)| row.cmp(other_row).then(x.total_cmp(other_x)));
        for &[(row, first), (_, end)] in crossings.as_chunks().0 {
            let [first, end] = [first, end].map(|x| self.first_col_from(x));
            self.nodes[row * self.cols + first..row * self.cols + end].fill(CAP_M.to_bits() ^ FAR_OUTSIDE);
        }
    }

    /// Brings the boundary near, on either side, to nodes within [`CAP_M`] of one of its edges.
    fn bring_near(&mut self, a: Vec2, b: Vec2) {
        let (low, high) = if a.y <= b.y { (a, b) } else { (b, a) };
        let along = high - low;
        // Across a strip of twice the cap, horizontally.
        let strip_m = CAP_M * along.length() / along.y;
        for row in self.rows_within(low.y - CAP_M, high.y + CAP_M) {
            let y = self.node_y(row);
            // The part of the edge that is level with the row, give or take the cap.
            let x_at =
                |y: f32| if along.y > 0.0 { low.x + along.x * ((y - low.y) / along.y).clamp(0.0, 1.0) } else { low.x };
            let (from, to) = if along.y > CAP_M { (x_at(y - CAP_M), x_at(y + CAP_M)) } else { (low.x, high.x) };
            let (mut left, mut right) = (from.min(to) - CAP_M, from.max(to) + CAP_M);
            if along.y > CAP_M {
                let x = low.x + along.x * ((y - low.y) / along.y);
                (left, right) = (left.max(x - strip_m), right.min(x + strip_m));
            }
            self.for_each_four(row, left, right, |_, points, nodes_m| {
                let distances_m = points.squared_distance_to_segment(a, b).sqrt();
                let sign = f32x4::splat(-0.0);
                Some((nodes_m & !sign).fast_min(distances_m) | (nodes_m & sign))
            });
        }
    }

    /// Lowers nodes to the signed distances from a thing within a box. `signed_distances_m` is also told whether any of the
    /// points lies in the box.
    fn carve(&mut self, (low, high): (Vec2, Vec2), signed_distances_m: impl Fn(FourPoints, bool) -> f32x4) {
        /// A generous bound of rounding in single precision, relative.
        const ROUNDING: f32 = 1.0 + 1e-4;
        for row in self.rows_within(low.y - CAP_M, high.y + CAP_M) {
            let y = self.node_y(row);
            let above_or_below_m = (low.y - y).max(y - high.y).max(0.0);
            self.for_each_four(row, low.x - CAP_M, high.x + CAP_M, |_, points, nodes_m| {
                let beside_m = (f32x4::splat(low.x) - points.x).fast_max(points.x - f32x4::splat(high.x));
                let beside_m = beside_m.fast_max(f32x4::ZERO);
                let to_box = beside_m * beside_m + f32x4::splat(above_or_below_m * above_or_below_m);
                // Most nodes are nearer to something else, or outside already.
                let is_in_box = to_box.simd_le(f32x4::ZERO).any();
                let is_nearer =
                    nodes_m.simd_gt(f32x4::ZERO) & (nodes_m * nodes_m * f32x4::splat(ROUNDING)).simd_gt(to_box);
                (is_in_box || is_nearer.any())
                    .then(|| nodes_m.fast_min(signed_distances_m(points, is_in_box).fast_max(f32x4::splat(-CAP_M))))
            });
        }
    }

    /// Replaces nodes of a row from one world x to another one, four at a time. `new_m` is given the column of the first,
    /// where they are, and what they hold.
    fn for_each_four(
        &mut self,
        row: usize,
        left: f32,
        right: f32,
        new_m: impl Fn(usize, FourPoints, f32x4) -> Option<f32x4>,
    ) {
        let col = |x: f32| ((x - self.origin.x) / NODE_M).max(0.0) as usize;
        let (first, end) = (col(left), (col(right) + 2).min(self.cols));
        let y = f32x4::splat(self.node_y(row));
        for col in (first..end).step_by(LANES) {
            // The last four of a row overlap those before.
            let col = col.min(self.cols - LANES);
            let index = row * self.cols + col;
            let x = f32x4::splat(self.origin.x) + counted_from(col) * f32x4::splat(NODE_M);
            if let Some(new_m) = new_m(col, FourPoints { x, y }, self.four_nodes_m(index)) {
                let stored = new_m.to_array().map(|node_m| node_m.to_bits() ^ FAR_OUTSIDE);
                self.nodes[index..index + LANES].copy_from_slice(&stored);
            }
        }
    }

    /// Rows from one world y to another one, and one more on either side.
    fn rows_within(&self, low: f32, high: f32) -> Range<usize> {
        let row = |y: f32| ((y - self.origin.y) / NODE_M).max(0.0) as usize;
        row(low).saturating_sub(1)..(row(high) + 2).min(self.rows)
    }

    fn node_y(&self, row: usize) -> f32 {
        self.origin.y + row as f32 * NODE_M
    }

    /// The first column at or beyond a world x.
    fn first_col_from(&self, x: f32) -> usize {
        let near = (((x - self.origin.x) / NODE_M).max(0.0) as usize).saturating_sub(1);
        (near..self.cols).find(|&col| self.origin.x + col as f32 * NODE_M >= x).unwrap_or(self.cols)
    }
}

/// Four nodes as they are stored, in a vector.
#[inline]
fn as_lanes(nodes: &[u32; LANES]) -> f32x4 {
    f32x4::from(nodes.map(f32::from_bits))
}

/// Distances of four nodes as they are stored.
#[inline]
fn from_stored(nodes: f32x4) -> f32x4 {
    nodes ^ f32x4::splat(-CAP_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pose, distance_to_segment_m, polygon_contains};

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
    fn open_ground_ends_nowhere() {
        let mut field = DistanceField::of_open_ground(Vec2::new(2.0, -4.0), Vec2::new(9.0, 4.0));
        field.carve_polygon(&[(2.0, -4.0), (9.0, -4.0), (9.0, -3.0), (2.0, -3.0)].map(Vec2::from));
        field.carve_disc(Vec2::new(8.0, 3.0), 1.0);
        for (x, y, expected_m) in [(5.0, -3.5, -0.5), (5.0, -2.0, 1.0), (11.0, 3.0, 2.0), (4.0, 0.5, CAP_M)] {
            let found_m = field.at(Vec2::new(x, y));
            assert!((found_m - expected_m).abs() < 0.02, "({x}, {y}): {found_m} m");
        }
        for (x, y) in [(12.5, 3.0), (80.0, 3.0), (5.0, -90.0), (-70.0, -3.5), (1e6, 1e6)] {
            let place = Vec2::new(x, y);
            assert_eq!([field.at(place), field.at_nearest_node(place)], [CAP_M; 2], "{place}");
            assert_eq!(field.at_four(FourPoints::splat(place)).to_array(), [CAP_M; 4], "{place}");
        }
    }

    /// Every node from every edge, one by one.
    fn plain_field(boundary: &[Vec2], islands: &[Vec<Vec2>], disc: (Vec2, f32)) -> DistanceField {
        let mut field = DistanceField::of_boundary(boundary);
        let to_edges_m = |polygon: &[Vec2], point: Vec2| {
            edges(polygon).map(|(a, b)| distance_to_segment_m(point, a, b)).fold(f32::INFINITY, f32::min)
        };
        for index in 0..field.rows * field.cols {
            let node = Vec2::new((index % field.cols) as f32, (index / field.cols) as f32);
            let point = field.origin + node * NODE_M;
            let sign = if polygon_contains(boundary, point) { 1.0 } else { -1.0 };
            let mut node_m = sign * to_edges_m(boundary, point).min(CAP_M);
            for island in islands {
                let sign = if polygon_contains(island, point) { -1.0 } else { 1.0 };
                node_m = node_m.min((sign * to_edges_m(island, point)).max(-CAP_M));
            }
            node_m = node_m.min((point.distance(disc.0) - disc.1).max(-CAP_M));
            field.nodes[index] = node_m.to_bits() ^ FAR_OUTSIDE;
        }
        field
    }

    #[test]
    fn a_field_of_what_is_near_is_the_field_of_everything() {
        // A lane with a bend and a notch, turned; a kerb, a long island, a disc.
        let lane =
            [(0.0, 0.0), (31.0, 0.0), (31.0, 24.0), (25.0, 24.0), (25.0, 6.5), (12.0, 6.5), (12.0, 5.0), (0.0, 7.0)];
        let islands = [
            vec![(4.0, 3.0), (9.0, 3.2), (6.0, 4.0)],
            vec![(27.0, 4.0), (28.0, 4.0), (28.0, 19.0), (27.5, 10.0), (27.0, 19.0)],
        ];
        for turned_rad in [0.0, 0.5, std::f32::consts::FRAC_PI_4, 1.9, 4.0] {
            let turned = Pose::new(Vec2::new(-7.3, 2.1), turned_rad).world_from_ego();
            let turn =
                |points: &[(f32, f32)]| points.iter().map(|&point| turned.point(point.into())).collect::<Vec<Vec2>>();
            let (boundary, islands) = (turn(&lane), islands.each_ref().map(|island| turn(island)));
            let disc = (turned.point(Vec2::new(16.0, 2.0)), 0.4);
            let mut field = DistanceField::of_boundary(&boundary);
            for island in &islands {
                field.carve_polygon(island);
            }
            field.carve_disc(disc.0, disc.1);
            let plain = plain_field(&boundary, &islands, disc);
            let different = (0..plain.nodes.len()).filter(|&index| field.nodes[index] != plain.nodes[index]).count();
            assert_eq!(different, 0, "of {} nodes, turned by {turned_rad}", plain.nodes.len());
        }
    }

    /// A star of many edges in a lot, by both ways of carving; at some turns nodes lie on its edges.
    #[test]
    fn an_island_of_many_edges_is_carved_to_the_bit_as_by_every_edge() {
        let star = |arms: usize, turned_rad: f32| -> Vec<Vec2> {
            let corner = |i: usize| {
                let radius_m = if i.is_multiple_of(2) { 9.0 } else { 6.3 };
                Vec2::new(14.0, 13.0)
                    + radius_m * maths::unit(turned_rad + i as f32 * std::f32::consts::PI / arms as f32)
            };
            (0..2 * arms).map(corner).collect()
        };
        let stairs: Vec<Vec2> = (0..10)
            .flat_map(|i| [(5 + i, 5 + i), (6 + i, 5 + i)])
            .chain([(16, 20), (5, 20)])
            .map(|(x, y)| Vec2::new(x as f32, y as f32))
            .collect();
        let lot = [(0.0, 0.0), (28.0, 0.0), (28.0, 26.0), (0.0, 26.0)].map(Vec2::from);
        for island in [star(8, 0.0), star(40, 0.3), star(7, 2.0), stairs] {
            let (mut near, mut every) = (DistanceField::of_boundary(&lot), DistanceField::of_boundary(&lot));
            for field in [&mut near, &mut every] {
                field.carve_disc(Vec2::new(4.0, 13.0), 1.5);
            }
            near.carve_by_near_edges(&island);
            every.carve_by_every_edge(&island);
            let different = (0..near.nodes.len()).filter(|&index| near.nodes[index] != every.nodes[index]).count();
            assert_eq!(different, 0, "of an island of {} edges", island.len());
            assert!(near.at(Vec2::new(14.0, 13.0)) <= -CAP_M || island.len() == 22);
        }
    }

    #[test]
    fn distances_at_four_points_are_those_at_each() {
        let mut field = DistanceField::of_boundary(&rectangle());
        field.carve_disc(Vec2::new(6.0, 4.0), 0.5);
        for i in 0..500 {
            // Some of them beyond the raster.
            let point = |k: usize| Vec2::new(-9.0 + 0.077 * (i + 11 * k) as f32, 17.0 - 0.051 * (i * (k + 1)) as f32);
            let points = std::array::from_fn(point);
            let distances_m = field.at_four(points.into()).to_array();
            let nearest_m = field.at_four_nearest_nodes(points.into()).to_array();
            for (k, &point) in points.iter().enumerate() {
                assert_eq!(distances_m[k].to_bits(), field.at(point).to_bits(), "at {point}");
                assert!((nearest_m[k] - field.at_nearest_node(point)).abs() <= 1.5 * NODE_M, "at {point}");
            }
        }
    }

    #[test]
    fn carved_shapes_are_exact_to_centimetres() {
        let mut field = DistanceField::of_boundary(&rectangle());
        let tilted = crate::geometry::rectangle(Pose::new(Vec2::new(9.0, 4.0), 0.3), 4.0, 1.8);
        field.carve_polygon(&tilted);
        field.carve_disc(Vec2::new(15.0, 4.0), 0.25);
        for i in 0..4000 {
            let point = Vec2::new(5.0 + 12.0 * (i % 80) as f32 / 80.0, 1.0 + 6.0 * (i / 80) as f32 / 50.0);
            let polygon_m =
                edges(&tilted).map(|(a, b)| distance_to_segment_m(point, a, b)).fold(f32::INFINITY, f32::min);
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
