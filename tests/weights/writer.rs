//! Files of tensors written piece by piece, as training states will be: any type, read back by ours and by the format's own crate.

use std::collections::BTreeMap;
use std::fs;

use omnix_tensors::{Dtype, TensorFile, TensorReader, TensorSpec, TensorWriter};
use safetensors::SafeTensors;

fn specs() -> Vec<TensorSpec> {
    vec![
        TensorSpec::new("step", Dtype::U64, []),
        TensorSpec::new("adam.m.\"quoted\" é", Dtype::F32, [2, 3]),
        TensorSpec::new("weights", Dtype::BF16, [5]),
        TensorSpec::new("none", Dtype::F64, [0, 7]),
        TensorSpec::new("done", Dtype::Bool, [3]),
        TensorSpec::new("seconds", Dtype::F64, [2]),
    ]
}

#[test]
fn every_type_goes_in_and_comes_out() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("new/state.safetensors");
    let metadata = BTreeMap::from([("format".to_owned(), "state\n\"1\"".to_owned())]);
    let mut writer = TensorWriter::create(&path, &specs(), &metadata).unwrap();
    writer.write_bytes("step", &u64::MAX.to_le_bytes()).unwrap();
    writer.write_f32("adam.m.\"quoted\" é", &[1.0, -2.0]).unwrap();
    writer.write_f32("adam.m.\"quoted\" é", &[3.0, 4.0, 5.0, f32::MIN_POSITIVE]).unwrap();
    writer.write_f32("weights", &[0.5, 1.0, 1.5, -2.0, 3.0]).unwrap();
    writer.write_bytes("done", &[1, 0, 1]).unwrap();
    writer.write_f64("seconds", &[1.7e9 + 0.04, 0.6]).unwrap();
    assert!(!path.exists(), "the file has its name before it is whole");
    assert_eq!(writer.finish().unwrap(), path);
    let bytes = fs::read(&path).unwrap();
    let other = SafeTensors::deserialize(&bytes).unwrap();
    assert_eq!(other.tensor("step").unwrap().data(), u64::MAX.to_le_bytes());
    assert_eq!(other.tensor("weights").unwrap().dtype(), safetensors::Dtype::BF16);
    let file = TensorFile::open(&path).unwrap();
    assert_eq!(file.metadata(), &metadata);
    assert_eq!(file.tensor("weights").unwrap().to_f32(), [0.5, 1.0, 1.5, -2.0, 3.0]);
    assert_eq!(file.tensor_bytes("done"), Some(&[1, 0, 1][..]));
    let reader = TensorReader::open(&path).unwrap();
    assert_eq!(reader.read_f64("seconds", 0..2).unwrap(), [1.7e9 + 0.04, 0.6]);
    let order: Vec<String> = reader.tensors().into_iter().map(|(name, _)| name.to_owned()).collect();
    assert_eq!(order, specs().into_iter().map(|spec| spec.name).collect::<Vec<_>>());
}

#[test]
fn a_file_that_is_not_finished_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("state.safetensors");
    fs::write(&path, "the one before").unwrap();
    let mut writer = TensorWriter::create(&path, &specs(), &BTreeMap::new()).unwrap();
    assert!(writer.write_bytes("step", &[0; 7]).unwrap_err().to_string().contains("an element has 8"));
    assert!(writer.write_u32("step", &[1]).unwrap_err().to_string().contains("announced as U64"));
    writer.write_bytes("step", &[0; 8]).unwrap();
    assert!(writer.write_bytes("step", &[0; 8]).unwrap_err().to_string().contains("the turn of"));
    assert!(writer.finish().unwrap_err().to_string().contains("0 of 6 elements"));
    drop(TensorWriter::create(&path, &specs(), &BTreeMap::new()).unwrap());
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    assert_eq!(fs::read(&path).unwrap(), b"the one before");
}

#[test]
fn impossible_announcements_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("state.safetensors");
    let create = |specs: &[TensorSpec]| TensorWriter::create(&path, specs, &BTreeMap::new()).map(|_| ());
    let one = |name: &str, shape: Vec<usize>| TensorSpec::new(name, Dtype::F32, shape);
    assert!(create(&[one("a", vec![1]), one("a", vec![1])]).unwrap_err().to_string().contains("twice"));
    assert!(create(&[one("__metadata__", vec![1])]).unwrap_err().to_string().contains("reserved"));
    for shape in [vec![usize::MAX], vec![1 << 40, 1 << 40], vec![usize::MAX / 4]] {
        let specs = [one("a", vec![1 << 10]), one("b", shape)];
        assert!(create(&specs).unwrap_err().to_string().contains("larger than any file"));
    }
}
