//! Where the files are.

use std::path::{Path, PathBuf};

use omnix_model::{Network, NetworkConfig};
use serde_json::Value;

/// A folder of the repository.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A JSON file of `tests/data/model`.
pub(crate) fn json(name: &str) -> Value {
    let path = root().join("tests/data/model").join(format!("{name}.json"));
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// The configuration of a golden network.
pub(crate) fn config(name: &str) -> NetworkConfig {
    NetworkConfig::from_json(&json(name)).unwrap()
}

/// A golden network.
pub(crate) fn network(name: &str) -> Network {
    Network::new(config(name))
}

/// The configuration of the checkpoint inside the repository.
pub(crate) fn nano() -> Value {
    let path = root().join("assets/weights/nano/config.json");
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// A folder of goldens or weights outside the repository, when it is there.
pub(crate) fn shared(folder: &str) -> Option<PathBuf> {
    Some(root().join("../shared").join(folder)).filter(|p| p.is_dir())
}
