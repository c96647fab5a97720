//! The folder that pictures are written into.

use crate::output::Output;
use anyhow::{Context as _, ensure};
use experiment::run_dir;
use report::pictures::drawing::Drawing;
use report::pictures::file_name;
use std::path::{Path, PathBuf};

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
        run_dir::ensure_outside_of_runs(path).context("--out")?;
        ensure!(
            self.overwrite || !(path.exists() || path.is_symlink()),
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
