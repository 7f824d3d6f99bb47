//! Tensors read piece by piece from a file that is not mapped: ranges of elements, or scattered rows, and nothing beside them.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::header;
use crate::info::{Header, TensorInfo};
use crate::plain::open_plain;
use crate::rows::scattered;
use crate::{Dtype, TensorError, convert};

/// A safetensors file whose header is known and whose elements are read when asked for. A file that shrinks meanwhile is an error.
#[derive(Debug)]
pub struct TensorReader {
    file: Mutex<File>,
    path: PathBuf,
    header: Header,
    read: AtomicU64,
}

impl TensorReader {
    /// Opens a file and reads its header.
    ///
    /// # Errors
    /// When the file is absent, unreadable, something other than safetensors, or of another length than its header says.
    pub fn open(path: &Path) -> Result<Self, TensorError> {
        let (mut file, total) = open_plain(path)?;
        let read = |e| TensorError::io("read the file", path, e);
        let mut start = [0; header::START];
        let start = &mut start[..(total as usize).min(header::START)];
        file.read_exact(start).map_err(read)?;
        // At most the format's limit, and no more than the file has.
        let mut json = vec![0; header::length(start, total, path)?];
        file.seek(SeekFrom::Start(8)).and_then(|_| file.read_exact(&mut json)).map_err(read)?;
        let header = header::parse(&json, total, path)?;
        let bytes = AtomicU64::new((start.len() + json.len()) as u64);
        Ok(Self { file: Mutex::new(file), path: path.to_owned(), header, read: bytes })
    }

    /// Bytes read from the file since it was opened, the header included.
    #[must_use]
    pub fn bytes_read(&self) -> u64 {
        self.read.load(Ordering::Relaxed)
    }

    /// The tensors by name, in the order of their bytes.
    #[must_use]
    pub fn tensors(&self) -> Vec<(&str, &TensorInfo)> {
        self.header.in_file_order()
    }

    /// What the header says of a tensor.
    #[must_use]
    pub fn info(&self, name: &str) -> Option<&TensorInfo> {
        self.header.tensors.get(name)
    }

    /// The file's `__metadata__`.
    #[must_use]
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.header.metadata
    }

    /// Where the file lies.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Elements of a floating-point tensor as f32, counted row by row.
    ///
    /// # Errors
    /// No such tensor, elements outside it, another type; a failure of reading.
    pub fn read_f32(&self, name: &str, elements: Range<usize>) -> Result<Vec<f32>, TensorError> {
        let (info, dtype) = self.typed(name, "F32, F16, BF16 or F64", |d| d.float().is_some())?;
        let bytes = self.bytes(name, info, dtype.size(), elements)?;
        Ok(floats(dtype, &bytes))
    }

    /// Elements of an F64 or F32 tensor as f64.
    ///
    /// # Errors
    /// As [`TensorReader::read_f32`].
    pub fn read_f64(&self, name: &str, elements: Range<usize>) -> Result<Vec<f64>, TensorError> {
        let (info, dtype) = self.typed(name, "F64 or F32", |d| matches!(d, Dtype::F64 | Dtype::F32))?;
        let bytes = self.bytes(name, info, dtype.size(), elements)?;
        Ok(if dtype == Dtype::F64 {
            bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect()
        } else {
            bytes.as_chunks().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect()
        })
    }

    /// Elements of a U32 tensor.
    ///
    /// # Errors
    /// As [`TensorReader::read_f32`].
    pub fn read_u32(&self, name: &str, elements: Range<usize>) -> Result<Vec<u32>, TensorError> {
        let (info, dtype) = self.typed(name, "U32", |d| d == Dtype::U32)?;
        Ok(integers(&self.bytes(name, info, dtype.size(), elements)?))
    }

    /// Rows of `width` elements of a floating-point tensor, in the order of `rows`, as f32. Row 0 begins at element `first`.
    /// Rows that lie close together are read together; the same row may be asked for again.
    ///
    /// # Errors
    /// As [`TensorReader::read_f32`].
    pub fn rows_f32(&self, name: &str, first: usize, width: usize, rows: &[u32]) -> Result<Vec<f32>, TensorError> {
        let (info, dtype) = self.typed(name, "F32, F16, BF16 or F64", |d| d.float().is_some())?;
        Ok(floats(dtype, &self.rows(name, info, dtype.size(), (first, width), rows)?))
    }

    /// As [`TensorReader::rows_f32`] of a U32 tensor.
    ///
    /// # Errors
    /// As [`TensorReader::read_f32`].
    pub fn rows_u32(&self, name: &str, first: usize, width: usize, rows: &[u32]) -> Result<Vec<u32>, TensorError> {
        let (info, dtype) = self.typed(name, "U32", |d| d == Dtype::U32)?;
        Ok(integers(&self.rows(name, info, dtype.size(), (first, width), rows)?))
    }

    /// The tensor's entry and its type, if that is one of the wanted.
    fn typed(
        &self,
        name: &str,
        wanted: &'static str,
        fits: fn(Dtype) -> bool,
    ) -> Result<(&TensorInfo, Dtype), TensorError> {
        let missing = || TensorError::Missing { tensor: name.to_owned(), path: self.path.clone() };
        let info = self.info(name).ok_or_else(missing)?;
        let dtype = info.known().filter(|dtype| fits(*dtype)).ok_or_else(|| TensorError::WrongType {
            tensor: name.to_owned(),
            dtype: info.dtype.clone(),
            wanted,
            path: self.path.clone(),
        })?;
        Ok((info, dtype))
    }

    fn bytes(
        &self,
        name: &str,
        info: &TensorInfo,
        size: usize,
        elements: Range<usize>,
    ) -> Result<Vec<u8>, TensorError> {
        let count = info.elements();
        if elements.start > elements.end || elements.end > count {
            return Err(TensorError::BadRange {
                tensor: name.to_owned(),
                range: elements,
                elements: count,
                path: self.path.clone(),
            });
        }
        self.at(info.range.start + elements.start * size, elements.len() * size)
    }

    fn rows(
        &self,
        name: &str,
        info: &TensorInfo,
        size: usize,
        (first, width): (usize, usize),
        rows: &[u32],
    ) -> Result<Vec<u8>, TensorError> {
        let elements = info.elements();
        let end =
            rows.iter().max().map_or(Some(first), |last| (*last as usize + 1).checked_mul(width)?.checked_add(first));
        if end.is_none_or(|end| end > elements) {
            let range = first..end.unwrap_or(usize::MAX);
            let (tensor, path) = (name.to_owned(), self.path.clone());
            return Err(TensorError::BadRange { tensor, range, elements, path });
        }
        let start = info.range.start + first * size;
        scattered(rows, width * size, &mut |range| self.at(start + range.start, range.len()))
    }

    /// `count` bytes from place `at` of the file on.
    fn at(&self, at: usize, count: usize) -> Result<Vec<u8>, TensorError> {
        let mut bytes = vec![0; count];
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let read = file.seek(SeekFrom::Start(at as u64)).and_then(|_| file.read_exact(&mut bytes));
        read.map_err(|e| TensorError::io("read the file", &self.path, e))?;
        self.read.fetch_add(count as u64, Ordering::Relaxed);
        Ok(bytes)
    }
}

fn floats(dtype: Dtype, bytes: &[u8]) -> Vec<f32> {
    let Some(float) = dtype.float() else { return Vec::new() };
    let mut out = vec![0.0; bytes.len() / float.size()];
    convert::to_f32(float, bytes, &mut out);
    out
}

fn integers(bytes: &[u8]) -> Vec<u32> {
    bytes.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect()
}
