//! Shapes as archetypes of Rerun: several of a kind in one entity, each with its own colour and size.
//!
//! Positions are in metres in the frame of the entity's parent (world, or the car's rear axle: x ahead, y left, z up).

use crate::colours::Colour;
use rerun::components::FillMode;
use rerun::{
    Arrows3D, Boxes3D, Color, Cylinders3D, LineStrip3D, LineStrips3D, Mesh3D, Points3D, Quaternion, Radius,
    Transform3D, TriangleIndices,
};

/// x, y, z, metres.
pub(crate) type Point = [f32; 3];

/// Half the width of arrows on the screen, points.
const ARROW_PT: f32 = 1.5;

/// A dot that keeps its size on the screen.
#[derive(Debug, Clone)]
pub(crate) struct Dot {
    /// Where.
    pub(crate) at: Point,
    /// Radius on the screen, points.
    pub(crate) radius_pt: f32,
    /// Its colour.
    pub(crate) colour: Colour,
    /// Text beside it; empty for none.
    pub(crate) label: String,
}

/// A polyline that keeps its width on the screen.
#[derive(Debug, Clone)]
pub(crate) struct Strip {
    /// Vertices.
    pub(crate) points: Vec<Point>,
    /// Half its width on the screen, points.
    pub(crate) radius_pt: f32,
    /// Its colour.
    pub(crate) colour: Colour,
}

/// An arrow that keeps its width on the screen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arrow {
    /// Its foot.
    pub(crate) from: Point,
    /// The vector from foot to tip.
    pub(crate) vector: Point,
    /// Its colour.
    pub(crate) colour: Colour,
}

/// A box, or a cylinder if it is round, on a vertical axis.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    /// Centre.
    pub(crate) centre: Point,
    /// Length, width and height; the length of a cylinder is its diameter.
    pub(crate) size_m: Point,
    /// Heading of the length axis.
    pub(crate) yaw_rad: f32,
    /// Its colour.
    pub(crate) colour: Colour,
}

/// A colour as Rerun has it.
pub(crate) fn color([r, g, b, a]: Colour) -> Color {
    Color::from_unmultiplied_rgba(r, g, b, a)
}

/// Rotation about the vertical axis.
fn about_vertical(yaw_rad: f32) -> Quaternion {
    let (sin, cos) = (0.5 * yaw_rad).sin_cos();
    Quaternion::from_xyzw([0.0, 0.0, sin, cos])
}

/// Places an entity and its children in their parent's frame.
pub(crate) fn pose(at: Point, yaw_rad: f32) -> Transform3D {
    Transform3D::update_fields().with_translation(at).with_quaternion(about_vertical(yaw_rad))
}

/// Dots; none is a value, too: it clears what was there.
pub(crate) fn dots(dots: &[Dot]) -> Points3D {
    let points = Points3D::update_fields()
        .with_positions(dots.iter().map(|dot| dot.at))
        .with_colors(dots.iter().map(|dot| color(dot.colour)))
        .with_radii(dots.iter().map(|dot| Radius::new_ui_points(dot.radius_pt)));
    if dots.iter().all(|dot| dot.label.is_empty()) {
        return points;
    }
    points.with_labels(dots.iter().map(|dot| dot.label.as_str()))
}

/// Polylines.
pub(crate) fn strips(strips: &[Strip]) -> LineStrips3D {
    LineStrips3D::update_fields()
        .with_strips(strips.iter().map(|strip| LineStrip3D::from_iter(strip.points.iter().copied())))
        .with_colors(strips.iter().map(|strip| color(strip.colour)))
        .with_radii(strips.iter().map(|strip| Radius::new_ui_points(strip.radius_pt)))
}

/// Arrows.
pub(crate) fn arrows(arrows: &[Arrow]) -> Arrows3D {
    Arrows3D::update_fields()
        .with_vectors(arrows.iter().map(|arrow| arrow.vector))
        .with_origins(arrows.iter().map(|arrow| arrow.from))
        .with_colors(arrows.iter().map(|arrow| color(arrow.colour)))
        .with_radii(arrows.iter().map(|_| Radius::new_ui_points(ARROW_PT)))
}

/// Filled boxes.
pub(crate) fn boxes(blocks: &[Block]) -> Boxes3D {
    let half = |block: &Block| block.size_m.map(|size_m| 0.5 * size_m);
    Boxes3D::from_centers_and_half_sizes(blocks.iter().map(|block| block.centre), blocks.iter().map(half))
        .with_quaternions(blocks.iter().map(|block| about_vertical(block.yaw_rad)))
        .with_colors(blocks.iter().map(|block| color(block.colour)))
        .with_fill_mode(FillMode::Solid)
}

/// Filled cylinders.
pub(crate) fn cylinders(blocks: &[Block]) -> Cylinders3D {
    let lengths = blocks.iter().map(|block| block.size_m[2]);
    let radii = blocks.iter().map(|block| 0.5 * block.size_m[0]);
    Cylinders3D::from_lengths_and_radii(lengths, radii)
        .with_centers(blocks.iter().map(|block| block.centre))
        .with_colors(blocks.iter().map(|block| color(block.colour)))
        .with_fill_mode(FillMode::Solid)
}

/// A flat, filled area of axis-parallel rectangles (x and y of the lower left, then of the upper right corner).
pub(crate) fn area(rectangles: &[[f32; 4]], z_m: f32, colour: Colour) -> Mesh3D {
    let corners = rectangles.iter().flat_map(|&[left, low, right, high]| {
        [[left, low], [right, low], [right, high], [left, high]].map(|[x, y]| [x, y, z_m])
    });
    let triangles = (0..rectangles.len() as u32).flat_map(|i| {
        let first = 4 * i;
        [[first, first + 1, first + 2], [first, first + 2, first + 3]].map(TriangleIndices::from)
    });
    Mesh3D::new(corners).with_triangle_indices(triangles).with_albedo_factor(color(colour).0)
}
