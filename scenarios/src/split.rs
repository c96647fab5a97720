//! Which lots may be trained on: every generated lot belongs to exactly one split, by the bits of its seed.

use serde::{Deserialize, Serialize};
use sim::seed::RootSeed;

/// What a generated lot may be used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Split {
    /// To learn from.
    Train,
    /// To choose between models and settings.
    Validation,
    /// To report numbers from, once.
    Test,
}

/// How hard a generated lot is to drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Difficulty {
    /// Wide lanes, few encroachments.
    Easy,
    /// Between the two.
    #[default]
    Medium,
    /// As narrow as the paper's lots, with slaloms.
    Hard,
}

/// The seed's top byte holds split and difficulty, the rest the index.
const INDEX_BITS: u32 = 56;

impl Split {
    /// In the order of use.
    pub const ALL: [Self; 3] = [Self::Train, Self::Validation, Self::Test];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Validation => "validation",
            Self::Test => "test",
        }
    }

    /// The seed of a lot. No two lots share one, whatever their split, difficulty and index.
    ///
    /// # Panics
    /// On an index of 2⁵⁶ or more.
    pub fn seed(self, difficulty: Difficulty, index: u64) -> RootSeed {
        assert!(index >> INDEX_BITS == 0, "lot index {index} is too large");
        // From 1, so that small seeds that people type never meet a generated lot's.
        let kind = (self as u64 + 1) << 4 | difficulty as u64;
        RootSeed(kind << INDEX_BITS | index)
    }

    /// The split a seed belongs to; `None` for seeds of other origin.
    pub fn of(seed: RootSeed) -> Option<Self> {
        let number = seed.0 >> (INDEX_BITS + 4);
        Self::ALL.into_iter().find(|&split| split as u64 + 1 == number)
    }
}

impl Difficulty {
    /// Easiest first.
    pub const ALL: [Self; 3] = [Self::Easy, Self::Medium, Self::Hard];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Easy => "easy",
            Self::Medium => "medium",
            Self::Hard => "hard",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_of_different_lots_never_meet() {
        let mut seen = std::collections::BTreeSet::new();
        let indices = (0..200).chain([1 << 32, (1 << 56) - 1]);
        for index in indices {
            for split in Split::ALL {
                for difficulty in Difficulty::ALL {
                    let seed = split.seed(difficulty, index);
                    assert!(seen.insert(seed), "{split:?} {difficulty:?} {index} shares its seed");
                    assert_eq!(Split::of(seed), Some(split));
                }
            }
        }
        assert_eq!(Split::of(RootSeed(42)), None);
    }

    /// Not only for the indices tried: the ranges of the splits lie apart.
    #[test]
    fn splits_are_disjoint_ranges() {
        let ranges =
            Split::ALL.map(|split| (split.seed(Difficulty::Easy, 0).0, split.seed(Difficulty::Hard, (1 << 56) - 1).0));
        assert!(ranges[0].1 < ranges[1].0 && ranges[1].1 < ranges[2].0);
    }

    #[test]
    #[should_panic(expected = "too large")]
    fn an_index_beyond_its_range_is_refused() {
        let _ = Split::Train.seed(Difficulty::Easy, 1 << 56);
    }
}
