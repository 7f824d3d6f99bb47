//! What the tests of all loaders share.

use crate::scene::{Pick, Scene};
use crate::{Flag, Sample, Tracks};

/// All images of a scene, video after video.
pub(super) fn picks(scene: &dyn Scene) -> Vec<Pick> {
    let videos = scene.videos().iter().enumerate();
    videos.flat_map(|(v, video)| (0..video.frames).map(move |f| Pick::plain(v, f))).collect()
}

/// Images and cameras are those of the truth, and so is depth but for this number of unknown pixels per image (any depth for
/// [`usize::MAX`]).
#[track_caller]
pub(super) fn agrees(sample: &Sample, truth: &Sample, unknown: usize) {
    assert_eq!((sample.count(), sample.size()), (truth.count(), truth.size()));
    for image in 0..truth.count() {
        assert!(sample.image(image) == truth.image(image), "picture {image}");
        let [a, b] = [sample, truth].map(|s| s.cameras()[image]);
        let numbers = |c: omnix_geometry::Camera| [c.extrinsics.as_flattened(), c.intrinsics.as_flattened()].concat();
        let off = numbers(a).iter().zip(numbers(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-5, "camera {image}: {a:?} {b:?}");
        if unknown < usize::MAX {
            let pairs = sample.depth(image).unwrap().iter().zip(truth.depth(image).unwrap());
            assert_eq!(pairs.clone().filter(|(a, _)| a.is_nan()).count(), unknown, "unknown depth of {image}");
            assert!(pairs.into_iter().all(|(a, b)| a.is_nan() || (a - b).abs() < 1e-5), "depth {image}");
        }
    }
}

/// The paths of some pixels of image 0 of a made sample.
pub(super) fn tracks(truth: &Sample, pixels: &[usize]) -> Tracks {
    let count = truth.count();
    let at = |time: usize| (0..pixels.len()).map(move |k| (time, pixels[k]));
    let all = (0..count).flat_map(at);
    Tracks {
        count: pixels.len(),
        positions: all.clone().map(|(time, pixel)| truth.positions(0, time).unwrap()[pixel]).collect(),
        visible: all.clone().map(|(time, pixel)| truth.visible(0, time).unwrap()[pixel]).collect(),
        pixels: Some(
            all.map(|(time, pixel)| {
                let point = truth.positions(0, time).unwrap()[pixel];
                let [u, v, _] =
                    omnix_geometry::project(point, &truth.cameras()[time], omnix_geometry::PixelCentre::Whole);
                [u, v]
            })
            .collect(),
        ),
    }
}

/// Numbers of one time of tracks.
pub(super) fn floats<const N: usize>(values: &[[f32; N]]) -> Vec<f64> {
    values.iter().flatten().map(|v| f64::from(*v)).collect()
}

/// 1 where it is so.
pub(super) fn ones(flags: &[Flag]) -> Vec<f64> {
    flags.iter().map(|flag| f64::from(u8::from(*flag == Flag::Yes))).collect()
}
