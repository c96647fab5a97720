//! One change of a setting.
#![no_main]

use experiment::settings::{Layers, Settings};
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static SETTINGS: LazyLock<Settings> = LazyLock::new(|| Settings::preset("default").expect("a preset"));

fuzz_target!(|text: &str| {
    let layers = Layers { overrides: vec![text.to_owned()], ..Layers::default() };
    drop(Settings::resolve_over(&SETTINGS, &layers, None));
});
