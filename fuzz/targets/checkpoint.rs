//! A trained network: model.toml or model.safetensors.
#![no_main]

use fuzz::Files;
use libfuzzer_sys::fuzz_target;
use policy::checkpoint::Checkpoint;
use std::path::Path;
use std::sync::LazyLock;

/// model.safetensors, then model.toml.
static SOUND: LazyLock<Files> = LazyLock::new(|| {
    let files = fuzz::network_files();
    assert!(files.is_sorted() && files.len() == 2);
    read(&files[0].1, &files[1].1).expect("it is sound");
    files
});

fn read(numbers: &[u8], model: &[u8]) -> Option<Checkpoint> {
    Checkpoint::from_contents(std::str::from_utf8(model).ok()?, numbers, Path::new("network")).ok()
}

// The first byte says which file is made up, the rest is its content.
fuzz_target!(|data: &[u8]| {
    let (which, content) = data.split_first().unwrap_or((&0, &[]));
    let [(_, numbers), (_, model)] = &SOUND[..] else { unreachable!("two files") };
    drop(if which % 2 == 0 { read(content, model) } else { read(numbers, content) });
});
