//! The image of a map.
#![no_main]

use fuzz::MAP;
use libfuzzer_sys::fuzz_target;
use scenarios::import::parsers;

fuzz_target!(|image: &[u8]| drop(parsers::ros_map(MAP, image)));
