//! Many lots on one page.

use super::drawing::{Drawing, Font, SIDE_MAX_PX};
use super::lot::{self, View, shortened};
use anyhow::ensure;
use sim::geometry::Vec2;
use sim::map::Map;

/// Side of a tile, pixels.
const TILE_PX: f32 = 300.0;
const GAP_PX: f32 = 14.0;
const COLS_MAX: usize = 5;
const FONT: Font = Font::Small;

/// Checks that so many lots find room.
///
/// # Errors
/// If they do not.
pub fn check(lots: usize) -> anyhow::Result<()> {
    let rows = ((SIDE_MAX_PX - GAP_PX) / step().y).floor() as usize;
    ensure!(
        lots <= COLS_MAX * rows,
        "a contact sheet has room for {} lots, not for {lots}; name fewer",
        COLS_MAX * rows
    );
    Ok(())
}

/// From one tile to the next, pixels.
fn step() -> Vec2 {
    Vec2::new(TILE_PX + GAP_PX, TILE_PX + GAP_PX + FONT.height_px() + 4.0)
}

/// Every lot in a tile of its own, all tiles equally large, each with its name and length.
///
/// # Errors
/// If the picture would be too large.
pub fn picture(maps: &[Map]) -> anyhow::Result<Drawing> {
    let cols = (maps.len() as f32).sqrt().ceil().clamp(1.0, COLS_MAX as f32) as usize;
    let rows = maps.len().div_ceil(cols);
    let step = step();
    let size = Vec2::new(cols as f32, rows as f32) * step + Vec2::splat(GAP_PX);
    let mut sheet = Drawing::new(size, [0xFF; 3])?;
    for (index, map) in maps.iter().enumerate() {
        let at = Vec2::new((index % cols) as f32, (index / cols) as f32) * step + Vec2::splat(GAP_PX);
        sheet.inset(tile(map)?, at);
        let name = format!("{}, {:.0} m", map.scenario().name, map.path().length_m());
        let letters = (TILE_PX / FONT.width_px("x")) as usize;
        sheet.text(shortened(&name, letters), at + Vec2::new(0.0, TILE_PX + 3.0), FONT, lot::INK);
    }
    Ok(sheet)
}

fn tile(map: &Map) -> anyhow::Result<Drawing> {
    let mut tile = Drawing::new(Vec2::splat(TILE_PX), lot::GROUND)?;
    let view = View::fitting(map, Vec2::splat(TILE_PX));
    lot::draw_ground(&mut tile, &view, map);
    lot::draw_obstacles(&mut tile, &view, map);
    let route = map.path().poses().iter().map(|pose| pose.position());
    tile.line(view.pixels(route), lot::ROUTE, 2.0);
    tile.disc(view.pixel(map.start().position()), 5.0, lot::ROUTE);
    lot::draw_finish(&mut tile, &view, map);
    Ok(tile)
}
