//! Words that were replaced do not come back: one thing has one name.

use crate::bench::root;
use std::path::Path;

/// What must not be written any more, in lower case, and what is written instead.
const REPLACED: [(&str, &str); 24] = [
    ("arbiter", "gated collector"),
    ("contestant", "driver"),
    ("further look", "noise augmentation"),
    ("further looks", "noise augmentations"),
    ("intruder", "lane encroachment"),
    ("ledger", "evaluation results"),
    ("looker", "noise augmentation"),
    ("lookers", "noise augmentations"),
    ("memory_ticks", "smoothing_ticks"),
    ("no more than it says", "say what it is"),
    ("none the worse", "say what it costs"),
    ("nudge", "disturbance"),
    ("nudged", "disturbed"),
    ("nudges", "disturbances"),
    ("relook", "noise augmentation"),
    ("relooks", "noise augmentations"),
    ("sighting", "incident"),
    ("smear", "occlusion"),
    ("smeared", "occluded"),
    ("station_m", "arc_length_m"),
    ("station_share", "reach_share"),
    ("steady hand", "action smoothing"),
    ("the bench", "the command line"),
    ("what stands about", "obstacles"),
];

/// Files that name old things: what they are called now, and that they are refused.
const NAME_OLD_THINGS: [&str; 7] = [
    "CHANGELOG.md",
    "docs/formats.md",
    "experiment/src/settings/reference/tests.rs",
    "experiment/src/settings/renamed.rs",
    "experiment/src/settings/tests.rs",
    "policy/src/dataset/store.rs",
    "tests/commands.rs",
];

/// Not ours, or made by a program.
const SKIPPED: [&str; 4] = ["target", "runs", "recordings", ".git"];

/// Calls with every source, page and settings file below a folder; returns how many there were.
fn each_text(folder: &Path, look: &mut dyn FnMut(&str, &str)) -> usize {
    let mut seen = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let (path, name) = (entry.path(), entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            seen += if SKIPPED.iter().any(|skipped| name == *skipped) { 0 } else { each_text(&path, look) };
        } else if path.extension().is_some_and(|extension| ["rs", "md", "toml", "py"].iter().any(|of| extension == *of))
        {
            look(&path.strip_prefix(root()).unwrap().to_string_lossy(), &std::fs::read_to_string(&path).unwrap());
            seen += 1;
        }
    }
    seen
}

/// Lines of a word, from 1; whole words only.
fn places(text: &str, word: &str) -> Vec<usize> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let is_whole =
        |&(at, _): &(usize, &str)| !text[..at].ends_with(is_part) && !text[at + word.len()..].starts_with(is_part);
    text.match_indices(word).filter(is_whole).map(|(at, _)| text[..at].matches('\n').count() + 1).collect()
}

#[test]
fn replaced_words_do_not_come_back() {
    let mut faults = Vec::new();
    let seen = each_text(root(), &mut |name, text| {
        if name == "tests/words.rs" || NAME_OLD_THINGS.contains(&name) {
            return;
        }
        let text = text.to_lowercase();
        for (word, instead) in REPLACED {
            faults.extend(places(&text, word).iter().map(|line| format!("{name}:{line}: {word:?}; write {instead:?}")));
        }
    });
    assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
    assert!(seen > 200, "only {seen} files were looked at");
}

#[test]
fn only_whole_words_are_found() {
    assert_eq!(places("a looker\nlookers, looker_m\n(looker)", "looker"), [1, 3]);
}
