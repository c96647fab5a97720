//! Names of the layers.

use serde::{Deserialize, Serialize};

/// What makes a part of the view wrong: the layers of [`NoiseSettings`](super::NoiseSettings).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layer {
    /// Ragged boundaries.
    Boundary,
    /// Shadows taken for obstacles.
    Shadow,
    /// Edges of speed bumps taken for curbs.
    SpeedBump,
    /// Ground behind a boundary taken for road.
    FalseFree,
    /// Misrecognised patches that come and go.
    Blob,
    /// Stains and paint.
    Stain,
    /// Patches of one or two frames.
    Flicker,
    /// The last grid repeated.
    Dropout,
}

impl Layer {
    /// Every layer, in the order of [`NoiseSettings`](super::NoiseSettings).
    pub const ALL: [Self; 8] = [
        Self::Boundary,
        Self::Shadow,
        Self::SpeedBump,
        Self::FalseFree,
        Self::Blob,
        Self::Stain,
        Self::Flicker,
        Self::Dropout,
    ];

    /// Its name in legends.
    pub fn name(self) -> &'static str {
        match self {
            Self::Boundary => "boundary",
            Self::Shadow => "shadow",
            Self::SpeedBump => "speed bump",
            Self::FalseFree => "false free",
            Self::Blob => "blob",
            Self::Stain => "stain",
            Self::Flicker => "flicker",
            Self::Dropout => "dropout",
        }
    }
}
