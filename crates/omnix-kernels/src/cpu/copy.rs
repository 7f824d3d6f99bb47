//! Oracle of `copy`.

use crate::copy::Copy;

/// Copies the elements of `x` that `spec` addresses into `y`.
///
/// # Panics
/// When an address is outside of its slice.
pub fn copy<T: core::marker::Copy>(spec: &Copy, x: &[T], y: &mut [T]) {
    let [a, b, c, d, e, f] = spec.shape;
    for index in (0..a).flat_map(|a| (0..b).map(move |b| [a, b])) {
        for (c, d) in (0..c).flat_map(|c| (0..d).map(move |d| (c, d))) {
            for (e, f) in (0..e).flat_map(|e| (0..f).map(move |f| (e, f))) {
                let index = [index[0], index[1], c, d, e, f];
                let at = |offset: u64, strides: &[u32; 6]| {
                    let sum: u64 = index.iter().zip(strides).map(|(&i, &s)| u64::from(i) * u64::from(s)).sum();
                    (offset + sum) as usize
                };
                y[at(spec.dst.offset, &spec.dst.strides)] = x[at(spec.src.offset, &spec.src.strides)];
            }
        }
    }
}
