//! What each setting means and what it may be: `reference.toml`, read by the range check, by the comments of printed
//! settings and by [`explain`].

use super::presets::PRESETS;
use super::renamed;
use super::schema::Settings;
use anyhow::{bail, ensure};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::{self, Write as _};
use std::str::FromStr;
use std::sync::{LazyLock, OnceLock};
use toml::{Table, Value};

/// One setting.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Dotted key, as in `--set`.
    pub key: String,
    /// What it means, one or two sentences.
    pub about: String,
    /// Unit; empty if it has none.
    #[serde(default)]
    pub unit: String,
    /// Numbers that it may be; each of them, if it is a list.
    pub range: Option<Range>,
    /// Words that it may be.
    #[serde(default)]
    pub choices: Vec<String>,
    /// Where the value is from: paper, authors' code, cited, derived or chosen (docs/methods.md).
    pub source: String,
    /// File and section in `docs/`.
    pub docs: String,
    /// Whether it is one of the few that most users need.
    #[serde(default)]
    pub common: bool,
}

/// Numbers from `low` to `high`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(try_from = "String")]
pub struct Range {
    low: Bound,
    high: Bound,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Bound {
    value: f64,
    is_included: bool,
}

impl Range {
    /// Whether a number is within; NaN is within nothing.
    pub fn contains(&self, number: f64) -> bool {
        let Self { low, high } = self;
        let is_above = number > low.value || (low.is_included && number >= low.value);
        let is_below = number < high.value || (high.is_included && number <= high.value);
        is_above && is_below
    }
}

impl Range {
    /// A number at either end. Where an end itself is outside, a millionth of the range away from it.
    pub fn ends(&self) -> [f64; 2] {
        let Self { low, high } = *self;
        let inset = |end: Bound| if end.is_included { 0.0 } else { 1e-6 * (high.value - low.value) };
        [low.value + inset(low), high.value - inset(high)]
    }
}

impl TryFrom<String> for Range {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl FromStr for Range {
    type Err = String;

    /// As in mathematics: `(0, 1]` lacks 0 and holds 1.
    fn from_str(text: &str) -> Result<Self, String> {
        let parse = || {
            let (low, high) = text.split_once(',')?;
            let low = Bound { value: low.get(1..)?.trim().parse().ok()?, is_included: low.starts_with('[') };
            let end = high.len().checked_sub(1)?;
            let high = Bound { value: high.get(..end)?.trim().parse().ok()?, is_included: high.ends_with(']') };
            Some(Self { low, high })
        };
        parse().ok_or_else(|| format!("{text:?} is not an interval such as \"[0, 1)\""))
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (low, high) = (self.low.value, self.high.value);
        match (self.low.is_included, self.high.is_included) {
            (true, true) => write!(f, "{low} to {high}"),
            (false, true) => write!(f, "more than {low}, at most {high}"),
            (true, false) => write!(f, "{low} to below {high}"),
            (false, false) => write!(f, "more than {low}, less than {high}"),
        }
    }
}

impl Entry {
    /// What it may be: range and unit, or choices; empty if anything.
    pub fn domain(&self) -> String {
        let mut parts = Vec::new();
        if !self.choices.is_empty() {
            parts.push(self.choices.join(" | "));
        }
        if let Some(range) = self.range {
            parts.push(format!("{range} {}", self.unit).trim_end().to_owned());
        }
        parts.join(", ")
    }

    /// One line: what it means and what it may be.
    pub(super) fn comment(&self) -> String {
        let domain = self.domain();
        if domain.is_empty() { self.about.clone() } else { format!("{} [{domain}]", self.about) }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    setting: Vec<Entry>,
}

/// Every setting, in the order of the sections.
pub fn entries() -> &'static [Entry] {
    static ENTRIES: OnceLock<Vec<Entry>> = OnceLock::new();
    ENTRIES.get_or_init(|| {
        let file: File = toml::from_str(include_str!("reference.toml")).expect("reference.toml is well-formed");
        file.setting
    })
}

/// The setting of this key.
pub fn entry(key: &str) -> Option<&'static Entry> {
    static BY_KEY: LazyLock<BTreeMap<&str, &Entry>> =
        LazyLock::new(|| entries().iter().map(|entry| (entry.key.as_str(), entry)).collect());
    BY_KEY.get(key).copied()
}

/// Refuses numbers out of range, wherever in the settings they are.
pub(super) fn check(table: &Table, prefix: &str) -> anyhow::Result<()> {
    for (key, value) in table {
        let key = format!("{prefix}{key}");
        match value {
            Value::Table(section) => check(section, &format!("{key}."))?,
            value => check_value(&key, value)?,
        }
    }
    Ok(())
}

fn check_value(key: &str, value: &Value) -> anyhow::Result<()> {
    let (number, written) = match value {
        Value::Array(values) => return values.iter().try_for_each(|value| check_value(key, value)),
        // As it was written: single precision has more digits when it is widened.
        Value::Float(number) => (*number, (*number as f32).to_string()),
        Value::Integer(number) => (*number as f64, number.to_string()),
        _ => return Ok(()),
    };
    let Some((range, entry)) = entry(key).and_then(|entry| Some((entry.range?, entry))) else {
        return Ok(());
    };
    ensure!(range.contains(number), "{key} = {written} is out of range: {}", entry.domain());
    Ok(())
}

/// Meaning, unit, range, defaults and source of a setting, or the settings of a section.
///
/// # Errors
/// If there is neither; the nearest key is named, and of an old key the new one.
pub fn explain(key: &str) -> anyhow::Result<String> {
    if let Some(entry) = entry(key) {
        return Ok(explain_entry(entry));
    }
    let section = format!("{}.", key.trim_end_matches('.'));
    let mut text = format!("{key}, a section:\n");
    for entry in entries().iter().filter(|entry| entry.key.starts_with(&section)) {
        let _ = write!(text, "\n{}\n    {}\n", entry.key, entry.about);
    }
    if text.lines().count() > 1 {
        return Ok(text);
    }
    if let Some(hint) = renamed::hint(key) {
        bail!("no setting {key:?}: {hint}");
    }
    let likeness = |entry: &Entry| {
        let last = |key: &str| key.rsplit('.').next().unwrap_or_default().to_owned();
        strsim::jaro_winkler(key, &entry.key).max(strsim::jaro_winkler(&last(key), &last(&entry.key)))
    };
    // Of equals, one that the default has.
    let is_used = |entry: &Entry| preset_value("default", &entry.key) != NOT_IN_USE;
    let order = |a: &&Entry, b: &&Entry| likeness(a).total_cmp(&likeness(b)).then_with(|| is_used(a).cmp(&is_used(b)));
    let nearest = entries().iter().max_by(order).filter(|entry| likeness(entry) > 0.8);
    let hint = nearest.map(|entry| format!("; did you mean {:?}?", entry.key)).unwrap_or_default();
    bail!("no setting {key:?}; cargo xtask settings --all lists them{hint}")
}

fn explain_entry(entry: &Entry) -> String {
    let mut text = format!("{}\n{}\n\n", entry.key, entry.about);
    let mut line = |name: &str, value: &str| {
        if !value.is_empty() {
            let _ = writeln!(text, "{name:8} {value}");
        }
    };
    line("unit", &entry.unit);
    line("range", &entry.range.map(|range| range.to_string()).unwrap_or_default());
    line("choices", &entry.choices.join(", "));
    line("default", &defaults(&entry.key));
    line("source", &entry.source);
    line("more", &format!("docs/{}", entry.docs));
    text
}

/// The value of a setting that a preset has no use for.
const NOT_IN_USE: &str = "not in use";

/// The value in every preset; one, if they agree.
fn defaults(key: &str) -> String {
    let values: Vec<(&str, String)> =
        PRESETS.iter().map(|preset| (preset.name, preset_value(preset.name, key))).collect();
    if values.iter().all(|(_, value)| *value == values[0].1) {
        return values[0].1.clone();
    }
    let parts: Vec<String> = values.iter().map(|(name, value)| format!("{value} ({name})")).collect();
    parts.join(", ")
}

/// A setting of a preset as it is printed.
fn preset_value(preset: &str, key: &str) -> String {
    let settings = Settings::preset(preset).expect("a preset of the list");
    let document = settings.to_toml().parse::<toml_edit::DocumentMut>().expect("settings are TOML");
    let mut item = document.as_item();
    for part in key.split('.') {
        match item.get(part) {
            Some(inner) => item = inner,
            None => return NOT_IN_USE.to_owned(),
        }
    }
    // An enum with fields: its variant.
    match item.as_table_like().and_then(|table| table.iter().next()) {
        Some((variant, _)) => variant.to_owned(),
        None => item.to_string().trim().to_owned(),
    }
}

#[cfg(test)]
mod tests;
