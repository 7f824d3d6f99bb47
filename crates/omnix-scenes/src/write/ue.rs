//! The layout of the paper's own set (`spec/omnix.md` 11.5, first row), one folder a scene.
//!
//! ```text
//! image/cam_CC/frame_NNNN.jpg              quality 95
//! camera/cam_CC/frame_NNNN.npz             intrinsic f64 [3,3], camera_pose f64 [4,4] camera to world, OpenCV axes, metres
//! depth/cam_CC/frame_NNNN.npy              f32 [H,W] z-depth, 65504 for the sky
//! foreground_mask/cam_CC/frame_NNNN.png    255 where what the pixel shows moves at any of the scene's times
//! vertex/frame_NNNN.npz                    actor_AAA f64 [V,3] in the world
//! face.npz                                 actor_AAA i32 [F,3]
//! ```

use glam::DVec3;
use image::codecs::{jpeg::JpegEncoder, png::PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

use super::files::{Files, Take};
use super::numpy::{f32_bytes, f64_bytes, npy};
use crate::cast::Geometry;
use crate::error::ScenesError;
use crate::scene::Scene;
use crate::view::View;

/// The largest f16, which the set has where nothing was hit.
const FAR: f32 = 65504.0;
const QUALITY: u8 = 95;

/// The files of one image.
pub(super) fn image(files: &Files, take: &Take) -> Result<(), ScenesError> {
    let [width, height] = take.view.size;
    let name = |kind: &str, end: &str| format!("{kind}/cam_{:02}/frame_{:04}.{end}", take.camera, take.frame);
    let (w, h) = (width as u32, height as u32);
    let mut jpeg = Vec::new();
    let failed = |error: image::ImageError| ScenesError::Encode { reason: error.to_string() };
    JpegEncoder::new_with_quality(&mut jpeg, QUALITY)
        .write_image(&take.colours, w, h, ExtendedColorType::Rgb8)
        .map_err(failed)?;
    files.put(&name("image", "jpg"), &jpeg)?;
    let depth = take.hits.iter().map(|hit| hit.map_or(FAR, |hit| hit.t as f32));
    files.put(&name("depth", "npy"), &npy("<f4", &[height, width], &f32_bytes(depth)))?;
    let mut mask = Vec::new();
    let levels: Vec<u8> = take.moving.iter().map(|&moves| if moves { 255 } else { 0 }).collect();
    PngEncoder::new(&mut mask).write_image(&levels, w, h, ExtendedColorType::L8).map_err(failed)?;
    files.put(&name("foreground_mask", "png"), &mask)?;
    let pose = f64_bytes(pose(&take.view));
    let intrinsic = f64_bytes(take.view.intrinsics().iter().flatten().map(|&v| f64::from(v)));
    let camera = [("intrinsic", npy("<f8", &[3, 3], &intrinsic)), ("camera_pose", npy("<f8", &[4, 4], &pose))];
    files.archive(&name("camera", "npz"), &camera)
}

/// Camera to world, row by row.
fn pose(view: &View) -> [f64; 16] {
    let [x, y, z] = [view.rotation.x_axis, view.rotation.y_axis, view.rotation.z_axis];
    let c = view.centre;
    [x.x, y.x, z.x, c.x, x.y, y.y, z.y, c.y, x.z, y.z, z.z, c.z, 0.0, 0.0, 0.0, 1.0]
}

/// Meshes of everything that moves, at one time; faces once.
pub(super) fn meshes(files: &Files, scene: &Scene, geometry: &Geometry, frame: usize) -> Result<(), ScenesError> {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    let mut instance = 1;
    for actor in &scene.actors {
        let (mut points, mut corners): (Vec<DVec3>, Vec<u32>) = (Vec::new(), Vec::new());
        for _ in &actor.parts {
            let (solid, pose) = geometry.instance(instance);
            let first = points.len() as u32;
            points.extend(solid.mesh.positions.iter().map(|&p| pose.map_or(p, |pose| pose.transform_point3(p))));
            corners.extend(solid.mesh.triangles.iter().flatten().map(|corner| corner + first));
            instance += 1;
        }
        vertices.push(npy("<f8", &[points.len(), 3], &f64_bytes(points.iter().flat_map(|p| p.to_array()))));
        let corners: Vec<u8> = corners.iter().flat_map(|&corner| (corner as i32).to_le_bytes()).collect();
        faces.push(npy("<i4", &[corners.len() / 12, 3], &corners));
    }
    let names: Vec<String> = (0..scene.actors.len()).map(|actor| format!("actor_{actor:03}")).collect();
    let named = |arrays: Vec<Vec<u8>>| names.iter().map(String::as_str).zip(arrays).collect::<Vec<_>>();
    files.archive(&format!("vertex/frame_{frame:04}.npz"), &named(vertices))?;
    if frame == 0 { files.archive("face.npz", &named(faces)) } else { Ok(()) }
}

/// Bytes that a scene takes at most, roughly: depth as it is, pictures and masks as JPEG and PNG.
pub(super) fn bytes(images: u64, pixels: u64) -> u64 {
    images.saturating_mul(pixels.saturating_mul(5))
}
