//! Small checkpoints, written with the format's own crate.

use std::collections::HashMap;
use std::path::Path;

use half::{bf16, f16};
use safetensors::tensor::{Dtype, TensorView};

/// A tensor to be written: name, type, shape, bytes.
pub(crate) type Tensor = (String, Dtype, Vec<usize>, Vec<u8>);

/// An F32 tensor of the given values.
pub(crate) fn f32(name: &str, shape: &[usize], values: &[f32]) -> Tensor {
    (name.to_owned(), Dtype::F32, shape.to_vec(), bytes(values.iter().map(|v| v.to_le_bytes())))
}

/// An F16 tensor.
pub(crate) fn f16(name: &str, shape: &[usize], values: &[f32]) -> Tensor {
    let values = values.iter().map(|&v| f16::from_f32(v).to_le_bytes());
    (name.to_owned(), Dtype::F16, shape.to_vec(), bytes(values))
}

/// A BF16 tensor.
pub(crate) fn bf16(name: &str, shape: &[usize], values: &[f32]) -> Tensor {
    let values = values.iter().map(|&v| bf16::from_f32(v).to_le_bytes());
    (name.to_owned(), Dtype::BF16, shape.to_vec(), bytes(values))
}

/// An F64 tensor.
pub(crate) fn f64(name: &str, shape: &[usize], values: &[f64]) -> Tensor {
    (name.to_owned(), Dtype::F64, shape.to_vec(), bytes(values.iter().map(|v| v.to_le_bytes())))
}

/// An I64 tensor.
pub(crate) fn i64(name: &str, values: &[i64]) -> Tensor {
    (name.to_owned(), Dtype::I64, vec![values.len()], bytes(values.iter().map(|v| v.to_le_bytes())))
}

fn bytes<const N: usize>(values: impl Iterator<Item = [u8; N]>) -> Vec<u8> {
    values.flatten().collect()
}

/// A safetensors file of these tensors and metadata.
pub(crate) fn file(tensors: &[Tensor], metadata: &[(&str, &str)]) -> Vec<u8> {
    let views =
        tensors.iter().map(|(name, dtype, shape, data)| (name, TensorView::new(*dtype, shape.clone(), data).unwrap()));
    let metadata: HashMap<String, String> = metadata.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    safetensors::serialize(views, Some(metadata)).unwrap()
}

/// A safetensors file from a header as text, for headers that no writer would make.
pub(crate) fn raw(header: &str, data: &[u8]) -> Vec<u8> {
    [&(header.len() as u64).to_le_bytes(), header.as_bytes(), data].concat()
}

/// Writes `config.json` and `model.safetensors` into a folder.
pub(crate) fn write(folder: &Path, config: &str, weights: &[u8]) {
    std::fs::write(folder.join("config.json"), config).unwrap();
    std::fs::write(folder.join("model.safetensors"), weights).unwrap();
}
