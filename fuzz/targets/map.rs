//! The YAML file of a map.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scenarios::import::parsers;

/// One pixel.
const IMAGE: &[u8] = b"P5\n1 1\n255\n\xcd";

fuzz_target!(|yaml: &str| drop(parsers::ros_map(yaml, IMAGE)));
