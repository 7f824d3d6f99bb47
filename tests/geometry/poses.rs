//! Quaternions, pose codes, normalisation and alignment against `geometry.safetensors` (`spec/da3.md` section 8).

use omnix_geometry::{
    AlignTo, Camera, align_cameras, decode_pose_code, encode_pose_code, fit_cameras, invert_pose, normalise_extrinsics,
    quaternion_from_rotation, rotation_from_quaternion,
};

use crate::fixture::{Golden, assert_close, goldens};

fn files() -> Vec<Golden> {
    goldens("geometry.safetensors", &["tiny-a/geometry.safetensors"])
}

#[test]
fn quaternions() {
    for golden in files() {
        let (_, quaternions) = golden.f32("quat.in_xyzw");
        let matrices = golden.matrices::<3, 3>("quat.matrix");
        let (_, back) = golden.f32("quat.back_xyzw");
        for ((q, m), back) in quaternions.as_chunks().0.iter().zip(&matrices).zip(back.as_chunks::<4>().0) {
            assert_close("matrix", rotation_from_quaternion(*q).as_flattened(), m.as_flattened(), 1e-5);
            assert_close("quaternion", &quaternion_from_rotation(m), back, 1e-5);
        }
    }
}

#[test]
fn pose_codes() {
    for golden in files() {
        let size = golden.i64("enc.hw");
        let (height, width) = (size[0] as u32, size[1] as u32);
        let extrinsics = golden.poses("enc.w2c");
        let intrinsics = golden.matrices::<3, 3>("enc.intrinsics");
        let (_, codes) = golden.f32("enc.pose");
        let c2w = golden.poses("dec.c2w");
        let w2c = golden.poses("dec.w2c");
        let decoded_k = golden.matrices::<3, 3>("dec.intrinsics");
        for (view, code) in codes.as_chunks::<9>().0.iter().enumerate() {
            let camera = Camera { extrinsics: extrinsics[view], intrinsics: intrinsics[view] };
            assert_close("code", &encode_pose_code(&camera, height, width), code, 2e-5);
            let decoded = decode_pose_code(*code, height, width);
            assert_close("w2c", decoded.extrinsics.as_flattened(), w2c[view].as_flattened(), 2e-5);
            assert_close("c2w", invert_pose(&decoded.extrinsics).as_flattened(), c2w[view].as_flattened(), 2e-5);
            assert_close("K", decoded.intrinsics.as_flattened(), decoded_k[view].as_flattened(), 1e-3);
        }
    }
}

#[test]
fn normalised_extrinsics() {
    for golden in files() {
        let normalised = normalise_extrinsics(&golden.poses("enc.w2c")).unwrap();
        let expected = golden.poses("norm.w2c");
        assert_close(
            "normalised",
            normalised.as_flattened().as_flattened(),
            expected.as_flattened().as_flattened(),
            2e-5,
        );
    }
}

#[test]
fn umeyama_alignment() {
    for golden in files() {
        let (estimated, reference) = (golden.poses("umeyama.est_w2c"), golden.poses("umeyama.ref_w2c"));
        let found = fit_cameras(&estimated, &reference).unwrap();
        let scale = golden.f32("umeyama.scale").1[0];
        assert_close("scale", &[found.scale as f32], &[scale], 1e-5);
        let rotation = found.rotation.map(|row| row.map(|v| v as f32));
        assert_close("rotation", rotation.as_flattened(), &golden.f32("umeyama.rotation").1, 1e-5);
        let translation = found.translation.map(|v| v as f32);
        assert_close("translation", &translation, &golden.f32("umeyama.translation").1, 1e-4);

        let aligned = align_cameras(&estimated, &reference, AlignTo::Predicted).unwrap().extrinsics;
        let expected = golden.poses("umeyama.aligned_w2c");
        assert_close("aligned", aligned.as_flattened().as_flattened(), expected.as_flattened().as_flattened(), 1e-4);
    }
}
