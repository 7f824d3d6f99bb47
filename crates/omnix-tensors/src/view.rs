//! A tensor inside a file, and its conversion to f32.
//!
//! Elements lie row-major and little endian. The data need not be aligned (a header may have any length): where they are, f32
//! is read in place; else conversion copies through small aligned buffers, which compilers vectorise.

use std::borrow::Cow;

use rayon::prelude::*;

use crate::Float;
use crate::convert::{self, Findings};

/// Elements that one processor converts at a time.
const PIECE: usize = 1 << 16;

/// A tensor of floating-point numbers: shape, type and bytes as stored, borrowed from the file.
#[derive(Debug, Clone, Copy)]
pub struct TensorView<'a> {
    /// Sizes, outermost first; empty for a scalar.
    pub shape: &'a [usize],
    /// Element type.
    pub dtype: Float,
    /// The elements as stored: row-major, little endian, perhaps not aligned.
    pub bytes: &'a [u8],
}

impl<'a> TensorView<'a> {
    /// Number of elements.
    #[must_use]
    pub fn elements(&self) -> usize {
        self.bytes.len() / self.dtype.size()
    }

    /// All elements as f32. F64 is rounded; the other types convert exactly.
    #[must_use]
    pub fn to_f32(&self) -> Vec<f32> {
        let mut out = vec![0.0; self.elements()];
        let pieces = self.bytes.par_chunks(PIECE * self.dtype.size());
        out.par_chunks_mut(PIECE).zip(pieces).for_each(|(out, bytes)| convert::to_f32(self.dtype, bytes, out));
        out
    }

    /// As [`TensorView::to_f32`]; what is f32 and aligned in the file already is not copied.
    #[must_use]
    pub fn as_f32(&self) -> Cow<'a, [f32]> {
        match bytemuck::try_cast_slice(self.bytes) {
            Ok(numbers) if self.dtype == Float::F32 && cfg!(target_endian = "little") => Cow::Borrowed(numbers),
            _ => Cow::Owned(self.to_f32()),
        }
    }

    /// What keeps its numbers from being used, if anything does.
    #[must_use]
    pub fn examine(&self) -> Findings {
        let pieces = self.bytes.par_chunks(PIECE * self.dtype.size()).map(|bytes| convert::examine(self.dtype, bytes));
        let found = pieces.collect::<Vec<_>>().into_iter().enumerate();
        found.fold(Findings::default(), |all, (k, here)| all.and(k * PIECE, here))
    }
}
