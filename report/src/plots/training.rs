//! How a training went.

use super::style::{self, Axis, Figure, Key, Labels, Look, colour};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use policy::fit::learning::LearningCurve;

/// Optimiser steps of a fit.
fn steps(curve: &LearningCurve) -> u32 {
    curve.training.iter().chain(&curve.validation).map(|&(step, _)| step).max().unwrap_or(0)
}

/// Over optimiser steps, rounds after each other: the error of the look-ahead point on held-back samples, metres, which
/// says how good the policy is; under it the losses, each on an axis of its own, because with β > 0 ([`policy::loss`])
/// they are different quantities. The training loss is drawn as means over up to 240 stretches of equal length.
pub fn learning(rounds: &[LearningCurve]) -> String {
    let steps: u32 = rounds.iter().map(steps).sum();
    let stretch = (steps / 240).max(1);
    let curves = |of: &dyn Fn(&LearningCurve) -> Vec<(u32, f64)>| rounds.iter().map(of).collect::<Vec<_>>();
    let panels = [
        ("Validation error of the look-ahead point", "RMS, m", "", curves(&|round| round.validation_rmse_m.clone())),
        ("Validation loss", "nats per sample", "", curves(&|round| round.validation.clone())),
        ("Training loss", "nats per sample", "optimiser step", curves(&|round| means(&round.training, stretch))),
    ];
    style::stacked("Learning curves", panels.len(), PANEL_PX, |areas| {
        for (series, (area, (title, y_label, x_label, curves))) in areas.iter().zip(&panels).enumerate() {
            panel(title, [x_label, y_label], steps, curves)
                .draw(area, |chart| draw_rounds(chart, rounds, curves, steps, series))?;
        }
        Ok(())
    })
}

/// Height of one of the curves, pixels.
const PANEL_PX: u32 = 230;

fn panel<'a>(title: &'a str, [x_label, y_label]: [&'a str; 2], steps: u32, curves: &[Vec<(u32, f64)>]) -> Figure<'a> {
    let (low, high) = range(curves);
    Figure {
        title,
        height_px: PANEL_PX,
        x: Axis { label: x_label, range: 0.0..1.01 * f64::from(steps.max(1)), ticks: 6, labels: Labels::Numbers(0) },
        y: Axis { label: y_label, range: low..high, ticks: 5, labels: Labels::Numbers(style::decimals(high - low)) },
        left_px: 66,
        legend: Vec::new(),
    }
}

fn draw_rounds(
    chart: &mut style::Chart<'_, '_>,
    rounds: &[LearningCurve],
    curves: &[Vec<(u32, f64)>],
    steps_of_all: u32,
    series: usize,
) -> style::Drawn {
    let (low, high) = range(curves);
    let mut first = 0;
    for (index, (round, curve)) in rounds.iter().zip(curves).enumerate() {
        let at = |&(step, value): &(u32, f64)| (f64::from(first + step), value.clamp(low, high));
        let points: Vec<(f64, f64)> = curve.iter().map(at).collect();
        if let Some(&last) = points.last() {
            style::marker(chart, series, last, colour(series))?;
        }
        style::line(chart, points, colour(series), 2)?;
        if index > 0 {
            style::dashes(chart, (f64::from(first), low), (f64::from(first), high), style::FAINT)?;
        }
        first += steps(round);
        if rounds.len() > 1 {
            // Where a round ends its curve is low.
            let at = (f64::from(first) - 0.012 * f64::from(steps_of_all), high);
            style::label(chart, &round.name, at, style::INK, Pos::new(HPos::Right, VPos::Top))?;
        }
    }
    Ok(())
}

/// Means of stretches of so many steps, each at its last step.
fn means(points: &[(u32, f64)], stretch: u32) -> Vec<(u32, f64)> {
    let same = |a: &(u32, f64), b: &(u32, f64)| a.0.saturating_sub(1) / stretch == b.0.saturating_sub(1) / stretch;
    let mean = |points: &[(u32, f64)]| {
        let sum: f64 = points.iter().map(|&(_, value)| value).sum();
        Some((points.last()?.0, sum / points.len() as f64))
    };
    points.chunk_by(same).filter_map(mean).collect()
}

/// The range from the lowest value to the 99th percentile: the first few steps are many times higher than all others. Up to a
/// hundred values are all within it.
fn range(curves: &[Vec<(u32, f64)>]) -> (f64, f64) {
    let mut values: Vec<f64> =
        curves.iter().flatten().map(|&(_, value)| value).filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let (Some(&low), Some(&high)) = (values.first(), values.get(((values.len().max(1) - 1) * 99).div_ceil(100))) else {
        return (0.0, 1.0);
    };
    let room = 0.1 * (high - low).max(0.02);
    // The names of the rounds stand at the top.
    (low - room, high + 2.5 * room)
}

/// η̂ of one training.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct EtaSeries {
    /// Its name in the legend.
    pub name: String,
    /// Iteration, from 1, and the share of ticks the network drove, 0…1.
    pub points: Vec<(u32, f64)>,
}

/// η̂ per iteration of one or more trainings beside the paper's, if there is any of it; `threshold` is η, above which
/// iterations end.
pub fn eta(ours: &[EtaSeries], paper: &[(u32, f64)], threshold: f64) -> String {
    let points = ours.iter().flat_map(|series| &series.points).chain(paper);
    let last = points.map(|&(iteration, _)| iteration).max().unwrap_or(1).max(2);
    let mut legend: Vec<Key> = ours
        .iter()
        .enumerate()
        .map(|(i, series)| Key { name: series.name.clone(), colour: colour(i), look: Look::Marked(i) })
        .collect();
    if !paper.is_empty() {
        legend.push(Key { name: "paper".to_owned(), colour: style::FAINT, look: Look::Marked(2) });
    }
    legend.push(Key { name: format!("η = {threshold}: stop"), colour: style::INK, look: Look::Dashes });
    let figure = Figure {
        title: "Share of ticks driven by the network",
        height_px: style::HEIGHT_PX,
        x: Axis {
            label: "DAgger iteration",
            range: 0.7..f64::from(last) + 0.3,
            ticks: last as usize,
            labels: Labels::Numbers(0),
        },
        y: Axis { label: "η̂ (share of ticks)", range: 0.0..1.05, ticks: 6, labels: Labels::Numbers(1) },
        left_px: 62,
        legend,
    };
    figure.svg(|chart| {
        style::dashes(chart, (0.7, threshold), (f64::from(last) + 0.3, threshold), style::INK)?;
        let paper = std::iter::once((2, style::FAINT, paper));
        let ours = ours.iter().enumerate().map(|(i, series)| (i, colour(i), series.points.as_slice()));
        for (shape, colour, points) in paper.chain(ours) {
            let points: Vec<(f64, f64)> = points.iter().map(|&(i, eta)| (f64::from(i), eta)).collect();
            style::line(chart, points.clone(), colour, 2)?;
            for at in points {
                style::marker(chart, shape, at, colour)?;
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The validation loss of a final training, the third value and the highest, was drawn 0.12 too low.
    #[test]
    fn few_values_are_all_within_the_axis_and_of_many_all_but_the_highest() {
        let range_of = |values: &[f64]| range(&[values.iter().map(|&value| (1, value)).collect()]);
        let (low, high) = range_of(&[-3.0, -2.9, -2.63]);
        assert!(low < -3.0 && high > -2.63, "{low} … {high}");
        let many: Vec<f64> = (0..300).map(|i| if i < 2 { 100.0 } else { f64::from(i % 10) }).collect();
        let (low, high) = range_of(&many);
        assert!(low < 0.0 && (9.0..20.0).contains(&high), "{low} … {high}");
    }
}
