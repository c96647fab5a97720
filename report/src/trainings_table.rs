//! What comes of several trainings whose policies all drove: a table, its rows and a plot.

use evaluation::statistics::bootstrap::Interval;
use experiment::run_dir::RunDir;

/// A table of several trainings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TrainingsTable {
    /// The table as Markdown, and how it is read.
    pub text: String,
    /// Its rows as CSV.
    pub csv: Vec<u8>,
    /// The same as a plot, SVG.
    pub svg: String,
}

impl TrainingsTable {
    /// Writes `NAME.md`, `NAME.csv` and `NAME.svg` into a run.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, run: &RunDir, name: &str) -> anyhow::Result<()> {
        run.write(&format!("{name}.md"), format!("{}\n", self.text).as_bytes())?;
        run.write(&format!("{name}.csv"), &self.csv)?;
        run.write(&format!("{name}.svg"), self.svg.as_bytes())
    }
}

/// A difference as columns of the CSV: itself, its lower and its upper end.
pub(crate) fn columns_of(difference: Option<Interval>) -> [Option<f64>; 3] {
    let column = |of: fn(Interval) -> f64| difference.map(of);
    [column(|interval| interval.estimate), column(|interval| interval.lower), column(|interval| interval.upper)]
}
