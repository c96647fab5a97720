//! Calibration of a network: its errors against the σ that it predicts.

use policy::checkpoint::Checkpoint;
use policy::dataset::Sample;

/// Bins of an axis, each with the same number of samples.
const BINS: usize = 10;

/// Errors of one axis of the look-ahead point against the σ predicted for them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AxisCalibration {
    /// `across`, `along`.
    pub name: String,
    /// Samples.
    pub samples: usize,
    /// Share of the labels within 1 σ and 2 σ of the answer, 0…1.
    pub coverage: [f64; 2],
    /// Root mean square of the predicted σ and of the error, metres, from the surest tenth of the samples to the least
    /// sure.
    pub bins: Vec<[f64; 2]>,
}

impl AxisCalibration {
    /// The calibration of `(error, predicted σ)` per sample, metres.
    pub fn of(name: &str, samples: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut samples: Vec<(f64, f64)> = samples.into_iter().collect();
        samples.sort_by(|a, b| a.1.total_cmp(&b.1));
        let n = samples.len().max(1) as f64;
        let within = |k: f64| samples.iter().filter(|(error, sigma)| error.abs() <= k * sigma).count() as f64 / n;
        let rms =
            |values: &mut dyn Iterator<Item = f64>, n: usize| (values.map(|v| v * v).sum::<f64>() / n as f64).sqrt();
        let bins = BINS.min(samples.len());
        let bin = |bin: &[(f64, f64)]| {
            [rms(&mut bin.iter().map(|s| s.1), bin.len()), rms(&mut bin.iter().map(|s| s.0), bin.len())]
        };
        Self {
            name: name.to_owned(),
            samples: samples.len(),
            coverage: [within(1.0), within(2.0)],
            bins: (0..bins).map(|i| bin(&samples[i * samples.len() / bins..(i + 1) * samples.len() / bins])).collect(),
        }
    }
}

/// Both axes of a policy on labelled samples: across and along the car, metres.
pub fn of_policy(policy: &Checkpoint, samples: &[&Sample]) -> [AxisCalibration; 2] {
    let grids: Vec<_> = samples.iter().map(|sample| &sample.grid).collect();
    let predictions = policy.predictor().predict(&grids);
    let side_m = f64::from(policy.geometry().side_m);
    [("across", 0), ("along", 1)].map(|(name, axis)| {
        let errors = samples.iter().zip(&predictions).map(|(sample, prediction)| {
            let error = f64::from(sample.label[axis] - prediction.mean[axis]);
            (side_m * error, side_m * f64::from(prediction.sigma[axis]))
        });
        AxisCalibration::of(name, errors)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::conditions::Conditions;
    use policy::network::{InferenceSettings, NetworkArchitecture, Weights};
    use sim::episode::EpisodeSettings;
    use sim::sensing::OccupancyGrid;

    /// Four errors by hand: σ = 1 for all, errors 0.5, −0.9, 1.5 and 3: half within 1 σ, three quarters within 2 σ.
    #[test]
    fn coverage_by_hand() {
        let of = AxisCalibration::of("along", [(0.5, 1.0), (-0.9, 1.0), (1.5, 1.0), (3.0, 1.0)]);
        assert_eq!((of.samples, of.coverage), (4, [0.5, 0.75]));
        // The surest first: σ 0.1 with error 0.2, then σ 2 with error 1.
        let of = AxisCalibration::of("along", [(1.0, 2.0), (-0.2, 0.1)]);
        assert_eq!(of.bins, [[0.1, 0.2], [2.0, 1.0]]);
        let of = AxisCalibration::of("along", (0..12).map(|i| (1.0, f64::from(i))));
        assert_eq!(of.bins.len(), BINS, "twelve in ten groups of one or two");
    }

    /// A network that answers one point, and is surer of its side: u is across, w along, a side of the image is 12 m.
    #[test]
    fn across_is_u_and_along_is_w_in_metres() {
        let mut weights = Weights::zeros(NetworkArchitecture { modes: 1, ..NetworkArchitecture::compact() });
        // log σ²: −4.6 across, the middle of the clamp; −4.6 + 4.6 · ½ along.
        let along = -4.6 + 4.6 * libm::atanhf(0.5);
        weights.parts_mut().fc2_bias.copy_from_slice(&[0.5, 0.4, -4.6, along]);
        let conditions = Conditions::of(&EpisodeSettings::paper());
        let policy = Checkpoint { weights, conditions, inference: InferenceSettings::plain() };
        let sample = Sample { grid: OccupancyGrid::free(), label: [0.6, 0.4], tau_hat: 0.0 };
        let axes = of_policy(&policy, &[&sample]);
        // 12 m · exp(−2.3) with an error of 1.2 m, and 12 m · exp(−1.15) with none.
        for (found, (name, expected)) in axes.iter().zip([("across", [1.2031, 1.2]), ("along", [3.7996, 0.0])]) {
            assert_eq!((found.name.as_str(), found.samples, found.bins.len()), (name, 1, 1));
            assert!(found.bins[0].iter().zip(expected).all(|(of, expected)| (of - expected).abs() < 1e-3), "{found:?}");
        }
    }
}
