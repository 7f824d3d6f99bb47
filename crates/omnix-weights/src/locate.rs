//! Finds the files of a checkpoint: one file of safetensors or of PyTorch, or the shards of an index, and `config.json`.
//!
//! `model.safetensors.index.json` is `{"weight_map": {tensor name: file name}}`; the shards lie beside it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use crate::{WeightsError, config, hub};

/// The single file of an unsharded checkpoint.
pub(crate) const SINGLE: &str = "model.safetensors";
/// The index of a sharded one.
pub(crate) const INDEX: &str = "model.safetensors.index.json";
/// Endings of PyTorch's own files.
const PYTORCH: [&str; 4] = ["pt", "pth", "ckpt", "bin"];

/// What lies where.
#[derive(Debug)]
pub(crate) struct Located {
    pub(crate) config: PathBuf,
    pub(crate) weights: Weights,
}

/// The weights of a checkpoint.
#[derive(Debug)]
pub(crate) enum Weights {
    Single(PathBuf),
    Sharded {
        index: PathBuf,
        /// File name of the shard of each tensor.
        map: BTreeMap<String, String>,
    },
}

/// Finds the files for a folder, a file of tensors, an index file, or the name of a repository in the hub's cache.
pub(crate) fn locate(path: &Path) -> Result<Located, WeightsError> {
    if path.is_dir() {
        return locate_folder(path);
    }
    if !path.exists() {
        let not_found = |looked| WeightsError::NotFound { path: path.to_owned(), looked };
        return match path.to_str().and_then(hub::find) {
            Some(Ok(folder)) => locate_folder(&folder),
            Some(Err(folder)) => Err(not_found(Some(folder))),
            None => Err(not_found(None)),
        };
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let is_index = path.file_name().is_some_and(|name| name.to_string_lossy().ends_with(".index.json"));
    let weights = if is_index { read_index(path)? } else { Weights::Single(path.to_owned()) };
    Ok(Located { config: folder.join("config.json"), weights })
}

fn locate_folder(folder: &Path) -> Result<Located, WeightsError> {
    let config = folder.join("config.json");
    let single = folder.join(SINGLE);
    if single.is_file() {
        return Ok(Located { config, weights: Weights::Single(single) });
    }
    let index = folder.join(INDEX);
    if index.is_file() {
        return Ok(Located { config, weights: read_index(&index)? });
    }
    // Name what is there instead: the message can then say what to do.
    let listing = |source| WeightsError::Folder { path: folder.to_owned(), source };
    let entries = std::fs::read_dir(folder).map_err(listing)?;
    let mut found = BTreeSet::new();
    let mut pytorch = BTreeSet::new();
    for entry in entries {
        let name = entry.map_err(listing)?.file_name();
        let extension = Path::new(&name).extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if extension == "safetensors" {
            found.insert(name.to_string_lossy().into_owned());
        } else if PYTORCH.contains(&extension.as_str()) {
            pytorch.insert(name.to_string_lossy().into_owned());
        }
    }
    if let (true, 1, Some(only)) = (found.is_empty(), pytorch.len(), pytorch.first()) {
        return Ok(Located { config, weights: Weights::Single(folder.join(only)) });
    }
    found.extend(pytorch);
    Err(WeightsError::NoWeights { path: folder.to_owned(), found: found.into_iter().collect() })
}

fn read_index(path: &Path) -> Result<Weights, WeightsError> {
    let bad = |reason: &str| WeightsError::BadIndex { path: path.to_owned(), reason: reason.to_owned() };
    let map = config::read_index(path)?;
    for file in map.values() {
        // A shard is a neighbour of the index, never a path to elsewhere.
        let mut parts = Path::new(file).components();
        if !(matches!(parts.next(), Some(Component::Normal(_))) && parts.next().is_none()) {
            return Err(bad(&format!("{file:?} is no plain file name")));
        }
    }
    if map.is_empty() {
        return Err(bad("its weight_map is empty"));
    }
    Ok(Weights::Sharded { index: path.to_owned(), map })
}
