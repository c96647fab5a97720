//! `bench`: how fast this is, here.

use crate::build_info;
use crate::output::Output;
use benchmark::page::{self, FIGURES_HEAD, PEERS_HEAD, Page, Table};
use benchmark::peers::{self, PEERS};
use benchmark::{Effort, Figure, driving, evaluating, maps, network};
use clap::{Args, ValueEnum};
use policy::fit::DeviceChoice;
use serde::Deserialize as _;
use serde::de::value::{Error as ValueError, StrDeserializer};
use std::path::PathBuf;

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
    /// Writes the table into this Markdown file, between its lines `<!-- bench -->` and `<!-- /bench -->`; rows there that are not
    /// measured stay.
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

impl Area {
    fn name(self) -> &'static str {
        page::AREAS[self as usize]
    }
}

pub(crate) fn run(args: &BenchArgs, output: &Output) -> anyhow::Result<()> {
    let page = args.write.as_deref().map(Page::read).transpose()?;
    let effort = if args.quick { Effort::quick() } else { Effort::full() };
    let mut measured = Table { head: vec![machine()], ..Table::default() };
    output.print(format_args!("{}\n\n{FIGURES_HEAD}", measured.head[0]));
    let mut report = |figure: Figure| {
        let row = page::row(&figure);
        output.print(&row);
        measured.figures.push(row);
    };
    let is_asked_for = |area: &&Area| args.only.is_empty() || args.only.contains(area);
    let areas: Vec<&Area> = Area::value_variants().iter().filter(is_asked_for).collect();
    for area in &areas {
        match area {
            Area::Driving => driving::figures(effort, &mut report)?,
            Area::Evaluating => evaluating::figures(effort, &mut report)?,
            Area::Maps => maps::figures(effort, &mut report)?,
            Area::Answers => network::answers(effort, &mut report)?,
            Area::Training => network::training(effort, args.device, &mut report)?,
        }
    }
    if args.peers {
        output.print(format_args!("\n{PEERS_HEAD}"));
        for peer in &PEERS {
            // One that cannot be installed does not hide the others.
            let printed =
                peers::run(peer, &args.environment).unwrap_or_else(|error| vec![format!("failed: {error:#}")]);
            let row = format!("| {} | {} | {} |", peer.name, printed.join("; "), peer.about);
            output.print(&row);
            measured.peers.push(row);
        }
    }
    let Some(page) = page else { return Ok(()) };
    let names: Vec<&str> = areas.iter().map(|area| area.name()).chain(args.peers.then_some(page::PEERS)).collect();
    page.write(measured, &names)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_called_in_the_page_as_on_the_command_line() {
        let of_command = Area::value_variants().iter().map(|area| area.to_possible_value().expect("none is hidden"));
        assert!(of_command.map(|value| value.get_name().to_owned()).eq(page::AREAS));
        assert!(Area::value_variants().iter().map(|area| area.name()).eq(page::AREAS));
    }
}
