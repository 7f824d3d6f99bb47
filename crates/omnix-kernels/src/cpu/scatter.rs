//! Oracle of `scatter`.

/// `y[index[r], :] = x[r, :]`; indices out of range are skipped.
///
/// # Panics
/// When an index occurs twice.
pub fn scatter(c: usize, x: &[u32], index: &[u32], y: &mut [u32]) {
    let mut written = vec![false; y.len() / c];
    for (row, &i) in x.chunks_exact(c).zip(index) {
        let Some(once) = written.get_mut(i as usize) else { continue };
        assert!(!*once, "row {i} has two writers");
        *once = true;
        y[i as usize * c..][..c].copy_from_slice(row);
    }
}
