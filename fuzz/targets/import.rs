//! A map and what is made of it: one of its files, or a TPCAP case. The first byte says which, the rest is its content.
#![no_main]

use fuzz::Imported;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((which, content)) = data.split_first() else { return };
    fuzz::import(Imported::ALL[usize::from(*which) % Imported::ALL.len()], content);
});
