//! The data set D: rounds of labelled grids, in the order they were collected.

pub mod store;

use serde::{Deserialize, Serialize};
use sim::sensing::OccupancyGrid;

/// One labelled tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// What was seen, noise included.
    pub grid: OccupancyGrid,
    /// The expert's look-ahead point (u, w), image fractions.
    pub label: [f32; 2],
    /// τ̂: how far off the network was, 0…1; 0 in behaviour cloning.
    pub tau_hat: f32,
}

impl Sample {
    /// The same scene seen in a mirror.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let [u, w] = self.label;
        Self { grid: self.grid.mirrored(), label: [1.0 - u, w], tau_hat: self.tau_hat }
    }
}

/// The samples of one collection, seat by seat and in order of time within a seat.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Round {
    /// The samples.
    pub samples: Vec<Sample>,
    /// Further looks at the scenes of the samples, each with noise of its own: the same number for every sample, those
    /// of one sample together. Trained on with the sample's label; never validated on.
    pub noise_augmentations: Vec<OccupancyGrid>,
}

impl From<Vec<Sample>> for Round {
    /// Without further looks.
    fn from(samples: Vec<Sample>) -> Self {
        Self { samples, noise_augmentations: Vec::new() }
    }
}

impl Round {
    /// Further looks at a sample.
    fn relooks_of(&self, sample: usize) -> &[OccupancyGrid] {
        let each = self.noise_augmentations.len() / self.samples.len().max(1);
        &self.noise_augmentations[sample * each..(sample + 1) * each]
    }
}

/// The union of all rounds so far.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Dataset {
    rounds: Vec<Round>,
}

/// Which samples are held back to validate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ValidationSplit {
    /// Length of a block, samples. Neighbouring ticks look alike (50 ms): blocks keep them on one side.
    pub block: usize,
    /// Every so many blocks one is held back; 0 = none.
    pub every: usize,
}

impl ValidationSplit {
    /// 20 % in blocks of 200 ticks = 10 s (share: authors' code; blocks: methods.md 4.2).
    pub fn paper() -> Self {
        Self { block: 200, every: 5 }
    }

    /// No validation: all samples are trained on.
    pub fn none() -> Self {
        Self { block: 200, every: 0 }
    }
}

/// Samples by purpose.
#[derive(Debug, Clone, Default)]
pub struct Split {
    /// Trained on.
    pub training: Vec<Sample>,
    /// Held back.
    pub validation: Vec<Sample>,
}

impl Dataset {
    /// Aggregates one more round (Algorithm 1, line 7).
    pub fn push(&mut self, round: Round) {
        self.rounds.push(round);
    }

    /// The rounds, oldest first.
    pub fn rounds(&self) -> &[Round] {
        &self.rounds
    }

    /// Samples in all rounds.
    pub fn len(&self) -> usize {
        self.rounds.iter().map(|round| round.samples.len()).sum()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Splits by blocks that never cross a round: a further round leaves the split of the earlier ones as it is.
    pub fn split(&self, by: ValidationSplit) -> Split {
        let mut split = Split::default();
        let mut blocks = 0;
        for round in &self.rounds {
            for (index, &sample) in round.samples.iter().enumerate() {
                blocks += usize::from(index % by.block.max(1) == 0);
                if by.every > 0 && blocks % by.every == 0 {
                    split.validation.push(sample);
                } else {
                    split.training.push(sample);
                    split.training.extend(round.relooks_of(index).iter().map(|&grid| Sample { grid, ..sample }));
                }
            }
        }
        split
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::network::fast::tests::lots;

    /// Samples whose label can be read off the grid: the mass of occupied cells decides.
    pub(crate) fn round(count: usize) -> Round {
        let samples: Vec<_> = lots(count)
            .into_iter()
            .enumerate()
            .map(|(index, grid)| {
                let left = (0..25).flat_map(|row| (0..12).map(move |col| (row, col)));
                let left = left.filter(|&(row, col)| grid.is_occupied(row, col)).count() as f32;
                let right = grid.count_occupied() as f32 - left;
                let tau_hat = if index % 7 == 0 { 0.3 } else { 0.0 };
                Sample { grid, label: [0.5 + 0.003 * (left - right), 0.2 + 0.002 * (left + right)], tau_hat }
            })
            .collect();
        samples.into()
    }

    #[test]
    fn blocks_stay_together_and_old_rounds_keep_their_split() {
        let by = ValidationSplit { block: 10, every: 5 };
        let mut dataset = Dataset::default();
        dataset.push(round(123));
        let before = dataset.split(by);
        assert_eq!(before.validation[..10], dataset.rounds()[0].samples[40..50]);
        assert_eq!(before.validation.len(), 20);
        assert_eq!(before.training.len(), 103);

        dataset.push(round(60));
        let after = dataset.split(by);
        assert_eq!(after.training[..103], before.training[..]);
        assert_eq!(after.validation[..20], before.validation[..]);
        assert_eq!(after.training.len() + after.validation.len(), dataset.len());
    }

    #[test]
    fn further_looks_are_trained_on_beside_their_sample_and_never_validated_on() {
        let mut round = round(20);
        round.noise_augmentations =
            round.samples.iter().flat_map(|sample| [sample.grid.mirrored(), sample.grid]).collect();
        let mut dataset = Dataset::default();
        dataset.push(round.clone());
        let split = dataset.split(ValidationSplit { block: 5, every: 2 });
        assert_eq!(split.validation, [&round.samples[5..10], &round.samples[15..20]].concat());
        assert_eq!(split.training.len(), 30);
        let first = round.samples[0];
        let mirrored = Sample { grid: first.grid.mirrored(), ..first };
        assert_eq!(split.training[..4], [first, mirrored, first, round.samples[1]]);
    }

    #[test]
    fn a_mirror_swaps_left_and_right() {
        let sample = round(1).samples[0];
        let mirrored = sample.mirrored();
        assert_eq!(mirrored.label, [1.0 - sample.label[0], sample.label[1]]);
        assert_eq!(mirrored.grid.is_occupied(3, 0), sample.grid.is_occupied(3, 24));
        assert_eq!(mirrored.mirrored().grid, sample.grid);
    }
}
