//! One owner per folder.

use crate::error::FileError;
use crate::whole::WRITE_REMEDY;
use std::fs::{self, File, TryLockError};
use std::io::Write as _;
use std::path::Path;

/// The file in the folder that is locked. It says who holds it, and is empty when nobody does.
pub const FILE: &str = ".lock";

const REMEDY: &str = "wait until it has ended, stop it, or choose another folder";

/// The right to write into a folder, until it is dropped or the process ends, however it ends.
#[derive(Debug)]
pub struct Lock {
    file: File,
}

impl Lock {
    /// Takes the lock of a folder. `owner`: who asks, for whoever comes second.
    ///
    /// # Errors
    /// If a living process holds it, which is named, or the file cannot be written. The system gives back the lock of a
    /// process that has died.
    pub fn take(folder: &Path, owner: &str) -> Result<Self, FileError> {
        let path = folder.join(FILE);
        let failed =
            |error: std::io::Error| FileError::new(&path, format_args!("cannot be locked: {error}"), WRITE_REMEDY);
        // Emptied below: not what a link that somebody put there points to.
        if fs::symlink_metadata(&path).is_ok_and(|about| !about.is_file()) {
            return Err(FileError::new(&path, "is no file", "choose another folder"));
        }
        let file = File::options().read(true).write(true).create(true).truncate(false).open(&path).map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::Error(error)) => return Err(failed(error)),
            Err(TryLockError::WouldBlock) => {
                let holder = fs::read_to_string(&path).unwrap_or_default();
                let holder = holder.lines().next().unwrap_or("another process").to_owned();
                return Err(FileError::new(folder, format_args!("in use by {holder}"), REMEDY));
            }
        }
        let lock = Self { file };
        lock.file
            .set_len(0)
            .and_then(|()| writeln!(&lock.file, "{owner}, process {}", std::process::id()))
            .map_err(failed)?;
        Ok(lock)
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // What is left of a name would only mislead readers; the lock itself goes with the file handle.
        let _ = self.file.set_len(0);
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
}
