//! The paper's table of DAgger iterations, from a run, as data.

use crate::json;
use crate::paper::{IterationsOfPaper, TABLE_1};
use experiment::run_dir::RunDir;
use policy::dagger::{IterationRow, Stop};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The version of `table1.json` that this program writes.
pub const SCHEMA: u32 = 1;
const FILE: &str = "table1.json";

/// The rounds of a training; `table1.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table1 {
    /// Version of the format: [`SCHEMA`].
    pub schema: u32,
    /// One per finished round.
    pub rows: Vec<IterationRow>,
    /// Why it ended.
    pub stop: Stop,
    /// The paper's table.
    pub paper: IterationsOfPaper,
}

impl Table1 {
    /// The table of finished rounds.
    pub fn new(rows: Vec<IterationRow>, stop: Stop) -> Self {
        Self { schema: SCHEMA, rows, stop, paper: TABLE_1 }
    }

    /// Writes `table1.json`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, run: &RunDir) -> anyhow::Result<()> {
        run.write(FILE, json::to_text(self)?.as_bytes())
    }

    /// Reads `table1.json`; `None` if nothing was trained there.
    ///
    /// # Errors
    /// If it is not what it should be, or of another version.
    pub fn read(folder: &Path) -> anyhow::Result<Option<Self>> {
        json::read_versioned(&folder.join(FILE), SCHEMA)
    }
}
