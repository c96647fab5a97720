//! The file of a lot.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sim::vehicle::VehicleSettings;

fuzz_target!(|text: &str| {
    let vehicle = VehicleSettings::hyundai_hg300();
    let Ok(lot) = scenarios::load::parse(text, "lot.toml", &vehicle) else { return };
    // What is accepted is read back as it is, and becomes a map.
    let again = scenarios::load::parse(&scenarios::load::to_toml(&lot), "lot.toml", &vehicle);
    assert_eq!(again.as_ref(), Ok(&lot));
    drop(sim::map::Map::build(lot, &vehicle).expect("what is accepted becomes a map"));
});
