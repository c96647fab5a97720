//! Drivers that can be named on the command line.

use crate::run_dir;
use crate::settings::Settings;
use anyhow::{Context as _, bail, ensure};
use expert::ScriptedExpert;
use planners::{Baseline, Planner, PlannerContext};
use policy::checkpoint::Checkpoint;
use policy::drivers::NetFleet;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::driver::{Decision, Driver, Fleet, Seat, SensorsOnly, Source};
use std::path::{Path, PathBuf};

/// The planners with the parameters that `cargo xtask tune` found: how they are named, and the file it wrote.
const TUNED: [(&str, &str); 6] = [
    ("tuned:tentacle", include_str!("../tuned/tentacle.toml")),
    ("tuned:vvf", include_str!("../tuned/vvf.toml")),
    ("tuned:dwa", include_str!("../tuned/dwa.toml")),
    ("tuned:cvm", include_str!("../tuned/cvm.toml")),
    ("tuned:apf", include_str!("../tuned/apf.toml")),
    ("tuned:vff", include_str!("../tuned/vff.toml")),
];

/// Ways to name a driver: how it is written, what it means.
pub fn specs() -> Vec<(&'static str, &'static str)> {
    let mut specs = vec![
        ("expert", "the scripted teacher; sees the truth"),
        ("run:DIR", "the final policy of a training run"),
        ("run:DIR/bc", "its behaviour cloning"),
        ("net:DIR", "a network by the folder of its checkpoint, e.g. a run's round-03"),
    ];
    specs.extend(Baseline::all().iter().map(|baseline| (baseline.name(), baseline.about())));
    specs
        .extend(TUNED.map(|(spec, _)| (spec, "the same with the parameters found by cargo xtask tune (xtask/tuned/)")));
    specs
        .push(("NAME:FILE", "one of these planners with the parameters in a TOML file (cargo xtask tune writes them)"));
    specs
}

/// A driver by name.
#[derive(Debug, Clone)]
pub struct DriverSpec {
    /// In tables.
    pub name: String,
    kind: Kind,
}

#[derive(Debug, Clone)]
enum Kind {
    Expert,
    Network(Box<Checkpoint>),
    Baseline(Baseline),
}

impl DriverSpec {
    /// The scripted expert.
    pub fn expert() -> Self {
        Self { name: "expert".to_owned(), kind: Kind::Expert }
    }

    /// A trained network.
    pub fn network(name: &str, checkpoint: Checkpoint) -> Self {
        Self { name: name.to_owned(), kind: Kind::Network(Box::new(checkpoint)) }
    }

    /// A model-based planner.
    pub fn baseline(name: &str, baseline: Baseline) -> Self {
        Self { name: name.to_owned(), kind: Kind::Baseline(baseline) }
    }

    /// Who it is, as decisions say it.
    pub fn source(&self) -> Source {
        match &self.kind {
            Kind::Expert => Source::Expert,
            Kind::Network(_) => Source::Novice,
            Kind::Baseline(_) => Source::Planner,
        }
    }

    /// The same with another name in tables.
    #[must_use]
    pub fn renamed(self, name: &str) -> Self {
        Self { name: name.to_owned(), ..self }
    }

    /// Reads several specs.
    ///
    /// # Errors
    /// If nothing is named so, its files are not what they should be, or one is named twice.
    pub fn parse_all(specs: &[String]) -> anyhow::Result<Vec<Self>> {
        let mut contestants: Vec<Self> = Vec::new();
        for spec in specs {
            let is_known = contestants.iter().any(|contestant| contestant.name == *spec);
            ensure!(!is_known, "driver {spec:?} is named twice; results are told apart by name");
            contestants.push(Self::parse(spec)?);
        }
        Ok(contestants)
    }

    fn parse(spec: &str) -> anyhow::Result<Self> {
        if let Some(baseline) = baseline(spec)? {
            return Ok(Self::baseline(spec, baseline));
        }
        let folder: PathBuf = if spec == "expert" {
            return Ok(Self::expert());
        } else if let Some(run) = spec.strip_prefix("run:") {
            run_dir::policy_folder(Path::new(run)).with_context(|| format!("driver {spec:?}"))?
        } else if let Some(folder) = spec.strip_prefix("net:") {
            folder.into()
        } else {
            let known: Vec<&str> = specs().iter().map(|(spec, _)| *spec).collect();
            bail!("no driver {spec:?}; there are {}", known.join(", "))
        };
        ensure!(
            Checkpoint::exists(&folder),
            "driver {spec:?}: {} holds no model.safetensors; name the folder of a round, as in net:runs/NAME/round-03",
            folder.display()
        );
        let checkpoint = Checkpoint::load(&folder).with_context(|| format!("driver {spec:?}"))?;
        Ok(Self::network(spec, checkpoint))
    }

    /// Whether it can drive with these settings.
    ///
    /// # Errors
    /// If it was trained for another patch of ground.
    pub fn check(&self, settings: &Settings) -> anyhow::Result<()> {
        if let Kind::Network(checkpoint) = &self.kind {
            let shown = settings.episode.sensing.geometry;
            ensure!(
                checkpoint.geometry == shown,
                "driver {:?} was trained on {:?}, but episode.sensing.geometry is {shown:?}; use the settings it was \
                 trained with (--config RUN/settings.toml)",
                self.name,
                checkpoint.geometry
            );
        }
        Ok(())
    }

    /// A planner of its own that can be asked what it weighed; `None` for who is no planner.
    pub fn planner(&self, settings: &Settings) -> Option<Planner> {
        match &self.kind {
            Kind::Baseline(baseline) => Some(baseline.planner(&PlannerContext::of(&settings.episode))),
            Kind::Expert | Kind::Network(_) => None,
        }
    }

    /// Seats it in this many cars, which are driven in lock-step.
    pub fn fleet(&self, settings: &Settings, cars: usize) -> Box<dyn Fleet> {
        match &self.kind {
            Kind::Expert => Box::new(OneEach((0..cars).map(|_| expert(settings)).collect())),
            Kind::Network(checkpoint) => Box::new(NetFleet::new((**checkpoint).clone(), settings.dagger.device)),
            Kind::Baseline(baseline) => {
                let planner = baseline.planner(&PlannerContext::of(&settings.episode));
                Box::new(OneEach(vec![SensorsOnly(planner); cars]))
            }
        }
    }
}

/// Parameters of a planner on disk.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannerFile {
    /// Which planner they are for.
    pub planner: String,
    /// All of its parameters.
    pub parameters: toml::Table,
    /// How they were found; not read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<toml::Table>,
}

/// The file of a planner that ships with tuned parameters, by its spec.
pub fn tuned_file(spec: &str) -> Option<&'static str> {
    TUNED.iter().find(|(name, _)| *name == spec).map(|(_, text)| *text)
}

/// The planner that `NAME`, `tuned:NAME` or `NAME:FILE` names; `None` if no planner has that name.
fn baseline(spec: &str) -> anyhow::Result<Option<Baseline>> {
    if let Some(text) = tuned_file(spec) {
        let name = spec.trim_start_matches("tuned:");
        let baseline = Baseline::all().into_iter().find(|baseline| baseline.name() == name);
        let baseline = baseline.with_context(|| format!("no planner {name:?}"))?;
        return with_parameters(&baseline, text).with_context(|| format!("xtask/tuned/{name}.toml")).map(Some);
    }
    let (name, file) = spec.split_once(':').map_or((spec, None), |(name, file)| (name, Some(Path::new(file))));
    let Some(baseline) = Baseline::all().into_iter().find(|baseline| baseline.name() == name) else {
        return Ok(None);
    };
    let Some(path) = file else { return Ok(Some(baseline)) };
    let text = std::fs::read_to_string(path).with_context(|| {
        format!("{}: cannot be read; cargo xtask drivers {name} prints such a file", path.display())
    })?;
    let read = with_parameters(&baseline, &text);
    read.with_context(|| format!("{}: cargo xtask drivers {name} prints a complete file", path.display())).map(Some)
}

/// A planner with the parameters in the text of a [`PlannerFile`].
fn with_parameters(baseline: &Baseline, text: &str) -> anyhow::Result<Baseline> {
    let file: PlannerFile = toml::from_str(text)?;
    let name = baseline.name();
    ensure!(file.planner == name, "these are parameters of {:?}, but {name:?} is asked for", file.planner);
    let changed = baseline.with_parameters(file.parameters).context("parameters")?;
    changed.check().map_err(anyhow::Error::msg).context("parameters")?;
    Ok(changed)
}

/// A fresh expert.
pub fn expert(settings: &Settings) -> ScriptedExpert {
    ScriptedExpert::new(settings.expert.clone(), &settings.episode)
}

/// A driver per car, asked in parallel: each answers for its own car alone, so the order does not matter.
struct OneEach<D>(Vec<D>);

impl<D: Driver + Send> Fleet for OneEach<D> {
    fn decide(&mut self, seats: &[Seat<'_>], decisions: &mut Vec<Decision>) {
        let mut waiting = seats.iter().peekable();
        let mut asked: Vec<_> = self
            .0
            .iter_mut()
            .enumerate()
            .filter_map(|(episode, driver)| Some((driver, waiting.next_if(|seat| seat.episode == episode)?)))
            .collect();
        asked
            .par_iter_mut()
            .map(|(driver, seat)| {
                if seat.was_reset {
                    driver.reset();
                }
                driver.decide(&seat.situation)
            })
            .collect_into_vec(decisions);
    }
}
