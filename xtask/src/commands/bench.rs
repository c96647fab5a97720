//! `bench`: how fast this is, here.

use crate::build_info;
use crate::output::Output;
use anyhow::Context as _;
use benchmark::peers::{self, PEERS};
use benchmark::{Effort, Figure, Goal, driving, evaluating, maps, network};
use clap::{Args, ValueEnum};
use policy::fit::DeviceChoice;
use serde::Deserialize as _;
use serde::de::value::{Error as ValueError, StrDeserializer};
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask bench --quick                          a look, in about two minutes
  cargo xtask bench --only training                  one area
  cargo xtask bench --peers                          with PyTorch, onnxruntime and other simulators from PyPI
  cargo xtask bench --peers --write docs/performance.md";

#[derive(Debug, Clone, Args)]
pub(crate) struct BenchArgs {
    /// Takes shorter measurements.
    #[arg(long)]
    quick: bool,
    /// Measures one area only; may be repeated.
    #[arg(long, value_enum, value_name = "AREA")]
    only: Vec<Area>,
    /// Also measures other simulators and libraries, in virtual environments made from PyPI (gigabytes).
    #[arg(long)]
    peers: bool,
    /// Folder of the environment that most of them share; the others have theirs next to it.
    #[arg(long, value_name = "DIR", default_value = "target/tools/peers", requires = "peers")]
    environment: PathBuf,
    /// Where networks are trained: cpu, or the GPU backend of burn that this program was built with (CONTRIBUTING.md).
    #[arg(long, value_name = "DEVICE", default_value = "cpu", value_parser = device)]
    device: DeviceChoice,
    /// Writes the table into this Markdown file, between its lines `<!-- bench -->` and `<!-- /bench -->`.
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Area {
    Driving,
    Evaluating,
    Maps,
    Answers,
    Training,
}

const AREAS: [Area; 5] = [Area::Driving, Area::Evaluating, Area::Maps, Area::Answers, Area::Training];
const BEGIN: &str = "<!-- bench -->";
const END: &str = "<!-- /bench -->";

pub(crate) fn run(args: &BenchArgs, output: &Output) -> anyhow::Result<()> {
    let page = args.write.as_deref().map(Page::read).transpose()?;
    let effort = if args.quick { Effort::quick() } else { Effort::full() };
    let mut text = format!("{}\n\n| | median | range | goal |\n|---|---|---|---|\n", machine());
    output.print(text.trim_end());
    let mut report = |figure: Figure| {
        let row = row(&figure);
        output.print(&row);
        writeln!(text, "{row}").expect("a string takes everything");
    };
    for area in AREAS.into_iter().filter(|area| args.only.is_empty() || args.only.contains(area)) {
        match area {
            Area::Driving => driving::figures(effort, &mut report)?,
            Area::Evaluating => evaluating::figures(effort, &mut report)?,
            Area::Maps => maps::figures(effort, &mut report)?,
            Area::Answers => network::answers(effort, &mut report)?,
            Area::Training => network::training(effort, args.device, &mut report)?,
        }
    }
    if args.peers {
        let head = "\n| beside it | printed | a step or call there |\n|---|---|---|\n";
        output.print(head.trim_end());
        text.push_str(head);
        for peer in &PEERS {
            // One that cannot be installed does not hide the others.
            let printed =
                peers::run(peer, &args.environment).unwrap_or_else(|error| vec![format!("failed: {error:#}")]);
            let row = format!("| {} | {} | {} |", peer.name, printed.join("; "), peer.about);
            output.print(&row);
            writeln!(text, "{row}").expect("a string takes everything");
        }
    }
    page.map_or(Ok(()), |page| page.write(&text))
}

/// A device by its name in settings.
fn device(name: &str) -> Result<DeviceChoice, ValueError> {
    DeviceChoice::deserialize(StrDeserializer::new(name))
}

/// Which machine and code: a line above the table.
fn machine() -> String {
    let build = build_info::get();
    let unknown = || "unknown".to_owned();
    let features = build.processor_features.join(", ").to_uppercase();
    format!(
        "{}, {} threads, {}; commit {}{}; `cargo xtask {}`",
        build.processor.clone().unwrap_or_else(unknown),
        std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        if features.is_empty() { "no vectors known" } else { &features },
        build.git_revision.as_deref().map_or_else(unknown, |revision| revision.chars().take(9).collect()),
        if build.git_dirty == Some(true) { " and changes" } else { "" },
        build.command_line.join(" "),
    )
}

fn row(figure: &Figure) -> String {
    let value = |value: f64| match value.abs() {
        100.0.. => format!("{value:.0}"),
        10.0.. => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    };
    let goal = figure.goal.map_or_else(String::new, |goal| {
        let (sign, bound) = match goal {
            Goal::AtLeast(bound) => ("≥", bound),
            Goal::AtMost(bound) => ("≤", bound),
        };
        format!("{sign} {} {}", value(bound), if goal.is_met(figure.median) { "met" } else { "missed" })
    });
    let (low, high) = figure.range;
    format!(
        "| {} | {} {} | {} … {} | {goal} |",
        figure.what,
        value(figure.median),
        figure.unit,
        value(low),
        value(high)
    )
}

/// A page with a place for the table.
struct Page<'a> {
    path: &'a Path,
    before: String,
    after: String,
}

impl<'a> Page<'a> {
    fn read(path: &'a Path) -> anyhow::Result<Self> {
        let text = storage::read::text(path, RUN_TEXT_BYTES_MAX).with_context(|| path.display().to_string())?;
        let parts = text.split_once(BEGIN).and_then(|(before, rest)| Some((before, rest.split_once(END)?.1)));
        let (before, after) = parts.with_context(|| {
            format!("{}: no lines {BEGIN} and {END}; write them where the table belongs", path.display())
        })?;
        Ok(Self { path, before: before.to_owned(), after: after.to_owned() })
    }

    fn write(&self, table: &str) -> anyhow::Result<()> {
        let text = format!("{}{BEGIN}\n{}\n{END}{}", self.before, table.trim_end(), self.after);
        Ok(storage::whole::write(self.path, text.as_bytes())?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_says_whether_its_goal_is_met() {
        let figure = |median, goal| Figure { what: "x".to_owned(), median, range: (1.0, 250.4), unit: "µs", goal };
        assert_eq!(row(&figure(12.34, Some(Goal::AtMost(20.0)))), "| x | 12.3 µs | 1.00 … 250 | ≤ 20.0 met |");
        assert_eq!(row(&figure(12.34, Some(Goal::AtLeast(20.0)))), "| x | 12.3 µs | 1.00 … 250 | ≥ 20.0 missed |");
        assert_eq!(row(&figure(3.0, None)), "| x | 3.00 µs | 1.00 … 250 |  |");
    }
}
