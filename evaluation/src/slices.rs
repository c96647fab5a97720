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
    /// Indices, ascending.
    groups: Vec<u32>,
}

impl Slice {
    /// Every group by itself; then all groups that no driver was trained or tuned on, and all groups, unless a slice has
    /// them already.
    pub fn all_of(groups: &[LotGroup]) -> Vec<Self> {
        let of = |kind, label: String, groups| Self { kind, label, groups };
        let indexed = || (0..).zip(groups);
        let by_itself = |(index, group): (u32, &LotGroup)| of(SliceKind::Group, group.label(), vec![index]);
        let mut slices: Vec<Self> = indexed().map(by_itself).collect();
        let unseen: Vec<u32> = indexed().filter(|(_, group)| !group.is_trained_on).map(|(index, _)| index).collect();
        if (2..groups.len()).contains(&unseen.len()) {
            slices.push(of(SliceKind::Unseen, UNSEEN.to_owned(), unseen));
        }
        if groups.len() > 1 {
            slices.push(of(SliceKind::All, ALL.to_owned(), indexed().map(|(index, _)| index).collect()));
        }
        slices
    }

    /// Whether it holds more than one group.
    pub fn is_pooled(&self) -> bool {
        self.groups.len() > 1
    }

    /// Whether a group belongs to it.
    pub fn contains(&self, group: u32) -> bool {
        self.groups.binary_search(&group).is_ok()
    }

    /// Indices of the groups in it, ascending.
    pub(crate) fn groups(&self) -> &[u32] {
        &self.groups
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_group_is_a_slice_and_those_that_are_unseen_and_all_are() {
        let group = |index: u32| LotGroup { name: format!("lot {index}"), lots: 1, is_trained_on: index == 2 };
        let slices = Slice::all_of(&(0..5).map(group).collect::<Vec<_>>());
        let [first, .., unseen, all] = &slices[..] else { panic!("{} slices", slices.len()) };
        assert_eq!((slices.len(), first.kind, first.groups(), &*first.label), (7, SliceKind::Group, &[0][..], "lot 0"));
        assert_eq!((unseen.kind, unseen.groups()), (SliceKind::Unseen, &[0, 1, 3, 4][..]));
        assert_eq!((all.kind, all.groups()), (SliceKind::All, &[0, 1, 2, 3, 4][..]));
        let held: Vec<u32> = (0..6).filter(|&group| unseen.contains(group)).collect();
        assert_eq!(held, unseen.groups());
        assert_eq!(Slice::all_of(&[group(0)]).len(), 1, "one group is all of them");
        assert_eq!(Slice::all_of(&[group(0), group(2)]).len(), 3, "one unseen group has a slice already");
    }
}
