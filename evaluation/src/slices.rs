//! Groups of lots that share a row of the tables, and slices that pool groups.

use experiment::lots::{ALL, UNSEEN};

/// Lots that share a row of the tables: a lot by itself, or all generated lots of one kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LotGroup {
    /// As [`experiment::lots::Lot::group`].
    pub name: String,
    /// Lots in it.
    pub lots: usize,
    /// Whether drivers were trained or tuned on it.
    pub is_trained_on: bool,
}

impl LotGroup {
    /// Its name in tables.
    pub fn label(&self) -> String {
        if self.lots == 1 { self.name.clone() } else { format!("{} ({} lots)", self.name, self.lots) }
    }
}

/// What a slice holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SliceKind {
    /// One group.
    Group,
    /// Several groups that no driver was trained or tuned on, and not all groups.
    Unseen,
    /// All groups, of several.
    All,
}

/// Groups of lots that are evaluated together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Slice {
    /// What it holds.
    pub kind: SliceKind,
    /// Its name in tables.
    pub label: String,
    groups: Vec<u32>,
}

impl Slice {
    /// Every group by itself; then all groups that no driver was trained or tuned on, and all groups, unless a slice has
    /// them already.
    pub fn all_of(groups: &[LotGroup]) -> Vec<Self> {
        let of = |kind: SliceKind, label: &str, wanted: &dyn Fn(usize) -> bool| Self {
            kind,
            label: label.to_owned(),
            groups: (0..groups.len()).filter(|&i| wanted(i)).map(|i| i as u32).collect(),
        };
        let mut slices: Vec<Self> =
            groups.iter().enumerate().map(|(i, f)| of(SliceKind::Group, &f.label(), &|j| i == j)).collect();
        let unseen = of(SliceKind::Unseen, UNSEEN, &|i| !groups[i].is_trained_on);
        if (2..groups.len()).contains(&unseen.groups.len()) {
            slices.push(unseen);
        }
        if groups.len() > 1 {
            slices.push(of(SliceKind::All, ALL, &|_| true));
        }
        slices
    }

    /// Whether it holds more than one group.
    pub fn is_pooled(&self) -> bool {
        self.groups.len() > 1
    }

    /// Whether a group belongs to it.
    pub fn contains(&self, group: u32) -> bool {
        self.groups.contains(&group)
    }
}
