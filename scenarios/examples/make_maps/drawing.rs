//! A map as a list of shapes painted one over the other. Metres; x to the right, y up, (0, 0) the lower left corner.

use image::{GrayImage, Luma};
use sim::geometry::{Pose, Vec2, distance_to_segment_m};
use sim::scenario::ReferencePath;

/// Grey values of `map_saver`.
pub(super) const FREE: u8 = 254;
pub(super) const OCCUPIED: u8 = 0;
pub(super) const UNKNOWN: u8 = 205;

pub(super) struct Drawing {
    pub(super) name: &'static str,
    pub(super) about: &'static str,
    pub(super) size_m: (f32, f32),
    pub(super) pixel_m: f32,
    /// Pose of the lower left corner: x, y, yaw.
    pub(super) origin: &'static str,
    pub(super) background: u8,
    pub(super) shapes: Shapes,
    /// Where to drive: the keys of the lot file, in the map's frame.
    pub(super) lot: &'static str,
    /// The route, in the map's frame.
    pub(super) centre_line: Option<Vec<Vec2>>,
}

/// Each with its grey value, the later ones over the earlier.
pub(super) type Shapes = Vec<(Shape, u8)>;

pub(super) enum Shape {
    /// Along a line.
    Band {
        line: Vec<Vec2>,
        width_m: f32,
    },
    Box {
        pose: Pose,
        length_m: f32,
        width_m: f32,
    },
    Disc {
        centre: Vec2,
        radius_m: f32,
    },
}

/// Nothing drawn yet: pixels of 10 cm, all of them occupied.
pub(super) fn plain(name: &'static str, about: &'static str, size_m: (f32, f32)) -> Drawing {
    Drawing {
        name,
        about,
        size_m,
        pixel_m: 0.1,
        origin: "[0.0, 0.0, 0.0]",
        background: OCCUPIED,
        shapes: Vec::new(),
        lot: "",
        centre_line: None,
    }
}

/// Numbers from 0 to 1 that look drawn.
pub(super) fn scatter(i: usize, k: usize) -> f32 {
    ((i * 7919 + k * 104_729 + 13) % 1000) as f32 / 1000.0
}

/// Numbers from -1 to 1 that look drawn.
pub(super) fn shake(i: usize, k: usize) -> f32 {
    2.0 * scatter(i, k) - 1.0
}

/// The point so far from another, at an angle counter-clockwise from x.
pub(super) fn polar(x: f32, y: f32, radius_m: f32, angle_deg: f32) -> Vec2 {
    Vec2::new(x, y) + radius_m * sim::maths::unit(angle_deg.to_radians())
}

/// From a point to the nearest of a line.
pub(super) fn distance_m(line: &[Vec2], point: Vec2) -> f32 {
    line.windows(2).map(|ends| distance_to_segment_m(point, ends[0], ends[1])).fold(f32::INFINITY, f32::min)
}

/// The middle of a way with rounded corners.
pub(super) fn way(points: &[(f32, f32)], radius_m: f32) -> Vec<Vec2> {
    let points = points.iter().map(|&point| Vec2::from(point)).collect();
    let path = sim::path::Path::new(&ReferencePath { points, corner_radius_m: radius_m });
    path.poses().iter().step_by(4).map(|pose| pose.position()).collect()
}

pub(super) fn band(points: &[(f32, f32)], radius_m: f32, width_m: f32) -> Shape {
    Shape::Band { line: way(points, radius_m), width_m }
}

/// Along a line with sharp corners: a wall, a fence, a hedge.
pub(super) fn stroke(points: impl IntoIterator<Item = impl Into<Vec2>>, width_m: f32) -> Shape {
    Shape::Band { line: points.into_iter().map(Into::into).collect(), width_m }
}

/// A rectangle from its lower left to its upper right corner.
pub(super) fn area(x: f32, y: f32, to_x: f32, to_y: f32) -> Shape {
    turned(0.5 * (x + to_x), 0.5 * (y + to_y), to_x - x, to_y - y, 0.0)
}

pub(super) fn turned(x: f32, y: f32, length_m: f32, width_m: f32, heading_deg: f32) -> Shape {
    Shape::Box { pose: Pose::new(Vec2::new(x, y), heading_deg.to_radians()), length_m, width_m }
}

pub(super) fn car(x: f32, y: f32, heading_deg: f32) -> (Shape, u8) {
    (turned(x, y, 4.6, 1.85, heading_deg), OCCUPIED)
}

pub(super) fn disc(x: f32, y: f32, radius_m: f32) -> Shape {
    Shape::Disc { centre: Vec2::new(x, y), radius_m }
}

/// Discs of one size, all of them occupied.
pub(super) fn discs(centres: impl IntoIterator<Item = impl Into<Vec2>>, radius_m: f32) -> Shapes {
    solid(centres.into_iter().map(|centre| Shape::Disc { centre: centre.into(), radius_m }))
}

/// Shapes, all of them occupied.
pub(super) fn solid(shapes: impl IntoIterator<Item = Shape>) -> Shapes {
    shapes.into_iter().map(|shape| (shape, OCCUPIED)).collect()
}

impl Shape {
    /// Gives `paint` its parts: what each lies within, from its lowest to its highest x and y, and whether a point is in
    /// it.
    fn parts(&self, mut paint: impl FnMut(Vec2, Vec2, &dyn Fn(Vec2) -> bool)) {
        match self {
            Self::Band { line, width_m } => {
                for ends in line.windows(2) {
                    let (low, high) = sim::geometry::bounds(ends);
                    let holds = |point| distance_to_segment_m(point, ends[0], ends[1]) < 0.5 * width_m;
                    paint(low - 0.5 * width_m, high + 0.5 * width_m, &holds);
                }
            }
            Self::Box { pose, length_m, width_m } => {
                let (centre, reach_m) = (pose.position(), 0.5 * (length_m + width_m));
                paint(centre - reach_m, centre + reach_m, &|point| {
                    let within = pose.world_from_ego().inverse_point(point).abs();
                    within.x < 0.5 * length_m && within.y < 0.5 * width_m
                });
            }
            Self::Disc { centre, radius_m } => {
                paint(*centre - *radius_m, *centre + *radius_m, &|point| centre.distance(point) < *radius_m);
            }
        }
    }
}

impl Drawing {
    pub(super) fn image(&self) -> GrayImage {
        let (cols, rows) = ((self.size_m.0 / self.pixel_m) as u32, (self.size_m.1 / self.pixel_m) as u32);
        let mut image = GrayImage::from_pixel(cols, rows, Luma([self.background]));
        let pixels = |low_m: f32, high_m: f32, count: u32| {
            (low_m / self.pixel_m) as u32..((high_m / self.pixel_m + 1.0) as u32).min(count)
        };
        for (shape, value) in &self.shapes {
            shape.parts(|low, high, holds| {
                for up in pixels(low.y, high.y, rows) {
                    for col in pixels(low.x, high.x, cols) {
                        if holds(Vec2::new(col as f32 + 0.5, up as f32 + 0.5) * self.pixel_m) {
                            image.put_pixel(col, rows - 1 - up, Luma([*value]));
                        }
                    }
                }
            });
        }
        image
    }

    /// Names and texts of its files but the image.
    pub(super) fn texts(&self) -> Vec<(String, String)> {
        let Self { name, about, pixel_m, origin, lot, centre_line, .. } = self;
        let yaml = format!(
            "# {about}\nimage: {name}.png\nmode: trinary\nresolution: {pixel_m}\norigin: {origin}\nnegate: 0\n\
             occupied_thresh: 0.65\nfree_thresh: 0.196\n"
        );
        let lot = format!("# {about} Drawn by examples/make_maps.\nmap = \"{name}.yaml\"\n{lot}");
        let mut texts = vec![(format!("{name}.yaml"), yaml), (format!("{name}.lot.toml"), lot)];
        if let Some(line) = centre_line {
            let points: Vec<String> = line.iter().map(|point| format!("{:.2},{:.2}", point.x, point.y)).collect();
            texts.push((format!("{name}.csv"), format!("x,y\n{}\n", points.join("\n"))));
        }
        texts
    }
}
