//! Lots that can be named on the command line: [`scenarios::suite`], checked before anything is driven.

use anyhow::{Context as _, bail, ensure};
use scenarios::generator;
use scenarios::import::MapLot;
use scenarios::note::{Loaded, Note};
use scenarios::reference::{self, ReferenceLot};
use scenarios::split::{Family, Split};
use scenarios::{LoadError, LotSpec};
use sim::limits::LOTS_MAX;
use sim::scenario::{Direction, NoiseLevel, Scenario};
use sim::seed::RootSeed;
use sim::validate::{is_hidden, validate};
use sim::vehicle::VehicleSettings;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A lot, before a trial has drawn its obstacles.
#[derive(Debug, Clone)]
pub struct Lot {
    name: String,
    spec: LotSpec,
    /// The content of a file, read once so that its errors come before any work.
    from_file: Option<Arc<FromFile>>,
}

/// What a file holds, and for which car it was read.
#[derive(Debug)]
struct FromFile {
    loaded: Loaded,
    vehicle: VehicleSettings,
}

/// A lot as it stands in one trial.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// The lot.
    pub scenario: Scenario,
    /// Draws the generator needed, this one included; `None` if it was not generated.
    pub attempts: Option<u32>,
}

impl Drawn {
    /// As a lot file says it.
    pub fn to_toml(&self) -> String {
        scenarios::load::to_toml(&self.scenario)
    }
}

/// Ways to name lots: how it is written, what it means.
pub fn specs() -> Vec<(&'static str, String)> {
    let families = format!("{}; all: one of each of the first {} in turn", Family::list(""), Family::ALL.len());
    [
        ("lot-a", "the paper's training lot rebuilt: 231 m; new obstacles in every trial"),
        ("lot-b", "139 m, the narrowest, never trained on"),
        ("lot-c", "149 m, the widest, never trained on"),
        ("reference", "all three"),
        ("test:N", "the first N generated lots of a split: train, validation or test; medium, unless a family follows"),
        ("test:N:FAMILY", families.as_str()),
        (
            "sealed:PHRASE:N",
            "N lots that nobody has tuned on, drawn from a phrase of a-z, 0-9 and -: easy, medium, hard in turn, or a family",
        ),
        ("test-hard-7", "a single generated lot: SPLIT-FAMILY-NUMBER, counted from 0; or sealed-PHRASE-hard-7"),
        (
            "PATH.toml",
            "a lot written by hand (cargo xtask generate writes examples), or the route on a map, PATH.lot.toml",
        ),
        ("PATH.yaml", "a ROS map, driven as PATH.lot.toml beside it says (see scenarios/examples/car-park.lot.toml)"),
        ("PATH.csv", "a TPCAP case with a drive forwards; PATH.lot.toml may change it"),
    ]
    .map(|(spec, about)| (spec, about.to_owned()))
    .to_vec()
}

/// Row of a table for all lots.
pub const ALL: &str = "all";
/// Row of a table for the lots that no driver was trained on.
pub const UNSEEN: &str = "unseen";

/// The error of a file that cannot be read by itself: [`storage::is_of_disk`] knows it.
fn not_loaded(error: LoadError) -> anyhow::Error {
    match error {
        LoadError::Unreadable(file) => file.into(),
        other => other.into(),
    }
}

/// The name of a lot from a file. One that is the name of other lots, or of another row of a table, is marked: it would be
/// counted among those, or be compared with the paper's.
fn name_of_file(scenario: &Scenario) -> String {
    let name = &scenario.name;
    // `test-medium`, the row of `test-medium-0` and its kin.
    // (No row has the name of a suite, which may stand for a million lots.)
    let is_one = !name.contains([':', ',']);
    let is_taken = |name: &str| is_one && scenarios::suite(name).is_ok_and(|lots| !lots.iter().any(LotSpec::is_file));
    // `test-easy (3 lots)`, the label of a row.
    let is_label = name.ends_with(" lots)");
    if [ALL, UNSEEN].contains(&name.as_str()) || is_label || is_taken(name) || is_taken(&format!("{name}-0")) {
        return format!("{name} (file)");
    }
    name.clone()
}

impl Lot {
    /// The lots that specs stand for. Files are checked with the car that is to drive there.
    ///
    /// # Errors
    /// If nothing is named so, a file does not describe a lot, or two lots have the same name.
    pub fn parse_all<S: AsRef<str>>(specs: &[S], vehicle: &VehicleSettings) -> anyhow::Result<Vec<Self>> {
        let (mut named, mut suites) = (BTreeSet::new(), Vec::new());
        let mut count = 0;
        for spec in specs {
            let spec: &str = spec.as_ref();
            // Before a million lots are made twice.
            ensure!(named.insert(spec), "lot {spec:?} is named twice; name it once");
            let suite = scenarios::suite(spec)?;
            // Replay keys name its file, and rows of tables hold them.
            if let Some(letter) = spec.chars().find(|&letter| is_hidden(letter)) {
                bail!("lot {spec:?} contains {letter:?}, and tables hold its name; rename the file or folder");
            }
            count += suite.len();
            ensure!(count <= LOTS_MAX, "{count} lots; at most {LOTS_MAX} are possible");
            suites.push(suite);
        }
        let lots = suites.into_iter().flatten().map(|spec| Self::new(spec, vehicle));
        let lots = lots.collect::<anyhow::Result<Vec<Self>>>()?;
        let mut names: Vec<&str> = lots.iter().map(Self::name).collect();
        names.sort_unstable();
        let twice = names.windows(2).find(|pair| pair[0] == pair[1]);
        ensure!(twice.is_none(), "lot {:?} is named twice; name it once", twice.unwrap_or(&[""])[0]);
        if *vehicle != VehicleSettings::hyundai_hg300() {
            ensure_it_fits(&lots, vehicle)?;
        }
        Ok(lots)
    }

    /// The one lot that a spec stands for.
    ///
    /// # Errors
    /// As [`Self::parse_all`], and if it stands for several.
    pub fn parse_one(spec: &str, vehicle: &VehicleSettings) -> anyhow::Result<Self> {
        let mut lots = Self::parse_all(&[spec], vehicle)?;
        ensure!(lots.len() == 1, "{spec:?} stands for {} lots; name one, as in test-hard-7", lots.len());
        Ok(lots.remove(0))
    }

    fn new(spec: LotSpec, vehicle: &VehicleSettings) -> anyhow::Result<Self> {
        if let LotSpec::File(path) = &spec {
            let loaded = scenarios::load::load_with_notes(path, vehicle).map_err(not_loaded)?;
            return Ok(Self::of_file(spec, loaded, vehicle));
        }
        Ok(Self { name: spec.to_string(), spec, from_file: None })
    }

    fn of_file(spec: LotSpec, loaded: Loaded, vehicle: &VehicleSettings) -> Self {
        let name = name_of_file(&loaded.scenario);
        Self { name, spec, from_file: Some(Arc::new(FromFile { loaded, vehicle: vehicle.clone() })) }
    }

    /// A map with a route that may differ from what is written beside it.
    ///
    /// # Errors
    /// If no lot can be made of it.
    pub fn of_map(path: &Path, lot: &MapLot, vehicle: &VehicleSettings) -> anyhow::Result<Self> {
        let loaded = lot.scenario(vehicle).map_err(not_loaded)?;
        Ok(Self::of_file(LotSpec::File(path.to_owned()), loaded, vehicle))
    }

    fn loaded(&self) -> Option<&Loaded> {
        self.from_file.as_ref().map(|file| &file.loaded)
    }

    /// Notes about a lot from a file. Those about one written by hand are found anew, which takes longer than its map.
    pub fn notes(&self) -> Vec<Note> {
        match self.from_file.as_deref() {
            Some(FromFile { loaded, vehicle }) if loaded.is_by_hand => {
                scenarios::load::junctions(&loaded.scenario, vehicle)
            }
            Some(FromFile { loaded, .. }) => loaded.notes.clone(),
            None => Vec::new(),
        }
    }

    /// The noise level that a lot from a file asks for.
    pub fn asks_for_noise(&self) -> Option<NoiseLevel> {
        self.loaded().map(|loaded| loaded.scenario.noise.level)
    }

    /// SHA-256 of a lot from a file, as it was read, whatever its name; `None` for one that ships or is generated.
    pub fn digest(&self) -> Option<String> {
        let nameless = Scenario { name: String::new(), ..self.loaded()?.scenario.clone() };
        Some(storage::sums::digest(scenarios::load::to_toml(&nameless).as_bytes()))
    }

    /// The file that it is read from.
    pub fn file(&self) -> Option<&Path> {
        match &self.spec {
            LotSpec::File(path) => Some(path),
            LotSpec::Reference(_) | LotSpec::Generated { .. } => None,
        }
    }

    /// Every file that it is made of: of a map its image and its route as well.
    pub fn files(&self) -> &[PathBuf] {
        self.loaded().map_or(&[], |loaded| &loaded.files)
    }

    /// Name in tables.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What a row of a printed table is about: generated lots of one kind share a row.
    pub fn group(&self) -> String {
        match &self.spec {
            LotSpec::Generated { split, family, .. } => format!("{split}-{}", family.name()),
            LotSpec::Reference(_) | LotSpec::File(_) => self.name.clone(),
        }
    }

    /// As named on the command line; stands for this lot alone.
    pub fn spec(&self) -> String {
        self.spec.to_string()
    }

    /// Whether it is one of many drawn from a distribution, so that lots themselves are the sample.
    pub fn is_generated(&self) -> bool {
        matches!(self.spec, LotSpec::Generated { .. })
    }

    /// Whether it is the user's: read from a file.
    pub fn is_from_file(&self) -> bool {
        self.from_file.is_some()
    }

    /// Checks that it can be driven in a direction. Generated lots can; one written by hand may leave no room to start
    /// back from its finish.
    ///
    /// # Errors
    /// [`scenarios::LoadError::ForwardOnly`], with file and line.
    pub fn check_direction(&self, direction: Direction, vehicle: &VehicleSettings) -> anyhow::Result<()> {
        match (&self.spec, self.loaded()) {
            (LotSpec::File(path), Some(loaded)) => {
                Ok(scenarios::load::check_direction(path, loaded, direction, vehicle)?)
            }
            _ => Ok(()),
        }
    }

    /// Whether planners may be tuned on it, and it is never unseen: lot a and the generator's training lots.
    pub fn is_for_training(&self) -> bool {
        match &self.spec {
            LotSpec::Generated { split, .. } => *split == Split::Train,
            LotSpec::Reference(lot) => *lot == ReferenceLot::A,
            LotSpec::File(_) => false,
        }
    }

    /// Whether trials draw their own obstacles; other lots are the same in every trial.
    pub fn is_drawn_per_trial(&self) -> bool {
        matches!(self.spec, LotSpec::Reference(_))
    }

    /// The lot that takes its place in a round of training: of `count` generated lots of a kind, round after round the
    /// next `count`, from the beginning again after `different` of them (0: never). Other lots stay: they draw new
    /// obstacles, or are files.
    #[must_use]
    pub fn in_round(&self, round: u32, count: u64, different: u32) -> Self {
        let mut lot = self.clone();
        if let LotSpec::Generated { index, .. } = &mut lot.spec {
            *index += u64::from(round) * count;
            *index = index.checked_rem(different.into()).unwrap_or(*index);
            lot.name = lot.spec.to_string();
        }
        lot
    }

    /// The lot with the obstacles of a trial.
    pub fn draw(&self, trial: RootSeed) -> Drawn {
        match &self.spec {
            LotSpec::Reference(lot) => Drawn { scenario: reference::lot(*lot, trial), attempts: None },
            LotSpec::Generated { split, family, index } => {
                let generated = generator::generate(split, *index, *family);
                Drawn { scenario: generated.scenario, attempts: Some(generated.attempts) }
            }
            LotSpec::File(_) => {
                let loaded = self.loaded().expect("files are read when they are named");
                Drawn { scenario: loaded.scenario.clone(), attempts: None }
            }
        }
    }
}

/// How many generated lots of each kind there are, by [`Lot::group`].
pub fn generated_by_kind(lots: &[Lot]) -> BTreeMap<String, u64> {
    let mut of_a_kind: BTreeMap<String, u64> = BTreeMap::new();
    for lot in lots.iter().filter(|lot| lot.is_generated()) {
        *of_a_kind.entry(lot.group()).or_default() += 1;
    }
    of_a_kind
}

/// Checks that there are enough generated lots for so many rounds of training; see [`Lot::in_round`].
///
/// # Errors
/// If one would have a number that no lot has.
pub fn check_rounds(lots: &[Lot], rounds: u32, different: u32) -> anyhow::Result<()> {
    let of_a_kind = generated_by_kind(lots);
    for lot in lots {
        let LotSpec::Generated { split, index, .. } = &lot.spec else { continue };
        let count = of_a_kind[&lot.group()];
        let last = index.saturating_add(u64::from(rounds.saturating_sub(1)).saturating_mul(count));
        ensure!(
            different > 0 || last < split.size(),
            "training.lots: {}: {rounds} rounds of {count} lots each come to number {last}, and there are {}; name \
             fewer, or earlier ones",
            lot.name,
            split.size()
        );
    }
    Ok(())
}

/// Refuses another car than ours that does not fit where it starts, before anything is driven: of each kind of lot one is
/// tried, and those from files were when they were read.
fn ensure_it_fits(lots: &[Lot], vehicle: &VehicleSettings) -> anyhow::Result<()> {
    let mut kinds = BTreeSet::new();
    for lot in lots.iter().filter(|lot| !lot.is_from_file() && kinds.insert(lot.group())) {
        let scenario = lot.draw(RootSeed(0)).scenario;
        validate(&scenario, vehicle).with_context(|| format!("lot {:?} and the car of episode.vehicle", lot.name))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_lots_and_doubles_are_refused() {
        let names = |specs: &[&str]| {
            let lots = Lot::parse_all(specs, &VehicleSettings::hyundai_hg300())?;
            Ok::<_, anyhow::Error>(lots.iter().map(|lot| lot.name().to_owned()).collect::<Vec<_>>())
        };
        assert_eq!(names(&["lot-a", "test:2"]).unwrap(), ["lot-a", "test-medium-0", "test-medium-1"]);
        for (specs, part) in [
            (&["lot-d"] as &[&str], "there are lot-a, lot-b"),
            (&["lot-a", "reference"], "\"lot-a\" is named twice"),
            (&["test:2", "lot-a", "test:2"], "\"test:2\" is named twice"),
            (&["no\nsuch.toml"], "\"no\\nsuch.toml\" contains '\\n'"),
            (&["no/such.toml"], "no/such.toml"),
        ] {
            let error = format!("{:#}", names(specs).unwrap_err());
            assert!(error.contains(part), "{specs:?}: {part:?} is missing in: {error}");
        }
    }

    /// A lot that was named so took the row of others, and ground under another name passed for unseen.
    #[test]
    fn a_lot_from_a_file_is_known_by_what_it_is_and_not_by_its_name() {
        let text = std::fs::read_to_string("../scenarios/examples/slalom.toml").unwrap();
        let file = std::env::temp_dir().join(format!("lotpilot-named-{}.toml", std::process::id()));
        let named = |name: &str| {
            std::fs::write(&file, text.replace("name = \"slalom\"", &format!("name = {name:?}"))).unwrap();
            Lot::parse_all(&[file.display().to_string()], &VehicleSettings::hyundai_hg300()).unwrap().remove(0)
        };
        for name in [
            "lot-b",
            "reference",
            "all",
            "unseen",
            "test-medium",
            "test-medium-3",
            "sealed-spring-lane",
            "test-easy (3 lots)",
        ] {
            assert_eq!(named(name).group(), format!("{name} (file)"));
            assert_eq!(named(name).digest(), named("mine").digest());
        }
        assert_eq!(named("mine").group(), "mine");
        std::fs::remove_file(file).unwrap();
    }

    /// Planners are tuned on no other, and `--unseen` refuses them.
    #[test]
    fn training_lots_are_lot_a_and_those_of_the_split_train() {
        let specs =
            ["lot-a", "lot-b", "train:3:all", "validation:1", "test:1:rooms", "sealed:train:2", "sealed-a-easy-0"];
        let lots = Lot::parse_all(&specs, &VehicleSettings::hyundai_hg300()).unwrap();
        let for_training: Vec<_> = lots.iter().filter(|lot| lot.is_for_training()).map(Lot::name).collect();
        assert_eq!(for_training, ["lot-a", "train-easy-0", "train-medium-0", "train-hard-0"]);
    }

    #[test]
    fn every_round_of_training_has_generated_lots_of_its_own() {
        let names = |round, different| -> Vec<String> {
            let lots =
                Lot::parse_all(&["lot-a", "train:2", "train:1:hard"], &VehicleSettings::hyundai_hg300()).unwrap();
            let of_a_kind = |lot: &Lot| lots.iter().filter(|other| other.group() == lot.group()).count() as u64;
            lots.iter().map(|lot| lot.in_round(round, of_a_kind(lot), different).name().to_owned()).collect()
        };
        assert_eq!(names(0, 0), ["lot-a", "train-medium-0", "train-medium-1", "train-hard-0"]);
        assert_eq!(names(1, 0), ["lot-a", "train-medium-2", "train-medium-3", "train-hard-1"]);
        // Whichever of its kind is named last.
        let last = ["sealed-x-easy-1048574", "sealed-x-easy-0"];
        let last = Lot::parse_all(&last, &VehicleSettings::hyundai_hg300()).unwrap();
        assert!(check_rounds(&last, 1, 0).is_ok() && check_rounds(&last, 2, 5).is_ok(), "once, and the same again");
        let error = check_rounds(&last, 2, 0).unwrap_err().to_string();
        assert!(error.contains("come to number 1048576, and there are 1048576"), "{error}");
        assert_eq!(names(1, 3), ["lot-a", "train-medium-2", "train-medium-0", "train-hard-1"], "three, then again");
    }
}
