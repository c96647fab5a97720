//! Files of a run: written whole or not at all, owned by one process.

mod error;
pub mod lock;
pub mod whole;

pub use error::FileError;
