//! Cameras from ray maps against `raypose.safetensors` (`spec/da3.md` section 9), with the recorded rank table.

use omnix_geometry::{RayMaps, cameras_from_rays, sample_table};

use crate::fixture::{assert_close, assert_relative, goldens};

/// The reference's own solve in f32 is this far from exact (`spec/da3.md` section 19).
const TOLERANCE: f32 = 1e-3;

#[test]
fn cameras_of_ray_maps() {
    for golden in goldens("raypose.safetensors", &["tiny-a/raypose.safetensors", "tiny-b/raypose.safetensors"]) {
        let (shape, rays) = golden.f32("in.ray");
        let (_, confidence) = golden.f32("in.ray_conf");
        let image = golden.i64("in.image_hw");
        let image = [image[0] as u32, image[1] as u32];
        let ranks: Vec<u32> = golden.i64("in.sample_table").iter().map(|&rank| rank as u32).collect();
        let maps = RayMaps { rays: &rays, confidence: &confidence, size: [shape[2], shape[3]] };
        let found = cameras_from_rays(&maps, image, Some(ranks.as_chunks().0)).unwrap();
        assert_eq!(found.len(), shape[1]);

        let c2w = golden.poses("mid.c2w");
        let extrinsics = golden.poses("out.extrinsics");
        let intrinsics = golden.matrices::<3, 3>("out.intrinsics");
        let (_, focal) = golden.f32("mid.focal");
        let (_, principal) = golden.f32("mid.principal");
        for (view, camera) in found.iter().enumerate() {
            assert_close("focal", &camera.focal, &focal[2 * view..][..2], TOLERANCE);
            assert_close("principal", &camera.principal, &principal[2 * view..][..2], TOLERANCE);
            assert_close("c2w", camera.c2w.as_flattened(), c2w[view].as_flattened(), TOLERANCE);
            let w2c = camera.camera.extrinsics;
            assert_close("w2c", w2c.as_flattened(), extrinsics[view].as_flattened(), TOLERANCE);
            let k = camera.camera.intrinsics;
            assert_relative("K", k.as_flattened(), intrinsics[view].as_flattened(), TOLERANCE);
        }

        // Another table finds nearly the same cameras: the noise is small and the outliers are rejected.
        let own = cameras_from_rays(&maps, image, None).unwrap();
        for (a, b) in own.iter().zip(&found) {
            assert_close("focal by the own table", &a.focal, &b.focal, 0.05);
        }
    }
}

#[test]
fn the_own_table_is_distinct_and_in_range() {
    let table = sample_table(46_080);
    assert_eq!(table.len(), 100);
    for ranks in table {
        let mut sorted = ranks.to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), 8);
        assert!(sorted[7] < 13_824);
    }
}
