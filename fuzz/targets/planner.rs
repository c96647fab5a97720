//! A file with the parameters of a planner.
#![no_main]

use experiment::drivers::DriverSpec;
use experiment::settings::Settings;
use fuzz::PLANNERS;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static SETTINGS: LazyLock<Settings> = LazyLock::new(|| Settings::preset("smoke").expect("a preset"));

fuzz_target!(|data: &[u8]| {
    let Some((which, text)) = data.split_first() else { return };
    let file = fuzz::write("planner.toml", text);
    let spec = format!("{}:{}", PLANNERS[usize::from(*which) % PLANNERS.len()], file.display());
    let spec: DriverSpec = spec.parse().expect("a planner with a file");
    drop(spec.load(&SETTINGS));
});
