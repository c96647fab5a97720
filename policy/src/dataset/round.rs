//! What one collection gives.

use crate::dataset::sample::Sample;
use crate::dataset::tick::Tick;
use sim::sensing::OccupancyGrid;

/// The samples of one collection, episode by episode and in order of time within an episode.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Round {
    /// The samples.
    pub samples: Vec<Sample>,
    /// Where and when each sample was taken: one per sample, or none at all for samples that were made otherwise.
    pub ticks: Vec<Tick>,
    /// Noise augmentations: the scenes of the samples seen with other draws of the sensor noise. The same number for
    /// every sample, those of one sample together. Trained on with the sample's label; never validated on.
    pub noise_augmentations: Vec<OccupancyGrid>,
}

impl From<Vec<Sample>> for Round {
    /// Samples alone.
    fn from(samples: Vec<Sample>) -> Self {
        Self { samples, ..Self::default() }
    }
}

impl Round {
    /// Noise augmentations of each sample.
    pub fn augmentations_each(&self) -> usize {
        self.noise_augmentations.len() / self.samples.len().max(1)
    }

    /// Noise augmentations of a sample.
    pub(crate) fn augmentations_of(&self, sample: usize) -> &[OccupancyGrid] {
        let each = self.augmentations_each();
        &self.noise_augmentations[sample * each..(sample + 1) * each]
    }
}
