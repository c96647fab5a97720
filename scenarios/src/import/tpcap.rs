//! Cases of the Trajectory Planning Competition of Automated Parking (<https://tpcap.github.io/benchmarks>).
//!
//! A case is one list of numbers: start x, y, θ; goal x, y, θ (rear axle, metres and radians); the number of obstacles;
//! the number of vertices of each; and the vertices x, y in order. The page describes one number per row, the files of
//! the competition hold them in one row: both are read.
//!
//! A case has no outer boundary; the ground reaches [`MARGIN_M`] beyond everything in it. Its solutions may reverse,
//! cars here do not: only cases with a drive forwards become lots.

use super::frame::Frame;
use super::ground::{self, Ground};
use crate::error::{LoadError, read_text, shortened};
use sim::geometry::{Pose, Vec2, wrap_angle};
use sim::limits::{CSV_BYTES_MAX, MAP_COORDINATE_MAX_M};
use sim::maths;
use sim::scenario::{Obstacle, ObstacleClass};
use std::path::Path;

/// Drivable ground around everything in a case, metres: the car must not face a wall at the finish.
const MARGIN_M: f32 = 20.0;
/// Obstacles and their vertices, at most: more are a misread number.
const COUNT_MAX: usize = 10_000;

/// A case in its own frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Case {
    /// x, y in metres, heading in degrees.
    pub(super) start: [f64; 3],
    /// Likewise.
    pub(super) goal: [f64; 3],
    obstacles: Vec<Vec<[f64; 2]>>,
}

impl Case {
    /// Reads a case.
    ///
    /// # Errors
    /// What is wrong with it, with file, line and remedy.
    pub(super) fn read(path: &Path) -> Result<Self, LoadError> {
        Self::parse(&read_text(path, CSV_BYTES_MAX)?, &path.display().to_string())
    }

    /// [`read`](Self::read), of the text of a file; `file` is its name in errors.
    pub(super) fn parse(text: &str, file: &str) -> Result<Self, LoadError> {
        let mut numbers = Numbers::of(text, file)?;
        let mut pose = |what: &str| -> Result<[f64; 3], LoadError> {
            let [x, y, theta_rad] = [numbers.next(what)?, numbers.next(what)?, numbers.next(what)?];
            Ok([x, y, f64::from(wrap_angle(theta_rad as f32).to_degrees())])
        };
        let (start, goal) = (pose("the start (x, y, theta)")?, pose("the goal (x, y, theta)")?);
        let count = numbers.count("the number of obstacles", 0)?;
        let vertices = (1..=count)
            .map(|i| numbers.count(&format!("the number of vertices of obstacle {i}"), 3))
            .collect::<Result<Vec<_>, _>>()?;
        let mut obstacles = Vec::with_capacity(count);
        for (i, count) in vertices.into_iter().enumerate() {
            let what = format!("a vertex of obstacle {}", i + 1);
            let mut outline: Vec<[f64; 2]> = Vec::with_capacity(count);
            for _ in 0..count {
                let vertex = [numbers.next(&what)?, numbers.next(&what)?];
                if outline.last() != Some(&vertex) {
                    outline.push(vertex);
                }
            }
            // Some writers repeat the first vertex.
            if outline.len() > 1 && outline.first() == outline.last() {
                outline.pop();
            }
            obstacles.push(outline);
        }
        numbers.end()?;
        Ok(Self { start, goal, obstacles })
    }

    /// The obstacles on an open plane, enlarged: what has the shape of a car as a car, anything else as an island.
    pub(super) fn ground(&self, frame: Frame) -> Ground {
        let poses = [self.start, self.goal].map(|[x, y, _]| frame.in_lot([x, y]));
        let in_lot = |outline: &Vec<[f64; 2]>| outline.iter().map(|&point| frame.in_lot(point)).collect::<Vec<_>>();
        let outlines = self.obstacles.iter().map(in_lot);
        let mut everything = poses.to_vec();
        let (mut islands, mut obstacles) = (Vec::new(), Vec::new());
        let [mut of_islands, mut of_obstacles] = ground::Numbers::default();
        for (outline, number) in outlines.zip(1..) {
            everything.extend(&outline);
            if let Some(car) = car_of(&outline) {
                obstacles.push(car);
                of_obstacles.push(number);
            } else {
                islands.push(outline);
                of_islands.push(number);
            }
        }
        let (low, high) = sim::geometry::bounds(&everything);
        let (low, high) = (low - MARGIN_M, high + MARGIN_M);
        let boundary = vec![low, Vec2::new(high.x, low.y), high, Vec2::new(low.x, high.y)];
        Ground { boundary, is_walled: false, islands, obstacles, numbers: [of_islands, of_obstacles] }
    }
}

/// A rectangle of the size of a car, to within 1 cm.
fn car_of(outline: &[Vec2]) -> Option<Obstacle> {
    let &[a, b, c, d] = outline else {
        return None;
    };
    let is_rectangle = (a + c).distance(b + d) < 0.02 && (a.distance(c) - b.distance(d)).abs() < 0.01;
    let (along, across) = if a.distance(b) >= b.distance(c) { (b - a, c - b) } else { (c - b, d - c) };
    let (length_m, width_m) = (along.length(), across.length());
    let [length_m, width_m] = [length_m, width_m].map(|metres| (metres * 1000.0).round() / 1000.0);
    (is_rectangle && (3.0..=6.5).contains(&length_m) && (1.3..=2.6).contains(&width_m)).then(|| Obstacle {
        length_m: Some(length_m),
        width_m: Some(width_m),
        ..Obstacle::new(ObstacleClass::Sedan, Pose::new(0.25 * (a + b + c + d), maths::angle_rad(along)))
    })
}

/// The numbers of a file with their lines.
struct Numbers<'a> {
    file: &'a str,
    values: Vec<(usize, f64)>,
    taken: usize,
}

impl<'a> Numbers<'a> {
    fn of(text: &str, file: &'a str) -> Result<Self, LoadError> {
        let mut values = Vec::new();
        for (i, line) in text.lines().enumerate() {
            let cells =
                line.trim_start_matches('\u{feff}').split([',', ';', ' ', '\t']).filter(|cell| !cell.is_empty());
            for cell in cells {
                let value: Option<f64> = cell.parse().ok().filter(|value: &f64| value.abs() <= MAP_COORDINATE_MAX_M);
                let Some(value) = value else {
                    return Err(LoadError::Faulty {
                        file: file.to_owned(),
                        line: i + 1,
                        problem: format!("{:?} is not a number of metres", shortened(cell)),
                        remedy: "a TPCAP case holds numbers only; a centre line belongs to the key centre_line"
                            .to_owned(),
                    });
                };
                values.push((i + 1, value));
            }
        }
        Ok(Self { file, values, taken: 0 })
    }

    fn fault(&self, problem: String) -> LoadError {
        let line = self.values.get(self.taken).or(self.values.last()).map_or(1, |&(line, _)| line);
        let remedy = "a TPCAP case is start x, y, theta, goal x, y, theta, number of obstacles, number of vertices of \
                      each, then the vertices x, y in order"
            .to_owned();
        LoadError::Faulty { file: self.file.to_owned(), line, problem, remedy }
    }

    fn next(&mut self, what: &str) -> Result<f64, LoadError> {
        let Some(&(_, value)) = self.values.get(self.taken) else {
            return Err(self.fault(format!("the file ends after {} numbers, before {what}", self.values.len())));
        };
        self.taken += 1;
        Ok(value)
    }

    fn count(&mut self, what: &str, least: usize) -> Result<usize, LoadError> {
        let value = self.next(what)?;
        if value.fract() != 0.0 || !(least as f64..=COUNT_MAX as f64).contains(&value) {
            self.taken -= 1;
            return Err(self.fault(format!("number {}, {what}, is {value}", self.taken + 1)));
        }
        Ok(value as usize)
    }

    fn end(&self) -> Result<(), LoadError> {
        match self.values.len() - self.taken {
            0 => Ok(()),
            left => Err(self.fault(format!("{left} numbers are left over after the last obstacle"))),
        }
    }
}
