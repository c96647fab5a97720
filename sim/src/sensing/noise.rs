//! Perception errors (docs/methods.md 10). Errors belong to places: every layer but flicker and dropout, which are the
//! camera's, is anchored in the world and is a pure function of (seed, place, tick). A shadow stays where it is while the
//! car passes, whoever drives.
//!
//! The paper names the types (shadows, ragged boundaries, misrecognition); sizes and rates are chosen, and calibrated
//! so that about 98 % of the pixels are right (`cargo xtask pixel-accuracy`). In time
//! it is value noise where an AR(1) process per tick would do as well: it needs no state, so a frame can be
//! recomputed alone and every driver meets the same noise. (Only a dropped frame repeats the one before.)

mod layer;
pub(super) mod patch;
pub(super) mod shadow;
mod value;

pub use layer::Layer;

use crate::geometry::{Pose, Vec2, polygon_contains};
use crate::map::Map;
use crate::maths;
use crate::scenario::{KERB_MAX_M, NoiseLevel};
use crate::seed::{Rng, RootSeed, Stream};
use crate::vectors::{FourPoints, f32x4};
use patch::{Patch, Patches, Reads, Region};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};
use shadow::Shadow;
use value::{Lattice, VALUE_NOISE_MAX, hash, unit, value_noise};

/// Strength of each layer, relative to the calibrated level `paper`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseSettings {
    /// Multiplies every layer: 0 = clean, 1 = `paper`, 2 = `hard`.
    pub intensity: f32,
    /// Ragged boundaries: the signed distance is shifted (both signs).
    pub boundary: f32,
    /// Parts of shadows taken for obstacles (false occupied).
    pub shadow: f32,
    /// Edges of speed bumps taken for curbs (false occupied).
    pub speed_bump: f32,
    /// Ground behind a boundary taken for road (false free).
    pub false_free: f32,
    /// Misrecognised patches that come and go (mostly false occupied).
    pub blob: f32,
    /// Stains and paint (false occupied).
    pub stain: f32,
    /// Patches of one or two frames (false occupied).
    pub flicker: f32,
    /// Frames in which the last grid is repeated.
    pub dropout: f32,
}

impl NoiseSettings {
    /// All layers at one level.
    pub fn of(level: NoiseLevel) -> Self {
        let intensity = match level {
            NoiseLevel::Clean => 0.0,
            NoiseLevel::Paper => 1.0,
            NoiseLevel::Hard => 2.0,
        };
        Self {
            intensity,
            boundary: 1.0,
            shadow: 1.0,
            speed_bump: 1.0,
            false_free: 1.0,
            blob: 1.0,
            stain: 1.0,
            flicker: 1.0,
            dropout: 1.0,
        }
    }
}

// Constants of level `paper`, from the table of docs/methods.md 10 unless said otherwise. With the wobble and
// shadows first planned only 96.3 % of the pixels are right (`pixel-accuracy`, lot a, seed 1: wobble alone costs 1.9 %, shadows
// 1.5 %); both are halved here to meet the paper's 98 %.
/// Static boundary wobble: standard deviation and correlation length, metres.
const WOBBLE_STATIC: (f32, f32) = (0.05, 2.0);
/// Moving boundary wobble: standard deviation and correlation length, metres.
const WOBBLE_MOVING: (f32, f32) = (0.025, 1.0);
/// Correlation time of the moving wobble, ticks: AR(1) with ρ = 0.7 per tick decays to 1/e in 2.8 ticks.
const WOBBLE_TICKS: f32 = 3.0;
/// Wobble grows with range as 1 + X_bev / this, metres.
const WOBBLE_RANGE_M: f32 = 10.0;
/// Route per shadow, metres.
const SHADOW_SPACING_M: f32 = 24.0;
/// Share of a shadow's area taken for an obstacle.
const SHADOW_SHARE: f32 = 0.4;
/// Correlation time of a shadow's breathing, ticks (AR(1), ρ = 0.98).
const SHADOW_TICKS: f32 = 50.0;
/// Breathing of the shadow threshold, as a share of the shadow area.
const SHADOW_BREATH: f32 = 0.1;
/// Probability that a speed bump is misread in a run.
const BUMP_PROBABILITY: f32 = 0.7;
/// Route per false-free opening, metres.
const FALSE_FREE_SPACING_M: f32 = 45.0;
/// Blobs alive at a time per square metre of lane.
const BLOB_PER_M2: f32 = 0.01;
/// A blob lives one part in this many of the time.
const BLOB_PERIODS: f32 = 4.0;
/// Route per possible stain, metres, and the probability that it is misread.
const STAIN: (f32, f32) = (25.0, 0.2);
/// New flickers per frame.
const FLICKER_PER_TICK: f32 = 0.3;
/// Life of a flicker, ticks.
const FLICKER_TICKS: u32 = 2;
/// Probability that a frame repeats the last grid.
const DROPOUT_PER_TICK: f32 = 0.002;

/// The noise of one episode: latents drawn once, then a pure function of place and tick.
#[derive(Debug, Clone)]
pub struct NoiseField {
    seed: u64,
    wobble: f32,
    flicker: f32,
    dropout: f32,
    misread_as_occupied: Patches,
    misread_as_free: Patches,
    pub(super) shadows: Vec<Shadow>,
}

impl NoiseField {
    /// Draws the latents of an episode on a map. `cell_radius_m`: from the centre of a grid cell to its farthest pixel.
    pub(super) fn new(map: &Map, settings: &NoiseSettings, seed: RootSeed, cell_radius_m: f32) -> Self {
        let amount = |layer: f32| settings.intensity * layer;
        let mut field = Self {
            seed: seed.child(Stream::Sensor, 0).0,
            wobble: amount(settings.boundary),
            flicker: amount(settings.flicker),
            dropout: amount(settings.dropout),
            misread_as_occupied: Patches::default(),
            misread_as_free: Patches::default(),
            shadows: Vec::new(),
        };
        // One stream per layer: strengthening one layer never moves another.
        let rng = |layer: u64| seed.rng(Stream::Sensor, 1 + layer);
        field.cast_shadows(map, amount(settings.shadow), cell_radius_m, &mut rng(0));
        field.misread_speed_bumps(map, amount(settings.speed_bump), &mut rng(1));
        field.open_boundaries(map, amount(settings.false_free), &mut rng(2));
        field.scatter_blobs(map, amount(settings.blob), &mut rng(3));
        field.spill_stains(map, amount(settings.stain), &mut rng(4));
        field.misread_as_occupied.arrange();
        field.misread_as_free.arrange();
        field
    }

    /// The patches that look like something.
    pub(super) fn patches(&self, reads: Reads) -> &Patches {
        match reads {
            Reads::Occupied => &self.misread_as_occupied,
            Reads::Free => &self.misread_as_free,
        }
    }

    /// A sampler of the boundary wobble.
    pub(super) fn boundary_shift(&self) -> BoundaryShift {
        let (static_m, static_corr_m) = WOBBLE_STATIC;
        let (moving_m, moving_corr_m) = WOBBLE_MOVING;
        BoundaryShift {
            lasting: Lattice::new(self.seed, static_corr_m, self.wobble * static_m),
            moving: Lattice::new(self.seed ^ 7, moving_corr_m, self.wobble * moving_m),
        }
    }

    /// Bound of [`BoundaryShift::at_four`], metres. `growth`: [`wobble_growth`] there.
    #[inline]
    pub(super) fn boundary_shift_max_m(&self, growth: f32) -> f32 {
        self.wobble * (WOBBLE_STATIC.0 + WOBBLE_MOVING.0) * VALUE_NOISE_MAX * growth
    }

    /// Rank from which a shadow's pixels are misread at a tick.
    pub(super) fn shadow_threshold(&self, shadow: usize, tick: u32) -> u8 {
        let breath = value_noise(self.seed ^ (11 + shadow as u64), Vec2::ZERO, tick as f32 / SHADOW_TICKS);
        (255.0 * (1.0 - SHADOW_SHARE - SHADOW_BREATH * breath)).clamp(0.0, 255.0) as u8
    }

    /// The flicker visible at a tick, if any: a square in the ego frame as (centre, side). It belongs to the camera,
    /// not to a place: within its two frames the car moves at most 0.2 m.
    pub(super) fn flicker(&self, tick: u32, patch_near_m: f32, patch_side_m: f32) -> Option<(Vec2, f32)> {
        let window = (tick / FLICKER_TICKS) as i32;
        let draw = |k: i32| unit(hash(self.seed ^ 0xF11C, window, k, 0));
        if draw(0) >= self.flicker * FLICKER_PER_TICK * FLICKER_TICKS as f32 {
            return None;
        }
        let centre = Vec2::new(patch_near_m + draw(1) * patch_side_m, (draw(2) - 0.5) * patch_side_m);
        Some((centre, 0.3 + 0.3 * draw(3)))
    }

    /// Whether this frame repeats the last one.
    pub(super) fn drops_frame(&self, tick: u32) -> bool {
        unit(hash(self.seed ^ 0xD30F, tick as i32, 0, 0)) < self.dropout * DROPOUT_PER_TICK
    }

    /// Shadows of things beside the lane (cars, trees, buildings), 1.5–3 object heights long, along the sun.
    fn cast_shadows(&mut self, map: &Map, amount: f32, cell_radius_m: f32, rng: &mut Rng) {
        let sun_azimuth_rad = rng.random_range(-std::f32::consts::PI..std::f32::consts::PI);
        let away_from_sun = maths::unit(sun_azimuth_rad);
        along_route(map, SHADOW_SPACING_M, amount, rng, |place, rng| {
            let width_m = rng.random_range(1.5..4.0);
            let height_m: f32 = rng.random_range(1.4..2.5);
            let length_m = height_m * rng.random_range(1.5..3.0);
            // The caster stands beside the lane, on the side from which its shadow falls into the lane.
            let left = place.pose.ahead().perp();
            let side = if away_from_sun.dot(left) > 0.0 { -1.0 } else { 1.0 };
            let foot = place.pose.position() + left * side * (place.half_width_m + rng.random_range(0.0..1.0));
            let across = away_from_sun.perp() * (0.5 * width_m);
            let tip = foot + away_from_sun * length_m;
            let polygon = vec![foot - across, tip - 0.8 * across, tip + 0.8 * across, foot + across];
            self.shadows.push(Shadow::new(polygon, rng.random(), cell_radius_m));
        });
    }

    /// Two strips across the lane at the edges of each bump, with gaps.
    fn misread_speed_bumps(&mut self, map: &Map, amount: f32, rng: &mut Rng) {
        for bump in &map.scenario().speed_bumps {
            let is_misread = rng.random::<f32>() < BUMP_PROBABILITY * amount;
            let centre = Pose { x_m: bump.x_m, y_m: bump.y_m, heading_rad: bump.heading_deg.to_radians() };
            let pieces = (bump.width_m / 0.5).ceil();
            let piece_m = bump.width_m / pieces;
            for edge_m in [-0.5 * bump.length_m, 0.5 * bump.length_m] {
                let thickness_m = rng.random_range(0.15..0.25);
                for piece in 0..pieces as usize {
                    let is_gap = rng.random::<f32>() < 0.2;
                    let middle = Vec2::new(edge_m, -0.5 * bump.width_m + (piece as f32 + 0.5) * piece_m);
                    let pose = Pose::new(centre.world_from_ego().point(middle), centre.heading_rad);
                    if is_misread && !is_gap {
                        let strip = crate::geometry::rectangle(pose, thickness_m, piece_m);
                        self.misread_as_occupied.patches.push(Patch::lasting(Layer::SpeedBump, strip.to_vec()));
                    }
                }
            }
        }
    }

    /// Opens sections of the boundary, 3–8 m long and 1–3 m deep including the line; shorter and shallower where real
    /// objects stand behind it, because those are seen.
    fn open_boundaries(&mut self, map: &Map, amount: f32, rng: &mut Rng) {
        along_route(map, FALSE_FREE_SPACING_M, amount, rng, |place, rng| {
            let side = if rng.random::<bool>() { 1.0 } else { -1.0 };
            let (length_m, depth_m): (f32, f32) = (rng.random_range(3.0..8.0), rng.random_range(1.0..3.0));
            let across = place.pose.ahead().perp() * side;
            let point = |along_m: f32, y_m: f32| place.pose.position() + place.pose.ahead() * along_m + across * y_m;
            let line_m = (0..60).map(|i| 0.1 * i as f32).find(|&y_m| map.signed_distance_m(point(0.0, y_m)) <= 0.0);
            let Some(line_m) = line_m else { return };
            for share in [1.0, 0.7, 0.5, 0.35] {
                // From just inside the line outwards, shorter at its back (rounded ends).
                let (near_m, far_m) = (line_m - 0.1, line_m + share * depth_m);
                let corners = [(-0.5, near_m), (0.5, near_m), (0.35, far_m), (-0.35, far_m)];
                let polygon = corners.map(|(along, y_m)| point(along * share * length_m, y_m)).to_vec();
                if is_empty_ground(map, &polygon) {
                    self.misread_as_free.patches.push(Patch::lasting(Layer::FalseFree, polygon));
                    return;
                }
            }
        });
    }

    /// Convex blobs of 0.3–1.0 m (at most 15 % of the lane width at level `paper`) that live 40…80 control ticks (2…4 s at
    /// 50 ms) and come back later.
    fn scatter_blobs(&mut self, map: &Map, amount: f32, rng: &mut Rng) {
        const LANE_M: f32 = 4.0;
        let spacing_m = 1.0 / (BLOB_PER_M2 * LANE_M * BLOB_PERIODS);
        along_route(map, spacing_m, amount, rng, |place, rng| {
            let lateral_m = rng.random_range(-1.0..1.0) * place.half_width_m;
            let centre = place.pose.world_from_ego().point(Vec2::new(0.0, lateral_m));
            let size_max_m = (0.15 * 2.0 * place.half_width_m * amount).max(0.3);
            let size_m = rng.random_range(0.3..1.0_f32).min(size_max_m);
            let corners = rng.random_range(5..=8);
            let turn = rng.random::<f32>();
            let polygon = (0..corners)
                .map(|k| std::f32::consts::TAU * (k as f32 + turn) / corners as f32)
                .map(|angle_rad| centre + 0.5 * size_m * maths::unit(angle_rad))
                .collect();
            let is_occupied = rng.random::<f32>() < 0.8;
            let life_ticks = rng.random_range(40..80);
            let period_ticks = (life_ticks as f32 * BLOB_PERIODS) as u32;
            let phase_ticks = rng.random_range(0..period_ticks);
            let patches = if is_occupied { &mut self.misread_as_occupied } else { &mut self.misread_as_free };
            let lasting = Patch::lasting(Layer::Blob, polygon);
            patches.patches.push(Patch { period_ticks, phase_ticks, life_ticks, ..lasting });
        });
    }

    /// Thin strokes, 0.1–0.2 m wide.
    fn spill_stains(&mut self, map: &Map, amount: f32, rng: &mut Rng) {
        let (spacing_m, probability) = STAIN;
        along_route(map, spacing_m, probability * amount, rng, |place, rng| {
            let lateral_m = rng.random_range(-0.8..0.8) * place.half_width_m;
            let centre = place.pose.world_from_ego().point(Vec2::new(0.0, lateral_m));
            let heading_rad = place.pose.heading_rad + rng.random_range(-0.6..0.6);
            let (length_m, width_m) = (rng.random_range(0.8..2.0), rng.random_range(0.1..0.2));
            let stroke = crate::geometry::rectangle(Pose::new(centre, heading_rad), length_m, width_m);
            self.misread_as_occupied.patches.push(Patch::lasting(Layer::Stain, stroke.to_vec()));
        });
    }
}

/// Whether nothing solid stands on a convex quadrilateral: no obstacle, and no island or ground outside of the boundary
/// that is higher than a kerb.
fn is_empty_ground(map: &Map, polygon: &[Vec2]) -> bool {
    const SAMPLES: usize = 12;
    let region = Region::new(polygon.to_vec());
    let near = map.occluders_near(region.centre, region.radius_m);
    let obstacles: Vec<_> = near.filter(|occluder| !occluder.is_wall()).collect();
    let scenario = map.scenario();
    let is_solid = |sample: Vec2| {
        obstacles.iter().any(|obstacle| polygon_contains(&obstacle.outline, sample))
            || scenario.boundary_height_m > KERB_MAX_M && !polygon_contains(&scenario.boundary, sample)
            || map.signed_distance_m(sample) <= 0.0
                && scenario
                    .islands
                    .iter()
                    .any(|island| island.height_m > KERB_MAX_M && polygon_contains(&island.polygon, sample))
    };
    (0..SAMPLES * SAMPLES).all(|i| {
        let (a, b) = ((i % SAMPLES) as f32, (i / SAMPLES) as f32);
        let (a, b) = (a / (SAMPLES - 1) as f32, b / (SAMPLES - 1) as f32);
        !is_solid(polygon[0].lerp(polygon[1], a).lerp(polygon[3].lerp(polygon[2], a), b))
    })
}

/// The boundary wobble around one view. What it has drawn is kept for the next view, which shares most of it.
#[derive(Debug, Clone)]
pub(super) struct BoundaryShift {
    lasting: Lattice,
    moving: Lattice,
}

impl BoundaryShift {
    /// Turns to a circle of the world at a tick; [`Self::at_four`] answers inside of it.
    pub(super) fn look_at(&mut self, centre: Vec2, radius_m: f32, tick: u32) {
        self.lasting.look_at(centre, radius_m, 0.0);
        self.moving.look_at(centre, radius_m, tick as f32 / WOBBLE_TICKS);
    }

    /// Shifts of the signed distance at four places, metres. `growth`: [`wobble_growth`] there.
    #[inline]
    pub(super) fn at_four(&self, places: FourPoints, growth: f32x4) -> f32x4 {
        (self.lasting.at_four(places) + self.moving.at_four(places)) * growth
    }
}

/// How much larger the wobble is at a distance from the patch's lower edge.
#[inline]
pub(super) fn wobble_growth(ahead_of_patch_m: f32) -> f32 {
    1.0 + ahead_of_patch_m / WOBBLE_RANGE_M
}

/// A place on the route and the free half-width there.
struct Place {
    pose: Pose,
    half_width_m: f32,
}

/// Calls `draw` at random places of the route, on average `amount` per `spacing_m`. The ground beyond start and finish
/// belongs to it, because it is seen.
fn along_route(map: &Map, spacing_m: f32, amount: f32, rng: &mut Rng, mut draw: impl FnMut(&Place, &mut Rng)) {
    const BEYOND_M: f32 = 15.0;
    let path_m = map.path().length_m();
    let expected = amount * (path_m + 2.0 * BEYOND_M) / spacing_m;
    let count = expected.floor() as usize + usize::from(rng.random::<f32>() < expected.fract());
    for _ in 0..count {
        let s_m = rng.random_range(-BEYOND_M..path_m + BEYOND_M);
        let on_path = map.path().pose_at(s_m);
        let beyond_m = s_m - s_m.clamp(0.0, path_m);
        let pose = Pose::new(on_path.position() + on_path.ahead() * beyond_m, on_path.heading_rad);
        let half_width_m = map.signed_distance_m(pose.position()).max(1.0);
        draw(&Place { pose, half_width_m }, rng);
    }
}
