//! Distances on the grid.

use sim::geometry::Vec2;
use sim::sensing::{GRID_CELLS, GridGeometry, OccupancyGrid};

/// The nearest occupied cell as seen from a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Nearest {
    /// Distance from the point to the square of the cell, metres; 0 inside.
    pub(crate) distance_m: f32,
    /// Unit vector from the cell to the point: the gradient of the distance. Between two cells equally near it is their
    /// mean, so that opposite sides cancel; zero inside a cell.
    pub(crate) away: Vec2,
}

/// The nearest occupied cell within `range_m` of an ego point. Exact: in each row only the first occupied cell on either
/// side can be nearest.
pub(crate) fn nearest_occupied(
    grid: &OccupancyGrid,
    geometry: &GridGeometry,
    point: Vec2,
    range_m: f32,
) -> Option<Nearest> {
    let (cell_m, half_m) = (geometry.cell_m(), 0.5 * geometry.side_m);
    let cells_from_far = (geometry.far_edge_ahead_m() - point.x) / cell_m;
    let reach = range_m / cell_m;
    let first = (cells_from_far - reach).floor().max(0.0) as usize;
    let last = ((cells_from_far + reach).floor() as isize).min(GRID_CELLS as isize - 1);
    let col = (((half_m - point.y) / cell_m).floor() as isize).clamp(0, GRID_CELLS as isize - 1) as u32;
    let up_to_col = u32::MAX >> (31 - col);
    let mut nearest_sq = range_m * range_m;
    let (mut away, mut ties) = (Vec2::ZERO, 0.0);
    for row in first..usize::try_from(last + 1).unwrap_or(0) {
        let cells = grid.row(row);
        let near_edge_m = geometry.near_edge_ahead_m + (GRID_CELLS - 1 - row) as f32 * cell_m;
        let ahead_m = point.x - point.x.clamp(near_edge_m, near_edge_m + cell_m);
        let on_left = cells & up_to_col;
        let on_right = cells & !(up_to_col >> 1);
        let left_col = on_left.checked_ilog2();
        let right_col = (on_right != 0).then(|| on_right.trailing_zeros()).filter(|&right| Some(right) != left_col);
        for col in [left_col, right_col].into_iter().flatten() {
            let left_edge_m = (0.5 * GRID_CELLS as f32 - col as f32) * cell_m;
            let right_edge_m = (0.5 * GRID_CELLS as f32 - 1.0 - col as f32) * cell_m;
            let offset = Vec2::new(ahead_m, point.y - point.y.clamp(right_edge_m, left_edge_m));
            let distance_sq = offset.length_squared();
            if distance_sq > nearest_sq * (1.0 + 1e-5) {
                continue;
            }
            if distance_sq < nearest_sq * (1.0 - 1e-5) {
                (away, ties) = (Vec2::ZERO, 0.0);
            }
            nearest_sq = distance_sq.min(nearest_sq);
            away += offset.normalize_or_zero();
            ties += 1.0;
        }
    }
    (ties > 0.0).then(|| Nearest { distance_m: nearest_sq.sqrt(), away: away / ties })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::grid_with;

    #[test]
    fn distances_to_occupied_cells_are_exact() {
        let geometry = GridGeometry::paper();
        let nearest = |cells: &[(usize, usize)], x, y, range_m| {
            nearest_occupied(&grid_with(cells), &geometry, Vec2::new(x, y), range_m)
        };
        // Cell (24, 12) is the square X 4.30…4.78, |Y| ≤ 0.24.
        let ahead = nearest(&[(24, 12)], 3.8, 0.0, 2.0).unwrap();
        assert!((ahead.distance_m - 0.5).abs() < 1e-5 && ahead.away.distance(-Vec2::X) < 1e-5, "{ahead:?}");
        let beside = nearest(&[(24, 12)], 4.5, 1.24, 2.0).unwrap();
        assert!((beside.distance_m - 1.0).abs() < 1e-5 && beside.away.distance(Vec2::Y) < 1e-5, "{beside:?}");
        let corner = nearest(&[(24, 12)], 4.0, 0.64, 2.0).unwrap(); // 3-4-5
        assert!(
            (corner.distance_m - 0.5).abs() < 1e-5 && corner.away.distance(Vec2::new(-0.6, 0.8)) < 1e-4,
            "{corner:?}"
        );
        assert_eq!(nearest(&[(24, 12)], 3.8, 0.0, 0.49), None);
        assert_eq!(nearest(&[(24, 12)], 4.5, 0.0, 1.0).unwrap().distance_m, 0.0);
        // Midway between two cells they cancel.
        let between = nearest(&[(20, 10), (20, 14)], 6.46, 0.0, 2.0).unwrap();
        assert!((between.distance_m - 0.72).abs() < 1e-5 && between.away.length() < 1e-6, "{between:?}");
    }
}
