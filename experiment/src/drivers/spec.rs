//! How drivers are named.

use super::planner_file::{self, Parameters};
use super::shipped;
use anyhow::{bail, ensure};
use planners::PlannerSpec;
use policy::checkpoint::Checkpoint;
use sim::validate::is_hidden;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A driver as named on the command line; nothing is loaded yet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DriverSpec {
    /// `expert`: the scripted expert, which sees the truth.
    Expert,
    /// `grid-expert`: its rules on the noisy grid.
    GridExpert,
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
    /// `trained:NAME`: a network that ships.
    Shipped {
        /// Its name.
        name: String,
    },
    /// `ensemble:DRIVER,DRIVER`: networks whose answers are taken together.
    Ensemble {
        /// `trained:`, `run:` and `net:` drivers, at least one.
        members: Vec<DriverSpec>,
    },
    /// `onnx:FILE`: a network from an ONNX file, trained anywhere.
    Onnx {
        /// The file.
        file: PathBuf,
    },
    /// `NAME`, `tuned:NAME` or `NAME:FILE`: a model-based planner.
    Planner {
        /// Its name, with the reading if it is not the paper's: `dwa/fox`.
        name: String,
        /// Its parameters.
        parameters: Parameters,
    },
    /// `python:NAME`: a function of the program that calls this library; it cannot be named on the command line.
    Callback {
        /// Its name.
        name: String,
    },
}

/// Ways to name a driver: how it is written, what it means.
pub fn specs() -> Vec<(String, String)> {
    let own = [
        ("expert", "the scripted expert; sees the truth"),
        ("grid-expert", "the expert's rules on the noisy grid, as the networks see it"),
        ("trained:default", "the network that cargo xtask train-dagger trains, as it ships (policy/trained/)"),
        ("run:DIR", "the final policy of a training run; if an ensemble was trained, all of its networks"),
        ("run:DIR/bc", "its policy after behaviour cloning, one network"),
        ("net:DIR", "a network by the folder of its checkpoint, e.g. a run's round-03"),
        ("ensemble:DRIVER,DRIVER", "run:, net: and trained: drivers whose answers are taken together"),
        ("onnx:FILE", "a network from an ONNX file, trained anywhere (docs/formats.md)"),
    ];
    let of_files = [
        ("tuned:NAME", "one of these planners with parameters found by cargo xtask tune (planners/tuned/)"),
        ("NAME:FILE", "one of these planners with parameters from a TOML file (cargo xtask tune writes them)"),
    ];
    let planners = PlannerSpec::all().into_iter().flat_map(|planner| {
        let of_reading = |(reading, about, _)| (format!("{}/{reading}", planner.name()), format!("reading: {about}"));
        let readings = planner.readings().into_iter().map(of_reading);
        std::iter::once((planner.name().to_owned(), planner.about().to_owned())).chain(readings).collect::<Vec<_>>()
    });
    let owned = |(spec, about): (&str, &str)| (spec.to_owned(), about.to_owned());
    own.map(owned).into_iter().chain(planners).chain(of_files.map(owned)).collect()
}

/// A letter that no driver, and no folder of a run, can have in its name: it would end a cell or a row of the tables, turn
/// their direction of writing, or make two names look the same.
pub fn never_in_a_name(name: &str) -> Option<char> {
    name.chars().find(|&letter| letter == '|' || is_hidden(letter))
}

impl FromStr for DriverSpec {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        if let Some(letter) = never_in_a_name(text) {
            bail!("driver {text:?} contains {letter:?}, and tables hold its name; rename the file or folder");
        }
        let is_planner = |name: &str| PlannerSpec::named(name).is_some();
        let planner = |name: &str, parameters| Ok(Self::Planner { name: name.to_owned(), parameters });
        match text.split_once(':') {
            Some((kind, "")) if ["run", "net", "onnx"].contains(&kind) || is_planner(kind) => {
                bail!("driver {text:?} names no folder or file; write it behind the colon, as in run:runs/NAME")
            }
            None if text == "expert" => Ok(Self::Expert),
            None if text == "grid-expert" => Ok(Self::GridExpert),
            None if is_planner(text) => planner(text, Parameters::Published),
            Some(("trained", name)) if shipped::names().any(|known| known == name) => {
                Ok(Self::Shipped { name: name.to_owned() })
            }
            Some(("run", folder)) => Ok(Self::Run { folder: folder.into() }),
            Some(("net", folder)) => Ok(Self::Checkpoint { folder: folder.into() }),
            Some(("ensemble", members)) => Self::ensemble(members),
            Some(("python", name)) => {
                bail!("{text:?} is a function in Python; only lotpilot.evaluate there can drive {name:?}")
            }
            Some(("onnx", file)) => Ok(Self::Onnx { file: file.into() }),
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
                    planner_file::tuned_specs()
                } else {
                    specs().into_iter().map(|(spec, _)| spec).collect()
                };
                ensure!(!text.contains(','), "no driver {text:?}; name several with spaces between them");
                let is_file = !text.contains(':') && path.extension().is_some_and(|extension| extension == "onnx");
                ensure!(!is_file, "no driver {text:?}; did you mean onnx:{text}?");
                let lower = text.to_lowercase();
                let nearest = known
                    .iter()
                    .map(|name| (strsim::jaro_winkler(&lower, name), name))
                    .filter(|(likeness, _)| *likeness > 0.85)
                    .max_by(|(a, _), (b, _)| a.total_cmp(b));
                let there =
                    nearest.map_or_else(|| "there".to_owned(), |(_, name)| format!("did you mean {name}? There"));
                bail!("no driver {text:?}; {there} are {}", known.join(", "))
            }
        }
    }
}

impl fmt::Display for DriverSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Expert => f.write_str("expert"),
            Self::GridExpert => f.write_str("grid-expert"),
            Self::Run { folder } => write!(f, "run:{}", folder.display()),
            Self::Checkpoint { folder } => write!(f, "net:{}", folder.display()),
            Self::Shipped { name } => write!(f, "trained:{name}"),
            Self::Ensemble { members } => {
                let members: Vec<String> = members.iter().map(Self::to_string).collect();
                write!(f, "ensemble:{}", members.join(","))
            }
            Self::Onnx { file } => write!(f, "onnx:{}", file.display()),
            Self::Planner { name, parameters: Parameters::Published } => f.write_str(name),
            Self::Planner { name, parameters: Parameters::Tuned } => write!(f, "tuned:{name}"),
            Self::Planner { name, parameters: Parameters::File(path) } => write!(f, "{name}:{}", path.display()),
            Self::Callback { name } => write!(f, "python:{name}"),
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
            let same = specs.iter().find(|other| other.is_same_as(&spec));
            ensure!(same.is_none(), "driver {spec} is named twice; name it once");
            specs.push(spec);
        }
        Ok(specs)
    }

    /// Whether two name the same, whatever they call the folder.
    pub fn is_same_as(&self, other: &Self) -> bool {
        let is_one =
            |a: &Path, b: &Path| storage::place_of(a).is_ok_and(|a| storage::place_of(b).is_ok_and(|b| a == b));
        match (self, other) {
            (Self::Run { folder: a }, Self::Run { folder: b })
            | (Self::Checkpoint { folder: a }, Self::Checkpoint { folder: b })
            | (Self::Onnx { file: a }, Self::Onnx { file: b }) => self == other || is_one(a, b),
            (
                Self::Planner { name, parameters: Parameters::File(a) },
                Self::Planner { name: other_name, parameters: Parameters::File(b) },
            ) => self == other || name == other_name && is_one(a, b),
            (Self::Ensemble { members }, Self::Ensemble { members: others }) => {
                members.len() == others.len() && members.iter().zip(others).all(|(a, b)| a.is_same_as(b))
            }
            _ => self == other,
        }
    }

    /// Whether it is a learned policy.
    pub fn is_network(&self) -> bool {
        match self {
            Self::Run { .. }
            | Self::Checkpoint { .. }
            | Self::Shipped { .. }
            | Self::Ensemble { .. }
            | Self::Onnx { .. } => true,
            Self::Expert | Self::GridExpert | Self::Planner { .. } | Self::Callback { .. } => false,
        }
    }

    /// The training run it comes from, of an ensemble the first one; `/bc` is part of it.
    pub fn run(&self) -> Option<&Path> {
        match self {
            Self::Run { folder } => Some(folder),
            Self::Ensemble { members } => members.iter().find_map(Self::run),
            Self::Expert
            | Self::GridExpert
            | Self::Checkpoint { .. }
            | Self::Shipped { .. }
            | Self::Onnx { .. }
            | Self::Planner { .. }
            | Self::Callback { .. } => None,
        }
    }

    /// The files and folders that it is read from.
    pub fn places(&self) -> Vec<&Path> {
        match self {
            // A policy of a run is read from the run.
            Self::Run { folder } if folder.ends_with("bc") && !folder.is_dir() => folder.parent().into_iter().collect(),
            Self::Run { folder } | Self::Checkpoint { folder } => vec![folder],
            Self::Ensemble { members } => members.iter().flat_map(Self::places).collect(),
            Self::Onnx { file } | Self::Planner { parameters: Parameters::File(file), .. } => vec![file],
            Self::Expert | Self::GridExpert | Self::Shipped { .. } | Self::Planner { .. } | Self::Callback { .. } => {
                Vec::new()
            }
        }
    }

    fn ensemble(members: &str) -> anyhow::Result<Self> {
        let members: Vec<Self> = members.split(',').map(str::parse).collect::<anyhow::Result<_>>()?;
        for (at, member) in members.iter().enumerate() {
            ensure!(
                matches!(member, Self::Run { .. } | Self::Checkpoint { .. } | Self::Shipped { .. }),
                "{member} cannot be part of an ensemble; its members are networks, as in ensemble:run:A,net:B/round-03"
            );
            ensure!(
                !members[..at].iter().any(|other| other.is_same_as(member)),
                "{member} is named twice in an ensemble"
            );
        }
        Ok(Self::Ensemble { members })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spec_is_read_back() {
        for text in [
            "expert",
            "grid-expert",
            "run:runs/mine/bc",
            "net:runs/mine/round-03",
            "trained:default",
            "ensemble:trained:default,run:runs/a",
            "ensemble:run:runs/a,net:runs/b/round-02",
            "onnx:policies/mine.onnx",
            "tentacle",
            "tuned:vvf",
            "dwa/fox",
            "dwa:my/dwa.toml",
        ] {
            assert_eq!(text.parse::<DriverSpec>().unwrap().to_string(), text);
        }
        for (wrong, known) in [
            ("exprt", "did you mean expert? There are expert, grid-expert, trained:default, run:DIR"),
            ("Tentacle", "did you mean tentacle?"),
            ("expert,tentacle", "with spaces between them"),
            ("run:", "names no folder or file"),
            ("trained:Default", "did you mean trained:default?"),
            ("dwa:", "names no folder or file"),
            ("", "there are expert, grid-expert, trained:default, run:DIR"),
            ("runs/mine", "there are expert, grid-expert, trained:default, run:DIR"),
            ("ensemble:run:runs/a,expert", "expert cannot be part of an ensemble"),
            ("ensemble:run:runs/a,run:runs/a", "named twice"),
            ("ensemble:run:runs/a,run:./runs/a", "named twice"),
            ("ensemble:", "there are expert, grid-expert, trained:default, run:DIR"),
            ("python:mine", "lotpilot.evaluate"),
            ("mine.onnx", "did you mean onnx:mine.onnx?"),
            ("run:runs/a|b", "contains '|', and tables hold its name; rename the file or folder"),
            ("ensemble:run:runs/a,net:b|c", "contains '|'"),
            ("dwa:my\ndwa.toml", "contains '\\n'"),
            ("tuned:tentacles", "did you mean tuned:tentacle? There are tuned:tentacle, tuned:vvf"),
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
}
