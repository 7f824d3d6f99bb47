//! What lies in a folder, in the order of the names.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use crate::DataError;

/// The folder, if there is one.
pub(crate) fn expect_folder(path: PathBuf) -> Result<PathBuf, DataError> {
    if path.is_dir() { Ok(path) } else { Err(DataError::Missing { path }) }
}

/// The files with one of these extensions (lower case, without the dot), sorted by name.
pub(crate) fn files_with(folder: &Path, extensions: &[&str]) -> Result<Vec<PathBuf>, DataError> {
    let wanted = |path: &Path| {
        let extension = path.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase);
        path.is_file() && extension.is_some_and(|e| extensions.contains(&e.as_str()))
    };
    Ok(entries(folder)?.into_iter().filter(|path| wanted(path)).collect())
}

/// The folders in a folder, sorted by name, without hidden ones.
pub(crate) fn folders(folder: &Path) -> Result<Vec<PathBuf>, DataError> {
    Ok(entries(folder)?.into_iter().filter(|path| path.is_dir()).collect())
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, DataError> {
    let read = |source| DataError::read(folder, source);
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(read)? {
        let path = entry.map_err(read)?.path();
        // Files that start with a dot are the system's, or still being written.
        if !path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b".")) {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

/// The name of a file without its extension.
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}
