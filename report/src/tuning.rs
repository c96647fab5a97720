//! What tuning changed, as Markdown.

use crate::markdown::table_of;
use evaluation::tune::{Found, Score};
use std::fmt::Write as _;

/// Before and after, a row of each per planner, then what was found. A choice profits from the trials of its search; what the
/// fresh ones alone say, which only the finalists drive, stands beside.
pub fn table(tuned: &[Found]) -> String {
    let header = [
        "planner",
        "parameters",
        "near-collisions (contacts)",
        "per 100 m",
        "per 100 m on fresh trials",
        "stuck",
        "safe ratio",
    ];
    let mut table = table_of(&header);
    let mut list = String::new();
    let rate = |score: &Score| format!("{:.2}", score.near_collisions_per_100m);
    for found in tuned {
        let rows = [("before", &found.before, &found.before_fresh), ("after", &found.after, &found.after_fresh)];
        for (when, score, fresh) in rows {
            table.add_row([
                found.name.clone(),
                when.to_owned(),
                format!("{} ({})", score.near_collisions, score.contacts),
                rate(score),
                rate(fresh),
                score.stuck.to_string(),
                format!("{:.3}", score.safe_ratio),
            ]);
        }
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
        let values = if found.is_start { "nothing better".to_owned() } else { values.join(", ") };
        let _ = write!(list, "\n- {}: found {values}", found.name);
    }
    format!(
        "{table}\n{list}\n\nCounts and rates are of all trials; the fresh ones are those that only the starting point and the best few \
         drive."
    )
}
