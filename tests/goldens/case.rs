//! One recorded case file, and the running comparison of a folder.

use std::collections::BTreeMap;
use std::path::Path;

use omnix::checkpoint::TensorFile;
use omnix_tests::relative_error;

/// A recorded tensor.
#[derive(Clone)]
pub(crate) struct Tensor {
    pub(crate) shape: Vec<usize>,
    pub(crate) data: Vec<f32>,
}

/// All tensors of a case file as f32; integers are converted.
pub(crate) struct Case {
    pub(crate) tensors: BTreeMap<String, Tensor>,
}

impl Case {
    pub(crate) fn open(path: &Path) -> Result<Self, String> {
        let file = TensorFile::open(path).map_err(|e| e.to_string())?;
        let mut tensors = BTreeMap::new();
        for (name, info) in file.tensors() {
            let bytes = file.tensor_bytes(name).ok_or("no bytes")?;
            let data = match info.dtype.as_str() {
                "F32" | "F16" | "BF16" | "F64" => file.tensor(name).map_err(|e| e.to_string())?.to_f32(),
                "I64" => {
                    bytes.chunks_exact(8).map(|b| i64::from_le_bytes(b.try_into().unwrap_or_default()) as f32).collect()
                }
                "I32" => {
                    bytes.chunks_exact(4).map(|b| i32::from_le_bytes(b.try_into().unwrap_or_default()) as f32).collect()
                }
                "U8" | "BOOL" => bytes.iter().map(|b| f32::from(*b)).collect(),
                other => return Err(format!("{name} has type {other}")),
            };
            tensors.insert(name.to_owned(), Tensor { shape: info.shape.clone(), data });
        }
        Ok(Self { tensors })
    }

    /// What was recorded of one network of a nested case: its inputs, and the names that begin with `part`, without that.
    pub(crate) fn part(&self, part: &str) -> Self {
        let own = |name: &str| {
            name.strip_prefix(part).or(Some(name).filter(|name| name.starts_with("in."))).map(str::to_owned)
        };
        let tensors = self.tensors.iter().filter_map(|(name, tensor)| Some((own(name)?, tensor.clone())));
        Self { tensors: tensors.collect() }
    }

    /// The images, and how many of which height and width.
    pub(crate) fn images(&self) -> Result<(&Tensor, [usize; 3]), String> {
        let images = self.get("in.images").or_else(|| self.get("in.image_normalised")).ok_or("no input images")?;
        let [.., count, 3, height, width] = images.shape[..] else {
            return Err(format!("images of shape {:?}", images.shape));
        };
        Ok((images, [count, height, width]))
    }

    pub(crate) fn get(&self, name: &str) -> Option<&Tensor> {
        self.tensors.get(name)
    }

    /// The single number stored under `name`.
    pub(crate) fn number(&self, name: &str) -> Option<f32> {
        self.get(name)?.data.first().copied()
    }
}

impl Tensor {
    /// A planar `[n, c, h, w]` tensor as `[n, h, w, c]`; anything else as it is.
    pub(crate) fn channels_last(&self) -> Vec<f32> {
        let [n, c, h, w] = self.shape[..] else { return self.data.clone() };
        let mut out = vec![0.0; self.data.len()];
        for i in 0..n {
            for channel in 0..c {
                for pixel in 0..h * w {
                    out[(i * h * w + pixel) * c + channel] = self.data[(i * c + channel) * h * w + pixel];
                }
            }
        }
        out
    }
}

/// Worst error so far, and what failed.
#[derive(Default)]
pub(crate) struct Comparison {
    pub(crate) tensors: usize,
    pub(crate) worst: f64,
    pub(crate) at: String,
    /// Worst error of runs with f16 weights.
    pub(crate) half: f64,
    /// Worst error of runs with int8 weights.
    pub(crate) byte: f64,
    pub(crate) failures: Vec<String>,
}

impl Comparison {
    /// Compares by relative error in norm against `limit`; only f32 runs count for the worst figure.
    pub(crate) fn compare(&mut self, what: &str, got: &[f32], want: &[f32], limit: f64, headline: bool) {
        let error = relative_error(got, want);
        self.note(what, error, limit, headline);
        if got.len() != want.len() {
            self.failures.push(format!("{what}: {} numbers, recorded {}", got.len(), want.len()));
        }
    }

    /// Enters an error measured elsewhere.
    pub(crate) fn note(&mut self, what: &str, error: f64, limit: f64, headline: bool) {
        self.tensors += 1;
        if headline && (error > self.worst || error.is_nan()) {
            self.worst = error;
            what.clone_into(&mut self.at);
        }
        for (worst, label) in [(&mut self.half, " f16 "), (&mut self.byte, " i8 ")] {
            if !headline && what.contains(label) {
                *worst = worst.max(error);
            }
        }
        if error.is_nan() || error > limit {
            self.failures.push(format!("{what}: {error:.3e} > {limit:.0e}"));
        }
    }
}
