//! Conversion between stored elements (little endian, any alignment) and numbers of the host, and what to find out about
//! numbers before they are used.

use half::slice::{HalfBitsSliceExt as _, HalfFloatSliceExt as _};
use half::{bf16, f16};

use crate::Float;

/// Elements converted at once through a buffer on the stack.
const CHUNK: usize = 1024;

/// Magnitudes from here on become infinite as f16: half way between its largest number, 65504, and the next there would be.
const BEYOND_F16: f32 = 65520.0;

/// Converts all of `bytes`; `out` has one place per element.
pub(crate) fn to_f32(dtype: Float, bytes: &[u8], out: &mut [f32]) {
    match dtype {
        Float::F32 => {
            for (o, b) in out.iter_mut().zip(bytes.as_chunks().0) {
                *o = f32::from_le_bytes(*b);
            }
        }
        Float::BF16 => {
            for (o, b) in out.iter_mut().zip(bytes.as_chunks().0) {
                // By hand, not `to_f32`: that also quiets signalling NaN, which costs the vectorised loop.
                *o = f32::from_bits(u32::from(u16::from_le_bytes(*b)) << 16);
            }
        }
        Float::F16 => {
            let mut bits = [0u16; CHUNK];
            for (o, b) in out.chunks_mut(CHUNK).zip(bytes.chunks(CHUNK * 2)) {
                let bits = &mut bits[..o.len()];
                read_bits(b, bits);
                bits.reinterpret_cast::<f16>().convert_to_f32_slice(o);
            }
        }
        Float::F64 => {
            for (o, b) in out.iter_mut().zip(bytes.as_chunks().0) {
                *o = f64::from_le_bytes(*b) as f32;
            }
        }
    }
}

fn read_bits(bytes: &[u8], out: &mut [u16]) {
    for (o, b) in out.iter_mut().zip(bytes.as_chunks().0) {
        *o = u16::from_le_bytes(*b);
    }
}

/// A number that cannot be stored: its place among those given, and what it is.
pub(crate) type Misfit = (usize, f64);

/// Appends `values` as elements of `dtype`, rounded to nearest, ties to even. NaN and infinity stay what they are.
///
/// # Errors
/// The first number that is finite and becomes infinite.
pub(crate) fn from_f32(dtype: Float, values: &[f32], out: &mut Vec<u8>) -> Result<(), Misfit> {
    let mut fits = true;
    match dtype {
        Float::F32 => values.iter().for_each(|v| out.extend(v.to_le_bytes())),
        Float::F64 => values.iter().for_each(|v| out.extend(f64::from(*v).to_le_bytes())),
        Float::F16 => values.iter().for_each(|v| {
            let half = f16::from_f32(*v);
            fits &= half.is_finite() || !v.is_finite();
            out.extend(half.to_le_bytes());
        }),
        Float::BF16 => values.iter().for_each(|v| {
            let half = bf16::from_f32(*v);
            fits &= half.is_finite() || !v.is_finite();
            out.extend(half.to_le_bytes());
        }),
    }
    if fits {
        return Ok(());
    }
    let stays = |v: f32| match dtype {
        Float::F16 => f16::from_f32(v).is_finite(),
        Float::BF16 => bf16::from_f32(v).is_finite(),
        Float::F32 | Float::F64 => true,
    };
    let first = values.iter().position(|v| v.is_finite() && !stays(*v));
    first.map_or(Ok(()), |at| Err((at, f64::from(values[at]))))
}

/// What keeps numbers from being used: the first of each kind, with its place in row-major order.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Findings {
    /// NaN or infinite as f32. An F64 too large for f32 counts too: it would become infinite when used.
    pub non_finite: Option<(usize, f32)>,
    /// Finite, but infinite as f16.
    pub beyond_f16: Option<(usize, f32)>,
}

impl Findings {
    /// Together with what was found in numbers that begin at place `start`, behind those of `self`.
    #[must_use]
    pub fn and(self, start: usize, later: Self) -> Self {
        let at = |(index, value)| (start + index, value);
        Self {
            non_finite: self.non_finite.or(later.non_finite.map(at)),
            beyond_f16: self.beyond_f16.or(later.beyond_f16.map(at)),
        }
    }
}

/// Looks at all elements of `bytes`.
pub(crate) fn examine(dtype: Float, bytes: &[u8]) -> Findings {
    let mut buffer = [0.0f32; CHUNK];
    let mut found = Findings::default();
    for (k, bytes) in bytes.chunks(CHUNK * dtype.size()).enumerate() {
        let values = &mut buffer[..bytes.len() / dtype.size()];
        to_f32(dtype, bytes, values);
        // Without an early exit inside, so that the test of a chunk is vectorised. NaN compares as false.
        if values.iter().fold(true, |good, v| good & (v.abs() < BEYOND_F16)) {
            continue;
        }
        let first = |odd: &dyn Fn(f32) -> bool| values.iter().position(|v| odd(*v)).map(|i| (i, values[i]));
        let here = Findings {
            non_finite: first(&|v| !v.is_finite()),
            beyond_f16: first(&|v| v.is_finite() && v.abs() >= BEYOND_F16),
        };
        found = found.and(k * CHUNK, here);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_f16_is_what_half_says() {
        for v in [65503.9, 65504.0, 65519.996, 65520.0, 65536.0, 1e30, -65519.996, -65520.0] {
            let found = examine(Float::F32, &f32::to_le_bytes(v));
            assert_eq!(found.beyond_f16.is_some(), f16::from_f32(v).is_infinite(), "{v}");
            let stored = from_f32(Float::F16, &[0.0, v], &mut Vec::new());
            assert_eq!(stored, if found.beyond_f16.is_some() { Err((1, f64::from(v))) } else { Ok(()) });
        }
        assert_eq!(from_f32(Float::BF16, &[f32::MAX], &mut Vec::new()), Err((0, f64::from(f32::MAX))));
        for dtype in [Float::F16, Float::BF16, Float::F32, Float::F64] {
            let mut out = Vec::new();
            assert_eq!(from_f32(dtype, &[f32::NAN, f32::INFINITY, 1.5], &mut out), Ok(()));
            let mut back = [0.0; 3];
            to_f32(dtype, &out, &mut back);
            assert!(back[0].is_nan() && back[1..] == [f32::INFINITY, 1.5], "{dtype}");
        }
    }
}
