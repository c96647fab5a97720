//! The table of another run in a page, or on a page of its own: of one that trained several times, of an evaluation or of a
//! training.

use crate::docs_page::{self, MadeBy};
use crate::page::{Image, Page};
use crate::trainings_table::TrainingsTable;
use crate::{deviations, rules, scaling};
use anyhow::{bail, ensure};
use evaluation::{shards, stage};
use experiment::command_line::command_line;
use experiment::manifest::{self, Manifest};
use experiment::trained;
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::convert::Infallible;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use storage::sums;

/// A run, and what stands above its table: `DIR` or `TITLE=DIR`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OtherRun {
    title: Option<String>,
    folder: PathBuf,
}

impl FromStr for OtherRun {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        // Folders may be called after what was set: `runs/dead_time_s=0.5`.
        Ok(match text.split_once('=').filter(|_| !Path::new(text).is_dir()) {
            Some((title, folder)) => Self { title: Some(title.to_owned()), folder: folder.into() },
            None => Self { title: None, folder: text.into() },
        })
    }
}

impl From<PathBuf> for OtherRun {
    fn from(folder: PathBuf) -> Self {
        Self { title: None, folder }
    }
}

impl fmt::Display for OtherRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.title.iter().try_for_each(|title| write!(f, "{title}="))?;
        write!(f, "{}", self.folder.display())
    }
}

impl OtherRun {
    /// Adds its table as a section.
    pub(crate) fn add_to(&self, page: &mut Page) -> anyhow::Result<()> {
        let Found { manifest, title, table, plot } = self.read()?;
        let revision = manifest.git_revision.as_deref().unwrap_or("unknown");
        let changes = if manifest.git_dirty == Some(true) { ", with changes that are not committed" } else { "" };
        let made_by = format!("Made by `{}` at commit `{revision}`{changes}.", command_line(&manifest));
        page.section(title, format!("{made_by}\n\n{table}"));
        add_plot(page, &manifest.command, plot);
        Ok(())
    }

    /// Its table as a page of the documentation, with what made it in its head and the tables of other runs at its end.
    ///
    /// # Errors
    /// If it, or one of the others, is not finished or has no table, or what it wrote cannot be read.
    pub fn docs_page(&self, others: &[Self], made_by: MadeBy<'_>) -> anyhow::Result<Page> {
        let Found { manifest, title, table, plot } = self.read()?;
        let named: Vec<String> = others.iter().map(Self::to_string).collect();
        let mut page = Page::new(title);
        let seed = [("root seed", manifest.root_seed.to_string())];
        page.text(docs_page::head(&self.to_string(), &named, &manifest, made_by, &seed));
        page.text(table);
        add_plot(&mut page, &manifest.command, plot);
        others.iter().try_for_each(|other| other.add_to(&mut page))?;
        Ok(page)
    }

    fn read(&self) -> anyhow::Result<Found> {
        let folder = &self.folder;
        let name = folder.display();
        ensure!(folder.is_dir() && manifest::is_finished(folder)?, "{name}: this is not a finished run");
        ensure!(!shards::is_shard(folder)?, "{name}: this is a shard, which has no table; put all together with merge");
        let manifest = Manifest::read(folder)?;
        let (title, table, plot) = match manifest.command.as_str() {
            command @ ("deviations" | "rules" | "scaling") => {
                // Judged anew, as the page says, by what was driven.
                let (title, TrainingsTable { text, svg, .. }) = judged(command, &manifest, folder)?;
                (title, text, Some(svg))
            }
            "evaluate" => ("An evaluation", self.text("summary.md")?, None),
            "train-bc" | "train-dagger" => ("A training", self.text("table1.md")?, None),
            other => bail!(
                "{name}: a run of {other} has no table of its own; name runs of deviations, rules, scaling, \
                            evaluate, train-bc or train-dagger"
            ),
        };
        Ok(Found { title: self.title.clone().unwrap_or_else(|| title.to_owned()), table, plot, manifest })
    }

    fn text(&self, file: &str) -> anyhow::Result<String> {
        Ok(sums::read_to_string(&self.folder.join(file), RUN_TEXT_BYTES_MAX)?)
    }
}

/// The table of a run that trained several times, and what stands above it.
fn judged(command: &str, manifest: &Manifest, root: &Path) -> anyhow::Result<(&'static str, TrainingsTable)> {
    let settings = trained::settings_of(root)?;
    let arguments = manifest.arguments.clone();
    Ok(match command {
        "deviations" => {
            let stages = evaluation::deviations::stages(&settings, &arguments.try_into()?, root)?;
            stage::ensure_of_run(&stages, root)?;
            (deviations::TITLE, deviations::table(&stages, root)?)
        }
        "rules" => {
            let extent = arguments.try_into()?;
            let stages = evaluation::rules::stages(&settings, &extent, root);
            stage::ensure_of_run(&stages, root)?;
            (rules::TITLE, rules::table(&settings, &extent, &stages, root)?)
        }
        _ => {
            let extent = arguments.try_into()?;
            let stages = evaluation::scaling::stages(&settings, &extent, root);
            stage::ensure_of_run(&stages, root)?;
            (scaling::TITLE, scaling::table(&settings, &extent, &stages, root)?)
        }
    })
}

/// What a run left that a page shows.
struct Found {
    manifest: Manifest,
    title: String,
    /// As Markdown.
    table: String,
    /// As SVG.
    plot: Option<String>,
}

fn add_plot(page: &mut Page, command: &str, plot: Option<String>) {
    let Some(svg) = plot else { return };
    let mut stems = (1..).map(|n| if n == 1 { command.to_owned() } else { format!("{command}-{n}") });
    let stem = stems.find(|stem| !page.has_figure(stem)).expect("numbers do not end");
    page.figure(stem, "The same as a plot.", Image::Svg(svg));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_is_named_by_its_folder_with_or_without_a_title() {
        let of = |text: &str| text.parse::<OtherRun>().unwrap();
        assert_eq!(of("runs/rules"), OtherRun { title: None, folder: "runs/rules".into() });
        let titled = OtherRun { title: Some("The paper's regime".to_owned()), folder: "runs/paper".into() };
        assert_eq!(of("The paper's regime=runs/paper"), titled);
        assert_eq!(titled.to_string(), "The paper's regime=runs/paper");
        // It was taken for the title of a folder `0.5`.
        let folder = std::env::temp_dir().join(format!("report-test-{}-dead_time_s=0.5", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        assert_eq!(of(folder.to_str().unwrap()), OtherRun { title: None, folder: folder.clone() });
        std::fs::remove_dir_all(folder).unwrap();
        let error = of("no/such/run").add_to(&mut Page::new("Results")).unwrap_err().to_string();
        assert!(error.contains("no/such/run: this is not a finished run"), "{error}");
    }
}
