//! One owner per folder.

use crate::error::FileError;
use crate::read;
use crate::whole::{WRITE_REMEDY, ensure_one_name, is_at};
use std::fs::{self, File, TryLockError};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The file in the folder that is locked. It says who holds it, and is empty when nobody does.
pub const FILE: &str = ".lock";

/// What is read of who holds it, bytes: a command and a number.
const HOLDER_BYTES_MAX: u64 = 4096;

/// Some network file systems have no locks.
const ELSEWHERE: &str = "choose a folder on a file system with locks, such as a local disk's";
const REMEDY: &str = "wait until it has ended, stop it, or choose another folder";

/// The right to write into a folder, until it is dropped or the process ends, however it ends.
#[derive(Debug)]
pub struct Lock {
    path: PathBuf,
    file: File,
}

impl Lock {
    /// Takes the lock of a folder. `owner`: who asks, for whoever comes second.
    ///
    /// # Errors
    /// If a living process holds it, which is named, or the file cannot be written or has another name elsewhere. The system
    /// gives back the lock of a process that has died.
    pub fn take(folder: &Path, owner: &str) -> Result<Self, FileError> {
        let path = folder.join(FILE);
        let failed =
            |error: std::io::Error| FileError::new(&path, format_args!("cannot be locked: {error}"), WRITE_REMEDY);
        // Emptied below: not what a link that somebody put there points to.
        if fs::symlink_metadata(&path).is_ok_and(|about| !about.is_file()) {
            return Err(FileError::new(&path, "is not a file", "choose another folder"));
        }
        let file = loop {
            let file =
                File::options().read(true).write(true).create(true).truncate(false).open(&path).map_err(failed)?;
            match file.try_lock() {
                // Not one that was deleted between both.
                Ok(()) if !is_at(&file, &path).map_err(failed)? => {}
                Ok(()) => break file,
                Err(TryLockError::Error(error)) => {
                    return Err(FileError::new(&path, format_args!("cannot be locked: {error}"), ELSEWHERE));
                }
                Err(TryLockError::WouldBlock) => {
                    let holder = read::text(&path, HOLDER_BYTES_MAX).unwrap_or_default();
                    let holder = holder.lines().next().unwrap_or("another process").to_owned();
                    return Err(FileError::new(folder, format_args!("in use by {holder}"), REMEDY));
                }
            }
        };
        // Before there is a lock, which empties its file when it is given back.
        ensure_one_name(&file, &path)?;
        let lock = Self { path, file };
        lock.file
            .set_len(0)
            .and_then(|()| writeln!(&lock.file, "{owner}, process {}", std::process::id()))
            .map_err(|error| FileError::new(&lock.path, format_args!("cannot be locked: {error}"), WRITE_REMEDY))?;
        Ok(lock)
    }

    /// Refuses to continue if the folder has been replaced: whoever deleted or moved it may have begun another run
    /// there.
    ///
    /// # Errors
    /// If the lock at its place is not this one.
    pub fn ensure_held(&self) -> Result<(), FileError> {
        let folder = self.path.parent().unwrap_or(&self.path);
        match is_at(&self.file, &self.path) {
            Ok(true) => Ok(()),
            Ok(false) => Err(FileError::new(
                folder,
                "was deleted or moved while it was being written",
                "nothing more is written there; begin again, or continue with --resume where it is now",
            )),
            Err(error) => Err(FileError::unreadable(&self.path, &error, WRITE_REMEDY)),
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // What is left of a name would only mislead readers.
        let _ = self.file.set_len(0);
        // Not with the file handle alone: a process that was forked from this one has it open as well, for as long as it lives.
        let _ = self.file.unlock();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_living_owner_is_named_and_a_dead_one_is_forgotten() {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-lock", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        // What a process that was killed leaves behind.
        fs::write(folder.join(FILE), "train-bc, process 1\n").unwrap();
        let lock = Lock::take(&folder, "train-dagger").unwrap();
        let error = Lock::take(&folder, "train-bc").unwrap_err().to_string();
        assert!(error.contains(&format!("in use by train-dagger, process {}", std::process::id())), "{error}");
        drop(lock);
        assert_eq!(fs::read(folder.join(FILE)).unwrap(), b"");
        Lock::take(&folder, "train-bc").unwrap();
        fs::remove_dir_all(folder).unwrap();
    }

    /// After a function in Python had forked a process, the folder of its finished evaluation was "in use by another process".
    #[test]
    fn a_lock_is_given_back_though_a_forked_process_has_its_file_open() {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-forked", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let lock = Lock::take(&folder, "evaluate").unwrap();
        // What a child has: the same open file.
        let of_child = lock.file.try_clone().unwrap();
        drop(lock);
        Lock::take(&folder, "merge").unwrap();
        drop(of_child);
        fs::remove_dir_all(folder).unwrap();
    }

    /// Somebody deleted the folder of a run under way, and began another there: both wrote into it.
    #[cfg(unix)]
    #[test]
    fn the_lock_of_a_folder_that_was_deleted_holds_no_more() {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-deleted", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let first = Lock::take(&folder, "train-dagger").unwrap();
        first.ensure_held().unwrap();
        fs::remove_dir_all(&folder).unwrap();
        assert!(first.ensure_held().is_err_and(|error| error.to_string().contains("was deleted or moved")));
        fs::create_dir_all(&folder).unwrap();
        let second = Lock::take(&folder, "train-bc").unwrap();
        assert!(first.ensure_held().is_err());
        second.ensure_held().unwrap();
        drop(first);
        assert!(fs::read_to_string(folder.join(FILE)).unwrap().starts_with("train-bc"));
        fs::remove_dir_all(folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_link_in_place_of_the_lock_empties_nothing() {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-link", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let diary = folder.join("diary");
        fs::write(&diary, "dear").unwrap();
        std::os::unix::fs::symlink(&diary, folder.join(FILE)).unwrap();
        assert!(Lock::take(&folder, "evaluate").is_err());
        assert_eq!(fs::read(&diary).unwrap(), b"dear");
        fs::remove_dir_all(folder).unwrap();
    }

    /// `ln diary RUN/.lock` emptied the diary: symbolic links alone were refused.
    #[cfg(unix)]
    #[test]
    fn a_second_name_of_a_file_in_place_of_the_lock_empties_nothing() {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-hard-link", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let diary = folder.join("diary");
        fs::write(&diary, "dear").unwrap();
        fs::hard_link(&diary, folder.join(FILE)).unwrap();
        assert!(Lock::take(&folder, "evaluate").is_err_and(|error| error.to_string().contains("a hard link")));
        assert_eq!(fs::read(&diary).unwrap(), b"dear");
        // What was advised.
        fs::copy(&diary, folder.join("copy")).unwrap();
        fs::rename(folder.join("copy"), folder.join(FILE)).unwrap();
        Lock::take(&folder, "evaluate").unwrap();
        assert_eq!(fs::read(&diary).unwrap(), b"dear");
        fs::remove_dir_all(folder).unwrap();
    }
}
