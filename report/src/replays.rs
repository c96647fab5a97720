//! Runs that were driven again, as a table.

use crate::markdown::{escaped, table_of};
use comfy_table::Table;
use experiment::replay_key::ReplayKey;
use serde::Serialize;
use sim::metrics::EpisodeMetrics;

/// A run that was driven again.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// What was driven again.
    pub key: ReplayKey,
    /// The name of its lot.
    pub lot: String,
    /// Its result.
    pub metrics: EpisodeMetrics,
    /// The digest of everything seen, decided and driven.
    pub sha256: String,
    /// Whether it was the same when it was recorded; `None` if it is not known.
    #[serde(rename = "same")]
    pub is_same: Option<bool>,
}

/// The table of all runs; a digest is shown by its first digits.
pub fn table(rows: &[Row]) -> Table {
    let mut table =
        table_of(&["driver", "lot", "way", "trial", "near-coll.", "contacts", "safe ratio", "digest", "as recorded"]);
    for Row { key, lot, metrics, sha256, is_same } in rows {
        table.add_row([
            escaped(&key.driver.to_string()),
            escaped(lot),
            key.direction.name().to_owned(),
            key.trial.to_string(),
            metrics.near_collisions.to_string(),
            metrics.contacts.to_string(),
            format!("{:.3}", metrics.safe_ratio),
            sha256[..16].to_owned(),
            match is_same {
                Some(true) => "the same",
                Some(false) => "NO",
                None => "–",
            }
            .to_owned(),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All figures of a lot called `a|b` stood under other headings.
    #[test]
    fn a_bar_in_the_name_of_a_lot_ends_no_cell() {
        let row = Row {
            key: "expert@lot-b@reverse@3@paper@1@0".parse().unwrap(),
            lot: "a|b".to_owned(),
            metrics: EpisodeMetrics::default(),
            sha256: "0".repeat(64),
            is_same: None,
        };
        let text = table(&[row]).to_string();
        assert!(text.contains("| a\\|b "), "{text}");
    }
}
