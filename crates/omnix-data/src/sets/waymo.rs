//! Waymo Open: up to five synchronised cameras on a car, world points from its laser scanner.
//!
//! `image/cam_K/NAME.jpg`, `camera/cam_K/NAME.npz` {intrinsic 3 x 3, camera_pose 4 x 4 camera to world}, `static_mask/cam_K/NAME.png` (above the
//! middle: stands still), `pts3d/cam_K/NAME.npz` {points}: world points of the pixels, `[H, W, 3]` (unknown: not finite, or three zeros), or of the
//! scan, `[N, 3]`, of which each pixel takes the nearest to the camera. What stands still has its place at all times, the rest at its own time:
//! `veh_trajectory/` (the paths of the vehicles) is not read, since its frame of reference and the vehicles' extents are not known to us. Unit: metres.
//! The world is large: positions are relative to the first camera of the first image.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::dense::standing;
use crate::files::{Archive, folders};
use crate::posed::{Stream, mask, pinhole};
use crate::scene::{Pick, Scene, Video, View};
use crate::set::Set;
use crate::{DataError, Flag, Motion, Unit};

pub(super) const SIGNATURE: &[&str] = &["image", "static_mask", "pts3d"];

#[derive(Debug)]
struct Waymo {
    folder: PathBuf,
    streams: Vec<Stream>,
    videos: Vec<Video>,
}

pub(super) fn open(folder: &Path) -> Result<Box<dyn Scene>, DataError> {
    let mut streams = Vec::new();
    for camera in folders(&folder.join("image"))? {
        let name = camera.file_name().unwrap_or_default().to_string_lossy().into_owned();
        streams.push(Stream::new(&name, camera, folder.join("camera").join(&name))?);
    }
    if streams.is_empty() {
        return Err(DataError::NoPictures { path: folder.join("image") });
    }
    let videos = streams.iter().map(Stream::video).collect();
    Ok(Box::new(Waymo { folder: folder.to_owned(), streams, videos }))
}

impl Waymo {
    fn file(&self, video: usize, frame: usize, kind: &str, extension: &str) -> PathBuf {
        let stream = &self.streams[video];
        stream.beside(frame, &self.folder.join(kind).join(&stream.name), extension)
    }
}

impl Scene for Waymo {
    fn set(&self) -> Set {
        Set::Waymo
    }

    fn path(&self) -> &Path {
        &self.folder
    }

    fn videos(&self) -> &[Video] {
        &self.videos
    }

    fn unit(&self) -> Unit {
        Unit::Metre
    }

    fn view(&self, video: usize, frame: usize) -> Result<View, DataError> {
        let mut view = self.streams[video].view(frame, &["intrinsic"], &["camera_pose"])?;
        view.moment = self.streams[video].number(frame);
        let still = mask(&self.file(video, frame, "static_mask", "png"), view.size())?;
        view.moving = Some(still.into_iter().map(|still| Flag::from(!still)).collect());
        view.depth = Some(self.depth(&self.file(video, frame, "pts3d", "npz"), &view)?);
        Ok(view)
    }

    fn motion(&self, _: &[Pick], views: &[View]) -> Result<Motion, DataError> {
        let still =
            |image: usize, pixel: usize| views[image].moving.as_ref().is_some_and(|moving| moving[pixel] == Flag::No);
        Ok(Motion::Dense(standing(views, still)))
    }

    fn origin(&self) -> Result<DVec3, DataError> {
        let mut archive = Archive::open(&self.file(0, 0, "camera", "npz"))?;
        Ok(pinhole(&mut archive, &["intrinsic"], &["camera_pose"])?.w2c.inverse().translation)
    }
}

impl Waymo {
    /// The depth of the points in an archive, as the camera of a view sees them.
    fn depth(&self, path: &Path, view: &View) -> Result<Vec<f32>, DataError> {
        let [width, height] = view.size();
        let array = Archive::open(path)?.array("points")?;
        let dense = array.shape().len() == 3;
        let array = if dense { array.expect(&[height, width, 3])? } else { array.expect(&[0, 3])? };
        let mut depth = vec![f32::NAN; width * height];
        for (index, point) in array.to_f64().chunks_exact(3).map(DVec3::from_slice).enumerate() {
            let seen = view.camera.w2c.apply(point);
            if !point.is_finite() || point == DVec3::ZERO || seen.z <= 0.0 {
                continue;
            }
            let [u, v] = view.camera.project(seen);
            let inside = u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64;
            let pixel = match (dense, inside) {
                (true, _) => index,
                (false, true) => v as usize * width + u as usize,
                (false, false) => continue,
            };
            // Of NaN and a number this is the number.
            depth[pixel] = depth[pixel].min(seen.z as f32);
        }
        Ok(depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;
    use crate::read::{ReadOptions, read};
    use crate::sets::tests_support::picks;

    /// The truth, written with a world whose origin is far away.
    fn write(dir: &Path, scan: bool) -> crate::Sample {
        let far = DVec3::new(1e6, -2e6, 40.0);
        let truth = made::video([28, 14], 2);
        for image in 0..2 {
            let file = |kind: &str, extension: &str| dir.join(format!("{kind}/cam_0/{image:05}.{extension}"));
            made::picture(&file("image", "png"), &truth, image);
            made::mask(
                &file("static_mask", "png"),
                [28, 14],
                truth.moving(image).unwrap().iter().map(|f| *f == Flag::No),
            );
            let (mut pose, k) = made::pose_and_intrinsics(&truth, image);
            (0..3).for_each(|axis| pose[4 * axis + 3] += far[axis]);
            made::npz(&file("camera", "npz"), &[("intrinsic", &[3, 3], &k), ("camera_pose", &[4, 4], &pose)]);
            let own = truth.positions(image, image).unwrap();
            let mut points: Vec<f64> =
                own.iter().flat_map(|p| (0..3).map(|axis| f64::from(p[axis]) + far[axis])).collect();
            points[..3].fill(if scan { f64::NAN } else { 0.0 });
            let shape: &[u64] = if scan { &[14 * 28, 3] } else { &[14, 28, 3] };
            made::npz(&file("pts3d", "npz"), &[("points", shape, &points)]);
        }
        truth
    }

    #[test]
    fn a_written_scene_is_read_back() {
        for scan in [false, true] {
            let dir = tempfile::tempdir().unwrap();
            let truth = write(dir.path(), scan);
            let opened = crate::sets::open(dir.path(), None).unwrap();
            assert_eq!(opened.set(), Set::Waymo);
            let sample = read(opened.as_ref(), &picks(opened.as_ref()), &ReadOptions::default()).unwrap();
            assert_eq!(sample.moving(1), truth.moving(1));
            // The world begins at the first camera, and nothing was lost to rounding.
            let first = omnix_geometry::camera_centre(&truth.cameras()[0].extrinsics);
            for (image, camera) in sample.cameras().iter().enumerate() {
                let [a, b] = [camera, &truth.cameras()[image]].map(|c| omnix_geometry::camera_centre(&c.extrinsics));
                assert!((0..3).all(|k| (a[k] + first[k] - b[k]).abs() < 1e-4), "{a:?} {b:?} {first:?}");
                let pairs = sample.depth(image).unwrap().iter().zip(truth.depth(image).unwrap());
                let off = pairs.clone().filter(|(a, b)| (*a - *b).abs() > 1e-3).count();
                // A point of a scan that lies on an edge of pixels may fall to the next.
                assert!(sample.depth(image).unwrap()[0].is_nan() && off <= if scan { 20 } else { 0 }, "{off}");
            }
            let still = sample.positions(0, 1).unwrap().iter().zip(sample.moving(0).unwrap());
            assert!(still.clone().all(|(p, moving)| *moving == Flag::No || p[0].is_nan()));
            assert!(still.into_iter().filter(|(p, _)| p[0].is_finite()).count() > 100);
        }
    }

    #[test]
    fn other_points_are_named() {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), false);
        made::npz(&dir.path().join("pts3d/cam_0/00000.npz"), &[("points", &[2, 4], &[0.0; 8])]);
        let opened = crate::sets::open(dir.path(), None).unwrap();
        assert!(matches!(opened.view(0, 0), Err(DataError::ArrayShape { .. })));
    }
}
