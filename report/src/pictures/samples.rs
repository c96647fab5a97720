//! Samples of a data set: the grid, the expert's label and what a network answers.

use super::drawing::{Drawing, Font};
use super::grids::{self, LABEL, PREDICTION};
use super::lot::INK;
use policy::dataset::Sample;
use policy::network::Prediction;
use sim::driver::LookAheadPoint;
use sim::geometry::Vec2;
use sim::maths;
use sim::sensing::{GRID_CELLS, GridGeometry};

/// Samples for which a picture has room.
pub const COUNT_MAX: usize = 256;

const CELL_PX: f32 = 9.0;
const GAP_PX: f32 = 16.0;
const FONT: Font = Font::Small;

/// At most [`COUNT_MAX`] samples with their index and what a network answers, four in a row.
///
/// # Errors
/// If the picture would be too large.
pub fn picture(
    title: &str,
    samples: &[(usize, Sample, Option<Prediction>)],
    geometry: &GridGeometry,
) -> anyhow::Result<Drawing> {
    let side = CELL_PX * GRID_CELLS as f32;
    let cols = samples.len().clamp(1, 4);
    let rows = samples.len().div_ceil(cols);
    let step = Vec2::new(side + GAP_PX, side + GAP_PX + 2.0 * (FONT.height_px() + 2.0));
    let head = 2.0 * (FONT.height_px() + 8.0);
    let width = (cols as f32 * step.x + GAP_PX).max(FONT.width_px(title) + 2.0 * GAP_PX).max(520.0);
    let mut sheet = Drawing::new(Vec2::new(width, rows as f32 * step.y + head + GAP_PX), [0xFF; 3])?;
    sheet.text(title, Vec2::new(GAP_PX, 8.0), FONT, INK);
    let mut legend = vec![(LABEL, "label (expert)".to_owned())];
    if samples.iter().any(|(.., prediction)| prediction.is_some()) {
        legend.push((PREDICTION, "network, 1 and 2 sigma".to_owned()));
    }
    grids::draw_small_legend(&mut sheet, Vec2::new(GAP_PX, head - 18.0), width - 2.0 * GAP_PX, &legend);
    for (place, (index, sample, prediction)) in samples.iter().enumerate() {
        let at = Vec2::new((place % cols) as f32, (place / cols) as f32) * step + Vec2::new(GAP_PX, head + 8.0);
        sheet.inset(tile(sample, prediction.as_ref(), geometry)?, at);
        let label = LookAheadPoint::from_image_fraction(sample.label, geometry);
        let below = at + Vec2::new(0.0, side + 2.0);
        sheet.text(format!("#{index}  tau {:.2}", sample.tau_hat), below, FONT, INK);
        if let Some(prediction) = prediction {
            let answer = prediction.look_ahead(*geometry);
            let off_m = maths::hypot(answer.ahead_m - label.ahead_m, answer.left_m - label.left_m);
            sheet.text(format!("off by {off_m:.2} m"), below + Vec2::new(0.0, FONT.height_px()), FONT, INK);
        }
    }
    Ok(sheet)
}

fn tile(sample: &Sample, prediction: Option<&Prediction>, geometry: &GridGeometry) -> anyhow::Result<Drawing> {
    let mut tile = grids::grid(&sample.grid, CELL_PX, |_, _| None)?;
    if let Some(prediction) = prediction {
        grids::draw_prediction(
            &mut tile,
            prediction.look_ahead(*geometry),
            Some(prediction.spread(*geometry)),
            geometry,
        );
    }
    grids::draw_label(&mut tile, LookAheadPoint::from_image_fraction(sample.label, geometry), geometry);
    Ok(tile)
}
