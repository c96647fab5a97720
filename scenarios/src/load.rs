//! Lots as files: TOML that a person can write by hand, and maps of other programs ([`crate::import`]); `examples/` has
//! annotated ones.
//!
//! Whatever is wrong with a file is one error that names file, line and remedy.

use crate::branches;
use crate::error::{LoadError, Location, line_at, read_text};
use crate::import::{self, MapLot};
use crate::note::{Loaded, Note, ShortCut};
use serde::Deserialize as _;
use sim::geometry::Vec2;
use sim::limits::LOT_BYTES_MAX;
use sim::map::Map;
use sim::scenario::{Direction, Place, Scenario, ScenarioError};
use sim::validate::validate;
use sim::vehicle::VehicleSettings;
use std::path::Path;
use toml_edit::de::Deserializer;
use toml_edit::visit_mut::{self, VisitMut};
use toml_edit::{Array, Document, Formatted, InlineTable, Item, Value};

/// Reads a lot and checks that a vehicle can drive it forward: a scenario file, a `NAME.lot.toml` that names a map, or a
/// map with such a file beside it.
///
/// # Errors
/// The first thing wrong with it, with its place.
pub fn load(path: &Path, vehicle: &VehicleSettings) -> Result<Scenario, LoadError> {
    load_with_notes(path, vehicle).map(|loaded| loaded.scenario)
}

/// [`load`], with notes about the lot.
///
/// # Errors
/// The first thing wrong with it, with its place.
pub fn load_with_notes(path: &Path, vehicle: &VehicleSettings) -> Result<Loaded, LoadError> {
    if import::is_map(path) {
        return MapLot::read(path)?.scenario(vehicle);
    }
    let (text, file) = (read_text(path, LOT_BYTES_MAX)?, path.display().to_string());
    let document = parse_toml(&text, &file)?;
    if names_a_map(&document) {
        return MapLot::read(path)?.scenario(vehicle);
    }
    let scenario = scenario_of(&document, &text, &file, vehicle)?;
    Ok(Loaded { scenario, files: vec![path.to_owned()], notes: Vec::new(), frame: None, is_by_hand: true })
}

/// The junctions and the short cuts of a lot written by hand, each in a note; none if there are none, or the vehicle does
/// not fit.
///
/// That takes as long as building its map, and longer: [`load_with_notes`] leaves it to whoever shows notes.
pub fn junctions(scenario: &Scenario, vehicle: &VehicleSettings) -> Vec<Note> {
    let Ok(map) = Map::build(scenario.clone(), vehicle) else {
        return Vec::new();
    };
    let ways = branches::find(&map, vehicle);
    let place = |at: Vec2| [at.x, at.y].map(f64::from);
    let mouths: Vec<_> = ways.branches.into_iter().map(|branch| place(branch.mouth)).collect();
    let noted = |way: branches::ShortCut| ShortCut { middle: place(way.middle), joins_m: way.joins_m };
    let short_cuts: Vec<_> = ways.short_cuts.into_iter().map(noted).collect();
    let open = (!mouths.is_empty()).then_some(Note::OpenByHand { mouths });
    let shorter = (!short_cuts.is_empty()).then_some(Note::ShortCutsByHand { short_cuts });
    open.into_iter().chain(shorter).collect()
}

fn names_a_map(document: &Document<&str>) -> bool {
    document.as_table().contains_key("map")
}

/// Checks that the lot of a file, as [`load`] returned it, can be driven in a direction.
///
/// # Errors
/// [`LoadError::ForwardOnly`] with the line of the route's last point, where a drive in reverse starts, or of the obstacle that
/// stands there; for a map, the line of the key that says where the route ends.
pub fn check_direction(
    path: &Path,
    Loaded { scenario, frame, .. }: &Loaded,
    direction: Direction,
    vehicle: &VehicleSettings,
) -> Result<(), LoadError> {
    let Err(error) = validate(&direction.of(scenario.clone()), vehicle) else {
        return Ok(());
    };
    let n_points = scenario.reference_path.points.len();
    let place = match (direction, error.place) {
        (Direction::Reverse, Place::ReferencePath(Some(i))) => Place::ReferencePath(Some(n_points - 1 - i)),
        (_, place) => place,
    };
    let file = if import::is_map(path) { path.with_extension("lot.toml") } else { path.to_owned() };
    let line = read_text(&file, LOT_BYTES_MAX).ok().and_then(|text| {
        let document = Document::parse(text.as_str()).ok()?;
        let offset = if names_a_map(&document) { offset_of_finish(&document) } else { offset_of(&document, place) };
        offset.map(|offset| line_at(&text, offset))
    });
    let frame = frame.as_ref().map_or_else(String::new, |frame| format!(" ({frame})"));
    // A map without a file beside it is itself the place.
    let file = if line.is_some() { &file } else { path };
    Err(LoadError::ForwardOnly {
        location: Location { file: file.display().to_string(), line },
        problem: format!("{place}: {}{frame}", error.problem),
        remedy: error.remedy,
    })
}

/// Reads the text of a scenario file and checks that a vehicle can drive it forward; `file` is its name in errors.
///
/// # Errors
/// The first thing wrong with it, with its line.
pub fn parse(text: &str, file: &str, vehicle: &VehicleSettings) -> Result<Scenario, LoadError> {
    scenario_of(&parse_toml(text, file)?, text, file, vehicle)
}

fn parse_toml<'a>(text: &'a str, file: &str) -> Result<Document<&'a str>, LoadError> {
    Document::parse(text).map_err(|error| {
        let offset = error.span().map_or(0, |span| span.start);
        let problem = format!("not TOML: {}", error.message().trim());
        LoadError::faulty(file, text, offset, &problem, "fix the syntax there".to_owned())
    })
}

fn scenario_of(
    document: &Document<&str>,
    text: &str,
    file: &str,
    vehicle: &VehicleSettings,
) -> Result<Scenario, LoadError> {
    let faulty =
        |offset: usize, problem: String, remedy: String| LoadError::faulty(file, text, offset, &problem, remedy);
    let scenario = Scenario::deserialize(Deserializer::from(document.clone())).map_err(|error| {
        let offset = error.span().map_or(0, |span| span.start);
        let problem = error.message().trim().to_owned();
        let remedy = remedy_for(&problem).to_owned();
        faulty(offset, problem, remedy)
    })?;
    if let Some((offset, length)) = first_odd_point(document) {
        // The deserialiser of points reads two numbers and ignores the rest.
        return Err(faulty(offset, format!("a point of {length} numbers"), "write points as [x, y]".to_owned()));
    }
    validate(&scenario, vehicle).map_err(|error| {
        let offset = offset_of(document, error.place).unwrap_or(0);
        let ScenarioError { place, problem, remedy } = error;
        faulty(offset, format!("{place}: {problem}"), remedy)
    })?;
    Ok(scenario)
}

/// The file of a scenario: one vertex or obstacle per line, coordinates as short as they are exact.
///
/// Reading it back gives an equal scenario.
pub fn to_toml(scenario: &Scenario) -> String {
    // Serialising plain numbers, strings and lists into a tree cannot fail.
    let mut document = toml_edit::ser::to_document(scenario).expect("a scenario is representable as TOML");
    for key in ["reference_path", "noise"] {
        if let Some(item) = document.get_mut(key)
            && let Ok(mut table) = std::mem::take(item).into_table()
        {
            table.decor_mut().set_prefix("\n");
            *item = Item::Table(table);
        }
    }
    Layout.visit_document_mut(&mut document);
    document.to_string()
}

/// What to do about a message of the deserialiser.
fn remedy_for(problem: &str) -> &'static str {
    if problem.starts_with("unknown field") {
        "delete or rename it"
    } else if problem.starts_with("missing field") {
        "add it; scenarios/examples shows a whole file"
    } else if problem.starts_with("unknown variant") {
        "use one of these"
    } else if problem.starts_with("invalid length") {
        "write points as [x, y]"
    } else if problem.starts_with("invalid type: map, expected a sequence") {
        "a section of which there may be several has double brackets, as in [[obstacle]]"
    } else if problem.starts_with("invalid type") {
        "write a value of the expected type"
    } else {
        "see scenarios/examples for a whole file"
    }
}

/// Where an element starts in the text.
fn offset_of(document: &Document<&str>, place: Place) -> Option<usize> {
    let root = document.as_table();
    let key = |key: &str| root.get(key);
    let start = match place {
        Place::Name => key("name")?.span(),
        Place::Boundary(vertex) => nth_or_whole(key("boundary")?, vertex),
        Place::Island(i) => nth_or_whole(key("island")?, Some(i)),
        Place::Obstacle(i) => nth_or_whole(key("obstacle")?, Some(i)),
        Place::SpeedBump(i) => nth_or_whole(key("speed_bump")?, Some(i)),
        Place::ReferencePath(None) => key("reference_path")?.span(),
        Place::ReferencePath(point) => nth_or_whole(key("reference_path")?.get("points")?, point),
    };
    start.map(|span| span.start)
}

/// Where a `NAME.lot.toml` says where its route ends.
fn offset_of_finish(document: &Document<&str>) -> Option<usize> {
    let root = document.as_table();
    let item = ["goal", "centre_line", "loop"].into_iter().find_map(|key| root.get(key))?;
    item.span().map(|span| span.start)
}

/// Offset and length of the first point that does not have two numbers.
fn first_odd_point(document: &Document<&str>) -> Option<(usize, usize)> {
    let root = document.as_table();
    let islands: Vec<&Array> = match root.get("island") {
        Some(Item::ArrayOfTables(tables)) => {
            tables.iter().filter_map(|table| table.get("polygon")?.as_array()).collect()
        }
        Some(Item::Value(Value::Array(tables))) => {
            tables.iter().filter_map(|table| table.as_inline_table()?.get("polygon")?.as_array()).collect()
        }
        _ => Vec::new(),
    };
    let boundary = root.get("boundary").and_then(Item::as_array);
    let route = root.get("reference_path").and_then(|table| table.get("points")?.as_array());
    boundary
        .into_iter()
        .chain(route)
        .chain(islands)
        .flat_map(|points| points.iter())
        .filter_map(|point| Some((point.span()?.start, point.as_array()?.len())))
        .find(|&(_, length)| length != 2)
}

/// Span of an element of an array or of an array of tables; of all of it where there is no such element.
fn nth_or_whole(list: &Item, index: Option<usize>) -> Option<std::ops::Range<usize>> {
    let element = match (list, index) {
        (Item::Value(Value::Array(array)), Some(i)) => array.get(i).and_then(Value::span),
        (Item::ArrayOfTables(tables), Some(i)) => tables.get(i).and_then(toml_edit::Table::span),
        _ => None,
    };
    element.or_else(|| list.span())
}

/// Numbers without the noise of f32 → f64, lists of points and tables one element per line.
struct Layout;

impl VisitMut for Layout {
    fn visit_float_mut(&mut self, node: &mut Formatted<f64>) {
        let single = *node.value() as f32;
        // The shortest decimal that reads back as the same f32.
        if let Ok(shortest) = single.to_string().parse() {
            *node = Formatted::new(shortest);
        }
    }

    fn visit_array_mut(&mut self, node: &mut Array) {
        visit_mut::visit_array_mut(self, node);
        let is_list = node.iter().any(|value| value.is_array() || value.is_inline_table());
        for (i, value) in node.iter_mut().enumerate() {
            value.decor_mut().set_prefix(match (is_list, i) {
                (true, _) => "\n    ",
                (false, 0) => "",
                (false, _) => " ",
            });
        }
        if is_list {
            node.set_trailing("\n");
            node.set_trailing_comma(true);
        }
    }

    fn visit_inline_table_mut(&mut self, node: &mut InlineTable) {
        node.fmt();
        visit_mut::visit_inline_table_mut(self, node);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{self, ReferenceLot};
    use sim::seed::RootSeed;

    const EXAMPLE: &str = include_str!("../examples/slalom.toml");

    fn message(text: &str) -> String {
        match parse(text, "lot.toml", &VehicleSettings::hyundai_hg300()) {
            Ok(_) => "accepted".to_owned(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn every_example_loads_and_is_valid_both_ways() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
        let mut files: Vec<_> =
            folder.read_dir().expect("examples").map(|entry| entry.expect("entry").path()).collect();
        files.retain(|file| file.extension().is_some_and(|extension| extension == "toml" || extension == "yaml"));
        files.sort();
        assert!(files.len() >= 5, "{files:?}");
        for file in files {
            let scenario = load(&file, &VehicleSettings::hyundai_hg300()).unwrap_or_else(|error| panic!("{error}"));
            let back = scenario.reversed();
            validate(&back, &VehicleSettings::hyundai_hg300())
                .unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        }
    }

    #[test]
    fn every_map_in_the_folder_becomes_a_lot_without_junctions_for_both_ways() {
        let car = VehicleSettings::hyundai_hg300();
        let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
        let files = [("maps", 29), ("maps-blind", 30), ("maps-blind-2", 30)].map(|(folder, count)| {
            let entries = examples.join(folder).read_dir().expect("maps").map(|entry| entry.expect("entry").path());
            let mut files: Vec<_> =
                entries.filter(|file| file.extension().is_some_and(|extension| extension == "yaml")).collect();
            files.sort();
            assert_eq!(files.len(), count, "{folder}: {files:?}");
            files
        });
        for file in files.concat() {
            let loaded = load_with_notes(&file, &car).unwrap_or_else(|error| panic!("{error}"));
            let is_open = |note: &Note| matches!(note, Note::Open { .. } | Note::ShortCuts { .. });
            assert!(!loaded.notes.iter().any(is_open), "{}: {:?}", file.display(), loaded.notes);
            let length_m = sim::path::Path::new(&loaded.scenario.reference_path).length_m();
            assert!((80.0..=300.0).contains(&length_m), "{}: {length_m} m", file.display());
            for direction in Direction::BOTH {
                assert_eq!(check_direction(&file, &loaded, direction, &car), Ok(()));
            }
        }
    }

    /// A map's junctions were named, but not those of the lot that `generate` writes of it.
    #[test]
    fn junctions_of_a_lot_written_by_hand_are_named() {
        let car = VehicleSettings::hyundai_hg300();
        let lane = parse(EXAMPLE, "slalom.toml", &car).expect("the example is sound");
        assert_eq!(junctions(&lane, &car), []);
        // A side street of 5 m, 27 m long.
        let lot = Scenario::new(
            "two streets",
            [
                (-18.0, -3.0),
                (90.0, -3.0),
                (90.0, 3.0),
                (32.5, 3.0),
                (32.5, 30.0),
                (27.5, 30.0),
                (27.5, 3.0),
                (-18.0, 3.0),
            ],
            [(0.0, 0.0), (70.0, 0.0)],
        );
        let notes = junctions(&lot, &car);
        let [note @ Note::OpenByHand { mouths }] = &notes[..] else { panic!("{notes:?}") };
        assert!(mouths.len() == 1 && (mouths[0][0] - 30.0).abs() < 2.5, "{mouths:?}");
        assert!(note.to_string().starts_with("the route has 1 junction, near ("), "{note}");
        assert!(note.to_string().contains("islands or obstacles"), "{note}");
    }

    /// Nothing on such a way is far from the route: it was said of no lot.
    #[test]
    fn a_short_cut_of_a_lot_written_by_hand_is_named_with_what_it_leaves_out() {
        let car = VehicleSettings::hyundai_hg300();
        // Two legs 12 m apart, and walls between them.
        let boundary = [(-10.0, -4.0), (66.0, -4.0), (66.0, 16.0), (-10.0, 16.0)];
        let mut lot = Scenario::new("hairpin", boundary, [(0.0, 0.0), (60.0, 0.0), (60.0, 12.0), (0.0, 12.0)])
            .with_corner_radius_m(5.0);
        let wall = |from: f32, to: f32| sim::scenario::Island {
            polygon: [(from, 5.8), (to, 5.8), (to, 6.2), (from, 6.2)].map(Vec2::from).to_vec(),
            height_m: 0.15,
        };
        lot.islands = vec![wall(-9.7, 25.0), wall(30.0, 55.0)];
        let notes = junctions(&lot, &car);
        let [note @ Note::ShortCutsByHand { short_cuts }] = &notes[..] else { panic!("{notes:?}") };
        assert_eq!(short_cuts.len(), 1);
        let said = note.to_string();
        assert!(said.starts_with("the route has 1 short cut, near (2") && said.contains(") from metre 2"), "{said}");
        assert!(said.contains("may take the shorter way; close them with islands or obstacles"), "{said}");
        lot.islands = vec![wall(-9.7, 55.0)];
        assert_eq!(junctions(&lot, &car), []);
    }

    #[test]
    fn writing_and_reading_gives_the_same_lot() {
        let parse = |text: &str, file: &str| parse(text, file, &VehicleSettings::hyundai_hg300());
        for lot in ReferenceLot::ALL {
            let scenario = reference::lot(lot, RootSeed(3));
            assert_eq!(parse(&to_toml(&scenario), "lot.toml"), Ok(scenario));
        }
        let example = parse(EXAMPLE, "slalom.toml").expect("the example is sound");
        assert_eq!(parse(&to_toml(&example), "lot.toml"), Ok(example));
    }

    #[test]
    fn a_written_lot_is_short_and_exact() {
        let parse = |text: &str, file: &str| parse(text, file, &VehicleSettings::hyundai_hg300());
        let text = to_toml(&parse(EXAMPLE, "slalom.toml").expect("the example is sound"));
        for line in [
            "    [-18.0, -2.5],",
            r#"    { class = "cone", x_m = 37.3, y_m = 16.0, heading_deg = 0.0 },"#,
            "corner_radius_m = 5.0",
        ] {
            assert!(text.lines().any(|found| found == line), "no line {line:?} in\n{text}");
        }
    }

    /// Replaces one line of the example and expects the error to name that line (or the one given).
    #[test]
    fn every_fault_of_a_file_is_named_with_its_line_and_a_remedy() {
        let line_of = |needle: &str| {
            1 + EXAMPLE.lines().position(|line| line.contains(needle)).unwrap_or_else(|| panic!("no line {needle:?}"))
        };
        // Text replaced, by what, the line the error names (found by its original text), the rest of the message.
        let table = [
            ("name = \"slalom\"", "name = slalom", "name =", "not TOML: "),
            ("name = \"slalom\"", "title = \"slalom\"", "name =", "unknown field `title`, expected one of `name`"),
            (
                "name = \"slalom\"",
                "name = 7",
                "name =",
                "invalid type: integer `7`, expected a string; write a value of",
            ),
            ("name = \"slalom\"", "name = \"\"", "name =", "name: the name is empty; give the lot a name"),
            ("[43.0, 46.0],", "[43.0, nan],", "[43.0, 46.0]", "boundary, vertex 3: y is NaN; write a finite number"),
            ("[43.0, 46.0],", "[43.0, 46.0, 0.0],", "[43.0, 46.0]", "a point of 3 numbers; write points as [x, y]"),
            (
                "[43.0, 46.0],",
                "[43.0, \"46\"],",
                "[43.0, 46.0]",
                "invalid type: string \"46\", expected f32; write a value",
            ),
            ("[37.0, 6.5], ", "[43.0, 6.5], ", "[43.0, -2.5]", "boundary, vertex 2: the edge from vertex 2 to 3 meets"),
            (
                "corner_radius_m = 5.0",
                "corner_radius = 5.0",
                "corner_radius_m",
                "unknown field `corner_radius`, expected `points`",
            ),
            (
                "corner_radius_m = 5.0",
                "corner_radius_m = inf",
                "[reference_path]",
                "reference_path: corner_radius_m is inf",
            ),
            (
                "[40.0, 28.0]]",
                "[40.0, 48.0]]",
                "[40.0, 28.0]]",
                "reference_path, point 3: the point (40.00, 48.00) lies outside the lot",
            ),
            (
                "points = [[0.0, 0.5],",
                "points = [[-17.5, 0.5],",
                "points =",
                "reference_path, point 1: the car (4.91 m",
            ),
            (
                "level = \"paper\"",
                "level = \"loud\"",
                "level =",
                "unknown variant `loud`, expected one of `clean`, `paper`, `hard`; use",
            ),
            ("height_m = 0.15", "height_m = 15.0", "[[island]]", "island 1: height_m is 15; write a number of metres"),
            (
                "class = \"van\"",
                "class = \"lorry\"",
                "class = \"van\"",
                "unknown variant `lorry`, expected one of `sedan`",
            ),
            ("x_m = 29.0\n", "", "class = \"van\"", "missing field `x_m`; add it"),
            ("height_m = 2.1", "height_m = -2.1", "class = \"van\"", "obstacle 2: height_m is -2.1; write a number"),
            (
                "x_m = 37.3",
                "x_m = 40.0",
                "class = \"cone\"",
                "obstacle 3: the cone at (40.00, 16.00) stands on the reference path",
            ),
            ("length_m = 0.5", "length_m = 0.0", "[[speed_bump]]", "speed_bump 1: length_m is 0; write"),
            ("[[speed_bump]]", "[[speedbump]]", "[[speed_bump]]", "unknown field `speedbump`, expected one of"),
        ];
        for (original, replacement, named_line, expected) in table {
            assert_eq!(EXAMPLE.matches(original).count(), 1, "{original:?} must occur once");
            let message = message(&EXAMPLE.replacen(original, replacement, 1));
            // A table of the file is named by its header, one line above its first key.
            let line =
                line_of(named_line) - usize::from(named_line.starts_with("class") && !original.starts_with("class"));
            let expected = format!("lot.toml:{line}: {expected}");
            assert!(message.starts_with(&expected), "got:      {message}\nexpected: {expected}");
        }
    }

    /// Written lots hold one obstacle per line; errors find it there too.
    #[test]
    fn a_fault_in_a_written_lot_is_named_with_its_line() {
        let mut scenario = reference::lot(ReferenceLot::B, RootSeed(1));
        scenario.obstacles[17].length_m = Some(-1.0);
        let text = to_toml(&scenario);
        let line = 1 + text.lines().position(|line| line.contains("length_m = -1.0")).expect("it is written");
        let expected = format!("lot.toml:{line}: obstacle 18: length_m is -1; write a number of metres");
        assert!(message(&text).starts_with(&expected), "got: {}\nexpected: {expected}", message(&text));
    }

    /// Whatever is in a file: an error with a line of it or a lot that builds, never a panic.
    #[test]
    fn damaged_files_never_panic() {
        use rand::RngExt as _;
        const WORDS: [&str; 12] =
            ["nan", "inf", "-1e30", "1e30", "1e-30", "0", "-0.0", "\"x\"", "[]", "{}", "40.0", "[["];
        let lines: Vec<&str> = EXAMPLE.lines().collect();
        let mut rng = RootSeed(9).rng(sim::seed::Stream::Suite, 0);
        let (mut accepted, mut refused) = (0, 0);
        for _ in 0..4000 {
            let mut damaged: Vec<String> = lines.iter().map(ToString::to_string).collect();
            for _ in 0..rng.random_range(1..3) {
                let i = rng.random_range(0..damaged.len());
                let mut words: Vec<String> = damaged[i].split(' ').map(str::to_owned).collect();
                let word = rng.random_range(0..words.len());
                match rng.random_range(0..4) {
                    0 => words[word] = WORDS[rng.random_range(0..WORDS.len())].to_owned(),
                    1 => words[word] = words[word].replace(|c: char| c.is_ascii_digit(), "7"),
                    2 => drop(words.remove(word)),
                    _ => words.insert(word, WORDS[rng.random_range(0..WORDS.len())].to_owned()),
                }
                damaged[i] = words.join(" ");
            }
            match parse(&damaged.join("\n"), "lot.toml", &VehicleSettings::hyundai_hg300()) {
                Ok(scenario) => {
                    accepted += 1;
                    if accepted % 20 == 0 {
                        sim::map::Map::build(scenario, &VehicleSettings::hyundai_hg300())
                            .expect("what loads also builds");
                    }
                }
                Err(LoadError::Faulty { line, .. }) => {
                    assert!((1..=lines.len()).contains(&line));
                    refused += 1;
                }
                Err(other) => panic!("{other}"),
            }
        }
        assert!(accepted > 200 && refused > 1000, "{accepted} accepted, {refused} refused: too gentle or too rough");
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = load(Path::new("no/such/lot.toml"), &VehicleSettings::hyundai_hg300()).expect_err("there is none");
        assert!(error.to_string().starts_with("no/such/lot.toml: cannot be read: No such file"), "{error}");
    }
}
