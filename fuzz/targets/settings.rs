//! A file with settings.
#![no_main]

use experiment::settings::Settings;
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|text: &str| {
    let read = |text: &str| Settings::resolve_text(text, Path::new("settings.toml"));
    let Ok(settings) = read(text) else { return };
    assert_eq!(read(&settings.to_toml()).expect("what is written is read"), settings);
});
