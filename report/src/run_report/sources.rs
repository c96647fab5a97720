//! What a run left on disk.

use crate::learning;
use crate::plots::LearningRound;
use crate::settings::{NoiseChoice, Settings};
use anyhow::Context as _;
use policy::dagger::IterationRow;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use sim::scenario::Direction;
use std::path::Path;

/// Everything the report is made of.
#[derive(Debug)]
pub(super) struct Sources {
    pub(super) settings: Settings,
    pub(super) settings_text: String,
    pub(super) manifest: toml::Table,
    /// The training, if it was one.
    pub(super) training: Option<Training>,
    /// The evaluation, if anything was driven.
    pub(super) evaluation: Option<Evaluation>,
}

#[derive(Debug)]
pub(super) struct Training {
    pub(super) table: String,
    pub(super) table1: Table1,
    pub(super) rounds: Vec<LearningRound>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Table1 {
    pub(super) rows: Vec<IterationRow>,
    pub(super) paper: Paper,
}

#[derive(Debug, Deserialize)]
pub(super) struct Paper {
    pub(super) eta_hat: Vec<Option<f64>>,
}

#[derive(Debug)]
pub(super) struct Evaluation {
    pub(super) tables: String,
    pub(super) summary: Summary,
    pub(super) runs: Vec<Run>,
    pub(super) failures: Vec<Failure>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Summary {
    pub(super) rows: Vec<Row>,
    pub(super) noise_sweep: Vec<SweepRow>,
}

/// A row of `summary.csv`, as far as it is drawn.
#[derive(Debug, Deserialize)]
pub(super) struct Row {
    pub(super) driver: String,
    pub(super) noise: NoiseChoice,
    pub(super) lots: String,
    pub(super) direction: String,
    pub(super) reference_m: f64,
    pub(super) near_collisions: u32,
    pub(super) per_100m: f64,
    pub(super) garwood_lower: f64,
    pub(super) garwood_upper: f64,
    pub(super) bootstrap_lower: Option<f64>,
    pub(super) bootstrap_upper: Option<f64>,
    pub(super) dispersion: Option<f64>,
    pub(super) safe_ratio: f64,
}

#[derive(Debug, Deserialize)]
pub(super) struct SweepRow {
    pub(super) driver: String,
    pub(super) lots: String,
    pub(super) times_paper: Option<f64>,
    pub(super) per_100m: f64,
    pub(super) lower: f64,
    pub(super) upper: f64,
}

/// A line of `runs.jsonl`.
#[derive(Debug, Deserialize)]
pub(super) struct Run {
    pub(super) driver: String,
    pub(super) noise: NoiseChoice,
    pub(super) metrics: Metrics,
}

#[derive(Debug, Deserialize)]
pub(super) struct Metrics {
    pub(super) safe_ratio: f64,
}

/// A line of `failures.jsonl`.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Failure {
    pub(super) driver: String,
    pub(super) lot: String,
    pub(super) direction: Direction,
    pub(super) trial: u32,
    pub(super) noise: NoiseChoice,
    pub(super) tick: u32,
    pub(super) route_m: f32,
    pub(super) speed_mps: f32,
    pub(super) cause: String,
    pub(super) replay: String,
}

impl Sources {
    pub(super) fn read(folder: &Path) -> anyhow::Result<Self> {
        let settings_text = text(&folder.join("settings.toml"))?;
        Ok(Self {
            settings: Settings::read(&folder.join("settings.toml"))?,
            settings_text,
            manifest: text(&folder.join("manifest.toml"))?.parse().context("manifest.toml")?,
            training: Training::read(folder)?,
            evaluation: Evaluation::read(folder)?,
        })
    }

    /// A value of the manifest as text.
    pub(super) fn made_with(&self, key: &str) -> String {
        match self.manifest.get(key) {
            Some(toml::Value::String(text)) => text.clone(),
            Some(value) => value.to_string(),
            None => "unknown".to_owned(),
        }
    }

    /// The command line, quoted as a shell needs it.
    pub(super) fn command_line(&self) -> String {
        let words = self.manifest.get("command_line").and_then(toml::Value::as_array);
        let words = words.into_iter().flatten().filter_map(toml::Value::as_str);
        let is_plain = |word: &str| word.chars().all(|c| c.is_alphanumeric() || "-_./:=,@%+".contains(c));
        let quoted =
            |word: &str| if is_plain(word) { word.to_owned() } else { format!("'{}'", word.replace('\'', "'\\''")) };
        std::iter::once("cargo xtask".to_owned()).chain(words.map(quoted)).collect::<Vec<_>>().join(" ")
    }
}

impl Training {
    fn read(folder: &Path) -> anyhow::Result<Option<Self>> {
        if !folder.join("table1.json").is_file() {
            return Ok(None);
        }
        let table1: Table1 = json(&folder.join("table1.json"))?;
        let mut rounds = Vec::new();
        for row in &table1.rows {
            let name = if row.round == 0 { "BC".to_owned() } else { format!("i = {}", row.round) };
            rounds.extend(learning::read(&folder.join(format!("round-{:02}", row.round)), &name)?);
        }
        rounds.extend(learning::read(&folder.join("final"), "final")?);
        Ok(Some(Self { table: text(&folder.join("table1.md"))?, table1, rounds }))
    }
}

impl Evaluation {
    fn read(folder: &Path) -> anyhow::Result<Option<Self>> {
        if !folder.join("summary.json").is_file() {
            return Ok(None);
        }
        Ok(Some(Self {
            tables: text(&folder.join("summary.md"))?,
            summary: json(&folder.join("summary.json"))?,
            runs: lines(&folder.join("runs.jsonl"))?,
            failures: lines(&folder.join("failures.jsonl"))?,
        }))
    }

    /// The lots that stand for all: pooled where there are several.
    pub(super) fn pooled(&self) -> &str {
        self.summary.rows.last().map_or("all", |row| row.lots.as_str())
    }
}

fn text(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("{}: cannot be read for the report", path.display()))
}

fn json<T: DeserializeOwned>(path: &Path) -> anyhow::Result<T> {
    serde_json::from_str(&text(path)?).with_context(|| path.display().to_string())
}

fn lines<T: DeserializeOwned>(path: &Path) -> anyhow::Result<Vec<T>> {
    let line = |(index, line): (usize, &str)| {
        serde_json::from_str(line).with_context(|| format!("{}:{}", path.display(), index + 1))
    };
    text(path)?.lines().enumerate().map(line).collect()
}
