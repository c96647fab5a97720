//! Whose action smoothing drives: each driver's own, or the same for all.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::fmt;
use std::str::FromStr;

/// Action smoothing of an evaluation's drivers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Smoothing {
    /// Networks as they were trained, experts and planners none.
    Own,
    /// The same for every driver: time constant in control ticks, 0 or more; 0 = none.
    Ticks(f32),
}

const OWN: &str = "own";

impl fmt::Display for Smoothing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Own => f.write_str(OWN),
            Self::Ticks(ticks) => write!(f, "{ticks}"),
        }
    }
}

impl FromStr for Smoothing {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == OWN {
            return Ok(Self::Own);
        }
        let ticks = text.parse().ok().filter(|ticks: &f32| ticks.is_finite() && *ticks >= 0.0);
        ticks.map(Self::Ticks).ok_or_else(|| format!("no smoothing {text:?}; it is own, or control ticks from 0 on"))
    }
}

impl Serialize for Smoothing {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Own => serializer.serialize_str(OWN),
            Self::Ticks(ticks) => serializer.serialize_f32(*ticks),
        }
    }
}

impl<'de> Deserialize<'de> for Smoothing {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;

        impl de::Visitor<'_> for Visitor {
            type Value = Smoothing;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"own\" or control ticks")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Smoothing, E> {
                text.parse().map_err(E::custom)
            }

            fn visit_f64<E: de::Error>(self, ticks: f64) -> Result<Smoothing, E> {
                self.visit_str(&ticks.to_string())
            }

            fn visit_i64<E: de::Error>(self, ticks: i64) -> Result<Smoothing, E> {
                self.visit_str(&ticks.to_string())
            }
        }

        deserializer.deserialize_any(Visitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_is_read_back_and_nonsense_is_refused() {
        for text in ["own", "0", "3.5"] {
            assert_eq!(text.parse::<Smoothing>().unwrap().to_string(), text);
        }
        for wrong in ["on", "-1", "nan", ""] {
            assert!(wrong.parse::<Smoothing>().is_err(), "{wrong:?}");
        }
    }
}
