//! The folder that pictures are written into.

use crate::output::Output;
use anyhow::{Context as _, bail, ensure};
use experiment::lots::Lot;
use report::pictures::drawing::Drawing;
use report::pictures::file_name;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Where the files lie that lots are made of.
pub(crate) fn made_of(lots: &[Lot]) -> anyhow::Result<BTreeSet<PathBuf>> {
    let files = lots.iter().flat_map(Lot::files);
    files.map(|file| storage::place_of(file).with_context(|| file.display().to_string())).collect()
}

/// Refuses to write over one of these, however it is named.
pub(crate) fn ensure_apart_from(places: &BTreeSet<PathBuf>, files: &[PathBuf]) -> anyhow::Result<()> {
    // Of generated lots nothing is looked up, of which there may be a million.
    for file in files.iter().filter(|_| !places.is_empty()) {
        ensure!(
            !places.contains(&storage::place_of(file).with_context(|| file.display().to_string())?),
            "{}: what the lot is made of lies there under that name; choose another --out",
            file.display()
        );
    }
    Ok(())
}

/// Refuses lots of which two would be one file: each with the name of its file, without the extension that all share.
pub(crate) fn ensure_files_differ<'a>(
    files: impl IntoIterator<Item = (String, &'a str)>,
    extension: &str,
) -> anyhow::Result<()> {
    let mut taken = BTreeMap::new();
    for (file, lot) in files {
        // Some file systems take no notice of capitals.
        if let Some(other) = taken.insert(file.to_lowercase(), lot) {
            bail!("lots {other:?} and {lot:?} would both be {file}.{extension}; write them into two folders");
        }
    }
    Ok(())
}

/// Where pictures go.
pub(crate) struct Folder<'a> {
    /// The folder.
    pub(crate) path: &'a Path,
    /// Whether files of the same name are replaced.
    pub(crate) overwrite: bool,
    /// What is said goes here.
    pub(crate) output: &'a Output,
}

impl Folder<'_> {
    /// Writes a picture as PNG, and as SVG where it is made of lines.
    pub(crate) fn write(&self, name: &str, drawing: &Drawing, is_vector: bool) -> anyhow::Result<()> {
        self.check(name, is_vector)?;
        let mut contents = vec![drawing.to_png()?];
        if is_vector {
            contents.push(drawing.to_svg().into_bytes());
        }
        self.files(name, is_vector).iter().zip(contents).try_for_each(|(path, content)| self.put(path, &content))
    }

    pub(crate) fn files(&self, name: &str, is_vector: bool) -> Vec<PathBuf> {
        let extensions: &[&str] = if is_vector { &["png", "svg"] } else { &["png"] };
        extensions.iter().map(|extension| self.path.join(format!("{}.{extension}", file_name(name)))).collect()
    }

    /// Refuses to replace files unasked: before anything is driven or drawn.
    pub(crate) fn check(&self, name: &str, is_vector: bool) -> anyhow::Result<()> {
        self.files(name, is_vector).iter().try_for_each(|path| self.check_file(path))
    }

    pub(crate) fn check_file(&self, path: &Path) -> anyhow::Result<()> {
        ensure!(
            self.overwrite || !path.exists(),
            "{}: exists already; choose another --out, or replace it with --overwrite",
            path.display()
        );
        Ok(())
    }

    /// The file of a picture. Asked before work begins that would be lost if it could not be written.
    ///
    /// # Errors
    /// If it is there already.
    pub(crate) fn file(&self, name: &str, extension: &str) -> anyhow::Result<PathBuf> {
        let path = self.path.join(format!("{}.{extension}", file_name(name)));
        self.check_file(&path)?;
        Ok(path)
    }

    /// Writes a file and says so.
    pub(crate) fn put(&self, path: &Path, content: &[u8]) -> anyhow::Result<()> {
        std::fs::create_dir_all(self.path)
            .with_context(|| format!("{}: cannot be created; choose another --out", self.path.display()))?;
        storage::whole::write(path, content)?;
        self.output.print(format_args!("{}: {} kB", path.display(), content.len().div_ceil(1000)));
        Ok(())
    }
}
