//! Preprocessing against recorded pictures of both references.

use omnix_io::preprocess::{
    Da3Preprocess, Framing, OmnixPreprocess, ResizeMethod, centre_crop, common_size, exported_picture, normalise,
};
use safetensors::SafeTensors;

use crate::common::{data, floats, pattern, picture, shared};

/// Largest difference and how many samples differ.
fn difference(a: &[u8], b: &[u8]) -> (u8, usize) {
    assert_eq!(a.len(), b.len());
    let differences = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b));
    (differences.clone().max().unwrap(), differences.filter(|&d| d > 0).count())
}

fn check_da3(bytes: &[u8]) -> usize {
    let tensors = SafeTensors::deserialize(bytes).unwrap();
    let mut cases: Vec<&str> = tensors.names().iter().filter_map(|n| n.strip_suffix(".in_rgb")).collect();
    cases.sort_unstable();
    for case in &cases {
        let mut parts = case.split('.').skip(1);
        let method: ResizeMethod = parts.next().unwrap().parse().unwrap();
        let process_res = parts.next().unwrap().parse().unwrap();
        let input = picture(&tensors, &format!("{case}.in_rgb"));
        let expected = picture(&tensors, &format!("{case}.out_rgb"));
        let k: Vec<f32> = floats(&tensors, &format!("{case}.in_intrinsics"));
        let k = [[k[0], k[1], k[2]], [k[3], k[4], k[5]], [k[6], k[7], k[8]]];
        let settings = Da3Preprocess { process_res, method };
        let out = settings.apply(&input, Some(k)).unwrap();
        let size = (out.picture.width, out.picture.height);
        assert_eq!(size, (expected.width, expected.height), "{case}");
        assert_eq!(settings.output_size(input.width, input.height).unwrap(), size, "{case}: planned size");
        let (worst, count) = difference(&out.picture.data, &expected.data);
        assert!(worst <= 1 && count <= 2, "{case}: {count} samples differ by up to {worst}");
        let k = out.intrinsics.unwrap().concat();
        for (a, b) in k.iter().zip(floats(&tensors, &format!("{case}.out_intrinsics"))) {
            assert!((a - b).abs() <= 1e-5 * b.abs().max(1.0), "{case}: intrinsics {a} {b}");
        }
        if tensors.tensor(&format!("{case}.out")).is_ok() {
            let expected_out = floats(&tensors, &format!("{case}.out"));
            let mut out = vec![0.0; expected_out.len()];
            normalise(&expected, &mut out);
            let worst = out.iter().zip(&expected_out).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst <= 1e-6, "{case}: normalised values differ by {worst}");
        }
    }
    if tensors.tensor("prebatch.in0").is_ok() {
        check_batch(&tensors);
    }
    cases.len()
}

fn check_batch(tensors: &SafeTensors<'_>) {
    let settings = Da3Preprocess { process_res: 98, method: ResizeMethod::default() };
    let run = |n: usize| settings.apply(&picture(tensors, &format!("prebatch.in{n}")), None).unwrap();
    let outs = [run(0), run(1)];
    let size = common_size(outs.iter().map(|o| (o.picture.width, o.picture.height))).unwrap();
    assert_eq!(size, (98, 56));
    let mut values = Vec::new();
    for out in outs {
        let out = centre_crop(out, size).picture;
        let mut plane = vec![0.0; 3 * 98 * 56];
        normalise(&out, &mut plane);
        values.extend(plane);
    }
    let expected = floats(tensors, "prebatch.out");
    let worst = values.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst <= 1.01 / 255.0 / 0.224, "batch: {worst}");
}

#[test]
fn depth_anything_3_goldens() {
    assert_eq!(check_da3(&std::fs::read(data("da3_preprocess.safetensors")).unwrap()), 4);
}

#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn depth_anything_3_goldens_all_of_them() {
    let path = shared("golden/da3/tiny-a/preprocess.safetensors").expect("the recorded cases");
    assert_eq!(check_da3(&std::fs::read(path).unwrap()), 8);
}

fn check_omnix(bytes: &[u8]) -> usize {
    let tensors = SafeTensors::deserialize(bytes).unwrap();
    let mut cases: Vec<&str> = tensors.names().iter().filter_map(|n| n.strip_suffix(".input")).collect();
    cases.sort_unstable();
    for case in &cases {
        let expected = picture(&tensors, &format!("{case}.output"));
        let settings = OmnixPreprocess { width: expected.width, height: expected.height };
        let out = settings.apply(&picture(&tensors, &format!("{case}.input"))).unwrap();
        assert_eq!(difference(&out.data, &expected.data), (0, 0), "{case}");
    }
    cases.len()
}

#[test]
fn omnix_goldens_byte_for_byte() {
    assert_eq!(check_omnix(&std::fs::read(data("omnix_resize.safetensors")).unwrap()), 4);
}

#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn omnix_goldens_byte_for_byte_all_of_them() {
    let path = shared("golden/omnix/preprocess/resize.safetensors").expect("the recorded cases");
    assert_eq!(check_omnix(&std::fs::read(path).unwrap()), 6);
}

#[test]
fn three_pixels_wide() {
    let settings = Da3Preprocess::default();
    for (w, h) in [(3, 1000), (1000, 3), (3, 3), (3, 40), (1, 1)] {
        let out = settings.apply(&pattern(w, h), None).unwrap().picture;
        assert!(out.width % 14 == 0 && out.height % 14 == 0, "{w} x {h} became {} x {}", out.width, out.height);
    }
    let crop = Da3Preprocess { method: ResizeMethod::UpperBoundCrop, ..settings };
    let message = crop.apply(&pattern(3, 1000), None).unwrap_err().to_string();
    assert!(message.contains("3 x 1000") && message.contains("use a resize method"), "{message}");
    let lower = Da3Preprocess { method: ResizeMethod::LowerBoundResize, ..settings };
    let message = lower.output_size(3, 100_000).unwrap_err().to_string();
    assert!(message.contains("upper_bound"), "{message}");
    assert_eq!(OmnixPreprocess::default().apply(&pattern(3, 40)).unwrap().width, 504);
    assert!(OmnixPreprocess { width: 500, height: 280 }.apply(&pattern(30, 40)).is_err());
    assert!(OmnixPreprocess::default().apply(&pattern(1, 20_000)).is_err());
}

#[test]
fn any_size_and_method_gives_patches_or_an_error() {
    let names = ["upper_bound_resize", "upper_bound_crop", "lower_bound_resize", "lower_bound_crop"];
    let (mut state, mut refused) = (1u32, 0);
    let mut random = |most: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        1 + (state >> 8) % most
    };
    for case in 0..240 {
        // Every fourth picture is a strip.
        let (w, h) = (random(200), random(if case % 4 == 0 { 9 } else { 200 }));
        let settings = Da3Preprocess { process_res: random(150), method: names[case % 4].parse().unwrap() };
        let label = format!("{w} x {h} {settings:?}");
        match settings.output_size(w, h) {
            Ok(size) => {
                let out = settings.apply(&pattern(w, h), None).unwrap().picture;
                assert_eq!((out.width, out.height), size, "{label}");
                assert!(size.0 > 0 && size.1 > 0 && size.0 % 14 == 0 && size.1 % 14 == 0, "{label}: {size:?}");
            }
            Err(error) => {
                assert!(matches!(error, omnix_io::IoError::DegenerateSize { .. }), "{label}: {error}");
                refused += 1;
            }
        }
    }
    assert!((1..100).contains(&refused), "{refused} refused");
}

#[test]
fn exported_picture_truncates() {
    let picture = pattern(64, 64);
    let out = exported_picture(&picture);
    let (worst, count) = difference(&picture.data, &out.data);
    assert!(worst == 1 && count > 0, "{count} of the samples lower by {worst}");
    assert!(picture.data.iter().zip(&out.data).all(|(a, b)| b <= a));
}

/// Where a pixel of the source is in the prepared picture, by the framing.
fn placed(framing: Framing, source: (u32, u32), k: [[f32; 3]; 3]) -> [f64; 4] {
    let scale =
        [f64::from(framing.resized.0) / f64::from(source.0), f64::from(framing.resized.1) / f64::from(source.1)];
    let k = k.map(|row| row.map(f64::from));
    let [left, top, ..] = framing.crop.map(f64::from);
    [k[0][0] * scale[0], k[1][1] * scale[1], k[0][2] * scale[0] - left, k[1][2] * scale[1] - top]
}

#[test]
fn framing_leads_back_to_the_source() {
    let k = [[310.0, 0.0, 90.0], [0.0, 300.0, 70.0], [0.0, 0.0, 1.0]];
    for name in ["upper_bound_resize", "upper_bound_crop", "lower_bound_resize", "lower_bound_crop"] {
        for (w, h) in [(181, 143), (143, 181), (200, 100), (64, 64)] {
            let settings = Da3Preprocess { process_res: 98, method: name.parse().unwrap() };
            let whole = settings.apply(&pattern(w, h), Some(k)).unwrap();
            let common = (whole.picture.width.min(84), whole.picture.height.min(56));
            let cut = centre_crop(whole, common);
            let framing = settings.framing(w, h, common).unwrap();
            assert_eq!((framing.crop[2], framing.crop[3]), common, "{name} {w} x {h}");
            let made = cut.intrinsics.unwrap();
            let made = [made[0][0], made[1][1], made[0][2], made[1][2]].map(f64::from);
            for (a, b) in made.iter().zip(placed(framing, (w, h), k)) {
                assert!((a - b).abs() < 1e-3, "{name} {w} x {h}: {made:?} by {framing:?}");
            }
        }
    }
}

#[test]
fn framing_of_a_fixed_size_says_what_is_cut() {
    // A picture whose left half is black and right half white: the edge is where the framing says.
    let (w, h) = (300, 100);
    let data = (0..w * h).flat_map(|i| [if i % w < w / 2 { 0 } else { 255 }; 3]).collect();
    let settings = OmnixPreprocess { width: 84, height: 56 };
    let framing = settings.framing(w, h).unwrap();
    assert_eq!((framing.resized, framing.crop), ((168, 56), [42, 0, 84, 56]));
    assert!((framing.kept() - 0.5).abs() < 1e-12);
    let out = settings.apply(&omnix_io::Picture::new(w, h, data)).unwrap();
    let edge = (0..84).position(|x| out.data[x * 3] > 127).unwrap();
    assert_eq!(edge, 42, "150 * 168 / 300 - 42");
}
