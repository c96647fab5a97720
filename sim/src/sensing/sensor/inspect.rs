//! Which noise layer caused which error. Computed on demand, so driving does not pay for it.

use super::{EgoView, Sensor};
use crate::geometry::Pose;
use crate::map::Map;
use crate::sensing::noise::Layer;
use crate::sensing::noise::patch::Reads;
use crate::sensing::{BEV_PIXELS, BirdsEyeView, CELL_PIXELS, GRID_CELLS, Observation, OccupancyGrid};

/// One observation, explained pixel by pixel and cell by cell: row 0 = far, column 0 = left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Inspection {
    /// The view of a faultless segmentation.
    pub clean: BirdsEyeView,
    /// The view as perceived at this tick; not what was shown if the frame was dropped.
    pub perceived: BirdsEyeView,
    /// The grid of a faultless segmentation.
    pub clean_grid: OccupancyGrid,
    /// The grid that was shown to the driver.
    pub shown_grid: OccupancyGrid,
    pixels: Vec<Option<Layer>>,
    cells: Vec<Option<Layer>>,
}

impl Inspection {
    /// What made a pixel (of 200×200) wrong; `None` if it is right.
    pub fn pixel(&self, row: usize, col: usize) -> Option<Layer> {
        self.pixels[row * BEV_PIXELS + col]
    }

    /// What made a cell (of 25×25) of the shown grid wrong; `None` if it is right. Where several layers did, the one
    /// with most pixels.
    pub fn cell(&self, row: usize, col: usize) -> Option<Layer> {
        self.cells[row * GRID_CELLS + col]
    }

    /// Wrong pixels of a layer.
    pub fn count_pixels(&self, layer: Layer) -> usize {
        self.pixels.iter().filter(|&&pixel| pixel == Some(layer)).count()
    }

    /// Wrong cells of a layer.
    pub fn count_cells(&self, layer: Layer) -> usize {
        self.cells.iter().filter(|&&cell| cell == Some(layer)).count()
    }

    /// What most of the wrong pixels of a cell have in common.
    fn layer_of_cell(&self, row: usize, col: usize) -> Option<Layer> {
        let pixels = |layer: Layer| {
            let of_cell = (0..CELL_PIXELS * CELL_PIXELS)
                .map(|i| self.pixel(row * CELL_PIXELS + i / CELL_PIXELS, col * CELL_PIXELS + i % CELL_PIXELS));
            of_cell.filter(|&pixel| pixel == Some(layer)).count()
        };
        // The first of equals, in the order of the layers.
        let most = Layer::ALL.into_iter().rev().max_by_key(|&layer| pixels(layer))?;
        (pixels(most) > 0).then_some(most)
    }
}

impl Sensor {
    /// Explains what was shown from a pose at a tick: `shown` is the answer of [`Sensor::observe`]. Any sensor with the
    /// same seed explains it, also later. Takes some milliseconds.
    ///
    /// Ground hidden behind tall objects is not an error: it is occupied in the clean view too.
    pub fn inspect(&self, map: &Map, pose: Pose, tick: u32, shown: &Observation) -> Inspection {
        let (clean, perceived) = (self.clean_view(map, pose), self.perceived_view(map, pose, tick));
        let claims = self.claims(pose, tick);
        let pixel = |i: usize| {
            let (row, col) = (i / BEV_PIXELS, i % BEV_PIXELS);
            let (is_occupied, was_occupied) = (perceived.is_occupied(row, col), clean.is_occupied(row, col));
            let claim = if is_occupied { claims.occupied[i] } else { claims.free[i] };
            // What no patch claims, a shifted boundary did.
            (is_occupied != was_occupied).then(|| claim.unwrap_or(Layer::Boundary))
        };
        let mut inspection = Inspection {
            pixels: (0..BEV_PIXELS * BEV_PIXELS).map(pixel).collect(),
            cells: Vec::new(),
            clean_grid: clean.to_grid(),
            shown_grid: shown.grid,
            clean,
            perceived,
        };
        let is_dropped = self.noise.drops_frame(tick) && inspection.perceived.to_grid() != shown.grid;
        let cell = |i: usize| {
            let (row, col) = (i / GRID_CELLS, i % GRID_CELLS);
            let is_wrong = inspection.shown_grid.is_occupied(row, col) != inspection.clean_grid.is_occupied(row, col);
            let layer = || if is_dropped { Some(Layer::Dropout) } else { inspection.layer_of_cell(row, col) };
            is_wrong.then(layer).flatten()
        };
        inspection.cells = (0..GRID_CELLS * GRID_CELLS).map(cell).collect();
        inspection
    }

    /// What the visible patches say about every pixel.
    fn claims(&self, pose: Pose, tick: u32) -> Claims {
        let geometry = &self.settings.geometry;
        let ego = EgoView::new(geometry, pose);
        let mut claims =
            Claims { occupied: vec![None; BEV_PIXELS * BEV_PIXELS], free: vec![None; BEV_PIXELS * BEV_PIXELS] };
        for (reads, into) in [(Reads::Occupied, &mut claims.occupied), (Reads::Free, &mut claims.free)] {
            for patch in self.visible_patches(&ego, tick, reads) {
                ego.polygon(&patch.region).for_each_row(geometry, |row, first, last| {
                    into[row * BEV_PIXELS + first..=row * BEV_PIXELS + last].fill(Some(patch.layer));
                });
            }
        }
        if let Some(flicker) = self.flicker(tick) {
            flicker.for_each_row(geometry, |row, first, last| {
                claims.occupied[row * BEV_PIXELS + first..=row * BEV_PIXELS + last].fill(Some(Layer::Flicker));
            });
        }
        self.for_each_shadow(&ego, tick, |polygon, shadow, threshold| {
            polygon.for_each_row(geometry, |row, first, last| {
                for col in first..=last {
                    if shadow.is_misread(ego.lattice.point(row as f32, col as f32), threshold) {
                        claims.occupied[row * BEV_PIXELS + col] = Some(Layer::Shadow);
                    }
                }
            });
        });
        claims
    }
}

/// Per pixel the layer that reads it as occupied, and the one that reads it as free.
struct Claims {
    occupied: Vec<Option<Layer>>,
    free: Vec<Option<Layer>>,
}
