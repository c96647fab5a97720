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

/// Names of lots and drivers are free text; names of files are not.
pub fn file_name(name: &str) -> String {
    name.replace(|c: char| !c.is_alphanumeric() && !"-_.".contains(c), "-")
}

#[cfg(test)]
mod tests;
