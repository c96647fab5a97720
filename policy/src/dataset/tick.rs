//! When and where a sample was taken, and who drove: `ticks.npz`.

use crate::dataset::npy::Archive;
use crate::files::{self, FileError, RESTORE_REMEDY};
use ndarray::Array1;
use ndarray_npy::{NpzWriter, ReadableElement, WritableElement};
use sim::driver::Source;
use sim::frame::Frame;
use std::path::Path;

/// The context of a sample: when and where it was taken, and who drove. Poses are those of the rear axle in the world frame of the lot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// Episode of the round, from 0.
    pub episode: u32,
    /// Decision of the episode, from 0. Ticks that were not kept leave gaps.
    pub tick: u32,
    /// Simulated time when observed, seconds. A tick with a near-collision lasts until the car is back on the path.
    pub time_s: f32,
    /// Rear axle when observed, metres.
    pub x_m: f32,
    /// Rear axle when observed, metres.
    pub y_m: f32,
    /// Heading when observed, radians, counter-clockwise from the X axis.
    pub heading_rad: f32,
    /// Forward speed when observed, m/s.
    pub speed_mps: f32,
    /// Road-wheel angle when observed, radians, positive to the left.
    pub steering_rad: f32,
    /// Road-wheel angle that was commanded, radians. Includes a disturbance, if there was one.
    pub command_steering_rad: f32,
    /// Speed that was commanded, m/s.
    pub command_speed_mps: f32,
    /// Who drove: 0 = expert, 1 = novice, 2 = planner in the file.
    pub driver: Source,
}

const NAME: &str = "ticks.npz";
/// Arrays of the file.
const COLUMNS: usize = 11;

/// Name of a column in the file, and how to read it.
type Column = (&'static str, fn(&Tick) -> f32);

impl Tick {
    /// The columns of single precision: their names in the file, and how to read them.
    pub const FLOATS: [Column; 8] = [
        ("time_s", |tick| tick.time_s),
        ("x_m", |tick| tick.x_m),
        ("y_m", |tick| tick.y_m),
        ("heading_rad", |tick| tick.heading_rad),
        ("speed_mps", |tick| tick.speed_mps),
        ("steering_rad", |tick| tick.steering_rad),
        ("command_steering_rad", |tick| tick.command_steering_rad),
        ("command_speed_mps", |tick| tick.command_speed_mps),
    ];

    /// The tick of a frame of an episode, which was observed at `time_s`.
    pub(crate) fn new(episode: u32, time_s: f32, frame: &Frame) -> Self {
        let (pose, command) = (frame.vehicle.pose, frame.command);
        Self {
            episode,
            tick: frame.tick,
            time_s,
            x_m: pose.x_m,
            y_m: pose.y_m,
            heading_rad: pose.heading_rad,
            speed_mps: frame.vehicle.speed_mps,
            steering_rad: frame.vehicle.steering_rad,
            command_steering_rad: command.steering_rad,
            command_speed_mps: command.speed_mps,
            driver: frame.decision.source,
        }
    }

    /// Writes one array per column.
    pub(crate) fn write_all(ticks: &[Self], folder: &Path) -> Result<(), FileError> {
        files::write_atomically(&folder.join(NAME), |file| {
            let mut archive = NpzWriter::new_compressed(file);
            let fail = |error: ndarray_npy::WriteNpzError| error.to_string();
            archive.add_array("episode", &column(ticks, |tick| tick.episode)).map_err(fail)?;
            archive.add_array("tick", &column(ticks, |tick| tick.tick)).map_err(fail)?;
            for (name, of) in Self::FLOATS {
                archive.add_array(name, &column(ticks, of)).map_err(fail)?;
            }
            archive.add_array("driver", &column(ticks, |tick| code(tick.driver))).map_err(fail)?;
            archive.finish().map(drop).map_err(fail)
        })
    }

    /// Reads the columns of `samples` samples.
    pub(crate) fn read_all(folder: &Path, samples: usize) -> Result<Vec<Self>, FileError> {
        let path = folder.join(NAME);
        let fail = |problem: String| FileError::new(&path, problem, RESTORE_REMEDY);
        let archive = Archive::open(&path, &[&[samples][..]; COLUMNS])?;
        let mut columns = Columns { archive, path: &path, samples };
        let (episode, tick) = (columns.read::<u32>("episode")?, columns.read::<u32>("tick")?);
        let (time_s, x_m, y_m) = (columns.floats("time_s")?, columns.floats("x_m")?, columns.floats("y_m")?);
        let (heading_rad, speed_mps) = (columns.floats("heading_rad")?, columns.floats("speed_mps")?);
        let steering_rad = columns.floats("steering_rad")?;
        let command_steering_rad = columns.floats("command_steering_rad")?;
        let command_speed_mps = columns.floats("command_speed_mps")?;
        let driver = columns.read::<u8>("driver")?;
        let tick = |i: usize| {
            let driver = driver_of(driver[i]).ok_or_else(|| fail(format!("driver {} in row {i}", driver[i])))?;
            Ok(Self {
                episode: episode[i],
                tick: tick[i],
                time_s: time_s[i],
                x_m: x_m[i],
                y_m: y_m[i],
                heading_rad: heading_rad[i],
                speed_mps: speed_mps[i],
                steering_rad: steering_rad[i],
                command_steering_rad: command_steering_rad[i],
                command_speed_mps: command_speed_mps[i],
                driver,
            })
        };
        (0..samples).map(tick).collect()
    }
}

fn code(driver: Source) -> u8 {
    match driver {
        Source::Expert => 0,
        Source::Novice => 1,
        Source::Planner => 2,
    }
}

fn driver_of(code: u8) -> Option<Source> {
    Source::ALL.into_iter().find(|&driver| self::code(driver) == code)
}

fn column<T: WritableElement>(ticks: &[Tick], of: impl Fn(&Tick) -> T) -> Array1<T> {
    ticks.iter().map(of).collect()
}

/// The arrays of an archive, each of one value per sample.
struct Columns<'a> {
    archive: Archive,
    path: &'a Path,
    samples: usize,
}

impl Columns<'_> {
    fn read<T: ReadableElement>(&mut self, name: &str) -> Result<Array1<T>, FileError> {
        self.archive.read(name, &[self.samples])
    }

    fn floats(&mut self, name: &str) -> Result<Array1<f32>, FileError> {
        let column = self.read::<f32>(name)?;
        match column.iter().position(|value| !value.is_finite()) {
            Some(row) => Err(FileError::new(self.path, format!("{name}: row {row} is not finite"), RESTORE_REMEDY)),
            None => Ok(column),
        }
    }
}
