//! What can be read off a grid at once for many places: how near something occupied is, and how far the way still goes.
//!
//! The second is a local goal for methods that follow a path where there is none. Like the grid planner of a navigation stack
//! it is a wavefront over passable cells, twice: away from the car, to see how far each cell is; and back from every cell that
//! the wave came to, the farther the cheaper, so that a pocket beside the way is worth no more than it is deep.

use crate::context::PlannerContext;
use sim::geometry::Vec2;
use sim::sensing::{GRID_CELLS, OccupancyGrid};
use sim::vectors::{FourPoints, f32x4};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Distances beyond this count as this, metres (*chosen*: more than any clearance that matters).
const DISTANCE_MAX_M: f32 = 3.0;
/// What a metre aside takes off how far a cell is (*chosen*: on open ground, where a corner of the patch is farther than the
/// middle of its far edge, straight ahead is the way).
const ASIDE: f32 = 0.5;
/// What a metre costs that the way does not go on (*chosen*: above 1, so that leaving a pocket is cheaper than staying).
const SHORT: f32 = 2.0;
/// Cells that the wave does not come to have this much farther to go than any that it comes to, metres (*chosen*).
const CUT_OFF_M: f32 = 2.0;

/// Distances and the way on, of the patch and of the unseen ground between it and the rear axle, which counts as free.
#[derive(Debug, Clone)]
pub(crate) struct WayField {
    rows: usize,
    cell_m: f32,
    /// Centre of the first cell: farthest and leftmost, ego frame.
    first: Vec2,
    /// Where waves start: the cell before the bumper.
    start: usize,
    /// Whether a cell is ground that the car covers or sees; waves do not go round beside it.
    is_known: Vec<bool>,
    /// Distance of a cell's centre to the disc inscribed in the nearest occupied cell, metres; negative inside.
    distance_m: Vec<f32>,
    /// How far the way still goes, metres, by cell; up to a constant.
    way_left_m: Vec<f32>,
    from_car_m: Vec<f32>,
    is_passable: Vec<bool>,
    cells_to_occupied: Vec<f32>,
    queue: BinaryHeap<(Reverse<u32>, u16)>,
}

impl WayField {
    pub(crate) fn new(context: &PlannerContext) -> Self {
        let geometry = &context.geometry;
        let cell_m = geometry.cell_m();
        let rows = GRID_CELLS + (geometry.near_edge_ahead_m / cell_m).ceil() as usize;
        let first = geometry.cell_in_ego(0, 0);
        let cells = rows * GRID_CELLS;
        let row_of_bumper = ((first.x - context.vehicle.front_m()) / cell_m).floor() as usize;
        let centre = |cell: usize| first - cell_m * Vec2::new((cell / GRID_CELLS) as f32, (cell % GRID_CELLS) as f32);
        let is_known =
            |cell: usize| cell / GRID_CELLS < GRID_CELLS || centre(cell).y.abs() <= 0.5 * context.vehicle.width_m;
        Self {
            rows,
            cell_m,
            first,
            start: row_of_bumper.min(rows - 1) * GRID_CELLS + GRID_CELLS / 2,
            is_known: (0..cells).map(is_known).collect(),
            distance_m: vec![DISTANCE_MAX_M; cells],
            way_left_m: vec![0.0; cells],
            from_car_m: vec![0.0; cells],
            is_passable: vec![true; cells],
            cells_to_occupied: vec![0.0; cells],
            queue: BinaryHeap::with_capacity(9 * cells),
        }
    }

    /// Reads a grid; waves keep to cells whose centre is no nearer than a distance to that of an occupied one, metres.
    /// Allocates nothing.
    pub(crate) fn read(&mut self, grid: &OccupancyGrid, passable_from_m: f32) {
        self.measure(grid);
        for cell in 0..self.distance_m.len() {
            // To the centre of the nearest occupied cell.
            let centre_m = self.distance_m[cell] + 0.5 * self.cell_m;
            self.is_passable[cell] = self.is_known[cell] && centre_m >= passable_from_m;
        }
        self.is_passable[self.start] = true;
        self.from_car_m.fill(f32::INFINITY);
        self.from_car_m[self.start] = 0.0;
        spread(&mut self.from_car_m, &self.is_passable, self.cell_m, &mut self.queue);

        let half = (GRID_CELLS / 2) as f32;
        let worth_m =
            |cell: usize, from_car_m: f32| from_car_m - ASIDE * ((cell % GRID_CELLS) as f32 - half).abs() * self.cell_m;
        let reached = |(cell, &from_car_m): (usize, &f32)| from_car_m.is_finite().then(|| worth_m(cell, from_car_m));
        let best_m = self.from_car_m.iter().enumerate().filter_map(reached).fold(0.0, f32::max);
        for (cell, (&from_car_m, way_left_m)) in self.from_car_m.iter().zip(&mut self.way_left_m).enumerate() {
            *way_left_m = SHORT * (best_m - worth_m(cell, from_car_m)).max(0.0);
            if from_car_m.is_infinite() {
                *way_left_m = f32::INFINITY;
            }
        }
        spread(&mut self.way_left_m, &self.is_passable, self.cell_m, &mut self.queue);
        let farthest_m = self.way_left_m.iter().copied().filter(|left_m| left_m.is_finite()).fold(0.0, f32::max);
        for left_m in &mut self.way_left_m {
            *left_m = left_m.min(farthest_m + CUT_OFF_M);
        }
    }

    /// Distances, exact between centres: first along columns, then across them.
    fn measure(&mut self, grid: &OccupancyGrid) {
        let (rows, far) = (self.rows, (self.rows + GRID_CELLS) as f32);
        let is_occupied = |row: usize, col: usize| row < GRID_CELLS && grid.is_occupied(row, col);
        for col in 0..GRID_CELLS {
            let mut steps = far;
            for row in 0..rows {
                steps = if is_occupied(row, col) { 0.0 } else { (steps + 1.0).min(far) };
                self.cells_to_occupied[row * GRID_CELLS + col] = steps;
            }
            for row in (0..rows).rev() {
                let nearest = &mut self.cells_to_occupied[row * GRID_CELLS + col];
                steps = (steps + 1.0).min(*nearest);
                *nearest = steps;
            }
        }
        for (cells, distances_m) in
            self.cells_to_occupied.chunks_exact(GRID_CELLS).zip(self.distance_m.chunks_exact_mut(GRID_CELLS))
        {
            for (col, distance_m) in distances_m.iter_mut().enumerate() {
                let squared = cells.iter().enumerate().map(|(other, along)| {
                    let across = other as f32 - col as f32;
                    across * across + along * along
                });
                let nearest_sq = squared.fold(f32::INFINITY, f32::min);
                *distance_m = (self.cell_m * (nearest_sq.sqrt() - 0.5)).min(DISTANCE_MAX_M);
            }
        }
    }

    /// Distances of four points to the disc inscribed in the nearest occupied cell, metres, bilinear between centres of cells:
    /// too large beside the corners of a cell, by up to 0.21 of its side.
    #[inline]
    pub(crate) fn distance_m(&self, in_ego: FourPoints) -> f32x4 {
        self.between(&self.distance_m, in_ego)
    }

    /// How far the way still goes from four points, metres; up to a constant.
    #[inline]
    pub(crate) fn way_left_m(&self, in_ego: FourPoints) -> f32x4 {
        self.between(&self.way_left_m, in_ego)
    }

    #[inline]
    fn between(&self, values: &[f32], in_ego: FourPoints) -> f32x4 {
        // The centre before each point, and how far it lies beyond it; the last centre belongs to the pair before it.
        let place = |first_m: f32, at_m: f32x4, cells: usize| {
            let (last, place) = ((cells - 1) as f32, (f32x4::splat(first_m) - at_m) / f32x4::splat(self.cell_m));
            let place = place.fast_max(f32x4::ZERO).fast_min(f32x4::splat(last));
            let before = f32x4::from_i32x4(place.fast_trunc_int()).fast_min(f32x4::splat(last - 1.0));
            (before, place - before)
        };
        let (above, down) = place(self.first.x, in_ego.x, self.rows);
        let (left, right) = place(self.first.y, in_ego.y, GRID_CELLS);
        let cells = (above * f32x4::splat(GRID_CELLS as f32) + left).fast_trunc_int().to_array();
        // From the first corner of each square to the last.
        let squares = cells.map(|cell| &values[cell as usize..][..GRID_CELLS + 2]);
        let corner = |offset: usize| f32x4::from(squares.map(|square| square[offset]));
        let across = |offset: usize| corner(offset) + right * (corner(offset + 1) - corner(offset));
        let (upper, lower) = (across(0), across(GRID_CELLS));
        upper + down * (lower - upper)
    }
}

/// Dijkstra's algorithm over passable cells and their eight neighbours, from what the costs are in the beginning.
fn spread(costs_m: &mut [f32], is_passable: &[bool], cell_m: f32, queue: &mut BinaryHeap<(Reverse<u32>, u16)>) {
    queue.clear();
    // The bits of numbers that are not negative are ordered as the numbers.
    let starts = costs_m.iter().enumerate().filter(|(_, cost_m)| cost_m.is_finite());
    queue.extend(starts.map(|(cell, cost_m)| (Reverse(cost_m.to_bits()), cell as u16)));
    let rows = costs_m.len() / GRID_CELLS;
    while let Some((Reverse(bits), cell)) = queue.pop() {
        let (cost_m, cell) = (f32::from_bits(bits), usize::from(cell));
        if cost_m > costs_m[cell] {
            continue;
        }
        let (row, col) = (cell / GRID_CELLS, cell % GRID_CELLS);
        for next_row in row.saturating_sub(1)..=(row + 1).min(rows - 1) {
            for next_col in col.saturating_sub(1)..=(col + 1).min(GRID_CELLS - 1) {
                let next = next_row * GRID_CELLS + next_col;
                let is_diagonal = next_row != row && next_col != col;
                let next_m = cost_m + cell_m * if is_diagonal { std::f32::consts::SQRT_2 } else { 1.0 };
                if is_passable[next] && next_m < costs_m[next] {
                    costs_m[next] = next_m;
                    queue.push((Reverse(next_m.to_bits()), next as u16));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{context, grid_with};

    #[test]
    fn distances_are_those_to_the_disc_in_the_nearest_cell() {
        let mut field = WayField::new(&context());
        // In cell (20, 12), X 6.22…6.70, |Y| ≤ 0.24, it has a radius of 0.24 m.
        field.read(&grid_with(&[(20, 12)]), 0.7);
        for (x_m, y_m, expected_m) in [(5.02, 0.0, 1.2), (6.46, 1.44, 1.2), (2.14, 0.0, 3.0), (6.46, 0.0, -0.24)] {
            let found_m = field.distance_m(FourPoints::splat(Vec2::new(x_m, y_m))).to_array()[0];
            assert!((found_m - expected_m).abs() < 0.02, "({x_m}, {y_m}): {found_m}");
        }
    }

    /// A lane with walls at |Y| > 3.12 that ends at X = 10.06 and turns to the left; a pocket opens on the right.
    #[test]
    fn the_way_goes_on_round_the_corner_and_not_into_the_pocket() {
        let mut open = [[false; GRID_CELLS]; GRID_CELLS];
        (13..25).for_each(|row| open[row][6..19].fill(true));
        (13..20).for_each(|row| open[row][..6].fill(true)); // the way on
        (18..22).for_each(|row| open[row][19..22].fill(true)); // the pocket
        let cells: Vec<u8> = open.iter().flatten().map(|open| u8::from(!open)).collect();
        let mut field = WayField::new(&context());
        field.read(&OccupancyGrid::from_cells(&cells), 0.7);
        let left_m = |x_m, y_m| field.way_left_m(FourPoints::splat(Vec2::new(x_m, y_m))).to_array()[0];
        let (here_m, corner_m, on_m) = (left_m(4.5, 0.0), left_m(8.2, 1.5), left_m(8.2, 5.0));
        assert!(on_m < corner_m && corner_m < here_m, "{here_m}, {corner_m}, {on_m}");
        assert!(left_m(6.5, -3.5) > left_m(6.5, 0.0), "the pocket");
        assert!(left_m(12.0, 0.0) > here_m, "cut off");
    }

    #[test]
    fn open_ground_is_crossed_straight_ahead() {
        let mut field = WayField::new(&context());
        field.read(&OccupancyGrid::free(), 0.7);
        let left_m = |y_m| field.way_left_m(FourPoints::splat(Vec2::new(11.0, y_m))).to_array()[0];
        assert!(left_m(0.0) < left_m(2.0) && left_m(0.0) < left_m(-2.0));
        assert!((left_m(3.0) - left_m(-3.0)).abs() < 1e-4);
    }
}
