//! A TPCAP case.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scenarios::import::parsers;

fuzz_target!(|case: &str| drop(parsers::tpcap_case(case)));
