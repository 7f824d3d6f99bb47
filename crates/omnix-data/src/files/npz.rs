//! NPY files, and NPZ archives of arrays by name.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use zip::ZipArchive;

use super::npy::Array;
use crate::DataError;

/// Reads the array of an NPY file.
pub(crate) fn read_npy(path: &Path) -> Result<Array, DataError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Array::read(&mut BufReader::new(open(path)?), &name, path)
}

/// An NPZ archive.
pub(crate) struct Archive {
    zip: ZipArchive<BufReader<File>>,
    path: PathBuf,
}

impl Archive {
    pub(crate) fn open(path: &Path) -> Result<Self, DataError> {
        let zip = ZipArchive::new(BufReader::new(open(path)?))
            .map_err(|error| DataError::Archive { reason: error.to_string(), path: path.to_owned() })?;
        Ok(Self { zip, path: path.to_owned() })
    }

    /// The names of its arrays, in the order of the names.
    pub(crate) fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            self.zip.file_names().filter_map(|name| name.strip_suffix(".npy")).map(str::to_owned).collect();
        names.sort();
        names
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.zip.index_for_name(&format!("{name}.npy")).is_some()
    }

    /// The array of this name.
    pub(crate) fn array(&mut self, name: &str) -> Result<Array, DataError> {
        if !self.has(name) {
            let found = self.names().join(", ");
            return Err(DataError::NoArray { array: name.to_owned(), found, path: self.path.clone() });
        }
        let mut entry = self
            .zip
            .by_name(&format!("{name}.npy"))
            .map_err(|error| DataError::Archive { reason: error.to_string(), path: self.path.clone() })?;
        Array::read(&mut entry, name, &self.path)
    }

    /// The first of these names that the archive has.
    pub(crate) fn any(&mut self, names: &[&str]) -> Result<Array, DataError> {
        let name = names.iter().find(|name| self.has(name)).or(names.first());
        self.array(name.copied().unwrap_or_default())
    }
}

fn open(path: &Path) -> Result<File, DataError> {
    // A pipe would block, a folder cannot be read.
    match std::fs::metadata(path) {
        Ok(meta) if !meta.is_file() => Err(DataError::NotAFile { path: path.to_owned() }),
        Ok(_) => File::open(path).map_err(|source| DataError::read(path, source)),
        Err(source) => Err(DataError::read(path, source)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made::npz;

    #[test]
    fn arrays_are_found_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("cam.npz");
        npz(&path, &[("pose", &[2], &[1.0, 2.0]), ("intrinsics", &[1], &[3.0])]);
        let mut archive = Archive::open(&path).unwrap();
        assert_eq!(archive.names(), ["intrinsics", "pose"]);
        assert_eq!(archive.array("pose").unwrap().to_f64(), [1.0, 2.0]);
        assert_eq!(archive.any(&["intrinsic", "intrinsics"]).unwrap().to_f64(), [3.0]);
        let error = archive.array("camera_pose").unwrap_err().to_string();
        assert!(error.contains("camera_pose") && error.contains("intrinsics, pose"), "{error}");
    }

    #[test]
    fn what_is_no_archive_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("cam.npz");
        std::fs::write(&path, "not a zip").unwrap();
        assert!(matches!(Archive::open(&path), Err(DataError::Archive { .. })));
        assert!(matches!(Archive::open(dir.path()), Err(DataError::NotAFile { .. })));
        assert!(matches!(read_npy(&dir.path().join("none.npy")), Err(DataError::Missing { .. })));
    }
}
