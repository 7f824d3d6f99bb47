//! Oracle of `fill`.

use crate::fill::Fill;

/// Writes the words that `spec` names into `y`.
///
/// # Panics
/// When they are not all in `y`.
pub fn fill(spec: &Fill, y: &mut [u32]) {
    for i in 0..spec.n {
        y[(spec.first + i) as usize] = spec.value;
    }
}
