//! Reads what the bench shows from standard input and writes it where Rerun's viewer finds it.
//!
//! Started by `cargo xtask visualise` and `--record`; of no use alone.

mod blueprint;
mod columns;
mod picture;
mod recording;
mod shapes;
#[cfg(test)]
mod tests;

use anyhow::Context as _;
use protocol::Message;
use recording::Recording;
use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use std::process::ExitCode;

/// The recording cannot be written: no place, no viewer, a broken pipe.
const EXIT_REFUSED: u8 = 2;

fn main() -> ExitCode {
    match record(BufReader::with_capacity(1 << 20, std::io::stdin().lock())) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("recorder: {error:#}");
            ExitCode::from(EXIT_REFUSED)
        }
    }
}

/// Writes all recordings until the pipe ends. What is open then is ended, too: a bench that was killed leaves files that
/// can be looked at.
fn record(mut pipe: impl Read) -> anyhow::Result<()> {
    let mut open: BTreeMap<u32, Recording> = BTreeMap::new();
    while let Some(message) = protocol::read(&mut pipe).context("the pipe from the bench")? {
        let unknown = |recording: u32| format!("recording {recording} was never begun");
        match message {
            Message::Begin { recording, header } => {
                let name = header.name.clone();
                open.insert(recording, Recording::begin(*header).with_context(|| name)?);
            }
            Message::Always { recording, marks } => {
                open.get(&recording).with_context(|| unknown(recording))?.always(marks)?;
            }
            Message::At { recording, clock, marks } => {
                open.get_mut(&recording).with_context(|| unknown(recording))?.at(clock, marks)?;
            }
            Message::End { recording } => {
                open.remove(&recording).with_context(|| unknown(recording))?.end()?;
            }
        }
    }
    open.into_values().try_for_each(Recording::end)
}
