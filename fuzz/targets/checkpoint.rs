//! A trained network: model.toml or model.safetensors.
#![no_main]

use fuzz::Sound;
use libfuzzer_sys::fuzz_target;
use policy::checkpoint::Checkpoint;
use std::sync::{LazyLock, Mutex};

static NETWORK: LazyLock<Mutex<Sound>> = LazyLock::new(|| {
    let network = Sound::new("network", fuzz::network_files());
    Checkpoint::load(network.path()).expect("it is sound");
    Mutex::new(network)
});

fuzz_target!(|data: &[u8]| {
    let mut network = NETWORK.lock().expect("one thread");
    network.make_up(data);
    drop(Checkpoint::load(network.path()));
});
