//! Arguments that several commands share.

use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use experiment::drivers;
use experiment::run_dir::Place;
use experiment::settings::{Layers, NoiseChoice};
use scenarios::SpecError;
use sim::scenario::Direction;
use std::path::{Component, Path, PathBuf};

/// What `--noise sweep` stands for, in multiples of the level `paper`: clean to hard.
const SWEEP: [f64; 5] = [0.0, 0.5, 1.0, 1.5, 2.0];

/// Above [`LayerArgs`] in `--help`. Not for all that follow them there, as `next_help_heading` is.
const HEADING: &str = "Settings";

/// Where settings come from, lowest priority first: preset, file, `--set`, then the flags of the command.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct LayerArgs {
    /// Named set of settings to start from [default: default].
    #[arg(long, value_name = "NAME", help_heading = HEADING)]
    preset: Option<String>,
    /// TOML file with the settings to change; the rest stays as in the preset.
    #[arg(long, value_name = "FILE", help_heading = HEADING)]
    config: Option<PathBuf>,
    /// Changes one setting, e.g. `dagger.eta=0.8`; may be repeated. `cargo xtask settings --explain KEY` explains it.
    #[arg(long = "set", value_name = "KEY=VALUE", help_heading = HEADING)]
    overrides: Vec<String>,
}

impl LayerArgs {
    /// The file that is read.
    pub(crate) fn file(&self) -> Option<&Path> {
        self.config.as_deref()
    }
}

impl From<&LayerArgs> for Layers {
    fn from(args: &LayerArgs) -> Self {
        Self { preset: args.preset.clone(), file: args.config.clone(), overrides: args.overrides.clone() }
    }
}

/// How tables are printed.
#[derive(Debug, Clone, Copy, Default, Args)]
pub(crate) struct JsonArgs {
    /// Prints tables as JSON, one line each.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Reads a name of lots, and refuses what names none before anything else is looked at.
pub(crate) fn lot_name(name: &str) -> Result<String, SpecError> {
    scenarios::suite(name).map(|_| name.to_owned())
}

/// Reads the folder of a run: as it is named in replay keys, relative to the present folder where it lies below that.
/// However a run is named that is resumed, the same keys are written.
pub(crate) fn run_folder() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        let path = from_here(&path).map_err(|error| error.to_string())?;
        let Some(name) = path.to_str() else {
            return Err("replay keys name it, so its name is UTF-8; rename it, or choose another".to_owned());
        };
        match drivers::never_in_a_name(name) {
            Some(letter) => {
                Err(format!("tables name it, so its name is without {letter:?}; rename it, or choose another"))
            }
            None => Ok(path),
        }
    })
}

/// A path relative to the present folder where it leads below that, else the whole path.
fn from_here(path: &Path) -> std::io::Result<PathBuf> {
    // Links stay as they are named, except for those that `..` would leave by another way.
    let leads_up = path.components().any(|part| part == Component::ParentDir);
    let full = if leads_up { storage::place_of(path) } else { std::path::absolute(path) }?;
    // A folder that was deleted meanwhile is below no other.
    let Ok(here) = std::env::current_dir() else { return Ok(full) };
    let here = if leads_up { storage::place_of(&here).unwrap_or(here) } else { here };
    let short: PathBuf = full.strip_prefix(here).unwrap_or(&full).components().collect();
    Ok(if short.as_os_str().is_empty() { ".".into() } else { short })
}

/// Where a run goes.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct OutArgs {
    /// Folder of the run [default: runs/COMMAND-PRESET-sSEED, the next free one].
    #[arg(long, value_name = "DIR", value_parser = run_folder())]
    pub(crate) out: Option<PathBuf>,
    /// Deletes the folder of an earlier run in `--out`, with all that it holds.
    #[arg(long, requires = "out")]
    pub(crate) overwrite: bool,
}

impl OutArgs {
    /// The folder that is asked for.
    pub(crate) fn place<'a>(&'a self, command: &'a str, preset: &'a str, seed: u64) -> Place<'a> {
        Place {
            build: crate::build_info::get(),
            out: self.out.as_deref(),
            overwrite: self.overwrite,
            command,
            preset,
            seed,
        }
    }
}

/// Ways a lot can be driven.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Directions {
    /// Forward and reverse.
    Both,
    /// From start to finish.
    Forward,
    /// From finish to start.
    Reverse,
}

impl Directions {
    pub(crate) fn to_vec(self) -> Vec<Direction> {
        match self {
            Self::Both => Direction::BOTH.to_vec(),
            Self::Forward => vec![Direction::Forward],
            Self::Reverse => vec![Direction::Reverse],
        }
    }
}

/// One way to drive a lot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum OneDirection {
    /// From start to finish.
    Forward,
    /// From finish to start.
    Reverse,
}

impl From<OneDirection> for Direction {
    fn from(direction: OneDirection) -> Self {
        match direction {
            OneDirection::Forward => Self::Forward,
            OneDirection::Reverse => Self::Reverse,
        }
    }
}

/// Noise levels as named on the command line; `sweep` stands for several.
pub(crate) fn noise_levels(names: &[String]) -> anyhow::Result<Vec<NoiseChoice>> {
    let mut levels = Vec::new();
    for name in names {
        if name == "sweep" {
            levels.extend(SWEEP.map(NoiseChoice::Times));
        } else {
            levels.push(name.parse().map_err(|error| anyhow::anyhow!("--noise {name}: {error}"))?);
        }
    }
    Ok(levels)
}
