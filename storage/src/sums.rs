//! The SHA-256 of every finished file of a folder, in the format of `sha256sum`: `sha256sum -c sha256sums` checks it, too.
//!
//! The list is the record of what is finished. A file is written under its name first and listed then, so that a file that
//! is not listed is what an interrupted command left: it is written again, and never read. A folder within a run is
//! finished when the folder above lists its list.

use crate::error::FileError;
use crate::lock;
use crate::read;
use crate::whole;
use sha2::{Digest as _, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, Seek as _};
use std::path::{Component, Path};

/// Name of the list.
pub const FILE: &str = "sha256sums";
/// Bytes of a list: a hundred thousand files with long names.
pub const LIST_BYTES_MAX: u64 = 32 << 20;

const RESTORE: &str = "restore it from a copy, or begin the run again";
/// The SHA-256 of some bytes in hexadecimal digits.
pub fn digest(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// The same of parts, one after the other, which need not lie in memory together.
pub fn digest_of_parts<T: AsRef<[u8]>>(parts: impl IntoIterator<Item = T>) -> String {
    let mut sha256 = Sha256::new();
    parts.into_iter().for_each(|part| sha256.update(part));
    hex(&sha256.finalize())
}

/// Bytes in hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// Digests by path within a folder.
type Sums = BTreeMap<String, String>;

/// The list of a folder; `None` if there is none.
fn list_of(folder: &Path) -> Result<Option<Sums>, FileError> {
    let path = folder.join(FILE);
    let text = match read::bytes(&path, LIST_BYTES_MAX) {
        Ok(bytes) => bytes,
        Err(error) if is_absent(&error) => return Ok(None),
        Err(error) => return Err(FileError::unreadable(&path, &error, RESTORE)),
    };
    let damaged = |line: usize| FileError::new(&path, format_args!("line {line} is damaged"), RESTORE);
    let text = String::from_utf8(text).map_err(|_| damaged(1))?;
    // The last line is whole only with its end.
    let lines = text.strip_suffix('\n').ok_or_else(|| damaged(text.lines().count().max(1)))?;
    let mut sums = Sums::new();
    for (index, line) in lines.split('\n').enumerate() {
        let parts = line.split_once("  ").filter(|(sum, name)| {
            sum.len() == 64 && sum.bytes().all(|byte| byte.is_ascii_hexdigit()) && lies_within(name)
        });
        let (sum, name) = parts.ok_or_else(|| damaged(index + 1))?;
        sums.insert(name.to_owned(), sum.to_owned());
    }
    Ok(Some(sums))
}

/// Whether a name is of a file in a folder, or below it, and not elsewhere.
fn lies_within(name: &str) -> bool {
    !name.is_empty() && Path::new(name).components().all(|component| matches!(component, Component::Normal(_)))
}

/// The folder, with a slash at its end, whose list has this name.
fn listed_folder(name: &str) -> Option<&str> {
    name.strip_suffix(FILE).filter(|folder| folder.ends_with('/'))
}

fn write_list(folder: &Path, sums: &Sums) -> Result<(), FileError> {
    let path = folder.join(FILE);
    if sums.is_empty() {
        return whole::remove(&path);
    }
    let mut text = String::new();
    for (name, sum) in sums {
        let _ = writeln!(text, "{sum}  {name}");
    }
    whole::write_parts(&path, &[text.as_bytes()])
}

/// Whether a folder has a list: whether anything is finished there.
///
/// # Errors
/// If the system does not say: a folder that seems to hold no work would be deleted.
pub fn exists(folder: &Path) -> Result<bool, FileError> {
    let path = folder.join(FILE);
    match path.try_exists() {
        Err(error) if !is_absent(&error) => Err(FileError::unreadable(&path, &error, RESTORE)),
        found => Ok(found.unwrap_or(false)),
    }
}

/// Whether there is no such file: a file has none in it, either.
fn is_absent(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory)
}

/// Whether a file of a folder is finished.
///
/// # Errors
/// If the list cannot be read or is damaged.
pub fn is_listed(folder: &Path, name: &str) -> Result<bool, FileError> {
    Ok(list_of(folder)?.is_some_and(|sums| sums.contains_key(name)))
}

/// The names of the finished files of a folder, in order; empty if it has no list.
///
/// # Errors
/// If the list cannot be read or is damaged.
pub fn names(folder: &Path) -> Result<Vec<String>, FileError> {
    Ok(list_of(folder)?.unwrap_or_default().into_keys().collect())
}

/// Lists files of a folder that are there and will not change: all at once.
///
/// # Errors
/// If one of them cannot be read, or the list cannot be written.
pub fn list(folder: &Path, names: &[&str]) -> Result<(), FileError> {
    let mut sums = list_of(folder)?.unwrap_or_default();
    for &name in names {
        let path = folder.join(name);
        let sum = read::open(&path, u64::MAX).and_then(|mut file| digest_of(&mut file));
        sums.insert(name.to_owned(), sum.map_err(|error| unreadable(&path, &error))?);
    }
    write_list(folder, &sums)
}

/// Lists files of a folder that were written with these digests, in hex: whatever the disk has changed since is damage.
///
/// # Errors
/// If the list cannot be read or written.
pub fn list_as(folder: &Path, digests: impl IntoIterator<Item = (String, String)>) -> Result<(), FileError> {
    let mut sums = list_of(folder)?.unwrap_or_default();
    sums.extend(digests);
    write_list(folder, &sums)
}

/// Lists every file of a folder, as it is before anybody else knows of it.
///
/// # Errors
/// See [`list`].
pub fn list_all(folder: &Path) -> Result<(), FileError> {
    let failed = |error: std::io::Error| FileError::unreadable(folder, &error, RESTORE);
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if is_content(&name) && entry.file_type().map_err(failed)?.is_file() {
            names.push(name);
        }
    }
    list(folder, &names.iter().map(String::as_str).collect::<Vec<_>>())
}

/// Lists the files of a folder within another one by one, with the digests of its own list, before it has its name: until
/// then it lies at `path`. It is known by them, and not finished.
///
/// # Errors
/// If the folder has no list, or the other's cannot be written.
pub fn list_files_of(folder: &Path, name: &str, path: &Path) -> Result<(), FileError> {
    let files = list_of(path)?.ok_or_else(|| FileError::new(&path.join(FILE), "is missing", RESTORE))?;
    list_as(folder, files.into_iter().map(|(file, sum)| (format!("{name}/{file}"), sum)))
}

/// Compares the list of a folder within another with what the other has of it, its files one by one or its list: whether it
/// is the one that was listed. The files themselves are compared when they are read.
///
/// # Errors
/// If a file is another one or missing from the list, the list is another one, or one cannot be read.
pub fn check_folder(folder: &Path, name: &str) -> Result<(), FileError> {
    let (within, path) = (format!("{name}/"), folder.join(name));
    let found = list_of(&path)?;
    for (listed, sum) in list_of(folder)?.unwrap_or_default() {
        let Some(file) = listed.strip_prefix(&within) else { continue };
        if file == FILE {
            read_listed(folder, &listed, LIST_BYTES_MAX)?;
            continue;
        }
        let Some(found) = &found else {
            return Err(FileError::new(
                &path.join(FILE),
                "is missing, so nothing says whether its files are whole",
                BEGUN_REMEDY,
            ));
        };
        match found.get(file) {
            Some(found) if *found == sum => {}
            Some(_) => return Err(FileError::new(&path.join(file), ANOTHER, BEGUN_REMEDY)),
            None => return Err(FileError::new(&path.join(file), UNLISTED, BEGUN_REMEDY)),
        }
    }
    Ok(())
}

/// Lists a folder within another by its own list, which vouches for all of its files: those that were listed one by one are
/// taken off, in one step.
///
/// # Errors
/// If the folder has no list, or the other's cannot be written.
pub fn list_folder(folder: &Path, name: &str) -> Result<(), FileError> {
    let within = format!("{name}/");
    let (path, list_name) = (folder.join(name).join(FILE), format!("{name}/{FILE}"));
    let list = read::bytes(&path, LIST_BYTES_MAX).map_err(|error| unreadable(&path, &error))?;
    let mut sums = list_of(folder)?.unwrap_or_default();
    sums.retain(|name, _| !name.starts_with(&within));
    sums.insert(list_name, digest(&list));
    write_list(folder, &sums)
}

/// Lists a finished folder within another by its files, but those of some names, instead of by its list, in one step: while
/// these are written again, the folder is known by the others, which [`check_folder`] compares. [`list_folder`] is the way
/// back.
///
/// # Errors
/// If the folder has no list, or the other's cannot be written.
pub fn list_but(folder: &Path, name: &str, but: &[&str]) -> Result<(), FileError> {
    let path = folder.join(name).join(FILE);
    let files = list_of(&folder.join(name))?.ok_or_else(|| FileError::new(&path, "is missing", RESTORE))?;
    let mut sums = list_of(folder)?.unwrap_or_default();
    sums.remove(&format!("{name}/{FILE}"));
    let kept = files.into_iter().filter(|(file, _)| !but.contains(&file.as_str()));
    sums.extend(kept.map(|(file, sum)| (format!("{name}/{file}"), sum)));
    write_list(folder, &sums)
}

/// Takes files off the list of a folder, before they are written again.
///
/// # Errors
/// If the list cannot be read or written.
pub fn unlist(folder: &Path, names: &[&str]) -> Result<(), FileError> {
    let Some(mut sums) = list_of(folder)? else { return Ok(()) };
    let count = sums.len();
    sums.retain(|name, _| !names.contains(&name.as_str()));
    if sums.len() == count { Ok(()) } else { write_list(folder, &sums) }
}

/// Writes a file of a folder and lists it.
///
/// # Errors
/// If it cannot be written, or the list is damaged.
pub fn write(folder: &Path, name: &str, content: &[u8]) -> Result<(), FileError> {
    let sum = digest(content);
    let mut sums = list_of(folder)?.unwrap_or_default();
    match sums.get(name) {
        // Whatever lies there now: only as much of it is read as would be the same.
        Some(listed) if *listed == sum && is_content_of(&folder.join(name), content) => return Ok(()),
        // Never listed with a digest that is not its own, whenever the process dies.
        Some(_) => unlist(folder, &[name])?,
        None => {}
    }
    whole::write_parts(&folder.join(name), &[content])?;
    sums.insert(name.to_owned(), sum);
    write_list(folder, &sums)
}

fn is_content_of(path: &Path, content: &[u8]) -> bool {
    read::bytes(path, content.len() as u64).is_ok_and(|found| found == content)
}

/// Writes a folder with its list within another, in place of one that is there, and lists it; without files, there is no
/// such folder afterwards.
///
/// # Errors
/// If it cannot be written.
pub fn write_folder(
    folder: &Path,
    name: &str,
    files: impl IntoIterator<Item = (String, Vec<u8>)>,
) -> Result<(), FileError> {
    replace_folder(folder, name, |partial| {
        for (name, content) in files {
            whole::write_parts(&partial.join(name), &[&content])?;
        }
        list_all(partial)
    })
}

/// Copies a finished folder, with finished folders within it, into another one under a name, in place of one that is there,
/// and lists it: it is there whole or not at all.
///
/// # Errors
/// If a file is missing or damaged, or cannot be written.
pub fn copy_folder(from: &Path, folder: &Path, name: &str) -> Result<(), FileError> {
    replace_folder(folder, name, |partial| copy_files(from, partial))
}

/// Fills a folder under another name, then puts it in place of one that is there, and lists it; one in which nothing is
/// listed is not there afterwards.
fn replace_folder(
    folder: &Path,
    name: &str,
    fill: impl FnOnce(&Path) -> Result<(), FileError>,
) -> Result<(), FileError> {
    let (path, partial, list_name) =
        (folder.join(name), folder.join(format!("{name}.{}", whole::PARTIAL)), format!("{name}/{FILE}"));
    let failed =
        |error: std::io::Error| FileError::new(&path, format_args!("cannot be written: {error}"), whole::WRITE_REMEDY);
    let remove = |old: &Path| if old.exists() { fs::remove_dir_all(old).map_err(failed) } else { Ok(()) };
    // A folder that was deleted meanwhile does not come back half.
    if !folder.is_dir() {
        return Err(FileError::new(folder, "was deleted or moved while it was being written", "begin again"));
    }
    remove(&partial)?;
    fs::create_dir_all(&partial).map_err(failed)?;
    // The old one stays until the new one is whole. It is listed until the new one is: where a process dies in between, a
    // listed folder is missing or another one, which is noticed.
    if let Err(error) = fill(&partial) {
        remove(&partial)?;
        return Err(error);
    }
    let is_empty = !exists(&partial)?;
    remove(&path)?;
    if is_empty {
        unlist(folder, &[&list_name])?;
        return fs::remove_dir(&partial).map_err(failed);
    }
    fs::rename(&partial, &path).map_err(failed)?;
    list_folder(folder, name)
}

fn copy_files(from: &Path, to: &Path) -> Result<(), FileError> {
    let sums = list_of(from)?.ok_or_else(|| FileError::new(&from.join(FILE), "is missing", RESTORE))?;
    for name in sums.keys() {
        let path = to.join(name);
        let folder = path.parent().unwrap_or(to);
        fs::create_dir_all(folder)
            .map_err(|error| FileError::new(folder, format_args!("cannot be written: {error}"), whole::WRITE_REMEDY))?;
        // Without a limit: what is listed was written by a run, and its digest is compared.
        let content = read_listed(from, name, u64::MAX)?;
        match listed_folder(name) {
            Some(inner) => copy_files(&from.join(inner), &to.join(inner))?,
            None => whole::write_parts(&path, &[&content])?,
        }
    }
    write_list(to, &sums)
}

/// Reads a finished file of at most this many bytes.
///
/// # Errors
/// If it is missing, too large, not a regular file, not listed in its folder, or not what it was when it was listed.
pub fn read(path: &Path, bytes_max: u64) -> Result<Vec<u8>, FileError> {
    let (folder, name) = (path.parent().unwrap_or(Path::new("")), path.file_name().unwrap_or_default());
    read_listed(folder, &name.to_string_lossy(), bytes_max)
}

/// Reads a finished file by the name under which a folder lists it: `a.csv` or `figures/sha256sums`.
///
/// # Errors
/// See [`read()`].
pub fn read_listed(folder: &Path, name: &str, bytes_max: u64) -> Result<Vec<u8>, FileError> {
    let path = &folder.join(name);
    let bytes = read::bytes(path, bytes_max).map_err(|error| unreadable(path, &error))?;
    compare(folder, name, &digest(&bytes))?;
    Ok(bytes)
}

/// Opens a finished file that is too large to be held, to be read from its beginning. All of it is compared with the
/// list first; whoever has the folder's lock, or reads a finished one, reads the same afterwards.
///
/// # Errors
/// See [`read()`].
pub fn open(path: &Path, bytes_max: u64) -> Result<File, FileError> {
    let (folder, name) = (path.parent().unwrap_or(Path::new("")), path.file_name().unwrap_or_default());
    let mut file = read::open(path, bytes_max).map_err(|error| unreadable(path, &error))?;
    let sum = digest_of(&mut file).map_err(|error| unreadable(path, &error))?;
    compare(folder, &name.to_string_lossy(), &sum)?;
    Ok(file)
}

/// The SHA-256 of a file, part by part; it is at its beginning afterwards.
fn digest_of(file: &mut File) -> std::io::Result<String> {
    let mut sha256 = Sha256::new();
    std::io::copy(file, &mut sha256)?;
    file.rewind()?;
    Ok(hex(&sha256.finalize()))
}

fn unreadable(path: &Path, error: &std::io::Error) -> FileError {
    FileError::unreadable(path, error, RESTORE)
}

/// Holds the digest of a file against the list of its folder.
fn compare(folder: &Path, name: &str, found: &str) -> Result<(), FileError> {
    let path = &folder.join(name);
    let Some(sums) = list_of(folder)? else {
        return Err(FileError::new(
            &folder.join(FILE),
            format_args!("is missing, so nothing says whether {} is whole", path.display()),
            RESTORE,
        ));
    };
    match sums.get(name) {
        Some(sum) if sum == found => Ok(()),
        Some(_) => Err(FileError::new(path, DAMAGED, RESTORE)),
        None => Err(FileError::new(path, UNLISTED, RESTORE)),
    }
}

/// Reads a finished text file.
///
/// # Errors
/// See [`read()`]; or if it is not UTF-8.
pub fn read_to_string(path: &Path, bytes_max: u64) -> Result<String, FileError> {
    String::from_utf8(read(path, bytes_max)?).map_err(|error| FileError::new(path, error, RESTORE))
}

/// Reads a file if its folder lists it; `None` if it is not finished.
///
/// # Errors
/// If it is listed, but missing or damaged.
pub fn read_if_listed(path: &Path, bytes_max: u64) -> Result<Option<Vec<u8>>, FileError> {
    let (folder, name) = (path.parent().unwrap_or(Path::new("")), path.file_name().unwrap_or_default());
    is_listed(folder, &name.to_string_lossy())?.then(|| read(path, bytes_max)).transpose()
}

/// Reads a text file that may be anybody's: if its folder lists it, it is what was written.
///
/// # Errors
/// If it cannot be read, is too long or not UTF-8; if it is listed, but missing or damaged.
pub fn read_text(path: &Path, bytes_max: u64) -> io::Result<String> {
    let (folder, name) = (path.parent().unwrap_or(Path::new("")), path.file_name().unwrap_or_default());
    if is_listed(folder, &name.to_string_lossy()).map_err(io::Error::other)? {
        return read_to_string(path, bytes_max).map_err(io::Error::other);
    }
    crate::read::text(path, bytes_max)
}

/// One SHA-256 of every finished file below a folder but those with some names: two folders with the same hold the same.
///
/// It is that of the lines of `sha256sum` with paths from the folder, in order, without the lists themselves.
///
/// # Errors
/// If a list is missing or damaged.
pub fn digest_of_all(folder: &Path, but: &[&str]) -> Result<String, FileError> {
    let mut sha256 = Sha256::new();
    add_all(folder, "", but, &mut sha256)?;
    Ok(hex(&sha256.finalize()))
}

fn add_all(folder: &Path, prefix: &str, but: &[&str], sha256: &mut Sha256) -> Result<(), FileError> {
    let sums = list_of(folder)?.ok_or_else(|| FileError::new(&folder.join(FILE), "is missing", RESTORE))?;
    for (path, sum) in sums {
        let name = path.rsplit('/').next().unwrap_or(&path);
        if let Some(inner) = listed_folder(&path) {
            add_all(&folder.join(inner), &format!("{prefix}{inner}"), but, sha256)?;
        } else if !but.contains(&name) {
            sha256.update(format!("{sum}  {prefix}{path}\n"));
        }
    }
    Ok(())
}

/// What [`verify`] found.
#[derive(Debug, Default)]
pub struct Verified {
    /// Files whose digests are right.
    pub files: usize,
    /// Their bytes.
    pub bytes: u64,
    /// What is wrong, in the order of the paths.
    pub faults: Vec<FileError>,
}

impl Verified {
    /// What the system says of the entries of a folder; what it cannot say is a fault.
    fn known<T>(&mut self, folder: &Path, entries: impl Iterator<Item = io::Result<T>>) -> Vec<T> {
        let known = entries.map(|entry| entry.map_err(|error| self.faults.push(unreadable(folder, &error))));
        known.flatten().collect()
    }
}

/// Whether a fault is what an interrupted command leaves: it is not listed yet, or not there yet.
pub fn is_unfinished(fault: &FileError) -> bool {
    [UNLISTED, GONE].contains(&fault.problem.as_str())
}

/// Compares every file below a folder with the lists: nothing may be missing, changed or additional. Recordings are not
/// looked at: another program adds them.
pub fn verify(folder: &Path) -> Verified {
    let mut verified = Verified::default();
    verify_into(folder, &mut verified);
    verified
}

fn verify_into(folder: &Path, verified: &mut Verified) {
    let list = folder.join(FILE);
    let sums = match list_of(folder) {
        Ok(Some(sums)) => sums,
        Ok(None) => return verified.faults.push(FileError::new(&list, "is missing", RESTORE)),
        Err(error) => return verified.faults.push(error),
    };
    let mut gone = BTreeSet::new();
    for (name, sum) in &sums {
        let path = folder.join(name);
        if let Some(within) = begun_and_gone(folder, name, &sums) {
            if gone.insert(within) {
                verified.faults.push(FileError::new(&folder.join(within), GONE, GONE_REMEDY));
            }
            continue;
        }
        let found =
            read::open(&path, u64::MAX).and_then(|mut file| Ok((file.metadata()?.len(), digest_of(&mut file)?)));
        match found {
            Ok((bytes, found)) if found == *sum => {
                verified.files += 1;
                verified.bytes += bytes;
            }
            Ok(_) => verified.faults.push(FileError::new(&path, DAMAGED, RESTORE)),
            Err(error) => verified.faults.push(unreadable(&path, &error)),
        }
    }
    look_for_others(folder, "", &sums, verified);
}

/// The folder of a listed file, if it is not there and was never finished: it is written again then.
fn begun_and_gone<'a>(folder: &Path, name: &'a str, sums: &Sums) -> Option<&'a str> {
    let (within, file) = name.rsplit_once('/')?;
    let is_finished = file == FILE || sums.contains_key(&format!("{within}/{FILE}"));
    (!is_finished && !folder.join(within).exists()).then_some(within)
}

/// What is there and not listed, in a folder or in folders within it that have no list of their own.
fn look_for_others(folder: &Path, prefix: &str, sums: &Sums, verified: &mut Verified) {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) => return verified.faults.push(unreadable(folder, &error)),
    };
    let mut entries = verified.known(folder, entries);
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let (path, name) = (entry.path(), format!("{prefix}{}", entry.file_name().to_string_lossy()));
        if !entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            if is_content(&name) && !sums.contains_key(&name) {
                verified.faults.push(FileError::new(&path, UNLISTED, UNLISTED_REMEDY));
            }
        } else if name == RECORDINGS || is_partial(&name) {
            // Another program's; or what was being written when a command was killed.
        } else if exists(&path).unwrap_or(true) || sums.contains_key(&format!("{name}/{FILE}")) {
            if !sums.contains_key(&format!("{name}/{FILE}")) {
                verified.faults.push(FileError::new(&path, UNLISTED, UNLISTED_REMEDY));
            }
            verify_into(&path, verified);
        } else {
            look_for_others(&path, &format!("{name}/"), sums, verified);
        }
    }
}

const DAMAGED: &str = "is damaged: its SHA-256 is not that in sha256sums";
const ANOTHER: &str = "is not the file that the run wrote: the sha256sums of the folder above has another SHA-256";
const BEGUN_REMEDY: &str = "restore its folder from a copy, or move it away: the run goes on with one of its own";
const GONE: &str = "is not there: a command died before it had its name, or somebody took it away";
const GONE_REMEDY: &str = "continue the run, which writes it again";
const UNLISTED: &str = "is not listed in sha256sums: it was never finished, or the list is damaged";
const UNLISTED_REMEDY: &str =
    "continue the run with --resume if it is not finished; else restore the list, or move away what is not of the run";

/// The folder that the viewer program adds to a run.
const RECORDINGS: &str = "recordings";

/// Whether a file of this name is content: neither a list, nor a lock, nor half-written.
fn is_content(name: &str) -> bool {
    let name = name.rsplit('/').next().unwrap_or(name);
    name != FILE && name != lock::FILE && !is_partial(name)
}

/// Whether a name is that of something half-written.
fn is_partial(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension == whole::PARTIAL)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn scratch(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn faults(folder: &Path) -> Vec<String> {
        verify(folder).faults.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_digest_of_parts_is_that_of_the_whole() {
        assert_eq!(digest_of_parts(["park", "", "ing lot"]), digest(b"parking lot"));
    }

    /// Figures were written into a run that had been deleted, which came back with nothing else.
    #[test]
    fn a_folder_is_not_written_into_one_that_is_gone() {
        let folder = scratch("gone");
        fs::remove_dir(&folder).unwrap();
        let refused = write_folder(&folder, "figures", [("a.svg".to_owned(), b"a".to_vec())]).unwrap_err().to_string();
        assert!(refused.contains("was deleted or moved") && !folder.exists(), "{refused}");
    }

    #[test]
    fn what_is_written_is_listed_as_sha256sum_lists_it_and_read_back() {
        let folder = scratch("written");
        write(&folder, "b", b"").unwrap();
        write(&folder, "a", b"hello\n").unwrap();
        let expected = "5891b5b522d5df086d0ff0b110fbd9d21bb4fc7163af34d08286a2e846f6be03  a\n\
                        e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855  b\n";
        assert_eq!(fs::read_to_string(folder.join(FILE)).unwrap(), expected);
        assert_eq!(read_to_string(&folder.join("a"), 100).unwrap(), "hello\n");
        write(&folder, "a", b"hello again\n").unwrap();
        assert_eq!(read(&folder.join("a"), 100).unwrap(), b"hello again\n");
        // What the folder lists is compared, what it does not is anybody's.
        fs::write(folder.join("c"), "mine").unwrap();
        assert_eq!(["a", "c"].map(|name| read_text(&folder.join(name), 100).unwrap()), ["hello again\n", "mine"]);
        fs::write(folder.join("a"), "hello again!").unwrap();
        assert!(read_text(&folder.join("a"), 100).is_err());
        fs::write(folder.join("a"), "hello again\n").unwrap();
        fs::remove_file(folder.join("c")).unwrap();
        assert!(verify(&folder).faults.is_empty());
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn damage_of_a_file_or_of_the_list_is_noticed_by_who_reads_and_by_verify() {
        let folder = scratch("damaged");
        let inner = folder.join("stages/one");
        fs::create_dir_all(&inner).unwrap();
        write(&inner, "data", b"12345").unwrap();
        write(&folder, "about", b"one stage").unwrap();
        list(&folder, &["stages/one/sha256sums"]).unwrap();
        assert_eq!(verify(&folder).files, 3);
        for path in ["about", "stages/one/data", "sha256sums", "stages/one/sha256sums"] {
            let path = folder.join(path);
            let whole = fs::read(&path).unwrap();
            let mut flipped = whole.clone();
            flipped[whole.len() / 2] ^= 1;
            for damaged in [Some(flipped), Some(whole[..whole.len() - 1].to_vec()), Some(Vec::new()), None] {
                match &damaged {
                    Some(bytes) => fs::write(&path, bytes).unwrap(),
                    None => fs::remove_file(&path).unwrap(),
                }
                assert!(!faults(&folder).is_empty(), "{path:?} as {damaged:?}");
                let stage = read_listed(&folder, "stages/one/sha256sums", 1000);
                let reads = [read(&folder.join("about"), 100), read(&inner.join("data"), 100), stage];
                assert!(reads.iter().any(Result::is_err), "{path:?} as {damaged:?}");
            }
            fs::write(&path, whole).unwrap();
        }
        assert_eq!(faults(&folder), [""; 0]);
        fs::write(inner.join("more"), "").unwrap();
        fs::write(folder.join("stages/note"), "").unwrap();
        assert_eq!(faults(&folder).len(), 2, "{:?}", faults(&folder));
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_copy_holds_what_is_finished_and_one_of_a_damaged_folder_replaces_nothing() {
        let folder = scratch("copy");
        let (from, to) = (folder.join("from"), folder.join("to"));
        fs::create_dir_all(from.join("stages/one")).unwrap();
        fs::create_dir_all(&to).unwrap();
        write(&from, "about", b"one stage").unwrap();
        write(&from.join("stages/one"), "data", b"12345").unwrap();
        write(&from.join("stages/one"), "old-sha256sums", b"a file like any other").unwrap();
        list(&from, &["stages/one/sha256sums"]).unwrap();
        fs::write(from.join("half"), "never finished").unwrap();
        for _ in 0..2 {
            copy_folder(&from, &to, "runs/copy").unwrap();
            let verified = verify(&to);
            assert_eq!((verified.files, verified.faults.len()), (5, 0), "{:?}", verified.faults);
            assert_eq!(digest_of_all(&to.join("runs/copy"), &[]).unwrap(), digest_of_all(&from, &[]).unwrap());
            assert!(!to.join("runs/copy/half").exists());
        }
        fs::write(from.join("stages/one/data"), "54321").unwrap();
        assert!(copy_folder(&from, &to, "runs/copy").unwrap_err().to_string().contains("stages/one/data"));
        let verified = verify(&to);
        assert_eq!((verified.files, verified.faults.len()), (5, 0), "the old copy is left as it was");
        copy_folder(&from, &to, "runs/other").unwrap_err();
        assert!(!to.join("runs/other").exists() && !to.join("runs/other.lotpilot-partial").exists());
        fs::remove_dir_all(folder).unwrap();
    }

    /// A list from elsewhere could name files of somebody else, to be read, compared or, in a copy, written.
    #[test]
    fn a_list_names_files_of_its_own_folder_only() {
        let folder = scratch("elsewhere");
        for name in ["../x", "/etc/passwd", "a/../../x", "."] {
            fs::write(folder.join(FILE), format!("{}  {name}\n", digest(b""))).unwrap();
            assert!(names(&folder).unwrap_err().to_string().contains("line 1 is damaged"), "{name}");
        }
        fs::remove_dir_all(folder).unwrap();
    }

    /// Two runs of one command on two machines differ in these alone.
    #[test]
    fn the_digest_of_a_folder_is_of_all_content_but_what_is_left_out() {
        let folder = scratch("digest");
        let begin = |time: &[u8]| {
            let _ = fs::remove_dir_all(&folder);
            fs::create_dir_all(folder.join("round")).unwrap();
            write(&folder, "data", b"1").unwrap();
            write(&folder, "time", time).unwrap();
            write(&folder.join("round"), "weights", b"2").unwrap();
            write(&folder.join("round"), "time", time).unwrap();
            list(&folder, &["round/sha256sums"]).unwrap();
        };
        let digest_now = || digest_of_all(&folder, &["time"]).unwrap();
        begin(b"10:00");
        let first = digest_now();
        begin(b"10:01");
        assert_eq!(digest_now(), first);
        let lines = format!("{}  data\n{}  round/weights\n", digest(b"1"), digest(b"2"));
        assert_eq!(first, digest(lines.as_bytes()), "anybody can compute it");
        write(&folder.join("round"), "weights", b"3").unwrap();
        assert_ne!(digest_now(), first);
        fs::remove_file(folder.join("round").join(FILE)).unwrap();
        assert!(digest_of_all(&folder, &["time"]).is_err());
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_folder_that_is_written_again_holds_what_was_written_last() {
        let folder = scratch("folder");
        write_folder(&folder, "figures", [("a.svg".to_owned(), b"a".to_vec()), ("b.svg".to_owned(), b"b".to_vec())])
            .unwrap();
        write_folder(&folder, "figures", [("b.svg".to_owned(), b"B".to_vec())]).unwrap();
        assert_eq!(names(&folder.join("figures")).unwrap(), ["b.svg"]);
        assert!(faults(&folder).is_empty());
        fs::remove_dir_all(folder).unwrap();
    }

    /// A process that died between taking the old folder away and putting the new one in its place left neither, and
    /// nothing was said of it.
    #[test]
    fn a_folder_that_is_lost_while_it_is_replaced_is_missed() {
        let folder = scratch("replaced");
        let old = folder.join("figures");
        write_folder(&folder, "figures", [("a.svg".to_owned(), b"a".to_vec())]).unwrap();
        // What cannot be deleted ends it there.
        let stopped = replace_folder(&folder, "figures", |partial| {
            write(partial, "a.svg", b"A")?;
            fs::remove_dir_all(&old).unwrap();
            fs::write(&old, "in the way").unwrap();
            Ok(())
        });
        assert!(stopped.unwrap_err().to_string().contains("figures: cannot be written"));
        fs::remove_file(&old).unwrap();
        let missed = faults(&folder);
        assert!(missed.len() == 1 && missed[0].contains("figures/sha256sums: cannot be read"), "{missed:?}");
        write_folder(&folder, "figures", [("a.svg".to_owned(), b"A".to_vec())]).unwrap();
        assert_eq!(faults(&folder), [""; 0]);
        write_folder(&folder, "figures", []).unwrap();
        assert!(!old.exists() && !exists(&folder).unwrap());
        fs::remove_dir_all(folder).unwrap();
    }

    /// It was waited for whoever would write into the pipe.
    #[cfg(unix)]
    #[test]
    fn a_pipe_in_place_of_a_listed_file_is_replaced_and_not_read() {
        let folder = scratch("pipe");
        write(&folder, "a", b"a").unwrap();
        fs::remove_file(folder.join("a")).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(folder.join("a")).status().unwrap().success());
        assert!(faults(&folder)[0].contains("not a regular file"), "{:?}", faults(&folder));
        write(&folder, "a", b"a").unwrap();
        assert_eq!((read(&folder.join("a"), 1).unwrap(), faults(&folder)), (b"a".to_vec(), Vec::new()));
        fs::remove_dir_all(folder).unwrap();
    }

    /// What the system could not say of a folder was taken for nothing being there.
    #[test]
    fn entries_of_a_folder_that_cannot_be_read_are_faults() {
        let mut verified = Verified::default();
        let entries = [Ok("a"), Err(io::Error::from_raw_os_error(5)), Ok("b")];
        assert_eq!(verified.known(Path::new("run"), entries.into_iter()), ["a", "b"]);
        let faults: Vec<String> = verified.faults.iter().map(ToString::to_string).collect();
        assert!(faults.len() == 1 && faults[0].starts_with("run: cannot be read"), "{faults:?}");
    }

    #[test]
    fn a_folder_that_is_listed_by_some_of_its_files_is_known_by_them_until_it_is_listed_again() {
        let folder = scratch("listed-but");
        write_folder(&folder, "stage", ["runs", "report"].map(|name| (name.to_owned(), b"1".to_vec()))).unwrap();
        let stage = folder.join("stage");
        list_but(&folder, "stage", &["report"]).unwrap();
        assert_eq!(names(&folder).unwrap(), ["stage/runs"]);
        write(&stage, "report", b"2").unwrap();
        check_folder(&folder, "stage").unwrap();
        list_but(&folder, "stage", &["report"]).unwrap();
        write(&stage, "runs", b"2").unwrap();
        assert!(check_folder(&folder, "stage").unwrap_err().to_string().contains("stage/runs: is not the file"));
        write(&stage, "runs", b"1").unwrap();
        list_folder(&folder, "stage").unwrap();
        assert_eq!((names(&folder).unwrap(), faults(&folder)), (vec!["stage/sha256sums".to_owned()], Vec::new()));
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_folder_whose_files_are_listed_one_by_one_is_known_by_them_and_not_finished() {
        let folder = scratch("begun");
        let (partial, round) = (folder.join("round.lotpilot-partial"), folder.join("round"));
        fs::create_dir_all(&partial).unwrap();
        for name in ["data", "record"] {
            write(&partial, name, b"1").unwrap();
        }
        list_files_of(&folder, "round", &partial).unwrap();
        let died = faults(&folder);
        assert!(died.len() == 1 && died[0].contains("continue the run, which writes it again"), "{died:?}");
        fs::rename(&partial, &round).unwrap();
        check_folder(&folder, "round").unwrap();
        assert!(faults(&folder).iter().all(|fault| fault.contains("never finished")));
        write(&round, "network", b"trained on them").unwrap();
        check_folder(&folder, "round").unwrap();
        let refused = |part: &str| {
            let error = check_folder(&folder, "round").unwrap_err().to_string();
            assert!(error.contains(part) && error.contains("move it away"), "{error}");
        };
        write(&round, "data", b"2").unwrap();
        refused("round/data: is not the file that the run wrote");
        unlist(&round, &["data"]).unwrap();
        refused("round/data: is not listed");
        let list = fs::read(round.join(FILE)).unwrap();
        fs::remove_file(round.join(FILE)).unwrap();
        refused("round/sha256sums: is missing");
        fs::write(round.join(FILE), list).unwrap();
        write(&round, "data", b"1").unwrap();
        list_folder(&folder, "round").unwrap();
        assert_eq!((names(&folder).unwrap(), faults(&folder)), (vec!["round/sha256sums".to_owned()], Vec::new()));
        check_folder(&folder, "round").unwrap();
        write(&round, "data", b"3").unwrap();
        assert!(check_folder(&folder, "round").unwrap_err().to_string().contains("round/sha256sums: is damaged"));
        // Finished, it is not written again.
        fs::remove_dir_all(&round).unwrap();
        assert!(!faults(&folder).iter().any(|fault| fault.contains("continue the run")));
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn what_is_not_finished_is_not_read() {
        let folder = scratch("unfinished");
        write(&folder, "a", b"a").unwrap();
        fs::write(folder.join("b"), "b").unwrap();
        assert!(read(&folder.join("b"), 100).unwrap_err().to_string().contains("not listed"));
        assert_eq!(read_if_listed(&folder.join("b"), 100).unwrap(), None);
        unlist(&folder, &["a"]).unwrap();
        assert!(!exists(&folder).unwrap());
        fs::remove_dir_all(folder).unwrap();
    }
}
