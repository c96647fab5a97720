//! A centre line.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scenarios::import::parsers;

fuzz_target!(|line: &str| drop(parsers::centre_line(line)));
