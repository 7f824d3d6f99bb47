//! Listing folders and reading whole files, in one order and with a bound.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::EvalError;

/// Bytes that are read of one file at most.
pub(crate) const MOST_BYTES: u64 = 8 << 30;

/// The entries of a folder, sorted by name.
///
/// # Errors
/// [`EvalError::Read`] if it cannot be listed.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>, EvalError> {
    let failed = |source| EvalError::Read { path: folder.to_owned(), source };
    let listed = std::fs::read_dir(folder).map_err(failed)?.map(|entry| entry.map(|e| e.path()));
    let mut paths = listed.collect::<Result<Vec<_>, _>>().map_err(failed)?;
    paths.sort();
    Ok(paths)
}

/// Its folders, sorted.
///
/// # Errors
/// As [`entries`].
pub(crate) fn folders(folder: &Path) -> Result<Vec<PathBuf>, EvalError> {
    Ok(entries(folder)?.into_iter().filter(|path| path.is_dir()).collect())
}

/// Its files with this extension (lower case, without the dot), sorted.
///
/// # Errors
/// As [`entries`].
pub(crate) fn files(folder: &Path, extension: &str) -> Result<Vec<PathBuf>, EvalError> {
    let right = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension)) && path.is_file();
    Ok(entries(folder)?.into_iter().filter(|path| right(path)).collect())
}

/// The last part of a path, as text.
#[must_use]
pub(crate) fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The last part of a path without its extension, as text.
#[must_use]
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// All bytes of a file.
///
/// # Errors
/// [`EvalError::Read`], or [`EvalError::TooLarge`] above [`MOST_BYTES`].
pub(crate) fn bytes(path: &Path) -> Result<Vec<u8>, EvalError> {
    let file = File::open(path).map_err(|source| EvalError::Read { path: path.to_owned(), source })?;
    bounded(file, path)
}

/// All text of a file.
///
/// # Errors
/// As [`bytes`]; [`EvalError::Format`] for bytes that are not UTF-8.
pub(crate) fn text(path: &Path, what: &'static str) -> Result<String, EvalError> {
    String::from_utf8(bytes(path)?).map_err(|e| EvalError::format(what, e.to_string(), path))
}

/// All bytes of a reader; memory grows as they come.
pub(super) fn bounded(reader: impl Read, path: &Path) -> Result<Vec<u8>, EvalError> {
    let mut bytes = Vec::new();
    reader
        .take(MOST_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| EvalError::Read { path: path.to_owned(), source })?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(EvalError::TooLarge { bytes: bytes.len() as u64, most: MOST_BYTES, path: path.to_owned() });
    }
    Ok(bytes)
}
