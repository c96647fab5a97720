//! Pictures of lots, drives, samples and noise. Nothing here reads a file or drives.
//!
//! | file | what |
//! |---|---|
//! | [`drawing`] | a picture as a list of shapes, which becomes PNG or SVG |
//! | [`lot`] | lots from above |
//! | [`trajectories`] | drives over a lot |
//! | [`contact_sheet`] | many lots on one page |
//! | [`grids`] | grids and views, predictions and labels |
//! | [`samples`], [`noise`] | pages of them |
//! | [`animation`], [`encode`] | drives that move, as GIF, APNG and in reports |

pub mod animation;
pub mod contact_sheet;
pub mod drawing;
pub mod encode;
pub mod grids;
pub mod lot;
pub mod noise;
pub mod samples;
pub mod trajectories;

use storage::sums;

/// Bytes of a [`file_name`]. File systems allow 255, an extension included.
const FILE_NAME_BYTES_MAX: usize = 200;

/// Names of lots and drivers are free text; names of files are not. The end of a long one becomes a digest of the whole.
pub fn file_name(name: &str) -> String {
    let plain = name.replace(|c: char| !c.is_alphanumeric() && !"-_.".contains(c), "-");
    if plain.len() <= FILE_NAME_BYTES_MAX {
        return plain;
    }
    let digest = &sums::digest(plain.as_bytes())[..8];
    let end = plain.floor_char_boundary(FILE_NAME_BYTES_MAX - digest.len() - 1);
    format!("{}-{digest}", &plain[..end])
}

#[cfg(test)]
mod tests;
