//! Damaged files: whatever the bytes, an error and never a panic.

use omnix_tensors::{TensorError, TensorReader};
use omnix_weights::{Checkpoint, TensorFile, WeightsError, check, describe};
use proptest::prelude::*;

use crate::fixture;

fn sound() -> Vec<u8> {
    let tensors = [
        fixture::f32("model.backbone.pretrained.cls_token", &[1, 1, 4], &[1.0, 2.0, 3.0, 4.0]),
        fixture::f16("model.backbone.pretrained.blocks.0.norm1.weight", &[4], &[1.0; 4]),
        fixture::bf16("model.head.scratch.output_conv2_aux.0.2.bias", &[2], &[1.0; 2]),
        fixture::i64("steps", &[1]),
    ];
    fixture::file(&tensors, &[("format", "pt")])
}

/// The other way to read: what it says is what the mapped file says.
fn from_disk(bytes: &[u8]) -> Result<(), TensorError> {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    std::io::Write::write_all(&mut file, bytes).unwrap();
    let reader = TensorReader::open(file.path())?;
    for (name, info) in reader.tensors() {
        if info.known().is_some_and(|dtype| dtype.float().is_some()) {
            assert_eq!(reader.read_f32(name, 0..info.elements()).unwrap().len(), info.elements());
        }
    }
    Ok(())
}

/// Uses everything that reads a checkpoint.
fn exercise(bytes: Vec<u8>) -> Result<(), WeightsError> {
    let read = from_disk(&bytes);
    let checkpoint = Checkpoint::from_bytes("fuzz", "{}", bytes.into());
    assert_eq!(read.is_ok(), checkpoint.is_ok(), "{read:?} {:?}", checkpoint.as_ref().err());
    let checkpoint = checkpoint?;
    let mut manifest = omnix_weights::Manifest::new();
    for (name, info) in checkpoint.tensors() {
        manifest.require(name, &info.shape);
        let _ = info.elements();
    }
    let _ = describe(&checkpoint);
    let _ = check(&checkpoint, &manifest).to_string();
    for file in checkpoint.files() {
        for (name, _) in file.tensors() {
            if let Ok(view) = file.tensor(name) {
                let _ = (view.to_f32(), view.examine());
            }
        }
    }
    let _ = checkpoint.digest();
    Ok(())
}

#[test]
fn the_sound_file_is_read() {
    exercise(sound()).unwrap();
}

#[test]
fn every_truncation_is_an_error() {
    let bytes = sound();
    for length in 0..bytes.len() {
        assert!(exercise(bytes[..length].to_vec()).is_err(), "{length} of {} bytes", bytes.len());
    }
}

#[test]
fn a_truncated_file_says_how_much_is_missing() {
    let bytes = sound();
    let cut = bytes[..bytes.len() - 9].to_vec();
    let error = TensorFile::from_bytes(cut.into(), "cut.safetensors").unwrap_err();
    let TensorError::WrongLength { expected, found, .. } = &error else { panic!("{error}") };
    assert_eq!((*expected, *found), (bytes.len() as u64, bytes.len() as u64 - 9));
    let message = error.to_string();
    assert!(message.contains("truncated") && message.ends_with("cut.safetensors"), "{message}");
}

#[test]
fn a_longer_file_is_an_error() {
    let mut bytes = sound();
    bytes.push(0);
    let message = TensorFile::from_bytes(bytes.into(), "long").unwrap_err().to_string();
    assert!(message.contains("longer"), "{message}");
}

#[test]
fn hostile_headers_are_errors() {
    let max = u64::MAX;
    let headers = [
        format!(r#"{{"a":{{"dtype":"F32","shape":[{max}],"data_offsets":[0,4]}}}}"#),
        format!(r#"{{"a":{{"dtype":"F32","shape":[{max},{max}],"data_offsets":[0,4]}}}}"#),
        format!(r#"{{"a":{{"dtype":"Q4","shape":[1],"data_offsets":[0,{max}]}}}}"#),
        r#"{"a":{"dtype":"F32","shape":[1],"data_offsets":[4,0]}}"#.to_owned(),
        r#"{"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4,8]}}"#.to_owned(),
        r#"{"a":{"dtype":"F32","shape":[-1],"data_offsets":[0,4]}}"#.to_owned(),
        r#"{"a":{"dtype":"F32","shape":[2],"data_offsets":[0,4]}}"#.to_owned(),
        r#"{"a":{"dtype":7,"shape":[1],"data_offsets":[0,4]}}"#.to_owned(),
        r#"{"a":7}"#.to_owned(),
        r#"{"__metadata__":[]}"#.to_owned(),
        r#"{"a":{"dtype":"I8","shape":[2],"data_offsets":[0,2]},"b":{"dtype":"I8","shape":[3],"data_offsets":[1,4]}}"#
            .to_owned(),
        r#"{"a":{"dtype":"I8","shape":[1],"data_offsets":[0,1]},"b":{"dtype":"I8","shape":[2],"data_offsets":[2,4]}}"#
            .to_owned(),
        "{".repeat(100_000),
        // A name twice, with other types; a space in front; a size that is no size; metadata that is no text.
        r#"{"a":{"dtype":"F16","shape":[2],"data_offsets":[0,4]},"a":{"dtype":"BF16","shape":[2],"data_offsets":[0,4]}}"#
            .to_owned(),
        r#" {"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}}"#.to_owned(),
        r#"{"a":{"dtype":"F32","shape":[1.0],"data_offsets":[0,4]}}"#.to_owned(),
        r#"{"__metadata__":{"a":1},"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}}"#.to_owned(),
    ];
    for header in headers {
        assert!(exercise(fixture::raw(&header, &[0; 4])).is_err(), "{header:.80}");
    }
    // A length that is no length.
    assert!(exercise([&max.to_le_bytes()[..], b"{}"].concat()).is_err());
}

#[test]
fn other_files_are_named() {
    let zip = b"PK\x03\x04\x00\x00\x08\x08\x00\x00 archive/data.pkl".to_vec();
    let pickle = b"\x80\x02\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19.".to_vec();
    for (bytes, cure) in [(zip, "cut short"), (pickle, "load and save it again")] {
        let error = TensorFile::from_bytes(bytes.into(), "model.ckpt").unwrap_err();
        assert!(matches!(error, TensorError::PyTorch { .. }), "{error}");
        assert!(error.to_string().contains(cure), "{error}");
    }
    let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:0".to_vec();
    let message = TensorFile::from_bytes(pointer.into(), "m").unwrap_err().to_string();
    assert!(message.contains("git lfs pull"), "{message}");
    for bytes in [b"".to_vec(), b"<!DOCTYPE html>".to_vec(), b"a long text that is no header".to_vec()] {
        let error = TensorFile::from_bytes(bytes.into(), "m").unwrap_err();
        assert!(matches!(error, TensorError::NotSafetensors { .. }), "{error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn corruption_never_panics(edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let mut bytes = sound();
        for (place, value) in edits {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        let _ = exercise(bytes);
    }

    #[test]
    fn any_header_never_panics(header in r#"\{("[ab]":\{"dtype":"(F32|F16|X|BOOL)","shape":\[[0-9]{0,3},?[0-9]{1,20}\],"data_offsets":\[[0-9]{1,20},[0-9]{1,20}\]\},?){0,3}\}"#) {
        let _ = exercise(fixture::raw(&header, &[0; 16]));
    }

    #[test]
    fn any_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..64)) {
        let _ = exercise(bytes);
    }
}
