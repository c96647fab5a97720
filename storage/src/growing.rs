//! Files that grow line by line, several of them together, and continue after the process has been killed.

use crate::error::FileError;
use crate::sums;
use crate::{sealed, whole};
use sha2::{Digest as _, Sha256};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

const REMEDY: &str = "restore it from a copy; or delete it and the file that ends in .unfinished to begin this again";
const LOST_REMEDY: &str =
    "restore the file that ends in .unfinished from a copy; or delete this one to begin this again";
/// Bytes of what says how far files are whole: a line for each.
const MARK_BYTES_MAX: u64 = 65_536;

/// Files that grow part by part: a part is added to all of them, or to none. The file `NAME.unfinished` says how far they
/// are whole, and of what they are; it is there before anything is in them.
#[derive(Debug)]
pub struct Growing {
    folder: PathBuf,
    mark: PathBuf,
    origin: String,
    files: Vec<GrowingFile>,
    parts: usize,
}

#[derive(Debug)]
struct GrowingFile {
    name: String,
    file: File,
    bytes: u64,
    sha256: Sha256,
}

impl Growing {
    /// Opens files of a folder as an interrupted process left them, without what it was adding, or creates them. `name`:
    /// what is done there. `origin`: a digest of what the files follow from, so that those of another run, copied beside
    /// this one, are not continued.
    ///
    /// # Errors
    /// If a file cannot be read or written, is not what was written into it, is of another origin, or has another name
    /// elsewhere; if one is not empty, and nothing says how much of it is whole.
    pub fn open(folder: &Path, name: &str, origin: &str, files: &[&str]) -> Result<Self, FileError> {
        let mark = mark_of(folder, name);
        let left = sealed::read_up_to(&mark, MARK_BYTES_MAX)?;
        let left = left.map(|text| Mark::parse(&mark, &text, origin, files)).transpose()?;
        let origin = origin.to_owned();
        let mut growing = Self { folder: folder.to_owned(), mark, origin, files: Vec::new(), parts: 0 };
        for (index, &name) in files.iter().enumerate() {
            let path = folder.join(name);
            let failed = |error: std::io::Error| FileError::new(&path, error, whole::WRITE_REMEDY);
            match std::fs::symlink_metadata(&path) {
                // Never through a link that somebody put there, and a pipe would be waited for.
                Ok(found) if !found.is_file() => {
                    return Err(FileError::new(&path, "is not a regular file", "remove it"));
                }
                Ok(found) if left.is_none() && found.len() > 0 => {
                    let mark = growing.mark.display();
                    let problem = format!("is not empty, but {mark}, which says how much of it is whole, is missing");
                    return Err(FileError::new(&path, problem, LOST_REMEDY));
                }
                _ => {}
            }
            let (bytes, sha256) =
                left.as_ref().map_or_else(|| Ok((0, Sha256::new())), |left| left.check(index, &path))?;
            let mut file = File::options().write(true).create(true).truncate(false).open(&path).map_err(failed)?;
            whole::ensure_one_name(&file, &path)?;
            file.set_len(bytes).map_err(failed)?;
            file.seek(SeekFrom::End(0)).map_err(failed)?;
            growing.files.push(GrowingFile { name: name.to_owned(), file, bytes, sha256 });
        }
        match left {
            Some(left) => growing.parts = left.parts,
            None => growing.write_mark()?,
        }
        Ok(growing)
    }

    /// Like [`open`](Self::open), but begins the files anew: whatever was left in them, even by another run, is deleted.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn begin(folder: &Path, name: &str, origin: &str, files: &[&str]) -> Result<Self, FileError> {
        let nothing = Mark { parts: 0, files: vec![(0, sums::digest(&[])); files.len()] };
        nothing.write(&mark_of(folder, name), origin, files.iter().copied())?;
        Self::open(folder, name, origin, files)
    }

    /// What is whole of a file, by its index, to be read from its beginning.
    ///
    /// # Errors
    /// If it cannot be opened.
    pub fn reader(&self, index: usize) -> Result<impl Read + use<>, FileError> {
        let GrowingFile { name, bytes, .. } = &self.files[index];
        let path = self.folder.join(name);
        let file = File::open(&path).map_err(|error| FileError::unreadable(&path, &error, REMEDY))?;
        Ok(file.take(*bytes))
    }

    /// Parts that are there.
    pub fn parts(&self) -> usize {
        self.parts
    }

    /// Adds a part: its text for each file, in their order.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn add(&mut self, texts: &[Vec<u8>]) -> Result<(), FileError> {
        for (file, text) in self.files.iter_mut().zip(texts) {
            let added = file.file.write_all(text).and_then(|()| file.file.sync_data());
            added.map_err(|error| {
                FileError::new(
                    &self.folder.join(&file.name),
                    format_args!("cannot be written: {error}"),
                    whole::WRITE_REMEDY,
                )
            })?;
            file.bytes += text.len() as u64;
            file.sha256.update(text);
        }
        self.parts += 1;
        self.write_mark()
    }

    fn write_mark(&self) -> Result<(), FileError> {
        let files = self.files.iter().map(|file| (file.bytes, sums::hex(&file.sha256.clone().finalize()))).collect();
        let names = self.files.iter().map(|file| file.name.as_str());
        Mark { parts: self.parts, files }.write(&self.mark, &self.origin, names)
    }

    /// Lists the files as finished. A process that dies meanwhile leaves the list, and what [`clear()`] deletes.
    ///
    /// # Errors
    /// If the list cannot be written.
    pub fn finish(self) -> Result<(), FileError> {
        let digests = self.files.into_iter().map(|file| (file.name, sums::hex(&file.sha256.finalize())));
        sums::list_as(&self.folder, digests)?;
        whole::remove(&self.mark)
    }
}

/// Deletes what says how far files are whole, which a process that died in [`Growing::finish`] left beside them: they are
/// listed.
///
/// # Errors
/// If it cannot be deleted.
pub fn clear(folder: &Path, name: &str) -> Result<(), FileError> {
    whole::remove(&mark_of(folder, name))
}

fn mark_of(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}.unfinished"))
}

/// How far files are whole.
struct Mark {
    parts: usize,
    /// Bytes and digest of each.
    files: Vec<(u64, String)>,
}

impl Mark {
    fn write<'a>(&self, path: &Path, origin: &str, names: impl Iterator<Item = &'a str>) -> Result<(), FileError> {
        let mut text = format!("{} {origin}\n", self.parts);
        for ((bytes, sum), name) in self.files.iter().zip(names) {
            let _ = writeln!(text, "{bytes} {sum} {name}");
        }
        sealed::write(path, text.as_bytes())
    }

    fn parse(path: &Path, text: &[u8], origin: &str, names: &[&str]) -> Result<Self, FileError> {
        let text = String::from_utf8_lossy(text);
        let mut lines = text.lines();
        let (parts, of) = lines.next().and_then(|line| line.split_once(' ')).unwrap_or_default();
        if of != origin {
            return Err(FileError::new(path, "was left by another run", REMEDY));
        }
        let mut mark = || {
            let parts = parts.parse().ok()?;
            let files = names.iter().map(|&name| {
                let (bytes, rest) = lines.next()?.split_once(' ')?;
                let (sum, of) = rest.split_once(' ')?;
                (of == name).then_some((bytes.parse().ok()?, sum.to_owned()))
            });
            Some(Self { parts, files: files.collect::<Option<_>>()? })
        };
        mark().ok_or_else(|| FileError::new(path, "is of other files", REMEDY))
    }

    /// How much of a file is whole, and the digest of that part, to continue from.
    fn check(&self, index: usize, path: &Path) -> Result<(u64, Sha256), FileError> {
        let (bytes, sum) = &self.files[index];
        // It may not be there yet.
        if *bytes == 0 {
            return Ok((0, Sha256::new()));
        }
        let unreadable = |error: io::Error| FileError::unreadable(path, &error, REMEDY);
        let mut sha256 = Sha256::new();
        let mut whole = File::open(path).map_err(unreadable)?.take(*bytes);
        let found = io::copy(&mut whole, &mut sha256).map_err(unreadable)?;
        if found < *bytes || sums::hex(&sha256.clone().finalize()) != *sum {
            return Err(FileError::new(path, "is damaged: it is not what was written into it", REMEDY));
        }
        Ok((*bytes, sha256))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// The digest was taken of what lay on the disk at the end, so that damage until then became what is right.
    #[test]
    fn what_the_disk_lost_before_the_end_is_damage() {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-growing-damage", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        let mut growing = Growing::open(&folder, "driving", "this", &["runs"]).unwrap();
        growing.add(&[b"1\n".to_vec()]).unwrap();
        fs::write(folder.join("runs"), "2\n").unwrap();
        growing.finish().unwrap();
        assert_eq!(sums::verify(&folder).faults.len(), 1);
        fs::remove_dir_all(folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_link_in_place_of_a_file_is_not_written_through() {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-growing-link", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        let diary = folder.join("diary");
        fs::write(&diary, "dear").unwrap();
        std::os::unix::fs::symlink(&diary, folder.join("runs")).unwrap();
        assert!(
            Growing::open(&folder, "driving", "this", &["runs"])
                .is_err_and(|error| error.to_string().contains("a regular"))
        );
        assert_eq!(fs::read(&diary).unwrap(), b"dear");
        fs::remove_dir_all(folder).unwrap();
    }

    /// `ln diary RUN/runs.jsonl` emptied the diary: symbolic links alone were refused.
    #[cfg(unix)]
    #[test]
    fn a_second_name_of_a_file_in_place_of_one_is_not_written_through() {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-growing-hard-link", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        let diary = folder.join("diary");
        fs::write(&diary, "dear").unwrap();
        fs::hard_link(&diary, folder.join("runs")).unwrap();
        let refused = Growing::begin(&folder, "driving", "this", &["runs"]).unwrap_err().to_string();
        assert!(refused.contains("a hard link"), "{refused}");
        assert_eq!(fs::read(&diary).unwrap(), b"dear");
        fs::remove_dir_all(folder).unwrap();
    }

    /// An evaluation whose `driving.unfinished` somebody had deleted lost hours of drives without a word.
    #[test]
    fn files_whose_mark_is_lost_are_not_emptied() {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-growing-lost", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        let (runs, mark) = (folder.join("runs"), folder.join("driving.unfinished"));
        let open = || Growing::open(&folder, "driving", "this", &["runs", "failures"]);
        // A death in the first moments: one file is there, and nothing in it.
        fs::write(&runs, "").unwrap();
        assert_eq!(open().unwrap().parts(), 0);
        // A death in the middle of the first part.
        fs::write(&runs, "1").unwrap();
        let mut growing = open().unwrap();
        assert_eq!((growing.parts(), fs::read(&runs).unwrap()), (0, Vec::new()));
        growing.add(&[b"1\n".to_vec(), Vec::new()]).unwrap();
        drop(growing);
        fs::remove_file(&mark).unwrap();
        let refused = open().unwrap_err().to_string();
        assert!(refused.contains("runs: is not empty") && refused.contains("or delete this one"), "{refused}");
        assert_eq!(fs::read(&runs).unwrap(), b"1\n");
        // Whoever knows that they are to be begun anew is not asked, even if they are of another run.
        let begin = |origin| Growing::begin(&folder, "driving", origin, &["runs", "failures"]).unwrap();
        begin("another").add(&[b"2\n".to_vec(), Vec::new()]).unwrap();
        let growing = begin("this");
        assert_eq!((growing.parts(), fs::read(&runs).unwrap()), (0, Vec::new()));
        growing.finish().unwrap();
        assert!(sums::verify(&folder).faults.is_empty() && !mark.exists());
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn files_go_on_after_the_last_whole_part_and_damage_is_noticed() {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-growing", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        let names = ["runs", "failures"];
        let open = || Growing::open(&folder, "driving", "this", &names);
        let contents =
            |growing: &Growing| [0, 1].map(|index| io::read_to_string(growing.reader(index).unwrap()).unwrap());
        let part = |n: u8| [vec![n, b'\n'], vec![]];
        let mut growing = open().unwrap();
        assert_eq!((growing.parts(), contents(&growing)), (0, [String::new(), String::new()]));
        growing.add(&part(b'1')).unwrap();
        growing.add(&part(b'2')).unwrap();
        drop(growing);
        // Killed in the middle of the third.
        fs::write(folder.join("runs"), "1\n2\n3").unwrap();
        let mut growing = open().unwrap();
        assert_eq!((growing.parts(), contents(&growing)), (2, ["1\n2\n".to_owned(), String::new()]));
        growing.add(&part(b'3')).unwrap();
        drop(growing);
        let of_other = Growing::open(&folder, "driving", "another", &names).unwrap_err().to_string();
        assert!(of_other.contains("driving.unfinished: was left by another run"), "{of_other}");
        let whole = fs::read(folder.join("runs")).unwrap();
        for damaged in ["1\n2\n4\n", "1\n2\n", ""] {
            fs::write(folder.join("runs"), damaged).unwrap();
            assert!(open().unwrap_err().to_string().contains("damaged"), "{damaged:?}");
        }
        fs::write(folder.join("runs"), whole).unwrap();
        open().unwrap().finish().unwrap();
        assert_eq!(sums::read(&folder.join("runs"), 100).unwrap(), b"1\n2\n3\n");
        assert!(sums::verify(&folder).faults.is_empty());
        fs::remove_dir_all(folder).unwrap();
    }
}
