//! Checkpoints of PyTorch, and conversion. (What is refused, and views of all kinds, are tested beside the reader in omnix-tensors.)

use std::ops::ControlFlow;
use std::path::Path;

use omnix_tensors::{Dtype, Float, TensorFile};
use omnix_tests::pytorch::{self, Tensor};
use omnix_weights::{Checkpoint, Conversion, WeightsError};

const CLS: &str = "backbone.pretrained.cls_token";

fn floats(name: &str, shape: &[usize], first: f32) -> Tensor {
    let count: usize = shape.iter().product();
    let bytes = (0..count).flat_map(|k| (first + k as f32).to_le_bytes()).collect();
    (name.to_owned(), Dtype::F32, shape.to_vec(), bytes)
}

fn some() -> Vec<Tensor> {
    let mut all = vec![
        floats(&format!("net.{CLS}"), &[1, 1, 4], 1.0),
        floats("net.a", &[3, 2], 10.0),
        floats("net.b", &[2, 2, 2], 0.5),
        floats("ema.a", &[3, 2], 99.0),
    ];
    all.push(("net.steps".to_owned(), Dtype::I64, vec![1], 7i64.to_le_bytes().to_vec()));
    all
}

fn go(_: u64, _: u64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Saved by PyTorch 2 itself, beside the same tensors in safetensors.
#[test]
fn a_file_of_pytorch_holds_what_its_safetensors_do() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/omx4d");
    let saved = TensorFile::open(&folder.join("predictions.pt")).unwrap();
    let same = TensorFile::open(&folder.join("predictions.safetensors")).unwrap();
    assert_eq!(saved.tensors().len(), 4);
    for ((name, info), (other, expected)) in saved.tensors().zip(same.tensors()) {
        assert_eq!((name, &info.dtype, &info.shape), (other, &expected.dtype, &expected.shape));
        assert_eq!(saved.tensor_bytes(name), same.tensor_bytes(name), "{name}");
    }
}

#[test]
fn a_checkpoint_opens_alone_in_its_folder_and_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("last.ckpt");
    std::fs::write(&file, pytorch::checkpoint(&some())).unwrap();
    let missing = Checkpoint::open(&file).unwrap_err();
    assert!(matches!(missing, WeightsError::ConfigMissing { .. }), "{missing}");
    std::fs::write(folder.path().join("config.json"), r#"{"format": "omnix-1"}"#).unwrap();
    for path in [folder.path(), &file] {
        let checkpoint = Checkpoint::open(path).unwrap();
        assert_eq!((checkpoint.key_prefix(), checkpoint.taken_for()), ("net.", None));
        assert_eq!(checkpoint.tensor(CLS).unwrap().to_f32(), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(checkpoint.metadata()["left out"], "epoch, optimizer_states");
        assert_eq!(checkpoint.digest().len(), 64);
    }
}

/// Names and shapes of a published network, as far as they tell which one it is.
#[test]
fn published_networks_are_known_without_a_configuration() {
    let network = |prefix: &str, width: usize, blocks: usize, more: &[&str]| {
        let mut all = vec![floats(&format!("{prefix}{CLS}"), &[1, 1, width], 0.0)];
        all.push(floats(&format!("{prefix}backbone.pretrained.blocks.{}.ls1.gamma", blocks - 1), &[1], 0.0));
        all.extend(more.iter().map(|name| floats(&format!("{prefix}{name}"), &[1], 0.0)));
        all
    };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("model.pt");
    let known = |tensors: &[Tensor]| {
        std::fs::write(&file, pytorch::checkpoint(tensors)).unwrap();
        Checkpoint::open(&file)
    };
    for (size, width, blocks) in [("small", 384, 12), ("base", 768, 12), ("large", 1024, 24), ("giant", 1536, 40)] {
        let found = known(&network("model.", width, blocks, &["cam_dec.fc_t.bias"])).unwrap();
        assert_eq!(found.taken_for(), Some(&*format!("da3-{size}")));
        assert_eq!(found.config_json()["model_name"], format!("da3-{size}"));
    }
    let release = known(&network("net.", 1536, 40, &["cam_dec.fc_t.bias", "st_mod.feature_proj.bias"])).unwrap();
    assert_eq!(release.config_json()["format"], "omnix-1");
    assert!(release.taken_for().is_some_and(|name| name.contains("OmniX")));
    // Another size, a network of another's own, and one of which there are two.
    for tensors in [
        network("model.", 64, 12, &["cam_dec.fc_t.bias"]),
        network("net.", 1024, 24, &["cam_dec.fc_t.bias", "st_mod.feature_proj.bias"]),
        network("model.", 1024, 24, &["head.scratch.sky_output_conv2.0.bias"]),
    ] {
        assert!(matches!(known(&tensors), Err(WeightsError::ConfigMissing { .. })));
    }
}

#[test]
fn conversions_hold_the_same_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let from = folder.path().join("from");
    std::fs::create_dir(&from).unwrap();
    std::fs::write(from.join("config.json"), r#"{"model_name": "x", "key_prefix": "net."}"#).unwrap();
    std::fs::write(from.join("last.ckpt"), pytorch::checkpoint(&some())).unwrap();
    let original = Checkpoint::open(&from).unwrap();
    let conversions = [
        (Conversion::default(), 1, "F32"),
        (Conversion { dtype: Some(Float::F16), shard: None }, 1, "F16"),
        (Conversion { dtype: Some(Float::BF16), shard: Some(20) }, 3, "BF16"),
        (Conversion { dtype: None, shard: Some(1) }, 4, "F32"),
    ];
    for (k, (conversion, files, dtype)) in conversions.into_iter().enumerate() {
        let out = folder.path().join(k.to_string());
        let done = conversion.write(&original, &out, &mut go).unwrap();
        assert_eq!((done.files.len(), done.left_out.as_slice()), (files, &["ema.a".to_owned()][..]));
        let planned = conversion.plan(&original);
        assert_eq!(planned.iter().map(|(_, bytes)| bytes).sum::<u64>(), done.bytes);
        assert!(planned.iter().zip(&done.files).all(|((name, _), file)| file.ends_with(name)));
        let written = Checkpoint::open(&out).unwrap();
        assert_eq!(written.config_json(), original.config_json());
        assert_eq!(written.tensors().count(), 4);
        for name in [CLS, "a", "b"] {
            assert_eq!(written.info(name).unwrap().dtype, dtype);
            assert_eq!(written.info(name).unwrap().shape, original.info(name).unwrap().shape);
            assert_eq!(written.tensor(name).unwrap().to_f32(), original.tensor(name).unwrap().to_f32(), "{name}");
        }
        assert_eq!(written.info("steps").unwrap().dtype, "I64");
        // Nothing is replaced.
        assert!(matches!(conversion.write(&original, &out, &mut go), Err(WeightsError::InTheWay { .. })));
    }
}

#[test]
fn a_conversion_that_cannot_be_done_leaves_no_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let from = folder.path().join("from");
    std::fs::create_dir(&from).unwrap();
    std::fs::write(from.join("config.json"), "{}").unwrap();
    let large = vec![floats(&format!("net.{CLS}"), &[2], 1.0), floats("net.large", &[3], 1e5)];
    std::fs::write(from.join("a.pt"), pytorch::checkpoint(&large)).unwrap();
    let original = Checkpoint::open(&from).unwrap();
    let out = folder.path().join("out");
    let half = Conversion { dtype: Some(Float::F16), shard: None };
    let message = half.write(&original, &out, &mut go).unwrap_err().to_string();
    assert!(message.contains("net.large") && message.contains("[0]") && message.contains("F32"), "{message}");
    let stopped = Conversion::default().write(&original, &out, &mut |_, _| ControlFlow::Break(()));
    assert!(matches!(stopped, Err(WeightsError::Interrupted)));
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 0);
}

/// A network's tensor that shares its bytes with one outside of it is written under the network's name.
#[test]
fn shared_bytes_stay_with_the_network() {
    let folder = tempfile::tempdir().unwrap();
    let from = folder.path().join("from");
    std::fs::create_dir(&from).unwrap();
    let metadata = [("net.b", "criterion.b"), ("net.c", "net.a")];
    let tensors = [
        crate::fixture::f32(&format!("net.{CLS}"), &[1], &[0.0]),
        crate::fixture::f32("net.a", &[1], &[1.0]),
        crate::fixture::f32("criterion.b", &[2], &[2.0, 3.0]),
        crate::fixture::f64("net.large", &[1], &[1e39]),
    ];
    crate::fixture::write(&from, "{}", &crate::fixture::file(&tensors, &metadata));
    let original = Checkpoint::open(&from).unwrap();
    let out = folder.path().join("out");
    Conversion::default().write(&original, &out, &mut go).unwrap();
    let written = Checkpoint::open(&out).unwrap();
    assert_eq!(written.tensor("b").unwrap().to_f32(), [2.0, 3.0]);
    assert_eq!(written.tensor("c").unwrap().to_f32(), [1.0]);
    // A number beyond f32 is no infinity.
    for dtype in [Float::F32, Float::F16] {
        let conversion = Conversion { dtype: Some(dtype), shard: None };
        let message = conversion.write(&original, &folder.path().join("narrow"), &mut go).unwrap_err().to_string();
        assert!(message.contains("net.large") && message.contains("F64"), "{message}");
    }
}
