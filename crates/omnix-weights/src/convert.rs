//! Conversion of stored elements (little endian, any alignment) to f32 and f16.

use half::slice::{HalfBitsSliceExt, HalfFloatSliceExt};
use half::{bf16, f16};

use crate::view::Dtype;

/// Elements converted at once through a buffer on the stack.
const CHUNK: usize = 1024;

/// Converts all of `bytes`; `out` has one place per element.
pub(crate) fn to_f32(dtype: Dtype, bytes: &[u8], out: &mut [f32]) {
    match dtype {
        Dtype::F32 => {
            for (o, b) in out.iter_mut().zip(bytes.as_chunks().0) {
                *o = f32::from_le_bytes(*b);
            }
        }
        Dtype::BF16 => {
            for (o, b) in out.iter_mut().zip(bytes.as_chunks().0) {
                // By hand, not `to_f32`: that also quiets signalling NaN, which costs the vectorised loop.
                *o = f32::from_bits(u32::from(u16::from_le_bytes(*b)) << 16);
            }
        }
        Dtype::F16 => {
            let mut bits = [0u16; CHUNK];
            for (o, b) in out.chunks_mut(CHUNK).zip(bytes.chunks(CHUNK * 2)) {
                let bits = &mut bits[..o.len()];
                read_bits(b, bits);
                bits.reinterpret_cast::<f16>().convert_to_f32_slice(o);
            }
        }
        Dtype::F64 => {
            for (o, b) in out.iter_mut().zip(bytes.as_chunks().0) {
                *o = f64::from_le_bytes(*b) as f32;
            }
        }
    }
}

/// Converts all of `bytes` to f16 by way of f32, rounding to nearest, ties to even.
pub(crate) fn to_f16(dtype: Dtype, bytes: &[u8], out: &mut [f16]) {
    match dtype {
        Dtype::F16 => read_bits(bytes, out.reinterpret_cast_mut()),
        Dtype::F32 | Dtype::BF16 | Dtype::F64 => {
            let mut values = [0.0f32; CHUNK];
            for (o, b) in out.chunks_mut(CHUNK).zip(bytes.chunks(CHUNK * dtype.size())) {
                let values = &mut values[..o.len()];
                to_f32(dtype, b, values);
                o.convert_from_f32_slice(values);
            }
        }
    }
}

/// One element; `bytes` has its size.
pub(crate) fn element(dtype: Dtype, bytes: &[u8]) -> f32 {
    match (dtype, bytes) {
        (Dtype::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        (Dtype::F16, &[a, b]) => f16::from_le_bytes([a, b]).to_f32(),
        (Dtype::BF16, &[a, b]) => bf16::from_le_bytes([a, b]).to_f32(),
        (Dtype::F64, &[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]) as f32,
        _ => unreachable!("BUG: an element of {dtype} in {} bytes", bytes.len()),
    }
}

fn read_bits(bytes: &[u8], out: &mut [u16]) {
    for (o, b) in out.iter_mut().zip(bytes.as_chunks().0) {
        *o = u16::from_le_bytes(*b);
    }
}
