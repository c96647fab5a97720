//! The table of limits in docs/formats.md is made of `sim/src/limits.rs`.

use crate::bench::root;
use std::fmt::Write as _;

/// A row per constant: what it limits, the number, its name.
fn table() -> String {
    let source = std::fs::read_to_string(root().join("sim/src/limits.rs")).unwrap();
    let lines: Vec<&str> = source.lines().collect();
    let mut table = "| what | limit | constant |\n|---|---|---|\n".to_owned();
    for (place, line) in lines.iter().enumerate() {
        let Some((name, rest)) = line.strip_prefix("pub const ").and_then(|rest| rest.split_once(':')) else {
            continue;
        };
        let about =
            lines[place - 1].strip_prefix("/// ").unwrap_or_else(|| panic!("{name} has a docstring of one line"));
        let value = rest.split_once('=').unwrap().1.trim().trim_end_matches(';');
        let value = value.split("..=").map(|number| number.replace('_', " ").trim_end_matches(".0").to_owned());
        let value = value.collect::<Vec<_>>().join(" to ");
        let _ = writeln!(table, "| {} | {value} | `{name}` |", about.trim_end_matches('.'));
    }
    table
}

#[test]
fn the_limits_in_the_docs_are_those_of_the_code() {
    let docs = std::fs::read_to_string(root().join("docs/formats.md")).unwrap();
    assert!(table().lines().count() > 25, "{}", table());
    assert!(docs.contains(&table()), "docs/formats.md should hold this table:\n{}", table());
}
