//! The sensor of one episode: clean view → occlusion → noise → grid.

mod inspect;
mod openings;

pub use inspect::Inspection;

use openings::Openings;

use super::noise::{BoundaryShift, NoiseField, NoiseSettings, Patch, Reads, Region, Shadow, wobble_growth};
use super::occlusion::{Camera, CellBox, ConvexInEgo, TallObject};
use super::quadtree::{BLOCK_CELLS, BLOCKS, PixelLattice, ROW_LANES, pixels_of, to_corner_m};
use super::{BEV_PIXELS, BirdsEyeView, CELL_PIXELS, GRID_CELLS, GridGeometry, Observation, OccupancyGrid};
use crate::distance_field::{DistanceField, change_max_m};
use crate::geometry::{Pose, Vec2, WorldFromEgo, bits};
use crate::map::Map;
use crate::seed::RootSeed;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Settings of the sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensingSettings {
    /// Where the patch lies.
    pub geometry: GridGeometry,
    /// Whether tall objects hide the ground behind them (docs/methods.md 1.7).
    pub occlusion: bool,
    /// Camera ahead of the rear axle, metres (docs/methods.md 9.2).
    pub camera_ahead_m: f32,
    /// Camera above ground, metres.
    pub camera_height_m: f32,
}

impl SensingSettings {
    /// The paper's camera, occlusion on.
    pub fn paper() -> Self {
        Self { geometry: GridGeometry::paper(), occlusion: true, camera_ahead_m: 1.59, camera_height_m: 1.55 }
    }
}

/// The sensor of one episode.
#[derive(Debug, Clone)]
pub struct Sensor {
    settings: SensingSettings,
    noise: NoiseField,
    /// The noise's boundary wobble, with what was drawn of it for the last view.
    shift: BoundaryShift,
    /// How much larger the wobble is in each row of cells than at the patch's lower edge.
    wobble_growth: [f32; GRID_CELLS],
    last: Option<Observation>,
}

impl Sensor {
    /// A sensor whose noise is drawn from `seed`.
    pub fn new(map: &Map, settings: SensingSettings, noise: &NoiseSettings, seed: RootSeed) -> Self {
        let geometry = &settings.geometry;
        let noise = NoiseField::new(map, noise, seed, to_corner_m(geometry.pixel_m(), CELL_PIXELS));
        let ahead_of_patch_m = |row: usize| geometry.cell_in_ego(row, 0).x - geometry.near_edge_ahead_m;
        let wobble_growth = std::array::from_fn(|row| wobble_growth(ahead_of_patch_m(row)));
        Self { shift: noise.boundary_shift(), wobble_growth, settings, noise, last: None }
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
    fn perceive_grid(&mut self, map: &Map, pose: Pose, tick: u32) -> OccupancyGrid {
        let ego = EgoView::new(&self.settings.geometry, pose);
        let mut grid = self.beyond_boundaries(map, &ego, tick);
        self.hide_ground(map, &ego, &mut grid);
        for polygon in self.misread(&ego, tick) {
            polygon.occupy(&self.settings.geometry, &mut grid);
        }
        self.darken(&ego, tick, &mut grid);
        grid
    }

    /// The cells that hold a pixel beyond a boundary, as shifted and opened by noise.
    fn beyond_boundaries(&mut self, map: &Map, ego: &EgoView, tick: u32) -> OccupancyGrid {
        let field = map.distance_field();
        let openings = self.openings(ego, tick);
        let mut grid = OccupancyGrid::free();
        let mut unsure = UnsureCells::new();
        self.occupy_surely_beyond(field, ego, &openings, &mut grid, &mut unsure);
        self.shift.look_at(ego.patch_centre, ego.patch_radius_m, tick);
        for cells in unsure.fours() {
            let thresholds_m = self.thresholds_m(ego, &cells.rows, &cells.cols);
            let (is_above, is_below) = ego.lattice.are_decided(&cells.centres_m, &thresholds_m);
            for i in bits(!is_above & 0b1111) {
                let (row, col) = (cells.rows[i], cells.cols[i]);
                let is_occupied = is_below >> i & 1 == 1
                    || ego.lattice.any_below(field, row, col, cells.centres_m[i], thresholds_m[i]);
                grid.occupy_row(row as usize, u32::from(is_occupied) << col);
            }
        }
        self.occupy_parted(field, ego, &openings, &mut grid);
        grid
    }

    /// Marks the cells that are beyond a boundary however noise shifts it; `unsure` gets those that take a look at the
    /// noise, but for cells that hold open pixels.
    fn occupy_surely_beyond(
        &self,
        field: &DistanceField,
        ego: &EgoView,
        openings: &Openings,
        grid: &mut OccupancyGrid,
        unsure: &mut UnsureCells,
    ) {
        let (above_m, below_m) = ego.lattice.decided_m();
        let mut centres_m = [0.0; ROW_LANES];
        for block_row in 0..BLOCKS {
            let (beyond_blocks, unsure_cols) = self.look_at_blocks(field, ego, block_row);
            let are_looked_at = (1 << unsure_cols.end) - (1 << unsure_cols.start);
            for row in block_row * BLOCK_CELLS..((block_row + 1) * BLOCK_CELLS).min(GRID_CELLS) {
                ego.lattice.nearest_nodes_of_cells(field, row, unsure_cols.clone(), &mut centres_m);
                let shift_m = self.shift_max_m(row);
                let (drivable, beyond) = sides(&centres_m[unsure_cols.clone()], shift_m + above_m, -shift_m - below_m);
                let [drivable, beyond] = [drivable, beyond].map(|cells| cells << unsure_cols.start);
                // All pixels of a cell in such a block are beyond, of other such cells some pixel is, which may be open.
                let touched = openings.touched_cells(row);
                let occupied = beyond_blocks & !openings.whole_cells(row) | beyond & !touched;
                grid.occupy_row(row, occupied);
                unsure.push_row(row, are_looked_at & !(drivable | occupied | touched), &centres_m);
            }
        }
    }

    /// The cells of a row of blocks whose blocks are wholly beyond a boundary however noise shifts it, bit = column, and
    /// columns of cells around all blocks that are not wholly on one side.
    fn look_at_blocks(&self, field: &DistanceField, ego: &EgoView, block_row: usize) -> (u32, Range<usize>) {
        let within_m = change_max_m(to_corner_m(self.settings.geometry.pixel_m(), BLOCK_CELLS * CELL_PIXELS));
        // Noise is largest far ahead.
        let sure_m = self.shift_max_m(block_row * BLOCK_CELLS) + within_m;
        let (drivable, beyond) = sides(&ego.lattice.nearest_nodes_of_blocks(field, block_row), sure_m, -sure_m);
        (cells_of_blocks(beyond), cells_from_first_to_last_block(!(drivable | beyond)))
    }

    /// How far noise may shift a boundary in a row of cells, metres.
    fn shift_max_m(&self, row: usize) -> f32 {
        self.noise.boundary_shift_max_m(self.wobble_growth[row])
    }

    /// Marks the cells that keep a pixel beyond a boundary although noise opens others.
    fn occupy_parted(&mut self, field: &DistanceField, ego: &EgoView, openings: &Openings, grid: &mut OccupancyGrid) {
        for (row, parted) in openings.parted_cells() {
            for col in bits(parted & !grid.row(row)) {
                let [threshold_m] = self.thresholds_m(ego, &[row as u32], &[col as u32]);
                let centre_m = field.at_nearest_node(ego.lattice.cell_centre(row, col));
                let (is_above, _) = ego.lattice.are_decided(&[centre_m], &[threshold_m]);
                let is_occupied =
                    is_above == 0 && openings.any_closed_pixel_below(field, &ego.lattice, row, col, threshold_m);
                grid.occupy_row(row, u32::from(is_occupied) << col);
            }
        }
    }

    /// Signed distances up to which pixels of cells, given as rows and columns, are beyond a boundary, metres.
    #[inline]
    fn thresholds_m<const N: usize>(&mut self, ego: &EgoView, rows: &[u32; N], cols: &[u32; N]) -> [f32; N] {
        let (xs, ys) = ego.lattice.cell_centres(rows, cols);
        let growth = rows.map(|row| self.wobble_growth[row as usize]);
        self.shift.at_each(&xs, &ys, &growth).map(|shift_m| -shift_m)
    }

    /// Marks the cells of which tall things hide a pixel.
    fn hide_ground(&self, map: &Map, ego: &EgoView, grid: &mut OccupancyGrid) {
        let geometry = &self.settings.geometry;
        for thing in self.occluders(map, ego) {
            // Most hidden ground lies beyond the lane, where everything is occupied already.
            let Some((low, high)) = thing.hidden_box() else { continue };
            if CellBox::around(geometry, low, high).is_none_or(|cells| cells.is_full(grid)) {
                continue;
            }
            if let Some(polygon) = thing.hidden_ground() {
                polygon.occupy(geometry, grid);
            }
        }
    }

    /// Marks the cells that hold a misread pixel of a shadow.
    fn darken(&self, ego: &EgoView, tick: u32, grid: &mut OccupancyGrid) {
        let geometry = &self.settings.geometry;
        self.for_each_shadow(ego, tick, |polygon, shadow, threshold| {
            let Some(spans) = polygon.spans_of_free_cells(geometry, grid) else { return };
            let is_any_of_row_misread = |row: usize, cell_col: usize| {
                let pixels = spans.pixels_of_cell(row, cell_col);
                pixels != 0 && {
                    let (xs, ys) = ego.lattice.pixels_of_cell(row, cell_col);
                    shadow.are_misread(&xs, &ys, threshold) & u32::from(pixels) != 0
                }
            };
            let is_any_misread = |cell_row: usize, cell_col: usize| {
                let (low, high) = ego.lattice.box_around_cell(cell_row, cell_col);
                shadow.may_be_misread_within(low, high, threshold)
                    && pixels_of(cell_row).any(|row| is_any_of_row_misread(row, cell_col))
            };
            for row in spans.cell_rows() {
                for col in bits(spans.touched_cells(row) & !grid.row(row)) {
                    let is_misread = shadow
                        .are_misread_around(ego.lattice.cell_centre(row, col), threshold)
                        .unwrap_or_else(|| is_any_misread(row, col));
                    grid.occupy_row(row, u32::from(is_misread) << col);
                }
            }
        });
    }

    /// The perceived view in full resolution, by brute force. Its max-pool is the grid of [`Self::observe`], dropped
    /// frames excepted.
    pub fn perceived_view(&self, map: &Map, pose: Pose, tick: u32) -> BirdsEyeView {
        let geometry = &self.settings.geometry;
        let ego = EgoView::new(geometry, pose);
        let (mut open, mut covered) = (PixelRows::empty(), PixelRows::empty());
        for polygon in self.patches(&ego, tick, Reads::Free) {
            polygon.for_each_row(geometry, |row, first, last| open.set(row, first, last));
        }
        for polygon in self.hidden_ground(map, &ego).chain(self.misread(&ego, tick)) {
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
        let mut shift = self.noise.boundary_shift();
        shift.look_at(ego.patch_centre, ego.patch_radius_m, tick);
        let shifts_m: Vec<f32> = (0..GRID_CELLS * GRID_CELLS)
            .map(|cell| {
                let (row, col) = (cell / GRID_CELLS, cell % GRID_CELLS);
                let centre = ego.lattice.cell_centre(row, col);
                let [shift_m] = shift.at_each(&[centre.x], &[centre.y], &[self.wobble_growth[row]]);
                shift_m
            })
            .collect();
        BirdsEyeView::from_fn(|row, col| {
            let shift_m = shifts_m[row / CELL_PIXELS * GRID_CELLS + col / CELL_PIXELS];
            let is_beyond = map.signed_distance_m(ego.lattice.point(row as f32, col as f32)) <= -shift_m;
            (is_beyond && !open.get(row, col)) || covered.get(row, col)
        })
    }

    /// The view a faultless segmentation would give: occlusion is geometry, not an error.
    pub fn clean_view(&self, map: &Map, pose: Pose) -> BirdsEyeView {
        let ego = EgoView::new(&self.settings.geometry, pose);
        let mut hidden = PixelRows::empty();
        for polygon in self.hidden_ground(map, &ego) {
            polygon.for_each_row(&self.settings.geometry, |row, first, last| hidden.set(row, first, last));
        }
        BirdsEyeView::from_fn(|row, col| {
            map.signed_distance_m(ego.lattice.point(row as f32, col as f32)) <= 0.0 || hidden.get(row, col)
        })
    }

    /// What is laid over the view as occupied by mistake: patches and flicker.
    fn misread<'a>(&'a self, ego: &'a EgoView, tick: u32) -> impl Iterator<Item = ConvexInEgo> + 'a {
        self.patches(ego, tick, Reads::Occupied).chain(self.flicker(tick))
    }

    fn flicker(&self, tick: u32) -> Option<ConvexInEgo> {
        let geometry = &self.settings.geometry;
        let (centre, side_m) = self.noise.flicker(tick, geometry.near_edge_ahead_m, geometry.side_m)?;
        Some(ConvexInEgo::new(crate::geometry::rectangle(Pose::new(centre, 0.0), side_m, side_m)))
    }

    fn hidden_ground<'a>(&'a self, map: &'a Map, ego: &'a EgoView) -> impl Iterator<Item = ConvexInEgo> + 'a {
        self.occluders(map, ego).filter_map(|thing| thing.hidden_ground())
    }

    /// Tall things around the patch as seen by the camera; none if ground is not hidden.
    fn occluders<'a>(&'a self, map: &'a Map, ego: &'a EgoView) -> impl Iterator<Item = TallObject> + 'a {
        let camera = Camera { ahead_m: self.settings.camera_ahead_m, height_m: self.settings.camera_height_m };
        let near = self.settings.occlusion.then(|| map.occluders_near(ego.patch_centre, ego.patch_radius_m));
        near.into_iter().flatten().map(move |occluder| {
            TallObject::new(&ego.world_from_ego.inverse_outline(&occluder.corners), occluder.height_m, camera)
        })
    }

    fn patches<'a>(&'a self, ego: &'a EgoView, tick: u32, reads: Reads) -> impl Iterator<Item = ConvexInEgo> + 'a {
        self.visible_patches(ego, tick, reads).map(|patch| ego.polygon(&patch.region))
    }

    fn visible_patches(&self, ego: &EgoView, tick: u32, reads: Reads) -> impl Iterator<Item = &Patch> {
        self.noise.patches(reads).near(ego.patch_centre, ego.patch_radius_m, tick)
    }

    fn openings(&self, ego: &EgoView, tick: u32) -> Openings {
        let geometry = &self.settings.geometry;
        Openings::new(self.patches(ego, tick, Reads::Free).filter_map(|polygon| polygon.all_spans(geometry)).collect())
    }

    fn for_each_shadow(&self, ego: &EgoView, tick: u32, mut visit: impl FnMut(&ConvexInEgo, &Shadow, u8)) {
        for (index, shadow) in self.noise.shadows.iter().enumerate() {
            if ego.may_see(shadow.region.centre, shadow.region.radius_m) {
                visit(&ego.polygon(&shadow.region), shadow, self.noise.shadow_threshold(index, tick));
            }
        }
    }
}

/// Which distances, at most a row of them, are above a bound and which are below another one; bit = index.
fn sides(distances_m: &[f32], above_m: f32, below_m: f32) -> (u32, u32) {
    const BITS: [[u32; 4]; ROW_LANES / 4] = {
        let mut bits = [[0; 4]; ROW_LANES / 4];
        let mut i = 0;
        while i < ROW_LANES {
            bits[i / 4][i % 4] = 1 << i;
            i += 1;
        }
        bits
    };
    // Four distances at once, whose bits are joined at the end.
    let (mut are_above, mut are_below) = ([0; 4], [0; 4]);
    for (four_m, bits) in distances_m.as_chunks::<4>().0.iter().zip(&BITS) {
        for i in 0..4 {
            are_above[i] |= if four_m[i] > above_m { bits[i] } else { 0 };
            are_below[i] |= if four_m[i] < below_m { bits[i] } else { 0 };
        }
    }
    let join = |four: [u32; 4]| four.into_iter().fold(0, |all, bits| all | bits);
    (join(are_above), join(are_below))
}

/// The cells of blocks in a row of blocks, bit = column.
fn cells_of_blocks(blocks: u32) -> u32 {
    const BLOCK: u32 = (1 << BLOCK_CELLS) - 1;
    bits(blocks).fold(0, |cells, block| cells | BLOCK << (block * BLOCK_CELLS))
}

/// The columns of cells from the first to the last of some blocks in a row of blocks.
fn cells_from_first_to_last_block(blocks: u32) -> Range<usize> {
    const ALL: u32 = (1 << BLOCKS) - 1;
    match blocks & ALL {
        0 => 0..0,
        blocks => blocks.trailing_zeros() as usize * BLOCK_CELLS..(blocks.ilog2() as usize + 1) * BLOCK_CELLS,
    }
}

/// Cells that one look-up does not decide.
struct UnsureCells {
    rows: [u8; UNSURE_MAX],
    cols: [u8; UNSURE_MAX],
    /// Signed distance at the node nearest to the centre of each.
    centres_m: [f32; UNSURE_MAX],
    n_cells: usize,
}

/// All cells, and what four at a time may read beyond the last.
const UNSURE_MAX: usize = GRID_CELLS * GRID_CELLS + 3;

/// Four cells: their rows and columns, and signed distances at the nodes nearest to their centres.
struct FourCells {
    rows: [u32; 4],
    cols: [u32; 4],
    centres_m: [f32; 4],
}

impl UnsureCells {
    fn new() -> Self {
        Self { rows: [0; UNSURE_MAX], cols: [0; UNSURE_MAX], centres_m: [f32::INFINITY; UNSURE_MAX], n_cells: 0 }
    }

    #[inline]
    fn push_row(&mut self, row: usize, cols: u32, centres_m: &[f32; ROW_LANES]) {
        for col in bits(cols & OccupancyGrid::ROW_MASK) {
            (self.rows[self.n_cells], self.cols[self.n_cells]) = (row as u8, col as u8);
            self.centres_m[self.n_cells] = centres_m[col];
            self.n_cells += 1;
        }
    }

    /// The cells, four at a time. What fills up the last four is far from any boundary.
    fn fours(&self) -> impl Iterator<Item = FourCells> + '_ {
        (0..self.n_cells).step_by(4).map(|first| FourCells {
            rows: four(&self.rows, first).map(u32::from),
            cols: four(&self.cols, first).map(u32::from),
            centres_m: four(&self.centres_m, first),
        })
    }
}

/// Four neighbours in an array.
#[inline]
fn four<T: Copy>(values: &[T; UNSURE_MAX], first: usize) -> [T; 4] {
    *values[first..].first_chunk().expect("there are three to spare")
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

impl PixelRows {
    fn empty() -> Self {
        Self { bits: vec![[0; WORDS]; BEV_PIXELS] }
    }

    fn set(&mut self, row: usize, first: usize, last: usize) {
        for word in first / 64..=last / 64 {
            let start = word * 64;
            let (low, high) = (first.max(start) - start, last.min(start + 63) - start);
            self.bits[row][word] |= (u64::MAX << low) & (u64::MAX >> (63 - high));
        }
    }

    fn get(&self, row: usize, col: usize) -> bool {
        self.bits[row][col / 64] >> (col % 64) & 1 == 1
    }
}
