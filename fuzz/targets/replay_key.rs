//! A replay key.
#![no_main]

use experiment::replay_key::ReplayKey;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let Ok(key) = text.parse::<ReplayKey>() else { return };
    assert_eq!(key.to_string().parse::<ReplayKey>().ok(), Some(key));
});
