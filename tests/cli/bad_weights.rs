//! Damaged and foreign checkpoints: named before anything runs.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use safetensors::SafeTensors;
use safetensors::tensor::TensorView;

use crate::common::{Ran, folder, of_kind, omnix, reconstruct, root};

/// The embedded checkpoint as files.
fn nano() -> (String, Vec<u8>) {
    let folder = root().join("assets/weights/nano");
    (fs::read_to_string(folder.join("config.json")).unwrap(), fs::read(folder.join("model.safetensors")).unwrap())
}

fn write(dir: &Path, config: &str, model: &[u8]) -> PathBuf {
    let folder = dir.join("weights");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("config.json"), config).unwrap();
    fs::write(folder.join("model.safetensors"), model).unwrap();
    folder
}

/// The checkpoint's tensors, changed: `change` gets name, shape and bytes and may drop a tensor.
fn changed(model: &[u8], change: impl Fn(&str, &mut Vec<usize>, &mut Vec<u8>) -> bool) -> Vec<u8> {
    let file = SafeTensors::deserialize(model).unwrap();
    let mut kept = Vec::new();
    for (name, view) in file.tensors() {
        let (mut shape, mut data) = (view.shape().to_vec(), view.data().to_vec());
        if change(&name, &mut shape, &mut data) {
            kept.push((name, view.dtype(), shape, data));
        }
    }
    let views = kept.iter().map(|(n, t, s, d)| (n.as_str(), TensorView::new(*t, s.clone(), d).unwrap()));
    safetensors::serialize(views, None::<HashMap<String, String>>).unwrap()
}

/// `reconstruct` and `weights check` both fail with exit code 3; the latter is returned.
#[track_caller]
fn both_refuse(dir: &Path, weights: &Path, words: &[&str]) -> Ran {
    let frames = folder(dir, 1);
    let out = dir.join("out");
    reconstruct(&frames, &out, &["--weights", weights.to_str().unwrap()]).fails(3, words);
    assert!(
        !out.join("manifest.json").exists() || crate::common::json(&out.join("manifest.json"))["interrupted"] == true
    );
    omnix(&["weights", "check", weights.to_str().unwrap()]).fails(3, &[])
}

const SOME: &str = "net.backbone.pretrained.blocks.1.attn.qkv.weight";

#[test]
fn truncated() {
    let dir = tempfile::tempdir().unwrap();
    let (config, model) = nano();
    let weights = write(dir.path(), &config, &model[..model.len() - 1000]);
    both_refuse(dir.path(), &weights, &["truncated", "model.safetensors"]);
}

#[test]
fn wrong_shapes() {
    let dir = tempfile::tempdir().unwrap();
    let (config, model) = nano();
    let model = changed(&model, |name, shape, _| {
        if name == SOME {
            shape.reverse();
        }
        true
    });
    let weights = write(dir.path(), &config, &model);
    let checked = both_refuse(dir.path(), &weights, &["blocks.1.attn.qkv.weight", "[192, 576] instead of [576, 192]"]);
    assert!(checked.out.contains("blocks.1.attn.qkv.weight"), "{}", checked.out);
}

#[test]
fn missing_and_surplus() {
    let dir = tempfile::tempdir().unwrap();
    let (config, model) = nano();
    let model = changed(&model, |name, _, _| name != SOME);
    let weights = write(dir.path(), &config, &model);
    both_refuse(dir.path(), &weights, &["1 missing", "blocks.1.attn.qkv.weight"]);
    let info = omnix(&["weights", "info", weights.to_str().unwrap(), "--json"]).ok();
    assert_eq!(of_kind(&info.events(), "weights")[0]["usable"], false);
}

#[test]
fn not_a_number() {
    let dir = tempfile::tempdir().unwrap();
    let (config, model) = nano();
    let model = changed(&model, |name, _, data| {
        if name == SOME {
            data[10..12].copy_from_slice(&half::f16::NAN.to_le_bytes());
        }
        true
    });
    let weights = write(dir.path(), &config, &model);
    let checked = both_refuse(dir.path(), &weights, &["NaN", "element 5", "blocks.1.attn.qkv.weight"]);
    assert!(checked.out.contains("blocks.1.attn.qkv.weight: NaN at element 5"), "{}", checked.out);
}

#[test]
fn beyond_f16() {
    let dir = tempfile::tempdir().unwrap();
    let (config, model) = nano();
    let file = SafeTensors::deserialize(&model).unwrap();
    // The same network in F32, one weight of which f16 cannot hold.
    let wide: Vec<_> = file
        .tensors()
        .into_iter()
        .map(|(name, view)| {
            let halves = view.data().as_chunks().0.iter().map(|b| half::f16::from_le_bytes(*b).to_f32());
            let mut numbers: Vec<f32> = halves.collect();
            if name == SOME {
                numbers[192 * 3 + 5] = 70000.0;
            }
            let bytes: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
            (name, view.shape().to_vec(), bytes)
        })
        .collect();
    let views =
        wide.iter().map(|(n, s, d)| (n.as_str(), TensorView::new(safetensors::Dtype::F32, s.clone(), d).unwrap()));
    let model = safetensors::serialize(views, None::<HashMap<String, String>>).unwrap();
    let weights = write(dir.path(), &config, &model);
    let weights = weights.to_str().unwrap();
    // It is no damage: the network runs with f32 weights.
    let checked = omnix(&["weights", "check", weights]).ok();
    assert!(checked.out.contains(&format!("{SOME}: 70000 at element 581; store it as f32")), "{}", checked.out);
    let (frames, out) = (folder(dir.path(), 1), dir.path().join("out"));
    let run = |storage| reconstruct(&frames, &out, &["--weights", weights, "--weights-type", storage]);
    run("f16").fails(3, &["blocks.1.attn.qkv.weight[3, 5]` = 70000 does not fit in f16"]);
    run("f32").ok();
}

#[test]
fn of_another_model() {
    let dir = tempfile::tempdir().unwrap();
    let (config, _) = nano();
    let data = vec![0u8; 64];
    let view = TensorView::new(safetensors::Dtype::F32, vec![4, 4], &data).unwrap();
    let model = safetensors::serialize([("encoder.layer.0.weight", view)], None::<HashMap<String, String>>).unwrap();
    let weights = write(dir.path(), &config, &model);
    both_refuse(dir.path(), &weights, &["missing", "encoder.layer.0.weight"]);
}

#[test]
fn no_checkpoint_at_all() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 1);
    let run = |weights: &str| reconstruct(&frames, &dir.path().join("out"), &["--weights", weights]);
    run("giganto").fails(3, &["no checkpoint", "giganto"]);
    let weights = write(dir.path(), "{\"format\": \"omnix-1\"", b"");
    fs::write(weights.join("model.safetensors"), nano().1).unwrap();
    run(weights.to_str().unwrap()).fails(3, &["config.json"]);
}
