//! The sensor of one episode: clean view → smear → noise → grid.

mod inspect;

pub use inspect::Inspection;

use super::noise::{BoundaryShift, NoiseConfig, NoiseField, Patch, Reads, Region, Shadow, wobble_growth};
use super::quadtree::{PixelLattice, ROW_LANES, to_corner_m};
use super::smear::{Camera, CellBox, ConvexInEgo, TallThing, bits_between};
use super::{BEV_PIXELS, BirdsEyeView, CELL_PIXELS, GRID_CELLS, GridGeometry, Observation, OccupancyGrid};
use crate::distance_field::change_max_m;
use crate::geometry::{Pose, Vec2, WorldFromEgo, bits};
use crate::map::Map;
use crate::seed::RootSeed;
use serde::{Deserialize, Serialize};
use std::ops::Range;

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
    /// The noise's boundary wobble, with what was drawn of it for the last view.
    shift: BoundaryShift,
    /// How much larger the wobble is in each row of cells than at the patch's lower edge.
    wobble_growth: [f32; GRID_CELLS],
    last: Option<Observation>,
}

impl Sensor {
    /// A sensor whose noise is drawn from `seed`.
    pub fn new(map: &Map, config: SensingConfig, noise: &NoiseConfig, seed: RootSeed) -> Self {
        let geometry = &config.geometry;
        let noise = NoiseField::new(map, noise, seed, to_corner_m(geometry.pixel_m(), CELL_PIXELS));
        let ahead_of_patch_m = |row: usize| geometry.cell_in_ego(row, 0).x - geometry.near_edge_ahead_m;
        let wobble_growth = std::array::from_fn(|row| wobble_growth(ahead_of_patch_m(row)));
        Self { shift: noise.boundary_shift(), wobble_growth, config, noise, last: None }
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
        let ego = EgoView::new(&self.config.geometry, pose);
        let mut grid = self.beyond_boundaries(map, &ego, tick);
        self.hide_ground(map, &ego, &mut grid);
        for polygon in self.misread(&ego, tick) {
            polygon.occupy(&self.config.geometry, &mut grid);
        }
        self.darken(&ego, tick, &mut grid);
        grid
    }

    /// The cells that hold a pixel beyond a boundary, as shifted and opened by noise.
    fn beyond_boundaries(&mut self, map: &Map, ego: &EgoView, tick: u32) -> OccupancyGrid {
        let (geometry, field) = (&self.config.geometry, map.distance_field());
        let openings = self.openings(ego, tick);
        let within_cell_m = change_max_m(to_corner_m(geometry.pixel_m(), CELL_PIXELS));
        let mut grid = OccupancyGrid::free();
        let mut unsure = UnsureCells::new();
        for row in 0..GRID_CELLS {
            let centres_m = ego.lattice.nearest_nodes_of_row(field, row);
            // A cell whose centre is this far from a boundary is decided without looking at the noise.
            let sure_m = self.noise.boundary_shift_max_m(self.wobble_growth[row]) + within_cell_m;
            let (is_sure, is_beyond) = sides(&centres_m, sure_m);
            let opened = openings.as_ref().map_or(0, |opened| opened.touched_cells(row));
            grid.occupy_row(row, is_beyond & !opened);
            unsure.push_row(row, !is_sure | (is_beyond & opened), &centres_m);
        }
        self.shift.look_at(ego.patch_centre, ego.patch_radius_m, tick);
        for cells in unsure.fours() {
            let (xs, ys) = ego.lattice.cell_centres(&cells.rows, &cells.cols);
            let growth = cells.rows.map(|row| self.wobble_growth[row as usize]);
            let thresholds_m = self.shift.at_each(&xs, &ys, &growth).map(|shift_m| -shift_m);
            let (is_above, is_below) = ego.lattice.are_decided(&cells.centres_m, &thresholds_m);
            for i in bits(!is_above & 0b1111) {
                let (row, col) = (cells.rows[i], cells.cols[i]);
                let is_occupied = match &openings {
                    Some(openings) if openings.touched_cells(row as usize) >> col & 1 == 1 => {
                        any_closed_pixel_below(map, ego, openings, row as usize, col as usize, thresholds_m[i])
                    }
                    _ => is_below >> i & 1 == 1 || ego.lattice.any_below(field, row, col, thresholds_m[i]),
                };
                grid.occupy_row(row as usize, u32::from(is_occupied) << col);
            }
        }
        grid
    }

    /// Marks the cells of which tall things hide a pixel.
    fn hide_ground(&self, map: &Map, ego: &EgoView, grid: &mut OccupancyGrid) {
        let geometry = &self.config.geometry;
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
        let geometry = &self.config.geometry;
        self.for_each_shadow(ego, tick, |polygon, shadow, threshold| {
            let Some(spans) = polygon.spans_of_free_cells(geometry, grid) else { return };
            let is_any_misread = |row: usize, cols: Range<usize>| {
                cols.clone().step_by(4).any(|first| {
                    let (xs, ys) = ego.lattice.four_pixels(row, first);
                    let is_pixel = (1 << (cols.end - first).min(4)) - 1;
                    shadow.are_misread(&xs, &ys, threshold) & is_pixel != 0
                })
            };
            for row in spans.cell_rows() {
                for col in bits(spans.touched_cells(row) & !grid.row(row)) {
                    let is_misread = match shadow.are_misread_around(ego.lattice.cell_centre(row, col), threshold) {
                        Some(are_misread) => are_misread,
                        None => spans.pixels_of_cell(row, col).any(|(row, cols)| is_any_misread(row, cols)),
                    };
                    grid.occupy_row(row, u32::from(is_misread) << col);
                }
            }
        });
    }

    /// The perceived view in full resolution, by brute force. Its max-pool is the grid of [`Self::observe`], dropped
    /// frames excepted.
    pub fn perceived_view(&self, map: &Map, pose: Pose, tick: u32) -> BirdsEyeView {
        let geometry = &self.config.geometry;
        let ego = EgoView::new(geometry, pose);
        let openings = self.openings(&ego, tick).unwrap_or_else(PixelRows::empty);
        let mut covered = PixelRows::empty();
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

    /// What is laid over the view as occupied by mistake: patches and flicker.
    fn misread<'a>(&'a self, ego: &'a EgoView, tick: u32) -> impl Iterator<Item = ConvexInEgo> + 'a {
        self.patches(ego, tick, Reads::Occupied).chain(self.flicker(tick))
    }

    fn flicker(&self, tick: u32) -> Option<ConvexInEgo> {
        let geometry = &self.config.geometry;
        let (centre, side_m) = self.noise.flicker(tick, geometry.near_edge_ahead_m, geometry.side_m)?;
        Some(ConvexInEgo::new(crate::geometry::rectangle(Pose::new(centre, 0.0), side_m, side_m)))
    }

    fn hidden_ground<'a>(&'a self, map: &'a Map, ego: &'a EgoView) -> impl Iterator<Item = ConvexInEgo> + 'a {
        self.occluders(map, ego).filter_map(|thing| thing.hidden_ground())
    }

    /// Tall things around the patch as seen by the camera; none if ground is not hidden.
    fn occluders<'a>(&'a self, map: &'a Map, ego: &'a EgoView) -> impl Iterator<Item = TallThing> + 'a {
        let camera = Camera { ahead_m: self.config.camera_ahead_m, height_m: self.config.camera_height_m };
        let near = self.config.smear.then(|| map.occluders_near(ego.patch_centre, ego.patch_radius_m));
        near.into_iter().flatten().map(move |occluder| {
            TallThing::new(&ego.world_from_ego.inverse_outline(&occluder.corners), occluder.height_m, camera)
        })
    }

    fn patches<'a>(&'a self, ego: &'a EgoView, tick: u32, reads: Reads) -> impl Iterator<Item = ConvexInEgo> + 'a {
        self.visible_patches(ego, tick, reads).map(|patch| ego.polygon(&patch.region))
    }

    fn visible_patches(&self, ego: &EgoView, tick: u32, reads: Reads) -> impl Iterator<Item = &Patch> {
        self.noise.patches(reads).near(ego.patch_centre, ego.patch_radius_m, tick)
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

/// Which cells of a row have a distance of more than `sure_m` on either side of the boundary, and which of them are beyond
/// it; bit = column.
// Not inlined: on its own and of unknown length, the loop is compiled to instructions that take four cells.
#[inline(never)]
fn sides(centres_m: &[f32], sure_m: f32) -> (u32, u32) {
    const BITS: [u32; ROW_LANES] = {
        let mut bits = [0; ROW_LANES];
        let mut col = 0;
        while col < ROW_LANES {
            bits[col] = 1 << col;
            col += 1;
        }
        bits
    };
    let (mut is_drivable, mut is_beyond) = (0, 0);
    for (&centre_m, &bit) in centres_m.iter().zip(&BITS) {
        is_drivable |= if centre_m > sure_m { bit } else { 0 };
        is_beyond |= if centre_m < -sure_m { bit } else { 0 };
    }
    (is_drivable | is_beyond, is_beyond)
}

/// Cells that take a closer look.
struct UnsureCells {
    /// Row and column of each.
    places: [[u8; 2]; UNSURE_MAX],
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
        Self { places: [[0; 2]; UNSURE_MAX], centres_m: [f32::INFINITY; UNSURE_MAX], n_cells: 0 }
    }

    #[inline]
    fn push_row(&mut self, row: usize, cols: u32, centres_m: &[f32; ROW_LANES]) {
        for col in bits(cols & OccupancyGrid::ROW_MASK) {
            self.places[self.n_cells] = [row as u8, col as u8];
            self.centres_m[self.n_cells] = centres_m[col];
            self.n_cells += 1;
        }
    }

    /// The cells, four at a time. What fills up the last four is far from any boundary.
    fn fours(&self) -> impl Iterator<Item = FourCells> + '_ {
        let fours = self.places.as_chunks::<4>().0.iter().zip(self.centres_m.as_chunks::<4>().0);
        fours.take(self.n_cells.div_ceil(4)).map(|(places, centres_m)| FourCells {
            rows: places.map(|[row, _]| u32::from(row)),
            cols: places.map(|[_, col]| u32::from(col)),
            centres_m: *centres_m,
        })
    }
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
    let cols: [f32; CELL_PIXELS] = std::array::from_fn(|i| (col * CELL_PIXELS + i) as f32);
    (row * CELL_PIXELS..(row + 1) * CELL_PIXELS).any(|row| {
        let opened = opened.pixels_of_cell(row, col);
        if opened == u8::MAX {
            return false;
        }
        let points = cols.map(|col| ego.lattice.point(row as f32, col));
        let (xs, ys) = (points.map(|point| point.x), points.map(|point| point.y));
        let distances_m = map.distance_field().at_each(&xs, &ys);
        let is_below = |i: usize| opened >> i & 1 == 0 && distances_m[i] <= threshold_m;
        (0..CELL_PIXELS).any(is_below)
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
    /// The cells of each row of cells of which any pixel is set, bit = column.
    touched: [u32; GRID_CELLS],
}

const WORDS: usize = BEV_PIXELS.div_ceil(64);
const CELLS_PER_WORD: usize = 64 / CELL_PIXELS;

impl PixelRows {
    fn empty() -> Self {
        Self { bits: vec![[0; WORDS]; BEV_PIXELS], touched: [0; GRID_CELLS] }
    }

    fn set(&mut self, row: usize, first: usize, last: usize) {
        for (word, bits) in self.bits[row].iter_mut().enumerate() {
            let start = word * 64;
            if first < start + 64 && last >= start {
                let (low, high) = (first.max(start) - start, last.min(start + 63) - start);
                *bits |= (u64::MAX << low) & (u64::MAX >> (63 - high));
            }
        }
        self.touched[row / CELL_PIXELS] |= bits_between(first / CELL_PIXELS, last / CELL_PIXELS);
    }

    fn get(&self, row: usize, col: usize) -> bool {
        self.bits[row][col / 64] >> (col % 64) & 1 == 1
    }

    /// The pixels of a row of pixels in a column of cells.
    fn pixels_of_cell(&self, row: usize, cell_col: usize) -> u8 {
        (self.bits[row][cell_col / CELLS_PER_WORD] >> (cell_col % CELLS_PER_WORD * CELL_PIXELS)) as u8
    }

    /// The cells of a row of cells of which any pixel is set, bit = column.
    fn touched_cells(&self, row: usize) -> u32 {
        self.touched[row]
    }
}
