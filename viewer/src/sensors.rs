//! What the sensor showed, beside what it should have shown.

use crate::picture::Picture;
use crate::recording::Recording;
use sim::episode::Episode;
use sim::frame::Frame;
use sim::map::Map;
use sim::sensing::noise::Layer;
use sim::sensing::{BEV_PIXELS, GRID_CELLS, Sensor};

/// Drivable and occupied where the sensor is right; where it is wrong, the layer of noise has a colour.
const RIGHT: [[u8; 3]; 2] = [[0xC9, 0xCF, 0xD6], [0x2B, 0x2F, 0x36]];

/// Colour of what a layer of noise made wrong.
fn of_layer(layer: Layer) -> [u8; 3] {
    match layer {
        Layer::Boundary => [0xE6, 0x9F, 0x00],
        Layer::Shadow => [0x56, 0xB4, 0xE9],
        Layer::SpeedBump => [0xF0, 0xE4, 0x42],
        Layer::FalseFree => [0xFF, 0x3B, 0x30],
        Layer::Blob => [0xCC, 0x79, 0xA7],
        Layer::Stain => [0x00, 0x9E, 0x73],
        Layer::Flicker => [0x7B, 0x4F, 0xE0],
        Layer::Dropout => [0xA6, 0x6A, 0x3A],
    }
}

/// A copy of an episode's sensor.
pub(crate) struct Sensors {
    root: String,
    sensor: Sensor,
}

impl Sensors {
    /// The sensor of an episode that is about to begin.
    pub(crate) fn new(root: &str, episode: &Episode) -> Self {
        Self { root: format!("{root}/sensors"), sensor: episode.sensor().clone() }
    }

    /// Shows the views of a tick: the clean view, the perceived one, and the grid that the driver was given.
    pub(crate) fn show(&self, map: &Map, frame: &Frame, recording: &Recording) {
        let seen = self.sensor.inspect(map, frame.vehicle.pose, frame.tick, &frame.observation);
        let clean = picture(BEV_PIXELS, |row, col| (seen.clean.is_occupied(row, col), None));
        let noisy = picture(BEV_PIXELS, |row, col| (seen.perceived.is_occupied(row, col), seen.pixel(row, col)));
        let grid = picture(GRID_CELLS, |row, col| (seen.shown_grid.is_occupied(row, col), seen.cell(row, col)));
        for (entity, picture) in [("clean", clean), ("noisy", noisy), ("grid", grid)] {
            recording.log(&format!("{}/{entity}", self.root), &picture.encoded());
        }
    }
}

/// A square picture of what is shown as occupied, and of the layer of noise that made it wrong, if one did.
fn picture(side: usize, pixel: impl Fn(usize, usize) -> (bool, Option<Layer>)) -> Picture {
    let index = |(is_occupied, wrong): (bool, Option<Layer>)| match wrong {
        None => u8::from(is_occupied),
        Some(layer) => (RIGHT.len() + layer as usize) as u8,
    };
    let pixels = (0..side * side).map(|i| index(pixel(i / side, i % side))).collect();
    let palette = RIGHT.into_iter().chain(Layer::ALL.map(of_layer)).collect();
    Picture { width: side as u32, pixels, palette }
}
