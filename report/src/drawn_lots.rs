//! Drawn lots and their pictures as files, and what they must not replace.

use crate::pictures::{file_name, lot};
use anyhow::{Context as _, bail, ensure};
use experiment::lots::Lot;
use experiment::run_dir;
use experiment::trials::Trial;
use sim::map::Map;
use sim::vehicle::VehicleSettings;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Where lots are written to, one TOML and one PNG file each.
#[derive(Debug, Clone, Copy)]
pub struct DrawnLots<'a> {
    /// The folder.
    pub out: &'a Path,
    /// Seed of their obstacles.
    pub seed: u64,
    /// Drawings of each lot.
    pub count: u32,
    /// Whether files of the same name are replaced.
    pub overwrite: bool,
}

/// A lot of a trial, under the name of its files.
#[derive(Debug)]
pub struct DrawnLot {
    /// Without an extension.
    pub name: String,
    /// What its TOML file says.
    pub toml: String,
    /// The same, to be driven on.
    pub map: Map,
    /// Draws the generator needed, this one included; `None` if it was not generated.
    pub attempts: Option<u32>,
}

impl DrawnLots<'_> {
    /// Name of the files of a lot, without an extension.
    fn name(&self, trial: &Trial<'_>) -> String {
        let name = match (trial.lot.is_drawn_per_trial(), self.count) {
            (false, _) => trial.lot.name().to_owned(),
            (true, 1) => format!("{}-s{}", trial.lot.name(), self.seed),
            (true, _) => format!("{}-s{}-{}", trial.lot.name(), self.seed, trial.index + 1),
        };
        file_name(&name)
    }

    /// The TOML and the PNG file of a name.
    fn files(&self, name: &str) -> [PathBuf; 2] {
        ["toml", "png"].map(|extension| self.out.join(format!("{name}.{extension}")))
    }

    /// Draws the lot of a trial.
    ///
    /// # Errors
    /// If the car cannot drive there.
    pub fn draw(&self, trial: &Trial<'_>, vehicle: &VehicleSettings) -> anyhow::Result<DrawnLot> {
        let name = self.name(trial);
        let mut drawn = trial.lot.draw(trial.seed);
        // The file is a lot of its own, told apart from its siblings in tables.
        drawn.scenario.name.clone_from(&name);
        let toml = drawn.to_toml();
        let map = Map::build(drawn.scenario, vehicle).with_context(|| name.clone())?;
        Ok(DrawnLot { name, toml, map, attempts: drawn.attempts })
    }

    /// Writes the two files of a lot, and returns the TOML file. `px_per_m`: of the picture, by default as fits 1600 pixels.
    ///
    /// # Errors
    /// If the picture would be too large, or the folder or a file cannot be written.
    pub fn write(&self, drawn: &DrawnLot, vehicle: &VehicleSettings, px_per_m: Option<f32>) -> anyhow::Result<PathBuf> {
        let [toml, png] = self.files(&drawn.name);
        let picture = lot::top_view(&drawn.map, vehicle, px_per_m)?.to_png()?;
        // A picture that is refused leaves no folder behind.
        std::fs::create_dir_all(self.out)
            .with_context(|| format!("{}: cannot be created; choose another --out", self.out.display()))?;
        storage::whole::write(&png, &picture)?;
        storage::whole::write(&toml, drawn.toml.as_bytes())?;
        Ok(toml)
    }

    /// Refuses lots whose files are there, would be those of another one or what a lot is made of, or would lie within a
    /// run: before the first is written.
    ///
    /// # Errors
    /// Naming the first such file, or the run.
    pub fn ensure_free(&self, lots: &[Lot], trials: &[Trial<'_>]) -> anyhow::Result<()> {
        // Whatever their names: also in the run's own folder, not only below it.
        run_dir::ensure_outside_of_runs(&self.out.join("lot.toml"))?;
        let made_of = made_of(lots)?;
        ensure_files_differ(trials.iter().map(|trial| (self.name(trial), trial.lot.name())), "toml")?;
        for trial in trials {
            let files = self.files(&self.name(trial));
            ensure_apart_from(&made_of, &files)?;
            // What no seed draws anew has none in its name.
            let other = if trial.lot.is_drawn_per_trial() { "--out or --seed" } else { "--out" };
            for path in files {
                ensure!(
                    self.overwrite || !(path.exists() || path.is_symlink()),
                    "{}: exists already; choose another {other}, or replace it with --overwrite",
                    path.display()
                );
            }
        }
        Ok(())
    }
}

/// Where the files lie that lots are made of.
///
/// # Errors
/// If a path leads nowhere.
pub fn made_of(lots: &[Lot]) -> anyhow::Result<BTreeSet<PathBuf>> {
    let files = lots.iter().flat_map(Lot::files);
    files.map(|file| storage::place_of(file).with_context(|| file.display().to_string())).collect()
}

/// Refuses to write over one of these, however it is named.
///
/// # Errors
/// Naming the file.
pub fn ensure_apart_from(places: &BTreeSet<PathBuf>, files: &[PathBuf]) -> anyhow::Result<()> {
    // Of generated lots nothing is looked up, of which there may be a million.
    for file in files.iter().filter(|_| !places.is_empty()) {
        ensure!(
            !places.contains(&storage::place_of(file).with_context(|| file.display().to_string())?),
            "{}: what the lot is made of lies there under that name; write into another folder",
            file.display()
        );
    }
    Ok(())
}

/// Refuses lots of which two would be one file: each with the name of its file, without the extension that all share.
///
/// # Errors
/// Naming both lots and the file.
pub fn ensure_files_differ<'a>(
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
