//! A file with settings.
#![no_main]

use experiment::settings::{Layers, Settings};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &[u8]| {
    let read = |text: &[u8]| {
        let file = Some(fuzz::write("settings.toml", text));
        Settings::resolve(&Layers { file, ..Layers::default() }, None)
    };
    let Ok(settings) = read(text) else { return };
    assert_eq!(read(settings.to_toml().as_bytes()).expect("what is written is read"), settings);
});
