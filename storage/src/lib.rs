//! Files: read within limits, written whole or not at all, owned by one process.

mod error;
pub mod lock;
pub mod read;
pub mod whole;

pub use error::FileError;
