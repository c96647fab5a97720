//! What a person should know about a lot that was imported, though nothing is wrong with it.

use crate::branches::KERBS_MAX;
use sim::scenario::Scenario;
use std::path::PathBuf;

/// A lot from a file, what it was made of, and notes about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// The lot.
    pub scenario: Scenario,
    /// Every file that was read: the lot's own, the map's, its image, its route.
    pub files: Vec<PathBuf>,
    /// Notes in order of the work; none for a lot written by hand, whose junctions and short cuts
    /// [`crate::load::junctions`] finds.
    pub notes: Vec<Note>,
    /// How its coordinates come from those of its map, in words; `None` if they are the same.
    pub frame: Option<String>,
    /// Whether it was written by hand, or by `cargo xtask generate`, and not made of a map.
    pub is_by_hand: bool,
}

/// A way that leads from a route back to it and is much shorter than the route between.
#[derive(Debug, Clone, PartialEq)]
pub struct ShortCut {
    /// Its middle, as the places of the note.
    pub middle: [f64; 2],
    /// The places of the route that it joins, metres of the lot from the start, the nearer one first.
    pub joins_m: [f32; 2],
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
    /// Ways lead from the route back to it and are much shorter than the route between.
    ShortCuts {
        /// Where, and from where to where.
        short_cuts: Vec<ShortCut>,
        /// Whether the lot asks for them to be closed: no kerb could be laid across these.
        is_asked_to_close: bool,
    },
    /// The same in a lot written by hand.
    ShortCutsByHand {
        /// Where, and from where to where.
        short_cuts: Vec<ShortCut>,
    },
}

/// Places named in a note, at most.
const PLACES_MAX: usize = 6;
/// What helps against ways on a map.
const LAY_KERBS: &str = "close_branches = true (--close-branches of cargo xtask generate) closes such ways with kerbs";
/// What helps against ways in a lot written by hand.
const CLOSE_BY_HAND: &str = "close them with islands or obstacles; of a map, cargo xtask generate --close-branches \
                             writes a lot with kerbs there";

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
                "{} of occupied pixels, too small for an island, made 10 cm large; drop_specks_m2 (--drop-specks of cargo \
                 xtask generate) leaves out such specks",
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
                "the map's YAML file has {}, which {} nothing here; known are image, resolution, origin, negate, \
                 occupied_thresh, free_thresh and mode",
                first_of(keys, |key| format!("{key:?}")),
                if keys.len() == 1 { "means" } else { "mean" }
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
            Self::Open { mouths, is_asked_to_close } => f.write_str(&open(mouths, &on_a_map(*is_asked_to_close))),
            Self::OpenByHand { mouths } => f.write_str(&open(mouths, CLOSE_BY_HAND)),
            Self::ShortCuts { short_cuts, is_asked_to_close } => {
                f.write_str(&shorter(short_cuts, &on_a_map(*is_asked_to_close)))
            }
            Self::ShortCutsByHand { short_cuts } => f.write_str(&shorter(short_cuts, CLOSE_BY_HAND)),
        }
    }
}

fn on_a_map(is_asked_to_close: bool) -> String {
    if !is_asked_to_close {
        return LAY_KERBS.to_owned();
    }
    format!(
        "no kerb closes what is left, which is too wide, too near to the route, or beyond {KERBS_MAX} kerbs: draw walls into \
         the map there"
    )
}

fn open(mouths: &[[f64; 2]], remedy: &str) -> String {
    let junctions = if mouths.len() == 1 { "1 junction".to_owned() } else { format!("{} junctions", mouths.len()) };
    let places = listed(mouths);
    format!("the route has {junctions}, near {places}: drivers do not see the route and may turn off there; {remedy}")
}

fn shorter(short_cuts: &[ShortCut], remedy: &str) -> String {
    let count =
        if short_cuts.len() == 1 { "1 short cut".to_owned() } else { format!("{} short cuts", short_cuts.len()) };
    let said = |ShortCut { middle: [x, y], joins_m: [from_m, to_m] }: &ShortCut| {
        format!("near ({x:.1}, {y:.1}) from metre {from_m:.0} to metre {to_m:.0}")
    };
    let places = first_of(short_cuts, said);
    format!("the route has {count}, {places}: drivers do not see the route and may take the shorter way; {remedy}")
}

fn listed(places: &[[f64; 2]]) -> String {
    first_of(places, |[x, y]| format!("({x:.1}, {y:.1})"))
}

/// As many of a list as are named in a note, and how many are not.
fn first_of<T>(list: &[T], said: impl Fn(&T) -> String) -> String {
    let named: Vec<_> = list.iter().take(PLACES_MAX).map(said).collect();
    let more = list.len().saturating_sub(PLACES_MAX);
    named.join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
}
