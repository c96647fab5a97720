//! Names of lots, drivers and noise.
#![no_main]

use experiment::drivers::DriverSpec;
use experiment::settings::NoiseChoice;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    drop(text.parse::<NoiseChoice>());
    if let Ok(spec) = text.parse::<DriverSpec>() {
        assert_eq!(spec.to_string().parse::<DriverSpec>().ok(), Some(spec));
    }
    let Ok(lots) = scenarios::suite(text) else { return };
    // A few of up to a million.
    for lot in lots.iter().take(3) {
        assert_eq!(lot.to_string().parse().as_ref(), Ok(lot));
    }
});
