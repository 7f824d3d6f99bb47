//! Checkpoints as people have them: PyTorch's own files, and conversion.

use std::fs;

use omnix_tensors::{Dtype, TensorFile};

use crate::common::{folder, of_kind, omnix, reconstruct, root};
use crate::pytorch::{self, Tensor};

/// The embedded checkpoint's tensors.
fn nano() -> Vec<Tensor> {
    let file = TensorFile::open(&root().join("assets/weights/nano/model.safetensors")).unwrap();
    let all = file.tensors().map(|(name, info)| {
        let dtype = Dtype::parse(&info.dtype).unwrap();
        (name.to_owned(), dtype, info.shape.clone(), file.tensor_bytes(name).unwrap().to_vec())
    });
    all.collect()
}

#[test]
fn a_checkpoint_of_pytorch_runs_and_converts() {
    let dir = tempfile::tempdir().unwrap();
    let weights = dir.path().join("weights");
    fs::create_dir(&weights).unwrap();
    fs::copy(root().join("assets/weights/nano/config.json"), weights.join("config.json")).unwrap();
    let checkpoint = weights.join("last.ckpt");
    fs::write(&checkpoint, pytorch::checkpoint(&nano())).unwrap();
    let checkpoint = checkpoint.to_str().unwrap();

    let info = omnix(&["weights", "info", checkpoint]).ok().out;
    assert!(info.contains("left out = epoch, optimizer_states"), "{info}");
    let converted = dir.path().join("converted");
    let events = omnix(&["weights", "convert", checkpoint, converted.to_str().unwrap(), "--json"]).ok().events();
    assert_eq!(of_kind(&events, "converted")[0]["files"].as_array().unwrap().len(), 1);
    omnix(&["weights", "check", converted.to_str().unwrap()]).ok();
    // A folder with a checkpoint is not written to.
    omnix(&["weights", "convert", checkpoint, converted.to_str().unwrap()])
        .fails(6, &["is there already", "config.json"]);

    // The same numbers, so the same depth.
    let frames = folder(dir.path(), 1);
    let depth = |name: &str, weights: &str| {
        let out = dir.path().join(name);
        reconstruct(&frames, &out, &["--weights", weights, "--size", "84x56", "--export", "npz"]).ok();
        fs::read(out.join("exports/npz/results.npz")).unwrap()
    };
    let embedded = depth("a", "nano");
    assert!(embedded == depth("b", checkpoint) && embedded == depth("c", converted.to_str().unwrap()));
}

#[test]
fn an_attack_is_named_and_not_run() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("model.pt");
    let mut bytes = pytorch::checkpoint(&nano()[..1]);
    // The first class of the pickle becomes a call of the system, of the same length.
    let (from, to) = (&b"ctorch._utils\n_rebuild_tensor_v2\n"[..], &b"cos\nsystem\n"[..]);
    let at = bytes.windows(from.len()).position(|w| w == from).unwrap();
    bytes[at..at + to.len()].copy_from_slice(to);
    fs::write(&path, bytes).unwrap();
    let path = path.to_str().unwrap();
    for command in ["info", "check"] {
        omnix(&["weights", command, path]).fails(3, &["os.system", "Nothing was run", "model.pt"]);
    }
}

#[test]
fn repositories_are_found_in_the_cache_of_the_hub() {
    let cache = tempfile::tempdir().unwrap();
    let folder = cache.path().join("models--somebody--nano-copy");
    let snapshot = folder.join("snapshots/0123abcd");
    fs::create_dir_all(&snapshot).unwrap();
    fs::create_dir_all(folder.join("refs")).unwrap();
    fs::write(folder.join("refs/main"), "0123abcd").unwrap();
    for name in ["config.json", "model.safetensors"] {
        fs::copy(root().join("assets/weights/nano").join(name), snapshot.join(name)).unwrap();
    }
    let info = |name: &str| {
        let mut command = crate::common::program();
        crate::common::finish(command.args(["weights", "info", name]).env("HF_HUB_CACHE", cache.path()))
    };
    assert!(info("somebody/nano-copy").ok().out.contains("6.71 M"));
    // One that is published and was not downloaded: where it would be, and that it is to be downloaded.
    info("DA3-SMALL").fails(3, &["models--depth-anything--DA3-SMALL", "download"]);
    info("no such thing").fails(3, &["no checkpoint there"]);
}
