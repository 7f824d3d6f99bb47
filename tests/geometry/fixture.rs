//! Reads golden tensors, and finds golden files inside and outside the repository.

use std::path::{Path, PathBuf};

use omnix_weights::TensorFile;

/// A golden file.
pub(crate) struct Golden(TensorFile);

impl Golden {
    fn open(path: &Path) -> Self {
        Self(TensorFile::open(path).unwrap())
    }

    /// Shape and values of a tensor as f32.
    pub(crate) fn f32(&self, name: &str) -> (Vec<usize>, Vec<f32>) {
        let view = self.0.tensor(name).unwrap();
        (view.shape.to_vec(), view.to_f32())
    }

    /// The values of a tensor of 64-bit integers.
    pub(crate) fn i64(&self, name: &str) -> Vec<i64> {
        let bytes = self.0.tensor_bytes(name).unwrap();
        bytes.as_chunks().0.iter().map(|b| i64::from_le_bytes(*b)).collect()
    }

    /// Names of all tensors.
    pub(crate) fn names(&self) -> Vec<String> {
        self.0.tensors().map(|(name, _)| name.to_owned()).collect()
    }

    /// Consecutive N by M matrices of a tensor.
    pub(crate) fn matrices<const N: usize, const M: usize>(&self, name: &str) -> Vec<[[f32; M]; N]> {
        let (_, values) = self.f32(name);
        let rows = values.as_chunks::<M>().0;
        rows.as_chunks::<N>().0.to_vec()
    }

    /// Consecutive poses of a tensor of 3x4 or 4x4 matrices.
    pub(crate) fn poses(&self, name: &str) -> Vec<[[f32; 4]; 3]> {
        let (shape, values) = self.f32(name);
        let rows = shape[shape.len() - 2];
        values.chunks(rows * 4).map(|m| std::array::from_fn(|i| std::array::from_fn(|j| m[4 * i + j]))).collect()
    }
}

/// The copy in the repository, and `shared` below `../shared/golden/da3` when it is there.
pub(crate) fn goldens(copy: &str, shared: &[&str]) -> Vec<Golden> {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths = vec![tests.join("data/geometry").join(copy)];
    let root: PathBuf = tests.join("../../shared/golden/da3");
    paths.extend(shared.iter().map(|name| root.join(name)).filter(|path| path.is_file()));
    paths.iter().map(|path| Golden::open(path)).collect()
}

/// Fails when two lists differ by more than `tolerance` anywhere.
#[track_caller]
pub(crate) fn assert_close(what: &str, found: &[f32], expected: &[f32], tolerance: f32) {
    assert_eq!(found.len(), expected.len(), "{what}: length");
    for (k, (a, b)) in found.iter().zip(expected).enumerate() {
        // NaN fails too.
        assert!((a - b).abs() <= tolerance, "{what}[{k}]: {a} instead of {b}");
    }
}

/// As [`assert_close`], relative to the largest expected magnitude.
#[track_caller]
pub(crate) fn assert_relative(what: &str, found: &[f32], expected: &[f32], tolerance: f32) {
    let scale = expected.iter().fold(0.0f32, |m, v| m.max(v.abs()));
    assert_close(what, found, expected, tolerance * scale);
}
