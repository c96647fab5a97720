//! The paper's table of DAgger iterations, from a run beside the paper's, as Markdown.

use crate::markdown::with_header;
use comfy_table::Table;
use evaluation::names::BC;
use evaluation::paper::{self, IterationsOfPaper};
use evaluation::table1::Table1;
use experiment::run_dir::RunDir;
use experiment::settings::{Settings, has_points_of_paper};
use policy::dagger::{IterationRow, Stop};
use policy::decision_rule::DecisionRule;
use std::fmt;

/// Writes `table1.md`; returns its text.
///
/// # Errors
/// If the file cannot be written.
pub fn write(table1: &Table1, run: &RunDir) -> anyhow::Result<String> {
    let text = to_markdown(table1);
    run.write("table1.md", format!("{text}\n").as_bytes())?;
    Ok(text)
}

/// A cell of a column.
type Cell = fn(&IterationRow) -> Option<String>;

/// What η̂ is to be read with, per round: name of the row, its cells.
const AGREEMENT: [(&str, Cell); 5] = [
    ("τ̂ < τ, whoever drove", |row| row.agreement.map(|found| format!("{:.3}", found.within_tau))),
    ("  best constant answer", |row| row.agreement.map(|found| format!("{:.3}", found.constant_within_tau))),
    ("τ̂ < τ scaled as the labels", |row| {
        row.agreement.map(|found| format!("{:.3} (τ {:.3})", found.within_tau_scaled, found.tau_scaled))
    }),
    ("  best constant answer, too", |row| {
        row.agreement.map(|found| format!("{:.3}", found.constant_within_tau_scaled))
    }),
    ("τ̂: quartiles; 90, 99 %", |row| {
        let [low, middle, high, most, nearly_all] =
            row.agreement?.tau_hat_quantiles.map(|tau_hat| format!("{tau_hat:.3}"));
        Some(format!("{low} {middle} {high}; {most} {nearly_all}"))
    }),
];

/// How to read it.
pub(crate) const READ_ETA_HAT: &str = "The best constant answer is the point that is within τ of the most labels: what is \
    learned is what lies above it. Nearer labels have smaller errors at the same τ; scaled as the labels, τ · mean range of \
    the labels / 6.4 m, the range of the paper's points (460 m in 6425 samples of 0.05 s, v = a_y/4.48). Shares compare \
    with the paper's η̂ only where labels and τ are the paper's.";

/// Whether η̂ is the quantity that the paper has: its labels, its τ.
pub(crate) fn has_eta_hat_of_paper(settings: &Settings) -> bool {
    has_points_of_paper(settings) && settings.dagger.rule.tau() == DecisionRule::paper().tau()
}

/// The paper's η̂ by iteration, to be drawn beside ours: none where ours is another quantity.
pub(crate) fn eta_hat_of_paper(settings: &Settings) -> Vec<(u32, f64)> {
    let of_paper = (0..).zip(paper::TABLE_1.eta_hat).filter_map(|(round, eta)| Some((round, eta?)));
    if has_eta_hat_of_paper(settings) { of_paper.collect() } else { Vec::new() }
}

/// A table of iterations beside the paper's, a column per round.
pub(crate) struct ByRound {
    table: Table,
    columns: usize,
}

impl ByRound {
    /// With the rows that every such table begins with. `unweighted`: rounds of the same training with α = 0, or none.
    pub(crate) fn new(rows: &[IterationRow], unweighted: &[IterationRow], paper: &IterationsOfPaper) -> Self {
        let columns = rows.len().max(unweighted.len()).max(paper.dataset.len());
        let header = std::iter::once(String::new())
            .chain((0..columns).map(|i| if i == 0 { BC.to_owned() } else { format!("i = {i}") }));
        let mut table = Self { table: with_header(header.collect()), columns };
        let eta_hat: Cell = |row| row.eta_hat.map(|eta| format!("{eta:.3}"));
        table.add_of("samples", rows, |row| Some(row.samples.to_string()));
        table.add("  paper", &|i| paper.dataset.get(i).map(ToString::to_string));
        table.add_of("η̂ = network / total", rows, eta_hat);
        if !unweighted.is_empty() {
            table.add_of("  with α = 0", unweighted, eta_hat);
        }
        table.add("  paper", &|i| of_paper(&paper.eta_hat, i));
        for (name, cell) in AGREEMENT {
            table.add_of(name, rows, cell);
        }
        table
    }

    /// Adds a row, whose cells are told by round.
    pub(crate) fn add(&mut self, name: &str, cell: &dyn Fn(usize) -> Option<String>) {
        let cells = (0..self.columns).map(|i| cell(i).unwrap_or_else(|| "–".to_owned()));
        self.table.add_row(std::iter::once(name.to_owned()).chain(cells).collect::<Vec<_>>());
    }

    /// Adds a row of what the rounds of a training have.
    pub(crate) fn add_of(&mut self, name: &str, rows: &[IterationRow], cell: Cell) {
        self.add(name, &|i| rows.get(i).and_then(cell));
    }
}

impl fmt::Display for ByRound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.table, f)
    }
}

/// A figure of the paper's table as it is printed there.
pub(crate) fn of_paper(values: &[Option<f64>; 6], round: usize) -> Option<String> {
    values.get(round).copied().flatten().map(|value| format!("{value:.2}"))
}

/// A column per round.
pub fn to_markdown(table1: &Table1) -> String {
    let mut table = ByRound::new(&table1.rows, &[], &table1.paper);
    let mut add = |name: &str, cell: Cell| table.add_of(name, &table1.rows, cell);
    add("samples in all", |row| Some(row.dataset.to_string()));
    add("mean weight of τ̂", |row| row.mean_weight.map(|weight| format!("{weight:.3}")));
    add("validation NLL", |row| row.validation_nll.map(|nll| format!("{nll:.3}")));
    add("validation error, m", |row| row.validation_rmse_m.map(|error| format!("{error:.3}")));
    add("Σ τ̂ per second", |row| row.tau_hat_per_s.map(|sum| format!("{sum:.3}")));
    add("near-collisions", |row| Some(row.near_collisions.to_string()));
    add("contacts", |row| row.effort.map(|effort| effort.contacts.to_string()));
    add("interventions", |row| row.effort.map(|effort| effort.interventions.to_string()));
    let why = match table1.stop {
        Stop::EtaReached => "η̂ passed the threshold η",
        Stop::IterationCap => "the cap on iterations was reached",
        Stop::Interrupted => "interrupted",
    };
    format!(
        "{table}\n\nEnded: {why}. η̂ and near-collisions of a column are of the policy trained in the column before; \
         the validation is of the policy trained in this one. {READ_ETA_HAT}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::agreement::Agreement;

    #[test]
    fn shorter_and_longer_runs_than_the_papers_fill_up_with_dashes() {
        let row = |round| IterationRow {
            round,
            samples: 100 + round as usize,
            dataset: 1000,
            eta_hat: (round > 0).then_some(0.5),
            tau_hat_per_s: None,
            near_collisions: 0,
            effort: None,
            agreement: (round > 0).then_some(Agreement {
                tau: 0.07,
                tau_scaled: 0.035,
                label_ahead_m: 3.2,
                within_tau: 0.886,
                within_tau_scaled: 0.64,
                constant_within_tau: 0.5,
                constant_within_tau_scaled: 0.2,
                tau_hat_quantiles: [0.01, 0.02, 0.04, 0.075, 0.2],
            }),
            mean_weight: None,
            validation_nll: Some(-2.0),
            validation_rmse_m: None,
        };
        for (count, columns) in [(2, 6), (8, 8)] {
            let rows: Vec<_> = (0..count).map(row).collect();
            let text = to_markdown(&Table1::new(rows, Stop::EtaReached));
            let lines: Vec<&str> = text.lines().take_while(|line| line.starts_with('|')).collect();
            assert!(lines.iter().all(|line| line.matches('|').count() == columns + 2), "{text}");
            assert!(text.contains("6425") && text.contains("101"), "{text}");
            assert!(text.contains("0.640 (τ 0.035)") && text.contains("0.010 0.020 0.040; 0.075 0.200"), "{text}");
        }
    }
}
