//! Draws the lots in `examples/lanes`: `cargo run -p scenarios --example make_lanes`. Lanes of constant width with five bends
//! of one radius and nothing in them, solid ground on both sides. The same bytes every time.
#![allow(clippy::unwrap_used, missing_docs, reason = "an example that a person runs")]
#![allow(clippy::disallowed_methods, reason = "written to millimetres, which the last bit does not change")]

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::path::{Path, PathBuf};

const RADII_M: [f64; 5] = [8.0, 10.0, 15.0, 20.0, 30.0];
const WIDTHS_M: [f64; 7] = [2.8, 3.0, 3.4, 4.0, 5.0, 6.5, 8.0];
/// Pieces of a bend.
const PIECES: u32 = 24;
/// Distance from the ends of the lane to those of the route, metres: room for the car, and for what it looks at.
const ENDS_M: f64 = 17.0;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/lanes")
}

fn main() {
    std::fs::create_dir_all(folder()).unwrap();
    for (file, text) in lanes() {
        std::fs::write(folder().join(file), text).unwrap();
    }
}

fn lanes() -> impl Iterator<Item = (String, String)> {
    let of_radius = |radius_m| WIDTHS_M.map(|width_m| lane(radius_m, width_m));
    RADII_M.into_iter().flat_map(of_radius)
}

/// The middle of a lane, as far as it is laid.
#[derive(Default)]
struct Middle {
    /// x, y and heading; metres and radians.
    points: Vec<[f64; 3]>,
}

impl Middle {
    fn end(&self) -> [f64; 3] {
        self.points.last().copied().unwrap_or_default()
    }

    fn ahead(&mut self, length_m: f64, pieces: u32) {
        for _ in 0..pieces {
            let ([x_m, y_m, heading], step_m) = (self.end(), length_m / f64::from(pieces));
            self.points.push([x_m + step_m * heading.cos(), y_m + step_m * heading.sin(), heading]);
        }
    }

    /// Left if positive.
    fn turn(&mut self, angle: f64, radius_m: f64) {
        let ([x_m, y_m, from], side_m) = (self.end(), radius_m * angle.signum());
        let (centre_x_m, centre_y_m) = (x_m - side_m * from.sin(), y_m + side_m * from.cos());
        self.points.extend((1..=PIECES).map(|piece| {
            let heading = from + angle * f64::from(piece) / f64::from(PIECES);
            [centre_x_m + side_m * heading.sin(), centre_y_m - side_m * heading.cos(), heading]
        }));
    }

    fn with_bends(radius_m: f64) -> Self {
        let mut middle = Self { points: vec![[0.0; 3]] };
        middle.ahead(34.0, 2);
        for side in [1.0, -1.0, -1.0, 1.0] {
            middle.turn(side * FRAC_PI_2, radius_m);
            middle.ahead(8.0, 1);
        }
        for side in [1.0, -1.0] {
            middle.turn(side * FRAC_PI_4, radius_m);
        }
        middle.ahead(30.0, 2);
        middle
    }

    /// Its points, moved to the left.
    fn beside(&self, left_m: f64) -> Vec<[f64; 2]> {
        let moved = |&[x_m, y_m, heading]: &[f64; 3]| [x_m - left_m * heading.sin(), y_m + left_m * heading.cos()];
        self.points.iter().map(moved).collect()
    }

    /// The route: from [`ENDS_M`] after its beginning to as much before its end.
    fn route(&self) -> Vec<[f64; 2]> {
        let (mut along_m, mut last) = (0.0, self.points[0]);
        let mut lengths_m = Vec::new();
        for &point in &self.points {
            along_m += (point[0] - last[0]).hypot(point[1] - last[1]);
            lengths_m.push(along_m);
            last = point;
        }
        let is_between = |at_m: f64| ENDS_M + 1.0 < at_m && at_m < along_m - ENDS_M - 1.0;
        let between = self.points.iter().zip(lengths_m).filter(|&(_, at_m)| is_between(at_m));
        let between = between.map(|(&[x_m, y_m, _], _)| [x_m, y_m]);
        std::iter::once([ENDS_M, 0.0]).chain(between).chain([[last[0] - ENDS_M, last[1]]]).collect()
    }
}

fn lane(radius_m: f64, width_m: f64) -> (String, String) {
    let middle = Middle::with_bends(radius_m);
    let left = middle.beside(0.5 * width_m);
    let boundary: Vec<[f64; 2]> = left.into_iter().chain(middle.beside(-0.5 * width_m).into_iter().rev()).collect();
    let list = |points: &[[f64; 2]]| {
        let points: Vec<String> = points.iter().map(|[x_m, y_m]| format!("[{x_m:.3}, {y_m:.3}]")).collect();
        points.join(", ")
    };
    let name = format!("lane-r{radius_m}-w{width_m:.1}");
    let text = format!(
        "# A lane of constant width, {width_m:.1} m, with five bends of R = {radius_m} m; solid ground on both sides.\n\
         name = \"{name}\"\nboundary = [{}]\n[reference_path]\npoints = [{}]\n",
        list(&boundary),
        list(&middle.route())
    );
    (format!("{name}.toml"), text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lots_in_the_folder_are_those_that_are_drawn() {
        for (file, text) in lanes() {
            assert!(std::fs::read_to_string(folder().join(&file)).unwrap() == text, "{file}: draw the lanes again");
        }
        assert_eq!(folder().read_dir().unwrap().count(), lanes().count());
    }
}
