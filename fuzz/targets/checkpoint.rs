//! A trained network: model.toml or model.safetensors.
#![no_main]

use fuzz::Files;
use libfuzzer_sys::fuzz_target;
use policy::checkpoint::Checkpoint;
use std::sync::LazyLock;

static SOUND: LazyLock<Files> = LazyLock::new(fuzz::network_files);

fuzz_target!(|data: &[u8]| {
    let folder = fuzz::with_one_made_up("network", &SOUND, data);
    drop(Checkpoint::load(&folder));
});
