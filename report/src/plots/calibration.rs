//! Whether the network knows how wrong it is.

use super::style::{self, Axis, Figure, Key, Labels, Look, colour};
use evaluation::calibration::AxisCalibration;

/// Shares of a normal distribution within one and two standard deviations.
const NORMAL: [f64; 2] = [0.6827, 0.9545];

/// Left: how many labels lie within 1 σ and 2 σ. Right: the error against σ. A calibrated network lies on the dashed
/// lines; above the diagonal it is too sure of itself.
pub fn calibration(axes: &[AxisCalibration]) -> String {
    let most = axes.iter().flat_map(|axis| axis.bins.iter().flatten()).copied().fold(0.0, f64::max);
    let high = style::round_up(1.05 * most);
    let key = |(i, axis): (usize, &AxisCalibration)| Key {
        name: axis.name.clone(),
        colour: colour(i),
        look: Look::Marked(i),
    };
    let coverage = Figure {
        title: "Labels within kσ",
        height_px: style::HEIGHT_PX,
        x: Axis { label: "k (dashed: normal)", range: 0.5..2.5, ticks: 3, labels: Labels::Numbers(0) },
        y: Axis { label: "share of the samples", range: 0.0..1.05, ticks: 6, labels: Labels::Numbers(1) },
        left_px: 58,
        legend: axes.iter().enumerate().map(key).collect(),
    };
    let decimals = style::decimals(high);
    let errors = Figure {
        title: "Error against predicted σ",
        height_px: style::HEIGHT_PX,
        x: Axis { label: "predicted σ, m", range: 0.0..high, ticks: 5, labels: Labels::Numbers(decimals) },
        y: Axis { label: "RMS error, m", range: 0.0..high, ticks: 6, labels: Labels::Numbers(decimals) },
        left_px: 58,
        legend: axes.iter().enumerate().map(key).collect(),
    };
    style::side_by_side("Variance calibration", style::HEIGHT_PX, |[left, right]| {
        coverage.draw(left, |chart| {
            for (k, share) in [1.0, 2.0].into_iter().zip(NORMAL) {
                style::dashes(chart, (k - 0.4, share), (k + 0.4, share), style::INK)?;
                for (i, axis) in axes.iter().enumerate() {
                    let x = k + 0.16 * (i as f64 - 0.5 * (axes.len() as f64 - 1.0));
                    style::marker(chart, i, (x, axis.coverage[k as usize - 1]), colour(i))?;
                }
            }
            Ok(())
        })?;
        errors.draw(right, |chart| {
            style::dashes(chart, (0.0, 0.0), (high, high), style::INK)?;
            for (i, axis) in axes.iter().enumerate() {
                let points: Vec<(f64, f64)> = axis.bins.iter().map(|&[sigma, error]| (sigma, error)).collect();
                style::line(chart, points.clone(), colour(i), 2)?;
                for at in points {
                    style::marker(chart, i, at, colour(i))?;
                }
            }
            Ok(())
        })
    })
}
