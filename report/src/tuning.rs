//! What tuning changed, as Markdown.

use crate::markdown::table_of;
use evaluation::tune::Found;

/// Before and after, one row per planner.
pub fn table(tuned: &[Found]) -> String {
    let header = [
        "planner",
        "near-collisions before",
        "after",
        "per 100 m before",
        "after",
        "stuck before",
        "after",
        "safe ratio before",
        "after",
        "found",
    ];
    let mut table = table_of(&header);
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
            before.near_collisions.to_string(),
            after.near_collisions.to_string(),
            format!("{:.2}", before.near_collisions_per_100m),
            format!("{:.2}", after.near_collisions_per_100m),
            before.stuck.to_string(),
            after.stuck.to_string(),
            format!("{:.3}", before.safe_ratio),
            format!("{:.3}", after.safe_ratio),
            if found.is_start { "nothing better".to_owned() } else { values.join(", ") },
        ]);
    }
    table.to_string()
}
