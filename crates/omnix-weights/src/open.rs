//! Opening of a checkpoint: its files, its configuration, or what it is taken for without one.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use omnix_tensors::TensorFile;
use serde_json::json;

use crate::locate::{self, Weights};
use crate::{Checkpoint, WeightsError, config, known};

impl Checkpoint {
    /// Opens a folder with `config.json` and `model.safetensors` (or `model.safetensors.index.json` and its shards, or one checkpoint
    /// of PyTorch), or such a file with `config.json` beside it. Without a `config.json`, published networks are known by their
    /// tensors ([`Checkpoint::taken_for`]).
    ///
    /// The weights are mapped, not read. Do not shorten the files while the checkpoint is open: the system then ends the
    /// process at the next access. Replacing a file by renaming another over it is harmless.
    ///
    /// # Errors
    /// Files that are absent, truncated, neither safetensors nor a checkpoint of PyTorch, or a configuration that is
    /// no JSON object. Tensors of types that cannot be used are no error before they are asked for.
    pub fn open(path: &Path) -> Result<Self, WeightsError> {
        let located = locate::locate(path)?;
        // The weights first: what is wrong with them says more than "no config.json beside it".
        let (files, index) = match located.weights {
            Weights::Single(file) => {
                let file = TensorFile::open(&file)?;
                let index = file.tensors().map(|(name, _)| (name.to_owned(), 0)).collect();
                (vec![file], index)
            }
            Weights::Sharded { index, map } => open_shards(&index, &map)?,
        };
        match config::read_config(&located.config) {
            Ok(config) => Ok(Self::assemble(config, files, index, name_of(path), path.to_owned())),
            Err(missing @ WeightsError::ConfigMissing { .. }) => {
                let found = Self::assemble(json!({}), files, index, name_of(path), path.to_owned());
                let (config, name) = known::configuration(&found).ok_or(missing)?;
                Ok(found.taken(config, name))
            }
            Err(error) => Err(error),
        }
    }
}

/// Opens every shard of an index and checks that each holds what the index says.
fn open_shards(
    path: &Path,
    map: &BTreeMap<String, String>,
) -> Result<(Vec<TensorFile>, BTreeMap<String, usize>), WeightsError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let shards: Vec<&str> = map.values().map(String::as_str).collect::<BTreeSet<_>>().into_iter().collect();
    let mut files = Vec::with_capacity(shards.len());
    for shard in &shards {
        let file = folder.join(shard);
        if !file.exists() {
            return Err(WeightsError::ShardMissing { path: path.to_owned(), shard: (*shard).to_owned() });
        }
        files.push(TensorFile::open(&file)?);
    }
    let mut index = BTreeMap::new();
    for (tensor, shard) in map {
        let place = shards.partition_point(|s| *s < shard.as_str());
        if files[place].info(tensor).is_none() {
            let reason = format!("{tensor} is not in {shard}");
            return Err(WeightsError::BadIndex { path: path.to_owned(), reason });
        }
        index.insert(tensor.clone(), place);
    }
    Ok((files, index))
}

/// The name of a folder, or of a file without its ending; `model.safetensors` is named by its folder.
fn name_of(path: &Path) -> String {
    let full = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let named = match (full.is_dir(), full.file_stem(), full.parent()) {
        (false, Some(stem), Some(folder)) if stem == "model" || stem == "model.safetensors.index" => folder.file_name(),
        (false, stem, _) => stem,
        (true, _, _) => full.file_name(),
    };
    named.map_or_else(|| "checkpoint".to_owned(), |name| name.to_string_lossy().into_owned())
}
