//! A trained network that answers grids.

use crate::network::architecture::{NetworkArchitecture, OUTPUTS, POOLED_1, row_width};
use crate::network::inference::InferenceSettings;
use crate::network::log_variance::soft_clamp_log_variance;
use crate::network::look_ahead_net::{LookAheadNet, occupied_tensor};
use crate::network::modes;
use crate::network::weights::Weights;
use burn::tensor::Device;
use sim::driver::{LookAheadPoint, Spread};
use sim::maths;
use sim::sensing::{GridGeometry, OccupancyGrid};

/// What the network answers to one grid, in image fractions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Mean of (u, w), as it left the network: may lie outside [0, 1].
    pub mean: [f32; 2],
    /// Standard deviation of (u, w).
    pub sigma: [f32; 2],
}

impl Prediction {
    /// The prediction from raw outputs; NaN throughout if one of them is not finite, which the loop that drives refuses
    /// ([`sim::batch::NotFinite`]).
    pub fn from_raw(raw: [f32; OUTPUTS]) -> Self {
        if !raw.iter().all(|value| value.is_finite()) {
            return Self { mean: [f32::NAN; 2], sigma: [f32::NAN; 2] };
        }
        let sigma = |raw| maths::exp(0.5 * soft_clamp_log_variance(raw));
        Self { mean: [raw[0], raw[1]], sigma: [sigma(raw[2]), sigma(raw[3])] }
    }

    /// The mean inside the image: what is driven to and compared.
    pub fn clipped_mean(&self) -> [f32; 2] {
        self.mean.map(|fraction| fraction.clamp(0.0, 1.0))
    }

    /// The point to drive to.
    pub fn look_ahead(&self, geometry: GridGeometry) -> LookAheadPoint {
        LookAheadPoint::from_image_fraction(self.clipped_mean(), &geometry)
    }

    /// The standard deviation in metres.
    pub fn spread(&self, geometry: GridGeometry) -> Spread {
        Spread { ahead_m: self.sigma[1] * geometry.side_m, left_m: self.sigma[0] * geometry.side_m }
    }
}

/// Most rows computed in one call. An answer does not depend on the other rows.
const ROWS_MAX: usize = 1024;
/// Most values of the widest layer of a call, 64 MB: wide networks compute fewer rows.
const LAYER_VALUES_MAX: usize = 1 << 24;

/// Most rows of a network computed in one call: bounds the memory.
fn rows_max(architecture: NetworkArchitecture) -> usize {
    let first_map = POOLED_1 * POOLED_1 * architecture.conv1.channels;
    let widest = first_map.max(architecture.features()).max(architecture.hidden);
    (LAYER_VALUES_MAX / widest).min(ROWS_MAX)
}

/// A network ready to answer: on CPUs, wherever it was trained.
#[derive(Debug, Clone)]
pub struct Predictor {
    mirror_averaging: bool,
    modes: usize,
    /// See [`rows_max`].
    rows_max: usize,
    net: LookAheadNet,
    device: Device,
}

impl Predictor {
    /// Makes a network ready. Action smoothing is not done here: it has a memory per car.
    pub fn new(weights: &Weights, inference: InferenceSettings) -> Self {
        let device = Device::flex();
        let net = LookAheadNet::from_weights(weights, &device);
        let architecture = weights.architecture();
        Self {
            mirror_averaging: inference.mirror_averaging,
            modes: architecture.modes,
            rows_max: rows_max(architecture),
            net,
            device,
        }
    }

    /// Answers every grid, in order.
    pub fn predict(&self, grids: &[&OccupancyGrid]) -> Vec<Prediction> {
        self.raw(grids).into_iter().map(Prediction::from_raw).collect()
    }

    /// Whether an answer is one of several ways.
    pub(crate) fn chooses(&self) -> bool {
        self.modes > 1
    }

    /// One answer per grid: means of u and w, raw log-variances of both. Of several modes, the one that is likeliest.
    pub fn raw(&self, grids: &[&OccupancyGrid]) -> Vec<[f32; OUTPUTS]> {
        modes::answers(grids, self.modes, self.mirror_averaging, |grids| self.outputs(grids))
    }

    /// The same, and what the loss of the grids is computed from, `[grids, width]`: of one Gaussian its answers, averaged with
    /// those to mirror images if that is how it drives; else all modes as they leave the network, which nothing is averaged with.
    pub(crate) fn raw_and_for_loss(&self, grids: &[&OccupancyGrid]) -> (Vec<[f32; OUTPUTS]>, Vec<f32>) {
        let mut of_modes = Vec::new();
        let answers = modes::answers(grids, self.modes, self.mirror_averaging, |asked| {
            let rows = self.outputs(asked);
            if self.chooses() {
                of_modes.extend_from_slice(&rows[..grids.len() * row_width(self.modes)]);
            }
            rows
        });
        let for_loss = if self.chooses() { of_modes } else { answers.as_flattened().to_vec() };
        (answers, for_loss)
    }

    /// The outputs of the network itself, one row per grid.
    fn outputs(&self, grids: &[&OccupancyGrid]) -> Vec<f32> {
        let mut outputs = Vec::with_capacity(grids.len() * row_width(self.modes));
        for grids in grids.chunks(self.rows_max) {
            let occupied = occupied_tensor(grids.iter().copied(), &self.device);
            outputs.extend(self.net.forward(occupied, None).into_data().try_into_vec::<f32>().expect("f32"));
        }
        outputs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::architecture::ConvLayer;
    use crate::test_data::lots;
    use sim::seed::RootSeed;

    /// The property that makes closed-loop results independent of how many cars are still on the road.
    #[test]
    fn an_answer_does_not_depend_on_the_other_grids() {
        let grids = lots(53);
        for (architecture, inference) in [
            (NetworkArchitecture::paper(), InferenceSettings::plain()),
            (NetworkArchitecture::compact(), InferenceSettings::smoothed()),
            (
                NetworkArchitecture { modes: 3, residual1: 1, residual2: 1, ..NetworkArchitecture::compact() },
                InferenceSettings::smoothed(),
            ),
        ] {
            let weights = Weights::init(architecture, RootSeed(1), 0);
            let predictor = Predictor::new(&weights, inference);
            let all: Vec<&OccupancyGrid> = grids.iter().collect();
            let together = predictor.raw(&all);
            for (index, grid) in grids.iter().enumerate() {
                assert_eq!(predictor.raw(&[grid])[0], together[index], "grid {index} alone");
            }
            // Other neighbours, other positions, other sizes.
            for start in [1, 7, 18] {
                assert_eq!(predictor.raw(&all[start..])[..], together[start..], "from {start}");
            }
        }
    }

    /// Of several modes it is that of the network itself, whose rows were computed a second time for it.
    #[test]
    fn the_loss_is_of_the_answers_of_one_mode_and_of_all_rows_of_several() {
        let grids = lots(20);
        let grids: Vec<&OccupancyGrid> = grids.iter().collect();
        for inference in [InferenceSettings::plain(), InferenceSettings::smoothed()] {
            for modes in [1, 2] {
                let architecture = NetworkArchitecture { modes, ..NetworkArchitecture::compact() };
                let predictor = Predictor::new(&Weights::init(architecture, RootSeed(1), 0), inference);
                let (answers, for_loss) = predictor.raw_and_for_loss(&grids);
                assert_eq!(answers, predictor.raw(&grids));
                let expected = if modes == 1 { answers.as_flattened().to_vec() } else { predictor.outputs(&grids) };
                assert_eq!(for_loss, expected, "{modes} modes, {inference:?}");
            }
        }
    }

    /// Only the first map was counted: 1024 rows of 65 536 hidden units took 256 MB.
    #[test]
    fn the_widest_layer_bounds_the_rows_of_a_call() {
        let compact = NetworkArchitecture::compact();
        assert_eq!(rows_max(NetworkArchitecture::paper()), ROWS_MAX);
        assert_eq!(rows_max(compact), ROWS_MAX);
        let wide = |channels| ConvLayer { channels, kernel: 3 };
        for (architecture, values) in [
            (NetworkArchitecture { conv1: wide(1024), ..compact }, 144 * 1024),
            (NetworkArchitecture { conv2: wide(1024), ..compact }, 36 * 1024),
            (NetworkArchitecture { hidden: 65_536, ..compact }, 65_536),
        ] {
            assert_eq!(rows_max(architecture), LAYER_VALUES_MAX / values, "{architecture:?}");
        }
    }

    /// Equal to the bit, except for the rounding of 1 − u.
    #[test]
    fn mirror_averaging_answers_mirror_images_alike() {
        let grids = lots(20);
        let mirrored: Vec<OccupancyGrid> = grids.iter().map(OccupancyGrid::mirrored).collect();
        for modes in [1, 2] {
            let architecture = NetworkArchitecture { modes, ..NetworkArchitecture::compact() };
            let weights = Weights::init(architecture, RootSeed(1), 0);
            let predictor = Predictor::new(&weights, InferenceSettings::smoothed());
            let answers = predictor.predict(&grids.iter().collect::<Vec<_>>());
            let images = predictor.predict(&mirrored.iter().collect::<Vec<_>>());
            for (answer, image) in answers.iter().zip(&images) {
                assert!((answer.mean[0] - (1.0 - image.mean[0])).abs() < 1e-6, "{answer:?} {image:?}");
                assert_eq!((answer.mean[1], answer.sigma), (image.mean[1], image.sigma));
            }
        }
    }

    #[test]
    fn one_and_two_threads_answer_the_same_bits() {
        let grids = lots(100);
        let grids: Vec<&OccupancyGrid> = grids.iter().collect();
        let weights = Weights::init(NetworkArchitecture::compact(), RootSeed(1), 0);
        let with_threads = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Predictor::new(&weights, InferenceSettings::smoothed()).raw(&grids))
        };
        assert_eq!(with_threads(1), with_threads(2));
    }

    #[test]
    fn a_prediction_is_clipped_only_in_use() {
        let geometry = GridGeometry::paper();
        let prediction = Prediction::from_raw([0.5, -0.2, -3.8, -3.8]);
        assert_eq!(prediction.mean, [0.5, -0.2]);
        let point = prediction.look_ahead(geometry);
        assert_eq!(point, LookAheadPoint { ahead_m: geometry.far_edge_ahead_m(), left_m: 0.0 });
        assert!((prediction.spread(geometry).left_m - 12.0 * prediction.sigma[0]).abs() < 1e-6);
    }
}
