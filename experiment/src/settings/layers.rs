//! Laying changes over a preset, and saying precisely what is wrong with one.

use super::reference;
use super::renamed;
use super::schema::Settings;
use anyhow::{Context as _, anyhow, bail, ensure};
use sim::limits::{RUN_TOML_BYTES_MAX, SETTINGS_BYTES_MAX};
use sim::seed::RootSeed;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Where settings come from, lowest priority first: preset, file, single overrides.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layers {
    /// Name of the preset to start from; `default` if `None`.
    pub preset: Option<String>,
    /// TOML file with the settings to change.
    pub file: Option<PathBuf>,
    /// Single changes, each as `key.of.setting=VALUE`.
    pub overrides: Vec<String>,
}

impl Layers {
    /// The preset that is meant where none is named.
    pub fn preset_name(&self) -> &str {
        self.preset.as_deref().unwrap_or("default")
    }

    /// Whether other settings than a run's own are asked for.
    pub fn names_a_base(&self) -> bool {
        self.preset.is_some() || self.file.is_some()
    }
}

impl Settings {
    /// Preset → file → overrides → seed.
    ///
    /// # Errors
    /// Naming what is wrong in which layer.
    pub fn resolve(layers: &Layers, seed: Option<u64>) -> anyhow::Result<Self> {
        Self::resolve_over(&Self::preset(layers.preset_name())?, layers, seed)
    }

    /// The same over other settings than a preset's, e.g. a run's own.
    ///
    /// # Errors
    /// Naming what is wrong in which layer.
    pub fn resolve_over(base: &Self, layers: &Layers, seed: Option<u64>) -> anyhow::Result<Self> {
        let mut settings = apply(base, layers.file.as_deref(), &layers.overrides)?;
        if let Some(seed) = seed {
            settings.seed = RootSeed(seed);
        }
        settings.checked()
    }

    /// The default with the changes of a file that has this text: for fuzz targets, which have no file. `path` is what errors
    /// call it.
    ///
    /// # Errors
    /// Naming what is wrong, and its line.
    pub fn resolve_text(text: &str, path: &Path) -> anyhow::Result<Self> {
        lay(&Self::preset("default")?, Some((path, text)), &[])?.checked()
    }

    fn checked(mut self) -> anyhow::Result<Self> {
        self.name_lots_one_by_one();
        self.check()?;
        Ok(self)
    }

    /// `"a,b"` as `"a", "b"`: what a network was trained on is known by single names.
    pub fn name_lots_one_by_one(&mut self) {
        for lots in [&mut self.training.lots, &mut self.evaluation.lots, &mut self.evaluation.elsewhere] {
            *lots = lots.iter().flat_map(|names| names.split(',').map(|name| name.trim().to_owned())).collect();
        }
    }

    /// Reads complete settings, as written into a run.
    ///
    /// # Errors
    /// If the file is missing, damaged or not complete.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = storage::sums::read_to_string(path, RUN_TOML_BYTES_MAX)?;
        let tree = parse(path, &text)?;
        let settings = settings_from(&tree).map_err(|fault| fault.in_file(path, &text))?;
        settings.check()?;
        Ok(settings)
    }
}

/// Lays a file and then single overrides over a base.
pub(super) fn apply(base: &Settings, file: Option<&Path>, overrides: &[String]) -> anyhow::Result<Settings> {
    let read = |path: &Path| {
        storage::sums::read_text(path, SETTINGS_BYTES_MAX)
            .with_context(|| format!("{}: cannot be read; name a TOML file with settings", path.display()))
    };
    let text = file.map(read).transpose()?;
    lay(base, file.zip(text.as_deref()), overrides)
}

/// Lays the text of a file, which has this path, and then single overrides over a base. What is not TOML is refused before
/// anything is laid over anything.
fn lay(base: &Settings, file: Option<(&Path, &str)>, overrides: &[String]) -> anyhow::Result<Settings> {
    let file = file.map(|(path, text)| Ok::<_, anyhow::Error>((path, text, parse(path, text)?))).transpose()?;
    let overrides: Vec<_> =
        overrides.iter().map(|text| Ok((text, parse_override(text)?))).collect::<anyhow::Result<_>>()?;
    let mut tree = Table::try_from(base).expect("settings are plain values");
    let mut settings = None;
    if let Some((path, text, of_file)) = file {
        merge(&mut tree, of_file.clone());
        settings = Some(settings_from(&tree).map_err(|fault| fault.in_file(path, text))?);
        reference::check(&of_file, "").with_context(|| path.display().to_string())?;
    }
    for (text, (key, value)) in overrides {
        merge(&mut tree, nested(&key, value));
        let fault = |Fault { key, problem }| anyhow!("--set {}: {key}: {problem}", storage::shortened(text, SAID_MAX));
        settings = Some(settings_from(&tree).map_err(fault)?);
    }
    match settings {
        Some(settings) => Ok(settings),
        None => settings_from(&tree).map_err(|Fault { key, problem }| anyhow!("{key}: {problem}")),
    }
}

fn parse(path: &Path, text: &str) -> anyhow::Result<Table> {
    text.parse().map_err(|error: toml::de::Error| anyhow!("{}: {}", place(path, text, error.span()), error.message()))
}

/// What is wrong, and with which key.
struct Fault {
    key: String,
    problem: String,
}

impl Fault {
    fn in_file(self, path: &Path, text: &str) -> anyhow::Error {
        anyhow!("{}: {}: {}", place(path, text, span_of(text, &self.key)), self.key, self.problem)
    }
}

fn settings_from(tree: &Table) -> Result<Settings, Fault> {
    serde_path_to_error::deserialize(Value::Table(tree.clone())).map_err(|error| {
        let key = error.path().to_string();
        let key = key.trim_end_matches(".?").to_owned();
        let problem = explain(&key, error.inner().message());
        Fault { key, problem }
    })
}

/// Adds the nearest valid key to "unknown field `etta`, expected one of `eta`, …", of an old key the new one, and to
/// anything else what the setting may be.
fn explain(key: &str, message: &str) -> String {
    let message = message.lines().next().unwrap_or(message);
    let Some((_, expected)) = message.split_once("unknown field ").or_else(|| message.split_once("unknown variant "))
    else {
        let list = if message.ends_with("expected a sequence") { "; write a list, as in '[\"lot-a\"]'" } else { "" };
        let domain = reference::entry(key).map(reference::Entry::domain).filter(|domain| !domain.is_empty());
        let domain = domain.map_or_else(String::new, |domain| format!("; it may be {domain}"));
        return format!("{message}{list}{domain}");
    };
    if let Some(hint) = renamed::hint(key) {
        return hint;
    }
    let mut quoted = expected.split('`').skip(1).step_by(2);
    let wrong = quoted.next().unwrap_or_default();
    let valid: Vec<&str> = quoted.collect();
    let nearest = valid
        .iter()
        .map(|candidate| (strsim::jaro_winkler(wrong, candidate), candidate))
        .filter(|(likeness, _)| *likeness > 0.8)
        .max_by(|(a, _), (b, _)| a.total_cmp(b));
    let hint = nearest.map(|(_, candidate)| format!("did you mean {candidate:?}?"));
    let valid = valid.join(", ");
    if message.contains("unknown variant") {
        let hint = hint.map(|hint| format!("{hint} ")).unwrap_or_default();
        return format!("no value {wrong:?}; {hint}{key} takes {valid}");
    }
    let place = key.rsplit_once('.').map_or_else(|| "at the top".to_owned(), |(section, _)| format!("in {section}"));
    // A question ends its sentence.
    let there = hint.map_or_else(|| "there".to_owned(), |hint| format!("{hint} There"));
    format!("no key {wrong:?} {place}; {there} are {valid}")
}

/// Lays `changes` over `tree`.
fn merge(tree: &mut Table, changes: Table) {
    for (key, change) in changes {
        match (tree.get_mut(&key), change) {
            (Some(Value::Table(old)), Value::Table(new)) if !switches_variant(old, &new) => merge(old, new),
            (_, change) => {
                tree.insert(key, change);
            }
        }
    }
}

/// `rule = { all_below = … }` laid over with `rule = { tau_only = … }`: an enum has one variant, not two. A section of
/// a single key is an enum; no struct of the settings has only one field.
fn switches_variant(old: &Table, new: &Table) -> bool {
    old.len() == 1 && new.len() == 1 && !old.keys().eq(new.keys())
}

/// Parts of a key, at most.
const KEY_PARTS_MAX: usize = 8;
/// Characters of a change that an error repeats, at most.
const SAID_MAX: usize = 200;

/// `a.b.c=VALUE`.
fn parse_override(text: &str) -> anyhow::Result<(Vec<String>, Value)> {
    let said = storage::shortened(text, SAID_MAX);
    let (key, value) = text
        .split_once('=')
        .with_context(|| format!("--set {said}: write a key and a value, as in --set dagger.eta=0.8"))?;
    let key: Vec<String> = key.trim().split('.').map(str::to_owned).collect();
    ensure!(
        key.len() <= KEY_PARTS_MAX,
        "--set {said}: a key of {} parts; none has more than {KEY_PARTS_MAX}",
        key.len()
    );
    let value = value.trim();
    let parsed = format!("value = {value}")
        .parse::<Table>()
        .ok()
        .and_then(|mut table| table.remove("value").filter(|_| table.is_empty()));
    let is_word = !value.is_empty() && value.chars().all(|c| c.is_alphanumeric() || "-_".contains(c));
    match parsed {
        Some(Value::Table(table)) if table.is_empty() => {
            bail!("--set {said}: an empty table changes nothing; name a key and its value")
        }
        Some(value) => Ok((key, value)),
        // A bare word can only be meant as a string.
        None if is_word => Ok((key, Value::String(value.to_owned()))),
        None => {
            bail!("--set {said}: this is not a TOML value; strings and lists of them need quotes, as in '[\"lot-a\"]'")
        }
    }
}

/// `{a = {b = {c = value}}}`.
fn nested(path: &[String], value: Value) -> Table {
    let (first, rest) = path.split_first().expect("splitting yields at least one part");
    let value = if rest.is_empty() { value } else { Value::Table(nested(rest, value)) };
    Table::from_iter([(first.clone(), value)])
}

/// `file:line`, if the line is known.
fn place(path: &Path, text: &str, span: Option<std::ops::Range<usize>>) -> String {
    let line = span.map(|span| text[..span.start.min(text.len())].matches('\n').count() + 1);
    line.map_or_else(|| path.display().to_string(), |line| format!("{}:{line}", path.display()))
}

/// Where a dotted key stands in a TOML text.
fn span_of(text: &str, key: &str) -> Option<std::ops::Range<usize>> {
    let document = toml_edit::Document::parse(text).ok()?;
    let mut table: &dyn toml_edit::TableLike = document.as_table();
    let mut span = None;
    for part in key.split('.') {
        let Some((found, item)) = table.get_key_value(part) else { break };
        span = found.span().or_else(|| item.span());
        let Some(inner) = item.as_table_like() else { break };
        table = inner;
    }
    span
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The values that a setting takes were listed as if they were keys of its section.
    #[test]
    fn an_unknown_value_is_told_what_its_setting_takes() {
        let layers = Layers { overrides: vec!["dagger.rule=hgdagger".to_owned()], ..Layers::default() };
        let refused = Settings::resolve(&layers, None).unwrap_err().to_string();
        let told = "no value \"hgdagger\"; did you mean \"hg_dagger\"? dagger.rule takes all_below, ";
        assert!(refused.contains(told) && !refused.contains("ere are"), "{refused}");
    }

    /// "did you mean "eta"?; in dagger there are" was one sentence with a question in its middle.
    #[test]
    fn an_unknown_key_is_told_what_there_is_after_the_question_which_one_is_meant() {
        for (key, told) in [
            ("dagger.etta", "no key \"etta\" in dagger; did you mean \"eta\"? There are "),
            ("dager.eta", "no key \"dager\" at the top; did you mean \"dagger\"? There are "),
            ("dagger.xyz", "no key \"xyz\" in dagger; there are "),
        ] {
            let layers = Layers { overrides: vec![format!("{key}=0.8")], ..Layers::default() };
            let refused = Settings::resolve(&layers, None).unwrap_err().to_string();
            assert!(refused.contains(told), "{refused}");
        }
    }
}
