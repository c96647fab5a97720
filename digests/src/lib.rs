//! The same bytes everywhere: digests of lots and of episodes, equal on every platform.
//!
//! An episode is digested in four layers of the loop from tick to tick: what was observed, what was decided, where the car
//! went, what was measured. `tests/goldens.toml` keeps the digests by stretches of ticks (0, 1, 2–3, 4–7, …), so that a
//! difference can be told by when runs part and which layer does so first.
//!
//! Nothing here needs a network, a file or threads (where there are none, rayon drives everything on the one there is), so that
//! it compiles for whatever Rust compiles for; the program of this crate drives [all of them](drive_all) and compares.
//! `tests/goldens.rs` drives networks too.

mod cases;
mod episode;

pub use cases::{Case, Scene, drive_all, lot_c};
pub use episode::drive;

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Digests that are kept.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goldens {
    /// Digests of the files of generated lots, by name.
    pub lots: BTreeMap<String, String>,
    /// Digests of episodes, by case.
    pub episodes: BTreeMap<String, Golden>,
}

/// Digests of one episode: a word per stretch of ticks in every layer.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Golden {
    /// What was seen.
    pub observations: String,
    /// What was answered.
    pub decisions: String,
    /// Where the car went.
    pub trajectory: String,
    /// What was measured.
    pub metrics: String,
}

impl Goldens {
    /// Those of `tests/goldens.toml`, as they were when this was compiled.
    ///
    /// # Errors
    /// If that is not a file of goldens.
    pub fn kept() -> Result<Self, toml::de::Error> {
        toml::from_str(include_str!("../../tests/goldens.toml"))
    }

    /// What is different, was not kept or was not driven, a line each.
    pub fn differences(&self, driven: &Self) -> Vec<String> {
        let of_lot = |(name, digest): (&String, &String)| {
            let kept = self.lots.get(name);
            (kept != Some(digest)).then(|| format!("lot {name}: {digest}, not {}", kept.map_or("kept", String::as_str)))
        };
        let of_episode = |(case, golden): (&String, &Golden)| {
            let kept = self.episodes.get(case).cloned().unwrap_or_default();
            kept.difference(golden).map(|difference| format!("{case}: {difference}"))
        };
        let lots_left = self.lots.keys().filter(|name| !driven.lots.contains_key(*name));
        let episodes_left = self.episodes.keys().filter(|case| !driven.episodes.contains_key(*case));
        (driven.lots.iter().filter_map(of_lot))
            .chain(driven.episodes.iter().filter_map(of_episode))
            .chain(lots_left.chain(episodes_left).map(|name| format!("{name}: is kept, but not made any more")))
            .collect()
    }
}

impl Golden {
    /// The layers in the order of the loop: the one that changes first is the cause.
    fn layers(&self) -> [(&'static str, &str); 4] {
        [
            ("observations", &self.observations),
            ("decisions", &self.decisions),
            ("trajectory", &self.trajectory),
            ("metrics", &self.metrics),
        ]
    }

    /// Where another run parts from this one; `None` if it does not.
    pub fn difference(&self, other: &Self) -> Option<String> {
        let words =
            |golden: &Self| golden.layers().map(|(_, words)| words.split(' ').map(str::to_owned).collect::<Vec<_>>());
        let (ours, theirs) = (words(self), words(other));
        let n = ours.iter().chain(&theirs).map(Vec::len).max().unwrap_or(0);
        let stretch = (0..n).find(|&i| (0..4).any(|layer| ours[layer].get(i) != theirs[layer].get(i)))?;
        let names: Vec<&str> = (0..4)
            .filter(|&layer| ours[layer].get(stretch) != theirs[layer].get(stretch))
            .map(|layer| self.layers()[layer].0)
            .collect();
        let (first, last) = ticks_of(stretch);
        let since = if first == last { format!("at tick {first}") } else { format!("in ticks {first} to {last}") };
        Some(format!("{} changed first, {since} (there: {})", names[0], names.join(", ")))
    }
}

/// First and last tick of a stretch.
fn ticks_of(stretch: usize) -> (usize, usize) {
    let first = if stretch == 0 { 0 } else { 1 << (stretch - 1) };
    (first, (1_usize << stretch) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_names_the_first_layer_and_its_ticks() {
        let golden = |decisions: &str, trajectory: &str| Golden {
            observations: "a b c d".to_owned(),
            decisions: decisions.to_owned(),
            trajectory: trajectory.to_owned(),
            metrics: "a b c d".to_owned(),
        };
        let kept = golden("a b c d", "a b c d");
        assert_eq!(kept.difference(&kept.clone()), None);
        let at_once = kept.difference(&golden("a b c d", "x x x x"));
        assert_eq!(at_once.as_deref(), Some("trajectory changed first, at tick 0 (there: trajectory)"));
        let later = kept.difference(&golden("a b c x", "a b c x"));
        assert_eq!(later.as_deref(), Some("decisions changed first, in ticks 4 to 7 (there: decisions, trajectory)"));
        let shorter = kept.difference(&golden("a b c", "a b c d"));
        assert!(shorter.is_some_and(|text| text.starts_with("decisions changed first, in ticks 4 to 7")));
    }

    #[test]
    fn lots_and_episodes_that_changed_or_are_missing_are_named() {
        let lots = |digest: &str| BTreeMap::from([("lot".to_owned(), digest.to_owned())]);
        let kept = Goldens { lots: lots("1"), ..Goldens::default() };
        assert_eq!(kept.differences(&kept), Vec::<String>::new());
        assert_eq!(kept.differences(&Goldens { lots: lots("2"), ..Goldens::default() }), ["lot lot: 2, not 1"]);
        assert_eq!(kept.differences(&Goldens::default()), ["lot: is kept, but not made any more"]);
        assert_eq!(Goldens::default().differences(&kept), ["lot lot: 1, not kept"]);
    }
}
