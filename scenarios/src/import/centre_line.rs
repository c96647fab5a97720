//! A centre line: a CSV file with a point per line, x and y in metres of the map's frame.

use crate::error::{LoadError, read_text, shortened};
use sim::limits::{CSV_BYTES_MAX, MAP_COORDINATE_MAX_M, ROUTE_POINTS_MAX};
use std::path::Path;

/// Points nearer than this count as one, metres in the lot.
const SAME_POINT_M: f64 = 0.01;

/// Reads the points of a line, two at least, for a lot that is so many times as large as the map.
///
/// # Errors
/// What is wrong with it, with file, line and remedy.
pub(super) fn read(path: &Path, scale: f64) -> Result<Vec<[f64; 2]>, LoadError> {
    parse(&read_text(path, CSV_BYTES_MAX)?, &path.display().to_string(), scale)
}

/// [`read`], of the text of a file; `file` is its name in errors.
pub(super) fn parse(text: &str, file: &str, scale: f64) -> Result<Vec<[f64; 2]>, LoadError> {
    // Some editors begin a file with it.
    let text = &without_indents(text.trim_start_matches('\u{feff}'));
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut points: Vec<[f64; 2]> = Vec::new();
    let commented = header_in_comment(text);
    for (i, record) in reader.records().enumerate() {
        let faulty = |line: usize, problem: String| LoadError::Faulty {
            file: file.to_owned(),
            line,
            problem,
            remedy: "write one point per line: x,y in metres of the map's frame".to_owned(),
        };
        let record = record.map_err(|error| faulty(i + 1, format!("not CSV: {error}")))?;
        let line = record.position().map_or(i + 1, |position| line_of(text, position));
        let numbers: Vec<Option<f64>> = record.iter().take(2).map(|cell| cell.parse().ok()).collect();
        if let (0, [Some(_), Some(_)], Some((line, header))) = (i, &numbers[..], &commented)
            && header.len() == record.len()
            && let Some(problem) = misplaced(header)
        {
            return Err(faulty(*line, format!("{problem} (if this comment is no header, change it)")));
        }
        match numbers[..] {
            [Some(x), Some(y)] if x.abs() <= MAP_COORDINATE_MAX_M && y.abs() <= MAP_COORDINATE_MAX_M => {
                if points.len() == ROUTE_POINTS_MAX {
                    return Err(faulty(line, format!("the line has more than {ROUTE_POINTS_MAX} points")));
                }
                let is_far = |&[a, b]: &[f64; 2]| scale * libm::hypot(a - x, b - y) > SAME_POINT_M;
                if points.last().is_none_or(is_far) {
                    points.push([x, y]);
                }
            }
            // A first line of words is a header; one that begins like a number is a point that is written wrongly.
            [None] | [None, None] if i == 0 && !record[0].starts_with(is_of_number) => {
                if let Some(problem) = misplaced(&record) {
                    return Err(faulty(line, problem));
                }
            }
            _ => {
                let cells = record.iter().collect::<Vec<_>>().join(",");
                return Err(faulty(line, format!("{:?} is not a point", shortened(&cells))));
            }
        }
    }
    if points.len() < 2 {
        return Err(LoadError::Map {
            file: file.to_owned(),
            place: "centre line".to_owned(),
            problem: format!("the line has {} points", points.len()),
            remedy: "give at least a start and a finish".to_owned(),
        });
    }
    Ok(points)
}

/// The text without the blanks before comments and in empty lines: to the reader they would be records.
fn without_indents(text: &str) -> String {
    let lines = text.split_inclusive('\n').map(|line| {
        let unindented = line.trim_start_matches([' ', '\t']);
        if unindented.starts_with('#') || unindented.trim_end().is_empty() { unindented } else { line }
    });
    lines.collect()
}

/// The line of a record, counted from 1. To the reader it begins where the record before ends: with the LF of a CRLF, and with
/// comments and empty lines.
fn line_of(text: &str, position: &csv::Position) -> usize {
    let from = usize::try_from(position.byte()).ok().and_then(|byte| text.get(byte..)).unwrap_or_default();
    let passed_over = from.lines().take_while(|line| line.is_empty() || line.starts_with('#')).count();
    position.line() as usize + passed_over
}

/// The last comment before the first point, and its line, if it can be a header: `numpy.savetxt` writes them so.
fn header_in_comment(text: &str) -> Option<(usize, csv::StringRecord)> {
    let before =
        text.lines().map(str::trim).enumerate().take_while(|(_, line)| line.is_empty() || line.starts_with('#'));
    let (i, comment) = before.filter(|(_, line)| !line.is_empty()).last()?;
    let cells: csv::StringRecord = comment.trim_start_matches('#').split(',').map(str::trim).collect::<Vec<_>>().into();
    // `x` or `x [m]`, but no words.
    let is_name = |cell: &str| {
        let mut words = cell.split_whitespace();
        words.next().is_some() && words.next().is_none_or(|unit| unit.starts_with(['[', '('])) && words.next().is_none()
    };
    cells.iter().all(is_name).then_some((i + 1, cells))
}

/// Names of columns in degrees: of latitudes, and of longitudes.
const DEGREES: [&[&str]; 2] = [&["lat", "latitude"], &["lon", "lng", "longitude"]];

/// What is wrong with a header whose columns are others than x and y, in this order: read as they are, they would be another
/// line.
fn misplaced(header: &csv::StringRecord) -> Option<String> {
    let has = |column: usize, known: &[&str]| {
        let lower = header.get(column).unwrap_or_default().to_lowercase();
        lower.split(|char: char| !char.is_alphanumeric()).any(|word| known.contains(&word))
    };
    let known = [("x", ["x", "easting", "east"]), ("y", ["y", "northing", "north"])];
    let has_both = DEGREES.iter().all(|names| (0..header.len()).any(|column| has(column, names)));
    let are_named = (0..).zip(known).all(|(column, (_, names))| has(column, &names));
    for (column, name) in header.iter().enumerate() {
        // Beside x and y, degrees do no harm, and farther on `a_lat` may be an acceleration.
        if !are_named && has(column, &DEGREES.concat()) && (column < 2 || has_both) {
            return Some(format!("the header has {:?}, which is in degrees", shortened(name)));
        }
        let (word, belongs) = match known.map(|(_, names)| has(column, &names)) {
            [true, false] => ("x", 0),
            [false, true] => ("y", 1),
            _ => continue,
        };
        // A second one does none, either, behind one that is where it belongs.
        if column != belongs && !has(belongs, &known[belongs].1) {
            let (is, should) = (column + 1, belongs + 1);
            return Some(format!(
                "the header has {:?} in column {is}; {word} is read from column {should}",
                shortened(name)
            ));
        }
    }
    None
}

/// Whether numbers begin with it.
fn is_of_number(first: char) -> bool {
    first.is_ascii_digit() || "+-.".contains(first)
}
