//! How noise is named: a level, or a multiple of the level `paper`.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use sim::scenario::NoiseLevel;
use sim::sensing::noise::NoiseSettings;
use std::fmt;
use std::str::FromStr;

/// Sensor noise of an episode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseChoice {
    /// None.
    Clean,
    /// About 98 % of the pixels right.
    Paper,
    /// Twice the errors of `paper`.
    Hard,
    /// The level the lot asks for.
    Lot,
    /// So many times the errors of `paper`, 0…[`NOISE_MAX`].
    Times(f64),
}

/// The strongest noise that can be asked for, in multiples of `paper`: far beyond what anybody drives through.
pub const NOISE_MAX: f64 = 10.0;

/// Levels with a name.
const NAMED: [(&str, NoiseChoice); 4] = [
    ("clean", NoiseChoice::Clean),
    ("paper", NoiseChoice::Paper),
    ("hard", NoiseChoice::Hard),
    ("lot", NoiseChoice::Lot),
];

impl NoiseChoice {
    /// What `episode.noise.intensity` is multiplied with, on a lot that asks for a level.
    pub fn intensity(self, of_lot: NoiseLevel) -> f32 {
        let of = |level| NoiseSettings::of(level).intensity;
        match self {
            Self::Clean => of(NoiseLevel::Clean),
            Self::Paper => of(NoiseLevel::Paper),
            Self::Hard => of(NoiseLevel::Hard),
            Self::Lot => of(of_lot),
            Self::Times(times) => times as f32,
        }
    }

    /// Multiple of `paper`, for the abscissa of a sweep; `None` if lots differ.
    pub fn times_paper(self) -> Option<f64> {
        (self != Self::Lot).then(|| f64::from(self.intensity(NoiseLevel::Clean)))
    }

    /// Whether another is the same however it is named: `hard` is twice `paper`.
    pub fn is_same_as(self, other: Self) -> bool {
        self == other || self.times_paper().is_some_and(|times| other.times_paper() == Some(times))
    }

    /// Its name in tables: [`Self::from_str`] reads it back.
    pub fn name(self) -> String {
        self.to_string()
    }

    fn times(times: f64) -> Result<Self, String> {
        if (0.0..=NOISE_MAX).contains(&times) {
            Ok(Self::Times(times))
        } else {
            Err(format!("noise {times} is not within 0 (clean) … {NOISE_MAX} times the level paper"))
        }
    }
}

impl fmt::Display for NoiseChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Times(times) => write!(f, "{times}"),
            named => f.pad(NAMED.iter().find(|(_, choice)| choice == named).map_or("", |(name, _)| name)),
        }
    }
}

impl FromStr for NoiseChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some((_, choice)) = NAMED.iter().find(|(name, _)| *name == text) {
            return Ok(*choice);
        }
        let times =
            text.parse().map_err(|_| format!("no noise {text:?}; there are clean, paper, hard, lot, or a number"))?;
        Self::times(times)
    }
}

impl Serialize for NoiseChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Times(times) => serializer.serialize_f64(*times),
            named => serializer.collect_str(named),
        }
    }
}

impl<'de> Deserialize<'de> for NoiseChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Visitor)
    }
}

struct Visitor;

impl de::Visitor<'_> for Visitor {
    type Value = NoiseChoice;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"clean\", \"paper\", \"hard\", \"lot\" or a multiple of paper")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<NoiseChoice, E> {
        let named = NAMED.iter().find(|(name, _)| *name == text).map(|(_, choice)| *choice);
        named.ok_or_else(|| E::unknown_variant(text, &["clean", "paper", "hard", "lot"]))
    }

    fn visit_f64<E: de::Error>(self, times: f64) -> Result<NoiseChoice, E> {
        NoiseChoice::times(times).map_err(E::custom)
    }

    fn visit_i64<E: de::Error>(self, times: i64) -> Result<NoiseChoice, E> {
        self.visit_f64(times as f64)
    }

    fn visit_u64<E: de::Error>(self, times: u64) -> Result<NoiseChoice, E> {
        self.visit_f64(times as f64)
    }
}

/// Reads one level or a list of them.
pub(super) fn one_or_many<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<NoiseChoice>, D::Error> {
    struct OneOrMany;

    impl<'de> de::Visitor<'de> for OneOrMany {
        type Value = Vec<NoiseChoice>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a noise level or a list of them")
        }

        fn visit_str<E: de::Error>(self, text: &str) -> Result<Self::Value, E> {
            Visitor.visit_str(text).map(|choice| vec![choice])
        }

        fn visit_f64<E: de::Error>(self, times: f64) -> Result<Self::Value, E> {
            Visitor.visit_f64(times).map(|choice| vec![choice])
        }

        fn visit_i64<E: de::Error>(self, times: i64) -> Result<Self::Value, E> {
            Visitor.visit_i64(times).map(|choice| vec![choice])
        }

        fn visit_seq<A: de::SeqAccess<'de>>(self, sequence: A) -> Result<Self::Value, A::Error> {
            Deserialize::deserialize(de::value::SeqAccessDeserializer::new(sequence))
        }
    }

    deserializer.deserialize_any(OneOrMany)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back_and_nonsense_is_refused() {
        for name in ["clean", "paper", "hard", "lot", "0.25", "1.5", "2"] {
            assert_eq!(name.parse::<NoiseChoice>().unwrap().name(), name);
        }
        for wrong in ["papr", "-1", "11", "nan", ""] {
            assert!(wrong.parse::<NoiseChoice>().is_err(), "{wrong:?}");
        }
        assert_eq!(NoiseChoice::Hard.times_paper(), Some(2.0));
        assert_eq!(NoiseChoice::Lot.times_paper(), None);
        assert_eq!(NoiseChoice::Lot.intensity(NoiseLevel::Hard), 2.0);
    }
}
