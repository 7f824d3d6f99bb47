//! Bytes of a weights file: mapped read-only from disk, or already in memory. The only unsafe code of the crate.

use std::borrow::Cow;
use std::fs::File;
use std::path::Path;

use memmap2::Mmap;

use crate::WeightsError;

/// The bytes of one file.
#[derive(Debug)]
pub(crate) enum Bytes {
    /// A private read-only mapping; pages are read when touched.
    Mapped(Mmap),
    /// Embedded in the program, or owned.
    Memory(Cow<'static, [u8]>),
}

impl Bytes {
    /// Maps a whole file. An empty file gives no bytes and no mapping.
    pub(crate) fn map(path: &Path) -> Result<Self, WeightsError> {
        let file = File::open(path).map_err(|e| WeightsError::io("open the weights", path, e))?;
        let meta = file.metadata().map_err(|e| WeightsError::io("read the size of the weights", path, e))?;
        if meta.len() == 0 {
            return Ok(Self::Memory(Cow::Borrowed(&[])));
        }
        map_file(&file).map(Self::Mapped).map_err(|e| WeightsError::io("map the weights", path, e))
    }
}

impl std::ops::Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Mapped(map) => map,
            Self::Memory(bytes) => bytes,
        }
    }
}

#[expect(unsafe_code, reason = "a mapping is the only way to read weights larger than memory without copying them")]
fn map_file(file: &File) -> std::io::Result<Mmap> {
    // SAFETY: the mapping is read-only and private to this process, and no reference into it outlives the `Mmap`. What
    // stays outside our control is another process that changes the file meanwhile: its bytes are only ever read as
    // plain numbers through `u8` slices, whose length was fixed here, and nothing but a shrinking file (SIGBUS, which
    // the documentation of `Checkpoint::open` states) can go wrong by that.
    unsafe { Mmap::map(file) }
}
