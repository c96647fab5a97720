//! What a run says of itself in its folder: what made it, from which inputs, and its outcome.

use crate::settings::Settings;
use anyhow::{Context as _, anyhow, ensure};
use policy::dagger::Stop;
use serde::{Deserialize, Serialize};
use sim::limits::RUN_TOML_BYTES_MAX;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use storage::sums;

/// The file of a [`Manifest`].
pub(crate) const MANIFEST: &str = "manifest.toml";
/// The file of all settings of a run.
pub(crate) const SETTINGS: &str = "settings.toml";
/// The file of [`Finished`].
pub(crate) const FINISHED: &str = "finished.toml";

/// SHA-256 of what is read from elsewhere by name, as on the command line: see [`inputs`](crate::inputs).
pub type Inputs = BTreeMap<String, String>;

/// What a run was asked for besides its settings, and what it reads from elsewhere.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Request {
    /// Arguments of the command.
    pub arguments: toml::Table,
    /// Lots, parameters and networks from files.
    pub inputs: Inputs,
    /// Every file and folder that is read: no run may take their place.
    pub reads: Vec<PathBuf>,
}

/// What made a run: `manifest.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of this format: [`MANIFEST_SCHEMA`].
    pub schema: u32,
    /// The name and version of the program.
    pub program: String,
    /// The command that made it, the only one that can continue it.
    pub command: String,
    /// The command line, without the name of the program.
    pub command_line: Vec<String>,
    /// What the settings started from.
    pub preset: String,
    /// Root seed of the training.
    pub root_seed: u64,
    /// Root seed of the trials of the evaluation.
    pub evaluation_seed: u64,
    /// Revision of the repository that the program was built from, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub git_revision: Option<String>,
    /// Whether sources of the program differed from that revision when it was built.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub git_dirty: Option<bool>,
    /// Git's hash of how they differed, where they did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub git_changes: Option<String>,
    /// The compiler that built the program.
    pub rustc_version: String,
    /// Threads it computed with; results do not depend on it.
    pub threads: usize,
    /// Architecture and operating system.
    pub target: String,
    /// The processor, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub processor: Option<String>,
    /// Its instructions that sums of networks may depend on: `avx2`, `fma`, …
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub processor_features: Vec<String>,
    /// The libraries that compute, with their versions: `libm 0.2.16`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub libraries: Vec<String>,
    /// What was asked for besides the settings.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub arguments: toml::Table,
    /// SHA-256 of what was read from elsewhere.
    #[serde(default, skip_serializing_if = "Inputs::is_empty")]
    pub inputs: Inputs,
}

/// The version of `manifest.toml` that this program writes.
pub const MANIFEST_SCHEMA: u32 = 3;

/// The outcome of a run, written last: `finished.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Finished {
    /// Version of this format: [`FINISHED_SCHEMA`].
    pub schema: u32,
    /// What was done.
    pub outcome: Outcome,
}

/// The version of `finished.toml` that this program writes.
pub const FINISHED_SCHEMA: u32 = 1;

/// What was done in a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
pub enum Outcome {
    /// Behaviour cloning, or DAgger.
    Training {
        /// Why it ended.
        stop: Stop,
        /// Rounds, behaviour cloning included.
        rounds: usize,
    },
    /// Drivers were driven.
    Evaluation {
        /// Who, as named on the command line.
        drivers: Vec<String>,
    },
    /// Parameters of planners were searched.
    Tuning {
        /// Which.
        planners: Vec<String>,
    },
    /// The paper was reproduced.
    Reproduction {
        /// Stages that were done.
        stages: usize,
    },
}

/// The program that makes a run, as its manifest describes it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Build {
    /// Name and version.
    pub program: String,
    /// The command line, without the name of the program.
    pub command_line: Vec<String>,
    /// Revision of the repository that it was built from, if known.
    pub git_revision: Option<String>,
    /// Whether its sources differed from that revision.
    pub git_dirty: Option<bool>,
    /// Git's hash of how they differ, where they do.
    pub git_changes: Option<String>,
    /// The compiler.
    pub rustc_version: String,
    /// The processor that it runs on, if known.
    pub processor: Option<String>,
    /// Its instructions that sums of networks may depend on.
    pub processor_features: Vec<String>,
    /// The libraries that compute, with their versions.
    pub libraries: Vec<String>,
}

/// The instructions that products and sums of networks are computed with here, where there is a choice.
pub fn processor_features() -> Vec<String> {
    #[cfg(target_arch = "x86_64")]
    let features = [
        ("avx2", std::arch::is_x86_feature_detected!("avx2")),
        ("fma", std::arch::is_x86_feature_detected!("fma")),
        ("avx512f", std::arch::is_x86_feature_detected!("avx512f")),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let features: [(&str, bool); 0] = [];
    features.into_iter().filter(|(_, has)| *has).map(|(name, _)| name.to_owned()).collect()
}

/// Whether products of networks are added without being rounded before.
fn rounds_once(processor_features: &[String]) -> bool {
    ["avx2", "fma"].iter().all(|&name| processor_features.iter().any(|it| it == name))
}

/// Architecture and operating system.
fn target() -> String {
    format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS)
}

impl Manifest {
    /// That of a run which begins.
    pub(crate) fn new(build: &Build, [command, preset]: [&str; 2], settings: &Settings, request: &Request) -> Self {
        Self {
            schema: MANIFEST_SCHEMA,
            program: build.program.clone(),
            command: command.to_owned(),
            command_line: build.command_line.clone(),
            preset: preset.to_owned(),
            root_seed: settings.seed.0,
            evaluation_seed: settings.evaluation.seed.0,
            git_revision: build.git_revision.clone(),
            git_dirty: build.git_dirty,
            git_changes: build.git_changes.clone(),
            rustc_version: build.rustc_version.clone(),
            threads: rayon::current_num_threads(),
            target: target(),
            processor: build.processor.clone(),
            processor_features: build.processor_features.clone(),
            libraries: build.libraries.clone(),
            arguments: request.arguments.clone(),
            inputs: request.inputs.clone(),
        }
    }

    /// Whether what is read from elsewhere is what the run was begun with.
    ///
    /// # Errors
    /// Naming what differs.
    pub fn check_inputs(&self, found: &Inputs) -> anyhow::Result<()> {
        for (name, digest) in &self.inputs {
            if found.get(name) != Some(digest) {
                return Err(has_changed(name));
            }
        }
        ensure!(found.len() == self.inputs.len(), "this run was begun with other lots or drivers; begin again");
        Ok(())
    }

    /// Whether some of what is read from elsewhere is what the run was begun with, as far as it says.
    ///
    /// # Errors
    /// Naming what differs.
    pub fn check_some_inputs(&self, found: &Inputs) -> anyhow::Result<()> {
        let differs =
            |(name, digest): &(&String, &String)| self.inputs.get(*name).is_some_and(|known| known != *digest);
        found.iter().find(differs).map_or(Ok(()), |(name, _)| Err(has_changed(name)))
    }

    /// Whether the run was made on this architecture and system.
    pub fn is_of_this_target(&self) -> bool {
        self.target == target()
    }

    /// Whether the same program made another run: by name, version, revision and changes to it.
    pub fn is_of_version_of(&self, other: &Self) -> bool {
        // Of changes without a hash, as earlier versions noted them, nobody knows whether they are the same.
        let is_known = self.git_dirty != Some(true) || self.git_changes.is_some();
        is_known && self.version() == other.version()
    }

    /// Whether networks compute the same bits where this run and another were made: their products round once with AVX2 and
    /// FMA, and twice without.
    pub fn rounds_like(&self, other: &Self) -> bool {
        rounds_once(&self.processor_features) == rounds_once(&other.processor_features)
    }

    /// [`rounds_like`](Self::rounds_like), here and now.
    pub fn rounds_like_here(&self, build: &Build) -> bool {
        rounds_once(&self.processor_features) == rounds_once(&build.processor_features)
    }

    /// Whether a program made this run: by name, version, revision and changes to it.
    pub fn is_of(&self, build: &Build) -> bool {
        self.version() == (&build.program, &build.git_revision, build.git_dirty, &build.git_changes)
    }

    /// What tells programs apart.
    pub(crate) fn version(&self) -> (&String, &Option<String>, Option<bool>, &Option<String>) {
        (&self.program, &self.git_revision, self.git_dirty, &self.git_changes)
    }

    /// Whether a folder holds a manifest, of whatever version: the folder is a run then, and not something else with files
    /// of the same names.
    pub(crate) fn is_in(folder: &Path) -> bool {
        let text = storage::read::text(&folder.join(MANIFEST), RUN_TOML_BYTES_MAX).unwrap_or_default();
        let table: toml::Table = text.parse().unwrap_or_default();
        ["schema", "program", "command", "preset", "root_seed"].iter().all(|key| table.contains_key(*key))
    }

    /// Reads the manifest of a run.
    ///
    /// # Errors
    /// If it is missing, damaged or of another version.
    pub fn read(run: &Path) -> anyhow::Result<Self> {
        let path = run.join(MANIFEST);
        let text = sums::read_to_string(&path, RUN_TOML_BYTES_MAX)?;
        let table: toml::Table = text.parse().with_context(|| path.display().to_string())?;
        let schema = table.get("schema").and_then(toml::Value::as_integer).unwrap_or(0);
        ensure!(
            schema == i64::from(MANIFEST_SCHEMA),
            "{}: written by another version of lotpilot (schema {schema}, this one reads {MANIFEST_SCHEMA}); make the \
             run again, or use the revision it names",
            path.display()
        );
        table.try_into().with_context(|| path.display().to_string())
    }
}

/// The outcome of a run; `None` if it is not finished.
///
/// # Errors
/// If the file is missing, damaged or of another version.
pub fn finished(path: &Path) -> anyhow::Result<Option<Finished>> {
    let file = path.join(FINISHED);
    let Some(text) = sums::read_if_listed(&file, RUN_TOML_BYTES_MAX)? else { return Ok(None) };
    let text = String::from_utf8(text).with_context(|| file.display().to_string())?;
    let finished: Finished = toml::from_str(&text).with_context(|| file.display().to_string())?;
    ensure!(
        finished.schema == FINISHED_SCHEMA,
        "{}: written by another version of lotpilot (schema {}, this one reads {FINISHED_SCHEMA})",
        file.display(),
        finished.schema
    );
    Ok(Some(finished))
}

/// Whether a run is finished.
///
/// # Errors
/// See [`finished`].
pub fn is_finished(path: &Path) -> anyhow::Result<bool> {
    Ok(finished(path)?.is_some())
}

/// Whether a file of a run is to be read: the run lists it, or should. All that a finished run wrote is listed; what is there
/// and is not, whoever reads it refuses by name.
///
/// # Errors
/// If the list cannot be read; see [`finished`].
pub fn has_file(run: &Path, name: &str) -> anyhow::Result<bool> {
    Ok(sums::is_listed(run, name)? || run.join(name).exists() && is_finished(run)?)
}

/// What is said of an input that is not what a run was begun with.
pub(crate) fn has_changed(name: &str) -> anyhow::Error {
    anyhow!("{name}: changed since this run was begun; restore it, or begin again into another folder")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_runs::message;

    fn manifest(build: &Build, inputs: &[(&str, &str)]) -> Manifest {
        let request = Request { inputs: of(inputs), ..Request::default() };
        Manifest::new(build, ["evaluate", "smoke"], &Settings::preset("smoke").unwrap(), &request)
    }

    fn of(inputs: &[(&str, &str)]) -> Inputs {
        inputs.iter().map(|&(name, digest)| (name.to_owned(), digest.to_owned())).collect()
    }

    #[test]
    fn runs_of_changes_that_nobody_knows_are_of_no_version() {
        let built = |git_dirty: Option<bool>, git_changes: Option<&str>| {
            let git_revision = Some("0123".to_owned());
            let git_changes = git_changes.map(str::to_owned);
            manifest(&Build { git_revision, git_dirty, git_changes, ..Build::default() }, &[])
        };
        let kinds = [
            built(None, None),
            built(Some(false), None),
            built(Some(true), Some("ab")),
            built(Some(true), Some("cd")),
            // As earlier versions noted them.
            built(Some(true), None),
        ];
        for (at, one) in kinds.iter().enumerate() {
            for (of_other, other) in kinds.iter().enumerate() {
                assert_eq!(one.is_of_version_of(other), at == of_other && at < 4, "{at} and {of_other}");
            }
        }
        let another = Manifest { git_revision: Some("4567".to_owned()), ..kinds[1].clone() };
        assert!(!another.is_of_version_of(&kinds[1]));
    }

    #[test]
    fn inputs_of_a_run_are_those_that_it_was_begun_with_and_no_others() {
        let run = manifest(&Build::default(), &[("a.toml", "1"), ("b.toml", "2")]);
        run.check_inputs(&of(&[("b.toml", "2"), ("a.toml", "1")])).unwrap();
        for (found, part) in [
            (&[("a.toml", "1"), ("b.toml", "3")][..], "b.toml: changed"),
            (&[("a.toml", "1")], "b.toml: changed"),
            (&[("a.toml", "1"), ("b.toml", "2"), ("c.toml", "3")], "other lots or drivers"),
        ] {
            let refused = message(run.check_inputs(&of(found)));
            assert!(refused.contains(part), "{found:?}: {refused}");
        }
        // Of what it was not begun with it says nothing.
        run.check_some_inputs(&of(&[("b.toml", "2"), ("c.toml", "3")])).unwrap();
        assert!(message(run.check_some_inputs(&of(&[("b.toml", "3")]))).contains("b.toml: changed"));
    }

    #[test]
    fn products_round_once_with_both_instructions_and_twice_without_either() {
        let with = |features: &[&str]| {
            let processor_features = features.iter().map(|&name| name.to_owned()).collect();
            manifest(&Build { processor_features, ..Build::default() }, &[])
        };
        assert!(with(&["avx2", "fma"]).rounds_like(&with(&["fma", "avx2", "avx512f"])));
        assert!(with(&["avx2"]).rounds_like(&with(&[])) && with(&["fma"]).rounds_like(&with(&["avx2"])));
        assert!(!with(&["avx2", "fma"]).rounds_like(&with(&["avx2"])));
        assert!(!with(&["fma"]).rounds_like(&with(&["avx2", "fma"])));
    }
}
