//! Batches of samples in random order.

use crate::dataset::Sample;
use crate::fit::settings::Mirror;
use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use sim::seed::{RootSeed, Stream};

/// Draws samples without replacement; each epoch has an order of its own.
pub(crate) struct BatchSampler<'a> {
    samples: &'a [Sample],
    mirror: Mirror,
    seed: RootSeed,
    order: Vec<u32>,
    next: usize,
    epoch: u64,
    rng: sim::seed::Rng,
}

impl<'a> BatchSampler<'a> {
    pub(crate) fn new(samples: &'a [Sample], mirror: Mirror, seed: RootSeed) -> Self {
        let order: Vec<u32> = (0..samples.len() as u32).collect();
        Self { samples, mirror, seed, next: order.len(), order, epoch: 0, rng: seed.rng(Stream::Shuffle, 0) }
    }

    pub(crate) fn draw(&mut self, count: usize, into: &mut Vec<Sample>) {
        into.clear();
        while into.len() < count {
            if self.next == self.order.len() {
                // A stream of its own per epoch: the order does not depend on how much the last one drew.
                self.rng = self.seed.rng(Stream::Shuffle, self.epoch);
                self.order.shuffle(&mut self.rng);
                self.epoch += 1;
                self.next = 0;
            }
            let sample = &self.samples[self.order[self.next] as usize];
            self.next += 1;
            let is_mirrored = self.mirror == Mirror::Half && self.rng.random::<bool>();
            into.push(if is_mirrored { sample.mirrored() } else { *sample });
        }
    }
}
