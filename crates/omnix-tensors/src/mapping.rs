//! Bytes of a file: mapped read-only from disk, or already in memory. The only unsafe code of the crate.

use std::borrow::Cow;
use std::fs::File;
use std::ops::Range;
use std::path::Path;

use memmap2::Mmap;

use crate::TensorError;
use crate::plain::open_plain;

/// Bytes, aligned, that Linux maps around a page that is asked for. What a neighbour reads meanwhile comes back at once.
#[cfg(unix)]
const AROUND: usize = 64 << 10;

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
    pub(crate) fn map(path: &Path) -> Result<Self, TensorError> {
        let (file, length) = open_plain(path)?;
        if length == 0 {
            return Ok(Self::Memory(Cow::Borrowed(&[])));
        }
        map_file(&file).map(Self::Mapped).map_err(|e| TensorError::io("map the file", path, e))
    }
}

impl Bytes {
    /// Gives back the memory of pages that were read for `range`, and of those that came with them; a later access reads
    /// them from the file again. Without it a checkpoint that is read once stays in the process's memory whole.
    pub(crate) fn release(&self, range: Range<usize>) {
        #[cfg(unix)]
        if let Self::Mapped(map) = self {
            // Counted from address 0, as Linux does.
            let base = map.as_ptr().addr();
            let start = ((base + range.start) / AROUND * AROUND).max(base);
            let end = (base + range.end).next_multiple_of(AROUND).min(base + map.len());
            release_pages(map, start - base..end - base);
        }
        #[cfg(not(unix))]
        let _ = range;
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
    // plain numbers through `u8` and `f32` slices, for which any bytes are valid and whose length was fixed here, and nothing but a
    // shrinking file (SIGBUS, which the documentation of `TensorFile::open` states) can go wrong by that. Numbers are looked at
    // before they are packed: a change between the two goes unnoticed.
    unsafe { Mmap::map(file) }
}

#[cfg(unix)]
#[expect(unsafe_code, reason = "the system's advice on pages has no safe form where it drops them")]
fn release_pages(map: &Mmap, range: Range<usize>) {
    // SAFETY: MADV_DONTNEED loses what was written to a mapping; this one is read-only and of a file, so a dropped page
    // comes back from the file with the same bytes, as it did at the first access. Slices into it stay valid.
    // A refusal costs memory, nothing else.
    let _ = unsafe { map.unchecked_advise_range(memmap2::UncheckedAdvice::DontNeed, range.start, range.len()) };
}
