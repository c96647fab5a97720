//! What a lot consists of: plain data that serialises to TOML, nothing derived.
//!
//! Metres and degrees, because people write these files by hand; everything behind [`crate::map::Map::build`] is in
//! radians. Unknown keys are refused.

use crate::geometry::{Pose, Vec2};
use crate::maths;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// A parking lot with obstacles and the route to be driven.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name used in tables and file names.
    pub name: String,
    /// Outline of the drivable ground, world metres, either winding. Everything outside is non-drivable.
    pub boundary: Vec<Vec2>,
    /// Height of what stands along the boundary, metres: above [`KERB_MAX_M`] it hides the drivable ground behind it.
    #[serde(default, skip_serializing_if = "is_flat")]
    pub boundary_height_m: f32,
    /// Route of the rear axle, from start to finish. Used by metrics and resets, never shown to a policy.
    pub reference_path: ReferencePath,
    /// Sensor noise of this lot; the command line may override the level.
    #[serde(default)]
    pub noise: LotNoise,
    /// Non-drivable areas inside the boundary.
    #[serde(default, rename = "island", skip_serializing_if = "Vec::is_empty")]
    pub islands: Vec<Island>,
    /// Solid objects.
    #[serde(default, rename = "obstacle", skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<Obstacle>,
    /// Speed bumps: drivable, but their edges can fool the perception.
    #[serde(default, rename = "speed_bump", skip_serializing_if = "Vec::is_empty")]
    pub speed_bumps: Vec<SpeedBump>,
}

/// Islands and boundaries up to this height are kerbs and hide nothing, metres; higher ones are walls.
pub const KERB_MAX_M: f32 = 0.15;

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_flat(height_m: &f32) -> bool {
    *height_m == 0.0
}

/// A raised area inside the boundary: planted island, kerbed median.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Island {
    /// Outline, world metres.
    pub polygon: Vec<Vec2>,
    /// Height above ground, metres: above [`KERB_MAX_M`] it hides the ground behind it.
    #[serde(default = "Island::default_height_m")]
    pub height_m: f32,
}

impl Island {
    fn default_height_m() -> f32 {
        KERB_MAX_M
    }
}

/// The route of the rear axle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReferencePath {
    /// Polyline, world metres, from start to finish.
    pub points: Vec<Vec2>,
    /// Radius with which interior vertices are rounded, metres (0 = as given).
    #[serde(default)]
    pub corner_radius_m: f32,
}

/// A solid object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Obstacle {
    /// What it is.
    pub class: ObstacleClass,
    /// World x of the centre, metres.
    pub x_m: f32,
    /// World y of the centre, metres.
    pub y_m: f32,
    /// Heading of the length axis, degrees counter-clockwise from world x.
    #[serde(default)]
    pub heading_deg: f32,
    /// Length (diameter if the class is round), metres. Defaults to the class's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length_m: Option<f32>,
    /// Width (ignored if the class is round), metres. Defaults to the class's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width_m: Option<f32>,
    /// Height above ground, metres. Defaults to the class's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f32>,
}

impl Obstacle {
    /// An obstacle of its class's default size.
    pub fn new(class: ObstacleClass, centre: Pose) -> Self {
        Self {
            class,
            x_m: centre.x_m,
            y_m: centre.y_m,
            heading_deg: centre.heading_rad.to_degrees(),
            length_m: None,
            width_m: None,
            height_m: None,
        }
    }

    /// Pose of the centre.
    pub fn centre(&self) -> Pose {
        Pose { x_m: self.x_m, y_m: self.y_m, heading_rad: self.heading_deg.to_radians() }
    }

    /// `[length, width, height]` in metres, the class's defaults filled in.
    pub fn size_m(&self) -> [f32; 3] {
        let [length, width, height] = self.class.default_size_m();
        let length = self.length_m.unwrap_or(length);
        let width = if self.class.is_round() { length } else { self.width_m.unwrap_or(width) };
        [length, width, self.height_m.unwrap_or(height)]
    }

    /// Convex outline in the world, counter-clockwise. Round classes are circumscribed octagons.
    pub fn outline(&self) -> Vec<Vec2> {
        let [length, width, _] = self.size_m();
        let centre = self.centre();
        if self.class.is_round() {
            let radius_m = 0.5 * length / maths::cos(std::f32::consts::PI / 8.0);
            return (0..8)
                .map(|k| {
                    centre.position()
                        + radius_m * maths::unit(centre.heading_rad + k as f32 * std::f32::consts::FRAC_PI_4)
                })
                .collect();
        }
        crate::geometry::rectangle(centre, length, width).to_vec()
    }
}

/// What an obstacle is: decides its default size, its colour in pictures and its group in statistics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "the names say it")]
pub enum ObstacleClass {
    Sedan,
    Suv,
    Compact,
    Van,
    Truck,
    Cone,
    Bollard,
    Curb,
    WheelStop,
    Pillar,
    Cart,
    Person,
    Wall,
}

impl ObstacleClass {
    /// Every class, in the order of declaration.
    pub const ALL: [Self; 13] = [
        Self::Sedan,
        Self::Suv,
        Self::Compact,
        Self::Van,
        Self::Truck,
        Self::Cone,
        Self::Bollard,
        Self::Curb,
        Self::WheelStop,
        Self::Pillar,
        Self::Cart,
        Self::Person,
        Self::Wall,
    ];

    /// Typical `[length, width, height]` in metres (docs/methods.md 11).
    pub fn default_size_m(self) -> [f32; 3] {
        match self {
            Self::Sedan => [4.70, 1.85, 1.45],
            Self::Suv => [4.70, 1.90, 1.70],
            Self::Compact => [3.60, 1.60, 1.50],
            Self::Van => [5.15, 1.92, 1.95],
            Self::Truck => [5.12, 1.74, 1.97],
            Self::Cone => [0.40, 0.40, 0.70],
            Self::Bollard => [0.15, 0.15, 0.90],
            Self::Curb => [2.00, 0.20, 0.15],
            Self::WheelStop => [0.75, 0.15, 0.10],
            Self::Pillar => [0.70, 0.70, 3.00],
            Self::Cart => [1.00, 0.60, 1.00],
            Self::Person => [0.50, 0.50, 1.70],
            Self::Wall => [5.00, 0.20, 3.00],
        }
    }

    /// Round objects have a diameter instead of length and width.
    pub fn is_round(self) -> bool {
        matches!(self, Self::Cone | Self::Bollard | Self::Person)
    }

    /// Cars and trucks of any kind.
    pub fn is_vehicle(self) -> bool {
        matches!(self, Self::Sedan | Self::Suv | Self::Compact | Self::Van | Self::Truck)
    }
}

/// A speed bump: a drivable strip across the lane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpeedBump {
    /// World x of the centre, metres.
    pub x_m: f32,
    /// World y of the centre, metres.
    pub y_m: f32,
    /// Direction of travel across the bump, degrees.
    #[serde(default)]
    pub heading_deg: f32,
    /// Extent along the direction of travel, metres.
    pub length_m: f32,
    /// Extent across the lane, metres.
    pub width_m: f32,
}

/// How far the perceived scene is from the true one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, PartialOrd, Ord)]
#[serde(rename_all = "snake_case")]
pub enum NoiseLevel {
    /// The clean view.
    Clean,
    /// About 98 % of the pixels right, as the paper's perception network.
    #[default]
    Paper,
    /// Twice the errors of `paper`.
    Hard,
}

/// Sensor noise of a lot.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LotNoise {
    /// Overall level.
    #[serde(default)]
    pub level: NoiseLevel,
}

impl Scenario {
    /// An empty lot: its boundary, and a route whose corners are not rounded. World metres.
    ///
    /// ```
    /// # use sim::{geometry::Pose, scenario::{Obstacle, ObstacleClass, Scenario}};
    /// let yard = Scenario::new("yard", [(0.0, 0.0), (40.0, 0.0), (40.0, 20.0), (0.0, 20.0)], [(5.0, 10.0), (30.0, 10.0)])
    ///     .with_obstacles([Obstacle::new(ObstacleClass::Cone, Pose { x_m: 20.0, y_m: 12.0, heading_rad: 0.0 })]);
    /// assert_eq!(yard.obstacles.len(), 1);
    /// ```
    pub fn new<P: Into<Vec2>, Q: Into<Vec2>>(
        name: impl Into<String>,
        boundary: impl IntoIterator<Item = P>,
        route: impl IntoIterator<Item = Q>,
    ) -> Self {
        Self {
            name: name.into(),
            boundary: boundary.into_iter().map(Into::into).collect(),
            boundary_height_m: 0.0,
            reference_path: ReferencePath { points: route.into_iter().map(Into::into).collect(), corner_radius_m: 0.0 },
            noise: LotNoise::default(),
            islands: Vec::new(),
            obstacles: Vec::new(),
            speed_bumps: Vec::new(),
        }
    }

    /// A straight lane along world x with its middle on y = 0, and a route along the middle. Ranges of x, metres.
    pub fn lane(x_m: RangeInclusive<f32>, width_m: f32, route_m: RangeInclusive<f32>) -> Self {
        let (from, to, half) = (*x_m.start(), *x_m.end(), 0.5 * width_m);
        let boundary = [(from, -half), (to, -half), (to, half), (from, half)];
        Self::new("lane", boundary, [(*route_m.start(), 0.0), (*route_m.end(), 0.0)])
    }

    /// The same lot with the corners of the route rounded.
    #[must_use]
    pub fn with_corner_radius_m(mut self, corner_radius_m: f32) -> Self {
        self.reference_path.corner_radius_m = corner_radius_m;
        self
    }

    /// The same lot with more obstacles.
    #[must_use]
    pub fn with_obstacles(mut self, obstacles: impl IntoIterator<Item = Obstacle>) -> Self {
        self.obstacles.extend(obstacles);
        self
    }

    /// The same lot with more speed bumps.
    #[must_use]
    pub fn with_speed_bumps(mut self, speed_bumps: impl IntoIterator<Item = SpeedBump>) -> Self {
        self.speed_bumps.extend(speed_bumps);
        self
    }

    /// The same lot driven from finish to start.
    #[must_use]
    pub fn reversed(mut self) -> Self {
        self.reference_path.points.reverse();
        self
    }
}

/// Which way a lot is driven.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// From start to finish.
    Forward,
    /// From finish to start.
    Reverse,
}

impl Direction {
    /// Both, forward first.
    pub const BOTH: [Self; 2] = [Self::Forward, Self::Reverse];

    /// `forward` or `reverse`, as in settings, tables and replay keys.
    pub fn name(self) -> &'static str {
        match self {
            Self::Forward => "forward",
            Self::Reverse => "reverse",
        }
    }

    /// The scenario as driven in this direction.
    pub fn of(self, scenario: Scenario) -> Scenario {
        match self {
            Self::Forward => scenario,
            Self::Reverse => scenario.reversed(),
        }
    }
}

/// What is wrong with a scenario, where, and what to do about it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{place}: {problem}; {remedy}")]
pub struct ScenarioError {
    /// The element at fault.
    pub place: Place,
    /// What is wrong with it, naming the value.
    pub problem: String,
    /// What would make it right.
    pub remedy: String,
}

/// An element of a scenario file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// `name`.
    Name,
    /// `boundary`, and the vertex where one is at fault.
    Boundary(Option<usize>),
    /// `[[island]]` number n, counted from 0.
    Island(usize),
    /// `[[obstacle]]` number n, counted from 0.
    Obstacle(usize),
    /// `[[speed_bump]]` number n, counted from 0.
    SpeedBump(usize),
    /// `[reference_path]`, and the point where one is at fault.
    ReferencePath(Option<usize>),
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Name => write!(f, "name"),
            Self::Boundary(None) => write!(f, "boundary"),
            Self::Boundary(Some(i)) => write!(f, "boundary, vertex {}", i + 1),
            Self::Island(i) => write!(f, "island {}", i + 1),
            Self::Obstacle(i) => write!(f, "obstacle {}", i + 1),
            Self::SpeedBump(i) => write!(f, "speed_bump {}", i + 1),
            Self::ReferencePath(None) => write!(f, "reference_path"),
            Self::ReferencePath(Some(i)) => write!(f, "reference_path, point {}", i + 1),
        }
    }
}
