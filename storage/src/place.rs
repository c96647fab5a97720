//! Where a path leads.

use std::io::{self, ErrorKind};
use std::path::{Component, Path, PathBuf};

/// The place that a path names, with every link resolved, whether anything is there yet or not. An empty path is the
/// present folder.
///
/// # Errors
/// If it goes back up (`..`) from a folder that is not there: nobody knows what that will be a link to.
pub fn place_of(path: &Path) -> io::Result<PathBuf> {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    let path = std::path::absolute(path)?;
    let resolved = |ancestor: &Path| ancestor.canonicalize().ok().map(|place| (place, ancestor.to_owned()));
    let (place, there) = path.ancestors().find_map(resolved).ok_or(ErrorKind::NotFound)?;
    let rest = path.strip_prefix(there).unwrap_or(Path::new(""));
    if rest.components().any(|part| !matches!(part, Component::Normal(_))) {
        return Err(io::Error::new(ErrorKind::NotFound, "it leads back up (..) from a folder that is not there"));
    }
    // Joined with nothing it would end in a slash.
    Ok(if rest.as_os_str().is_empty() { place } else { place.join(rest) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_place_is_the_same_however_it_is_named() {
        let folder = std::env::temp_dir().join(format!("storage-test-{}-place", std::process::id()));
        fs::create_dir_all(folder.join("a/b")).unwrap();
        let folder = folder.canonicalize().unwrap();
        let place = |name: &str| place_of(&folder.join(name)).map_err(|error| error.kind());
        assert_eq!(place("a/b"), Ok(folder.join("a/b")));
        assert_eq!(place("a/./b/../b/"), Ok(folder.join("a/b")));
        assert_eq!(place("a/new/one"), Ok(folder.join("a/new/one")), "not there yet");
        assert_eq!(place("a/../new"), Ok(folder.join("new")));
        assert_eq!(place("new/../a"), Err(ErrorKind::NotFound), "`new` may become a link to anywhere");
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(folder.join("a"), folder.join("link")).unwrap();
            assert_eq!(place("link/new"), Ok(folder.join("a/new")));
        }
        assert_eq!(place_of(Path::new("")).unwrap(), std::env::current_dir().unwrap().canonicalize().unwrap());
        fs::remove_dir_all(folder).unwrap();
    }
}
