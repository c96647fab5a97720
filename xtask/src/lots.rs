//! Lots that can be named on the command line.

use anyhow::bail;
use scenarios::reference::{self, ReferenceLot};
use sim::scenario::Scenario;
use sim::seed::RootSeed;
use std::path::Path;

/// A lot, before a trial has drawn its obstacles.
#[derive(Debug, Clone)]
pub struct Lot {
    name: String,
    source: LotSource,
}

#[derive(Debug, Clone)]
enum LotSource {
    Reference(ReferenceLot),
    /// Written by hand: the same in every trial.
    File(Box<Scenario>),
}

/// Ways to name a lot: how it is written, what it means.
pub const SPECS: [(&str, &str); 4] = [
    ("lot-a", "the paper's training lot, 231 m, rebuilt"),
    ("lot-b", "139 m, the narrowest, never trained on"),
    ("lot-c", "149 m, the widest, never trained on"),
    ("PATH.toml", "a lot written by hand (cargo xtask generate writes examples)"),
];

impl Lot {
    /// Reads a spec.
    ///
    /// # Errors
    /// If nothing is named so, or a file does not describe a lot.
    pub fn parse(spec: &str) -> anyhow::Result<Self> {
        if let Some(which) = ReferenceLot::ALL.into_iter().find(|lot| lot.name() == spec) {
            return Ok(Self { name: spec.to_owned(), source: LotSource::Reference(which) });
        }
        let path = Path::new(spec);
        if path.extension().is_some_and(|extension| extension == "toml") {
            let scenario = scenarios::load::load(path)?;
            return Ok(Self { name: scenario.name.clone(), source: LotSource::File(Box::new(scenario)) });
        }
        let known: Vec<&str> = SPECS.iter().map(|(spec, _)| *spec).collect();
        bail!("no lot {spec:?}; there are {}", known.join(", "))
    }

    /// Reads several, each once.
    ///
    /// # Errors
    /// As [`Self::parse`].
    pub fn parse_all(specs: &[String]) -> anyhow::Result<Vec<Self>> {
        let mut lots: Vec<Self> = Vec::new();
        for spec in specs {
            let lot = Self::parse(spec)?;
            if lots.iter().any(|known| known.name == lot.name) {
                bail!("lot {:?} is named twice; results are told apart by name", lot.name);
            }
            lots.push(lot);
        }
        Ok(lots)
    }

    /// Name in tables.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The lot with the obstacles of a trial.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn scenario(&self, trial: RootSeed) -> anyhow::Result<Scenario> {
        match &self.source {
            LotSource::Reference(which) => Ok(reference::lot(*which, trial)),
            LotSource::File(scenario) => Ok((**scenario).clone()),
        }
    }
}
