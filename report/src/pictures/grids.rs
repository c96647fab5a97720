//! Grids and views as the driver sees them: far is up, left is left.

use super::drawing::{Drawing, Font, Rgb};
use super::lot::{INK, LegendEntry};
use super::trajectories::rgb;
use sim::driver::{LookAheadPoint, Spread};
use sim::geometry::Vec2;
use sim::maths;
use sim::sensing::noise::Layer;
use sim::sensing::{BEV_PIXELS, GRID_CELLS, GridGeometry, Inspection, OccupancyGrid};

/// Drivable.
pub const FREE: Rgb = [0xF4, 0xF4, 0xF2];
/// Not drivable.
pub const OCCUPIED: Rgb = [0x55, 0x5B, 0x66];
/// Between cells.
pub const LINE: Rgb = [0xDC, 0xDD, 0xDF];

/// Colour of what a layer made wrong.
pub fn of_layer(layer: Layer) -> Rgb {
    match layer {
        Layer::Boundary => rgb(0),
        Layer::Shadow => rgb(3),
        Layer::SpeedBump => [0xF0, 0xE4, 0x42],
        Layer::FalseFree => rgb(2),
        Layer::Blob => rgb(1),
        Layer::Stain => rgb(4),
        Layer::Flicker => rgb(5),
        Layer::Dropout => rgb(6),
    }
}

/// 25×25 cells. Cells that a layer made wrong have its colour: full where they are shown as occupied, as a frame where
/// they are shown as free.
///
/// # Errors
/// If the picture would be too large.
pub fn grid(
    grid: &OccupancyGrid,
    cell_px: f32,
    wrong: impl Fn(usize, usize) -> Option<Layer>,
) -> anyhow::Result<Drawing> {
    let mut drawing = Drawing::new(Vec2::splat(cell_px * GRID_CELLS as f32), LINE)?;
    for (row, col) in (0..GRID_CELLS).flat_map(|row| (0..GRID_CELLS).map(move |col| (row, col))) {
        let corner = Vec2::new(col as f32, row as f32) * cell_px;
        let inner = Vec2::splat(cell_px - 1.0);
        let is_occupied = grid.is_occupied(row, col);
        match wrong(row, col) {
            Some(layer) => {
                drawing.rectangle(corner, inner, of_layer(layer));
                if !is_occupied {
                    let frame = (0.2 * cell_px).ceil();
                    drawing.rectangle(corner + Vec2::splat(frame), inner - Vec2::splat(2.0 * frame), FREE);
                }
            }
            None => drawing.rectangle(corner, inner, if is_occupied { OCCUPIED } else { FREE }),
        }
    }
    Ok(drawing)
}

/// 200×200 pixels, each `scale` pixels wide, wrong ones in the colour of the layer that made them so: darker where they
/// are perceived as occupied.
///
/// # Errors
/// If the picture would be too large.
pub fn view(inspection: &Inspection, scale: f32, is_clean: bool) -> anyhow::Result<Drawing> {
    let seen = if is_clean { &inspection.clean } else { &inspection.perceived };
    let colour = |row: usize, col: usize| {
        let wrong = inspection.pixel(row, col).filter(|_| !is_clean);
        match (wrong, seen.is_occupied(row, col)) {
            (None, true) => OCCUPIED,
            (None, false) => FREE,
            (Some(layer), true) => of_layer(layer),
            (Some(layer), false) => of_layer(layer).map(|channel| channel / 2 + 0x7F),
        }
    };
    let mut drawing = Drawing::new(Vec2::splat(BEV_PIXELS as f32 * scale), FREE)?;
    for row in 0..BEV_PIXELS {
        let mut col = 0;
        while col < BEV_PIXELS {
            let rgb = colour(row, col);
            let run = (col..BEV_PIXELS).take_while(|&next| colour(row, next) == rgb).count();
            if rgb != FREE {
                let corner = Vec2::new(col as f32, row as f32) * scale;
                drawing.rectangle(corner, Vec2::new(run as f32, 1.0) * scale, rgb);
            }
            col += run;
        }
    }
    Ok(drawing)
}

/// Where a point of the ego frame lies in a picture of the patch, pixels; points outside lie outside.
pub fn pixel(point: LookAheadPoint, geometry: &GridGeometry, side_px: f32) -> Vec2 {
    Vec2::from(point.to_image_fraction(geometry)) * side_px
}

/// A point with its 1σ and 2σ ellipses.
pub fn draw_prediction(drawing: &mut Drawing, point: LookAheadPoint, spread: Option<Spread>, geometry: &GridGeometry) {
    let side_px = drawing.size_px().x;
    let at = pixel(point, geometry, side_px);
    let px_per_m = side_px / geometry.side_m;
    if let Some(spread) = spread {
        for k in [1.0, 2.0] {
            let radii = k * px_per_m * Vec2::new(spread.left_m, spread.ahead_m);
            let corner = |i: u8| at + radii * maths::unit(f32::from(i) / 36.0 * std::f32::consts::TAU);
            drawing.outline((0..36).map(corner).collect(), PREDICTION, 1.5);
        }
    }
    drawing.disc(at, 6.5, [0xFF; 3]);
    drawing.disc(at, 5.0, PREDICTION);
}

/// The network's point.
pub const PREDICTION: Rgb = [0xD5, 0x5E, 0x00];
/// The expert's point.
pub const LABEL: Rgb = [0x00, 0x72, 0xB2];

/// The expert's point: a square, to be told apart from the network's without colours.
pub fn draw_label(drawing: &mut Drawing, point: LookAheadPoint, geometry: &GridGeometry) {
    let at = pixel(point, geometry, drawing.size_px().x);
    drawing.rectangle(at - Vec2::splat(6.5), Vec2::splat(13.0), [0xFF; 3]);
    drawing.rectangle(at - Vec2::splat(5.0), Vec2::splat(10.0), LABEL);
}

/// Swatches with small letters, in rows that fit into a width; returns their height, pixels.
pub fn draw_small_legend(drawing: &mut Drawing, at: Vec2, width_px: f32, entries: &[LegendEntry]) -> f32 {
    let (places, height_px) = small_legend(width_px, entries);
    for ((rgb, name), place) in entries.iter().zip(places) {
        drawing.rectangle(at + place + Vec2::new(0.0, 2.0), Vec2::splat(14.0), *rgb);
        drawing.text(name.clone(), at + place + Vec2::new(20.0, 0.0), Font::Small, INK);
    }
    height_px
}

/// Where the entries of a small legend stand, and its height, pixels.
pub fn small_legend(width_px: f32, entries: &[LegendEntry]) -> (Vec<Vec2>, f32) {
    let line = Font::Small.height_px() + 6.0;
    let mut next = Vec2::ZERO;
    let place = |(_, name): &LegendEntry| {
        let needed = 20.0 + Font::Small.width_px(name);
        if next.x > 0.0 && next.x + needed > width_px {
            next = Vec2::new(0.0, next.y + line);
        }
        let place = next;
        next.x += needed + 20.0;
        place
    };
    let places: Vec<Vec2> = entries.iter().map(place).collect();
    let height_px = places.last().map_or(0.0, |last| last.y + line);
    (places, height_px)
}
