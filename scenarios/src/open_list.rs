//! What searches have found and not yet looked at.

use std::cmp::Ordering;

/// Queue entry: [`std::collections::BinaryHeap`] pops the smallest estimate first, ties in order of the nodes.
pub(crate) struct Open {
    pub(crate) estimate: f32,
    pub(crate) node: u32,
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Open {}
impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other.estimate.total_cmp(&self.estimate).then(other.node.cmp(&self.node))
    }
}
