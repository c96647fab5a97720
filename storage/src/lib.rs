//! Files of a run: read within limits.

mod error;
pub mod read;

pub use error::FileError;
