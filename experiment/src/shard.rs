//! A share of a command's trials: several machines do one each.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// One of some shares, as `--shard 2/3` names it. What is shared out goes to them in turn, like cards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Shard {
    number: u32,
    of: u32,
}

impl Shard {
    /// Which, from 1.
    pub fn number(self) -> u32 {
        self.number
    }

    /// How many there are.
    pub fn of(self) -> u32 {
        self.of
    }

    /// Every share of as many.
    pub fn all(self) -> impl Iterator<Item = Self> {
        (1..=self.of).map(move |number| Self { number, ..self })
    }

    /// Whether the share has the piece at an index.
    pub fn takes(self, index: usize) -> bool {
        index as u64 % u64::from(self.of) == u64::from(self.number - 1)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((number, of)) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err(format!("no shard {text:?}; write NUMBER/OF, counted from 1, as in 1/3, 2/3 and 3/3")),
        }
    }
}

impl TryFrom<String> for Shard {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> Self {
        shard.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_piece_goes_to_one_shard_and_shares_differ_by_one_at_most() {
        let shards: Vec<Shard> = "1/3".parse::<Shard>().unwrap().all().collect();
        assert_eq!(shards.iter().map(Shard::to_string).collect::<Vec<_>>(), ["1/3", "2/3", "3/3"]);
        let share = |shard: &Shard| (0..10).filter(|&index| shard.takes(index)).collect::<Vec<_>>();
        assert_eq!(shards.iter().map(share).collect::<Vec<_>>(), [vec![0, 3, 6, 9], vec![1, 4, 7], vec![2, 5, 8]]);
    }

    #[test]
    fn what_is_no_shard_is_refused_with_how_to_write_one() {
        for wrong in ["", "3", "0/3", "4/3", "1/0", "-1/3", "1/3/3", "a/b", "1/99999999999"] {
            assert!(wrong.parse::<Shard>().unwrap_err().contains("as in 1/3"), "{wrong:?}");
        }
    }
}
