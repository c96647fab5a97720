//! What one entity is at many moments, sent as columns: a thousand rows cost little more than one.

use crate::picture;
use crate::shapes::{self, Batch};
use anyhow::{Context as _, bail};
use protocol::{Clock, Pose, Shape};
use rerun::{
    EncodedImage, RecordingStream, Scalars, SerializedComponentColumn, StateChange, TextDocument, TextLog, TimeColumn,
    Transform3D,
};

/// Moments that wait to be sent.
#[derive(Default)]
pub struct Column {
    clocks: Vec<Clock>,
    shapes: Vec<Shape>,
    /// Encoded pictures, in place of the shapes they were.
    pictures: Vec<Vec<u8>>,
    bytes: usize,
}

impl Column {
    /// Takes one moment.
    pub fn push(&mut self, clock: Clock, shape: Shape) -> anyhow::Result<()> {
        if let Some(first) = self.shapes.first()
            && std::mem::discriminant(first) != std::mem::discriminant(&shape)
        {
            bail!("an entity keeps one kind of shape, but {first:?} is followed by {shape:?}");
        }
        self.clocks.push(clock);
        match &shape {
            Shape::Picture(pixels) => {
                let png = picture::png(pixels)?;
                self.bytes += png.len();
                self.pictures.push(png);
                if self.shapes.is_empty() {
                    self.shapes.push(shape);
                }
            }
            _ => self.shapes.push(shape),
        }
        Ok(())
    }

    /// Moments that wait.
    pub fn rows(&self) -> usize {
        self.clocks.len()
    }

    /// Bytes of the pictures that wait.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Sends what waits.
    pub fn send(&mut self, stream: &RecordingStream, entity: &str) -> anyhow::Result<()> {
        if self.clocks.is_empty() {
            return Ok(());
        }
        let Self { clocks, shapes, pictures, .. } = std::mem::take(self);
        let columns = columns(&shapes, pictures).with_context(|| entity.to_owned())?;
        stream.send_columns(entity, timelines(&clocks), columns).with_context(|| entity.to_owned())
    }
}

/// The moments on their two time lines.
fn timelines(clocks: &[Clock]) -> [TimeColumn; 2] {
    let is_training = matches!(clocks[0], Clock::Training { .. });
    let first = clocks.iter().map(|clock| match *clock {
        Clock::Episode { tick, .. } => tick,
        Clock::Training { step, .. } => step,
    });
    if is_training {
        let rounds = clocks.iter().map(|clock| if let Clock::Training { round, .. } = *clock { round } else { 0 });
        [TimeColumn::new_sequence("step", first), TimeColumn::new_sequence("round", rounds)]
    } else {
        let times = clocks.iter().map(|clock| if let Clock::Episode { time_s, .. } = *clock { time_s } else { 0.0 });
        [TimeColumn::new_sequence("tick", first), TimeColumn::new_duration_secs("sim_time", times)]
    }
}

/// The shapes as components, one row per moment. All are of the kind of the first.
fn columns(shapes: &[Shape], pictures: Vec<Vec<u8>>) -> anyhow::Result<Vec<SerializedComponentColumn>> {
    macro_rules! all {
        ($pattern:pat => $value:expr) => {
            shapes.iter().filter_map(|shape| if let $pattern = shape { Some($value) } else { None })
        };
    }
    Ok(match &shapes[0] {
        Shape::Pose(_) => poses(&all!(Shape::Pose(pose) => *pose).collect::<Vec<_>>())?,
        Shape::Dots(_) => {
            let batch = Batch::new(all!(Shape::Dots(dots) => dots.as_slice()));
            shapes::dots(&batch.items).columns(batch.lengths)?.collect()
        }
        Shape::Strips(_) => {
            let batch = Batch::new(all!(Shape::Strips(strips) => strips.as_slice()));
            shapes::strips(&batch.items).columns(batch.lengths)?.collect()
        }
        Shape::Arrows(_) => {
            let batch = Batch::new(all!(Shape::Arrows(arrows) => arrows.as_slice()));
            shapes::arrows(&batch.items).columns(batch.lengths)?.collect()
        }
        Shape::Picture(_) => {
            let rows = pictures.len();
            let images = EncodedImage::update_fields().with_many_blob(pictures);
            images.with_many_media_type(std::iter::repeat_n("image/png", rows)).columns_of_unit_batches()?.collect()
        }
        Shape::Value(_) => Scalars::new(all!(Shape::Value(value) => *value)).columns_of_unit_batches()?.collect(),
        Shape::State(_) => StateChange::new()
            .with_state(all!(Shape::State(state) => state.as_str()))
            .columns_of_unit_batches()?
            .collect(),
        Shape::Line { .. } => TextLog::update_fields()
            .with_many_text(all!(Shape::Line { text, .. } => text.as_str()))
            .with_many_level(all!(Shape::Line { is_warning, .. } => if *is_warning { "WARN" } else { "INFO" }))
            .columns_of_unit_batches()?
            .collect(),
        Shape::Document(_) => TextDocument::update_fields()
            .with_many_text(all!(Shape::Document(text) => text.as_str()))
            .with_many_media_type(std::iter::repeat_n("text/markdown", shapes.len()))
            .columns_of_unit_batches()?
            .collect(),
        Shape::Blocks(_) | Shape::Area(_) | Shape::Signal { .. } | Shape::States(_) => bail!("static only"),
    })
}

fn poses(poses: &[Pose]) -> anyhow::Result<Vec<SerializedComponentColumn>> {
    let columns = Transform3D::update_fields()
        .with_many_translation(poses.iter().map(|pose| pose.at))
        .with_many_quaternion(poses.iter().map(|pose| shapes::about_vertical(pose.yaw_rad)))
        .with_many_scale(poses.iter().map(|pose| pose.scale));
    Ok(columns.columns_of_unit_batches()?.collect())
}
