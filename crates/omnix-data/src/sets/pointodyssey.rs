//! PointOdyssey in CUT3R's preparation: one moving camera, points tracked through the whole scene.
//!
//! `rgb/NAME.jpg`, `depth/NAME.npy` (z-depth, `[H, W]`, unknown where not below 1000), `cam/NAME.npz` {intrinsics 3 x 3, pose 4 x 4 camera to world},
//! `traj/NAME.npz` {trajs_2d `[N, 2]`, trajs_3d `[N, 3]` in the world, valids `[N]`, visibs `[N]`}: the same N points in every image; unknown where
//! not valid. Unit: metres.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::files::Archive;
use crate::posed::{Stream, npy_depth, point};
use crate::scene::{Pick, Scene, Video, View};
use crate::set::Set;
use crate::{DataError, Flag, Motion, Tracks, Unit};

pub(super) const SIGNATURE: &[&str] = &["rgb", "traj", "cam"];
/// Depth from here on is the sky's.
const FAR: f32 = 1000.0;

#[derive(Debug)]
struct PointOdyssey {
    folder: PathBuf,
    stream: Stream,
    videos: [Video; 1],
}

pub(super) fn open(folder: &Path) -> Result<Box<dyn Scene>, DataError> {
    let stream = Stream::new("rgb", folder.join("rgb"), folder.join("cam"))?;
    let videos = [stream.video()];
    Ok(Box::new(PointOdyssey { folder: folder.to_owned(), stream, videos }))
}

impl Scene for PointOdyssey {
    fn set(&self) -> Set {
        Set::PointOdyssey
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

    fn view(&self, _: usize, frame: usize) -> Result<View, DataError> {
        let mut view = self.stream.view(frame, &["intrinsics"], &["pose"])?;
        let mut depth = npy_depth(&self.stream.beside(frame, &self.folder.join("depth"), "npy"), view.size())?;
        depth.iter_mut().filter(|z| **z >= FAR).for_each(|z| *z = f32::NAN);
        view.depth = Some(depth);
        Ok(view)
    }

    fn motion(&self, picks: &[Pick], views: &[View]) -> Result<Motion, DataError> {
        let mut tracks = Tracks { pixels: Some(Vec::new()), ..Tracks::default() };
        for (index, pick) in picks.iter().enumerate() {
            let path = self.stream.beside(pick.frame, &self.folder.join("traj"), "npz");
            let mut archive = Archive::open(&path)?;
            let positions = archive.array("trajs_3d")?.expect(&[0, 3])?;
            let count = positions.shape()[0];
            if index == 0 {
                tracks.count = count;
            } else if count != tracks.count {
                return Err(positions.wrong(format!("has {count} points where the other images have {}", tracks.count)));
            }
            let valid = archive.array("valids")?.expect(&[count])?.to_bools();
            let visible = archive.array("visibs")?.expect(&[count])?.to_bools();
            let known = positions.to_f64();
            for (k, values) in known.chunks_exact(3).enumerate() {
                let position = if valid[k] { point(values, DVec3::ZERO) } else { [f32::NAN; 3] };
                tracks.positions.push(position);
                tracks.visible.push(if position[0].is_nan() { Flag::Unknown } else { visible[k].into() });
            }
            // Positions in the picture are of the picture as it lies on the disk: no longer true once it is fitted.
            let pixels = archive.array("trajs_2d")?.expect(&[count, 2])?.to_f32();
            if let Some(all) = &mut tracks.pixels {
                all.extend(pixels.as_chunks::<2>().0);
            }
        }
        if !as_on_disk(self, picks, views) {
            tracks.pixels = None;
        }
        Ok(Motion::Tracks(tracks))
    }
}

/// Whether the views still have the size and camera of their files.
fn as_on_disk(scene: &PointOdyssey, picks: &[Pick], views: &[View]) -> bool {
    let (Some(pick), Some(view)) = (picks.first(), views.first()) else {
        return true;
    };
    let own = Archive::open(&scene.stream.beside(pick.frame, &scene.folder.join("cam"), "npz"))
        .and_then(|mut archive| crate::posed::pinhole(&mut archive, &["intrinsics"], &["pose"]));
    own.is_ok_and(|own| (own.focal, own.principal) == (view.camera.focal, view.camera.principal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;
    use crate::read::{ReadOptions, read};
    use crate::sets::tests_support::{agrees, floats, ones, picks, tracks};

    fn write(dir: &Path) -> (crate::Sample, Tracks) {
        let truth = made::video([28, 14], 3);
        let chosen: Vec<usize> = (0..truth.pixels()).step_by(5).collect();
        let all = tracks(&truth, &chosen);
        let n = chosen.len();
        for image in 0..3 {
            let file = |kind: &str, extension: &str| dir.join(format!("{kind}/rgb_{image:05}.{extension}"));
            made::picture(&file("rgb", "png"), &truth, image);
            let mut depth = truth.depth(image).unwrap().to_vec();
            depth[7] = 1000.0;
            made::npy(&file("depth", "npy"), &[14, 28], &depth);
            let (pose, k) = made::pose_and_intrinsics(&truth, image);
            made::npz(&file("cam", "npz"), &[("intrinsics", &[3, 3], &k), ("pose", &[4, 4], &pose)]);
            let here = image * n..(image + 1) * n;
            let mut valid = vec![1.0; n];
            valid[2] = 0.0;
            let count = n as u64;
            made::npz(
                &file("traj", "npz"),
                &[
                    ("trajs_2d", &[count, 2], &floats(&all.pixels.as_ref().unwrap()[here.clone()])),
                    ("trajs_3d", &[count, 3], &floats(&all.positions[here.clone()])),
                    ("valids", &[count], &valid),
                    ("visibs", &[count], &ones(&all.visible[here])),
                ],
            );
        }
        (truth, all)
    }

    #[test]
    fn a_written_scene_is_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let (truth, all) = write(dir.path());
        let opened = crate::sets::open(dir.path(), None).unwrap();
        assert_eq!(opened.set(), Set::PointOdyssey);
        let sample = read(opened.as_ref(), &picks(opened.as_ref()), &ReadOptions::default()).unwrap();
        agrees(&sample, &truth, 1);
        let Motion::Tracks(found) = sample.motion() else { panic!("no tracks") };
        assert_eq!((found.count, found.visible[2], found.positions[2][0].is_nan()), (all.count, Flag::Unknown, true));
        let same = (0..all.positions.len()).filter(|k| k % all.count != 2);
        assert!(same.into_iter().all(|k| found.positions[k] == all.positions[k] && found.visible[k] == all.visible[k]));
        assert_eq!(found.pixels, all.pixels);

        let fitted = ReadOptions { size: Some([28, 14]), dense: true, ..ReadOptions::default() };
        let dense = read(opened.as_ref(), &picks(opened.as_ref()), &fitted).unwrap();
        let known = dense.positions(0, 2).unwrap().iter().filter(|p| p[0].is_finite()).count();
        assert!(known > 30, "{known}");
    }

    #[test]
    fn other_numbers_of_points_are_named() {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path());
        let path = dir.path().join("traj/rgb_00001.npz");
        made::npz(&path, &[("trajs_3d", &[1, 3], &[0.0; 3])]);
        let opened = crate::sets::open(dir.path(), None).unwrap();
        let error = read(opened.as_ref(), &picks(opened.as_ref()), &ReadOptions::default()).unwrap_err();
        assert!(error.to_string().contains("has 1 points"), "{error}");
    }
}
