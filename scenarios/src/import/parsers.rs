//! The readers of the files that a map is made of, each of what is in a file, without the lot that is made of it: fuzzing
//! makes such files up by the million.

use super::{centre_line, ros, tpcap};
use crate::error::LoadError;

/// Reads a ROS map: the text of its YAML file, and the bytes of the image that it names.
///
/// # Errors
/// What is wrong with either.
pub fn ros_map(yaml: &str, image: &[u8]) -> Result<(), LoadError> {
    ros::Map::parse(yaml, image).map(drop)
}

/// Reads the text of a TPCAP case.
///
/// # Errors
/// What is wrong with it, with its line.
pub fn tpcap_case(text: &str) -> Result<(), LoadError> {
    tpcap::Case::parse(text, "case.csv").map(drop)
}

/// Reads the text of a centre line, for a lot as large as its map.
///
/// # Errors
/// What is wrong with it, with its line.
pub fn centre_line(text: &str) -> Result<(), LoadError> {
    centre_line::parse(text, "line.csv", 1.0).map(drop)
}
