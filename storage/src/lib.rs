//! Files: read within limits, written whole or not at all, listed with their SHA-256, owned by one process.

mod error;
pub mod growing;
pub mod lock;
mod place;
mod quoted;
pub mod read;
pub mod sealed;
pub mod sums;
pub mod whole;

pub use error::{FileError, is_of_disk};
pub use place::place_of;
pub use quoted::{ERROR_CHARS_MAX, shortened};
