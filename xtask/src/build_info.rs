//! Which program this is, for the manifest of every run.

use crate::output::Output;
use anyhow::ensure;
use evaluation::shards::has_networks;
use experiment::manifest::{Build, Manifest, processor_features};
use experiment::run_dir::RunDir;
use experiment::settings::Settings;
use serde::Deserialize;
use std::path::Path;
use std::sync::OnceLock;

/// Name and version, as in `--version` and manifests.
pub(crate) const PROGRAM: &str = concat!("lotpilot ", env!("CARGO_PKG_VERSION"));

/// What made this program, and how it was called.
pub(crate) fn get() -> &'static Build {
    static BUILD: OnceLock<Build> = OnceLock::new();
    BUILD.get_or_init(|| Build {
        program: PROGRAM.to_owned(),
        command_line: std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned()).collect(),
        git_revision: Some(env!("XTASK_GIT_REVISION").to_owned()).filter(|revision| !revision.is_empty()),
        git_dirty: changes().map(|changes| !changes.is_empty()),
        git_changes: changes().filter(|changes| !changes.is_empty()).map(str::to_owned),
        rustc_version: env!("XTASK_RUSTC").to_owned(),
        processor: processor(),
        processor_features: processor_features(),
        libraries: libraries(),
    })
}

/// Git's hash of what the sources that this was built from have beside the commit: empty if nothing, `None` if unknown.
fn changes() -> Option<&'static str> {
    Some(env!("XTASK_GIT_CHANGES")).filter(|changes| *changes != "unknown")
}

/// Reopens the folder of an interrupted run of a command, if this program may continue it.
///
/// # Errors
/// See [`RunDir::resume`]; or if the run was begun by another version, with other libraries, or where networks round otherwise.
pub(crate) fn resume(run: &Path, command: &str, output: &Output) -> anyhow::Result<(RunDir, Settings, Manifest)> {
    let (folder, settings, manifest) = RunDir::resume(run, command)?;
    check_can_go_on(run, &manifest, output)?;
    Ok((folder, settings, manifest))
}

/// Checks that this program may continue a run: otherwise results of two versions would stand under the name of one.
/// Another commit of the same version, which may differ only in its documents, and other changes to it are reported.
fn check_can_go_on(run: &Path, manifest: &Manifest, output: &Output) -> anyhow::Result<()> {
    let Build { program, libraries, git_revision, git_changes, .. } = get();
    ensure!(
        manifest.program == *program && manifest.libraries == *libraries,
        "{0}: begun with another version of lotpilot ({1}; {0}/manifest.toml lists its libraries); use that one, or \
         begin again into another folder",
        run.display(),
        manifest.program
    );
    ensure!(
        manifest.is_of_this_target() && (!has_networks(manifest) || manifest.rounds_like_here(get())),
        "{0}: begun on a machine that rounds otherwise ({0}/manifest.toml has its target and processor_features), and a run is of \
         one kind; continue it there, or begin again into another folder",
        run.display()
    );
    if let (Some(begun), Some(now)) = (&manifest.git_revision, git_revision)
        && begun != now
    {
        output.note(format_args!(
            "{}: begun at commit {begun}, which its manifest names; this program is of commit {now}",
            run.display()
        ));
    } else if manifest.git_changes != *git_changes {
        output.note(format_args!(
            "{}: begun by a program with other changes to its sources than this one has (`git_changes` in its manifest)",
            run.display()
        ));
    }
    Ok(())
}

/// Checks that this program is the one that began a shard: its stages would be of two versions, and `merge` would refuse
/// them after all the work.
///
/// # Errors
/// If it is another.
pub(crate) fn check_began_shard(run: &Path, manifest: &Manifest) -> anyhow::Result<()> {
    ensure!(
        manifest.is_of(get()),
        "{}: this shard was begun with another version of lotpilot; use that one, or make the shard again",
        run.display()
    );
    Ok(())
}

/// The libraries whose arithmetic or draws results depend on.
const COMPUTING: [&str; 20] = [
    "burn",
    "burn-flex",
    "faer",
    "gemm-f32",
    "geo",
    "glam",
    "libm",
    "nano-gemm-f32",
    "parry2d",
    "private-gemm-x86",
    "pulp",
    "rand",
    "rand_chacha",
    "rapier2d",
    "rten",
    "rten-gemm",
    "rten-simd",
    "rten-vecmath",
    "statrs",
    "wide",
];

/// [`COMPUTING`], in every version that `Cargo.lock` names.
fn libraries() -> Vec<String> {
    /// What is read of `Cargo.lock`.
    #[derive(Deserialize)]
    struct Lock {
        package: Vec<Package>,
    }
    #[derive(Deserialize)]
    struct Package {
        name: String,
        version: String,
    }
    let lock: Lock = toml::from_str(include_str!("../../Cargo.lock")).expect("cargo wrote it");
    let computing = lock.package.into_iter().filter(|package| COMPUTING.contains(&package.name.as_str()));
    computing.map(|Package { name, version }| format!("{name} {version}")).collect()
}

/// The name of the processor, where the system tells (Linux).
fn processor() -> Option<String> {
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let name = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'))?.1;
    Some(name.trim().to_owned())
}

#[cfg(test)]
#[path = "../build/git.rs"]
mod git;

#[cfg(test)]
mod tests {
    use super::*;
    use experiment::manifest::Request;
    use experiment::run_dir::Place;
    use std::fs;

    /// A run went on with another generator of its noise or with other vectors in its networks: neither was among them.
    #[test]
    fn a_run_names_the_version_of_every_library_that_computes() {
        let named = libraries();
        let is_named = |name: &&str| named.iter().any(|library| library.split(' ').next() == Some(*name));
        let unnamed: Vec<&str> = COMPUTING.into_iter().filter(|name| !is_named(name)).collect();
        assert!(unnamed.is_empty(), "{unnamed:?} is in no Cargo.lock any more");
        assert!(["pulp", "rand_chacha", "statrs", "wide"].iter().all(is_named), "{named:?}");
    }

    /// A run is of one version, with its libraries, and of machines that round alike; another commit is only said.
    #[test]
    fn a_run_is_resumed_by_its_version_and_where_its_networks_round_alike() {
        let folder = std::env::temp_dir().join(format!("xtask-test-{}-resume", std::process::id()));
        let settings = Settings::preset("smoke").unwrap();
        let resumed = |build: &Build, driver: &str| {
            let _ = fs::remove_dir_all(&folder);
            let place =
                Place { build, out: Some(&folder), overwrite: false, command: "evaluate", preset: "smoke", seed: 1 };
            let drivers = toml::Value::Array(vec![driver.into()]);
            let arguments = toml::Table::from_iter([("drivers".to_owned(), drivers)]);
            drop(RunDir::create(&place, &settings, &Request { arguments, ..Request::default() }).unwrap());
            loop {
                let came = resume(&folder, "evaluate", &Output::new(true, false)).map(drop);
                match came.map_err(|error| error.to_string()) {
                    // By a child of another test, which has every lock of this process until its program begins.
                    Err(error) if error.contains("in use by another process") => std::thread::yield_now(),
                    came => return came,
                }
            }
        };
        let here = get();
        for build in [
            here.clone(),
            Build { git_revision: Some("another commit".to_owned()), ..here.clone() },
            Build { git_changes: Some("other changes".to_owned()), ..here.clone() },
        ] {
            assert_eq!(resumed(&build, "run:runs/mine"), Ok(()), "{build:?}");
        }
        let old = Build { program: "lotpilot 0.0.0".to_owned(), ..here.clone() };
        let of_other_libraries = Build { libraries: vec!["libm 0.0.0".to_owned()], ..here.clone() };
        let rounds_once = ["avx2", "fma"].map(str::to_owned).to_vec();
        let has_fma = rounds_once.iter().all(|name| here.processor_features.contains(name));
        let processor_features = if has_fma { Vec::new() } else { rounds_once };
        let rounds_otherwise = Build { processor_features, ..here.clone() };
        for (build, problem) in [
            (&old, "begun with another version of lotpilot (lotpilot 0.0.0;"),
            (&of_other_libraries, "begun with another version of lotpilot"),
            (&rounds_otherwise, "begun on a machine that rounds otherwise"),
        ] {
            let error = resumed(build, "run:runs/mine").unwrap_err();
            assert!(error.contains(problem), "{error}");
        }
        assert_eq!(resumed(&rounds_otherwise, "tentacle"), Ok(()), "no network drives");
        fs::remove_dir_all(&folder).unwrap();
    }

    /// Two programs with other changes to one commit were taken for one.
    #[test]
    fn programs_with_other_changes_to_their_sources_differ_and_nothing_else_counts() {
        let folder = std::env::temp_dir().join(format!("xtask-test-{}-git", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(folder.join("src")).unwrap();
        let git = |args: &[&str]| git::answer(&folder, args).unwrap_or_else(|| panic!("git {args:?}"));
        let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
        let changes = || git::changes(&folder, &["src", "Cargo.toml"]).unwrap();
        git(&["init", "--quiet"]);
        write("src/main.rs", "fn main() {}\n");
        write("Cargo.toml", "");
        write("README.md", "");
        git(&["add", "."]);
        git(&[
            "-c",
            "user.name=a",
            "-c",
            "user.email=a@b",
            "-c",
            "commit.gpgsign=false",
            "commit",
            "--quiet",
            "-m",
            "a",
        ]);
        assert_eq!(changes(), "");
        write("README.md", "It is no source.");
        write("notes.txt", "Nor is this.");
        assert_eq!(changes(), "");
        let mut seen = vec![changes()];
        let mut is_new = |what: &str| {
            assert!(!seen.contains(&changes()), "{what}");
            seen.push(changes());
        };
        write("src/main.rs", "fn main() { one() }\n");
        is_new("a change");
        write("src/main.rs", "fn main() { two() }\n");
        is_new("another one in the same file");
        write("src/Näheres.rs", "");
        is_new("a file that git does not know");
        fs::rename(folder.join("src/Näheres.rs"), folder.join("src/other.rs")).unwrap();
        is_new("its name");
        fs::remove_file(folder.join("Cargo.toml")).unwrap();
        is_new("a file that is gone");
        git(&["checkout", "--quiet", "."]);
        fs::remove_file(folder.join("src/other.rs")).unwrap();
        assert_eq!(changes(), "");
        // How its user likes git to print changes nothing.
        write("src/Näheres.rs", "");
        let as_usual = changes();
        for (setting, value) in
            [("diff.noprefix", "true"), ("diff.mnemonicPrefix", "true"), ("core.quotePath", "false")]
        {
            git(&["config", setting, value]);
        }
        assert_eq!(changes(), as_usual);
        fs::remove_dir_all(folder.join(".git")).unwrap();
        assert_eq!(git::changes(&folder, &["src"]), None, "no checkout");
        fs::remove_dir_all(&folder).unwrap();
    }
}
