//! One change of a setting.
#![no_main]

use experiment::settings::{Layers, Settings};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let layers = Layers { overrides: vec![text.to_owned()], ..Layers::default() };
    drop(Settings::resolve(&layers, None));
});
