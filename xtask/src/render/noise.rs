//! What each noise layer does to one view.

use super::drawing::{Drawing, Font};
use super::grids::{self, FREE, OCCUPIED, of_layer};
use super::lot::INK;
use sim::geometry::Vec2;
use sim::sensing::noise::Layer;
use sim::sensing::{BEV_PIXELS, GRID_CELLS, Inspection};

const GAP_PX: f32 = 16.0;
/// A whole number: pixels of the view keep sharp edges.
const SCALE: f32 = 2.0;
const FONT: Font = Font::Small;

/// A row per noise level: the view, and the grid of it, both with wrong parts in the colour of the layer that made them
/// so. The first row has the clean view and its grid.
///
/// # Errors
/// If the picture would be too large.
pub fn picture(title: &str, levels: &[(String, Inspection)]) -> anyhow::Result<Drawing> {
    let side = BEV_PIXELS as f32 * SCALE;
    let cell = side / GRID_CELLS as f32;
    let line = FONT.height_px() + 6.0;
    let width = 2.0 * side + 3.0 * GAP_PX;
    let mut legend = vec![(OCCUPIED, "occupied".to_owned()), (FREE, "free".to_owned())];
    legend.extend(Layer::ALL.map(|layer| (of_layer(layer), layer.name().to_owned())));
    let rows = levels.len() + 1;
    let (_, legend_px) = grids::small_legend(width - 2.0 * GAP_PX, &legend);
    let height = GAP_PX + line + legend_px + 6.0 + rows as f32 * (side + line + GAP_PX);
    let mut sheet = Drawing::new(Vec2::new(width, height), [0xFF; 3])?;
    sheet.text(title, Vec2::splat(GAP_PX), FONT, INK);
    let used = grids::draw_small_legend(&mut sheet, Vec2::new(GAP_PX, GAP_PX + line), width - 2.0 * GAP_PX, &legend);
    let mut y = GAP_PX + line + used + 6.0;
    let Some((_, first)) = levels.first() else { return Ok(sheet) };
    let mut row = |name: &str, view: Drawing, grid: Drawing| {
        sheet.text(name, Vec2::new(GAP_PX, y), FONT, INK);
        sheet.inset(view, Vec2::new(GAP_PX, y + line));
        sheet.inset(grid, Vec2::new(side + 2.0 * GAP_PX, y + line));
        y += side + line + GAP_PX;
    };
    row("clean", grids::view(first, SCALE, true)?, grids::grid(&first.clean_grid, cell, |_, _| None)?);
    for (name, inspection) in levels {
        let right = 100.0 * inspection.perceived.pixel_accuracy(&inspection.clean);
        let cells: usize = Layer::ALL.map(|layer| inspection.count_cells(layer)).iter().sum();
        let name = format!("noise {name}: {right:.1} % of the pixels right, {cells} of 625 cells wrong");
        let grid = grids::grid(&inspection.shown_grid, cell, |row, col| inspection.cell(row, col))?;
        row(&name, grids::view(inspection, SCALE, false)?, grid);
    }
    Ok(sheet)
}
