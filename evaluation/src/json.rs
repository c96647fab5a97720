//! JSON files with a version.

use anyhow::{Context as _, ensure};
use experiment::manifest;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::path::Path;
use storage::sums;

/// What is read of a file first: the rest of another version may be anything, and is not held.
#[derive(Deserialize)]
struct Version {
    #[serde(default)]
    schema: u64,
}

/// Reads a file whose field `schema` is the version of its format; `None` if no such file is finished.
///
/// # Errors
/// If it is missing, damaged or of another version.
pub fn read_versioned<T: DeserializeOwned>(path: &Path, schema: u32) -> anyhow::Result<Option<T>> {
    let (folder, name) = (path.parent().unwrap_or(Path::new("")), path.file_name().unwrap_or_default());
    if !manifest::has_file(folder, &name.to_string_lossy())? {
        return Ok(None);
    }
    let text = sums::read(path, RUN_TEXT_BYTES_MAX)?;
    let version = serde_json::from_slice::<Version>(&text).with_context(|| path.display().to_string())?;
    let found = version.schema;
    ensure!(
        found == u64::from(schema),
        "{}: written by another version of lotpilot (schema {found}, this one reads {schema}); make it again",
        path.display()
    );
    serde_json::from_slice(&text).map(Some).with_context(|| path.display().to_string())
}

/// Pretty JSON with a newline at its end.
///
/// # Errors
/// If the value cannot be written as JSON.
pub fn to_text(value: &impl serde::Serialize) -> anyhow::Result<String> {
    Ok(serde_json::to_string_pretty(value)? + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Rates {
        schema: u32,
        rates: Vec<f32>,
    }

    /// All of a file was held as a tree of values, many times its size, to look at its version.
    #[test]
    fn the_version_of_a_file_is_read_before_the_rest() {
        let folder = std::env::temp_dir().join(format!("evaluation-test-{}-json", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("rates.json");
        let read = |text: &str| {
            sums::write(&folder, "rates.json", text.as_bytes()).unwrap();
            read_versioned::<Rates>(&path, 2).map_err(|error| format!("{error:#}"))
        };
        assert_eq!(read(r#"{"schema": 2, "rates": [0.1]}"#), Ok(Some(Rates { schema: 2, rates: vec![0.1] })));
        for (text, expected) in [
            (r#"{"schema": 1, "of": {"old": [1]}}"#, "(schema 1, this one reads 2)"),
            (r#"{"rates": []}"#, "(schema 0, this one reads 2)"),
            (r#"{"schema": 2, "rates": [], "more": 1}"#, "unknown field `more`"),
            ("{", "rates.json"),
        ] {
            let refused = read(text).unwrap_err();
            assert!(refused.contains(expected), "{text}: {refused}");
        }
        std::fs::remove_dir_all(folder).unwrap();
    }
}
