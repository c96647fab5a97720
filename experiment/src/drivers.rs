//! Drivers: how they are named, and how they get to the wheel.

use crate::run_dir;
use anyhow::{Context as _, bail, ensure};
use expert::{ExpertSettings, ScriptedExpert};
use planners::{Planner, PlannerContext, PlannerSpec};
use policy::checkpoint::Checkpoint;
use policy::drivers::NetFleet;
use policy::network::DeviceChoice;
use serde::{Deserialize, Serialize};
use sim::driver::{Fleet, OneDriverEach, SensorsOnly, Source};
use sim::episode::EpisodeSettings;
use std::fmt::{self, Write as _};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use storage::sums;

/// Parameters that ship: the planner, and the file that `cargo xtask tune` wrote.
const TUNED: [(&str, &str); 6] = [
    ("tentacle", include_str!("../../planners/tuned/tentacle.toml")),
    ("vvf", include_str!("../../planners/tuned/vvf.toml")),
    ("dwa", include_str!("../../planners/tuned/dwa.toml")),
    ("cvm", include_str!("../../planners/tuned/cvm.toml")),
    ("apf", include_str!("../../planners/tuned/apf.toml")),
    ("vff", include_str!("../../planners/tuned/vff.toml")),
];

/// A driver as named on the command line; nothing is loaded yet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DriverSpec {
    /// `expert`: the scripted expert, which sees the truth.
    Expert,
    /// `run:DIR` and `run:DIR/bc`: a policy of a training run.
    Run {
        /// The folder as written, `/bc` included.
        folder: PathBuf,
    },
    /// `net:DIR`: a network by the folder of its checkpoint.
    Checkpoint {
        /// The folder.
        folder: PathBuf,
    },
    /// `NAME`, `tuned:NAME` or `NAME:FILE`: a model-based planner.
    Planner {
        /// Its name.
        name: String,
        /// Its parameters.
        parameters: Parameters,
    },
}

/// Where a planner's parameters come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Parameters {
    /// The paper's or the literature's.
    Published,
    /// Those that ship, found by `cargo xtask tune`.
    Tuned,
    /// A TOML file.
    File(PathBuf),
}

/// Ways to name a driver: how it is written, what it means.
pub fn specs() -> Vec<(&'static str, &'static str)> {
    let mut specs = vec![
        ("expert", "the scripted expert; sees the truth"),
        ("run:DIR", "the final policy of a training run"),
        ("run:DIR/bc", "its policy after behaviour cloning"),
        ("net:DIR", "a network by the folder of its checkpoint, e.g. a run's round-03"),
    ];
    specs.extend(PlannerSpec::all().iter().map(|planner| (planner.name(), planner.about())));
    specs.push(("tuned:NAME", "one of these planners with parameters found by cargo xtask tune (planners/tuned/)"));
    specs.push(("NAME:FILE", "one of these planners with parameters from a TOML file (cargo xtask tune writes them)"));
    specs
}

/// The planners with parameters that ship.
pub fn tuned_specs() -> Vec<String> {
    TUNED.iter().map(|(name, _)| format!("tuned:{name}")).collect()
}

impl FromStr for DriverSpec {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let is_planner = |name: &str| PlannerSpec::all().iter().any(|planner| planner.name() == name);
        let planner = |name: &str, parameters| Ok(Self::Planner { name: name.to_owned(), parameters });
        match text.split_once(':') {
            None if text == "expert" => Ok(Self::Expert),
            None if is_planner(text) => planner(text, Parameters::Published),
            Some(("run", folder)) => Ok(Self::Run { folder: folder.into() }),
            Some(("net", folder)) => Ok(Self::Checkpoint { folder: folder.into() }),
            Some(("tuned", name)) if is_planner(name) => planner(name, Parameters::Tuned),
            Some((name, file)) if is_planner(name) => planner(name, Parameters::File(file.into())),
            _ => {
                let path = Path::new(text);
                if path.join("settings.toml").is_file() {
                    bail!("no driver {text:?}; did you mean run:{text}?");
                }
                if Checkpoint::exists(path).is_ok_and(|exists| exists) {
                    bail!("no driver {text:?}; did you mean net:{text}?");
                }
                let known = if text.starts_with("tuned:") {
                    tuned_specs()
                } else {
                    specs().iter().map(|(spec, _)| (*spec).to_owned()).collect()
                };
                bail!("no driver {text:?}; there are {}", known.join(", "))
            }
        }
    }
}

impl fmt::Display for DriverSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Expert => f.write_str("expert"),
            Self::Run { folder } => write!(f, "run:{}", folder.display()),
            Self::Checkpoint { folder } => write!(f, "net:{}", folder.display()),
            Self::Planner { name, parameters: Parameters::Published } => f.write_str(name),
            Self::Planner { name, parameters: Parameters::Tuned } => write!(f, "tuned:{name}"),
            Self::Planner { name, parameters: Parameters::File(path) } => write!(f, "{name}:{}", path.display()),
        }
    }
}

impl DriverSpec {
    /// Reads several.
    ///
    /// # Errors
    /// If nothing is named so, or one is named twice.
    pub fn parse_all<S: AsRef<str>>(texts: &[S]) -> anyhow::Result<Vec<Self>> {
        let mut specs: Vec<Self> = Vec::new();
        for text in texts {
            let spec: Self = text.as_ref().parse()?;
            ensure!(!specs.contains(&spec), "driver {spec} is named twice; results are told apart by name");
            specs.push(spec);
        }
        Ok(specs)
    }

    /// Whether it is a learned policy.
    pub fn is_network(&self) -> bool {
        matches!(self, Self::Run { .. } | Self::Checkpoint { .. })
    }

    /// The training run it comes from; `/bc` is part of it.
    pub fn run(&self) -> Option<&Path> {
        match self {
            Self::Run { folder } => Some(folder),
            Self::Expert | Self::Checkpoint { .. } | Self::Planner { .. } => None,
        }
    }

    /// Reads the files it names.
    ///
    /// # Errors
    /// If they are not what they should be.
    pub fn load(self, expert: &ExpertSettings, device: DeviceChoice) -> anyhow::Result<NamedDriver> {
        let name = self.to_string();
        let in_driver = || format!("driver {name:?}");
        let model = match &self {
            Self::Expert => Model::Expert(expert.clone()),
            Self::Run { folder } => {
                let folder = run_dir::policy_folder(folder).with_context(in_driver)?;
                Model::Network(Box::new(Checkpoint::load(&folder).with_context(in_driver)?), device)
            }
            Self::Checkpoint { folder } => {
                ensure!(
                    Checkpoint::exists(folder).with_context(in_driver)?,
                    "driver {name:?}: {} lists no finished model.safetensors in sha256sums; name the folder of a round, as in \
                     net:runs/NAME/round-03",
                    folder.display()
                );
                Model::Network(Box::new(Checkpoint::load(folder).with_context(in_driver)?), device)
            }
            Self::Planner { name, parameters } => Model::Planner(planner(name, parameters)?),
        };
        Ok(NamedDriver { name, spec: self, model })
    }
}

/// A driver that can take the wheel.
#[derive(Debug, Clone)]
pub struct NamedDriver {
    /// In tables.
    pub name: String,
    /// As named on the command line, for replay keys.
    pub spec: DriverSpec,
    model: Model,
}

#[derive(Debug, Clone)]
enum Model {
    Expert(ExpertSettings),
    Network(Box<Checkpoint>, DeviceChoice),
    Planner(PlannerSpec),
}

impl NamedDriver {
    /// Reads several; each is named as it is written.
    ///
    /// # Errors
    /// If nothing is named so, its files are not what they should be, or one is named twice.
    pub fn load_all<S: AsRef<str>>(
        texts: &[S],
        expert: &ExpertSettings,
        device: DeviceChoice,
    ) -> anyhow::Result<Vec<Self>> {
        DriverSpec::parse_all(texts)?.into_iter().map(|spec| spec.load(expert, device)).collect()
    }

    /// The scripted expert.
    pub fn expert(settings: &ExpertSettings) -> Self {
        Self { name: "expert".to_owned(), spec: DriverSpec::Expert, model: Model::Expert(settings.clone()) }
    }

    /// A network that is loaded already.
    pub fn network(name: &str, spec: DriverSpec, checkpoint: Checkpoint, device: DeviceChoice) -> Self {
        Self { name: name.to_owned(), spec, model: Model::Network(Box::new(checkpoint), device) }
    }

    /// A planner with parameters of the caller's.
    pub fn planner(planner: PlannerSpec) -> Self {
        let name = planner.name().to_owned();
        let spec = DriverSpec::Planner { name: name.clone(), parameters: Parameters::Published };
        Self { name, spec, model: Model::Planner(planner) }
    }

    /// The same with another name in tables.
    #[must_use]
    pub fn renamed(self, name: &str) -> Self {
        Self { name: name.to_owned(), ..self }
    }

    /// SHA-256 of what its files say; `None` for one that ships.
    pub fn digest(&self) -> Option<String> {
        match (&self.model, &self.spec) {
            (Model::Network(checkpoint, _), _) => {
                let about = format!("{:?} {:?}", checkpoint.geometry, checkpoint.inference);
                let weights = checkpoint.weights.values().iter().flat_map(|value| value.to_le_bytes());
                Some(sums::digest(&about.into_bytes().into_iter().chain(weights).collect::<Vec<u8>>()))
            }
            (Model::Planner(planner), DriverSpec::Planner { parameters: Parameters::File(_), .. }) => {
                Some(sums::digest(planner.parameters().to_string().as_bytes()))
            }
            (Model::Expert(_) | Model::Planner(_), _) => None,
        }
    }

    /// Who it is, as decisions say it.
    pub fn source(&self) -> Source {
        match &self.model {
            Model::Expert(_) => Source::Expert,
            Model::Network(..) => Source::Novice,
            Model::Planner(_) => Source::Planner,
        }
    }

    /// Whether it can drive with these settings.
    ///
    /// # Errors
    /// If it was trained for another patch of ground.
    pub fn check(&self, episode: &EpisodeSettings) -> anyhow::Result<()> {
        if let Model::Network(checkpoint, _) = &self.model {
            let shown = episode.sensing.geometry;
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
    pub fn to_planner(&self, episode: &EpisodeSettings) -> Option<Planner> {
        match &self.model {
            Model::Planner(planner) => Some(planner.planner(&PlannerContext::of(episode))),
            Model::Expert(_) | Model::Network(..) => None,
        }
    }

    /// How many of some cars, which are driven in lock-step, one fleet drives best: on CPUs a network answers for a thread's
    /// share of them in one call, on a GPU for all; others answer for each car alone.
    pub fn cars_per_fleet(&self, cars: usize) -> usize {
        match self.model {
            Model::Network(_, device) if device != DeviceChoice::default() => cars.max(1),
            Model::Network(..) => cars.div_ceil(rayon::current_num_threads()).max(1),
            Model::Expert(_) | Model::Planner(_) => 1,
        }
    }

    /// Seats it in this many cars, which are driven in lock-step.
    pub fn fleet(&self, episode: &EpisodeSettings, cars: usize) -> Box<dyn Fleet + Send> {
        match &self.model {
            Model::Expert(settings) => Box::new(OneDriverEach((0..cars).map(|_| expert(settings, episode)).collect())),
            Model::Network(checkpoint, device) => Box::new(NetFleet::new(checkpoint, *device)),
            Model::Planner(planner) => {
                let planner = planner.planner(&PlannerContext::of(episode));
                Box::new(OneDriverEach(vec![SensorsOnly(planner); cars]))
            }
        }
    }
}

/// A fresh expert.
pub fn expert(settings: &ExpertSettings, episode: &EpisodeSettings) -> ScriptedExpert {
    ScriptedExpert::new(settings.clone(), episode)
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

impl PlannerFile {
    /// The text of the file for a spec, as `cargo xtask drivers SPEC` prints it.
    ///
    /// # Errors
    /// If no planner is named so.
    pub fn text_of(spec: &str) -> anyhow::Result<String> {
        if let Some((_, text)) = spec.strip_prefix("tuned:").and_then(|name| TUNED.iter().find(|(of, _)| *of == name)) {
            return Ok((*text).to_owned());
        }
        let planner = published(spec)?;
        let mut text = format!("# {}\n", planner.about());
        for (parameter, span) in planner.search_space() {
            let _ = writeln!(text, "# cargo xtask tune searches {parameter}: {span}");
        }
        let file = Self { planner: spec.to_owned(), parameters: planner.parameters(), search: None };
        Ok(text + "\n" + &toml::to_string(&file)?)
    }
}

fn published(name: &str) -> anyhow::Result<PlannerSpec> {
    let planners = PlannerSpec::all();
    let names: Vec<&str> = planners.iter().map(PlannerSpec::name).collect();
    let known = names.join(", ");
    planners
        .into_iter()
        .find(|planner| planner.name() == name)
        .with_context(|| format!("no planner {name:?}; there are {known}"))
}

fn planner(name: &str, parameters: &Parameters) -> anyhow::Result<PlannerSpec> {
    let planner = published(name)?;
    match parameters {
        Parameters::Published => Ok(planner),
        Parameters::Tuned => {
            let text = TUNED.iter().find(|(of, _)| *of == name).map(|(_, text)| *text);
            let text = text.with_context(|| format!("no tuned parameters ship for {name:?}"))?;
            with_parameters(&planner, text).with_context(|| format!("planners/tuned/{name}.toml"))
        }
        Parameters::File(path) => {
            let text = std::fs::read_to_string(path).with_context(|| {
                format!("{}: cannot be read; cargo xtask drivers {name} prints such a file", path.display())
            })?;
            with_parameters(&planner, &text)
                .with_context(|| format!("{}: cargo xtask drivers {name} prints a complete file", path.display()))
        }
    }
}

/// A planner with the parameters in the text of a [`PlannerFile`].
fn with_parameters(planner: &PlannerSpec, text: &str) -> anyhow::Result<PlannerSpec> {
    let file: PlannerFile = toml::from_str(text)?;
    let name = planner.name();
    ensure!(file.planner == name, "these are parameters of {:?}, but {name:?} is asked for", file.planner);
    let changed = planner.with_parameters(file.parameters).context("parameters")?;
    changed.check().map_err(anyhow::Error::msg).context("parameters")?;
    Ok(changed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spec_is_read_back() {
        for text in ["expert", "run:runs/mine/bc", "net:runs/mine/round-03", "tentacle", "tuned:vvf", "dwa:my/dwa.toml"]
        {
            assert_eq!(text.parse::<DriverSpec>().unwrap().to_string(), text);
        }
        for (wrong, known) in [
            ("exprt", "there are expert, run:DIR"),
            ("", "there are expert, run:DIR"),
            ("runs/mine", "there are expert, run:DIR"),
            ("tuned:tentacles", "there are tuned:tentacle, tuned:vvf"),
        ] {
            let error = wrong.parse::<DriverSpec>().unwrap_err().to_string();
            assert!(error.contains(known), "{wrong:?}: {error}");
        }
    }

    #[test]
    fn a_run_folder_alone_is_no_driver_but_says_which_one() {
        let folder = std::env::temp_dir().join(format!("lotpilot-spec-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("settings.toml"), "").unwrap();
        let spec = folder.display().to_string();
        let error = spec.parse::<DriverSpec>().unwrap_err().to_string();
        assert!(error.contains(&format!("did you mean run:{spec}?")), "{error}");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn parameters_that_ship_fit_their_planners() {
        for (name, _) in TUNED {
            planner(name, &Parameters::Tuned).unwrap();
        }
    }
}
