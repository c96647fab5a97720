//! The first look: which views there are, and what they show.

use serde::{Deserialize, Serialize};

/// A part of the window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Layout {
    /// Side by side, each with its share of the width.
    Columns(Vec<(f32, Layout)>),
    /// One below the other, each with its share of the height.
    Rows(Vec<(f32, Layout)>),
    /// One behind the other; the first is shown.
    Tabs(Vec<Layout>),
    /// A view.
    View(View),
}

/// A view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// Its title.
    pub name: String,
    /// What it draws.
    pub kind: ViewKind,
    /// Entity paths, `/**` at the end for all below; `-` before one leaves it out.
    pub contents: Vec<String>,
    /// Entities of which everything up to now is shown, not the latest only.
    pub trails: Vec<String>,
}

/// What a view draws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ViewKind {
    /// The scene in space.
    Scene(Eye),
    /// A picture.
    Picture,
    /// Signals over time, with the range of their axis.
    Signals {
        /// Lowest and highest value; as found if `None`.
        range: Option<[f64; 2]>,
    },
    /// States over time.
    States,
    /// A log.
    Log,
    /// A text.
    Document,
}

/// From where the scene is seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Eye {
    /// Of the eye; in the frame of `follows`, if set.
    pub position: [f32; 3],
    /// What it looks at.
    pub target: [f32; 3],
    /// Direction that is up on the screen.
    pub up: [f32; 3],
    /// Entity the eye moves with.
    pub follows: Option<String>,
}

impl Layout {
    /// All views, from left to right and from top to bottom.
    pub fn views(&self) -> Vec<&View> {
        match self {
            Self::Columns(parts) | Self::Rows(parts) => parts.iter().flat_map(|(_, part)| part.views()).collect(),
            Self::Tabs(parts) => parts.iter().flat_map(Self::views).collect(),
            Self::View(view) => vec![view],
        }
    }
}

impl From<View> for Layout {
    fn from(view: View) -> Self {
        Self::View(view)
    }
}
