//! A TPCAP case.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|case: &[u8]| fuzz::load_lot(&fuzz::write("case.csv", case)));
