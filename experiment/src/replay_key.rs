//! A short text that identifies one run and a control tick in it.
//!
//! ```text
//! run:runs/mine/bc@lot-b@reverse@3@paper@1@842
//! driver           lot   way     │ noise │ tick
//!                                trial   seed of the evaluation
//! ```
//!
//! Obstacles, noise and start follow from these parts ([`crate::trials`]) and the settings: replay with the
//! `settings.toml` of the folder that the key comes from. `@` and `%` within names are written `%40` and `%25`; what a shell
//! takes for its own in the name of a folder must be quoted.

use crate::drivers::DriverSpec;
use crate::settings::NoiseChoice;
use anyhow::{Context as _, bail, ensure};
use serde::{Deserialize, Serialize};
use sim::limits::TRIAL_MAX;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use std::fmt;
use std::str::FromStr;

/// One run, and a moment in it. Serialised as its text.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ReplayKey {
    /// The driver, as on the command line (`cargo xtask drivers`).
    pub driver: DriverSpec,
    /// The lot, as on the command line (`cargo xtask lots`); stands for a single lot.
    pub lot: String,
    /// Which way it was driven.
    pub direction: Direction,
    /// Which trial: with `seed` it decides obstacles and noise.
    pub trial: u32,
    /// Sensor noise.
    pub noise: NoiseChoice,
    /// Seed of the evaluation (`evaluation.seed`).
    pub seed: RootSeed,
    /// The control tick of interest, counted from 0; 0 where the whole run is meant.
    pub tick: u32,
}

impl fmt::Display for ReplayKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { driver, lot, direction, trial, noise, seed, tick } = self;
        let way = direction.name();
        write!(f, "{}@{}@{way}@{trial}@{noise}@{}@{tick}", escaped(&driver.to_string()), escaped(lot), seed.0)
    }
}

impl FromStr for ReplayKey {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let parts: Vec<&str> = text.split('@').collect();
        let [driver, lot, direction, trial, noise, seed, tick] = parts[..] else {
            bail!(
                "replay key {text:?} has {} parts, not the 7 of DRIVER@LOT@WAY@TRIAL@NOISE@SEED@TICK; copy a whole one from the \
                 failures.md or runs.jsonl of a run, as in expert@lot-b@reverse@3@paper@1@842",
                parts.len()
            );
        };
        let number = |what: &str, part: &str| {
            part.parse().with_context(|| format!("replay key {text:?}: {what} {part:?} is not a number"))
        };
        let direction = Direction::BOTH.into_iter().find(|&known| known.name() == direction).with_context(|| {
            format!("replay key {text:?}: no direction {direction:?}; there are forward and reverse")
        })?;
        let noise = noise.parse().map_err(|error| anyhow::anyhow!("replay key {text:?}: {error}"))?;
        ensure!(!driver.is_empty() && !lot.is_empty(), "replay key {text:?}: driver and lot have names");
        let small = |what, part| {
            u32::try_from(number(what, part)?)
                .with_context(|| format!("replay key {text:?}: {what} {part} is too large"))
        };
        let index = small("trial", trial)?;
        ensure!(index <= TRIAL_MAX, "replay key {text:?}: trial {index} is too large; there are 0 to {TRIAL_MAX}");
        Ok(Self {
            driver: unescaped(driver)
                .parse()
                .map_err(|error: anyhow::Error| anyhow::anyhow!("replay key {text:?}: {error:#}"))?,
            lot: unescaped(lot),
            direction,
            trial: index,
            noise,
            seed: RootSeed(number("seed", seed)?),
            tick: small("tick", tick)?,
        })
    }
}

impl TryFrom<String> for ReplayKey {
    type Error = anyhow::Error;

    fn try_from(text: String) -> anyhow::Result<Self> {
        text.parse()
    }
}

impl From<ReplayKey> for String {
    fn from(key: ReplayKey) -> Self {
        key.to_string()
    }
}

/// The driver of a key that is written down, as it was named.
pub fn driver_of(key: &str) -> String {
    unescaped(key.split('@').next().unwrap_or_default())
}

/// The lot of a key that is written down, as it was named.
pub fn lot_of(key: &str) -> String {
    unescaped(key.split('@').nth(1).unwrap_or_default())
}

fn escaped(name: &str) -> String {
    name.replace('%', "%25").replace('@', "%40").replace(' ', "%20")
}

fn unescaped(part: &str) -> String {
    part.replace("%20", " ").replace("%40", "@").replace("%25", "%")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_is_read_back() {
        for (driver, lot) in [
            ("expert", "lot-b"),
            ("run:runs/mine/bc", "test-hard-17"),
            ("net:my runs/50%@home/round-03", "lots/a%20b@c.toml"),
            ("tentacle:my%20parameters.toml", "%25"),
        ] {
            for noise in [NoiseChoice::Paper, NoiseChoice::Lot, NoiseChoice::Times(0.1)] {
                for direction in Direction::BOTH {
                    let key = ReplayKey {
                        driver: driver.parse().unwrap(),
                        lot: lot.to_owned(),
                        direction,
                        trial: 3,
                        noise,
                        seed: RootSeed(u64::MAX),
                        tick: 842,
                    };
                    let text = key.to_string();
                    assert_eq!(text.parse::<ReplayKey>().unwrap(), key, "{text}");
                    assert!(!text.contains(' '), "{text}");
                    assert_eq!(lot_of(&text), lot);
                }
            }
        }
    }

    #[test]
    fn the_form_is_the_documented_one() {
        let key: ReplayKey = "expert@lot-b@reverse@3@paper@1@842".parse().unwrap();
        assert_eq!((key.trial, key.seed, key.tick, key.noise), (3, RootSeed(1), 842, NoiseChoice::Paper));
        for (wrong, part) in [
            ("expert@lot-b", "7"),
            ("expert@lot-b@left@3@paper@1@842", "no direction \"left\""),
            ("expert@lot-b@reverse@x@paper@1@842", "trial \"x\""),
            ("expert@lot-b@reverse@3@loud@1@842", "no noise \"loud\""),
            ("expert@lot-b@reverse@3@paper@1@5000000000", "too large"),
            ("expert@lot-b@reverse@1048576@paper@1@0", "there are 0 to 1048575"),
        ] {
            let error = format!("{:#}", wrong.parse::<ReplayKey>().unwrap_err());
            assert!(error.contains(part), "{wrong}: {part:?} is missing in: {error}");
        }
    }
}
