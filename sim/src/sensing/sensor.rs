//! The sensor of one episode: clean view → occlusion → noise → grid.

mod inspect;
mod openings;

pub use inspect::Inspection;

use openings::Openings;

use super::noise::patch::{Patch, Reads, Region};
use super::noise::shadow::Shadow;
use super::noise::{BoundaryShift, NoiseField, NoiseSettings, wobble_growth};
use super::occlusion::{Camera, CellBox, ConvexInEgo, TallObject};
use super::quadtree::{BLOCK_CELLS, BLOCKS, PixelLattice, pixels_of, to_corner_m};
use super::{BEV_PIXELS, BirdsEyeView, CELL_PIXELS, GRID_CELLS, GridGeometry, Observation, OccupancyGrid};
use crate::distance_field::{DistanceField, change_max_m};
use crate::geometry::{Pose, Vec2, WorldFromEgo, bits};
use crate::map::{Map, Occluder};
use crate::seed::RootSeed;
use crate::vectors::{ALL_LANES, FourPoints, LANES, Picked, coordinate, f32x4};
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
    /// The last observation and its tick.
    last: Option<(u32, Observation)>,
    undecided: Undecided,
}

impl Sensor {
    /// A sensor whose noise is drawn from `seed`.
    pub fn new(map: &Map, settings: SensingSettings, noise: &NoiseSettings, seed: RootSeed) -> Self {
        let geometry = &settings.geometry;
        let noise = NoiseField::new(map, noise, seed, to_corner_m(geometry.pixel_m(), CELL_PIXELS));
        let ahead_of_patch_m = |row: usize| geometry.cell_in_ego(row, 0).x - geometry.near_edge_ahead_m;
        let wobble_growth = std::array::from_fn(|row| wobble_growth(ahead_of_patch_m(row)));
        Self {
            shift: noise.boundary_shift(),
            wobble_growth,
            settings,
            noise,
            last: None,
            undecided: Undecided::with_room(),
        }
    }

    /// What the car perceives from a pose at a tick.
    ///
    /// A dropped frame repeats the grid of the tick before. A sensor that was not asked then has nothing to repeat: an older
    /// grid shows another place.
    pub fn observe(&mut self, map: &Map, pose: Pose, tick: u32) -> Observation {
        let observation = match self.last {
            Some((of, last)) if of + 1 == tick && self.noise.drops_frame(tick) => last,
            _ => Observation { grid: self.perceive_grid(map, pose, tick) },
        };
        self.last = Some((tick, observation));
        observation
    }

    /// Does not repeat what was seen so far: the car is put somewhere else.
    pub fn forget(&mut self) {
        self.last = None;
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
    ///
    /// First blocks of cells are looked up, then cells, then the noise, then pixels: each for what the one before has left
    /// undecided.
    fn beyond_boundaries(&mut self, map: &Map, ego: &EgoView, tick: u32) -> OccupancyGrid {
        let field = map.distance_field();
        let openings = self.openings(ego, tick);
        let mut grid = OccupancyGrid::free();
        let mut undecided = std::mem::take(&mut self.undecided);
        undecided.clear();
        self.occupy_blocks(field, ego, &openings, &mut grid, &mut undecided);
        self.occupy_surely_beyond(field, ego, &openings, &mut grid, &mut undecided);
        self.shift.look_at(ego.patch_centre, ego.patch_radius_m, tick);
        self.occupy_beyond_shifted(ego, &mut grid, &mut undecided);
        undecided.occupy_by_pixels(field, &ego.lattice, &mut grid);
        self.undecided = undecided;
        self.occupy_parted(field, ego, &openings, &mut grid);
        grid
    }

    /// Marks the cells of blocks that are wholly beyond a boundary however noise shifts it.
    fn occupy_blocks(
        &self,
        field: &DistanceField,
        ego: &EgoView,
        openings: &Openings,
        grid: &mut OccupancyGrid,
        undecided: &mut Undecided,
    ) {
        let within_m = change_max_m(to_corner_m(self.settings.geometry.pixel_m(), BLOCK_CELLS * CELL_PIXELS));
        for block_row in 0..BLOCKS {
            // Noise is largest far ahead.
            let sure_m = f32x4::splat(self.shift_max_m(block_row * BLOCK_CELLS) + within_m);
            let mut beyond = 0;
            for first in (0..BLOCKS).step_by(LANES) {
                let centres_m = ego.lattice.nearest_nodes_of_blocks(field, block_row, first);
                let (is_drivable, is_beyond) = (centres_m.simd_gt(sure_m), centres_m.simd_lt(-sure_m));
                beyond |= is_beyond.to_bitmask() << first;
                let unsure = !(is_drivable | is_beyond).to_bitmask() & ALL_BLOCKS >> first;
                undecided.blocks.pick(block_row * BLOCKS + first, unsure);
            }
            for row in rows_of_block(block_row) {
                grid.occupy_row(row, cells_of_blocks(beyond) & !openings.whole_cells(row));
            }
        }
    }

    /// Marks the cells of undecided blocks of which a pixel is beyond a boundary however noise shifts it. Leaves out cells
    /// that hold open pixels.
    fn occupy_surely_beyond(
        &self,
        field: &DistanceField,
        ego: &EgoView,
        openings: &Openings,
        grid: &mut OccupancyGrid,
        undecided: &mut Undecided,
    ) {
        let (above_m, below_m) = ego.lattice.decided_m();
        for block in undecided.blocks.iter() {
            let (block_row, block_col) = (block / BLOCKS, block % BLOCKS);
            let first_col = block_col * BLOCK_CELLS;
            for row in rows_of_block(block_row) {
                let centres_m = ego.lattice.nearest_nodes_of_cells(field, row, block_col);
                let shift_m = self.shift_max_m(row);
                let drivable = centres_m.simd_gt(f32x4::splat(shift_m + above_m)).to_bitmask();
                let beyond = centres_m.simd_lt(f32x4::splat(-shift_m - below_m)).to_bitmask();
                let untouched = (!openings.touched_cells(row) & OccupancyGrid::ROW_MASK) >> first_col & ALL_LANES;
                grid.occupy_row(row, (beyond & untouched) << first_col);
                let first = cell_number(row, first_col);
                undecided.cells.pick(first, !(drivable | beyond) & untouched);
                undecided.centres_m[first..first + LANES].copy_from_slice(centres_m.as_array());
            }
        }
    }

    /// Marks the undecided cells of which the centre tells, once it is known how noise shifts the boundary.
    fn occupy_beyond_shifted(&self, ego: &EgoView, grid: &mut OccupancyGrid, undecided: &mut Undecided) {
        let Undecided { cells, centres_m, shifted, thresholds_m, .. } = undecided;
        for (i, (cells, lanes)) in cells.fours().enumerate() {
            let (rows, cols) = (cells.map(row_of_cell), cells.map(col_of_cell));
            let of_four_m = self.thresholds_m(ego, rows.map(coordinate).into(), cols.map(coordinate).into());
            let (are_above, are_below) = ego.lattice.are_decided(cells.map(|cell| centres_m[cell]).into(), of_four_m);
            for lane in 0..LANES {
                grid.occupy_row(rows[lane], (are_below >> lane & 1) << cols[lane]);
            }
            shifted.pick(i * LANES, !(are_above | are_below) & lanes);
            thresholds_m.extend(of_four_m.to_array());
        }
    }

    /// How far noise may shift a boundary in a row of cells, metres.
    fn shift_max_m(&self, row: usize) -> f32 {
        self.noise.boundary_shift_max_m(self.wobble_growth[row])
    }

    /// Marks the cells that keep a pixel beyond a boundary although noise opens others.
    fn occupy_parted(&self, field: &DistanceField, ego: &EgoView, openings: &Openings, grid: &mut OccupancyGrid) {
        for (row, parted) in openings.parted_cells() {
            for col in bits(parted & !grid.row(row)) {
                let thresholds_m = self.thresholds_m(ego, f32x4::splat(row as f32), f32x4::splat(col as f32));
                let centre_m = field.at_nearest_node(ego.lattice.cell_centre(row, col));
                let (are_above, _) = ego.lattice.are_decided(f32x4::splat(centre_m), thresholds_m);
                let is_occupied = are_above == 0
                    && openings.any_closed_pixel_below(field, &ego.lattice, row, col, thresholds_m.as_array()[0]);
                grid.occupy_row(row, u32::from(is_occupied) << col);
            }
        }
    }

    /// Signed distances up to which pixels of cells are beyond a boundary, metres.
    #[inline]
    fn thresholds_m(&self, ego: &EgoView, rows: f32x4, cols: f32x4) -> f32x4 {
        let growth = rows.to_array().map(|row| self.wobble_growth[row as usize]);
        -self.shift.at_four(ego.lattice.cell_centres(rows, cols), growth.into())
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
                    let [left, right] = ego.lattice.pixels_of_cell(row, cell_col);
                    let are_misread = |points| shadow.are_misread(points, threshold);
                    (are_misread(left) | are_misread(right) << LANES) & u32::from(pixels) != 0
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
                shift.at_four(FourPoints::splat(centre), f32x4::splat(self.wobble_growth[row])).as_array()[0]
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

    /// Tall things around the patch and on the way to it, as seen by the camera; none if ground is not hidden.
    fn occluders<'a>(&'a self, map: &'a Map, ego: &'a EgoView) -> impl Iterator<Item = TallObject> + 'a {
        let camera = Camera { ahead_m: self.settings.camera_ahead_m, height_m: self.settings.camera_height_m };
        let (centre, radius_m) = circle_of_sight(&self.settings.geometry, camera.ahead_m);
        let centre = ego.world_from_ego.point(centre);
        let near = self.settings.occlusion.then(|| map.occluders_near(centre, radius_m));
        let camera_in_world = ego.world_from_ego.point(Vec2::new(camera.ahead_m, 0.0));
        let near_sides = move |occluder: &&Occluder| !occluder.is_far_side(camera_in_world, camera.height_m);
        near.into_iter().flatten().filter(near_sides).map(move |occluder| {
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

/// The blocks of a row, bit = column.
const ALL_BLOCKS: u32 = (1 << BLOCKS) - 1;

/// The cells of blocks in a row of blocks, bit = column.
fn cells_of_blocks(blocks: u32) -> u32 {
    const BLOCK: u32 = (1 << BLOCK_CELLS) - 1;
    (0..BLOCKS).fold(0, |cells, block| cells | (((blocks >> block & 1) * BLOCK) << (block * BLOCK_CELLS)))
}

/// Rows of cells in a row of blocks.
fn rows_of_block(block_row: usize) -> Range<usize> {
    block_row * BLOCK_CELLS..((block_row + 1) * BLOCK_CELLS).min(GRID_CELLS)
}

/// Cells are numbered row by row, with gaps where blocks reach beyond the view.
const NUMBERS_PER_ROW: usize = 32;

fn cell_number(row: usize, col: usize) -> usize {
    row * NUMBERS_PER_ROW + col
}

fn row_of_cell(number: usize) -> usize {
    number / NUMBERS_PER_ROW
}

fn col_of_cell(number: usize) -> usize {
    number % NUMBERS_PER_ROW
}

/// What is left undecided at one stage after the other. Kept between views for its memory only.
#[derive(Debug, Clone, Default)]
struct Undecided {
    /// Blocks of cells, row by row.
    blocks: Picked,
    /// Cells by number, and of each the signed distance at the node nearest to its centre.
    cells: Picked,
    centres_m: Vec<f32>,
    /// Indices of those of the cells that are undecided when the shift of the boundary is known, and of each of the cells
    /// the signed distance up to which its pixels are beyond.
    shifted: Picked,
    thresholds_m: Vec<f32>,
    /// Indices of those of the cells of which no pixel in a corner is beyond.
    inside: Picked,
}

impl Undecided {
    fn with_room() -> Self {
        const NUMBERS: usize = GRID_CELLS * NUMBERS_PER_ROW;
        Self {
            blocks: Picked::up_to(BLOCKS * BLOCKS),
            cells: Picked::up_to(NUMBERS),
            centres_m: vec![0.0; NUMBERS],
            shifted: Picked::up_to(NUMBERS),
            thresholds_m: Vec::new(),
            inside: Picked::up_to(NUMBERS),
        }
    }

    fn clear(&mut self) {
        let Self { blocks, cells, shifted, thresholds_m, inside, .. } = self;
        [blocks, cells, shifted, inside].into_iter().for_each(Picked::clear);
        thresholds_m.clear();
    }

    /// Marks the cells of which a pixel is beyond a boundary, by looking at pixels: first at those in the corners, where
    /// most have one.
    fn occupy_by_pixels(&mut self, field: &DistanceField, lattice: &PixelLattice, grid: &mut OccupancyGrid) {
        let Self { cells, shifted, thresholds_m, inside, .. } = self;
        let cell = |index: usize| {
            let number = cells.get(index);
            (row_of_cell(number), col_of_cell(number), thresholds_m[index])
        };
        for index in shifted.iter() {
            let (row, col, threshold_m) = cell(index);
            let is_beyond = lattice.any_corner_below(field, row, col, threshold_m);
            grid.occupy_row(row, u32::from(is_beyond) << col);
            inside.pick_if(!is_beyond, index);
        }
        for index in inside.iter() {
            let (row, col, threshold_m) = cell(index);
            grid.occupy_row(row, u32::from(lattice.any_below(field, row, col, threshold_m)) << col);
        }
    }
}

/// A circle around all lines of sight from the camera into the patch: its centre in the ego frame, and its radius, metres.
fn circle_of_sight(geometry: &GridGeometry, camera_ahead_m: f32) -> (Vec2, f32) {
    let [near, far] = [geometry.near_edge_ahead_m, geometry.far_edge_ahead_m()]
        .map(|ahead_m| Vec2::new(ahead_m, 0.5 * geometry.side_m));
    let camera = Vec2::new(camera_ahead_m, 0.0);
    // As far from the camera as from the far corners.
    let centre = Vec2::new(0.5 * (far.length_squared() - camera.length_squared()) / (far.x - camera.x), 0.0);
    (centre, [near, far, camera].map(|point| centre.distance(point)).into_iter().fold(0.0, f32::max))
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
        let reach_m = self.patch_radius_m + radius_m;
        centre.distance_squared(self.patch_centre) < reach_m * reach_m
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
