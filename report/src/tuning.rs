//! What tuning changed, as Markdown.

use crate::markdown::table_of;
use evaluation::tune::{Found, Score};

/// Before and after, one row per planner. A choice profits from the trials of its search; what the fresh ones alone say,
/// which only the finalists drive, stands beside.
pub fn table(tuned: &[Found]) -> String {
    let header = [
        "planner",
        "near-collisions (contacts) before",
        "after",
        "per 100 m before",
        "after",
        "on fresh trials before",
        "after",
        "stuck before",
        "after",
        "safe ratio before",
        "after",
        "found",
    ];
    let mut table = table_of(&header);
    let counts = |score: &Score| format!("{} ({})", score.near_collisions, score.contacts);
    let rate = |score: &Score| format!("{:.2}", score.near_collisions_per_100m);
    for found in tuned {
        let (before, after) = (&found.before, &found.after);
        let parameters = found.planner.parameters();
        let values: Vec<String> = found
            .planner
            .search_space()
            .iter()
            .map(|(name, _)| match &parameters[*name] {
                toml::Value::Float(value) => format!("{name} {value:.3}"),
                other => format!("{name} {other}"),
            })
            .collect();
        table.add_row(vec![
            found.name.clone(),
            counts(before),
            counts(after),
            rate(before),
            rate(after),
            rate(&found.before_fresh),
            rate(&found.after_fresh),
            before.stuck.to_string(),
            after.stuck.to_string(),
            format!("{:.3}", before.safe_ratio),
            format!("{:.3}", after.safe_ratio),
            if found.is_start { "nothing better".to_owned() } else { values.join(", ") },
        ]);
    }
    table.to_string()
}
