//! Conversion of F32, F16, BF16 and F64, whole and in pieces, aligned and not.

use std::borrow::Cow;
use std::collections::BTreeMap;

use omnix_tensors::{Dtype, Float, TensorError, TensorFile, TensorReader, TensorSpec, TensorView, TensorWriter};

use crate::fixture;

/// Values that f16 and bf16 both hold exactly, one longer than the conversion's inner chunk of 1024.
fn exact(n: usize) -> Vec<f32> {
    (0..n).map(|k| ((k * 37 % 255) as f32 - 127.0) / 32.0).collect()
}

fn all_types(n: usize) -> (TensorFile, Vec<f32>) {
    let values = exact(n);
    let double: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
    let tensors = [
        fixture::f32("f32", &[n], &values),
        fixture::f16("f16", &[n], &values),
        fixture::bf16("bf16", &[n], &values),
        fixture::f64("f64", &[n], &double),
    ];
    (TensorFile::from_bytes(fixture::file(&tensors, &[]).into(), "all types").unwrap(), values)
}

#[test]
fn every_type_converts_exactly() {
    for n in [0, 1, 7, 1024, 1025, 5000] {
        let (file, values) = all_types(n);
        for name in ["f32", "f16", "bf16", "f64"] {
            let view = file.tensor(name).unwrap();
            assert_eq!((view.shape, view.elements()), (&[n][..], n));
            assert_eq!(view.to_f32(), values, "{name} {n}");
            assert_eq!(*view.as_f32(), values, "{name} {n}");
            assert!(name == "f32" || matches!(view.as_f32(), Cow::Owned(_)), "{name} {n}");
        }
    }
}

#[test]
fn pieces_are_parts_of_the_whole() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("all.safetensors");
    let values = exact(3000);
    let double: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
    let tensors = [
        fixture::f32("f32", &[3000], &values),
        fixture::f16("f16", &[3000], &values),
        fixture::bf16("bf16", &[3000], &values),
        fixture::f64("f64", &[3000], &double),
    ];
    std::fs::write(&path, fixture::file(&tensors, &[])).unwrap();
    let reader = TensorReader::open(&path).unwrap();
    for name in ["f32", "f16", "bf16", "f64"] {
        for range in [0..0, 0..1, 5..1500, 2999..3000, 3000..3000] {
            assert_eq!(reader.read_f32(name, range.clone()).unwrap(), values[range], "{name}");
        }
        for range in [0..3001, 2999..3001, usize::MAX - 1..usize::MAX] {
            assert!(matches!(reader.read_f32(name, range.clone()), Err(TensorError::BadRange { .. })), "{range:?}");
        }
        #[expect(clippy::reversed_empty_ranges, reason = "a caller may compute one")]
        let reversed = 4..2;
        assert!(reader.read_f32(name, reversed).is_err());
        // Rows of 10 behind the first 100 numbers, in any order and again.
        let rows = [7, 0, 289, 7];
        let expected: Vec<f32> = rows.iter().flat_map(|r| &values[100 + 10 * r..110 + 10 * r]).copied().collect();
        assert_eq!(reader.rows_f32(name, 100, 10, &rows.map(|r| r as u32)).unwrap(), expected, "{name}");
        assert!(matches!(reader.rows_f32(name, 100, 10, &[290]), Err(TensorError::BadRange { .. })));
        assert!(reader.rows_f32(name, 100, usize::MAX / 2, &[3]).is_err());
    }
    assert!(matches!(reader.read_u32("f32", 0..1), Err(TensorError::WrongType { .. })));
    let before = reader.bytes_read();
    reader.rows_f32("f32", 0, 1, &[0, 2999]).unwrap();
    assert_eq!(reader.bytes_read() - before, 8, "two numbers of four bytes");
}

#[test]
fn unaligned_data_converts() {
    let values = exact(100);
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    // Every alignment of the data, by headers of growing length.
    for spaces in 0..8 {
        let header = format!(r#"{{"a":{{"dtype":"F32","shape":[100],"data_offsets":[0,400]}}}}{}"#, " ".repeat(spaces));
        let file = TensorFile::from_bytes(fixture::raw(&header, &data).into(), "unaligned").unwrap();
        let view = file.tensor("a").unwrap();
        assert_eq!(view.to_f32(), values);
        // Read where it lies, if it lies on a multiple of four bytes.
        assert_eq!(*view.as_f32(), values);
        let aligned = view.bytes.as_ptr().addr().is_multiple_of(4);
        assert_eq!(matches!(view.as_f32(), Cow::Borrowed(_)), aligned, "{spaces} spaces");
    }
}

#[test]
fn special_values_survive() {
    let values = [f32::INFINITY, f32::NEG_INFINITY, f32::MIN_POSITIVE / 2.0, -0.0, f32::MAX];
    let tensors = [
        fixture::f32("f32", &[5], &values),
        fixture::f16("f16", &[3], &[f32::INFINITY, 65504.0, 5.960_464_5e-8]),
        fixture::bf16("bf16", &[2], &[f32::NAN, 3.389_531_4e38]),
    ];
    let file = TensorFile::from_bytes(fixture::file(&tensors, &[]).into(), "special").unwrap();
    let bits = |name: &str| file.tensor(name).unwrap().to_f32().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits("f32"), values.map(f32::to_bits));
    assert_eq!(file.tensor("f16").unwrap().to_f32(), [f32::INFINITY, 65504.0, 5.960_464_5e-8]);
    let bf16 = file.tensor("bf16").unwrap().to_f32();
    assert!(bf16[0].is_nan() && bf16[1] == 3.389_531_4e38);
}

#[test]
fn f16_storage_rounds_to_nearest_even() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("rounded.safetensors");
    let specs = [TensorSpec::new("a", Dtype::F16, [5]), TensorSpec::new("b", Dtype::BF16, [1])];
    let mut writer = TensorWriter::create(&path, &specs, &BTreeMap::new()).unwrap();
    writer.write_f32("a", &[2049.0, 2051.0]).unwrap();
    writer.write_f32("a", &[65519.0, f32::INFINITY, f32::NAN]).unwrap();
    writer.write_f32("b", &[1.003_906_3]).unwrap();
    let file = TensorFile::open(&writer.finish().unwrap()).unwrap();
    let back = file.tensor("a").unwrap().to_f32();
    assert_eq!(back[..4], [2048.0, 2052.0, 65504.0, f32::INFINITY]);
    assert!(back[4].is_nan() && file.tensor("b").unwrap().to_f32() == [1.0]);

    let mut writer = TensorWriter::create(&path, &specs, &BTreeMap::new()).unwrap();
    writer.write_f32("a", &[0.0; 3]).unwrap();
    let error = writer.write_f32("a", &[1.0, 65520.0]).unwrap_err().to_string();
    assert!(error.starts_with("a[4] = 65520 does not fit in F16; store it as F32"), "{error}");
}

#[test]
fn nan_and_infinity_are_found_with_their_place() {
    fn place(view: &TensorView<'_>) -> Option<usize> {
        view.examine().non_finite.map(|(index, _)| index)
    }
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for at in [0, 1023, 1024, 4096, 9999, 65_535, 65_536, 69_999] {
            let mut values = exact(70_000);
            values[at] = bad;
            let double: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
            let tensors = [
                fixture::f32("f32", &[70_000], &values),
                fixture::f16("f16", &[70_000], &values),
                fixture::bf16("bf16", &[70_000], &values),
                fixture::f64("f64", &[70_000], &double),
            ];
            let file = TensorFile::from_bytes(fixture::file(&tensors, &[]).into(), "bad").unwrap();
            for name in ["f32", "f16", "bf16", "f64"] {
                assert_eq!(place(&file.tensor(name).unwrap()), Some(at), "{name} {bad}");
            }
        }
    }
    let (file, _) = all_types(70_000);
    assert_eq!(place(&file.tensor("f32").unwrap()), None);
    // Finite as f64, not as f32.
    let large = fixture::file(&[fixture::f64("a", &[2], &[0.0, 1e300])], &[]);
    let large = TensorFile::from_bytes(large.into(), "large").unwrap();
    assert_eq!(large.tensor("a").unwrap().examine().non_finite, Some((1, f32::INFINITY)));
}

#[test]
fn other_types_are_refused_when_read() {
    let file = fixture::file(&[fixture::i64("steps", &[7]), fixture::f32("a", &[1], &[1.0])], &[]);
    let file = TensorFile::from_bytes(file.into(), "mixed").unwrap();
    let message = file.tensor("steps").unwrap_err().to_string();
    assert!(message.contains("steps") && message.contains("I64"), "{message}");
    assert_eq!(file.tensor("a").unwrap().dtype, Float::F32);
    assert_eq!(file.tensor_bytes("steps").unwrap(), 7i64.to_le_bytes());
}
