//! Archives of numpy's arrays: zip files with a member `NAME.npy` for each, stored or deflated.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use zip::ZipArchive;

use super::folder;
use super::npy::Array;
use crate::EvalError;

const WHAT: &str = "NPZ archive";

/// An open archive; arrays are read one at a time.
pub struct Archive {
    zip: ZipArchive<BufReader<File>>,
    path: PathBuf,
}

impl Archive {
    /// Opens an archive.
    ///
    /// # Errors
    /// [`EvalError::Read`], [`EvalError::Format`].
    pub fn open(path: &Path) -> Result<Self, EvalError> {
        let file = File::open(path).map_err(|source| EvalError::Read { path: path.to_owned(), source })?;
        let zip = ZipArchive::new(BufReader::new(file)).map_err(|e| EvalError::format(WHAT, e.to_string(), path))?;
        Ok(Self { zip, path: path.to_owned() })
    }

    /// Where it lies.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The names of its arrays, sorted.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            self.zip.file_names().filter_map(|n| n.strip_suffix(".npy")).map(str::to_owned).collect();
        names.sort();
        names
    }

    /// Whether it has an array of this name.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.zip.file_names().any(|file| file.strip_suffix(".npy") == Some(name))
    }

    /// Reads an array.
    ///
    /// # Errors
    /// [`EvalError::Missing`] with the names that are there, [`EvalError::Format`], [`EvalError::Read`], [`EvalError::TooLarge`].
    pub fn array(&mut self, name: &str) -> Result<Array, EvalError> {
        if !self.has(name) {
            let found = self.names().join(", ");
            return Err(EvalError::Missing { name: name.to_owned(), found, path: self.path.clone() });
        }
        let member = self.zip.by_name(&format!("{name}.npy"));
        let member = member.map_err(|e| EvalError::format(WHAT, e.to_string(), &self.path))?;
        if member.size() > folder::MOST_BYTES {
            return Err(EvalError::TooLarge {
                bytes: member.size(),
                most: folder::MOST_BYTES,
                path: self.path.clone(),
            });
        }
        let bytes = folder::bounded(member, &self.path)?;
        Array::parse(name, &self.path, bytes)
    }
}

impl std::fmt::Debug for Archive {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Archive").field("path", &self.path).finish_non_exhaustive()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::io::Write;

    use zip::write::SimpleFileOptions;

    use super::*;
    use crate::files::npy::tests::npy;

    /// Writes an archive of these arrays: name, type, shape, bytes.
    pub(crate) fn write(path: &Path, arrays: &[(&str, &str, &str, Vec<u8>)]) {
        let mut zip = zip::ZipWriter::new(File::create(path).unwrap());
        for (name, descr, shape, body) in arrays {
            zip.start_file(format!("{name}.npy"), SimpleFileOptions::default()).unwrap();
            zip.write_all(&npy(descr, shape, body)).unwrap();
        }
        zip.finish().unwrap();
    }

    #[test]
    fn arrays_are_read_by_name_and_missing_ones_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npz");
        write(&path, &[("b", "|u1", "(2,)", vec![1, 2]), ("a", "|u1", "(1,)", vec![7])]);
        let mut archive = Archive::open(&path).unwrap();
        assert_eq!(archive.names(), ["a", "b"]);
        assert_eq!(archive.array("b").unwrap().f64s().unwrap(), [1.0, 2.0]);
        let missing = archive.array("c").unwrap_err().to_string();
        assert!(missing.contains("\"c\"") && missing.contains("a, b"), "{missing}");
    }

    #[test]
    fn what_is_no_archive_is_said() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npz");
        assert!(matches!(Archive::open(&path), Err(EvalError::Read { .. })));
        std::fs::write(&path, b"not a zip").unwrap();
        assert!(matches!(Archive::open(&path), Err(EvalError::Format { .. })));
        write(&path, &[("a", "|u1", "(4,)", vec![7; 4])]);
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
        assert!(Archive::open(&path).is_err());
    }
}
