//! Where to drive: the paper's three lots, generated lots and lots written by hand.

pub mod clutter;
pub mod corridor;
pub mod generator;
pub mod load;
pub mod reference;
pub mod solver;
pub mod split;

/// placeholder
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct SpecError(String);

/// FNV-1a: pins text in tests.
#[cfg(test)]
fn fnv1a(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}
