//! The networks that runs have trained, as `run:DIR` and `run:DIR/bc` name them.

use crate::command_line::quoted_path;
use crate::manifest::{Finished, Inputs, MANIFEST, Manifest, Outcome, SETTINGS, finished};
use crate::settings::Settings;
use anyhow::{Context as _, bail, ensure};
use policy::checkpoint::Checkpoint;
use serde::Deserialize as _;
use sim::limits::RUN_TOML_BYTES_MAX;
use sim::seed::RootSeed;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use storage::sums;

/// A training that may have been done several times, with other seeds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Training {
    /// What all of them have in common: SHA-256 of the program's version, the settings but seed and evaluation, the lots from
    /// files, and which policy of the run it is.
    pub recipe: String,
    /// Its root seed.
    pub seed: RootSeed,
}

/// Lots that networks were trained on, or that parameters of a planner were tuned on: no driver is new to them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TrainedOn {
    /// As in the settings of their trainings, or in the file of the parameters.
    pub lots: BTreeSet<String>,
    /// SHA-256 of those from files: they are known by it wherever they lie now.
    pub digests: BTreeSet<String>,
}

impl TrainedOn {
    /// Adds those of other networks.
    pub fn extend(&mut self, other: Self) {
        self.lots.extend(other.lots);
        self.digests.extend(other.digests);
    }
}

/// The folder with the checkpoint that `run:DIR` or `run:DIR/bc` names.
///
/// # Errors
/// If there is no run, no network in it yet, or one of its rounds is missing or incomplete.
pub fn policy_folder(spec: &Path) -> anyhow::Result<PathBuf> {
    let (run, is_bc) = run_of(spec)?;
    let names = sums::names(run)?;
    let folders = names.iter().filter_map(|name| name.strip_suffix(&format!("/{}", sums::FILE)));
    // Not `round-01-critic`: what is trained beside the network of a round.
    let round_of = |folder: &str| folder.strip_prefix("round-")?.parse::<u32>().ok();
    let mut folders: Vec<&str> = folders.filter(|folder| *folder == "final" || round_of(folder).is_some()).collect();
    let rounds = folders.iter().filter(|folder| **folder != "final").count();
    if let Some(Finished { outcome: Outcome::Training { rounds: expected, .. }, .. }) = finished(run)? {
        ensure!(
            rounds == expected,
            "{}: {rounds} rounds are listed of {expected} that were finished; restore sha256sums from a copy, or train \
             again into another folder",
            run.display()
        );
        // With that line lost from the list, the network of the last round would drive in its place.
        let has_final = settings_of(spec).is_ok_and(|settings| settings.dagger.final_fit().is_some());
        ensure!(
            !has_final || folders.contains(&"final"),
            "{}: does not list final/{}, the network of the final training; restore the file, or train again",
            run.join(sums::FILE).display(),
            sums::FILE
        );
    }
    folders.sort_by_key(|folder| (*folder == "final", round_of(folder)));
    let folder = if is_bc { folders.first() } else { folders.last() };
    let folder = folder.with_context(|| {
        let command = Manifest::read(run).map(|manifest| manifest.command);
        match command {
            _ if Checkpoint::exists(run).is_ok_and(|exists| exists) => {
                format!("{}: this is the folder of one network; name it as net:{0}", run.display())
            }
            Ok(command) if command.starts_with("train-") => {
                format!(
                    "{}: no network is trained there yet; finish it with --resume {}",
                    run.display(),
                    quoted_path(run)
                )
            }
            Ok(command) => format!(
                "{}: this is a run of {command}, which has no network of its own; name a training",
                run.display()
            ),
            Err(_) => {
                format!("{}: this folder holds no finished network; name a training or a round of it", run.display())
            }
        }
    })?;
    sums::read_listed(run, &format!("{folder}/{}", sums::FILE), sums::LIST_BYTES_MAX)?;
    Ok(run.join(folder))
}

/// Refuses the policy of a training that was interrupted: it would be taken for what the whole training makes. Behaviour
/// cloning, `DIR/bc`, is whole as soon as it is there.
///
/// # Errors
/// If it is not finished, or there is no run.
pub fn ensure_whole(spec: &Path) -> anyhow::Result<()> {
    let (run, is_bc) = run_of(spec)?;
    if is_bc || finished(run)?.is_some() {
        return Ok(());
    }
    let round = policy_folder(spec)?;
    bail!(
        "{}: this training is not finished; continue it with --resume {}, or take the network that it has now, {} \
         (as a driver: net:{2})",
        run.display(),
        quoted_path(run),
        round.display()
    )
}

/// The folders with the checkpoints that drive as `run:DIR` or `run:DIR/bc`: the policy and, if the decision rule
/// has an ensemble drive, its other members. A final fit, and `bc`, are one network.
///
/// # Errors
/// See [`policy_folder`].
pub fn driving_folders(spec: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let policy = policy_folder(spec)?;
    let (run, is_bc) = run_of(spec)?;
    // Damage is an error. Settings that are whole may be of another version: the network alone can be used then.
    sums::read(&run.join(SETTINGS), RUN_TOML_BYTES_MAX)?;
    // It says which files the network was trained on.
    sums::read(&run.join(MANIFEST), RUN_TOML_BYTES_MAX)?;
    let round = policy.file_name().and_then(|name| name.to_str()).filter(|name| !is_bc && name.starts_with("round-"));
    // A lost line in the list would leave fewer networks than the rule has drive.
    let members = settings_of(spec).map_or(1, |settings| settings.dagger.rule.members());
    let mut folders = vec![policy.clone()];
    for member in (1..).map_while(|member| Some(format!("{}-member-{member}", round?))) {
        let list = format!("{member}/{}", sums::FILE);
        if !sums::is_listed(run, &list)? {
            ensure!(
                folders.len() >= members,
                "{}: does not list {list}, one of the {members} networks that drive; restore the file, or train again",
                run.join(sums::FILE).display()
            );
            break;
        }
        sums::read_listed(run, &list, sums::LIST_BYTES_MAX)?;
        folders.push(run.join(member));
    }
    Ok(folders)
}

/// The settings of the run that `run:DIR` or `run:DIR/bc` names.
///
/// # Errors
/// If there is no run, or its settings are not of this program.
pub fn settings_of(spec: &Path) -> anyhow::Result<Settings> {
    Settings::read(&run_of(spec)?.0.join(SETTINGS))
}

/// What a policy `DIR` or `DIR/bc` was trained by.
///
/// # Errors
/// See [`settings_of`].
pub fn training_of(spec: &Path) -> anyhow::Result<Training> {
    let mut settings = settings_of(spec)?;
    let seed = std::mem::replace(&mut settings.seed, RootSeed(0));
    settings.evaluation = Settings::preset("default")?.evaluation;
    let policy = if run_of(spec)?.1 { "bc" } else { "final" };
    let manifest = Manifest::read(run_of(spec)?.0)?;
    let digests: Vec<_> = settings.training.lots.iter().map(|lots| manifest.inputs.get(lots)).collect();
    let recipe = format!("{policy}\n{:?}\n{digests:?}\n{}", manifest.version(), settings.to_toml());
    let recipe = sums::digest(recipe.as_bytes());
    Ok(Training { recipe, seed })
}

/// The lots that a policy `DIR` or `DIR/bc` was trained on. The two keys that say so are read of any version: whoever
/// forgets them takes lots for unseen that are not.
///
/// # Errors
/// If there is no run, a file is missing or damaged, or it does not say so.
pub fn trained_on(spec: &Path) -> anyhow::Result<TrainedOn> {
    let (run, _) = run_of(spec)?;
    let table = |name: &str| -> anyhow::Result<toml::Table> {
        let path = run.join(name);
        sums::read_to_string(&path, RUN_TOML_BYTES_MAX)?.parse().with_context(|| path.display().to_string())
    };
    let lots = table(SETTINGS)?.get("training").and_then(|training| training.get("lots")).cloned();
    let lots: Vec<String> = lots.and_then(|lots| lots.try_into().ok()).with_context(|| {
        let path = run.join(SETTINGS);
        format!("{}: training.lots names no lots, so nobody knows what it was trained on; train again", path.display())
    })?;
    let inputs = table(MANIFEST)?.remove("inputs").map(Inputs::deserialize);
    let inputs = inputs.transpose().with_context(|| run.join(MANIFEST).display().to_string())?.unwrap_or_default();
    let digests = lots.iter().filter_map(|lots| inputs.get(lots)).cloned().collect();
    Ok(TrainedOn { lots: lots.into_iter().collect(), digests })
}

/// The same of a network by the folder of its checkpoint: those of the run that it lies in, none outside of one.
///
/// # Errors
/// See [`trained_on`].
pub fn network_trained_on(checkpoint: &Path) -> anyhow::Result<TrainedOn> {
    run_of_network(checkpoint)?.map_or_else(|| Ok(TrainedOn::default()), |run| trained_on(&run))
}

/// Refuses a network from a run whose settings or manifest are damaged: what it was trained on would be unknown.
///
/// # Errors
/// If they are.
pub fn ensure_run_of_network(checkpoint: &Path) -> anyhow::Result<()> {
    if let Some(run) = run_of_network(checkpoint)? {
        sums::read(&run.join(SETTINGS), RUN_TOML_BYTES_MAX)?;
        sums::read(&run.join(MANIFEST), RUN_TOML_BYTES_MAX)?;
    }
    Ok(())
}

/// The run that a checkpoint lies in, if it does.
fn run_of_network(checkpoint: &Path) -> anyhow::Result<Option<PathBuf>> {
    let place = storage::place_of(checkpoint)?;
    let Some(folder) = place.parent() else { return Ok(None) };
    let is_there = [SETTINGS, MANIFEST].iter().all(|name| folder.join(name).is_file());
    // What is listed and gone is damage, not the absence of a run. A list of another program is none.
    let is_listed = |name| match sums::is_listed(folder, name) {
        Err(error) if !storage::is_of_disk(&error) => Ok(false),
        found => found,
    };
    let is_run = is_there || is_listed(SETTINGS)? || is_listed(MANIFEST)?;
    Ok(is_run.then(|| folder.to_owned()))
}

/// A hint at the run of that name, if there is one.
fn in_runs(run: &Path) -> String {
    let meant = Path::new("runs").join(run);
    let hint = || format!("; did you mean {}?", meant.display());
    sums::exists(&meant).is_ok_and(|exists| exists).then(hint).unwrap_or_default()
}

/// The folder of the run, and whether its policy after behaviour cloning is meant.
fn run_of(spec: &Path) -> anyhow::Result<(&Path, bool)> {
    let (run, is_bc) = match (spec.file_name(), spec.parent()) {
        (Some(name), Some(run)) if name == "bc" && !spec.is_dir() => (run, true),
        _ => (spec, false),
    };
    ensure!(
        sums::exists(run)? || !run.join(SETTINGS).is_file(),
        "{}: this run has no sha256sums: an earlier version made it, or the list is lost; train again into another folder, \
         or restore the list from a copy",
        run.display()
    );
    // An empty path is the present folder, and does not exist.
    ensure!(
        sums::exists(run)? || run.exists(),
        "{}: there is no such folder, so this is not a run; list those in runs/{}",
        run.display(),
        in_runs(run)
    );
    ensure!(
        sums::exists(run)?,
        "{}: this is not a run; cargo xtask train-dagger and evaluate make them, in runs/ unless --out says otherwise{}",
        run.display(),
        in_runs(run)
    );
    Ok((run, is_bc))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drivers::DriverSpec;
    use crate::manifest::Request;
    use crate::run_dir::RunDir;
    use crate::test_runs::{create, message, place, scratch};
    use policy::conditions::Conditions;
    use policy::dagger::Stop;
    use policy::decision_rule::DecisionRule;
    use policy::fit::Budget;
    use policy::network::Weights;
    use std::fs;

    /// Three trainings before a change of the code and three after it were one method, and three of them vanished.
    #[test]
    fn trainings_of_two_versions_of_the_program_are_not_of_one_recipe() {
        let path = scratch("recipe-of-version");
        let settings = Settings::preset("smoke").unwrap();
        RunDir::create(&place(&path, false), &settings, &Request::default()).unwrap();
        let manifest = path.join(MANIFEST);
        let written = fs::read_to_string(&manifest).unwrap();
        let kept: Vec<&str> = written.lines().filter(|line| !line.starts_with("git_revision")).collect();
        let recipe_at = |revision: &str| {
            fs::write(&manifest, format!("git_revision = \"{revision}\"\n{}\n", kept.join("\n"))).unwrap();
            sums::list(&path, &[MANIFEST]).unwrap();
            training_of(&path).unwrap().recipe
        };
        assert_eq!(recipe_at("0123"), recipe_at("0123"));
        assert_ne!(recipe_at("0123"), recipe_at("4567"));
    }

    /// Puts a network into two rounds of a run.
    fn two_rounds(run: &Path, settings: &Settings) -> Checkpoint {
        let weights = Weights::init(settings.dagger.network, RootSeed(1), 0);
        let checkpoint =
            Checkpoint { weights, conditions: Conditions::of(&settings.episode), inference: settings.dagger.inference };
        for folder in ["round-00", "round-01"] {
            checkpoint.save(&run.join(folder)).unwrap();
            sums::list(run, &[&format!("{folder}/sha256sums")]).unwrap();
        }
        checkpoint
    }

    /// Lots that a network was trained on counted as unseen where it was named by its folder.
    #[test]
    fn the_lots_of_a_training_are_those_of_its_networks_however_they_are_named() {
        let path = scratch("trained-on");
        let mut settings = Settings::preset("smoke").unwrap();
        settings.training.lots = vec!["lot-b".to_owned()];
        RunDir::create(&place(&path, false), &settings, &Request::default()).unwrap();
        let checkpoint = two_rounds(&path, &settings);
        let lots_of = |spec: String| {
            let spec: DriverSpec = spec.parse().unwrap();
            spec.load(&settings).unwrap().trained_on.lots.into_iter().collect::<Vec<_>>()
        };
        let run = path.display();
        for spec in [
            format!("run:{run}/bc"),
            format!("net:{run}/round-01"),
            format!("net:{run}/round-00/../round-01/"),
            format!("ensemble:net:{run}/round-00,run:{run}"),
        ] {
            assert_eq!(lots_of(spec.clone()), ["lot-b"], "{spec}");
        }
        let whole = fs::read(path.join(MANIFEST)).unwrap();
        fs::write(path.join(MANIFEST), &whole[1..]).unwrap();
        let damaged: DriverSpec = format!("net:{run}/round-01").parse().unwrap();
        assert!(message(damaged.clone().load(&settings).map(drop)).contains("manifest.toml: is damaged"));
        fs::write(path.join(MANIFEST), &whole).unwrap();
        // Without one of them the folder was none of a run's, and lots that it was trained on were unseen ones.
        for name in [SETTINGS, MANIFEST] {
            fs::rename(path.join(name), path.join("away")).unwrap();
            let refused = message(damaged.clone().load(&settings).map(drop));
            assert!(refused.contains(&format!("{name}: cannot be read")), "{refused}");
            fs::rename(path.join("away"), path.join(name)).unwrap();
        }
        let around = scratch("trained-on-alone");
        let alone = around.join("network");
        fs::create_dir_all(&around).unwrap();
        checkpoint.save(&alone).unwrap();
        assert!(lots_of(format!("net:{}", alone.display())).is_empty(), "nobody knows");
        fs::write(alone.with_file_name("sha256sums"), "of another program").unwrap();
        assert!(lots_of(format!("net:{}", alone.display())).is_empty(), "nobody knows still");
        for path in [path, around] {
            fs::remove_dir_all(path).unwrap();
        }
    }

    /// The lots of a run whose settings another version wrote were forgotten, and unseen ones in tables.
    #[test]
    fn a_run_with_a_setting_that_is_gone_still_knows_its_lots() {
        let path = scratch("trained-on-before");
        let mut settings = Settings::preset("smoke").unwrap();
        settings.training.lots = vec!["lot-b".to_owned()];
        let inputs = [("lot-b".to_owned(), "of a file".to_owned())].into();
        RunDir::create(&place(&path, false), &settings, &Request { inputs, ..Request::default() }).unwrap();
        two_rounds(&path, &settings);
        let mut written: toml::Table = fs::read_to_string(path.join(SETTINGS)).unwrap().parse().unwrap();
        written.insert("of_another_version".to_owned(), toml::Value::Integer(1));
        let write = |written: &toml::Table| sums::write(&path, SETTINGS, written.to_string().as_bytes()).unwrap();
        write(&written);
        assert!(message(settings_of(&path)).contains("of_another_version"));
        let load = |spec: &str| spec.parse::<DriverSpec>().unwrap().load(&settings);
        let run = path.display();
        let specs =
            [format!("run:{run}"), format!("net:{run}/round-01"), format!("ensemble:net:{run}/round-00,run:{run}")];
        for spec in &specs {
            let TrainedOn { lots, digests } = load(spec).unwrap().trained_on;
            assert_eq!((lots, digests), (["lot-b".to_owned()].into(), ["of a file".to_owned()].into()), "{spec}");
        }
        written["training"].as_table_mut().unwrap().remove("lots");
        write(&written);
        for spec in &specs {
            let refused = message(load(spec).map(drop));
            assert!(refused.contains("nobody knows what it was trained on"), "{spec}: {refused}");
        }
        fs::remove_dir_all(path).unwrap();
    }

    /// `evaluate` drove with the first network of an ensemble alone.
    #[test]
    fn a_run_whose_rule_has_an_ensemble_drives_with_all_of_it() {
        let path = scratch("members");
        let mut settings = Settings::preset("smoke").unwrap();
        settings.dagger.rule = DecisionRule::named("ensemble_dagger").unwrap();
        RunDir::create(&place(&path, false), &settings, &Request::default()).unwrap();
        let weights = Weights::init(settings.dagger.network, RootSeed(1), 0);
        let checkpoint =
            Checkpoint { weights, conditions: Conditions::of(&settings.episode), inference: settings.dagger.inference };
        let rounds = ["round-00", "round-01"].into_iter();
        let folders = rounds.flat_map(|round| ["", "-member-1", "-member-2"].map(|part| format!("{round}{part}")));
        for folder in folders {
            checkpoint.save(&path.join(&folder)).unwrap();
            sums::list(&path, &[&format!("{folder}/sha256sums")]).unwrap();
        }
        let of_last = ["round-01", "round-01-member-1", "round-01-member-2"].map(|folder| path.join(folder));
        assert_eq!(driving_folders(&path).unwrap(), of_last);
        assert_eq!(driving_folders(&path.join("bc")).unwrap(), [path.join("round-00")]);
        let whole = fs::read(path.join(SETTINGS)).unwrap();
        fs::write(path.join(SETTINGS), &whole[1..]).unwrap();
        assert!(message(driving_folders(&path)).contains("settings.toml"), "damage does not make one network of it");
        fs::write(path.join(SETTINGS), whole).unwrap();
        let list = fs::read_to_string(path.join(sums::FILE)).unwrap();
        let without_last: Vec<&str> = list.lines().filter(|line| !line.contains("round-01-member-2")).collect();
        fs::write(path.join(sums::FILE), without_last.join("\n") + "\n").unwrap();
        assert!(message(driving_folders(&path)).contains("one of the 3 networks that drive"), "two of three drove");
        fs::write(path.join(sums::FILE), list).unwrap();
        fs::remove_dir_all(&of_last[2]).unwrap();
        assert!(message(driving_folders(&path)).contains("round-01-member-2/sha256sums"));
        fs::remove_dir_all(path).unwrap();
    }

    /// A flipped bit in the list, in the name `final`, made `run:DIR` the network of the last round, without a word.
    #[test]
    fn a_training_that_ends_with_a_final_one_never_drives_with_its_last_round() {
        let path = scratch("lost-final");
        let mut settings = Settings::preset("smoke").unwrap();
        settings.dagger.final_budget = Budget::Steps(3);
        let run = RunDir::create(&place(&path, false), &settings, &Request::default()).unwrap();
        let checkpoint = two_rounds(&path, &settings);
        checkpoint.save(&path.join("final")).unwrap();
        sums::list(&path, &["final/sha256sums"]).unwrap();
        run.finish(Outcome::Training { stop: Stop::IterationCap, rounds: 2 }).unwrap();
        assert_eq!(policy_folder(&path).unwrap(), path.join("final"));
        let list = fs::read_to_string(path.join(sums::FILE)).unwrap();
        fs::write(path.join(sums::FILE), list.replace("final/", "finel/")).unwrap();
        let refused = message(policy_folder(&path));
        assert!(refused.contains("sha256sums: does not list final/sha256sums"), "{refused}");
        drop(run);
        fs::remove_dir_all(path).unwrap();
    }

    /// A misspelt folder was advised how runs are made, not that there is none.
    #[test]
    fn a_folder_that_does_not_exist_is_said_not_to() {
        let path = scratch("no-folder");
        for spec in [path.clone(), path.join("bc")] {
            let refused = message(policy_folder(&spec));
            assert!(refused.starts_with(&path.display().to_string()), "{refused}");
            assert!(refused.contains("there is no such folder, so"), "{refused}");
            assert!(refused.ends_with("list those in runs/"), "{refused}");
        }
        fs::create_dir_all(&path).unwrap();
        let refused = message(policy_folder(&path));
        assert!(refused.contains("this is not a run") && !refused.contains("no such folder"), "{refused}");
        fs::remove_dir_all(path).unwrap();
    }

    /// A run of an earlier version was called no run at all.
    #[test]
    fn what_has_no_list_has_no_policy() {
        let path = scratch("no-policy");
        fs::create_dir_all(&path).unwrap();
        assert!(message(policy_folder(&path)).contains("this is not a run"));
        fs::write(path.join(SETTINGS), "").unwrap();
        assert!(message(policy_folder(&path)).contains("an earlier version made it"));
        fs::remove_dir_all(path).unwrap();
    }

    #[test]
    fn the_policy_of_a_run_is_its_last_network() {
        let path = scratch("policy");
        assert!(message(policy_folder(&path)).contains("this is not a run"));
        create(&path, false).unwrap();
        assert!(message(policy_folder(&path)).contains("no network"));
        // What was collected of a round, without a network.
        sums::write_folder(&path, "round-00", [("round.toml".to_owned(), Vec::new())]).unwrap();
        let refused = message(policy_folder(&path.join("round-00")));
        assert!(refused.contains("holds no finished network") && !refused.contains("another command"), "{refused}");
        let settings = Settings::preset("smoke").unwrap();
        let weights = Weights::init(settings.dagger.network, RootSeed(1), 0);
        let checkpoint =
            Checkpoint { weights, conditions: Conditions::of(&settings.episode), inference: settings.dagger.inference };
        let save = |folder: &str| {
            checkpoint.save(&path.join(folder)).unwrap();
            sums::list(&path, &[&format!("{folder}/sha256sums")]).unwrap();
        };
        for folder in ["round-00", "round-01", "round-99", "round-100"] {
            save(folder);
        }
        save("round-100-critic"); // trained beside the network
        fs::create_dir_all(path.join("round-101")).unwrap(); // collected, not trained yet
        assert_eq!(policy_folder(&path).unwrap(), path.join("round-100"), "of 101 rounds the last but one drove");
        assert_eq!(policy_folder(&path.join("bc")).unwrap(), path.join("round-00"));
        save("final");
        assert_eq!(policy_folder(&path).unwrap(), path.join("final"));
        // A round that was lost is an error: another would drive under its name.
        fs::remove_dir_all(path.join("final")).unwrap();
        assert!(message(policy_folder(&path)).contains("final/sha256sums"));
        fs::remove_dir_all(path).unwrap();
    }

    /// What counts more makes one method of none, what counts less a method of two.
    #[test]
    fn a_recipe_is_of_everything_but_the_seed_and_the_evaluation() {
        let path = scratch("recipe-of-settings");
        let trained = |change: fn(&mut Settings), digest: &str, policy: &str| {
            let mut settings = Settings::preset("smoke").unwrap();
            settings.training.lots = vec!["lots/mine.toml".to_owned()];
            change(&mut settings);
            let inputs = [("lots/mine.toml".to_owned(), digest.to_owned())].into();
            let request = Request { inputs, ..Request::default() };
            drop(RunDir::create(&place(&path, true), &settings, &request).unwrap());
            training_of(&path.join(policy)).unwrap()
        };
        let own = trained(|_| {}, "1", "");
        assert_eq!(own.seed, Settings::preset("smoke").unwrap().seed);
        let of_seed = trained(|settings| settings.seed = RootSeed(9), "1", "");
        assert_eq!(of_seed, Training { seed: RootSeed(9), ..own.clone() });
        let elsewhere = trained(|settings| settings.evaluation.lots = vec!["lot-c".to_owned()], "1", "");
        assert_eq!(elsewhere, own);
        for other in [
            trained(|settings| settings.dagger.eta = 0.5, "1", ""),
            trained(|settings| settings.training.trials = 2, "1", ""),
            // Other ground under the same name.
            trained(|_| {}, "2", ""),
            // Behaviour cloning.
            trained(|_| {}, "1", "bc"),
        ] {
            assert_ne!(other.recipe, own.recipe);
        }
        fs::remove_dir_all(path).unwrap();
    }
}
