//! The data set D: rounds of labelled grids, in the order they were collected; in memory and on disk.

mod aggregate;
mod collection;
mod npy;
mod packed;
mod round;
mod sample;
pub mod store;
mod tick;

pub use aggregate::{Dataset, Split, ValidationSplit};
pub use collection::{Collection, Effort, EpisodeRecord};
pub use round::Round;
pub(crate) use round::kept_places;
pub use sample::Sample;
pub use tick::Tick;
