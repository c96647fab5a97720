//! What one collection gives.

use crate::dataset::sample::Sample;
use crate::dataset::tick::Tick;
use sim::sensing::OccupancyGrid;

/// The samples of one collection, episode by episode and in order of time within an episode.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Round {
    /// The samples.
    pub samples: Vec<Sample>,
    /// Where and when each sample was taken: one per sample, or none at all for samples that were made in another way.
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

    /// At most this many of the samples, spread evenly over all of them; 0 = all.
    #[must_use]
    pub(crate) fn thinned(&self, at_most: usize) -> Self {
        let places = || kept_places(self.samples.len(), at_most);
        Self {
            samples: places().map(|place| self.samples[place]).collect(),
            ticks: places().filter_map(|place| self.ticks.get(place).copied()).collect(),
            noise_augmentations: places().flat_map(|place| self.augmentations_of(place).iter().copied()).collect(),
        }
    }

    /// Noise augmentations of a sample.
    pub(crate) fn augmentations_of(&self, sample: usize) -> &[OccupancyGrid] {
        let each = self.augmentations_each();
        &self.noise_augmentations[sample * each..(sample + 1) * each]
    }
}

/// The places of those of `count` samples that stay where at most so many are wanted, spread evenly; 0 = all.
pub(crate) fn kept_places(count: usize, at_most: usize) -> impl Iterator<Item = usize> {
    let stay = if at_most == 0 { count } else { count.min(at_most) };
    (0..stay).map(move |i| i * count / stay)
}

#[cfg(test)]
mod tests {
    use crate::test_data::collected;

    #[test]
    fn thinned_rounds_keep_samples_with_their_ticks_and_augmentations() {
        let (round, _) = collected(30, 2);
        let thinned = round.thinned(7);
        assert_eq!((thinned.samples.len(), thinned.ticks.len(), thinned.noise_augmentations.len()), (7, 7, 14));
        for (at, place) in [(0, 0), (1, 4), (6, 25)] {
            assert_eq!(thinned.samples[at], round.samples[place]);
            assert_eq!(thinned.ticks[at], round.ticks[place]);
            assert_eq!(thinned.augmentations_of(at), round.augmentations_of(place));
        }
        assert_eq!((round.thinned(0), round.thinned(30)), (round.clone(), round));
    }
}
