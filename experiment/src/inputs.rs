//! What a run reads from elsewhere, by digest: lots, parameters and networks from files.

use crate::drivers::NamedDriver;
use crate::lots::Lot;
use std::path::PathBuf;

pub use crate::manifest::Inputs;

/// Those of some lots and drivers; what ships with the program is not among them.
pub fn of(lots: &[Lot], drivers: &[NamedDriver]) -> Inputs {
    let lots = lots.iter().filter_map(|lot| Some((lot.spec(), lot.digest()?)));
    let drivers = drivers.iter().filter_map(|driver| Some((driver.spec.to_string(), driver.digest()?)));
    lots.chain(drivers).collect()
}

/// The files and folders that they are read from.
pub fn places(lots: &[Lot], drivers: &[NamedDriver]) -> Vec<PathBuf> {
    let lots = lots.iter().flat_map(Lot::files).cloned();
    lots.chain(drivers.iter().flat_map(|driver| driver.spec.places()).map(PathBuf::from)).collect()
}
