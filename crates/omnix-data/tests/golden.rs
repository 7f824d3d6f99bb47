//! Normalisation and derived targets against `../shared/golden/omnix-train`, whose inputs are normalised already.

#![expect(clippy::unwrap_used, reason = "a test may unwrap, also in its helpers")]

use std::path::Path;

use omnix_data::{Dense, Flag, Motion, Sample, SampleParts, Time, Unit, mean_distance, normalise, targets};
use omnix_geometry::{Camera, invert_pose};
use omnix_tensors::TensorFile;

struct Case(TensorFile);

impl Case {
    fn open() -> Self {
        Self(TensorFile::open(&Path::new(env!("OMNIX_SHARED")).join("golden/omnix-train/case.safetensors")).unwrap())
    }

    fn floats(&self, name: &str) -> Vec<f32> {
        self.0.tensor(name).unwrap().to_f32()
    }

    fn sample(&self) -> Sample {
        let poses = self.floats("in.camera_pose");
        let intrinsics = self.floats("in.intrinsic");
        let cameras = poses.as_chunks::<16>().0.iter().zip(intrinsics.as_chunks::<9>().0).map(|(pose, k)| Camera {
            extrinsics: invert_pose(&std::array::from_fn(|i| std::array::from_fn(|j| pose[i * 4 + j]))),
            intrinsics: std::array::from_fn(|i| std::array::from_fn(|j| k[i * 3 + j])),
        });
        let flags =
            |name: &str| self.0.tensor_bytes(name).unwrap().iter().map(|v| Flag::from(*v != 0)).collect::<Vec<_>>();
        let (valid, mut depth) = (flags("in.valid"), self.floats("in.depth"));
        for (z, valid) in depth.iter_mut().zip(valid) {
            assert_eq!(z.is_finite(), valid == Flag::Yes, "valid is where depth is known");
        }
        Sample::new(SampleParts {
            size: [84, 70],
            images: self.floats("in.image").iter().map(|v| (v * 255.0) as u8).collect(),
            times: (0..4).map(|t| Time { video: 0, frame: t, moment: t, seconds: None }).collect(),
            cameras: cameras.collect(),
            depth: Some(depth),
            moving: Some(flags("in.moving")),
            motion: Motion::Dense(Dense {
                positions: self.floats("in.trajectory").as_chunks::<3>().0.to_vec(),
                visible: None,
            }),
            unit: Unit::MeanDistance,
        })
        .unwrap()
    }
}

#[track_caller]
fn near(found: &[f32], expected: &[f32], tolerance: f32) {
    assert_eq!(found.len(), expected.len());
    for (index, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!((a - b).abs() <= tolerance || (a.is_nan() && b.is_nan()), "{index}: {a} instead of {b}");
    }
}

#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn rays_and_pose_codes() {
    let case = Case::open();
    let sample = case.sample();
    near(&targets::rays(&sample).unwrap(), &case.floats("gt.ray"), 1e-6);
    near(targets::pose_codes(&sample).as_flattened(), &case.floats("gt.pose_encoding"), 1e-6);
}

#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn labels_of_pixels_and_tokens() {
    let case = Case::open();
    let sample = case.sample();
    let number = |flag: &Flag| match flag {
        Flag::No => 0.0,
        Flag::Yes => 1.0,
        Flag::Unknown => f32::NAN,
    };
    let labels = targets::moving_labels(&sample, true);
    near(&labels.iter().map(number).collect::<Vec<_>>(), &case.floats("gt.moving_label"), 0.0);
    let tokens = targets::token_labels(&sample, &labels).unwrap();
    near(&tokens.iter().map(number).collect::<Vec<_>>(), &case.floats("gt.moving_label_token"), 0.0);
    // Without the masks, the pixels without a known step are unknown.
    let without = targets::moving_labels(&sample, false);
    assert_eq!(without.iter().filter(|flag| **flag == Flag::Unknown).count(), 1080);
}

/// The recorded case was divided by the mean before a corner of image 1 was made invalid: with the depth of that corner filled in from
/// its paths, dividing again changes nothing.
#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn a_normalised_case_stays_as_it_is() {
    let sample = Case::open().sample();
    let mut parts = sample.clone().into_parts();
    let mut depth = parts.depth.take().unwrap();
    for image in 0..4 {
        let own = sample.positions(image, image).unwrap();
        for (pixel, z) in depth[image * 5880..(image + 1) * 5880].iter_mut().enumerate().filter(|(_, z)| z.is_nan()) {
            *z = omnix_geometry::project(own[pixel], &sample.cameras()[image], omnix_data::PIXEL)[2];
        }
    }
    parts.depth = Some(depth);
    let whole = Sample::new(parts).unwrap();
    assert!((mean_distance(&whole).unwrap() - 1.0).abs() < 1e-6);
    // The paths and the depth say the same points.
    let mut without = whole.clone().into_parts();
    without.motion = Motion::Unknown;
    assert!((mean_distance(&Sample::new(without).unwrap()).unwrap() - 1.0).abs() < 1e-6);
    let again = normalise(whole.clone()).unwrap().sample;
    near(again.parts().depth.as_ref().unwrap(), whole.parts().depth.as_ref().unwrap(), 1e-6);
    let (Motion::Dense(a), Motion::Dense(b)) = (again.motion(), whole.motion()) else {
        panic!("the paths are gone");
    };
    near(a.positions.as_flattened(), b.positions.as_flattened(), 1e-6);
    // With the corner left out the mean differs, and so would the scale.
    assert!((mean_distance(&sample).unwrap() - 0.996_61).abs() < 1e-5);
}
