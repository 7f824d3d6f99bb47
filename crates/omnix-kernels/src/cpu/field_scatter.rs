//! Oracle of `field_scatter`.

use crate::field_scatter::FieldScatter;

/// `field[s, t, index[s, i], :] = z[t, s, i, :]` over a field of `rest`.
#[must_use]
pub fn field_scatter(spec: &FieldScatter, z: &[f32], index: &[u32], rest: &[f32]) -> Vec<f32> {
    let (sources, times, k) = (spec.sources as usize, spec.times as usize, spec.k as usize);
    let (cells, c) = (spec.cells as usize, spec.c as usize);
    let mut field = rest.repeat(sources * times * cells);
    for s in 0..sources {
        for t in 0..times {
            for i in 0..k {
                let cell = index[s * k + i] as usize;
                let to = ((s * times + t) * cells + cell) * c;
                field[to..to + c].copy_from_slice(&z[((t * sources + s) * k + i) * c..][..c]);
            }
        }
    }
    field
}
