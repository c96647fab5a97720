//! Parameters of planners: those that ship, and those in files.

use anyhow::{Context as _, ensure};
use planners::PlannerSpec;
use serde::{Deserialize, Serialize};
use sim::limits::PLANNER_BYTES_MAX;
use std::fmt::Write as _;
use std::path::PathBuf;
use storage::sums;

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

/// Parameters that ship: the planner, and the file that `cargo xtask tune` wrote.
const TUNED: [(&str, &str); 7] = [
    ("tentacle", include_str!("../../../planners/tuned/tentacle.toml")),
    ("vvf", include_str!("../../../planners/tuned/vvf.toml")),
    ("dwa", include_str!("../../../planners/tuned/dwa.toml")),
    ("cvm", include_str!("../../../planners/tuned/cvm.toml")),
    ("apf", include_str!("../../../planners/tuned/apf.toml")),
    ("vff", include_str!("../../../planners/tuned/vff.toml")),
    ("mppi", include_str!("../../../planners/tuned/mppi.toml")),
];

/// The planners with parameters that ship.
pub fn tuned_specs() -> Vec<String> {
    TUNED.iter().map(|(name, _)| format!("tuned:{name}")).collect()
}

/// Parameters of a planner on disk.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannerFile {
    /// Which planner they are for.
    pub planner: String,
    /// All of its parameters.
    pub parameters: toml::Table,
    /// How they were found; of it, only the `lots` are read.
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
        let file = Self { planner: planner.name().to_owned(), parameters: planner.parameters(), search: None };
        Ok(text + "\n" + &toml::to_string(&file)?)
    }
}

fn published(name: &str) -> anyhow::Result<PlannerSpec> {
    PlannerSpec::named(name).with_context(|| {
        let names: Vec<&str> = PlannerSpec::all().iter().map(PlannerSpec::name).collect();
        format!("no planner {name:?}; there are {}", names.join(", "))
    })
}

/// The planner of a name and reading, with these parameters, and the lots on which they were found: none where nobody says.
///
/// # Errors
/// If nothing is named so, or the parameters are not its own.
pub(super) fn planner(name: &str, parameters: &Parameters) -> anyhow::Result<(PlannerSpec, Vec<String>)> {
    let planner = published(name)?;
    match parameters {
        Parameters::Published => Ok((planner, Vec::new())),
        Parameters::Tuned => {
            let text = TUNED.iter().find(|(of, _)| *of == name).map(|(_, text)| *text);
            let text = text.with_context(|| format!("no tuned parameters ship for {name:?}"))?;
            with_parameters(&planner, text).with_context(|| format!("planners/tuned/{name}.toml"))
        }
        Parameters::File(path) => {
            let text = sums::read_text(path, PLANNER_BYTES_MAX).with_context(|| {
                format!("{}: cannot be read; cargo xtask drivers {name} prints such a file", path.display())
            })?;
            with_parameters(&planner, &text)
                .with_context(|| format!("{} (cargo xtask drivers {name} prints a complete file)", path.display()))
        }
    }
}

/// A planner with the parameters in the text of a [`PlannerFile`], and the lots on which they were found.
fn with_parameters(planner: &PlannerSpec, text: &str) -> anyhow::Result<(PlannerSpec, Vec<String>)> {
    let file: PlannerFile = toml::from_str(text)?;
    let name = planner.name();
    ensure!(file.planner == name, "these are parameters of {:?}, but {name:?} is asked for", file.planner);
    let changed = planner.with_parameters(file.parameters).context("parameters")?;
    changed.check().map_err(anyhow::Error::msg).context("parameters")?;
    // Whoever writes such a file by hand may note there what he likes.
    let lots = file.search.as_ref().and_then(|search| search.get("lots")?.as_array());
    let lots = lots.into_iter().flatten().filter_map(|lot| lot.as_str().map(str::to_owned));
    Ok((changed, lots.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_that_ship_fit_their_planners() {
        for (name, _) in TUNED {
            let (_, lots) = planner(name, &Parameters::Tuned).unwrap();
            assert_eq!(lots, ["lot-a", "train:24:all"], "{name}");
        }
    }

    #[test]
    fn what_is_noted_of_a_search_by_hand_is_no_error() {
        let apf = PlannerSpec::named("apf").unwrap();
        let text = PlannerFile::text_of("apf").unwrap();
        for (search, expected) in [
            ("", vec![]),
            ("[search]\nby = \"eye\"", vec![]),
            ("[search]\nlots = 7", vec![]),
            ("[search]\nlots = [\"lot-b\", 3]", vec!["lot-b"]),
        ] {
            assert_eq!(with_parameters(&apf, &format!("{text}\n{search}\n")).unwrap().1, expected, "{search}");
        }
    }
}
