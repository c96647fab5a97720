//! The union of rounds, and which of its samples are held back.

use crate::dataset::round::Round;
use crate::dataset::sample::Sample;
use serde::{Deserialize, Serialize};

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
    /// One block in so many is held back; 0 = none.
    pub every: usize,
}

impl ValidationSplit {
    /// 20 % in blocks of 200 ticks = 10 s (share: authors' code; blocks: docs/methods.md 4.2).
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
        let (mut split, mut blocks) = (Split::default(), 0);
        for round in &self.rounds {
            split.add(round, by, &mut blocks);
        }
        split
    }

    /// The same, round by round.
    pub fn split_by_round(&self, by: ValidationSplit) -> Vec<Split> {
        let mut blocks = 0;
        let split = |round| {
            let mut split = Split::default();
            split.add(round, by, &mut blocks);
            split
        };
        self.rounds.iter().map(split).collect()
    }
}

impl Split {
    /// Adds a round, after `blocks` blocks of the rounds before it.
    fn add(&mut self, round: &Round, by: ValidationSplit, blocks: &mut usize) {
        for (index, &sample) in round.samples.iter().enumerate() {
            *blocks += usize::from(index % by.block.max(1) == 0);
            if by.every > 0 && blocks.is_multiple_of(by.every) {
                self.validation.push(sample);
            } else {
                self.training.push(sample);
                self.training.extend(round.augmentations_of(index).iter().map(|&grid| Sample { grid, ..sample }));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::round;

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
        let by_round = dataset.split_by_round(by);
        assert_eq!(by_round[0].validation, before.validation);
        assert_eq!(by_round[1].validation, after.validation[20..]);
        assert_eq!(by_round[1].training, after.training[103..]);
    }

    #[test]
    fn noise_augmentations_are_trained_on_beside_their_sample_and_never_validated_on() {
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
}
