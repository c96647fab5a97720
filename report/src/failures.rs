//! `failures.md`: near-collisions one by one.

use crate::markdown::escaped;
use evaluation::records::{self, FailureRecord};
use experiment::run_dir::RunDir;
use std::fmt::Write as _;

const HEAD: &str = "\
# Near-collisions

One row each. The rules behind the causes are in docs/methods.md 8.4; `failures.jsonl` has what they found. A replay key \
draws its moment: `cargo xtask render animation 'KEY'`, with `--config RUN/settings.toml` if settings were changed.

| driver | lot | way | trial | noise | tick | route m | x m | y m | m/s | cause | replay key |
|---|---|---|---|---|---|---|---|---|---|---|---|
";

/// Writes `failures.md` from `failures.jsonl`.
///
/// # Errors
/// If a file cannot be read or written.
pub fn write(run: &RunDir) -> anyhow::Result<()> {
    let mut text = HEAD.to_owned();
    records::each_line(&run.path().join(records::FAILURES), |failure: FailureRecord| {
        let FailureRecord { header, tick, route_m, x_m, y_m, speed_mps, replay, .. } = &failure;
        let (way, cause) = (header.direction.name(), failure.cause.name());
        // Even of code, a bar would end the cell.
        let replay = replay.replace('|', "\\|");
        let _ = writeln!(
            text,
            "| {} | {} | {way} | {} | {} | {tick} | {route_m:.1} | {x_m:.2} | {y_m:.2} | {speed_mps:.2} | {cause} | \
             `{replay}` |",
            escaped(&header.driver),
            escaped(&header.lot),
            header.trial,
            header.noise
        );
        Ok(())
    })?;
    run.write("failures.md", text.as_bytes())
}
