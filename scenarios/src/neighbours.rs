//! The cells around a cell of a raster that is stored row by row: where a search goes on from there.

use std::f32::consts::SQRT_2;

/// Columns and rows to each neighbour, and how far it is, in cells: first those that share an edge.
static STEPS: [(isize, isize, f32); 8] = [
    (1, 0, 1.0),
    (-1, 0, 1.0),
    (0, 1, 1.0),
    (0, -1, 1.0),
    (1, 1, SQRT_2),
    (1, -1, SQRT_2),
    (-1, 1, SQRT_2),
    (-1, -1, SQRT_2),
];
/// How many of them share an edge.
const BESIDE: usize = 4;

/// The cells that share an edge or a corner with one, and how far each is from it, in cells.
pub(crate) fn around(cell: usize, cols: usize, rows: usize) -> impl Iterator<Item = (usize, f32)> {
    within(&STEPS, cell, cols, rows)
}

/// The cells that share an edge with one.
pub(crate) fn beside(cell: usize, cols: usize, rows: usize) -> impl Iterator<Item = usize> {
    within(&STEPS[..BESIDE], cell, cols, rows).map(|(next, _)| next)
}

fn within(
    steps: &'static [(isize, isize, f32)],
    cell: usize,
    cols: usize,
    rows: usize,
) -> impl Iterator<Item = (usize, f32)> {
    let (col, row) = (cell % cols, cell / cols);
    steps.iter().filter_map(move |&(right, up, cells)| {
        let (col, row) = (col.checked_add_signed(right)?, row.checked_add_signed(up)?);
        (col < cols && row < rows).then_some((row * cols + col, cells))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_end_at_the_edges_of_the_raster() {
        // 6 7 8
        // 3 4 5
        // 0 1 2
        let all = |cell| around(cell, 3, 3).collect::<Vec<_>>();
        assert_eq!(all(0), [(1, 1.0), (3, 1.0), (4, SQRT_2)]);
        assert_eq!(all(5), [(4, 1.0), (8, 1.0), (2, 1.0), (7, SQRT_2), (1, SQRT_2)]);
        assert_eq!(all(4).len(), 8);
        assert_eq!(beside(4, 3, 3).collect::<Vec<_>>(), [5, 3, 7, 1]);
        assert_eq!(beside(8, 3, 3).collect::<Vec<_>>(), [7, 5]);
    }
}
