//! A centre line.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|line: &[u8]| fuzz::load_map(None, None, Some(line)));
