//! A checkpoint written anew: as safetensors, in another type, in shards.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use omnix_tensors::{AtomicFile, Dtype, Float, TensorError, TensorSpec, TensorView, TensorWriter};
use serde_json::json;

use crate::locate::{INDEX, SINGLE};
use crate::{Checkpoint, WeightsError};

/// What a checkpoint is converted to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Conversion {
    /// The type of all floating-point numbers; as they are where it is not given. Rounded to nearest, ties to even.
    pub dtype: Option<Float>,
    /// Bytes of tensors in a file at most; a tensor that is larger has a file of its own. One file where it is not given.
    pub shard: Option<u64>,
}

/// What was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Converted {
    /// The files of tensors, in order.
    pub files: Vec<PathBuf>,
    /// Bytes of tensors in all of them.
    pub bytes: u64,
    /// Tensors that were not written, since they are not the network's: their full names.
    pub left_out: Vec<String>,
}

/// Bytes converted at a time, so that a large tensor is not held twice; whole elements of every type.
const PIECE: usize = 1 << 22;

impl Conversion {
    /// The files that a conversion would write, each with its bytes of tensors.
    #[must_use]
    pub fn plan(&self, checkpoint: &Checkpoint) -> Vec<(String, u64)> {
        let shards = self.shards(checkpoint);
        let bytes = |specs: &[TensorSpec]| specs.iter().map(size).sum();
        let count = shards.len();
        shards.iter().enumerate().map(|(k, specs)| (file_name(k, count), bytes(specs))).collect()
    }

    /// Writes the network's tensors, names unchanged, and `config.json` into a folder that has neither. Each file has its name only when it
    /// is whole, and `config.json` comes last. Tensors are converted piece by piece. `progress` is told bytes done and in all.
    ///
    /// # Errors
    /// A checkpoint that is there already; a number that the type cannot hold; a failure of writing; `progress` broke off
    /// ([`WeightsError::Interrupted`]).
    pub fn write(
        &self,
        checkpoint: &Checkpoint,
        folder: &Path,
        progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
    ) -> Result<Converted, WeightsError> {
        let config = folder.join("config.json");
        if let Some(there) = [&config, &folder.join(SINGLE), &folder.join(INDEX)].into_iter().find(|path| path.exists())
        {
            return Err(WeightsError::InTheWay { path: there.clone() });
        }
        let shards = self.shards(checkpoint);
        let total: u64 = shards.iter().flatten().map(size).sum();
        let mut metadata = checkpoint.metadata().clone();
        metadata.insert("format".to_owned(), "pt".to_owned());
        let (mut files, mut map, mut done) = (Vec::new(), BTreeMap::new(), 0);
        for (k, specs) in shards.iter().enumerate() {
            let name = file_name(k, shards.len());
            let mut writer = TensorWriter::create(&folder.join(&name), specs, &metadata)?;
            for spec in specs {
                self.copy(checkpoint, spec, &mut writer)?;
                done += size(spec);
                if progress(done, total).is_break() {
                    return Err(WeightsError::Interrupted);
                }
                map.insert(spec.name.clone(), name.clone());
            }
            files.push(writer.finish()?);
        }
        if files.len() > 1 {
            let index = json!({ "metadata": { "total_size": total }, "weight_map": map });
            write_json(&folder.join(INDEX), &index)?;
        }
        write_json(&config, checkpoint.config_json())?;
        let left_out = checkpoint.tensors().map(|(name, _)| name).filter(|name| !map.contains_key(*name));
        Ok(Converted { files, bytes: total, left_out: left_out.map(str::to_owned).collect() })
    }

    /// The tensors of each file, in the order of their names.
    fn shards(&self, checkpoint: &Checkpoint) -> Vec<Vec<TensorSpec>> {
        let most = self.shard.unwrap_or(u64::MAX);
        let mut shards = vec![Vec::new()];
        let mut bytes = 0;
        for (name, info) in checkpoint.network_tensors() {
            // Types that nobody knows are of no use to anybody.
            let Some(stored) = info.known() else { continue };
            let dtype = self.dtype.filter(|_| stored.float().is_some()).map_or(stored, Float::dtype);
            let spec = TensorSpec::new(name, dtype, info.shape.clone());
            if bytes > 0 && bytes + size(&spec) > most {
                shards.push(Vec::new());
                bytes = 0;
            }
            bytes += size(&spec);
            if let Some(shard) = shards.last_mut() {
                shard.push(spec);
            }
        }
        shards
    }

    /// Copies a tensor's numbers, converted where its type changes.
    fn copy(&self, checkpoint: &Checkpoint, spec: &TensorSpec, writer: &mut TensorWriter) -> Result<(), WeightsError> {
        let Some((file, bytes, stored)) = checkpoint.stored(&spec.name) else {
            return Err(WeightsError::TensorMissing { tensor: spec.name.clone(), path: checkpoint.path().to_owned() });
        };
        for (piece, first) in bytes.chunks(PIECE).zip((0..).step_by(PIECE / stored.size())) {
            match stored.float().filter(|_| stored != spec.dtype) {
                Some(dtype) => {
                    let numbers = TensorView { shape: &[], dtype, bytes: piece }.to_f32();
                    if dtype == Float::F64 {
                        fits(piece, &numbers, first, spec, checkpoint)?;
                    }
                    writer.write_f32(&spec.name, &numbers)?;
                }
                None => writer.write_bytes(&spec.name, piece)?,
            }
        }
        file.release(&spec.name);
        Ok(())
    }
}

/// Whether every F64 that is finite is so as f32; the first of `numbers` is element `first` of its tensor.
fn fits(
    bytes: &[u8],
    numbers: &[f32],
    first: usize,
    spec: &TensorSpec,
    checkpoint: &Checkpoint,
) -> Result<(), WeightsError> {
    let wide = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b));
    match wide.zip(numbers).enumerate().find(|(_, (wide, number))| wide.is_finite() && !number.is_finite()) {
        None => Ok(()),
        Some((index, (value, _))) => Err(TensorError::DoesNotFit {
            tensor: spec.name.clone(),
            index: first + index,
            value,
            dtype: spec.dtype.name(),
            wider: Dtype::F64.name(),
            path: checkpoint.path().to_owned(),
        }
        .into()),
    }
}

/// `model.safetensors`, or the name of shard `k` of `count`.
fn file_name(k: usize, count: usize) -> String {
    if count == 1 { SINGLE.to_owned() } else { format!("model-{:05}-of-{count:05}.safetensors", k + 1) }
}

/// Bytes of a tensor. No overflow: shapes were compared with the file's length, and no type is more than eight bytes.
fn size(spec: &TensorSpec) -> u64 {
    (spec.len() * Dtype::size(spec.dtype)) as u64
}

fn write_json(path: &Path, value: &serde_json::Value) -> Result<(), WeightsError> {
    let failed = |source| TensorError::Io { action: "write the file", path: path.to_owned(), source };
    let mut file = AtomicFile::create(path).map_err(failed)?;
    file.write_all(format!("{value:#}\n").as_bytes()).map_err(failed)?;
    file.commit().map_err(failed)?;
    Ok(())
}
