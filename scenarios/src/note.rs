//! What a person should know about a lot that was imported, though nothing is wrong with it.

use sim::scenario::Scenario;
use std::path::PathBuf;

/// A lot from a file, what it was made of, and notes about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// The lot.
    pub scenario: Scenario,
    /// Every file that was read: the lot's own, the map's, its image, its route.
    pub files: Vec<PathBuf>,
    /// Notes in order of the work; none for a lot written by hand, whose junctions [`crate::load::junctions`] finds.
    pub notes: Vec<Note>,
    /// How its coordinates come from those of its map, in words; `None` if they are the same.
    pub frame: Option<String>,
    /// Whether it was written by hand, or by `cargo xtask generate`, and not made of a map.
    pub is_by_hand: bool,
}

/// Something an import did, or found. Places are metres in the map's own frame, or that of a lot written by hand.
#[derive(Debug, Clone, PartialEq)]
pub enum Note {
    /// The map is far from its origin, where single precision is too coarse: the lot's origin is this place.
    Recentred {
        /// The place of the lot's origin.
        origin: [f64; 2],
    },
    /// Occupied specks smaller than the smallest island were made as large as it.
    Padded {
        /// How many.
        specks: usize,
    },
    /// Things thinner than the sensor is sure to see were made thicker.
    Thickened {
        /// By how many pixels in all.
        pixels: usize,
    },
    /// Occupied specks were taken for free ground, because the lot asks for it.
    Dropped {
        /// How many.
        specks: usize,
        /// Up to this size, m² in the lot.
        up_to_m2: f64,
    },
    /// Keys of a map's YAML file mean nothing here.
    Unused {
        /// Which.
        keys: Vec<String>,
    },
    /// Grey pixels that map savers write for unknown ground count as free.
    UnknownIsFree {
        /// The map's threshold.
        free_thresh: f64,
    },
    /// The same in mode `scale`, whatever the threshold.
    UnknownIsScaled,
    /// Ways that leave the route were closed, because the lot asks for it.
    Closed {
        /// Where they leave it.
        mouths: Vec<[f64; 2]>,
    },
    /// Ways leave the route and go on.
    Open {
        /// Where they leave it.
        mouths: Vec<[f64; 2]>,
        /// Whether the lot asks for them to be closed: no kerb could be laid across these.
        is_asked_to_close: bool,
    },
    /// Ways leave the route of a lot written by hand and go on.
    OpenByHand {
        /// Where they leave it.
        mouths: Vec<[f64; 2]>,
    },
}

/// Places named in a note, at most.
const PLACES_MAX: usize = 6;

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let are = |count: usize, one: &str, more: &str| {
            if count == 1 { format!("1 {one}") } else { format!("{count} {more}") }
        };
        match self {
            Self::Recentred { origin: [x, y] } => {
                write!(f, "the map is far from its origin; (0, 0) of the lot is ({x}, {y}) of the map")
            }
            Self::Padded { specks } => write!(
                f,
                "{} of occupied pixels, too small for an island, made 10 cm large; drop_specks_m2 in NAME.lot.toml \
                 leaves out such specks",
                are(*specks, "speck", "specks")
            ),
            Self::Thickened { pixels } => write!(
                f,
                "what is thinner than 10 cm made thicker, by {} in all: the sensor would see it only in part",
                are(*pixels, "pixel", "pixels")
            ),
            Self::Dropped { specks, up_to_m2 } => write!(
                f,
                "{} of occupied pixels left out: drop_specks_m2 takes up to {up_to_m2} m² for free ground",
                are(*specks, "speck", "specks")
            ),
            Self::Unused { keys } => write!(
                f,
                "the map's YAML file has {}, which mean nothing here; known are image, resolution, origin, negate, \
                 occupied_thresh, free_thresh and mode",
                keys.iter().take(PLACES_MAX).map(|key| format!("{key:?}")).collect::<Vec<_>>().join(", ")
            ),
            Self::UnknownIsFree { free_thresh } => write!(
                f,
                "pixels of grey 205, which map savers write for unknown ground, count as free under free_thresh {free_thresh}, \
                 as in map_server; write free_thresh: 0.196 into the YAML file if they are unknown"
            ),
            Self::UnknownIsScaled => f.write_str(
                "pixels of grey 205, which map savers write for unknown ground, count as free in mode scale, where \
                 only transparent pixels are unknown; write mode: trinary and free_thresh: 0.196 into the YAML file if \
                 they are unknown",
            ),
            Self::Closed { mouths } => {
                write!(f, "{} closed with kerbs, near {}", are(mouths.len(), "branch", "branches"), listed(mouths))
            }
            Self::Open { mouths, is_asked_to_close: true } => f.write_str(&open(
                mouths,
                "no kerb closes what is left, which is too wide or too near to the route: draw walls into the map \
                 there",
            )),
            Self::Open { mouths, is_asked_to_close: false } => f.write_str(&open(
                mouths,
                "close_branches = true (--close-branches of cargo xtask generate) closes branches with kerbs",
            )),
            Self::OpenByHand { mouths } => f.write_str(&open(
                mouths,
                "close them with islands or obstacles; of a map, cargo xtask generate --close-branches writes a lot \
                 with kerbs there",
            )),
        }
    }
}

fn open(mouths: &[[f64; 2]], remedy: &str) -> String {
    let junctions = if mouths.len() == 1 { "1 junction".to_owned() } else { format!("{} junctions", mouths.len()) };
    let places = listed(mouths);
    format!("the route has {junctions}, near {places}: drivers do not see the route and may turn off there; {remedy}")
}

fn listed(places: &[[f64; 2]]) -> String {
    let named: Vec<_> = places.iter().take(PLACES_MAX).map(|[x, y]| format!("({x:.1}, {y:.1})")).collect();
    let more = places.len().saturating_sub(PLACES_MAX);
    named.join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
}
