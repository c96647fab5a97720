//! One of the files of a round.
#![no_main]

use fuzz::Files;
use libfuzzer_sys::fuzz_target;
use policy::dataset::store::Store;
use std::sync::LazyLock;

static SOUND: LazyLock<Files> = LazyLock::new(fuzz::round_files);

fuzz_target!(|data: &[u8]| {
    fuzz::with_one_made_up("round-00", &SOUND, data);
    let store = Store::open(fuzz::folder()).expect("the folder is there");
    drop(store.read_round(0));
});
