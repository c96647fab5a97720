//! What a command left in its folder.

use anyhow::Context as _;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use storage::{lock, sums};

/// Every file of a folder by its path there, except for the lock. Wall times, and the digests that depend on them,
/// differ from one repetition to the next and are left out.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Content {
    files: BTreeMap<String, Vec<u8>>,
}

const WALL_TIME: &str = "wall_time.jsonl";

impl Content {
    pub(crate) fn read(folder: &Path) -> anyhow::Result<Self> {
        let mut content = Self::default();
        content.add(folder, "")?;
        Ok(content)
    }

    fn add(&mut self, folder: &Path, prefix: &str) -> anyhow::Result<()> {
        for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
            let entry = entry?;
            let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
            let within = format!("{prefix}{name}");
            if entry.file_type()?.is_dir() {
                self.add(&path, &format!("{within}/"))?;
            } else if name != lock::FILE {
                let bytes = fs::read(&path).with_context(|| path.display().to_string())?;
                let bytes = match &*name {
                    WALL_TIME => Vec::new(),
                    sums::FILE => without_digests_of_wall_times(&bytes),
                    _ => bytes,
                };
                self.files.insert(within, bytes);
            }
        }
        Ok(())
    }

    pub(crate) fn files(&self) -> usize {
        self.files.len()
    }

    pub(crate) fn bytes(&self) -> usize {
        self.files.values().map(Vec::len).sum()
    }

    /// The first thing in which this differs from what is right.
    pub(crate) fn difference(&self, right: &Self) -> Option<String> {
        let missing = right.files.keys().find(|name| !self.files.contains_key(*name));
        let more = self.files.keys().find(|name| !right.files.contains_key(*name));
        let differs =
            self.files.iter().find(|(name, bytes)| right.files.get(*name).is_some_and(|whole| whole != *bytes));
        let missing = missing.map(|name| format!("{name} is missing"));
        missing
            .or_else(|| more.map(|name| format!("{name} is left over")))
            .or_else(|| differs.map(|(name, _)| format!("{name} differs")))
    }
}

/// A list with the names of wall times and of lists, which may name wall times, but not their digests.
fn without_digests_of_wall_times(list: &[u8]) -> Vec<u8> {
    let lines = list.split_inclusive(|byte| *byte == b'\n').map(|line| {
        let line = String::from_utf8_lossy(line);
        let is_free = [WALL_TIME, sums::FILE].iter().any(|name| line.trim_end().ends_with(name));
        line.split_once("  ").filter(|_| is_free).map_or_else(|| line.to_string(), |(_, name)| name.to_owned())
    });
    lines.collect::<String>().into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn content(files: &[(&str, &str)]) -> Content {
        Content { files: files.iter().map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec())).collect() }
    }

    #[test]
    fn every_difference_is_noticed_but_wall_times() {
        let right = content(&[("a", "1"), ("b", "2")]);
        for (files, expected) in [
            (&[("a", "1"), ("b", "2")][..], None),
            (&[("a", "1")], Some("b is missing")),
            (&[("a", "1"), ("b", "2"), ("c.lotpilot-partial", "")], Some("c.lotpilot-partial is left over")),
            (&[("a", "1"), ("b", "3")], Some("b differs")),
        ] {
            assert_eq!(content(files).difference(&right).as_deref(), expected);
        }
        let list = b"00  runs.jsonl\n11  wall_time.jsonl\n22  drives/sha256sums\n";
        assert_eq!(without_digests_of_wall_times(list), b"00  runs.jsonl\nwall_time.jsonl\ndrives/sha256sums\n");
    }
}
