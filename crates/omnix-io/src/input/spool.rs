//! Pictures that wait in a file instead of in memory.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::picture::Picture;
use crate::IoError;

/// Pictures of one size in an unnamed file, gone with the process however that ends: a film takes the memory of one picture.
#[derive(Debug)]
pub struct PictureSpool {
    file: Mutex<File>,
    /// Named in errors.
    folder: PathBuf,
    width: u32,
    height: u32,
    count: usize,
}

impl PictureSpool {
    /// An empty one, in a folder that exists.
    ///
    /// # Errors
    /// No file can be made there.
    pub fn new(folder: &Path, width: u32, height: u32) -> Result<Self, IoError> {
        let file = tempfile::tempfile_in(folder).map_err(|e| IoError::write(folder, e))?;
        Ok(Self { file: Mutex::new(file), folder: folder.to_owned(), width, height, count: 0 })
    }

    /// Adds a picture behind the others.
    ///
    /// # Errors
    /// A full disk or other failure of writing.
    ///
    /// # Panics
    /// When the picture has another size: a fault of the caller.
    pub fn push(&mut self, picture: &Picture) -> Result<(), IoError> {
        assert_eq!((picture.width, picture.height), (self.width, self.height), "BUG: a picture of another size");
        let at = SeekFrom::Start(self.count as u64 * self.bytes() as u64);
        let file = self.file.get_mut().unwrap_or_else(PoisonError::into_inner);
        file.seek(at).and_then(|_| file.write_all(&picture.data)).map_err(|e| IoError::write(&self.folder, e))?;
        self.count += 1;
        Ok(())
    }

    /// The picture of this number.
    ///
    /// # Errors
    /// A failure of reading.
    ///
    /// # Panics
    /// When there is no such picture: a fault of the caller.
    pub fn get(&self, index: usize) -> Result<Picture, IoError> {
        assert!(index < self.count, "BUG: picture {index} of {}", self.count);
        let mut data = vec![0; self.bytes()];
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let at = SeekFrom::Start(index as u64 * data.len() as u64);
        file.seek(at).and_then(|_| file.read_exact(&mut data)).map_err(|e| IoError::read(&self.folder, e))?;
        Ok(Picture::new(self.width, self.height, data))
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Of a picture.
    fn bytes(&self) -> usize {
        3 * self.width as usize * self.height as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_come_back_in_any_order() {
        let dir = tempfile::tempdir().unwrap();
        let mut spool = PictureSpool::new(dir.path(), 2, 3).unwrap();
        let picture = |k: u8| Picture::new(2, 3, (0..18).map(|v| v * 7 + k).collect());
        (0..4).for_each(|k| spool.push(&picture(k)).unwrap());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "it has no name");
        for k in [3, 0, 2, 1] {
            assert_eq!(spool.get(usize::from(k)).unwrap(), picture(k));
        }
        spool.push(&picture(9)).unwrap();
        assert_eq!((spool.get(4).unwrap(), spool.len()), (picture(9), 5));
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let error = PictureSpool::new(&dir.path().join("gone"), 2, 2).unwrap_err();
        assert!(matches!(error, IoError::Vanished { .. }), "{error:?}");
    }
}
