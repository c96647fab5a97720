//! One of the files of a round.
#![no_main]

use fuzz::Sound;
use libfuzzer_sys::fuzz_target;
use policy::dataset::store::Store;
use std::sync::{LazyLock, Mutex};

static STORE: LazyLock<Store> = LazyLock::new(|| Store::open(fuzz::folder()).expect("the folder is there"));
static ROUND: LazyLock<Mutex<Sound>> = LazyLock::new(|| {
    let round = Sound::new("round-00", fuzz::round_files());
    STORE.read_round(0).expect("it is sound");
    Mutex::new(round)
});

fuzz_target!(|data: &[u8]| {
    ROUND.lock().expect("one thread").make_up(data);
    drop(STORE.read_round(0));
});
