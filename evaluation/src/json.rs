//! JSON files with a version.

use anyhow::{Context as _, ensure};
use serde::de::DeserializeOwned;
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::path::Path;
use storage::sums;

/// Reads a file whose field `schema` is the version of its format; `None` if no such file is finished.
///
/// # Errors
/// If it is missing, damaged or of another version.
pub fn read_versioned<T: DeserializeOwned>(path: &Path, schema: u32) -> anyhow::Result<Option<T>> {
    let Some(text) = sums::read_if_listed(path, RUN_TEXT_BYTES_MAX)? else { return Ok(None) };
    let value: serde_json::Value = serde_json::from_slice(&text).with_context(|| path.display().to_string())?;
    let found = value.get("schema").and_then(serde_json::Value::as_u64).unwrap_or(0);
    ensure!(
        found == u64::from(schema),
        "{}: written by another version of lotpilot (schema {found}, this one reads {schema}); make it again",
        path.display()
    );
    serde_json::from_value(value).map(Some).with_context(|| path.display().to_string())
}

/// Pretty JSON with a newline at its end.
///
/// # Errors
/// If the value cannot be written as JSON.
pub fn to_text(value: &impl serde::Serialize) -> anyhow::Result<String> {
    Ok(serde_json::to_string_pretty(value)? + "\n")
}
