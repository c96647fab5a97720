//! Which generated lots there are and which may be trained on: the bits of a lot's seed are its split, family and index.

use sha2::{Digest as _, Sha256};
use sim::seed::RootSeed;

/// What a generated lot may be used for.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Split {
    /// To learn from.
    Train,
    /// To choose between models and settings.
    Validation,
    /// To look at while developing.
    Test,
    /// To report final figures from, once: whoever chooses the phrase draws lots that nobody has seen.
    Sealed(Phrase),
}

/// What a sealed split is drawn from: 1 to 40 of a–z, 0–9 and `-`, which is neither first nor last.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Phrase(String);

/// A kind of generated lots.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Family {
    /// A corridor with corners between parked cars: wide lanes, few encroachments.
    Easy,
    /// Between the two.
    #[default]
    Medium,
    /// As narrow as the paper's lots, with slaloms.
    Hard,
    /// One width all along, bends that are not widened.
    Lane,
    /// Corridors of a building between thin walls.
    Rooms,
    /// Between kerbs, with parked cars on both sides.
    Street,
    /// Parallel aisles of a car park.
    Aisles,
    /// A closed band, as of a race track.
    Track,
    /// Open ground on which things that stand about leave one way.
    Open,
    /// Aisles between racks in a hall, others branching off.
    Halls,
    /// Wide ground on which things stand apart.
    Yards,
    /// Roads with barriers from either side in turn.
    Chicanes,
    /// Rows of cones or bollards on open ground.
    Cones,
    /// Aisles between cars that are parked at a slant.
    Slanted,
    /// Edges, width and furniture change along the way.
    Mixed,
}

/// The seed's top byte holds split and family, the rest the index.
const INDEX_BITS: u32 = 56;
/// Of these, the lower ones count the lots of a phrase and the upper ones are the phrase's.
const SEALED_INDEX_BITS: u32 = 20;

impl Split {
    /// The splits that everybody shares, in the order of use.
    pub const OPEN: [Self; 3] = [Self::Train, Self::Validation, Self::Test];

    /// The number of the split, from 1, so that small seeds that people type never meet a generated lot's.
    fn number(&self) -> u64 {
        match self {
            Self::Train => 1,
            Self::Validation => 2,
            Self::Test => 3,
            Self::Sealed(_) => 4,
        }
    }

    /// How many lots of a family it has; their indices are below.
    pub fn size(&self) -> u64 {
        match self {
            Self::Train | Self::Validation | Self::Test => 1 << INDEX_BITS,
            Self::Sealed(_) => 1 << SEALED_INDEX_BITS,
        }
    }

    /// The seed of a lot. No two lots share one, whatever their split, family and index, except that two phrases in
    /// 2³⁶ draw the same lots.
    ///
    /// # Panics
    /// If the index is [`Self::size`] or more.
    pub fn seed(&self, family: Family, index: u64) -> RootSeed {
        assert!(index < self.size(), "lot index {index} is too large");
        let index = match self {
            Self::Train | Self::Validation | Self::Test => index,
            Self::Sealed(phrase) => phrase.bits() << SEALED_INDEX_BITS | index,
        };
        let kind = self.number() << 4 | family as u64;
        RootSeed(kind << INDEX_BITS | index)
    }
}

/// Name on the command line and in names of lots.
impl std::fmt::Display for Split {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Train => write!(f, "train"),
            Self::Validation => write!(f, "validation"),
            Self::Test => write!(f, "test"),
            Self::Sealed(Phrase(phrase)) => write!(f, "sealed-{phrase}"),
        }
    }
}

impl Phrase {
    /// `None` unless the text has the form of a phrase.
    pub fn new(text: &str) -> Option<Self> {
        let is_allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        let is_framed = !text.starts_with('-') && !text.ends_with('-');
        let is_phrase = (1..=40).contains(&text.len()) && text.chars().all(is_allowed) && is_framed;
        is_phrase.then(|| Self(text.to_owned()))
    }

    /// The first bits of its SHA-256.
    fn bits(&self) -> u64 {
        let digest = Sha256::digest(self.0.as_bytes());
        let first = digest[..8].iter().fold(0, |bits, &byte| bits << 8 | u64::from(byte));
        first >> (64 - (INDEX_BITS - SEALED_INDEX_BITS))
    }
}

impl Family {
    /// Every family in the order of their numbers, which are part of the seeds: append, never renumber.
    pub const EVERY: [Self; 15] = [
        Self::Easy,
        Self::Medium,
        Self::Hard,
        Self::Lane,
        Self::Rooms,
        Self::Street,
        Self::Aisles,
        Self::Track,
        Self::Open,
        Self::Halls,
        Self::Yards,
        Self::Chicanes,
        Self::Cones,
        Self::Slanted,
        Self::Mixed,
    ];

    /// What `all` goes through: the families that published figures are of. Those made since are asked for by name.
    pub const ALL: &[Self] = Self::EVERY.split_at(12).0;

    /// The corridor between parked cars in its three difficulties, easiest first.
    pub const CORRIDORS: [Self; 3] = [Self::Easy, Self::Medium, Self::Hard];

    /// All names, each with something before it: `a, b or c`.
    pub fn list(before: &str) -> String {
        let names = Self::EVERY.map(|family| format!("{before}{}", family.name()));
        let (last, others) = names.split_last().expect("there are families");
        format!("{} or {last}", others.join(", "))
    }

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Easy => "easy",
            Self::Medium => "medium",
            Self::Hard => "hard",
            Self::Lane => "lane",
            Self::Rooms => "rooms",
            Self::Street => "street",
            Self::Aisles => "aisles",
            Self::Track => "track",
            Self::Open => "open",
            Self::Halls => "halls",
            Self::Yards => "yards",
            Self::Chicanes => "chicanes",
            Self::Cones => "cones",
            Self::Slanted => "slanted",
            Self::Mixed => "mixed",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sealed(phrase: &str) -> Split {
        Split::Sealed(Phrase::new(phrase).expect("a phrase"))
    }

    #[test]
    fn seeds_of_different_lots_never_meet() {
        let mut seen = std::collections::BTreeSet::new();
        let mut splits = Split::OPEN.to_vec();
        splits.extend([sealed("spring"), sealed("autumn")]);
        for split in splits {
            for index in (0..200).chain([1 << 19, split.size() - 1]) {
                for family in Family::EVERY {
                    let seed = split.seed(family, index);
                    assert!(seen.insert(seed), "{split:?} {family:?} {index} shares its seed");
                }
            }
        }
    }

    /// Not only for the indices tried: the ranges of the splits lie apart.
    #[test]
    fn splits_are_disjoint_ranges() {
        let splits = [Split::Train, Split::Validation, Split::Test, sealed("spring")];
        let [first, .., last] = Family::EVERY;
        let ranges = splits.map(|split| (split.seed(first, 0).0, split.seed(last, split.size() - 1).0));
        assert!(ranges.windows(2).all(|pair| pair[0].1 < pair[1].0), "{ranges:x?}");
    }

    /// The bits are part of the reproducibility contract: SHA-256 of "spring" begins with 0x622a494d3.
    #[test]
    fn a_phrase_is_turned_into_seeds_by_its_digest() {
        assert_eq!(sealed("spring").seed(Family::Hard, 7).0, 0x42 << 56 | 0x6_22a4_94d3 << 20 | 7);
    }

    #[test]
    fn phrases_can_be_part_of_names() {
        for phrase in ["a", "2026-spring", "x--y", &"z".repeat(40)] {
            assert!(Phrase::new(phrase).is_some(), "{phrase:?}");
        }
        for text in ["", "A", "two words", "a:b", "a_b", "é", "a-", "-a", &"z".repeat(41)] {
            assert!(Phrase::new(text).is_none(), "{text:?}");
        }
    }

    #[test]
    #[should_panic(expected = "too large")]
    fn an_index_beyond_its_range_is_refused() {
        let _ = Split::Train.seed(Family::Easy, 1 << 56);
    }
}
