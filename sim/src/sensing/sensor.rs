//! The sensor of one episode: clean view → smear → noise → grid.

mod inspect;

pub use inspect::Inspection;

use super::noise::{NoiseConfig, NoiseField, Patch, Reads, Region, Shadow};
use super::quadtree::{PixelLattice, ROW_LANES, to_corner_m};
use super::smear::{ConvexInEgo, hidden_ground};
use super::{BEV_PIXELS, BirdsEyeView, CELL_PIXELS, GRID_CELLS, GridGeometry, Observation, OccupancyGrid};
use crate::distance_field::change_max_m;
use crate::geometry::{Pose, Vec2, WorldFromEgo};
use crate::map::Map;
use crate::seed::RootSeed;
use serde::{Deserialize, Serialize};

/// Settings of the sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensingConfig {
    /// Where the patch lies.
    pub geometry: GridGeometry,
    /// Whether tall things hide the ground behind them (methods.md 1.7).
    pub smear: bool,
    /// Camera ahead of the rear axle, metres (methods.md 9.2).
    pub camera_ahead_m: f32,
    /// Camera above ground, metres.
    pub camera_height_m: f32,
}

impl SensingConfig {
    /// The paper's camera, smear on.
    pub fn paper() -> Self {
        Self { geometry: GridGeometry::paper(), smear: true, camera_ahead_m: 1.59, camera_height_m: 1.55 }
    }
}

/// The sensor of one episode.
#[derive(Debug, Clone)]
pub struct Sensor {
    config: SensingConfig,
    noise: NoiseField,
    last: Option<Observation>,
}

impl Sensor {
    /// A sensor whose noise is drawn from `seed`.
    pub fn new(map: &Map, config: SensingConfig, noise: &NoiseConfig, seed: RootSeed) -> Self {
        let cell_radius_m = to_corner_m(config.geometry.pixel_m(), CELL_PIXELS);
        Self { config, noise: NoiseField::new(map, noise, seed, cell_radius_m), last: None }
    }

    /// What the car perceives from a pose at a tick.
    pub fn observe(&mut self, map: &Map, pose: Pose, tick: u32) -> Observation {
        let observation = match self.last {
            Some(last) if self.noise.drops_frame(tick) => last,
            _ => Observation { grid: self.perceive_grid(map, pose, tick) },
        };
        self.last = Some(observation);
        observation
    }

    /// The perceived grid, without ever computing all 40 000 pixels.
    fn perceive_grid(&self, map: &Map, pose: Pose, tick: u32) -> OccupancyGrid {
        let geometry = &self.config.geometry;
        let ego = EgoView::new(geometry, pose);
        let openings = self.openings(&ego, tick);
        let mut shift = self.noise.boundary_shift(ego.patch_centre, ego.patch_radius_m, tick);
        let within_cell_m = change_max_m(to_corner_m(geometry.pixel_m(), CELL_PIXELS));
        let mut grid = OccupancyGrid::free();
        for row in 0..GRID_CELLS {
            let ahead_of_patch_m = geometry.cell_in_ego(row, 0).x - geometry.near_edge_ahead_m;
            let centres_m = ego.lattice.nearest_nodes_of_row(map.distance_field(), row);
            // A cell whose centre is this far from a boundary is decided without looking at the noise.
            let sure_m = self.noise.boundary_shift_max_m(ahead_of_patch_m) + within_cell_m;
            let may_be_occupied = bits_where(&centres_m, |centre_m| centre_m <= sure_m);
            let opened = openings.as_ref().map_or(0, |opened| opened.touched_cells(row)) & may_be_occupied;
            let mut occupied = bits_where(&centres_m, |centre_m| centre_m < -sure_m) & !opened;
            for col in bits(may_be_occupied & !occupied) {
                let threshold_m = -shift.at(ego.lattice.cell_centre(row, col), ahead_of_patch_m);
                let is_occupied = match &openings {
                    Some(openings) if opened >> col & 1 == 1 => {
                        any_closed_pixel_below(map, &ego, openings, row, col, threshold_m)
                    }
                    _ => ego.lattice.any_below(map.distance_field(), row, col, centres_m[col], threshold_m),
                };
                occupied |= u32::from(is_occupied) << col;
            }
            grid.occupy_row(row, occupied);
        }
        for polygon in self.covers(map, &ego, tick) {
            polygon.occupy(geometry, &mut grid);
        }
        self.for_each_shadow(&ego, tick, |polygon, shadow, threshold| {
            // Cells of which no pixel can be misread.
            let mut is_read = OccupancyGrid::free();
            polygon.for_each_row(geometry, |row, first, last| {
                let cell_row = row / CELL_PIXELS;
                for cell_col in first / CELL_PIXELS..=last / CELL_PIXELS {
                    if grid.is_occupied(cell_row, cell_col) || is_read.is_occupied(cell_row, cell_col) {
                        continue;
                    }
                    match shadow.are_misread_around(ego.lattice.cell_centre(cell_row, cell_col), threshold) {
                        Some(true) => grid.set_occupied(cell_row, cell_col),
                        Some(false) => is_read.set_occupied(cell_row, cell_col),
                        None => {
                            let (cell_first, cell_last) = (cell_col * CELL_PIXELS, (cell_col + 1) * CELL_PIXELS - 1);
                            let mut cols = first.max(cell_first)..=last.min(cell_last);
                            let is_misread =
                                |col: usize| shadow.is_misread(ego.lattice.point(row as f32, col as f32), threshold);
                            if cols.any(is_misread) {
                                grid.set_occupied(cell_row, cell_col);
                            }
                        }
                    }
                }
            });
        });
        grid
    }

    /// The perceived view in full resolution, by brute force. Its max-pool is the grid of [`Self::observe`], dropped
    /// frames excepted.
    pub fn perceived_view(&self, map: &Map, pose: Pose, tick: u32) -> BirdsEyeView {
        let geometry = &self.config.geometry;
        let ego = EgoView::new(geometry, pose);
        let openings = self.openings(&ego, tick).unwrap_or_else(PixelRows::empty);
        let mut covered = PixelRows::empty();
        for polygon in self.covers(map, &ego, tick) {
            polygon.for_each_row(geometry, |row, first, last| covered.set(row, first, last));
        }
        self.for_each_shadow(&ego, tick, |polygon, shadow, threshold| {
            polygon.for_each_row(geometry, |row, first, last| {
                for col in first..=last {
                    if shadow.is_misread(ego.lattice.point(row as f32, col as f32), threshold) {
                        covered.set(row, col, col);
                    }
                }
            });
        });
        let mut shift = self.noise.boundary_shift(ego.patch_centre, ego.patch_radius_m, tick);
        let shifts_m: Vec<f32> = (0..GRID_CELLS * GRID_CELLS)
            .map(|cell| {
                let (row, col) = (cell / GRID_CELLS, cell % GRID_CELLS);
                let ahead_of_patch_m = geometry.cell_in_ego(row, 0).x - geometry.near_edge_ahead_m;
                shift.at(ego.lattice.cell_centre(row, col), ahead_of_patch_m)
            })
            .collect();
        BirdsEyeView::from_fn(|row, col| {
            let shift_m = shifts_m[row / CELL_PIXELS * GRID_CELLS + col / CELL_PIXELS];
            let is_beyond = map.signed_distance_m(ego.lattice.point(row as f32, col as f32)) <= -shift_m;
            (is_beyond && !openings.get(row, col)) || covered.get(row, col)
        })
    }

    /// The view a faultless segmentation would give: smear is geometry, not an error.
    pub fn clean_view(&self, map: &Map, pose: Pose) -> BirdsEyeView {
        let ego = EgoView::new(&self.config.geometry, pose);
        let mut hidden = PixelRows::empty();
        for polygon in self.hidden_ground(map, &ego) {
            polygon.for_each_row(&self.config.geometry, |row, first, last| hidden.set(row, first, last));
        }
        BirdsEyeView::from_fn(|row, col| {
            map.signed_distance_m(ego.lattice.point(row as f32, col as f32)) <= 0.0 || hidden.get(row, col)
        })
    }

    /// Everything that is laid over the view as occupied: hidden ground, misread patches, flicker.
    fn covers<'a>(&'a self, map: &'a Map, ego: &'a EgoView, tick: u32) -> impl Iterator<Item = ConvexInEgo> + 'a {
        self.hidden_ground(map, ego).chain(self.patches(ego, tick, Reads::Occupied)).chain(self.flicker(tick))
    }

    fn flicker(&self, tick: u32) -> Option<ConvexInEgo> {
        let geometry = &self.config.geometry;
        let (centre, side_m) = self.noise.flicker(tick, geometry.near_edge_ahead_m, geometry.side_m)?;
        Some(ConvexInEgo::new(crate::geometry::rectangle(Pose::new(centre, 0.0), side_m, side_m)))
    }

    fn hidden_ground<'a>(&'a self, map: &'a Map, ego: &'a EgoView) -> impl Iterator<Item = ConvexInEgo> + 'a {
        let occluders = if self.config.smear { map.occluders() } else { &[] };
        occluders.iter().filter(|occluder| ego.may_see(occluder.centre, occluder.radius_m)).filter_map(|occluder| {
            let mut outline = [Vec2::ZERO; 8];
            for (in_ego, &corner) in outline.iter_mut().zip(&occluder.outline) {
                *in_ego = ego.world_from_ego.inverse_point(corner);
            }
            let outline = &outline[..occluder.outline.len()];
            hidden_ground(outline, occluder.height_m, self.config.camera_ahead_m, self.config.camera_height_m)
        })
    }

    fn patches<'a>(&'a self, ego: &'a EgoView, tick: u32, reads: Reads) -> impl Iterator<Item = ConvexInEgo> + 'a {
        let visible = self.visible_patches(ego, tick).filter(move |patch| patch.reads == reads);
        visible.map(|patch| ego.polygon(&patch.region))
    }

    fn visible_patches<'a>(&'a self, ego: &'a EgoView, tick: u32) -> impl Iterator<Item = &'a Patch> + 'a {
        let is_visible =
            move |patch: &&Patch| ego.may_see(patch.region.centre, patch.region.radius_m) && patch.is_alive(tick);
        self.noise.patches.iter().filter(is_visible)
    }

    /// Ground that is taken for road although it is not; `None` if there is none in sight.
    fn openings(&self, ego: &EgoView, tick: u32) -> Option<PixelRows> {
        let mut openings = None;
        for polygon in self.patches(ego, tick, Reads::Free) {
            let rows: &mut PixelRows = openings.get_or_insert_with(PixelRows::empty);
            polygon.for_each_row(&self.config.geometry, |row, first, last| rows.set(row, first, last));
        }
        openings
    }

    fn for_each_shadow(&self, ego: &EgoView, tick: u32, mut visit: impl FnMut(&ConvexInEgo, &Shadow, u8)) {
        for (index, shadow) in self.noise.shadows.iter().enumerate() {
            if ego.may_see(shadow.region.centre, shadow.region.radius_m) {
                visit(&ego.polygon(&shadow.region), shadow, self.noise.shadow_threshold(index, tick));
            }
        }
    }
}

/// The cells of a row of which something holds, bit = column.
#[inline]
fn bits_where(values: &[f32; ROW_LANES], is_so: impl Fn(f32) -> bool) -> u32 {
    let bits = values.iter().enumerate().fold(0, |bits, (col, &value)| bits | u32::from(is_so(value)) << col);
    bits & OccupancyGrid::ROW_MASK
}

/// Indices of the set bits, lowest first.
fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then(|| mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        bit
    })
}

/// Whether a cell keeps a pixel beyond the boundary although parts of it are opened.
fn any_closed_pixel_below(
    map: &Map,
    ego: &EgoView,
    opened: &PixelRows,
    row: usize,
    col: usize,
    threshold_m: f32,
) -> bool {
    (0..CELL_PIXELS * CELL_PIXELS).any(|i| {
        let (row, col) = (row * CELL_PIXELS + i / CELL_PIXELS, col * CELL_PIXELS + i % CELL_PIXELS);
        !opened.get(row, col) && map.signed_distance_m(ego.lattice.point(row as f32, col as f32)) <= threshold_m
    })
}

/// One pose, prepared for sensing.
struct EgoView {
    world_from_ego: WorldFromEgo,
    lattice: PixelLattice,
    patch_centre: Vec2,
    patch_radius_m: f32,
}

impl EgoView {
    fn new(geometry: &GridGeometry, pose: Pose) -> Self {
        let world_from_ego = pose.world_from_ego();
        let centre_ahead_m = geometry.near_edge_ahead_m + 0.5 * geometry.side_m;
        Self {
            world_from_ego,
            lattice: PixelLattice::new(geometry, pose),
            patch_centre: world_from_ego.point(Vec2::new(centre_ahead_m, 0.0)),
            patch_radius_m: geometry.side_m * std::f32::consts::FRAC_1_SQRT_2,
        }
    }

    fn may_see(&self, centre: Vec2, radius_m: f32) -> bool {
        centre.distance_squared(self.patch_centre) < (self.patch_radius_m + radius_m).powi(2)
    }

    fn polygon(&self, region: &Region) -> ConvexInEgo {
        ConvexInEgo::new(region.polygon.iter().map(|&corner| self.world_from_ego.inverse_point(corner)))
    }
}

/// One bit per pixel of the view.
struct PixelRows {
    bits: Vec<[u64; WORDS]>,
}

const WORDS: usize = BEV_PIXELS.div_ceil(64);
const CELLS_PER_WORD: usize = 64 / CELL_PIXELS;

impl PixelRows {
    fn empty() -> Self {
        Self { bits: vec![[0; WORDS]; BEV_PIXELS] }
    }

    fn set(&mut self, row: usize, first: usize, last: usize) {
        for col in first..=last {
            self.bits[row][col / 64] |= 1 << (col % 64);
        }
    }

    fn get(&self, row: usize, col: usize) -> bool {
        self.bits[row][col / 64] >> (col % 64) & 1 == 1
    }

    /// The cells of a row of cells of which any pixel is set, bit = column.
    fn touched_cells(&self, row: usize) -> u32 {
        let mut words = [0; WORDS];
        for pixels in &self.bits[row * CELL_PIXELS..(row + 1) * CELL_PIXELS] {
            for (word, pixels) in words.iter_mut().zip(pixels) {
                *word |= pixels;
            }
        }
        let is_touched = |col: usize| words[col / CELLS_PER_WORD] >> (col % CELLS_PER_WORD * CELL_PIXELS) & 0xFF != 0;
        (0..GRID_CELLS).fold(0, |cells, col| cells | u32::from(is_touched(col)) << col)
    }
}
