//! The image of a map.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|image: &[u8]| fuzz::load_map(None, Some(image), None));
