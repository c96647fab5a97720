//! Shapes of the bench as archetypes of Rerun.

use protocol::{Area, Arrow, Block, Colour, Dot, Pose, Shape, Strip};
use rerun::components::FillMode;
use rerun::{
    Arrows3D, Boxes3D, Color, Cylinders3D, EncodedImage, LineStrip3D, LineStrips3D, Mesh3D, Points3D, Quaternion,
    Radius, RecordingStream, RecordingStreamResult, Scalars, SeriesLines, SeriesPoints, StateChange,
    StateConfiguration, TextDocument, TextLog, Transform3D, TriangleIndices,
};

/// Width of arrows and frames on the screen, points.
const LINE_PT: f32 = 1.5;

/// Items of several rows one after the other, and how many each row has.
pub struct Batch<T> {
    pub items: Vec<T>,
    pub lengths: Vec<usize>,
}

impl<T: Clone> Batch<T> {
    pub fn new<'a>(rows: impl Iterator<Item = &'a [T]>) -> Self
    where
        T: 'a,
    {
        let mut batch = Self { items: Vec::new(), lengths: Vec::new() };
        for row in rows {
            batch.items.extend_from_slice(row);
            batch.lengths.push(row.len());
        }
        batch
    }
}

/// Sends a shape that holds at all times.
pub fn send_static(stream: &RecordingStream, entity: &str, shape: &Shape) -> anyhow::Result<()> {
    let sent: RecordingStreamResult<()> = match shape {
        Shape::Pose(pose) => stream.log_static(entity, &transform(pose)),
        Shape::Dots(all) => stream.log_static(entity, &dots(all)),
        Shape::Strips(all) => stream.log_static(entity, &strips(all)),
        Shape::Arrows(all) => stream.log_static(entity, &arrows(all)),
        Shape::Blocks(all) => return blocks(stream, entity, all),
        Shape::Area(area) => stream.log_static(entity, &mesh(area)),
        Shape::Picture(picture) => {
            let image = EncodedImage::new(crate::picture::png(picture)?).with_media_type("image/png");
            stream.log_static(entity, &image)
        }
        Shape::Value(value) => stream.log_static(entity, &Scalars::single(*value)),
        Shape::Signal { name, colour, dotted: false } => {
            let lines = SeriesLines::new().with_names([name.as_str()]).with_colors([color(*colour)]);
            stream.log_static(entity, &lines.with_widths([1.5]))
        }
        Shape::Signal { name, colour, dotted: true } => {
            let points = SeriesPoints::new().with_names([name.as_str()]).with_colors([color(*colour)]);
            stream.log_static(entity, &points.with_marker_sizes([4.0]))
        }
        Shape::State(state) => stream.log_static(entity, &StateChange::single(state.as_str())),
        Shape::States(states) => {
            let configuration = StateConfiguration::new()
                .with_values(states.iter().map(|(name, _)| name.as_str()))
                .with_colors(states.iter().map(|(_, colour)| color(*colour)));
            stream.log_static(entity, &configuration)
        }
        Shape::Line { text, .. } => stream.log_static(entity, &TextLog::new(text.as_str())),
        Shape::Document(text) => stream.log_static(entity, &TextDocument::from_markdown(text.as_str())),
    };
    Ok(sent?)
}

fn color([r, g, b, a]: Colour) -> Color {
    Color::from_unmultiplied_rgba(r, g, b, a)
}

/// Rotation by an angle about the vertical axis.
pub fn about_vertical(yaw_rad: f32) -> Quaternion {
    let (sin, cos) = (0.5 * yaw_rad).sin_cos();
    Quaternion::from_xyzw([0.0, 0.0, sin, cos])
}

fn transform(pose: &Pose) -> Transform3D {
    Transform3D::update_fields()
        .with_translation(pose.at)
        .with_quaternion(about_vertical(pose.yaw_rad))
        .with_scale(pose.scale)
}

pub fn dots(dots: &[Dot]) -> Points3D {
    let points = Points3D::update_fields()
        .with_positions(dots.iter().map(|dot| dot.at))
        .with_colors(dots.iter().map(|dot| color(dot.colour)))
        .with_radii(dots.iter().map(|dot| Radius::new_ui_points(dot.radius_pt)));
    if dots.iter().all(|dot| dot.label.is_empty()) {
        return points;
    }
    points.with_labels(dots.iter().map(|dot| dot.label.as_str()))
}

pub fn strips(strips: &[Strip]) -> LineStrips3D {
    LineStrips3D::update_fields()
        .with_strips(strips.iter().map(|strip| LineStrip3D::from_iter(strip.points.iter().copied())))
        .with_colors(strips.iter().map(|strip| color(strip.colour)))
        .with_radii(strips.iter().map(|strip| Radius::new_ui_points(strip.radius_pt)))
}

pub fn arrows(arrows: &[Arrow]) -> Arrows3D {
    Arrows3D::update_fields()
        .with_vectors(arrows.iter().map(|arrow| arrow.vector))
        .with_origins(arrows.iter().map(|arrow| arrow.from))
        .with_colors(arrows.iter().map(|arrow| color(arrow.colour)))
        .with_radii(arrows.iter().map(|_| Radius::new_ui_points(LINE_PT)))
}

fn blocks(stream: &RecordingStream, entity: &str, blocks: &[Block]) -> anyhow::Result<()> {
    let is_solid = blocks.iter().all(|block| block.colour[3] == u8::MAX);
    let fill = if is_solid { FillMode::Solid } else { FillMode::TransparentFillMajorWireframe };
    let (round, square): (Vec<&Block>, Vec<&Block>) = blocks.iter().partition(|block| block.is_round);
    if !square.is_empty() {
        let half = |block: &&Block| block.size_m.map(|size_m| 0.5 * size_m);
        let boxes =
            Boxes3D::from_centers_and_half_sizes(square.iter().map(|block| block.centre), square.iter().map(half))
                .with_quaternions(square.iter().map(|block| about_vertical(block.yaw_rad)))
                .with_colors(square.iter().map(|block| color(block.colour)))
                .with_fill_mode(fill);
        stream.log_static(entity, &boxes)?;
    }
    if !round.is_empty() {
        let lengths = round.iter().map(|block| block.size_m[2]);
        let radii = round.iter().map(|block| 0.5 * block.size_m[0]);
        let cylinders = Cylinders3D::from_lengths_and_radii(lengths, radii)
            .with_centers(round.iter().map(|block| block.centre))
            .with_colors(round.iter().map(|block| color(block.colour)))
            .with_fill_mode(fill);
        stream.log_static(entity, &cylinders)?;
    }
    Ok(())
}

fn mesh(area: &Area) -> Mesh3D {
    let corners = area.rectangles.iter().flat_map(|&[left, low, right, high]| {
        [[left, low], [right, low], [right, high], [left, high]].map(|[x, y]| [x, y, area.z_m])
    });
    let triangles = (0..area.rectangles.len() as u32).flat_map(|i| {
        let first = 4 * i;
        [[first, first + 1, first + 2], [first, first + 2, first + 3]].map(TriangleIndices::from)
    });
    Mesh3D::new(corners).with_triangle_indices(triangles).with_albedo_factor(color(area.colour).0)
}
