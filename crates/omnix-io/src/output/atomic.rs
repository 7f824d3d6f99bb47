//! Files that appear whole or not at all, and unnamed files to spool into.

use std::{
    fs::{self, File},
    io::{BufReader, BufWriter, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use crate::IoError;

/// Makes the folder with its parents and proves that a file can be written in it. Leaves nothing but the folder.
///
/// # Errors
/// The folder cannot be made, is a file, or cannot be written to.
pub fn check_output_folder(dir: &Path) -> Result<(), IoError> {
    let refuse = |source| IoError::OutputFolder { path: dir.to_owned(), source };
    fs::create_dir_all(dir).map_err(refuse)?;
    let mut probe = tempfile::tempfile_in(dir).map_err(refuse)?;
    probe.write_all(b"omnix").and_then(|()| probe.flush()).map_err(|e| IoError::write(dir, e))
}

/// [`omnix_tensors::AtomicFile`] with errors that name the file: it has its name only when it is whole.
#[derive(Debug)]
pub(super) struct AtomicFile {
    file: omnix_tensors::AtomicFile,
    path: PathBuf,
}

impl AtomicFile {
    /// Starts the file, making its folder.
    pub(super) fn create(path: PathBuf) -> Result<Self, IoError> {
        let file = omnix_tensors::AtomicFile::create(&path).map_err(|e| IoError::write(&path, e))?;
        Ok(Self { file, path })
    }

    /// Where it lies until it is whole, for another program to write to.
    pub(super) fn temporary(&self) -> &Path {
        self.file.temporary()
    }

    /// Writes bytes, naming the file on failure.
    pub(super) fn put(&mut self, bytes: &[u8]) -> Result<(), IoError> {
        self.file.write_all(bytes).map_err(|e| IoError::write(&self.path, e))
    }

    /// The writer, for encoders; wrap their errors with [`IoError::write`].
    pub(super) fn writer(&mut self) -> &mut (impl Write + Seek + use<>) {
        &mut self.file
    }

    /// Empties the buffers, waits for the disk, and renames.
    pub(super) fn commit(self) -> Result<PathBuf, IoError> {
        self.file.commit().map_err(|e| IoError::write(&self.path, e))
    }
}

/// Writes one whole file.
pub(super) fn write_file(path: PathBuf, bytes: &[u8]) -> Result<PathBuf, IoError> {
    let mut file = AtomicFile::create(path)?;
    file.put(bytes)?;
    file.commit()
}

/// An unnamed file: gone when dropped, whatever happens to the process.
pub(super) struct Spool {
    out: BufWriter<File>,
    /// Named in errors: the file that the bytes are for.
    target: PathBuf,
    bytes: u64,
}

impl Spool {
    /// Opens it in `dir`, which must exist, so that it lies on the disk of the results.
    pub(super) fn new(dir: &Path, target: PathBuf) -> Result<Self, IoError> {
        let file = tempfile::tempfile_in(dir).map_err(|e| IoError::write(&target, e))?;
        Ok(Self { out: BufWriter::with_capacity(1 << 18, file), target, bytes: 0 })
    }

    pub(super) fn put(&mut self, bytes: &[u8]) -> Result<(), IoError> {
        self.bytes += bytes.len() as u64;
        self.out.write_all(bytes).map_err(|e| IoError::write(&self.target, e))
    }

    /// Number of bytes put so far.
    pub(super) fn len(&self) -> u64 {
        self.bytes
    }

    /// Ends writing; the file is read from its start.
    pub(super) fn into_reader(self) -> Result<BufReader<File>, IoError> {
        let target = self.target;
        let mut file = self.out.into_inner().map_err(|e| IoError::write(&target, e.into_error()))?;
        file.seek(SeekFrom::Start(0)).map_err(|e| IoError::read(&target, e))?;
        Ok(BufReader::with_capacity(1 << 20, file))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dropping_leaves_nothing_and_commit_replaces() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a/b.txt");
        let mut file = AtomicFile::create(path.clone()).unwrap();
        file.put(b"half").unwrap();
        drop(file);
        assert_eq!(fs::read_dir(dir.path().join("a")).unwrap().count(), 0);
        write_file(path.clone(), b"one").unwrap();
        write_file(path.clone(), b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(fs::read_dir(dir.path().join("a")).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_that_goes_away_while_a_file_is_written_has_a_name() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("depth");
        let file = AtomicFile::create(folder.join("000003.png")).unwrap();
        fs::remove_dir_all(&folder).unwrap();
        let error = file.commit().unwrap_err();
        assert!(matches!(&error, IoError::Vanished { path } if path.ends_with("depth/000003.png")), "{error:?}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_has_a_name() {
        let mut full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let error = IoError::write("points.ply", full.write_all(b"x").unwrap_err());
        assert!(matches!(&error, IoError::DiskFull { .. }), "{error:?}");
        assert!(error.to_string().contains("disk is full") && error.to_string().ends_with("points.ply"));
    }
}
