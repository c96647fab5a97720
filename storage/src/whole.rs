//! Files that exist under their name only when they are whole.

use crate::error::FileError;
use std::fmt::Display;
use std::fs::{self, File};
use std::io::{self, Cursor, ErrorKind, Write as _};
use std::path::Path;

/// Ending of a file or folder that is being written: it is deleted where a process has died, and nobody else names one so.
pub const PARTIAL: &str = "lotpilot-partial";

/// What helps against most errors of writing.
pub const WRITE_REMEDY: &str = "check that the folder exists, is writable and has space";
#[cfg(unix)]
const ONE_NAME_REMEDY: &str = "put a copy of it in its place: copy it, and rename the copy to its name";

/// Writes a file beside its place, then renames it. Of several that write the same file at once, each waits for the one
/// before it: what is under the name was written by one of them.
///
/// # Errors
/// If it cannot be written, or a device, a pipe or a folder is in its place.
pub fn write(path: &Path, content: &[u8]) -> Result<(), FileError> {
    ensure_no_device(path)?;
    write_parts(path, &[content])
}

/// Like [`write()`], for files of runs, in whose place nothing else belongs: it is replaced. The content is given in parts, which
/// need not be put together in memory.
///
/// # Errors
/// If it cannot be written.
pub(crate) fn write_parts(path: &Path, parts: &[&[u8]]) -> Result<(), FileError> {
    let partial = path.with_added_extension(PARTIAL);
    let write = || {
        let mut file = create_own(&partial)?;
        // The name must not be on disk before the content is.
        let written = parts.iter().try_for_each(|part| file.write_all(part));
        let written = written.and_then(|()| file.sync_all()).and_then(|()| fs::rename(&partial, path));
        if written.is_err() {
            // It is this process's still, which has its lock. Where that fails as well, whoever writes next deletes it.
            let _ = fs::remove_file(&partial);
        }
        written
    };
    write().map_err(|error: io::Error| failed(path, &error))
}

/// Refuses to put a file in the place of a device, a pipe or a folder: `/dev/null` would be a file then, for every program.
fn ensure_no_device(path: &Path) -> Result<(), FileError> {
    match fs::symlink_metadata(path) {
        Ok(about) if !about.is_file() && !about.is_symlink() => {
            Err(FileError::new(path, "is a device, a pipe or a folder, which no file replaces", "choose another name"))
        }
        // What is wrong with it, writing says.
        _ => Ok(()),
    }
}

/// A new file that this process alone writes; what a dead one left in its place is deleted.
fn create_own(partial: &Path) -> io::Result<File> {
    loop {
        let file = match File::create_new(partial) {
            Ok(file) => file,
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                make_way(partial)?;
                continue;
            }
            Err(error) => return Err(error),
        };
        if let Err(error) = lock(&file) {
            // Nobody else can lock it, to find it left by a dead process and delete it.
            let _ = fs::remove_file(partial);
            return Err(error);
        }
        // Before the lock, others take it for what a dead process left.
        if is_at(&file, partial)? {
            return Ok(file);
        }
    }
}

/// Deletes what is in the way, once nobody writes it any more.
fn make_way(partial: &Path) -> io::Result<()> {
    let found = match fs::symlink_metadata(partial) {
        // A link that somebody put there is neither followed nor waited for.
        // To be locked on network file systems, it must be open for writing.
        Ok(about) if about.is_file() => File::options().write(true).open(partial).map(Some),
        other => other.map(|_| None),
    };
    let found = match found {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        found => found?,
    };
    if let Some(file) = &found {
        lock(file)?;
        // Its writer was done meanwhile, and it has its name.
        if !is_at(file, partial)? {
            return Ok(());
        }
    }
    match fs::remove_file(partial) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

/// Waits for a lock, where the file system has any.
fn lock(file: &File) -> io::Result<()> {
    match file.lock() {
        Err(error) if !is_lack_of_locks(&error) => Err(error),
        _ => Ok(()),
    }
}

/// Whether the file system has no locks.
fn is_lack_of_locks(error: &io::Error) -> bool {
    /// "No locks available": what Linux says of NFS without its service of locks.
    const ENOLCK: i32 = 37;
    error.kind() == ErrorKind::Unsupported || cfg!(target_os = "linux") && error.raw_os_error() == Some(ENOLCK)
}

/// Whether an open file is the one at a path still.
#[cfg(unix)]
pub(crate) fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt as _;
    let opened = file.metadata()?;
    match fs::symlink_metadata(path) {
        Ok(found) => Ok((found.dev(), found.ino()) == (opened.dev(), opened.ino())),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

/// Whether there is a file at a path still; whether it is the open one is not told here.
#[cfg(not(unix))]
pub(crate) fn is_at(_: &File, path: &Path) -> io::Result<bool> {
    path.try_exists()
}

/// Refuses an open file that is known by another name as well (a hard link): what is written into it, or emptied, changes
/// there, too.
///
/// # Errors
/// If it is, or the system does not say.
#[cfg(unix)]
pub(crate) fn ensure_one_name(file: &File, path: &Path) -> Result<(), FileError> {
    use std::os::unix::fs::MetadataExt as _;
    let about = file.metadata().map_err(|error| FileError::unreadable(path, &error, WRITE_REMEDY))?;
    if about.nlink() > 1 {
        let problem = "has another name elsewhere (a hard link), where it would change as well";
        return Err(FileError::new(path, problem, ONE_NAME_REMEDY));
    }
    Ok(())
}

/// Whether it is known by another name is not told here.
#[cfg(not(unix))]
pub(crate) fn ensure_one_name(_: &File, _: &Path) -> Result<(), FileError> {
    Ok(())
}

/// Like [`write()`], with a function that writes, into memory at first.
///
/// # Errors
/// If it cannot be written, or the function fails.
pub fn write_with(
    path: &Path,
    content: impl FnOnce(&mut Cursor<Vec<u8>>) -> Result<(), String>,
) -> Result<(), FileError> {
    let mut buffer = Cursor::new(Vec::new());
    content(&mut buffer).map_err(|problem| failed(path, &problem))?;
    write(path, buffer.get_ref())
}

fn failed(path: &Path, problem: &dyn Display) -> FileError {
    FileError::new(path, format_args!("cannot be written: {problem}"), WRITE_REMEDY)
}

/// Deletes a file, and what a process that died was writing in its place, if they are there.
///
/// # Errors
/// If one cannot be deleted.
pub fn remove(path: &Path) -> Result<(), FileError> {
    remove_partial(path)?;
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(not_deleted(path, &error)),
        _ => Ok(()),
    }
}

/// Deletes what a process that died was writing in the place of a file, if it is there.
///
/// # Errors
/// If it cannot be deleted.
fn remove_partial(path: &Path) -> Result<(), FileError> {
    let partial = path.with_added_extension(PARTIAL);
    make_way(&partial).map_err(|error| not_deleted(&partial, &error))
}

fn not_deleted(path: &Path, error: &io::Error) -> FileError {
    FileError::new(path, format_args!("cannot be deleted: {error}"), WRITE_REMEDY)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What one had half written was put in place by the other.
    #[test]
    fn of_two_that_write_the_same_file_one_is_read_whole() {
        let path = std::env::temp_dir().join(format!("storage-test-{}-both", std::process::id()));
        let contents = [b'a', b'b'].map(|letter| vec![letter; 1 << 20]);
        write(&path, &contents[0]).unwrap();
        std::thread::scope(|scope| {
            let writers =
                contents.each_ref().map(|content| scope.spawn(|| (0..20).for_each(|_| write(&path, content).unwrap())));
            while writers.iter().any(|writer| !writer.is_finished()) {
                let found = fs::read(&path).unwrap();
                assert!(contents.contains(&found), "{} bytes", found.len());
            }
        });
        assert!(!path.with_added_extension(PARTIAL).exists());
        fs::remove_file(path).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn links_in_the_way_are_not_written_through() {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-in-the-way", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let (diary, path) = (folder.join("diary"), folder.join("report"));
        fs::write(&diary, "dear").unwrap();
        let partial = path.with_added_extension(PARTIAL);
        std::os::unix::fs::symlink(&diary, &partial).unwrap();
        write(&path, b"first").unwrap();
        fs::hard_link(&diary, &partial).unwrap();
        write(&path, b"second").unwrap();
        assert_eq!((fs::read(&diary).unwrap(), fs::read(&path).unwrap()), (b"dear".to_vec(), b"second".to_vec()));
        fs::remove_dir_all(folder).unwrap();
    }

    /// `--out /dev/null --overwrite` made a file of it, where the user might.
    #[cfg(unix)]
    #[test]
    fn a_pipe_or_a_folder_is_not_replaced_by_a_file() {
        use std::os::unix::fs::FileTypeExt as _;
        let folder = std::env::temp_dir().join(format!("storage-test-{}-device", std::process::id()));
        fs::create_dir_all(folder.join("folder")).unwrap();
        let pipe = folder.join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for path in [&pipe, &folder.join("folder")] {
            let error = write(path, b"file").unwrap_err().to_string();
            assert!(error.contains("which no file replaces"), "{error}");
            assert!(!path.with_added_extension(PARTIAL).exists());
        }
        assert!(fs::symlink_metadata(&pipe).unwrap().file_type().is_fifo());
        fs::remove_dir_all(folder).unwrap();
    }

    /// No file could be written on NFS without locks, and one that nobody could delete was left.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_volume_without_locks_is_told_from_a_disk_that_fails() {
        let is_lack = |code| is_lack_of_locks(&io::Error::from_raw_os_error(code));
        let [enolck, enosys, eio] = [37, 38, 5];
        assert!(is_lack(enolck) && is_lack(enosys) && !is_lack(eio));
    }

    #[test]
    fn what_a_dead_process_was_writing_goes_with_the_file() {
        let path = std::env::temp_dir().join(format!("storage-test-{}-whole", std::process::id()));
        write(&path, b"whole").unwrap();
        let partial = path.with_added_extension(PARTIAL);
        fs::write(&partial, "ha").unwrap();
        remove(&path).unwrap();
        remove(&path).unwrap();
        assert!(!path.exists() && !partial.exists());
    }
}
