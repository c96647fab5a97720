//! Figures as tables, and the page in which they stand: what is measured anew takes the place of what was there.

use crate::{Figure, Goal};
use anyhow::Context as _;
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::fmt;
use std::path::Path;

/// Names of what is measured here.
pub const AREAS: [&str; 5] = ["driving", "evaluating", "maps", "answers", "training"];
/// Name of what is measured beside it.
pub const PEERS: &str = "peers";
/// The head of the table of figures.
pub const FIGURES_HEAD: &str = "| | median | range | goal |\n|---|---|---|---|";
/// The head of the table of other simulators and libraries.
pub const PEERS_HEAD: &str = "| beside it | printed | a step or call there |\n|---|---|---|";
const BEGIN: &str = "<!-- bench -->";
const END: &str = "<!-- /bench -->";

/// A figure as a row below [`FIGURES_HEAD`].
pub fn row(figure: &Figure) -> String {
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
pub struct Table {
    /// Paragraphs above them: machine and code, then those of what was measured later.
    pub head: Vec<String>,
    /// Rows below [`FIGURES_HEAD`].
    pub figures: Vec<String>,
    /// Rows below [`PEERS_HEAD`].
    pub peers: Vec<String>,
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
        if AREAS.iter().all(|area| names.contains(area)) {
            figures.clear();
        }
        if names.contains(&PEERS) {
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

/// A page with a place for the tables, between its lines `<!-- bench -->` and `<!-- /bench -->`.
#[derive(Debug)]
pub struct Page<'a> {
    path: &'a Path,
    before: String,
    table: Table,
    after: String,
}

impl<'a> Page<'a> {
    /// Reads a page.
    ///
    /// # Errors
    /// If it cannot be read, or has no place for the tables.
    pub fn read(path: &'a Path) -> anyhow::Result<Self> {
        let text = storage::read::text(path, RUN_TEXT_BYTES_MAX).with_context(|| path.display().to_string())?;
        let parts = text.split_once(BEGIN).and_then(|(before, rest)| Some((before, rest.split_once(END)?)));
        let (before, (table, after)) = parts.with_context(|| {
            format!("{}: no lines {BEGIN} and {END}; write them where the table belongs", path.display())
        })?;
        Ok(Self { path, before: before.to_owned(), table: Table::read(table), after: after.to_owned() })
    }

    /// Writes it with what was measured: the areas of these names, of [`AREAS`] and [`PEERS`]. Rows of others stay.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(self, measured: Table, names: &[&str]) -> anyhow::Result<()> {
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

        let figures = read().with(of("new", rows(&["loop"], "4.00"), Vec::new()), &AREAS);
        assert_eq!((figures.figures, figures.peers), (rows(&["loop"], "4.00"), peers()));
        let whole = || of("new", rows(&["loop"], "4.00"), peers());
        assert_eq!(read().with(whole(), &[&AREAS[..], &[PEERS]].concat()), whole());
        assert_eq!(Table::default().with(whole(), &["maps"]), whole(), "into an empty place");
    }
}
