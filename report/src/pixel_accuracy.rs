//! How wrong the noisy view is, as Markdown.

use crate::markdown::{escaped, table_of};
use comfy_table::Table;
use evaluation::pixel_accuracy::{PAPER, Pixels};
use experiment::settings::NoiseChoice;
use sim::sensing::{BEV_PIXELS, GRID_CELLS};

/// The table without rows.
pub fn table() -> Table {
    table_of(&[
        "lot",
        "level",
        "poses",
        "accuracy %",
        "paper %",
        "false occupied %",
        "false free %",
        "cells wrong %",
        "occupied %",
    ])
}

/// A lot at a noise level.
pub fn row(pixels: &Pixels, lot: &str, noise: NoiseChoice) -> Vec<String> {
    let all = (pixels.poses * (BEV_PIXELS * BEV_PIXELS) as u64) as f64;
    let cells = (pixels.poses * (GRID_CELLS * GRID_CELLS) as u64) as f64;
    let percent = |count: u64, of: f64| format!("{:.2}", 100.0 * count as f64 / of);
    let paper = PAPER.iter().find(|(name, _)| *name == lot && noise == NoiseChoice::Paper);
    vec![
        escaped(lot),
        noise.name(),
        pixels.poses.to_string(),
        format!("{:.2}", 100.0 - 100.0 * (pixels.false_occupied + pixels.false_free) as f64 / all),
        paper.map_or_else(|| "–".to_owned(), |(_, percent)| format!("{percent:.2}")),
        percent(pixels.false_occupied, all),
        percent(pixels.false_free, all),
        percent(pixels.cells_wrong, cells),
        percent(pixels.occupied, all),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All figures of a lot called `a|b` stood under other headings.
    #[test]
    fn a_bar_in_the_name_of_a_lot_ends_no_cell() {
        let cells = row(&Pixels { poses: 1, ..Pixels::default() }, "a|b", NoiseChoice::Paper);
        assert_eq!((cells[0].as_str(), cells[3].as_str()), ("a\\|b", "100.00"));
    }
}
