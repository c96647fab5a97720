//! What each noise layer does to one view.

use super::drawing::{Drawing, Font};
use super::grids::{self, FREE, OCCUPIED, of_layer};
use super::lot::{INK, shortened};
use experiment::settings::NoiseChoice;
use experiment::trials::{self, Trial};
use rayon::prelude::*;
use sim::episode::EpisodeSettings;
use sim::geometry::Vec2;
use sim::map::Map;
use sim::sensing::noise::Layer;
use sim::sensing::{BEV_PIXELS, GRID_CELLS, Inspection, Sensor};

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
    let letters = ((width - 2.0 * GAP_PX) / FONT.width_px("x")) as usize;
    sheet.text(shortened(title, letters), Vec2::splat(GAP_PX), FONT, INK);
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

/// What is seen on the route at a place, about when a car at 1.4 m/s gets there.
pub fn inspect(episode: &EpisodeSettings, trial: &Trial<'_>, map: &Map, noise: NoiseChoice, at_m: f32) -> Inspection {
    let episode = trials::episode_settings(episode, noise, map);
    let tick = (at_m / (1.4 * episode.control_period_s())) as u32;
    let mut sensor = Sensor::new(map, episode.sensing, &episode.noise, trial.episode_seed());
    let pose = map.path().pose_at(at_m);
    let shown = sensor.observe(map, pose, tick);
    sensor.inspect(map, pose, tick, &shown)
}

/// Where most layers make cells wrong; among these, where most cells are.
pub fn richest_place(length_m: f32, inspect: impl Fn(f32) -> Inspection + Sync) -> f32 {
    let places: Vec<f32> = (0..(length_m / 2.0) as u32).map(|i| 2.0 * i as f32).collect();
    let richness = |inspection: &Inspection| {
        let cells = Layer::ALL.map(|layer| inspection.count_cells(layer));
        (cells.iter().filter(|&&n| n > 0).count(), cells.iter().sum::<usize>())
    };
    let rich: Vec<_> = places.par_iter().map(|&at_m| richness(&inspect(at_m))).collect();
    let best = (0..places.len()).rev().max_by_key(|&i| rich[i]).unwrap_or(0);
    places.get(best).copied().unwrap_or(0.0)
}
