//! The YAML file of a map.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|yaml: &[u8]| fuzz::load_map(Some(yaml), None, None));
