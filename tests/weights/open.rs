//! Finding and opening checkpoints: folders, files, shards, embedded bytes, and what users get wrong.

use std::path::Path;

use omnix_tensors::TensorError;
use omnix_weights::{Checkpoint, WeightsError, describe};

use crate::fixture;

const CLS: &str = "backbone.pretrained.cls_token";

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn one(prefix: &str) -> Vec<u8> {
    fixture::file(&[fixture::f32(&format!("{prefix}{CLS}"), &[1, 1, 2], &[1.0, 2.0])], &[("format", "pt")])
}

#[test]
fn a_folder_and_its_file_open_alike() {
    let folder = folder();
    fixture::write(folder.path(), r#"{"model_name": "da3-test", "config": {"a": 1}}"#, &one("model."));
    for path in [folder.path().to_owned(), folder.path().join("model.safetensors")] {
        let checkpoint = Checkpoint::open(&path).unwrap();
        assert_eq!((checkpoint.name(), checkpoint.key_prefix()), ("da3-test", "model."));
        assert_eq!(checkpoint.config_json()["config"]["a"], 1);
        assert_eq!(checkpoint.metadata()["format"], "pt");
        assert_eq!(checkpoint.tensor(CLS).unwrap().to_f32(), [1.0, 2.0]);
        assert_eq!(checkpoint.info(CLS).unwrap().shape, [1, 1, 2]);
    }
}

#[test]
fn bytes_in_memory_open_alike() {
    let bytes: &'static [u8] = one("net.").leak();
    let checkpoint = Checkpoint::from_bytes("nano", "{}", bytes.into()).unwrap();
    assert_eq!((checkpoint.name(), checkpoint.key_prefix()), ("nano", "net."));
    assert_eq!(checkpoint.tensor(CLS).unwrap().to_f32(), [1.0, 2.0]);
}

#[test]
fn the_digest_is_blake3_of_the_file() {
    let empty = Checkpoint::from_bytes("empty", "{}", fixture::raw("{}", &[]).into()).unwrap();
    // By the blake3 package of Python.
    assert_eq!(empty.digest(), "b8b38d1cb0675f6b3512a37c75287375d8a17f9992e59155c409a35837560cf9");
    assert_eq!(describe(&empty), "empty");
}

#[test]
fn the_name_falls_back_to_the_folder() {
    let folder = folder();
    let inner = folder.path().join("my-weights");
    std::fs::create_dir(&inner).unwrap();
    fixture::write(&inner, "{}", &one(""));
    std::fs::write(inner.join("other.safetensors"), one("")).unwrap();
    let name = |path: &Path| Checkpoint::open(path).unwrap().name().to_owned();
    assert_eq!(name(&inner), "my-weights");
    assert_eq!(name(&inner.join("model.safetensors")), "my-weights");
    assert_eq!(name(&inner.join("other.safetensors")), "other");
}

#[test]
fn prefixes_are_detected_or_configured() {
    for prefix in ["", "model.", "net.", "model.da3."] {
        assert_eq!(Checkpoint::from_bytes("x", "{}", one(prefix).into()).unwrap().key_prefix(), prefix);
    }
    let configured = Checkpoint::from_bytes("x", r#"{"key_prefix": "my."}"#, one("my.").into()).unwrap();
    assert_eq!(configured.key_prefix(), "my.");
    // The file is right where the configuration is wrong.
    let wrong = Checkpoint::from_bytes("x", r#"{"key_prefix": "net."}"#, one("model.").into()).unwrap();
    assert_eq!(wrong.key_prefix(), "model.");
    // What training programs wrap around a network, known or not.
    for wrapper in ["module.", "module.net.", "_orig_mod.model.", "strange."] {
        let config = r#"{"key_prefix": "net."}"#;
        let wrapped = Checkpoint::from_bytes("x", config, one(wrapper).into()).unwrap();
        assert_eq!((wrapped.key_prefix(), wrapped.tensor(CLS).is_ok()), (wrapper, true));
    }
    let none = Checkpoint::from_bytes("x", "{}", fixture::raw("{}", &[]).into()).unwrap();
    assert!(matches!(none.tensor(CLS), Err(WeightsError::TensorMissing { .. })));
}

#[test]
fn shards_are_one_checkpoint() {
    let folder = folder();
    let index = folder.path().join("model.safetensors.index.json");
    let write = |map: &str| std::fs::write(&index, format!(r#"{{"metadata": {{}}, "weight_map": {map}}}"#)).unwrap();
    std::fs::write(folder.path().join("config.json"), "{}").unwrap();
    std::fs::write(folder.path().join("a.safetensors"), one("model.")).unwrap();
    let second = fixture::file(&[fixture::f16("model.b", &[1], &[0.5])], &[]);
    std::fs::write(folder.path().join("b.safetensors"), second).unwrap();

    write(r#"{"model.backbone.pretrained.cls_token": "a.safetensors", "model.b": "b.safetensors"}"#);
    for path in [folder.path(), &index] {
        let checkpoint = Checkpoint::open(path).unwrap();
        assert_eq!(checkpoint.files().len(), 2);
        assert_eq!(checkpoint.tensor(CLS).unwrap().to_f32(), [1.0, 2.0]);
        assert_eq!(checkpoint.tensor("b").unwrap().to_f32(), [0.5]);
        assert_eq!(checkpoint.tensors().count(), 2);
    }

    let error = || Checkpoint::open(folder.path()).unwrap_err();
    write(r#"{"model.b": "c.safetensors"}"#);
    assert!(matches!(error(), WeightsError::ShardMissing { shard, .. } if shard == "c.safetensors"));
    write(r#"{"model.b": "a.safetensors"}"#);
    assert!(matches!(error(), WeightsError::BadIndex { .. }));
    for map in ["[]", "{}", r#"{"model.b": 3}"#, r#"{"model.b": "../b.safetensors"}"#, r#"{"model.b": "/etc/passwd"}"#]
    {
        write(map);
        assert!(matches!(error(), WeightsError::BadIndex { .. }), "{map}");
    }
}

#[test]
fn missing_things_are_named() {
    let folder = folder();
    let open = |path: &Path| Checkpoint::open(path).unwrap_err();
    assert!(matches!(open(&folder.path().join("nothing")), WeightsError::NotFound { .. }));
    let error = open(folder.path());
    assert!(matches!(&error, WeightsError::NoWeights { found, .. } if found.is_empty()), "{error}");

    // A checkpoint of PyTorch is taken where it is the only file of tensors.
    std::fs::write(folder.path().join("last.ckpt"), b"PK\x03\x04").unwrap();
    let error = open(folder.path());
    assert!(
        matches!(&error, WeightsError::Tensors(TensorError::PyTorch { path, .. }) if path.ends_with("last.ckpt")),
        "{error}"
    );
    assert!(matches!(open(&folder.path().join("last.ckpt")), WeightsError::Tensors(TensorError::PyTorch { .. })));
    std::fs::write(folder.path().join("first.pt"), b"PK\x03\x04").unwrap();
    let message = open(folder.path()).to_string();
    assert!(message.contains("first.pt, last.ckpt"), "{message}");

    std::fs::write(folder.path().join("case.safetensors"), one("")).unwrap();
    let message = open(folder.path()).to_string();
    assert!(message.contains("case.safetensors"), "{message}");

    let weights = folder.path().join("model.safetensors");
    std::fs::write(&weights, one("")).unwrap();
    let error = open(&weights);
    assert!(matches!(&error, WeightsError::ConfigMissing { path } if path.ends_with("config.json")), "{error}");
    let long = format!("{{\"a\": [{}0]}}", "0,".repeat(1 << 20));
    for config in [&b"{"[..], b"[]", b"", b"\xff\xfe{}", br#"{"a": {"b": 1, "b": 2}}"#, long.as_bytes()] {
        std::fs::write(folder.path().join("config.json"), config).unwrap();
        assert!(matches!(open(folder.path()), WeightsError::ConfigInvalid { .. }), "{config:?}");
    }
    // With the byte-order mark that some editors put in front.
    std::fs::write(folder.path().join("config.json"), "\u{feff}{\"model_name\": \"marked\"}").unwrap();
    assert_eq!(Checkpoint::open(folder.path()).unwrap().name(), "marked");
    std::fs::write(&weights, b"").unwrap();
    assert!(matches!(open(folder.path()), WeightsError::Tensors(TensorError::NotSafetensors { .. })));
}

#[test]
fn a_dropped_shared_tensor_is_found_under_its_kept_name() {
    let kept = "model.head.scratch.output_conv2_aux.0.2.weight";
    let dropped = "head.scratch.output_conv2_aux.3.2.weight";
    let cls = fixture::f32(&format!("model.{CLS}"), &[1, 1, 1], &[0.0]);
    let level0 = fixture::f32(kept, &[2], &[3.0, 4.0]);
    let metadata = [("model.head.scratch.output_conv2_aux.3.2.weight", kept)];
    for metadata in [&metadata[..], &[]] {
        let bytes = fixture::file(&[cls.clone(), level0.clone()], metadata);
        let checkpoint = Checkpoint::from_bytes("x", "{}", bytes.into()).unwrap();
        assert_eq!(checkpoint.tensor(dropped).unwrap().to_f32(), [3.0, 4.0]);
        assert_eq!(checkpoint.resolve(dropped).as_deref(), Some(kept));
    }
    // A file that stores all four is taken at its word.
    let level3 = fixture::f32(&format!("model.{dropped}"), &[2], &[5.0, 6.0]);
    let bytes = fixture::file(&[cls, level0, level3], &metadata);
    let checkpoint = Checkpoint::from_bytes("x", "{}", bytes.into()).unwrap();
    assert_eq!(checkpoint.tensor(dropped).unwrap().to_f32(), [5.0, 6.0]);
}

#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn published_layouts_open() {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let cases = [
        ("golden/da3/tiny-a", "model.", "Depth Anything 3, any-view, width 64, 10 blocks"),
        ("golden/da3/tiny-b", "model.", "Depth Anything 3, any-view, width 128, 8 blocks, with a Gaussian head"),
        ("golden/da3/tiny-mono", "model.", "Depth Anything 3, monocular or metric, width 64, 8 blocks"),
        ("golden/omnix/mixed", "net.", "OmniX"),
        ("weights/nano", "net.", "OmniX, any-view, width 192, 8 blocks"),
    ];
    for (path, prefix, seems) in cases {
        let path = shared.join(path);
        let checkpoint = Checkpoint::open(&path).unwrap();
        assert_eq!(checkpoint.key_prefix(), prefix);
        assert!(describe(&checkpoint).starts_with(seems), "{}", describe(&checkpoint));
        for (name, _) in checkpoint.tensors() {
            let view = checkpoint.tensor(name.strip_prefix(prefix).unwrap()).unwrap();
            assert_eq!(view.examine().non_finite, None, "{name}");
        }
    }
}

#[cfg(unix)]
#[test]
fn pipes_are_refused_and_do_not_block() {
    for name in ["config.json", "model.safetensors", "other.safetensors", "model.safetensors.index.json"] {
        let folder = folder();
        fixture::write(folder.path(), "{}", &one(""));
        if name.contains("index") {
            std::fs::remove_file(folder.path().join("model.safetensors")).unwrap();
        }
        let pipe = folder.path().join(name);
        let _ = std::fs::remove_file(&pipe);
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let opened = if name.starts_with("other") { pipe } else { folder.path().to_owned() };
        let error = Checkpoint::open(&opened).unwrap_err();
        let pipe = matches!(&error, WeightsError::Tensors(TensorError::NotPlain { .. }));
        assert!(pipe || matches!(error, WeightsError::NoWeights { .. }), "{name}: {error}");
    }
}

#[test]
fn an_index_names_a_tensor_once() {
    let folder = folder();
    std::fs::write(folder.path().join("config.json"), "{}").unwrap();
    std::fs::write(folder.path().join("a.safetensors"), one("model.")).unwrap();
    let full = format!("model.{CLS}");
    let map = format!(r#"{{"weight_map": {{"{full}": "a.safetensors", "{full}": "b.safetensors"}}}}"#);
    std::fs::write(folder.path().join("model.safetensors.index.json"), map).unwrap();
    let error = Checkpoint::open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("there twice"), "{error}");
}
