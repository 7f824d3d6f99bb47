//! Conversion of F32, F16, BF16 and F64, whole and in pieces, aligned and not.

use std::borrow::Cow;

use half::f16;
use omnix_weights::{Dtype, TensorFile, TensorView, find_non_finite};

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
            assert_eq!(view.f32_iter().collect::<Vec<_>>(), values, "{name} {n}");
            let mut halves = vec![f16::ZERO; n];
            view.read_f16_into(0..n, &mut halves).unwrap();
            assert!(halves.iter().zip(&values).all(|(h, v)| h.to_f32() == *v), "{name} {n}");
        }
    }
}

#[test]
fn pieces_are_parts_of_the_whole() {
    let (file, values) = all_types(3000);
    for name in ["f32", "f16", "bf16", "f64"] {
        let view = file.tensor(name).unwrap();
        for range in [0..0, 0..1, 5..1500, 2999..3000, 3000..3000] {
            let mut out = vec![f32::NAN; range.len()];
            view.read_f32_into(range.clone(), &mut out).unwrap();
            assert_eq!(out, values[range], "{name}");
        }
        for (range, places) in [(0..3001, 3001), (2999..3001, 2), (0..2, 3), (usize::MAX - 1..usize::MAX, 1)] {
            assert!(view.read_f32_into(range.clone(), &mut vec![0.0; places]).is_err(), "{range:?}");
        }
        #[expect(clippy::reversed_empty_ranges, reason = "a caller may compute one")]
        let reversed = 4..2;
        assert!(view.read_f32_into(reversed, &mut []).is_err());
    }
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
    let values = [2049.0, 2051.0, 65519.0, 65520.0];
    let file = fixture::file(&[fixture::f32("a", &[4], &values)], &[]);
    let file = TensorFile::from_bytes(file.into(), "rounding").unwrap();
    let mut out = [f16::ZERO; 4];
    file.tensor("a").unwrap().read_f16_into(0..4, &mut out).unwrap();
    assert_eq!(out.map(f16::to_f32), [2048.0, 2052.0, 65504.0, f32::INFINITY]);
}

#[test]
fn nan_and_infinity_are_found_with_their_place() {
    fn place(view: &TensorView<'_>) -> Option<usize> {
        find_non_finite(view).map(|(index, _)| index)
    }
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for at in [0, 4095, 4096, 9999] {
            let mut values = exact(10_000);
            values[at] = bad;
            let double: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
            let tensors = [
                fixture::f32("f32", &[10_000], &values),
                fixture::f16("f16", &[10_000], &values),
                fixture::bf16("bf16", &[10_000], &values),
                fixture::f64("f64", &[10_000], &double),
            ];
            let file = TensorFile::from_bytes(fixture::file(&tensors, &[]).into(), "bad").unwrap();
            for name in ["f32", "f16", "bf16", "f64"] {
                assert_eq!(place(&file.tensor(name).unwrap()), Some(at), "{name} {bad}");
            }
        }
    }
    let (file, _) = all_types(10_000);
    assert_eq!(place(&file.tensor("f32").unwrap()), None);
    // Finite as f64, not as f32.
    let large = fixture::file(&[fixture::f64("a", &[2], &[0.0, 1e300])], &[]);
    let large = TensorFile::from_bytes(large.into(), "large").unwrap();
    assert_eq!(find_non_finite(&large.tensor("a").unwrap()), Some((1, f32::INFINITY)));
}

#[test]
fn other_types_are_refused_when_read() {
    let file = fixture::file(&[fixture::i64("steps", &[7]), fixture::f32("a", &[1], &[1.0])], &[]);
    let file = TensorFile::from_bytes(file.into(), "mixed").unwrap();
    let message = file.tensor("steps").unwrap_err().to_string();
    assert!(message.contains("steps") && message.contains("I64"), "{message}");
    assert_eq!(file.tensor("a").unwrap().dtype, Dtype::F32);
    assert_eq!(file.tensor_bytes("steps").unwrap(), 7i64.to_le_bytes());
}
