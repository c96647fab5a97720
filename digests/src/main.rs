//! Drives all cases that need no network and compares them with what is kept: `cargo run -p digests`, or with `--target` for
//! another platform. Prints the digest of every case, in the form of `tests/goldens.toml`, then one of them all.
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a program of its own, without the command line's output"
)]

use digests::Goldens;
use std::process::ExitCode;

fn main() -> Result<ExitCode, Box<dyn std::error::Error>> {
    let driven = digests::drive_all();
    let text = toml::to_string(&driven)?;
    println!("{text}\n# all: {}", storage::sums::digest(text.as_bytes()));
    let mut kept = Goldens::kept()?;
    kept.episodes.retain(|case, _| !case.starts_with("network"));
    let differences = kept.differences(&driven);
    for difference in &differences {
        eprintln!("{difference}");
    }
    Ok(if differences.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
