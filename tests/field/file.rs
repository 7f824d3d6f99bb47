//! Saved fields: written in pieces, read in pieces, by ours and by the safetensors crate; and what is refused.

use std::{collections::BTreeMap, fs, path::Path};

use omnix_io::{
    IoError,
    output::field::{Dtype, FieldReader, FieldWriter, TensorSpec},
};
use safetensors::SafeTensors;

fn specs() -> Vec<TensorSpec> {
    vec![
        TensorSpec::new("weights", Dtype::F16, [2, 3]),
        TensorSpec::new("tokens", Dtype::U32, [2, 2]),
        TensorSpec::new("nothing", Dtype::F32, [0, 4]),
        TensorSpec::new("points", Dtype::F32, [2, 2, 3]),
    ]
}

fn write(path: &Path) {
    let metadata = BTreeMap::from([("images".to_owned(), "2".to_owned())]);
    let mut writer = FieldWriter::create(path, &specs(), &metadata).unwrap();
    writer.write("weights", &[0.5, 0.1]).unwrap();
    writer.write("weights", &[0.25, 65519.0, -2.0, 3.0]).unwrap();
    writer.write_u32("tokens", &[1, 2, 3, u32::MAX]).unwrap();
    assert!(!path.exists(), "the file has its name before it is whole");
    for image in 0..2 {
        writer.write("points", &[0, 1, 2, 3, 4, 5].map(|v| (10 * image + v) as f32)).unwrap();
    }
    assert_eq!(writer.finish().unwrap(), path);
}

#[test]
fn pieces_go_in_and_come_out() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("field.safetensors");
    write(&path);
    let reader = FieldReader::open(&path).unwrap();
    assert_eq!(reader.specs(), specs());
    assert_eq!((reader.metadata("images"), reader.metadata("version")), (Some("2"), Some("2")));
    assert_eq!(reader.read("points", 6..9).unwrap(), [10.0, 11.0, 12.0]);
    assert_eq!(reader.read("weights", 0..3).unwrap(), [0.5, 0.099_975_586, 0.25]);
    assert_eq!(reader.read("weights", 3..4).unwrap(), [65504.0], "the largest f16");
    assert_eq!(reader.read_u32("tokens", 1..4).unwrap(), [2, 3, u32::MAX]);
    assert_eq!(reader.read("nothing", 0..0).unwrap(), [0.0f32; 0]);
    reader.expect_shape("points", &[2, 2, 3]).unwrap();

    let bytes = fs::read(&path).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let points = tensors.tensor("points").unwrap();
    assert_eq!((points.shape(), points.data().len()), (&[2, 2, 3][..], 48));
    assert_eq!(tensors.tensor("tokens").unwrap().data()[12..], [255; 4]);
}

fn message(path: &Path) -> String {
    FieldReader::open(path).unwrap_err().to_string()
}

#[test]
fn other_files_are_named_for_what_they_are() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("field.safetensors");
    write(&path);
    let whole = fs::read(&path).unwrap();
    for cut in [0, 5, 100, whole.len() - 1] {
        fs::write(&path, &whole[..cut]).unwrap();
        assert!(matches!(FieldReader::open(&path), Err(IoError::FieldCutShort { .. })), "{cut}: {}", message(&path));
        assert!(message(&path).contains("cut short"), "{}", message(&path));
    }
    fs::write(&path, [whole.as_slice(), b"x"].concat()).unwrap();
    assert!(message(&path).contains("1 bytes follow"), "{}", message(&path));
    let text = String::from_utf8_lossy(&whole[8..]).into_owned();
    let other = |from: &str, to: &str| {
        assert!(text.contains(from) && from.len() == to.len());
        let at = whole.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        let mut bytes = whole.clone();
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        fs::write(&path, bytes).unwrap();
        message(&path)
    };
    let version = other("\"version\":\"2\"", "\"version\":\"7\"");
    assert!(version.contains("version 7") && version.contains("reads version 1"), "{version}");
    assert!(other("omnix-field", "omnix-photo").contains("not a saved field"));
    assert!(other("[2,2,3]", "[2,2,9]").contains("\"points\""));
    assert!(other("\"F16\"", "\"I16\"").contains("neither F32 nor F16 nor U32"));
    // The format wants the header's first byte to be a brace, and each name once.
    assert!(other("{\"__metadata__\"", " {\"_metadata__\"").contains("not a saved field"));
    assert!(other("\"points\"", "\"tokens\"").contains("twice"));
    fs::write(&path, "just some text that is long enough").unwrap();
    assert!(message(&path).contains("not a saved field"), "{}", message(&path));
    assert!(matches!(FieldReader::open(&dir.path().join("none")), Err(IoError::NotFound { .. })));
}

#[test]
fn the_writer_keeps_to_its_header() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("field.safetensors");
    let mut writer = FieldWriter::create(&path, &specs(), &BTreeMap::new()).unwrap();
    let turn = writer.write("points", &[1.0]).unwrap_err().to_string();
    assert!(turn.contains("turn of \"weights\""), "{turn}");
    assert!(writer.write("weights", &[0.0; 7]).unwrap_err().to_string().contains("more than 6"));
    writer.write("weights", &[0.0; 6]).unwrap();
    let beyond = writer.write("weights", &[]).and_then(|()| {
        let mut other = FieldWriter::create(&path, &specs(), &BTreeMap::new())?;
        other.write("weights", &[0.5, -1e9])
    });
    assert!(beyond.unwrap_err().to_string().starts_with("weights[1] = -1000000000 of the field does not fit in f16"));
    assert!(writer.write("tokens", &[0.0]).unwrap_err().to_string().contains("announced as U32"));
    assert!(writer.finish().unwrap_err().to_string().contains("0 of 4 elements"));
    assert!(!path.exists() && fs::read_dir(dir.path()).unwrap().count() == 0, "a part of a file is left");
    let twice = [TensorSpec::new("a", Dtype::F32, [1]), TensorSpec::new("a", Dtype::F32, [1])];
    assert!(FieldWriter::create(&path, &twice, &BTreeMap::new()).is_err());
}

#[test]
fn reading_outside_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("field.safetensors");
    write(&path);
    let reader = FieldReader::open(&path).unwrap();
    assert!(reader.read("points", 6..13).unwrap_err().to_string().contains("12 elements"));
    assert!(reader.read("none", 0..1).unwrap_err().to_string().contains("is missing"));
    assert!(reader.read("tokens", 0..1).unwrap_err().to_string().contains("integers"));
    assert!(reader.read_u32("points", 0..1).unwrap_err().to_string().contains("floats"));
    let shape = reader.expect_shape("points", &[2, 3]).unwrap_err().to_string();
    assert!(shape.contains("[2, 2, 3] instead of [2, 3]"), "{shape}");
}
