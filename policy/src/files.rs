//! Files of a run: written whole or not at all, numbered by schema, refused by name.

use serde::Serialize;
use serde::de::DeserializeOwned;
use sim::limits::RUN_TOML_BYTES_MAX;
use std::fs;
use std::io::{Cursor, Write as _};
use std::path::Path;
use storage::sums;
pub(crate) use storage::whole::{WRITE_REMEDY, write_with as write_atomically};
use toml::{Table, Value};

pub use storage::FileError;

pub(crate) const RESTORE_REMEDY: &str = "restore it from a copy, or train again into another folder";
pub(crate) const SCHEMA_REMEDY: &str = "train again into another folder, or use the version of lotpilot that wrote it";

/// A TOML file with one name and a schema version, which is its first key.
pub(crate) trait Format: Serialize + DeserializeOwned {
    /// Its name within its folder.
    const NAME: &'static str;
    /// The version of the format: raise it whenever an older reader would misread the file.
    const SCHEMA: u32;
    /// Its most bytes.
    const BYTES_MAX: u64 = RUN_TOML_BYTES_MAX;
}

/// Writes a file into its folder; it is finished when it is listed.
pub(crate) fn write<T: Format>(folder: &Path, content: &T) -> Result<(), FileError> {
    let path = folder.join(T::NAME);
    let text = toml::to_string_pretty(content)
        .map_err(|error| FileError::new(&path, error, "report this: the content cannot be written as TOML"))?;
    write_atomically(&path, |file| write!(file, "schema = {}\n{text}", T::SCHEMA).map_err(|error| error.to_string()))
}

/// Reads a file from its folder.
pub(crate) fn read<T: Format>(folder: &Path) -> Result<T, FileError> {
    let path = folder.join(T::NAME);
    let text = sums::read_to_string(&path, T::BYTES_MAX)?;
    parse(&text, &path)
}

/// What the text of a file says; errors name the file.
pub(crate) fn parse<T: Format>(text: &str, path: &Path) -> Result<T, FileError> {
    let mut table: Table = text.parse().map_err(|error| FileError::new(path, error, RESTORE_REMEDY))?;
    match table.remove("schema") {
        Some(Value::Integer(schema)) if schema == i64::from(T::SCHEMA) => {}
        Some(schema) => {
            let problem = format!("schema {schema}; this program reads schema {}", T::SCHEMA);
            return Err(FileError::new(path, problem, SCHEMA_REMEDY));
        }
        None => {
            let problem = format!("no schema number, so it is from an older version; this one reads {}", T::SCHEMA);
            return Err(FileError::new(path, problem, SCHEMA_REMEDY));
        }
    }
    T::deserialize(Value::Table(table)).map_err(|error| FileError::new(path, error, RESTORE_REMEDY))
}

/// Reads a file from its folder; `None` if it is not finished.
pub(crate) fn read_if_finished<T: Format>(folder: &Path) -> Result<Option<T>, FileError> {
    sums::is_listed(folder, T::NAME)?.then(|| read(folder)).transpose()
}

/// Creates a folder if it is not there. Not those above it: a run whose folder was removed must not come back in part.
pub(crate) fn create_folder(folder: &Path) -> Result<(), FileError> {
    match fs::create_dir(folder) {
        Err(error) if !folder.is_dir() => Err(FileError::new(folder, error, WRITE_REMEDY)),
        _ => Ok(()),
    }
}

/// The content of a finished file of at most this many bytes.
pub(crate) fn open(path: &Path, bytes_max: u64) -> Result<Cursor<Vec<u8>>, FileError> {
    sums::read(path, bytes_max).map(Cursor::new)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::scratch;
    use serde::Deserialize;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Note {
        text: String,
        inner: Inner,
    }

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Inner {
        number: f32,
    }

    impl Format for Note {
        const NAME: &'static str = "note.toml";
        const SCHEMA: u32 = 3;
    }

    /// It was made again, with some of its files.
    #[test]
    fn a_folder_that_was_removed_does_not_come_back_in_part() {
        let folder = scratch("removed");
        let error = create_folder(&folder.join("round-01")).unwrap_err().to_string();
        assert!(error.contains("round-01") && !folder.exists(), "{error}");
    }

    #[test]
    fn a_file_begins_with_its_schema_and_other_schemas_are_refused_by_name() {
        let folder = scratch("note");
        create_folder(&folder).unwrap();
        let note = Note { text: "hello".to_owned(), inner: Inner { number: 0.1 } };
        assert_eq!(read_if_finished::<Note>(&folder).unwrap(), None);
        write(&folder, &note).unwrap();
        assert_eq!(read_if_finished::<Note>(&folder).unwrap(), None, "not listed yet");
        sums::list_all(&folder).unwrap();
        let path = folder.join("note.toml");
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("schema = 3\n"), "{text}");
        assert_eq!(read_if_finished::<Note>(&folder).unwrap(), Some(note));
        for (text, part) in [
            (text.replace("schema = 3\n", "schema = 2\n"), "schema 2"),
            (text.replace("schema = 3\n", ""), "older version"),
            (text.replace("text", "words"), "words"),
        ] {
            sums::write(&folder, "note.toml", text.as_bytes()).unwrap();
            let error = read::<Note>(&folder).unwrap_err().to_string();
            assert!(error.contains("note.toml") && error.contains(part), "{error}");
        }
        fs::remove_dir_all(folder).unwrap();
    }
}
