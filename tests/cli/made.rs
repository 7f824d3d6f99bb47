//! Checkpoints of Depth Anything 3's smaller kinds, made here: small, of seeded random numbers, in the layout of the published files.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use omnix::model::{NetworkConfig, Parts, manifest};
use omnix_tensors::{Dtype, TensorSpec, TensorWriter};
use serde_json::{Value, json};

/// A monocular network of this name; one whose name says `metric` is metric.
pub(crate) fn single(name: &str) -> Value {
    json!({ "model_name": name, "config": single_tree() })
}

/// An any-view network with a Gaussian head, and a metric one beside it.
pub(crate) fn nested() -> Value {
    let net =
        json!({ "alt_start": 2, "qknorm_start": 2, "rope_start": 2, "cat_token": true, "out_layers": [2, 3, 4, 5] });
    let head = json!({ "__object__": { "name": "DualDPT" }, "dim_in": 64, "output_dim": 2, "features": 16, "out_channels": [8, 8, 16, 16] });
    let gaussians = json!({ "dim_in": 64, "output_dim": 38, "features": 16, "out_channels": [8, 8, 16, 16] });
    let any_view = json!({ "net": with_encoder(net, 6), "head": head, "cam_enc": { "dim_out": 32 }, "cam_dec": { "dim_in": 64 }, "gs_head": gaussians });
    json!({ "model_name": "made-nested", "config": { "anyview": any_view, "metric": single_tree() } })
}

fn single_tree() -> Value {
    let net = json!({ "alt_start": -1, "qknorm_start": -1, "rope_start": -1, "cat_token": false, "out_layers": [0, 1, 2, 3] });
    let head = json!({ "__object__": { "name": "DPT" }, "dim_in": 32, "output_dim": 1, "features": 16, "out_channels": [8, 8, 16, 16] });
    json!({ "net": with_encoder(net, 4), "head": head })
}

fn with_encoder(mut net: Value, depth: usize) -> Value {
    net["name"] = json!("custom");
    net["embed_dim"] = json!(32);
    net["depth"] = json!(depth);
    net["num_heads"] = json!(2);
    net["ffn_layer"] = json!("mlp");
    net
}

/// Writes the checkpoint of a configuration; its numbers depend on the seed.
pub(crate) fn write(folder: &Path, config: &Value, seed: u64) {
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join("config.json"), config.to_string()).unwrap();
    let network = NetworkConfig::from_json(config).unwrap();
    let all = manifest(&network, &Parts { rays: true, given_cameras: true, gaussians: true, ..Parts::default() });
    let nested = network.metric.is_some();
    let stored = |name: &str| match (nested, name.starts_with("da3_metric.")) {
        (true, false) => format!("model.da3.{name}"),
        _ => format!("model.{name}"),
    };
    let mut tensors: Vec<_> = all.expected().iter().map(|e| (stored(&e.name), e.shape.clone())).collect();
    tensors.sort();
    let specs: Vec<_> = tensors.iter().map(|(name, shape)| TensorSpec::new(name, Dtype::F32, shape.clone())).collect();
    let mut writer = TensorWriter::create(&folder.join("model.safetensors"), &specs, &BTreeMap::new()).unwrap();
    let mut state = seed;
    for (name, shape) in &tensors {
        let count: usize = shape.iter().product();
        let inner = (count / shape[0]).max(1) as f32;
        let numbers: Vec<f32> = (0..count).map(|_| number(&mut state) * 1.5 / inner.sqrt()).collect();
        // Norms and scales are near 1.
        let norm = name.ends_with("gamma") || shape.len() == 1 && name.contains("norm") && name.ends_with("weight");
        let numbers: Vec<f32> = numbers.iter().map(|n| if norm { 1.0 + 0.1 * n } else { *n }).collect();
        writer.write_f32(name, &numbers).unwrap();
    }
    writer.finish().unwrap();
}

/// Uniform in -1..1 (Knuth's MMIX generator).
fn number(state: &mut u64) -> f32 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
}
