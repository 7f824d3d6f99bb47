//! A checkpoint of random weights as a folder that omnix and the Python package read: `config.json` with the network's name, and
//! `model.safetensors` (an 8-byte length, a JSON header, the numbers) with the published names.

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;

use omnix::bench::RandomWeights;
use omnix::model::config::NetworkConfig;
use omnix_graph::ParameterSource as _;
use serde_json::{Map, json};

/// Published names begin with it.
const PREFIX: &str = "model.";

/// Writes both files into `dir`, one tensor in memory at a time. An interrupted run leaves no whole header behind: the file
/// is renamed when it is whole.
pub(crate) fn write(dir: &Path, config: &NetworkConfig, weights: &RandomWeights) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(dir)?;
    let mut header = Map::new();
    let mut end = 0usize;
    for (name, shape) in weights.shapes() {
        let begin = end;
        end += shape.iter().product::<usize>() * 4;
        header
            .insert(format!("{PREFIX}{name}"), json!({ "dtype": "F32", "shape": shape, "data_offsets": [begin, end] }));
    }
    let mut header = serde_json::to_vec(&header)?;
    // Numbers start on a multiple of 8.
    header.resize(header.len().next_multiple_of(8), b' ');
    let partial = dir.join("model.safetensors.partial");
    let mut file = BufWriter::new(File::create(&partial)?);
    file.write_all(&(header.len() as u64).to_le_bytes())?;
    file.write_all(&header)?;
    for (name, _) in weights.shapes() {
        let numbers = weights.read(name).map_err(|error| error.to_string())?;
        file.write_all(bytemuck::cast_slice(&numbers))?;
    }
    file.into_inner()?;
    std::fs::write(dir.join("config.json"), serde_json::to_vec(&json!({ "model_name": config.name }))?)?;
    Ok(std::fs::rename(partial, dir.join("model.safetensors"))?)
}
