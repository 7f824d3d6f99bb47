//! One safetensors file: its header and its bytes. Knows neither a configuration nor prefixes.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::WeightsError;
use crate::header::{self, Header};
use crate::mapping::Bytes;
use crate::view::{Dtype, TensorView};

/// What the header says of one tensor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TensorInfo {
    /// Element type as the header writes it (`F32`, `BF16`, `I64`, …).
    pub dtype: String,
    /// Sizes, outermost first; empty for a scalar.
    pub shape: Vec<usize>,
    /// Bytes in the file.
    pub(crate) range: Range<usize>,
}

impl TensorInfo {
    /// Number of elements.
    #[must_use]
    pub fn elements(&self) -> usize {
        // No overflow: checked when the header was read.
        self.shape.iter().product()
    }

    /// Bytes that the tensor takes in the file.
    #[must_use]
    pub fn byte_len(&self) -> usize {
        self.range.len()
    }
}

/// Bytes that are looked at together when a whole file goes by.
const PIECE: usize = 16 << 20;

/// A safetensors file, mapped or in memory. Tensors are found by their full names.
#[derive(Debug)]
pub struct TensorFile {
    bytes: Bytes,
    header: Header,
    path: PathBuf,
}

impl TensorFile {
    /// Maps a file and reads its header.
    ///
    /// # Errors
    /// When the file is absent, unreadable, something other than safetensors, or of another length than its header says.
    pub fn open(path: &Path) -> Result<Self, WeightsError> {
        if !path.is_file() {
            return Err(WeightsError::NotFound { path: path.to_owned() });
        }
        Self::new(Bytes::map(path)?, path)
    }

    /// Reads bytes that are already in memory; `label` stands for the path in messages.
    ///
    /// # Errors
    /// As [`TensorFile::open`].
    pub fn from_bytes(bytes: Cow<'static, [u8]>, label: &str) -> Result<Self, WeightsError> {
        Self::new(Bytes::Memory(bytes), Path::new(label))
    }

    fn new(bytes: Bytes, path: &Path) -> Result<Self, WeightsError> {
        let header = header::parse(&bytes, path)?;
        Ok(Self { bytes, header, path: path.to_owned() })
    }

    /// The tensors by full name, in the order of their names.
    pub fn tensors(&self) -> impl ExactSizeIterator<Item = (&str, &TensorInfo)> {
        self.header.tensors.iter().map(|(name, info)| (name.as_str(), info))
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

    /// A tensor by its full name.
    ///
    /// # Errors
    /// When there is none, or when its elements are not F32, F16, BF16 or F64.
    pub fn tensor(&self, name: &str) -> Result<TensorView<'_>, WeightsError> {
        let info = self
            .info(name)
            .ok_or_else(|| WeightsError::TensorMissing { tensor: name.to_owned(), path: self.path.clone() })?;
        let dtype = Dtype::parse(&info.dtype).ok_or_else(|| WeightsError::UnsupportedDtype {
            tensor: name.to_owned(),
            dtype: info.dtype.clone(),
            path: self.path.clone(),
        })?;
        Ok(TensorView { shape: &info.shape, dtype, bytes: &self.bytes[info.range.clone()] })
    }

    /// The bytes of a tensor of any type, as stored.
    #[must_use]
    pub fn tensor_bytes(&self, name: &str) -> Option<&[u8]> {
        self.info(name).map(|info| &self.bytes[info.range.clone()])
    }

    /// Gives back the memory that reading a tensor took, where the file is mapped; a later access reads the file again.
    pub fn release(&self, name: &str) {
        if let Some(info) = self.info(name) {
            self.bytes.release(info.range.clone());
        }
    }

    /// The whole file in pieces, none of which stays in memory.
    pub(crate) fn in_pieces(&self, each: &mut dyn FnMut(&[u8])) {
        for start in (0..self.bytes.len()).step_by(PIECE) {
            let end = (start + PIECE).min(self.bytes.len());
            each(&self.bytes[start..end]);
            self.bytes.release(start..end);
        }
    }

    /// Where the file lies, or the label of bytes in memory.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}
