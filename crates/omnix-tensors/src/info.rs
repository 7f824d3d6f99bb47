//! What a header says: the tensors of a file, and its metadata.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::Dtype;

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

    /// The element type, if it is a known one.
    #[must_use]
    pub fn known(&self) -> Option<Dtype> {
        Dtype::parse(&self.dtype)
    }
}

/// A parsed header; byte ranges of the tensors count from the start of the file.
#[derive(Debug, Default)]
pub(crate) struct Header {
    pub(crate) tensors: BTreeMap<String, TensorInfo>,
    pub(crate) metadata: BTreeMap<String, String>,
}

impl Header {
    /// The tensors in the order of their bytes.
    pub(crate) fn in_file_order(&self) -> Vec<(&str, &TensorInfo)> {
        let mut all: Vec<_> = self.tensors.iter().map(|(name, info)| (name.as_str(), info)).collect();
        all.sort_by_key(|(_, info)| (info.range.start, info.range.end));
        all
    }
}
