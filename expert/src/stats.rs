//! Counts of the expert's decisions.

use serde::{Deserialize, Serialize};

/// Which rule a decision was made by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// Nothing in the way of the chosen arc: as far as possible (the paper's third rule).
    Far,
    /// An obstacle ahead: a point from which it can be avoided (the paper's second rule).
    Avoid,
    /// The second rule with less than the comfortable clearance.
    Relaxed,
    /// No point from which anything can be avoided: the widest gap at the lowest speed.
    LastResort,
}

/// Decisions of one or more runs, counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpertStats {
    /// Decisions in all.
    pub decisions: u64,
    /// Decisions by [`Rule::Far`].
    pub far: u64,
    /// Decisions by [`Rule::Avoid`].
    pub avoid: u64,
    /// Decisions by [`Rule::Relaxed`].
    pub relaxed: u64,
    /// Decisions by [`Rule::LastResort`].
    pub last_resort: u64,
    /// Last resorts in which every arc touches something.
    pub failed: u64,
    /// Look-ahead points more than 1 m from the one before, both in the ego frame of their time.
    pub label_jumps: u64,
}

impl ExpertStats {
    /// Adds the counts of another run.
    pub fn merge(&mut self, other: &Self) {
        self.decisions += other.decisions;
        self.far += other.far;
        self.avoid += other.avoid;
        self.relaxed += other.relaxed;
        self.last_resort += other.last_resort;
        self.failed += other.failed;
        self.label_jumps += other.label_jumps;
    }

    /// A count as a share of all decisions, 0…1.
    pub fn share(&self, count: u64) -> f64 {
        count as f64 / self.decisions.max(1) as f64
    }

    pub(crate) fn count(&mut self, rule: Rule, has_failed: bool, has_jumped: bool) {
        self.decisions += 1;
        match rule {
            Rule::Far => self.far += 1,
            Rule::Avoid => self.avoid += 1,
            Rule::Relaxed => self.relaxed += 1,
            Rule::LastResort => self.last_resort += 1,
        }
        self.failed += u64::from(has_failed);
        self.label_jumps += u64::from(has_jumped);
    }
}
