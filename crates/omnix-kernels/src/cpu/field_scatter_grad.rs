//! Oracle of `field_scatter_grad`.

use crate::field_scatter_grad::FieldScatterGrad;

/// `dz[t, s, i, :] = dfield[s, t, index[s, i], :]`.
#[must_use]
pub fn field_scatter_grad(spec: &FieldScatterGrad, dfield: &[f32], index: &[u32]) -> Vec<f32> {
    let (sources, times, k) = (spec.sources as usize, spec.times as usize, spec.k as usize);
    let (cells, c) = (spec.cells as usize, spec.c as usize);
    let mut dz = Vec::with_capacity(times * sources * k * c);
    for t in 0..times {
        for s in 0..sources {
            for i in 0..k {
                let cell = index[s * k + i] as usize;
                if cell < cells {
                    dz.extend_from_slice(&dfield[((s * times + t) * cells + cell) * c..][..c]);
                } else {
                    dz.resize(dz.len() + c, 0.0);
                }
            }
        }
    }
    dz
}
