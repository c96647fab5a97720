//! Where to drive: the paper's three lots, generated lots and lots written by hand.

pub mod clutter;
pub mod corridor;
pub mod reference;
