//! Finds the files of a checkpoint: one safetensors file, or the shards of an index, and `config.json`.
//!
//! `model.safetensors.index.json` is `{"weight_map": {tensor name: file name}}`; the shards lie beside it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use serde_json::Value;

use crate::WeightsError;

/// The single file of an unsharded checkpoint.
const SINGLE: &str = "model.safetensors";
/// The index of a sharded one.
const INDEX: &str = "model.safetensors.index.json";
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

/// Finds the files for a folder, a safetensors file or an index file.
pub(crate) fn locate(path: &Path) -> Result<Located, WeightsError> {
    if path.is_dir() {
        return locate_folder(path);
    }
    if !path.is_file() {
        return Err(WeightsError::NotFound { path: path.to_owned() });
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
    let entries = std::fs::read_dir(folder).map_err(|e| WeightsError::io("list the folder", folder, e))?;
    let mut found = BTreeSet::new();
    let mut pytorch = BTreeSet::new();
    for entry in entries {
        let name = entry.map_err(|e| WeightsError::io("list the folder", folder, e))?.file_name();
        let extension = Path::new(&name).extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if extension == "safetensors" {
            found.insert(name.to_string_lossy().into_owned());
        } else if PYTORCH.contains(&extension.as_str()) {
            pytorch.insert(name);
        }
    }
    match pytorch.first() {
        Some(name) if found.is_empty() => Err(WeightsError::PyTorch { path: folder.join(name) }),
        _ => Err(WeightsError::NoWeights { path: folder.to_owned(), found: found.into_iter().collect() }),
    }
}

fn read_index(path: &Path) -> Result<Weights, WeightsError> {
    let bad = |reason: &str| WeightsError::BadIndex { path: path.to_owned(), reason: reason.to_owned() };
    let text = std::fs::read(path).map_err(|e| WeightsError::io("read the index of the weights", path, e))?;
    let json: Value = serde_json::from_slice(&text).map_err(|e| bad(&e.to_string()))?;
    let entries = json.get("weight_map").and_then(Value::as_object).ok_or_else(|| bad("it has no weight_map"))?;
    let mut map = BTreeMap::new();
    for (tensor, file) in entries {
        let file = file.as_str().ok_or_else(|| bad("a file name is no string"))?;
        // A shard is a neighbour of the index, never a path to elsewhere.
        let mut parts = Path::new(file).components();
        if !(matches!(parts.next(), Some(Component::Normal(_))) && parts.next().is_none()) {
            return Err(bad(&format!("{file:?} is no plain file name")));
        }
        map.insert(tensor.clone(), file.to_owned());
    }
    if map.is_empty() {
        return Err(bad("its weight_map is empty"));
    }
    Ok(Weights::Sharded { index: path.to_owned(), map })
}

/// Reads and parses `config.json`, which must be a JSON object.
pub(crate) fn read_config(path: &Path) -> Result<Value, WeightsError> {
    match std::fs::read_to_string(path) {
        Ok(text) => parse_config(&text, path),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            Err(WeightsError::ConfigMissing { path: path.to_owned() })
        }
        Err(e) if e.kind() == std::io::ErrorKind::InvalidData => {
            Err(WeightsError::ConfigInvalid { path: path.to_owned(), reason: "it is not UTF-8 text".to_owned() })
        }
        Err(e) => Err(WeightsError::io("read the configuration", path, e)),
    }
}

/// Parses the text of a `config.json`.
pub(crate) fn parse_config(text: &str, path: &Path) -> Result<Value, WeightsError> {
    let invalid = |reason: String| WeightsError::ConfigInvalid { path: path.to_owned(), reason };
    let config: Value = serde_json::from_str(text).map_err(|e| invalid(e.to_string()))?;
    if config.is_object() { Ok(config) } else { Err(invalid("it is no object".to_owned())) }
}
