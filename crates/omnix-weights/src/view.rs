//! A tensor inside a file, and its conversion to f32.
//!
//! Elements lie row-major and little endian. The data need not be aligned (a header may have any length): where they are, f32
//! is read in place; else conversion copies through small aligned buffers, which compilers vectorise.

use std::borrow::Cow;
use std::fmt;
use std::ops::Range;

use half::f16;
use rayon::prelude::*;

use crate::WeightsError;
use crate::convert;

/// Elements that one processor converts at a time.
const PIECE: usize = 1 << 16;

/// Element types that can be converted to f32.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Dtype {
    /// IEEE 754 binary32.
    F32,
    /// IEEE 754 binary16.
    F16,
    /// The upper half of binary32.
    BF16,
    /// IEEE 754 binary64; rounded to f32 when read.
    F64,
}

impl Dtype {
    /// Bytes of one element.
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Self::F16 | Self::BF16 => 2,
            Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(crate) fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "F32" => Self::F32,
            "F16" => Self::F16,
            "BF16" => Self::BF16,
            "F64" => Self::F64,
            _ => return None,
        })
    }
}

impl fmt::Display for Dtype {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::F32 => "F32",
            Self::F16 => "F16",
            Self::BF16 => "BF16",
            Self::F64 => "F64",
        })
    }
}

/// A tensor of a checkpoint: shape, type and bytes as stored, borrowed from the file.
#[derive(Debug, Clone, Copy)]
pub struct TensorView<'a> {
    /// Sizes, outermost first; empty for a scalar.
    pub shape: &'a [usize],
    /// Element type.
    pub dtype: Dtype,
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
            Ok(numbers) if self.dtype == Dtype::F32 && cfg!(target_endian = "little") => Cow::Borrowed(numbers),
            _ => Cow::Owned(self.to_f32()),
        }
    }

    /// Elements one by one as f32, without a buffer of the whole.
    pub fn f32_iter(&self) -> impl Iterator<Item = f32> + use<'a> {
        let dtype = self.dtype;
        self.bytes.chunks_exact(dtype.size()).map(move |element| convert::element(dtype, element))
    }

    /// Converts the elements `range` (counted in row-major order) into `out`, for tensors too large to convert at once.
    ///
    /// # Errors
    /// When the range leaves the tensor or `out` has another length than the range.
    pub fn read_f32_into(&self, range: Range<usize>, out: &mut [f32]) -> Result<(), WeightsError> {
        let bytes = self.bytes_of(range, out.len())?;
        convert::to_f32(self.dtype, bytes, out);
        Ok(())
    }

    /// As [`TensorView::read_f32_into`], to f16 by way of f32, rounding to nearest, ties to even. Magnitudes from 65520 on become
    /// infinite; F16 is copied bit for bit.
    ///
    /// # Errors
    /// As [`TensorView::read_f32_into`].
    pub fn read_f16_into(&self, range: Range<usize>, out: &mut [f16]) -> Result<(), WeightsError> {
        let bytes = self.bytes_of(range, out.len())?;
        convert::to_f16(self.dtype, bytes, out);
        Ok(())
    }

    fn bytes_of(&self, range: Range<usize>, destination: usize) -> Result<&'a [u8], WeightsError> {
        let elements = self.elements();
        if range.start > range.end || range.end > elements || range.len() != destination {
            return Err(WeightsError::BadRange { range, elements, destination });
        }
        let size = self.dtype.size();
        Ok(&self.bytes[range.start * size..range.end * size])
    }
}

/// The first element that is NaN or infinite as f32, with its row-major index.
///
/// An F64 too large for f32 counts too: it would become infinite on upload.
#[must_use]
pub fn find_non_finite(view: &TensorView<'_>) -> Option<(usize, f32)> {
    const CHUNK: usize = 4096;
    let mut buffer = [0.0f32; CHUNK];
    let size = view.dtype.size();
    for (k, bytes) in view.bytes.chunks(CHUNK * size).enumerate() {
        let values = &mut buffer[..bytes.len() / size];
        convert::to_f32(view.dtype, bytes, values);
        // Without an early exit inside, so that the test of a chunk is vectorised.
        if values.iter().fold(false, |bad, v| bad | !v.is_finite()) {
            let place = values.iter().position(|v| !v.is_finite())?;
            return Some((k * CHUNK + place, values[place]));
        }
    }
    None
}
