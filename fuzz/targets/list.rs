//! A list of digests.
#![no_main]

use libfuzzer_sys::fuzz_target;
use storage::sums;

fuzz_target!(|list: &[u8]| {
    fuzz::write(sums::FILE, list);
    let Ok(names) = sums::names(fuzz::folder()) else { return };
    // What is read is written as it was, except for its order and what is named twice.
    let lines = list.split(|byte| *byte == b'\n').count() - 1;
    assert!(names.len() <= lines, "{names:?}");
    drop(sums::verify(fuzz::folder()));
});
