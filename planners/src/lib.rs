//! The paper's opponents: planners that answer the same noisy grid with a formula (methods.md 6 and 7).
//!
//! | file | family | method | did the paper run it? |
//! |---|---|---|---|
//! | [`tentacle`] | candidate paths | clothoid tentacles (Mouhagir 2019), arcs of von Hundelshausen 2008 | yes |
//! | [`vvf`] | field | velocity vector field: repulsion plus a wish to go forward | yes |
//! | [`dwa`] | candidate paths | dynamic window approach (Fox 1997) | no |
//! | [`cvm`] | candidate paths | curvature velocity method (Simmons 1996) | no |
//! | [`apf`] | field | artificial potential field (Khatib; Ge and Cui 2000) | no |
//! | [`vff`] | field | virtual force field (Borenstein and Koren) | no |
//!
//! They choose a steering angle; the controller drives it with the paper's law for planners, slower when steering more.
//! None has a global path, so where a method wants a goal it gets "straight ahead" or what the grid suggests
//! ([`Goal`]).
//!
//! Tags in the documentation of parameters, as in methods.md: *paper* = stated there, *cited* = read in the cited work
//! or the authors' code, *derived* = arithmetic from those, *recalled* = from the cited work from memory, *chosen* =
//! stated nowhere.
//!
//! What all files share is below: the car they are installed in, distances on the grid, the walk along a field.

pub mod apf;
pub mod cvm;
pub mod dwa;
pub mod explanation;
pub mod search;
pub mod tentacle;
pub mod vff;
pub mod vvf;

use search::Dimension;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};
use sim::controller::{self, ControllerSettings};
use sim::driver::{Decision, LookAheadPoint, Policy, Source};
use sim::episode::EpisodeSettings;
use sim::geometry::{Pose, Vec2};
use sim::sensing::{GRID_CELLS, GridGeometry, Observation, OccupancyGrid};
use sim::vehicle::VehicleSettings;

/// The car a planner is installed in: what it may know besides the grid.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannerContext {
    /// Dimensions and limits.
    pub vehicle: VehicleSettings,
    /// Where the grid lies.
    pub geometry: GridGeometry,
    /// What becomes of an answer.
    pub controller: ControllerSettings,
    /// Between two answers, seconds.
    pub control_period_s: f32,
}

impl PlannerContext {
    /// The car of an episode.
    pub fn of(settings: &EpisodeSettings) -> Self {
        Self {
            vehicle: settings.vehicle.clone(),
            geometry: settings.sensing.geometry,
            controller: settings.controller.clone(),
            control_period_s: settings.control_period_s(),
        }
    }

    /// The middle of the front bumper, ego frame.
    fn bumper(&self) -> Vec2 {
        Vec2::new(self.vehicle.front_m(), 0.0)
    }

    /// Road-wheel angle of an arc of the rear axle, radians.
    fn steering_rad(&self, curvature_per_m: f32) -> f32 {
        (curvature_per_m * self.vehicle.wheelbase_m).atan()
    }

    /// Arc of the rear axle of a road-wheel angle, 1/m.
    fn curvature_per_m(&self, steering_rad: f32) -> f32 {
        steering_rad.tan() / self.vehicle.wheelbase_m
    }

    /// What the controller would drive an arc with, m/s.
    fn speed_mps(&self, curvature_per_m: f32) -> f32 {
        controller::pursue(&self.controller, &self.vehicle, &self.geometry, &steer_along(curvature_per_m)).speed_mps
    }
}

/// Travel along an arc at which it is answered with a point, metres. Pure pursuit drives the same arc for any value;
/// here the point is ahead of the axle at every curvature a car can drive.
const POINT_ON_ARC_M: f32 = 6.0;

/// Answers with an arc of the rear axle.
fn steer_along(curvature_per_m: f32) -> Decision {
    head_for(Pose::default().advanced_along_arc(curvature_per_m, POINT_ON_ARC_M).position())
}

/// Answers with a point, ego frame.
fn head_for(point: Vec2) -> Decision {
    let look_ahead = LookAheadPoint { ahead_m: point.x, left_m: point.y };
    Decision { look_ahead, source: Source::Planner, spread: None }
}

/// Where the wheels probably stand. No planner is shown the wheel angle; it knows what it asked for and how fast the
/// wheels turn. The dead time (1.2 ticks) is not modelled.
#[derive(Debug, Clone, Copy)]
struct WheelEstimate {
    steering_rad: f32,
    command_rad: f32,
    rate_rad_per_tick: f32,
}

impl WheelEstimate {
    fn new(rig: &PlannerContext) -> Self {
        let rate_rad_per_tick = rig.vehicle.steering_rate_max_radps * rig.control_period_s;
        Self { steering_rad: 0.0, command_rad: 0.0, rate_rad_per_tick }
    }

    /// The angle one control period after the last command, radians.
    fn advance(&mut self) -> f32 {
        let (low, high) = (self.steering_rad - self.rate_rad_per_tick, self.steering_rad + self.rate_rad_per_tick);
        self.steering_rad = self.command_rad.clamp(low, high);
        self.steering_rad
    }

    /// Straight wheels, as after a reset.
    fn reset(&mut self) {
        (self.steering_rad, self.command_rad) = (0.0, 0.0);
    }
}

/// The nearest occupied cell as seen from a point.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Nearest {
    /// From the point to the square of the cell, metres; 0 inside.
    distance_m: f32,
    /// Unit vector from the cell to the point: the gradient of the distance. Between two cells equally near it is their
    /// mean, so that opposite sides cancel; zero inside a cell.
    away: Vec2,
}

/// The nearest occupied cell within `range_m` of an ego point. Exact: in each row only the first occupied cell on either
/// side can be nearest.
fn nearest_occupied(grid: &OccupancyGrid, geometry: &GridGeometry, point: Vec2, range_m: f32) -> Option<Nearest> {
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

/// Khatib's repulsion (1/ρ − 1/ρ₀)/ρ² at distance ρ, 0 beyond the range ρ₀: the slope of ½(1/ρ − 1/ρ₀)².
fn khatib_repulsion(distance_m: f32, range_m: f32) -> f32 {
    if distance_m >= range_m { 0.0 } else { (1.0 / distance_m - 1.0 / range_m) / (distance_m * distance_m) }
}

/// Half a cell: nearer than that, the grid says nothing about distances (methods.md 7.1).
const DISTANCE_FLOOR_M: f32 = 0.24;
/// One step of the walk along a field, metres (methods.md 7.1, *chosen*).
const WALK_STEP_M: f32 = 0.10;
/// A walk ends this far before an occupied cell, metres (methods.md 7.1, *chosen*).
const WALK_STOPS_M: f32 = 0.2;
/// The look-ahead point that a walk ends with lies at least this far ahead of the rear axle, metres (methods.md 7.1,
/// *chosen*).
const WALK_AHEAD_MIN_M: f32 = 2.3;
/// A field weaker than this has no direction: the walk goes forward (methods.md 7.1, *chosen*).
const FIELD_MIN: f32 = 0.05;

/// "The look-ahead point is searched by descending along the gradient of the field's direction from the front of the
/// vehicle" (paper). Steps along the direction of `field(point, nearest occupied cell within range_m)` for `length_m`
/// at most; ends before it would leave the patch ahead or sideways, fall behind the rear axle or come too near to an
/// occupied cell. It may fall behind the bumper: a wall just ahead pushes it back and aside, and a walk that ended there
/// would answer "straight on", into the wall.
fn walk_along_field(
    grid: &OccupancyGrid,
    rig: &PlannerContext,
    range_m: f32,
    length_m: f32,
    field: impl Fn(Vec2, Option<Nearest>) -> Vec2,
) -> Vec2 {
    let half_m = 0.5 * rig.geometry.side_m;
    let mut point = rig.bumper();
    for _ in 0..(length_m / WALK_STEP_M).round() as u32 {
        let force = field(point, nearest_occupied(grid, &rig.geometry, point, range_m));
        let direction = if force.length() < FIELD_MIN { Vec2::X } else { force.normalize_or(Vec2::X) };
        let next = point + WALK_STEP_M * direction;
        let is_outside = next.x < 0.0 || next.x > rig.geometry.far_edge_ahead_m() || next.y.abs() > half_m;
        if is_outside || nearest_occupied(grid, &rig.geometry, next, WALK_STOPS_M).is_some() {
            break;
        }
        point = next;
    }
    point
}

/// Where a method that wants a goal is told to go. There is no global path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Goal {
    /// The middle of the far edge of the patch: "so that the vehicle could drive forward" (paper, of the velocity field).
    #[default]
    Ahead,
    /// The end of the longest free line of sight from the front bumper.
    FarthestVisible,
}

impl Goal {
    const OPTIONS: [Self; 2] = [Self::Ahead, Self::FarthestVisible];

    fn from_index(index: f32) -> Self {
        Self::OPTIONS[index as usize]
    }
}

/// Lines of sight from the front bumper, from 90° right to 90° left.
#[derive(Debug, Clone)]
struct Sight {
    /// Nearest to straight ahead first, so that the first of several equally long lines wins.
    rays: Vec<Ray>,
    ahead: Vec2,
}

#[derive(Debug, Clone)]
struct Ray {
    /// Points every [`RAY_STEP_M`] and the row and column they lie in; those before the patch are left out.
    points: Vec<(Vec2, usize, usize)>,
}

/// Between two points of a line of sight, metres: half a cell.
const RAY_STEP_M: f32 = 0.24;
/// Lines of sight to each side: every 3°.
const RAYS_PER_SIDE: i32 = 30;

impl Sight {
    fn new(rig: &PlannerContext) -> Self {
        let geometry = &rig.geometry;
        let ray = |bearing_rad: f32| {
            let direction = Vec2::from_angle(bearing_rad);
            let points = (1..)
                .map(|step| rig.bumper() + step as f32 * RAY_STEP_M * direction)
                .skip_while(|point| point.x < geometry.near_edge_ahead_m && point.y.abs() <= 0.5 * geometry.side_m)
                .map_while(|point| cell_of(geometry, point).map(|(row, col)| (point, row, col)))
                .collect();
            Ray { points }
        };
        let bearings = (0..=RAYS_PER_SIDE).flat_map(|step| if step == 0 { vec![0] } else { vec![step, -step] });
        let per_step = std::f32::consts::FRAC_PI_2 / RAYS_PER_SIDE as f32;
        let rays = bearings.map(|step| ray(step as f32 * per_step)).collect();
        Self { rays, ahead: Vec2::new(geometry.far_edge_ahead_m(), 0.0) }
    }

    /// The goal in the ego frame.
    fn goal(&self, goal: Goal, grid: &OccupancyGrid) -> Vec2 {
        match goal {
            Goal::Ahead => self.ahead,
            Goal::FarthestVisible => {
                let (mut longest, mut end) = (0, self.ahead);
                for ray in &self.rays {
                    let free = ray.points.iter().take_while(|(_, row, col)| !grid.is_occupied(*row, *col));
                    if let Some((steps, (point, ..))) = free.enumerate().last().filter(|(steps, _)| steps + 1 > longest)
                    {
                        (longest, end) = (steps + 1, *point);
                    }
                }
                end
            }
        }
    }
}

/// Row and column of an ego point; `None` outside the patch.
fn cell_of(geometry: &GridGeometry, point: Vec2) -> Option<(usize, usize)> {
    geometry.contains(point).then(|| {
        let cell = |metres: f32| ((metres / geometry.cell_m()) as usize).min(GRID_CELLS - 1);
        (cell(geometry.far_edge_ahead_m() - point.x), cell(0.5 * geometry.side_m - point.y))
    })
}

/// Curvatures from −max to max, `2 · side + 1` of them, dense near zero: κ_k = κ_max·sgn(k)(|k|/side)^power.
fn spread_curvatures(side: i32, max_per_m: f32, power: f32) -> Vec<f32> {
    let share = |k: i32| (k.abs() as f32 / side as f32).powf(power);
    (-side..=side).map(|k| k.signum() as f32 * max_per_m * share(k)).collect()
}

/// Parameters of a planner, and the planner they make.
pub trait Method: Clone + std::fmt::Debug + PartialEq + Serialize + DeserializeOwned + 'static {
    /// As named on the command line.
    const NAME: &'static str;
    /// One line.
    const ABOUT: &'static str;
    /// What the tuner varies, and how far.
    const SEARCH: &'static [Dimension<Self>];
    /// What sits at the wheel.
    type Planner: Policy + Clone + Send + Sync;

    /// The paper's values where it ran the method, the literature's otherwise.
    fn paper() -> Self;

    /// Whether a planner can be made of these.
    ///
    /// # Errors
    /// Naming the parameter that is out of range.
    fn check(&self) -> Result<(), String>;

    /// A planner for a car.
    fn planner(&self, rig: &PlannerContext) -> Self::Planner;
}

/// Writes a number as people would: TOML's floats are f64, and 2.3 as f32 is 2.299999952316284 as f64.
fn shorten(value: &mut toml::Value) {
    if let toml::Value::Float(number) = value
        && let Ok(short) = (*number as f32).to_string().parse()
    {
        *number = short;
    }
}

/// `Err` unless a parameter lies within its range.
fn within(name: &str, value: f32, low: f32, high: f32) -> Result<(), String> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(format!("{name} = {value}: choose {low} to {high}")) }
}

macro_rules! baselines {
    ($($variant:ident $module:ident,)*) => {
        /// A baseline with its parameters.
        #[derive(Debug, Clone, PartialEq)]
        pub enum Baseline {
            $(#[doc = concat!("See [`", stringify!($module), "`].")] $variant($module::Params),)*
        }

        /// A baseline at the wheel.
        #[derive(Debug, Clone)]
        pub enum Planner {
            $(#[doc = concat!("See [`", stringify!($module), "`].")] $variant(<$module::Params as Method>::Planner),)*
        }

        impl Baseline {
            /// Every baseline with the paper's or the literature's parameters.
            pub fn all() -> Vec<Self> {
                vec![$(Self::$variant($module::Params::paper()),)*]
            }

            /// As named on the command line.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$variant(_) => <$module::Params as Method>::NAME,)* }
            }

            /// One line.
            pub fn about(&self) -> &'static str {
                match self { $(Self::$variant(_) => <$module::Params as Method>::ABOUT,)* }
            }

            /// Whether a planner can be made of these parameters.
            ///
            /// # Errors
            /// Naming the parameter that is out of range.
            pub fn check(&self) -> Result<(), String> {
                match self { $(Self::$variant(params) => params.check(),)* }
            }

            /// A planner for a car. Making one takes milliseconds (tables); clones share them.
            pub fn planner(&self, rig: &PlannerContext) -> Planner {
                match self { $(Self::$variant(params) => Planner::$variant(params.planner(rig)),)* }
            }

            /// The same method with parameters from a file, all of them and no others; not checked for range.
            ///
            /// # Errors
            /// If one is missing, unknown or of another type.
            pub fn with_parameters<'de, D: Deserializer<'de>>(&self, parameters: D) -> Result<Self, D::Error> {
                match self {
                    $(Self::$variant(_) => $module::Params::deserialize(parameters).map(Self::$variant),)*
                }
            }

            /// The parameters as TOML.
            ///
            /// # Panics
            /// Never: parameters are plain values.
            pub fn parameters(&self) -> toml::Table {
                let table = match self { $(Self::$variant(params) => toml::Table::try_from(params),)* };
                let mut table = table.expect("parameters are plain values");
                table.iter_mut().for_each(|(_, value)| shorten(value));
                table
            }

            /// Names and spans of what the tuner varies.
            pub fn search_space(&self) -> Vec<(&'static str, search::Span)> {
                match self {
                    $(Self::$variant(_) => $module::Params::SEARCH.iter().map(|d| (d.name, d.span)).collect(),)*
                }
            }

            /// Where these parameters lie in the search space, 0…1 per dimension.
            pub fn to_unit_cube(&self) -> Vec<f32> {
                match self {
                    $(Self::$variant(params) => {
                        $module::Params::SEARCH.iter().map(|d| d.span.to_unit((d.get)(params))).collect()
                    })*
                }
            }

            /// These parameters, those that the tuner varies moved to a point of the search space.
            ///
            /// # Panics
            /// If the point has another dimension.
            #[must_use]
            pub fn at(&self, unit_cube: &[f32]) -> Self {
                match self {
                    $(Self::$variant(params) => {
                        let mut params = params.clone();
                        assert_eq!(unit_cube.len(), $module::Params::SEARCH.len(), "one coordinate per dimension");
                        for (dimension, &unit) in $module::Params::SEARCH.iter().zip(unit_cube) {
                            (dimension.set)(&mut params, dimension.span.from_unit(unit));
                        }
                        Self::$variant(params)
                    })*
                }
            }
        }

        impl Policy for Planner {
            fn act(&mut self, observation: &Observation) -> Decision {
                match self { $(Self::$variant(planner) => planner.act(observation),)* }
            }

            fn reset(&mut self) {
                match self { $(Self::$variant(planner) => planner.reset(),)* }
            }
        }
    };
}

baselines! {
    Tentacle tentacle,
    Vvf vvf,
    Dwa dwa,
    Cvm cvm,
    Apf apf,
    Vff vff,
}

#[cfg(test)]
mod tests;
