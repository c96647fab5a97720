//! Named random streams: every draw in the project comes from one of these.
//!
//! A new stream never shifts an old one: each purpose has its own 64-bit `ChaCha` stream under the root seed's key.

use crate::limits::TRIAL_MAX;
use rand::{Rng as _, SeedableRng as _};
use serde::{Deserialize, Serialize};

/// The generator behind every draw. `ChaCha8` is named, portable and has 2⁶⁴ independent streams per key.
pub type Rng = rand_chacha::ChaCha8Rng;

/// What a random stream is for. The discriminant is part of the reproducibility contract: append, never renumber.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u16)]
pub enum Stream {
    /// Obstacles of one trial on a fixed lot.
    Obstacles = 1,
    /// Geometry of a generated lot.
    Layout = 2,
    /// Sensor noise of one episode.
    Sensor = 3,
    /// Initial weights of a network.
    Weights = 4,
    /// Order of samples in training, and mirroring.
    Shuffle = 5,
    /// Dropout masks.
    Dropout = 6,
    /// Draws of a stochastic decision rule.
    DecisionRule = 7,
    /// Seeds of episodes derived from a run's root seed.
    Episode = 8,
    /// Resampling in statistics.
    Bootstrap = 9,
    /// Imperfections of the expert (label jitter), off by default.
    Expert = 10,
    /// Suites of lots.
    Suite = 11,
    /// Candidates of a search for parameters.
    Search = 12,
    /// Sensor noise of the additional observations of a training tick.
    NoiseAugmentation = 13,
    /// Disturbances injected into the steering while collecting data (DART).
    Disturbance = 14,
    /// Control sequences that a planner rolls out.
    Rollouts = 15,
}

/// The one number a run is reproduced from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct RootSeed(pub u64);

impl RootSeed {
    /// The generator of a purpose and an index (episode, round, lot …), of which the lowest 48 bits count.
    pub fn rng(self, stream: Stream, index: u64) -> Rng {
        let mut rng = Rng::seed_from_u64(self.0);
        // 16 bits of purpose above 48 bits of index: streams of one key never overlap.
        rng.set_stream((stream as u64) << 48 | (index & 0xFFFF_FFFF_FFFF));
        rng
    }

    /// A seed for a sub-task, itself a root of independent streams.
    #[must_use]
    pub fn child(self, stream: Stream, index: u64) -> Self {
        Self(self.rng(stream, index).next_u64())
    }
}

/// An episode of a round, and the index of its random streams.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EpisodeIndex {
    round: u32,
    episode: u32,
}

impl EpisodeIndex {
    /// A run has fewer rounds than this, and a round fewer episodes.
    pub const LIMIT: u32 = TRIAL_MAX + 1;

    /// Episode `episode` of round `round`, both from 0.
    ///
    /// # Panics
    /// If either is [`Self::LIMIT`] or more.
    pub fn new(round: u32, episode: u32) -> Self {
        assert!(
            round < Self::LIMIT && episode < Self::LIMIT,
            "round {round}, episode {episode}: a run has fewer than 2^20 rounds of fewer than 2^20 episodes"
        );
        Self { round, episode }
    }

    /// The first `count` episodes of a round.
    pub fn of_round(round: u32, count: usize) -> impl Iterator<Item = Self> {
        (0..count).map(move |episode| Self::new(round, u32::try_from(episode).unwrap_or(u32::MAX)))
    }

    /// The round, from 0.
    pub fn round(self) -> u32 {
        self.round
    }

    /// The episode within its round, from 0.
    pub fn episode(self) -> u32 {
        self.episode
    }

    /// Index for [`RootSeed::rng`] and [`RootSeed::child`]: 40 bits, different for every episode of a run.
    pub fn stream(self) -> u64 {
        u64::from(self.round) << 20 | u64::from(self.episode)
    }

    /// Index of one of up to 256 streams of the episode: 48 bits.
    pub fn part(self, part: u8) -> u64 {
        self.stream() << 8 | u64::from(part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bits are part of the reproducibility contract.
    #[test]
    fn episodes_of_a_run_have_indices_of_their_own() {
        assert_eq!(EpisodeIndex::new(3, 7).stream(), 3 * 1_048_576 + 7);
        assert_eq!(EpisodeIndex::new(3, 7).part(2), (3 * 1_048_576 + 7) * 256 + 2);
        let last = EpisodeIndex::new(EpisodeIndex::LIMIT - 1, EpisodeIndex::LIMIT - 1);
        assert_eq!(last.part(255), (1 << 48) - 1, "fits below the purpose of a stream");
        let second: Vec<u64> = EpisodeIndex::of_round(1, 2).map(EpisodeIndex::stream).collect();
        assert_eq!(second, [1 << 20, (1 << 20) + 1]);
    }

    #[test]
    #[should_panic(expected = "fewer than 2^20")]
    fn an_episode_beyond_the_limit_would_share_the_streams_of_another() {
        EpisodeIndex::new(0, EpisodeIndex::LIMIT);
    }

    /// Golden: the first draw of streams. If this fails, every recorded result changes; say why in the commit.
    #[test]
    fn streams_are_pinned_and_distinct() {
        let draw = |stream, index| RootSeed(42).rng(stream, index).next_u64();
        let draws = [draw(Stream::Obstacles, 0), draw(Stream::Obstacles, 1), draw(Stream::Sensor, 0)];
        assert_ne!(draws[0], draws[1]);
        assert_ne!(draws[0], draws[2]);
        assert_eq!(draws, [11_027_680_626_051_900_178, 18_178_751_841_779_265_898, 11_632_404_386_239_061_520]);
    }

    /// Those that no golden drive draws from would be renumbered without a word.
    #[test]
    fn streams_keep_their_numbers() {
        let streams = [
            Stream::Obstacles,
            Stream::Layout,
            Stream::Sensor,
            Stream::Weights,
            Stream::Shuffle,
            Stream::Dropout,
            Stream::DecisionRule,
            Stream::Episode,
            Stream::Bootstrap,
            Stream::Expert,
            Stream::Suite,
            Stream::Search,
            Stream::NoiseAugmentation,
            Stream::Disturbance,
            Stream::Rollouts,
        ];
        assert_eq!(streams.map(|stream| stream as u16), [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]);
    }
}
