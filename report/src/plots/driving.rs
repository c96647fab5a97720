//! How well drivers drove.

use super::style::{self, Axis, Figure, Key, Labels, Look, colour};
use plotters::prelude::*;

const ROW_PX: u32 = 30;
/// Head and axis of a plot with rows.
const AROUND_ROWS_PX: u32 = 112;
/// Names of rows take at most this much of the width.
const NAMES_MAX_PX: f64 = 250.0;

/// Near-collisions of a driver on some lots.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RateRow {
    /// What the row is about: the driver, or driver and lot.
    pub name: String,
    /// Near-collisions per 100 m.
    pub per_100m: f64,
    /// Its interval of 95 %.
    pub interval: [f64; 2],
    /// Rows of one group have one colour.
    pub group: usize,
}

/// A dot and a whisker per row.
pub fn rates(title: &str, rows: &[RateRow]) -> String {
    let most = rows.iter().map(|row| row.interval[1].max(row.per_100m)).fold(0.0, f64::max);
    let high = style::round_up(1.04 * most);
    let names = row_names(rows.iter().map(|row| &row.name));
    let figure = rows_figure(title, &names, "near-collisions per 100 m, with 95 % interval", 0.0..high);
    figure.svg(|chart| {
        for (index, row) in rows.iter().enumerate() {
            let (y, colour) = (height(index, rows.len()), colour(row.group));
            let [from, to] = row.interval;
            style::line(chart, vec![(from, y), (to, y)], colour, 3)?;
            for end in [from, to] {
                style::line(chart, vec![(end, y - 0.18), (end, y + 0.18)], colour, 2)?;
            }
            style::marker(chart, row.group, (row.per_100m, y), colour)?;
        }
        Ok(())
    })
}

/// A rate where something was set to a value.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RatePoint {
    /// The value, in the unit of the x axis.
    pub x: f64,
    /// Near-collisions per 100 m.
    pub per_100m: f64,
    /// Its interval of 95 %.
    pub interval: [f64; 2],
}

/// A driver at several values.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RateSeries {
    /// The driver.
    pub name: String,
    /// Its rates, in order of the values.
    pub points: Vec<RatePoint>,
}

/// Rates against the noise in multiples of the level `paper`.
pub fn rates_against_noise(title: &str, drivers: &[RateSeries]) -> String {
    let last = drivers.iter().flat_map(|driver| &driver.points).map(|point| point.x).fold(0.0, f64::max).max(1.0);
    let x = Axis {
        label: "noise, in multiples of the level “paper”",
        range: -0.06 * last..1.06 * last,
        ticks: 6,
        labels: Labels::Numbers(1),
    };
    rates_against(title, x, drivers)
}

/// Rates against the number of different lots that were trained on: `x` is the place in `counts`, side by side whatever
/// lies between them.
pub fn rates_against_lots(title: &str, counts: &[String], drivers: &[RateSeries]) -> String {
    let x = Axis {
        label: "different lots that were trained on",
        range: -0.4..(counts.len() as f64 - 0.6).max(0.6),
        ticks: counts.len(),
        labels: Labels::Names(counts),
    };
    rates_against(title, x, drivers)
}

/// Rates against the share of the ticks at which the expert is asked while data are collected, percent.
pub fn rates_against_effort(title: &str, rules: &[RateSeries]) -> String {
    let x = Axis {
        label: "ticks at which the expert is asked while collecting, %",
        range: -4.0..104.0,
        ticks: 6,
        labels: Labels::Numbers(0),
    };
    rates_against(title, x, rules)
}

/// Points of different drivers are at one place if they are no farther apart than this share of the axis; they are drawn as
/// far apart …
const APART: f64 = 0.007;
/// … and all that are at one place within this share.
const APART_ALL: f64 = 0.05;

/// How far beside its value a point of a driver is drawn, in units of the axis. Points at one place are set a little apart,
/// so that whiskers do not hide each other; a point alone stands where it was measured.
fn aside(drivers: &[RateSeries], driver: usize, x: f64, span: f64) -> f64 {
    let is_there = |other: &&RateSeries| other.points.iter().any(|point| (point.x - x).abs() <= APART * span);
    let before = drivers[..driver].iter().filter(is_there).count();
    let after = drivers[driver + 1..].iter().filter(is_there).count();
    let apart = APART.min(APART_ALL / (before + after).max(1) as f64);
    0.5 * apart * span * (before as f64 - after as f64)
}

/// A line with whiskers per driver.
fn rates_against(title: &str, x: Axis<'_>, drivers: &[RateSeries]) -> String {
    let points = || drivers.iter().flat_map(|driver| &driver.points);
    let most = points().map(|point| point.interval[1].max(point.per_100m)).fold(0.0, f64::max);
    let high = style::round_up(1.02 * most);
    let legend = drivers.iter().enumerate().map(|(i, driver)| Key {
        name: style::fitting(&driver.name, 400.0),
        colour: colour(i),
        look: Look::Marked(i),
    });
    let span = x.range.end - x.range.start;
    let figure = Figure {
        title,
        height_px: style::HEIGHT_PX + 40,
        x,
        y: Axis {
            label: "near-collisions per 100 m",
            range: 0.0..high,
            ticks: 6,
            labels: Labels::Numbers(style::decimals(high)),
        },
        left_px: 62,
        legend: legend.collect(),
    };
    figure.svg(|chart| {
        for (i, driver) in drivers.iter().enumerate() {
            let at = |point: &RatePoint| (point.x + aside(drivers, i, point.x, span), point.per_100m);
            style::line(chart, driver.points.iter().map(at).collect(), colour(i), 2)?;
            for point in &driver.points {
                let (x, _) = at(point);
                let [from, to] = point.interval;
                style::line(chart, vec![(x, from), (x, to)], colour(i), 1)?;
                style::marker(chart, i, at(point), colour(i))?;
            }
        }
        Ok(())
    })
}

/// A value per run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Distribution {
    /// What the row is about.
    pub name: String,
    /// The values of the runs.
    pub values: Vec<f64>,
    /// Rows of one group have one colour.
    pub group: usize,
}

/// Every run as a dot, with a box from the lower to the upper quartile and a bar at the median, a row per driver.
pub fn safe_ratios(title: &str, rows: &[Distribution]) -> String {
    let lowest = rows.iter().flat_map(|row| row.values.iter().copied()).fold(1.0, f64::min);
    let low = ((lowest - 0.02) * 10.0).floor().max(0.0) / 10.0;
    let names = row_names(rows.iter().map(|row| &row.name));
    let label = "safe ratio of a run (drivable share of the 1 m ring)";
    let figure = rows_figure(title, &names, label, low..1.0);
    figure.svg(|chart| {
        for (index, row) in rows.iter().enumerate() {
            let (y, colour) = (height(index, rows.len()), colour(row.group));
            let mut sorted = row.values.clone();
            sorted.sort_by(f64::total_cmp);
            let Some([q1, median, q3]) = quartiles(&sorted) else { continue };
            let outline = [(q1, y - 0.3), (q3, y + 0.3)];
            chart.draw_series([
                Rectangle::new(outline, colour.mix(0.15).filled()),
                Rectangle::new(outline, colour.stroke_width(1)),
            ])?;
            // Dots lie on three lines in turn: neighbours in value do not hide each other.
            let dot =
                |(i, value): (usize, f64)| Circle::new((value, y + 0.15 * ((i % 3) as f64 - 1.0)), 2, colour.filled());
            let dots = sorted.iter().copied().step_by(sorted.len().div_ceil(DOTS_MAX));
            chart.draw_series(dots.enumerate().map(dot))?;
            style::line(chart, vec![(median, y - 0.36), (median, y + 0.36)], style::INK, 3)?;
        }
        Ok(())
    })
}

/// Dots of a row at most (chosen: more cannot be told apart).
const DOTS_MAX: usize = 500;

/// Linear interpolation between order statistics, as numpy's `percentile`.
fn quartiles(sorted: &[f64]) -> Option<[f64; 3]> {
    let last = sorted.len().checked_sub(1)?;
    Some([0.25, 0.5, 0.75].map(|share| {
        let at = share * last as f64;
        let below = at as usize;
        sorted[below] + at.fract() * (sorted[(below + 1).min(last)] - sorted[below])
    }))
}

/// Height of a row: the first is the highest.
fn height(index: usize, rows: usize) -> f64 {
    (rows - 1 - index) as f64
}

/// Names that fit beside a plot, from the lowest row to the highest.
fn row_names<'a>(names: impl DoubleEndedIterator<Item = &'a String>) -> Vec<String> {
    names.rev().map(|name| style::fitting(name, NAMES_MAX_PX)).collect()
}

fn rows_figure<'a>(title: &'a str, names: &'a [String], label: &'a str, range: std::ops::Range<f64>) -> Figure<'a> {
    let longest = names.iter().map(|name| style::text_px(name)).fold(40.0, f64::max);
    let (span, rows) = (range.end - range.start, names.len().max(1));
    Figure {
        title,
        height_px: AROUND_ROWS_PX + ROW_PX * rows as u32,
        x: Axis { label, range, ticks: 6, labels: Labels::Numbers(style::decimals(span).max(1)) },
        y: Axis { label: "", range: -0.5..rows as f64 - 0.5, ticks: 2 * rows + 2, labels: Labels::Names(names) },
        left_px: longest as u32 + 16,
        legend: Vec::new(),
    }
}
