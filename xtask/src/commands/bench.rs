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
use std::fmt;
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

const AREAS: [Area; 5] = [Area::Driving, Area::Evaluating, Area::Maps, Area::Answers, Area::Training];
/// What `--peers` measures, beside the areas.
const PEERS_NAME: &str = "peers";
const BEGIN: &str = "<!-- bench -->";
const END: &str = "<!-- /bench -->";
const FIGURES_HEAD: &str = "| | median | range | goal |\n|---|---|---|---|";
const PEERS_HEAD: &str = "| beside it | printed | a step or call there |\n|---|---|---|";

impl Area {
    fn name(self) -> &'static str {
        match self {
            Self::Driving => "driving",
            Self::Evaluating => "evaluating",
            Self::Maps => "maps",
            Self::Answers => "answers",
            Self::Training => "training",
        }
    }
}

pub(crate) fn run(args: &BenchArgs, output: &Output) -> anyhow::Result<()> {
    let page = args.write.as_deref().map(Page::read).transpose()?;
    let effort = if args.quick { Effort::quick() } else { Effort::full() };
    let mut measured = Table { head: vec![machine()], ..Table::default() };
    output.print(format_args!("{}\n\n{FIGURES_HEAD}", measured.head[0]));
    let mut report = |figure: Figure| {
        let row = row(&figure);
        output.print(&row);
        measured.figures.push(row);
    };
    let is_asked_for = |area: &Area| args.only.is_empty() || args.only.contains(area);
    let areas: Vec<Area> = AREAS.into_iter().filter(is_asked_for).collect();
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
    let names: Vec<&str> = areas.iter().map(|area| area.name()).chain(args.peers.then_some(PEERS_NAME)).collect();
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

/// The tables of a page.
#[derive(Debug, Default, PartialEq, Eq)]
struct Table {
    /// Paragraphs above them: machine and code, then those of what was measured later.
    head: Vec<String>,
    figures: Vec<String>,
    peers: Vec<String>,
}

/// How a paragraph begins about what was measured later than the rest.
const LATER: &str = "Measured later (";

impl Table {
    /// Reads what [`fmt::Display`] writes.
    fn read(text: &str) -> Self {
        let mut table = Self::default();
        for block in text.split("\n\n").map(str::trim).filter(|block| !block.is_empty()) {
            let rows = block.lines().skip(2).map(str::to_owned);
            if block.starts_with(FIGURES_HEAD) {
                table.figures.extend(rows);
            } else if block.starts_with(PEERS_HEAD) {
                table.peers.extend(rows);
            } else {
                table.head.push(block.to_owned());
            }
        }
        table
    }

    /// With what was measured anew: the areas of these names. Rows of other areas stay, and so does what is said of them.
    fn with(self, measured: Self, names: &[&str]) -> Self {
        let Self { mut head, mut figures, mut peers } = self;
        if AREAS.iter().all(|area| names.contains(&area.name())) {
            figures.clear();
        }
        if names.contains(&PEERS_NAME) {
            peers.clear();
        }
        if figures.is_empty() && peers.is_empty() {
            return measured;
        }
        let is_of_others = |of: &str| of.split(", ").any(|name| !names.contains(&name));
        head.retain(|said| areas_of(said).is_none_or(is_of_others));
        head.extend(measured.head.iter().map(|machine| format!("{LATER}{}): {machine}", names.join(", "))));
        Self { head, figures: replaced(figures, measured.figures), peers: replaced(peers, measured.peers) }
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.head.join("\n\n"))?;
        for (head, rows) in [(FIGURES_HEAD, &self.figures), (PEERS_HEAD, &self.peers)] {
            if !rows.is_empty() {
                write!(f, "\n\n{head}\n{}", rows.join("\n"))?;
            }
        }
        Ok(())
    }
}

/// The areas that a paragraph is about; `None`: all the others.
fn areas_of(said: &str) -> Option<&str> {
    said.strip_prefix(LATER)?.split_once("): ").map(|(names, _)| names)
}

/// Rows, with new ones in the places of those of the same name, and behind them.
fn replaced(mut rows: Vec<String>, new: Vec<String>) -> Vec<String> {
    let name = |row: &str| row.split('|').nth(1).unwrap_or_default().trim().to_owned();
    for row in new {
        match rows.iter_mut().find(|old| name(old) == name(&row)) {
            Some(old) => *old = row,
            None => rows.push(row),
        }
    }
    rows
}

/// A page with a place for the tables.
struct Page<'a> {
    path: &'a Path,
    before: String,
    table: Table,
    after: String,
}

impl<'a> Page<'a> {
    fn read(path: &'a Path) -> anyhow::Result<Self> {
        let text = storage::read::text(path, RUN_TEXT_BYTES_MAX).with_context(|| path.display().to_string())?;
        let parts = text.split_once(BEGIN).and_then(|(before, rest)| Some((before, rest.split_once(END)?)));
        let (before, (table, after)) = parts.with_context(|| {
            format!("{}: no lines {BEGIN} and {END}; write them where the table belongs", path.display())
        })?;
        Ok(Self { path, before: before.to_owned(), table: Table::read(table), after: after.to_owned() })
    }

    fn write(self, measured: Table, names: &[&str]) -> anyhow::Result<()> {
        let Self { path, before, table, after } = self;
        let text = format!("{before}{BEGIN}\n{}\n{END}{after}", table.with(measured, names));
        Ok(storage::whole::write(path, text.as_bytes())?)
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

    /// `--only training --write` left the rows of training alone in the page.
    #[test]
    fn rows_that_are_not_measured_stay_in_the_page() {
        let rows = |names: &[&str], value: &str| -> Vec<String> {
            names.iter().map(|name| format!("| {name} | {value} s | 1.00 … 2.00 |  |")).collect()
        };
        let of = |machine: &str, figures: Vec<String>, peers: Vec<String>| Table {
            head: vec![machine.to_owned()],
            figures,
            peers,
        };
        let peers = || vec!["| theirs | 7 steps/s | a step |".to_owned()];
        let page = of("old", rows(&["loop", "map", "fit"], "1.00"), peers());
        assert_eq!(Table::read(&format!("\n{page}\n")), page);
        let read = || Table::read(&page.to_string());

        let later = read().with(of("new", rows(&["fit", "more"], "2.00"), Vec::new()), &["training"]);
        assert_eq!(later.head, ["old", "Measured later (training): new"]);
        assert_eq!(later.figures, [rows(&["loop", "map"], "1.00"), rows(&["fit", "more"], "2.00")].concat());
        assert_eq!(later.peers, peers());
        let again = later.with(of("newer", rows(&["map", "fit"], "3.00"), Vec::new()), &["maps", "training"]);
        assert_eq!(again.head, ["old", "Measured later (maps, training): newer"]);
        assert_eq!(Table::read(&again.to_string()), again);

        let all: Vec<&str> = AREAS.iter().map(|area| area.name()).collect();
        let figures = read().with(of("new", rows(&["loop"], "4.00"), Vec::new()), &all);
        assert_eq!((figures.figures, figures.peers), (rows(&["loop"], "4.00"), peers()));
        let whole = || of("new", rows(&["loop"], "4.00"), peers());
        assert_eq!(read().with(whole(), &[&all[..], &[PEERS_NAME]].concat()), whole());
        assert_eq!(Table::default().with(whole(), &["maps"]), whole(), "into an empty place");
    }
}
