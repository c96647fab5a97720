//! The colours of recordings: Okabe and Ito's, which colour-blind people can tell apart, on a dark ground.

use sim::driver::Source;
use sim::scenario::ObstacleClass;

/// Red, green, blue, opacity.
pub(crate) type Colour = [u8; 4];

/// The expert, and what it said.
pub(crate) const EXPERT: Colour = [0x56, 0xB4, 0xE9, 0xFF];
/// The network, and what it said.
pub(crate) const NOVICE: Colour = [0xE6, 0x9F, 0x00, 0xFF];
/// A planner, and what it said.
pub(crate) const PLANNER: Colour = [0x00, 0x9E, 0x73, 0xFF];
/// The field that a planner follows: bright, for its arrows are thin.
pub(crate) const FIELD: Colour = [0x5C, 0xF2, 0xC0, 0xFF];
/// What went wrong.
pub(crate) const FAILURE: Colour = [0xFF, 0x3B, 0x30, 0xFF];
/// The safe ring.
pub(crate) const RING: Colour = [0xF0, 0xE4, 0x42, 0xFF];
/// The body of the car.
pub(crate) const CAR: Colour = [0xFF, 0xFF, 0xFF, 0xFF];
/// Its windows.
pub(crate) const GLASS: Colour = [0x2A, 0x35, 0x42, 0xFF];
/// Tyres.
pub(crate) const TYRE: Colour = [0x12, 0x12, 0x12, 0xFF];
/// Drivable ground.
pub(crate) const ASPHALT: Colour = [0x3A, 0x3F, 0x47, 0xFF];
/// Edges of the drivable ground.
pub(crate) const EDGE: Colour = [0xB8, 0xBE, 0xC8, 0xFF];
/// The reference path.
pub(crate) const ROUTE: Colour = [0x7F, 0x8C, 0x8D, 0xFF];
/// Speed bumps.
pub(crate) const BUMP: Colour = [0xC9, 0x9A, 0x2E, 0xFF];
/// What the sensor shows of the ground.
pub(crate) const PATCH: Colour = [0xCC, 0x79, 0xA7, 0xFF];
/// Thresholds and what was asked for.
pub(crate) const FAINT: Colour = [0x8E, 0x94, 0x9E, 0xFF];

/// Who drives.
pub(crate) fn of_source(source: Source) -> Colour {
    match source {
        Source::Expert => EXPERT,
        Source::Novice => NOVICE,
        Source::Planner => PLANNER,
    }
}

/// Several drivers on the same plots: the first of a kind has the colour of its kind, the others take what is left.
pub(crate) fn of_drivers(sources: &[Source]) -> Vec<Colour> {
    let mut left = [PATCH, RING, EDGE, BUMP, ROUTE].into_iter().cycle();
    let is_first = |index: usize| !sources[..index].contains(&sources[index]);
    let colour = |index| if is_first(index) { Some(of_source(sources[index])) } else { left.next() };
    (0..sources.len()).filter_map(colour).collect()
}

/// Obstacles, by what they are.
pub(crate) fn of_class(class: ObstacleClass) -> Colour {
    match class {
        ObstacleClass::Sedan => [0x6C, 0x8E, 0xBF, 0xFF],
        ObstacleClass::Suv => [0x4F, 0x75, 0xA8, 0xFF],
        ObstacleClass::Compact => [0x8F, 0xAD, 0xD4, 0xFF],
        ObstacleClass::Van => [0x8D, 0x7F, 0xB8, 0xFF],
        ObstacleClass::Truck => [0x6E, 0x5F, 0x9E, 0xFF],
        ObstacleClass::Cone => [0xFF, 0x8C, 0x42, 0xFF],
        ObstacleClass::Bollard => [0xD9, 0xC7, 0x5F, 0xFF],
        ObstacleClass::Curb | ObstacleClass::WheelStop => [0xA3, 0xA3, 0xA3, 0xFF],
        ObstacleClass::Pillar => [0x8C, 0x7B, 0x6B, 0xFF],
        ObstacleClass::Cart => [0x5F, 0xB3, 0xA6, 0xFF],
        ObstacleClass::Person => [0xE0, 0x6C, 0x9F, 0xFF],
        ObstacleClass::Wall => [0xB0, 0x6A, 0x55, 0xFF],
    }
}

/// The same, let through.
pub(crate) fn faded([r, g, b, _]: Colour, opacity: u8) -> Colour {
    [r, g, b, opacity]
}
