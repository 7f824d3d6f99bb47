//! The files of a scene in the making, with their digests, and one image as it is handed to a layout.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::numpy;
use crate::cast::Hit;
use crate::error::ScenesError;
use crate::view::View;

/// One image with its labels.
pub(super) struct Take {
    pub(super) camera: usize,
    pub(super) frame: usize,
    pub(super) view: View,
    pub(super) colours: Vec<u8>,
    pub(super) hits: Vec<Option<Hit>>,
    pub(super) moving: Vec<bool>,
}

/// The files of a scene in the making.
pub(super) struct Files {
    pub(super) folder: PathBuf,
    digests: Mutex<BTreeMap<String, String>>,
}

impl Files {
    /// Files in this folder, which is made with the first of them.
    pub(super) fn new(folder: PathBuf) -> Self {
        Self { folder, digests: Mutex::default() }
    }

    /// Names and digests of all files so far.
    pub(super) fn digests(&self) -> BTreeMap<String, String> {
        self.digests.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Writes one.
    pub(super) fn put(&self, name: &str, bytes: &[u8]) -> Result<(), ScenesError> {
        let path = self.folder.join(name);
        let parent = path.parent().map_or(Ok(()), fs::create_dir_all);
        parent.and_then(|()| fs::write(&path, bytes)).map_err(|source| ScenesError::Write { path, source })?;
        let digest = blake3::hash(bytes).to_hex().to_string();
        self.digests.lock().unwrap_or_else(PoisonError::into_inner).insert(name.to_owned(), digest);
        Ok(())
    }

    /// Takes the digests of files that others wrote.
    pub(super) fn digest_all(&self) -> Result<(), ScenesError> {
        let read = |path: &Path| {
            let path = path.to_owned();
            move |source| ScenesError::Read { path, source }
        };
        let mut folders = vec![self.folder.clone()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).map_err(read(&folder))? {
                let path = entry.map_err(read(&folder))?.path();
                if path.is_dir() {
                    folders.push(path);
                    continue;
                }
                let digest = blake3::hash(&fs::read(&path).map_err(read(&path))?).to_hex().to_string();
                let name = path.strip_prefix(&self.folder).unwrap_or(&path).to_string_lossy().replace('\\', "/");
                self.digests.lock().unwrap_or_else(PoisonError::into_inner).insert(name, digest);
            }
        }
        Ok(())
    }

    /// Writes an NPZ archive.
    pub(super) fn archive(&self, name: &str, arrays: &[(&str, Vec<u8>)]) -> Result<(), ScenesError> {
        let bytes = numpy::npz(arrays);
        self.put(name, &bytes.map_err(|source| ScenesError::Write { path: self.folder.join(name), source })?)
    }
}
