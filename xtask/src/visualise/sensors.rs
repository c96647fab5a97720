//! What the sensor showed, beside what it should have shown.

use protocol::{Mark, Picture, Shape};
use sim::episode::{Episode, Frame};
use sim::map::Map;
use sim::sensing::{BEV_PIXELS, BirdsEyeView, GRID_CELLS, OccupancyGrid, Sensor};

/// Free, occupied, free but shown as occupied, occupied but shown as free.
const PALETTE: [[u8; 3]; 4] = [[0xC9, 0xCF, 0xD6], [0x2B, 0x2F, 0x36], [0xE6, 0x9F, 0x00], [0xFF, 0x3B, 0x30]];

/// A copy of an episode's sensor.
pub struct Sensors {
    root: String,
    sensor: Sensor,
}

impl Sensors {
    /// The sensor of an episode that is about to begin.
    pub fn new(root: &str, episode: &Episode) -> Self {
        Self { root: format!("{root}/sensors"), sensor: episode.sensor().clone() }
    }

    /// The views of a tick: as it is, as perceived, and the grid that the driver was shown.
    pub fn look(&self, map: &Map, frame: &Frame) -> Vec<Mark> {
        let pose = frame.vehicle.pose;
        let clean = self.sensor.clean_view(map, pose);
        let noisy = self.sensor.perceived_view(map, pose, frame.tick);
        vec![
            self.mark("clean", view(|row, col| [clean.is_occupied(row, col); 2])),
            self.mark("noisy", view(|row, col| [clean.is_occupied(row, col), noisy.is_occupied(row, col)])),
            self.mark("grid", grid(&clean, &frame.observation.grid)),
        ]
    }

    fn mark(&self, entity: &str, picture: Picture) -> Mark {
        Mark::new(format!("{}/{entity}", self.root), Shape::Picture(picture))
    }
}

/// The grid alone, without knowing what is there.
pub fn shown(root: &str, frame: &Frame) -> Mark {
    let grid = frame.observation.grid;
    let picture = picture(GRID_CELLS, |row, col| [grid.is_occupied(row, col); 2]);
    Mark::new(format!("{root}/sensors/grid"), Shape::Picture(picture))
}

/// Index of a colour from what is there and what is shown.
fn class([is_occupied, is_shown]: [bool; 2]) -> u8 {
    match (is_occupied, is_shown) {
        (false, false) => 0,
        (true, true) => 1,
        (false, true) => 2,
        (true, false) => 3,
    }
}

fn view(pixel: impl Fn(usize, usize) -> [bool; 2]) -> Picture {
    picture(BEV_PIXELS, pixel)
}

fn grid(clean: &BirdsEyeView, shown: &OccupancyGrid) -> Picture {
    let clean = clean.to_grid();
    picture(GRID_CELLS, |row, col| [clean.is_occupied(row, col), shown.is_occupied(row, col)])
}

fn picture(side: usize, pixel: impl Fn(usize, usize) -> [bool; 2]) -> Picture {
    let pixels = (0..side * side).map(|i| class(pixel(i / side, i % side))).collect();
    Picture { width: side as u32, pixels, palette: PALETTE.to_vec() }
}
