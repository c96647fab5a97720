//! Drives all cases that need no network and compares them with what is kept: `cargo run -p digests`, or with `--target` for
//! another platform. Prints the digest of every case, in the form of `tests/goldens.toml`, then one of them all.

use digests::Goldens;
use sha2::{Digest as _, Sha256};
use std::process::ExitCode;

fn main() -> Result<ExitCode, Box<dyn std::error::Error>> {
    let driven = digests::drive_all();
    let text = toml::to_string(&driven)?;
    let sum: String = Sha256::digest(&text).iter().map(|byte| format!("{byte:02x}")).collect();
    println!("{text}\n# all: {sum}");
    let mut kept = Goldens::kept()?;
    kept.episodes.retain(|case, _| !case.starts_with("network"));
    let differences = kept.differences(&driven);
    differences.iter().for_each(|difference| eprintln!("{difference}"));
    Ok(if differences.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
