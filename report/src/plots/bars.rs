//! Quantities of several drivers by lot, the paper's beside ours.

use super::style::{self, Axis, Figure, Key, Labels, Look, colour};
use plotters::prelude::*;

/// A bar.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bar {
    /// Which of the drivers.
    pub driver: usize,
    /// Its height.
    pub value: f64,
    /// Interval of 95 %, where one is known.
    pub interval: Option<[f64; 2]>,
    /// The paper's: drawn pale.
    pub is_papers: bool,
}

/// Bars that stand together.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BarGroup {
    /// Written under them.
    pub name: String,
    /// Its bars from left to right.
    pub bars: Vec<Bar>,
}

/// Share of its place that a bar fills.
const FILLED: f64 = 0.8;
/// Room between two groups, in places.
const GAP: f64 = 1.5;

/// A group of bars per lot, colours by driver; pale bars are the paper's, whiskers intervals of 95 %.
pub fn bars(title: &str, quantity: &str, drivers: &[&str], groups: &[BarGroup]) -> String {
    let tops = groups.iter().flat_map(|group| &group.bars);
    let top = tops.map(|bar| bar.interval.map_or(bar.value, |[_, upper]| upper.max(bar.value))).fold(0.0, f64::max);
    let high = style::round_up(1.02 * top);
    let names: Vec<String> = groups.iter().map(|group| group.name.clone()).collect();
    let places = groups.iter().map(|group| group.bars.len()).max().unwrap_or(1) as f64 + GAP;
    let key = |(i, name): (usize, &&str)| Key { name: (*name).to_owned(), colour: colour(i), look: Look::Marked(2) };
    let figure = Figure {
        title,
        height_px: style::HEIGHT_PX,
        x: Axis {
            label: "pale: the paper, full: here",
            range: -0.5..groups.len().max(1) as f64 - 0.5,
            ticks: 2 * groups.len() + 2,
            labels: Labels::Names(&names),
        },
        y: Axis { label: quantity, range: 0.0..high, ticks: 6, labels: Labels::Numbers(style::decimals(high).max(1)) },
        left_px: 58,
        legend: drivers.iter().enumerate().map(key).collect(),
    };
    figure.svg(|chart| {
        for (place, group) in groups.iter().enumerate() {
            for (index, bar) in group.bars.iter().enumerate() {
                let middle = place as f64 + (index as f64 - 0.5 * (group.bars.len() as f64 - 1.0)) / places;
                let (left, right) = (middle - 0.5 * FILLED / places, middle + 0.5 * FILLED / places);
                let paint = colour(bar.driver).mix(if bar.is_papers { 0.35 } else { 1.0 });
                let body = Rectangle::new([(left, 0.0), (right, bar.value)], paint.filled());
                let outline = Rectangle::new([(left, 0.0), (right, bar.value)], colour(bar.driver).stroke_width(1));
                chart.draw_series([body, outline])?;
                if let Some([lower, upper]) = bar.interval {
                    style::line(chart, vec![(middle, lower), (middle, upper)], style::INK, 2)?;
                    let half = 0.2 * FILLED / places;
                    for end in [lower, upper] {
                        style::line(chart, vec![(middle - half, end), (middle + half, end)], style::INK, 2)?;
                    }
                }
            }
        }
        Ok(())
    })
}
