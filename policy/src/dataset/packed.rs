//! Grids as numpy's `packbits` stores them: a bit per cell, row by row, the first cell in the highest bit of the first
//! byte. Bits beyond the last cell are 0.

use ndarray::{Array, Array2, Dimension};
use sim::sensing::{GRID_CELLS, OccupancyGrid};

const CELLS: usize = GRID_CELLS * GRID_CELLS;
/// Bytes of a grid.
pub(crate) const GRID_BYTES: usize = CELLS.div_ceil(8);

/// `[n, GRID_BYTES]`: the bits of n grids.
pub(crate) fn pack<'a>(grids: impl ExactSizeIterator<Item = &'a OccupancyGrid>) -> Array2<u8> {
    let mut packed = Array2::zeros([grids.len(), GRID_BYTES]);
    for (mut bytes, grid) in packed.outer_iter_mut().zip(grids) {
        for (index, cell) in grid.cells().enumerate() {
            bytes[index / 8] |= cell << (7 - index % 8);
        }
    }
    packed
}

/// The grids of an array `[…, GRID_BYTES]`, in order.
///
/// # Panics
/// If the last axis is not as long as a grid.
pub(crate) fn unpack<D: Dimension>(packed: Array<u8, D>) -> impl Iterator<Item = OccupancyGrid> {
    assert_eq!(packed.shape().last(), Some(&GRID_BYTES), "bytes of a grid");
    let mut bytes = packed.into_iter();
    std::iter::from_fn(move || {
        let bytes: Vec<u8> = bytes.by_ref().take(GRID_BYTES).collect();
        let cell = |index: usize| bytes[index / 8] >> (7 - index % 8) & 1;
        (!bytes.is_empty()).then(|| OccupancyGrid::from_cells(&(0..CELLS).map(cell).collect::<Vec<_>>()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::round;

    #[test]
    fn the_first_cells_lie_in_the_highest_bits() {
        let mut grid = OccupancyGrid::free();
        grid.set_occupied(0, 0);
        grid.set_occupied(0, 9);
        grid.set_occupied(24, 24);
        let mut expected = [0_u8; GRID_BYTES];
        (expected[0], expected[1], expected[78]) = (0b1000_0000, 0b0100_0000, 0b1000_0000);
        assert_eq!(pack([grid].iter()).as_slice().unwrap(), expected);
    }

    #[test]
    fn grids_are_unpacked_as_they_were_packed() {
        let mut grids: Vec<OccupancyGrid> = round(7).samples.iter().map(|sample| sample.grid).collect();
        grids.extend([OccupancyGrid::free(), OccupancyGrid::occupied()]);
        assert_eq!(unpack(pack(grids.iter())).collect::<Vec<_>>(), grids);
        assert_eq!(unpack(pack([].iter())).count(), 0);
    }
}
