//! Folders that appear whole or not at all, and files that two folders share.
//!
//! A folder cannot be renamed over another one that has files. So NAME is written as `.omnix-NAME.new`; when it is on the disk, the
//! former NAME becomes `.omnix-NAME.old`, the new one takes its name, and the old one is removed. Killed at any moment, one of the two is
//! whole, and which one follows from what is there:
//!
//! | there is | then |
//! |---|---|
//! | NAME | it is whole; anything beside it is removed |
//! | no NAME, old | the new one was whole before the old one moved: it takes the name, or, if it is not there, the old one does |
//! | no NAME, no old | the new one was being written: it is removed |

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use crate::TrainError;

fn new_of(parent: &Path, name: &str) -> PathBuf {
    parent.join(format!(".omnix-{name}.new"))
}

fn old_of(parent: &Path, name: &str) -> PathBuf {
    parent.join(format!(".omnix-{name}.old"))
}

fn written<T>(path: &Path, result: io::Result<T>) -> Result<T, TrainError> {
    result.map_err(|source| TrainError::Write { path: path.to_owned(), source })
}

fn remove(path: &Path) -> Result<(), TrainError> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => written(path, Err(error)),
        _ => Ok(()),
    }
}

/// Waits until a folder's names are on the disk. Not every file system offers that.
fn sync(folder: &Path) {
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
}

/// An empty folder that will become `parent`/`name`.
pub(crate) fn begin(parent: &Path, name: &str) -> Result<PathBuf, TrainError> {
    recover(parent, name)?;
    let new = new_of(parent, name);
    written(&new, fs::create_dir_all(&new))?;
    Ok(new)
}

/// Gives the folder of [`begin`], whose files are on the disk, its name.
pub(crate) fn finish(parent: &Path, name: &str) -> Result<(), TrainError> {
    let (path, new, old) = (parent.join(name), new_of(parent, name), old_of(parent, name));
    sync(&new);
    if path.exists() {
        written(&old, fs::rename(&path, &old))?;
        sync(parent);
    }
    written(&path, fs::rename(&new, &path))?;
    sync(parent);
    remove(&old)
}

/// Completes or takes away what a killed program left.
pub(crate) fn recover(parent: &Path, name: &str) -> Result<(), TrainError> {
    let (path, new, old) = (parent.join(name), new_of(parent, name), old_of(parent, name));
    if !path.exists() && old.exists() {
        let whole = if new.exists() { &new } else { &old };
        written(&path, fs::rename(whole, &path))?;
        sync(parent);
    }
    remove(&new)?;
    remove(&old)
}

/// A second name of a file that is never changed, or, where the file system has none, a copy.
pub(crate) fn link(from: &Path, to: &Path) -> Result<(), TrainError> {
    if fs::hard_link(from, to).is_ok() {
        return Ok(());
    }
    let copy = || fs::copy(from, to).and_then(|_| File::open(to)?.sync_all());
    written(to, copy())
}

/// As [`link`], in place of what `to` is now.
pub(crate) fn link_over(from: &Path, to: &Path) -> Result<(), TrainError> {
    let new = to.with_extension("new.part");
    let clear = |path: &Path| match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => written(path, Err(error)),
        _ => Ok(()),
    };
    clear(&new)?;
    link(from, &new)?;
    written(to, fs::rename(&new, to))?;
    // A rename between two names of one file does nothing.
    clear(&new)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn content(path: &Path) -> Option<String> {
        fs::read_to_string(path.join("file")).ok()
    }

    fn make(path: &Path, text: &str) {
        fs::create_dir_all(path).unwrap();
        fs::write(path.join("file"), text).unwrap();
    }

    #[test]
    fn the_new_one_takes_the_place() {
        let dir = tempfile::tempdir().unwrap();
        for text in ["one", "two"] {
            make(&begin(dir.path(), "last").unwrap(), text);
            finish(dir.path(), "last").unwrap();
            assert_eq!(content(&dir.path().join("last")).as_deref(), Some(text));
            assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
        }
    }

    /// Every state that a killed program can leave.
    #[test]
    fn one_of_the_two_is_always_whole() {
        for (last, new, old, expected) in [
            (Some("former"), Some("half"), None, Some("former")),
            (None, Some("whole"), Some("former"), Some("whole")),
            (Some("whole"), None, Some("former"), Some("whole")),
            (None, None, Some("former"), Some("former")),
            (None, Some("half"), None, None),
            (None, None, None, None),
        ] {
            let dir = tempfile::tempdir().unwrap();
            let paths = [dir.path().join("last"), new_of(dir.path(), "last"), old_of(dir.path(), "last")];
            for (path, text) in paths.iter().zip([last, new, old]) {
                if let Some(text) = text {
                    make(path, text);
                }
            }
            recover(dir.path(), "last").unwrap();
            assert_eq!(content(&paths[0]).as_deref(), expected);
            assert!(!paths[1].exists() && !paths[2].exists());
        }
    }

    #[test]
    fn linked_files_replace_and_survive_their_source() {
        let dir = tempfile::tempdir().unwrap();
        let (from, to) = (dir.path().join("from"), dir.path().join("to.safetensors"));
        fs::write(&to, "before").unwrap();
        fs::write(&from, "after").unwrap();
        link_over(&from, &to).unwrap();
        link_over(&from, &to).unwrap();
        fs::remove_file(&from).unwrap();
        assert_eq!(fs::read_to_string(&to).unwrap(), "after");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
