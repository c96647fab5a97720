//! `torture`: whether commands survive deaths, full disks and errors of the disk, to the same bytes.

use crate::console::Console;
use crate::interrupt;
use crate::output::{Output, note};
use anyhow::{Context as _, ensure};
use clap::Args;
use experiment::progress::Progress as _;
use experiment::shard::Shard;
use torture::cases::{CASES, Case};
use torture::trial::{Extent, Outcome, Share, Workplace};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask torture --only evaluate --strikes 10
  cargo xtask torture --only train-dagger --kills 1 --shard 1/8      the other seven elsewhere
  cargo xtask torture --only train-dagger --kills 1 --from 1228      what is left of one that was stopped
  cargo xtask torture --kills 100               every operation of every command: many hours";

#[derive(Debug, Clone, Args)]
pub(crate) struct TortureArgs {
    /// Tortures these commands only [default: all that write].
    #[arg(long, value_name = "COMMAND", num_args = 1.., value_delimiter = ',')]
    only: Vec<String>,
    /// Operations on files that each fault strikes, evenly spaced over those of a command [default: all].
    #[arg(long, value_name = "N")]
    strikes: Option<u16>,
    /// Begins with this operation of each fault, to continue where a run was stopped.
    #[arg(long, value_name = "N", default_value_t = 1)]
    from: u16,
    /// Strikes only this share of these operations. Kills are not shared out: give each shard another `--seed`, or few
    /// `--kills`.
    #[arg(long, value_name = "NUMBER/OF")]
    shard: Option<Shard>,
    /// Kills of each command at random times.
    #[arg(long, value_name = "N", default_value_t = 30)]
    kills: u16,
    /// Seed of these times.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

const HEAD: &str = "\
| command | files | killed at | disk full at | disk fails at | killed at random times | not the same afterwards |
|---|---|---|---|---|---|---|";

pub(crate) fn run(args: &TortureArgs, output: &Output) -> anyhow::Result<()> {
    let cases = cases(&args.only)?;
    let folder = std::env::temp_dir().join(format!("lotpilot-torture-{}", std::process::id()));
    let workplace = Workplace::new(&std::env::current_exe()?, &folder, interrupt::is_requested)?;
    let failures = match torture_all(args, &cases, &workplace, output) {
        Err(error) if interrupt::is_requested() => {
            // Whether it can be deleted or not, it was interrupted.
            let _ = workplace.leave();
            return Err(error);
        }
        came => came?,
    };
    ensure!(
        failures == 0,
        "{failures} times something was lost or not the same; what was left is in {}",
        folder.display()
    );
    workplace.leave().with_context(|| folder.display().to_string())?;
    Ok(())
}

/// Tortures every command; the number of failures.
fn torture_all(args: &TortureArgs, cases: &[&Case], workplace: &Workplace, output: &Output) -> anyhow::Result<usize> {
    let console = Console::new(output);
    output.print(HEAD);
    let mut failures = 0;
    for case in cases {
        console.begin("torture", case.name);
        let strikes = args.strikes.map_or(usize::MAX, usize::from);
        let extent = Extent {
            strikes,
            from: args.from.into(),
            share: share(args.shard),
            kills: args.kills.into(),
            seed: args.seed,
        };
        let outcome = workplace.torture(case, &extent, &mut |share| console.at(share, &mut |_| String::new()))?;
        console.end("compared");
        outcome.failures.iter().for_each(|failure| note(format_args!("{}: {failure}", case.name)));
        failures += outcome.failures.len();
        output.print(row(case, &outcome));
    }
    Ok(failures)
}

fn cases(only: &[String]) -> anyhow::Result<Vec<&'static Case>> {
    let names = || CASES.iter().map(|case| case.name);
    if let Some(unknown) = only.iter().find(|name| !names().any(|known| known == **name)) {
        anyhow::bail!("--only {unknown}: there are {}", names().collect::<Vec<_>>().join(", "));
    }
    Ok(CASES.iter().filter(|case| only.is_empty() || only.iter().any(|name| name == case.name)).collect())
}

fn share(shard: Option<Shard>) -> Share {
    shard.map_or(Share { index: 0, of: 1 }, |shard| Share {
        index: shard.number() as usize - 1,
        of: shard.of() as usize,
    })
}

fn row(case: &Case, outcome: &Outcome) -> String {
    let Outcome { files, bytes, struck, kills, failures } = outcome;
    let struck = struck.map(|(struck, of)| format!("{struck} of {of} operations")).join(" | ");
    let (size_kb, failures) = (bytes.div_ceil(1000), failures.len());
    format!("| `{}` | {files}, {size_kb} kB | {struck} | {kills} | {failures} |", case.name)
}
