//! Where to drive: the paper's three lots, generated lots and lots written by hand.
//!
//! A [`LotSpec`] names one lot, a [`suite`] several; [`LotSpec::scenario`] gives the scenario of one trial.
//!
//! | module | |
//! |---|---|
//! | [`corridor`] | lane geometry: legs, corners, widths, bulges → one boundary polygon |
//! | [`clutter`] | parked cars and other obstacles, under gap rules |
//! | [`mod@reference`] | lots a, b and c of the paper |
//! | [`generator`] | procedural lots of several families, each verified by the [`solver`] |
//! | [`split`] | splits and families of generated lots, sealed ones included |
//! | [`load`] | lots as TOML files |
//! | [`import`] | ROS maps and TPCAP cases as lots |
//! | [`note`] | what an import did and found, for people |

mod branches;
pub mod clutter;
pub mod corridor;
mod error;
mod families;
pub mod generator;
pub mod import;
pub mod load;
mod neighbours;
pub mod note;
mod open_list;
pub mod reference;
pub mod solver;
pub mod split;

pub use error::{LoadError, Location};

use reference::ReferenceLot;
use sim::limits::LOTS_MAX;
use sim::scenario::Scenario;
use sim::seed::RootSeed;
use sim::vehicle::VehicleSettings;
use split::{Family, Phrase, Split};
use std::path::PathBuf;

/// The lots that a name means; several names are separated by commas.
///
/// `lot-a`, `lot-b`, `lot-c` · `reference` (all three) · `train:N`, `validation:N`, `test:N` (the first N generated lots
/// of a split, medium unless `:hard` or another [`Family`] follows; `:all` takes [`Family::ALL`] in turn) ·
/// `sealed:PHRASE:N` (lots that nobody has seen before the phrase was chosen: easy, medium and hard in turn unless a
/// family or `:all` follows) · `test-hard-7` (a single one, counted from 0) · a path ending in `.toml`, or in `.yaml`
/// or `.csv` for a map with its route beside it (see [`import`]).
///
/// ```
/// let lots = scenarios::suite("lot-a,test:2:hard")?;
/// let names: Vec<_> = lots.iter().map(ToString::to_string).collect();
/// assert_eq!(names, ["lot-a", "test-hard-0", "test-hard-1"]);
/// # Ok::<(), scenarios::SpecError>(())
/// ```
///
/// # Errors
/// A name that means no lot, and the message lists the names there are; or more than [`LOTS_MAX`] lots.
pub fn suite(names: &str) -> Result<Vec<LotSpec>, SpecError> {
    let mut lots = Vec::new();
    for name in names.split(',').map(str::trim) {
        lots.extend(lots_of(name)?);
        if lots.len() > LOTS_MAX {
            return Err(SpecError::new(
                name,
                format!("is too much: {} lots are named, of at most {LOTS_MAX}", lots.len()),
            ));
        }
    }
    Ok(lots)
}

/// One lot, by name.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum LotSpec {
    /// One of the paper's: fixed geometry, new obstacles in every trial.
    Reference(ReferenceLot),
    /// A procedural one: geometry and obstacles are fixed by its name.
    Generated {
        /// What it may be used for.
        split: Split,
        /// Which kind.
        family: Family,
        /// Its number within both.
        index: u64,
    },
    /// A file: the same in every trial.
    File(PathBuf),
}

impl LotSpec {
    /// Whether it names a file.
    pub fn is_file(&self) -> bool {
        matches!(self, Self::File(_))
    }

    /// The lot in one trial. Methods that are compared get the same trial seeds, hence the same lots.
    ///
    /// Generated lots do not depend on the vehicle: their rules are made for the paper's.
    ///
    /// # Errors
    /// Only for files: if one cannot be read, or the vehicle does not fit.
    pub fn scenario(&self, trial_seed: RootSeed, vehicle: &VehicleSettings) -> Result<Scenario, LoadError> {
        match self {
            Self::Reference(lot) => Ok(reference::lot(*lot, trial_seed)),
            Self::Generated { split, family, index } => Ok(generator::generate(split, *index, *family).scenario),
            Self::File(path) => load::load(path, vehicle),
        }
    }
}

impl std::fmt::Display for LotSpec {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Reference(lot) => write!(f, "{}", lot.name()),
            Self::Generated { split, family, index } => write!(f, "{split}-{}-{index}", family.name()),
            Self::File(path) => write!(f, "{}", path.display()),
        }
    }
}

impl std::str::FromStr for LotSpec {
    type Err = SpecError;

    /// The name of a single lot.
    fn from_str(name: &str) -> Result<Self, SpecError> {
        let mut lots = suite(name)?;
        match (lots.pop(), lots.len()) {
            (Some(lot), 0) => Ok(lot),
            (_, others) => Err(SpecError::new(name, format!("stands for {} lots where one is wanted", others + 1))),
        }
    }
}

/// A name that means no lot.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{name:?} {problem}; {there} are lot-a, lot-b, lot-c, reference (all three), train:N, validation:N, test:N and \
     sealed:PHRASE:N (N generated lots; add :all, {families}), single ones such as test-hard-7, and paths ending in .toml, \
     .yaml (ROS map) or .csv (TPCAP case)",
    there = meant(name).map_or_else(|| "there".to_owned(), |meant| format!("did you mean {meant}? There")),
    families = Family::list(":")
)]
pub struct SpecError {
    name: String,
    problem: String,
}

impl SpecError {
    fn new(name: &str, problem: impl Into<String>) -> Self {
        Self { name: name.to_owned(), problem: problem.into() }
    }
}

/// The name that a wrong one is likely to stand for.
fn meant(name: &str) -> Option<String> {
    let name = name.to_lowercase();
    // `test-20` for `test:20`.
    let suite = name.replace(['-', '_', '/'], ":");
    if generated_suite(&suite).is_ok() {
        return Some(suite);
    }
    let known = ReferenceLot::ALL.into_iter().map(ReferenceLot::name).chain(["reference"]);
    let mut known: Vec<(f64, &str)> = known.map(|known| (strsim::jaro_winkler(&name, known), known)).collect();
    known.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    // Of `lot-d` nobody can say which.
    let [(likeness, nearest), (next, _), ..] = known[..] else { return None };
    (likeness > 0.85 && likeness > next).then(|| nearest.to_owned())
}

fn lots_of(name: &str) -> Result<Vec<LotSpec>, SpecError> {
    if name == "reference" {
        return Ok(ReferenceLot::ALL.map(LotSpec::Reference).to_vec());
    }
    if let Some(lot) = ReferenceLot::ALL.into_iter().find(|lot| lot.name() == name) {
        return Ok(vec![LotSpec::Reference(lot)]);
    }
    let path = std::path::Path::new(name);
    if path.extension().is_some_and(|extension| extension == "toml") || import::is_map(path) {
        return Ok(vec![LotSpec::File(name.into())]);
    }
    if path.extension().is_some_and(|extension| ["pgm", "png"].iter().any(|image| extension == *image)) {
        return Err(SpecError::new(name, "is an image, not a lot; name the .yaml or .toml file beside it"));
    }
    if let Some(lot) = generated_lot(name) {
        return Ok(vec![lot]);
    }
    generated_suite(name)
}

/// `test-hard-7` or `sealed-PHRASE-hard-7`.
fn generated_lot(name: &str) -> Option<LotSpec> {
    let [index, family, split] = name.rsplitn(3, '-').collect::<Vec<_>>().try_into().ok()?;
    let split = match split.strip_prefix("sealed-") {
        Some(phrase) => Split::Sealed(Phrase::new(phrase)?),
        None => split_called(split)?,
    };
    let family = family_called(family)?;
    let index = index.parse().ok().filter(|index| *index < split.size())?;
    Some(LotSpec::Generated { split, family, index })
}

/// `test:100`, `test:100:hard`, `test:100:all` or the same of `sealed:PHRASE`.
fn generated_suite(name: &str) -> Result<Vec<LotSpec>, SpecError> {
    let fault = |problem: String| SpecError::new(name, problem);
    let mut parts = name.split(':');
    let split = match parts.next() {
        Some("sealed") => {
            let phrase = parts.next().ok_or_else(|| fault("does not say which phrase".to_owned()))?;
            Split::Sealed(Phrase::new(phrase).ok_or_else(|| {
                fault(format!(
                    "has the phrase {phrase:?}; write 1 to 40 of a-z, 0-9 and -, which is neither first nor last"
                ))
            })?)
        }
        other => other.and_then(split_called).ok_or_else(|| fault("is not a lot".to_owned()))?,
    };
    let count = parts.next().ok_or_else(|| fault("does not say how many lots".to_owned()))?;
    let count: u64 = count
        .parse()
        .ok()
        .filter(|count| (1..=LOTS_MAX as u64).contains(count))
        .ok_or_else(|| fault(format!("asks for {count:?} lots, not for a number from 1 to {LOTS_MAX}")))?;
    let families = match (parts.next(), &split) {
        (Some("all"), _) => Family::ALL.to_vec(),
        (Some(called), _) => vec![family_called(called).ok_or_else(|| fault(format!("has no family {called:?}")))?],
        (None, Split::Sealed(_)) => Family::CORRIDORS.to_vec(),
        (None, Split::Train | Split::Validation | Split::Test) => vec![Family::default()],
    };
    if let Some(extra) = parts.next() {
        return Err(fault(format!("has {extra:?} too much")));
    }
    // In turn: of several families, each has its first lots.
    let turns = families.len() as u64;
    let lot =
        |k: u64| LotSpec::Generated { split: split.clone(), family: families[(k % turns) as usize], index: k / turns };
    Ok((0..count).map(lot).collect())
}

fn split_called(name: &str) -> Option<Split> {
    Split::OPEN.into_iter().find(|split| split.to_string() == name)
}

fn family_called(name: &str) -> Option<Family> {
    Family::EVERY.into_iter().find(|family| family.name() == name)
}

/// FNV-1a: pins text in tests.
#[cfg(test)]
fn fnv1a(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(of: &str) -> Result<Vec<String>, SpecError> {
        Ok(suite(of)?.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn names_stand_for_lots() {
        let table: &[(&str, &[&str])] = &[
            ("lot-a", &["lot-a"]),
            ("reference", &["lot-a", "lot-b", "lot-c"]),
            ("train:2", &["train-medium-0", "train-medium-1"]),
            ("validation:1:easy, lot-c", &["validation-easy-0", "lot-c"]),
            ("test:3:hard", &["test-hard-0", "test-hard-1", "test-hard-2"]),
            ("test-hard-41", &["test-hard-41"]),
            ("train:2:rooms", &["train-rooms-0", "train-rooms-1"]),
            ("train:1:cones,test-slanted-7", &["train-cones-0", "test-slanted-7"]),
            ("sealed:spring:2:lane", &["sealed-spring-lane-0", "sealed-spring-lane-1"]),
            (
                "sealed:a-b-hard-3:4",
                &[
                    "sealed-a-b-hard-3-easy-0",
                    "sealed-a-b-hard-3-medium-0",
                    "sealed-a-b-hard-3-hard-0",
                    "sealed-a-b-hard-3-easy-1",
                ],
            ),
            ("sealed-a-b-hard-3-easy-1", &["sealed-a-b-hard-3-easy-1"]),
            ("some/where.toml", &["some/where.toml"]),
        ];
        for (name, expected) in table {
            let expected: Vec<String> = expected.iter().map(ToString::to_string).collect();
            assert_eq!(names(name), Ok(expected), "{name}");
        }
    }

    /// Figures and trainings name `all`: families made since do not change what it means.
    #[test]
    fn all_stands_for_twelve_families() {
        let names = names("validation:13:all").expect("names of lots");
        assert_eq!(names[11..], ["validation-chicanes-0", "validation-easy-1"]);
    }

    #[test]
    fn other_names_are_refused_with_what_there_is() {
        let table = [
            ("lot-d", "\"lot-d\" is not a lot; there are lot-a, lot-b"),
            ("office.pgm", "\"office.pgm\" is an image, not a lot; name the .yaml or .toml file beside it; there are"),
            ("", "\"\" is not a lot; there are"),
            ("lot-a,", "\"\" is not a lot; there are"),
            ("train", "\"train\" does not say how many lots; there are"),
            ("train:x", "\"train:x\" asks for \"x\" lots, not for a number from 1 to"),
            ("test:0", "\"test:0\" asks for \"0\" lots"),
            ("test:5:brutal", "\"test:5:brutal\" has no family \"brutal\"; there are"),
            ("test:5:hard:1", "\"test:5:hard:1\" has \"1\" too much"),
            ("test-hard-x", "\"test-hard-x\" is not a lot; there are"),
            ("lotb", "\"lotb\" is not a lot; did you mean lot-b? There are lot-a, "),
            ("Lot-B", "\"Lot-B\" is not a lot; did you mean lot-b? There are"),
            ("test-20", "\"test-20\" is not a lot; did you mean test:20? There are"),
            ("sealed", "\"sealed\" does not say which phrase; there are"),
            ("sealed:spring", "\"sealed:spring\" does not say how many lots; there are"),
            (
                "sealed:Spring:3",
                "\"sealed:Spring:3\" has the phrase \"Spring\"; write 1 to 40 of a-z, 0-9 and -, which",
            ),
            ("sealed-spring-hard-1048576", "\"sealed-spring-hard-1048576\" is not a lot"),
            ("sealed-hard-7", "\"sealed-hard-7\" is not a lot"),
            ("test-hard-99999999999999999999", "\"test-hard-99999999999999999999\" is not a lot"),
        ];
        for (name, expected) in table {
            let message = names(name).expect_err(name).to_string();
            assert!(message.starts_with(expected), "got:      {message}\nexpected: {expected}");
        }
        let several = "reference".parse::<LotSpec>().expect_err("three lots").to_string();
        assert!(several.starts_with("\"reference\" stands for 3 lots where one is wanted"), "{several}");
        let listed = suite("lot-d").unwrap_err().to_string();
        assert!(listed.contains(":all, :easy, ") && listed.contains(", :slanted or :mixed)"), "{listed}");
    }

    /// Reference lots change with the trial, others do not; every lot carries the name it was asked for by.
    #[test]
    fn a_trial_seed_re_draws_reference_lots_only() {
        let vehicle = VehicleSettings::hyundai_hg300();
        let draw = |name: &str, seed| {
            name.parse::<LotSpec>().expect("a lot").scenario(RootSeed(seed), &vehicle).expect("a scenario")
        };
        assert_ne!(draw("lot-b", 1).obstacles, draw("lot-b", 2).obstacles);
        assert_eq!(draw("lot-b", 1), draw("lot-b", 1));
        assert_eq!(draw("test-easy-3", 1), draw("test-easy-3", 2));
        for name in ["lot-c", "validation-hard-1"] {
            assert_eq!(draw(name, 1).name, name);
        }
    }
}
