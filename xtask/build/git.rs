//! What git says about the checkout that a program is built from.

use std::collections::BTreeSet;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// How sources differ from the commit: git's hash of the names and contents that do; empty if none does, `None` without
/// git or checkout. Of names and contents, because what git prints depends on the settings of its user.
pub(crate) fn changes(workspace: impl AsRef<Path>, sources: &[&str]) -> Option<String> {
    let workspace = workspace.as_ref();
    let names_of = |args: &[&str]| answer(workspace, &[args, &["-z", "--"], sources].concat());
    let changed = names_of(&["diff", "HEAD", "--name-only", "--no-renames", "--relative"])?;
    let untracked = names_of(&["ls-files", "--others", "--exclude-standard"])?;
    let names: BTreeSet<&str> =
        changed.split('\0').chain(untracked.split('\0')).filter(|name| !name.is_empty()).collect();
    if names.is_empty() {
        return Some(String::new());
    }
    let content = |name: &str| {
        answer(workspace, &["hash-object", "--no-filters", "--", name]).unwrap_or_else(|| "gone".to_owned())
    };
    let differences: Vec<String> = names.into_iter().map(|name| format!("{}  {name}\n", content(name))).collect();
    let mut hash = command(workspace, &["hash-object", "--stdin"]);
    let mut hash = hash.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().ok()?;
    hash.stdin.take()?.write_all(differences.concat().as_bytes()).ok()?;
    text_of(&hash.wait_with_output().ok()?)
}

/// What git answers; `None` without git or checkout.
pub(crate) fn answer(workspace: impl AsRef<Path>, args: &[&str]) -> Option<String> {
    text_of(&command(workspace.as_ref(), args).output().ok()?)
}

fn command(workspace: &Path, args: &[&str]) -> Command {
    let mut git = Command::new("git");
    // Set where git runs a hook: they name another checkout.
    for name in ["GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_COMMON_DIR", "GIT_OBJECT_DIRECTORY"] {
        git.env_remove(name);
    }
    git.arg("--no-optional-locks").current_dir(workspace).args(args);
    git
}

/// What a command printed, if it succeeded.
pub(crate) fn text_of(output: &Output) -> Option<String> {
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
