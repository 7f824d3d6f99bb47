//! Oracle of `top_k`.

/// The indices of the k largest of each row of n, ascending (`flat`: plus row · n), and the mask; NaN is lowest, ties go to the lower index.
#[must_use]
pub fn top_k((n, k): (usize, usize), flat: bool, x: &[f32]) -> (Vec<u32>, Vec<f32>) {
    let (mut indices, mut mask) = (Vec::new(), vec![0.0; x.len()]);
    for (row, values) in x.chunks_exact(n).enumerate() {
        let mut order: Vec<usize> = (0..n).collect();
        // A stable sort keeps the lower index first. NaN sorts behind everything.
        order.sort_by(|&a, &b| match (values[a].is_nan(), values[b].is_nan()) {
            (false, false) => values[b].partial_cmp(&values[a]).unwrap_or(std::cmp::Ordering::Equal),
            (a, b) => a.cmp(&b),
        });
        order.truncate(k);
        order.sort_unstable();
        for i in order {
            indices.push((if flat { row * n + i } else { i }) as u32);
            mask[row * n + i] = 1.0;
        }
    }
    (indices, mask)
}
