//! NPY files and NPZ archives of whole arrays. Format: NPY version 1.0, C order, little endian; archives as numpy's `savez` names
//! them (`NAME.npy`), deflated, arrays above 64 MiB stored as they are, since packing floats takes longer than it saves.

use std::{
    cell::RefCell,
    io::{self, Read, Seek, SeekFrom, Write},
    path::PathBuf,
    rc::Rc,
};

use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use super::atomic::AtomicFile;
use crate::IoError;

const STORED_ABOVE: usize = 64 << 20;

/// A whole array, ready to be written.
pub(super) struct Array {
    pub(super) name: &'static str,
    /// numpy's description, such as `<f4`.
    pub(super) dtype: &'static str,
    pub(super) shape: Vec<usize>,
    pub(super) bytes: Vec<u8>,
}

impl Array {
    pub(super) fn f32(name: &'static str, shape: Vec<usize>, values: impl IntoIterator<Item = f32>) -> Self {
        Self { name, dtype: "<f4", shape, bytes: values.into_iter().flat_map(f32::to_le_bytes).collect() }
    }

    pub(super) fn f64(name: &'static str, shape: Vec<usize>, values: impl IntoIterator<Item = f64>) -> Self {
        Self { name, dtype: "<f8", shape, bytes: values.into_iter().flat_map(f64::to_le_bytes).collect() }
    }

    pub(super) fn i32(name: &'static str, shape: Vec<usize>, values: impl IntoIterator<Item = i32>) -> Self {
        Self { name, dtype: "<i4", shape, bytes: values.into_iter().flat_map(i32::to_le_bytes).collect() }
    }

    pub(super) fn u8(name: &'static str, shape: Vec<usize>, bytes: Vec<u8>) -> Self {
        Self { name, dtype: "|u1", shape, bytes }
    }

    pub(super) fn bool(name: &'static str, shape: Vec<usize>, values: &[bool]) -> Self {
        Self { name, dtype: "|b1", shape, bytes: values.iter().map(|&v| u8::from(v)).collect() }
    }
}

/// NPY 1.0 header, padded so that the data starts at a multiple of 64.
pub(super) fn header(dtype: &str, shape: &[usize]) -> Vec<u8> {
    let sizes: Vec<String> = shape.iter().map(ToString::to_string).collect();
    // A tuple of one needs its comma.
    let comma = if shape.len() == 1 { "," } else { "" };
    let mut text = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({}{comma}), }}", sizes.join(", "));
    let unpadded = 10 + text.len() + 1;
    text.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(64) - unpadded));
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend_from_slice(&(text.len() as u16).to_le_bytes());
    header.extend_from_slice(text.as_bytes());
    header
}

/// Writes one array as an NPY file.
pub(super) fn write_npy(path: PathBuf, array: &Array) -> Result<PathBuf, IoError> {
    let mut file = AtomicFile::create(path)?;
    file.put(&header(array.dtype, &array.shape))?;
    file.put(&array.bytes)?;
    file.commit()
}

/// Writes the arrays as one NPZ archive.
pub(super) fn write_npz(path: PathBuf, arrays: &[Array]) -> Result<PathBuf, IoError> {
    let mut archive = Archive::create(path)?;
    for array in arrays {
        let pack = if array.bytes.len() > STORED_ABOVE { Pack::Stored } else { Pack::Deflated };
        let large = array.bytes.len() > 1 << 30;
        archive.add(array.name, &header(array.dtype, &array.shape), &mut array.bytes.as_slice(), pack, large)?;
    }
    archive.finish()
}

/// How an array lies in an archive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pack {
    Stored,
    Deflated,
}

/// An NPZ archive in the making.
pub(super) struct Archive {
    zip: ZipWriter<Remembering>,
    path: PathBuf,
    failed: Rc<RefCell<Option<io::Error>>>,
}

impl Archive {
    /// Starts the file.
    pub(super) fn create(path: PathBuf) -> Result<Self, IoError> {
        let failed = Rc::new(RefCell::new(None));
        let out = Remembering {
            file: AtomicFile::create(path.clone())?,
            at: 0,
            end: 0,
            lost: false,
            failed: Rc::clone(&failed),
        };
        Ok(Self { zip: ZipWriter::new(out), path, failed })
    }

    /// Adds an array of these bytes; `large` if they may be more than 4 GiB.
    pub(super) fn add(
        &mut self,
        name: &str,
        header: &[u8],
        body: &mut dyn Read,
        pack: Pack,
        large: bool,
    ) -> Result<(), IoError> {
        let method = match pack {
            Pack::Stored => CompressionMethod::Stored,
            Pack::Deflated => CompressionMethod::Deflated,
        };
        let options = SimpleFileOptions::default().compression_method(method).large_file(large);
        let started = self.zip.start_file(format!("{name}.npy"), options).map_err(io::Error::from);
        let written = started.and_then(|()| self.zip.write_all(header)).and_then(|()| io::copy(body, &mut self.zip));
        self.check(written.map(|_| ()))
    }

    /// Completes the archive and gives it its name.
    pub(super) fn finish(self) -> Result<PathBuf, IoError> {
        let Self { zip, path, failed } = self;
        let written = zip.finish().map_err(|e| IoError::write(&path, e.into()));
        match failed.take() {
            Some(error) => Err(IoError::write(path, error)),
            None => written?.file.commit(),
        }
    }

    fn check(&self, outcome: io::Result<()>) -> Result<(), IoError> {
        match self.failed.take() {
            Some(error) => Err(IoError::write(&self.path, error)),
            None => outcome.map_err(|error| IoError::write(&self.path, error)),
        }
    }
}

/// A file that takes everything after its first failure and keeps nothing: an archive that is given up in the middle still writes its
/// end, and would complain on standard error that it cannot. The failure is remembered for who can report it.
struct Remembering {
    file: AtomicFile,
    /// Where the next byte goes, and where the file ends, as the archive sees it.
    at: u64,
    end: u64,
    lost: bool,
    failed: Rc<RefCell<Option<io::Error>>>,
}

impl Remembering {
    fn fail(&mut self, error: io::Error) {
        self.lost = true;
        self.failed.borrow_mut().get_or_insert(error);
    }
}

impl Write for Remembering {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut taken = bytes.len();
        if !self.lost {
            match self.file.writer().write(bytes) {
                Ok(count) => taken = count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => return Err(error),
                Err(error) => self.fail(error),
            }
        }
        self.at += taken as u64;
        self.end = self.end.max(self.at);
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        if !self.lost
            && let Err(error) = self.file.writer().flush()
        {
            self.fail(error);
        }
        Ok(())
    }
}

impl Seek for Remembering {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let target = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
            SeekFrom::End(by) => self.end.checked_add_signed(by),
        };
        let target = target.ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?;
        if !self.lost
            && let Err(error) = self.file.writer().seek(SeekFrom::Start(target))
        {
            self.fail(error);
        }
        self.at = target;
        Ok(target)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn header_is_padded() {
        for shape in [&[][..], &[7], &[24, 280, 504]] {
            let header = header("<f4", shape);
            assert_eq!(header.len() % 64, 0);
            assert_eq!(header.last(), Some(&b'\n'));
        }
        assert!(String::from_utf8_lossy(&header("<f4", &[7])).contains("'shape': (7,), "));
    }
}
