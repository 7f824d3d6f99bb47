//! Dynamic Replica: two synchronised cameras, points tracked in the world.
//!
//! `left|right/rgb/NAME.png`, `.../depth/NAME.npy` (z-depth, `[H, W]`; not finite or not above 0: unknown), `.../foreground_mask/NAME.png`,
//! `.../cam/NAME.npz` {intrinsics 3 x 3, pose 4 x 4 camera to world}, `.../traj/NAME.npz` {traj_3d_world `[N, 3]`}: the same N points in every image. A
//! point is visible in an image where the depth there agrees with its own within 0.03. Unit: metres.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::files::Archive;
use crate::posed::{Stream, moving, npy_depth, point, shows};
use crate::scene::{Pick, Scene, Video, View};
use crate::set::Set;
use crate::{DataError, Motion, Tracks, Unit};

pub(super) const SIGNATURE: &[&str] = &["left/rgb", "left/cam"];
/// Difference of depth within which a point is seen, in metres.
const AGREES: f64 = 0.03;

#[derive(Debug)]
struct DynamicReplica {
    folder: PathBuf,
    streams: Vec<Stream>,
    videos: Vec<Video>,
}

pub(super) fn open(folder: &Path) -> Result<Box<dyn Scene>, DataError> {
    let mut streams = Vec::new();
    for side in ["left", "right"] {
        let side_folder = folder.join(side);
        if side_folder.is_dir() {
            streams.push(Stream::new(side, side_folder.join("rgb"), side_folder.join("cam"))?);
        }
    }
    let videos = streams.iter().map(Stream::video).collect();
    Ok(Box::new(DynamicReplica { folder: folder.to_owned(), streams, videos }))
}

impl DynamicReplica {
    fn file(&self, video: usize, frame: usize, kind: &str, extension: &str) -> PathBuf {
        let stream = &self.streams[video];
        stream.beside(frame, &self.folder.join(&stream.name).join(kind), extension)
    }
}

impl Scene for DynamicReplica {
    fn set(&self) -> Set {
        Set::DynamicReplica
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
        let mut view = self.streams[video].view(frame, &["intrinsics", "intrinsic"], &["pose"])?;
        view.depth = Some(npy_depth(&self.file(video, frame, "depth", "npy"), view.size())?);
        view.moving = Some(moving(&self.file(video, frame, "foreground_mask", "png"), view.size())?);
        Ok(view)
    }

    fn motion(&self, picks: &[Pick], views: &[View]) -> Result<Motion, DataError> {
        let mut tracks = Tracks::default();
        for (index, (pick, view)) in picks.iter().zip(views).enumerate() {
            let mut archive = Archive::open(&self.file(pick.video, pick.frame, "traj", "npz"))?;
            let positions = archive.array("traj_3d_world")?.expect(&[0, 3])?;
            let count = positions.shape()[0];
            if index == 0 {
                tracks.count = count;
            } else if count != tracks.count {
                return Err(positions.wrong(format!("has {count} points where the other images have {}", tracks.count)));
            }
            for values in positions.to_f64().chunks_exact(3) {
                tracks.positions.push(point(values, DVec3::ZERO));
                tracks.visible.push(shows(view, DVec3::from_slice(values), AGREES));
            }
        }
        Ok(Motion::Tracks(tracks))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Flag;
    use crate::made;
    use crate::read::{ReadOptions, read};
    use crate::sets::tests_support::{agrees, floats, picks, tracks};

    #[test]
    fn a_written_scene_is_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let views: Vec<_> = [0, 1]
            .into_iter()
            .flat_map(|v| (0..2).map(move |f| (made::time(v, f), made::path([56, 28], v, f))))
            .collect();
        let truth = made::sample([56, 28], &views);
        let chosen: Vec<usize> = (0..truth.pixels()).step_by(7).collect();
        let all = tracks(&truth, &chosen);
        let n = chosen.len();
        for (image, time) in truth.times().iter().enumerate() {
            let side = ["left", "right"][time.video as usize];
            let file =
                |kind: &str, extension: &str| dir.path().join(format!("{side}/{kind}/{:04}.{extension}", time.frame));
            made::picture(&file("rgb", "png"), &truth, image);
            made::npy(&file("depth", "npy"), &[28, 56], truth.depth(image).unwrap());
            made::mask(
                &file("foreground_mask", "png"),
                [56, 28],
                truth.moving(image).unwrap().iter().map(|f| *f == Flag::Yes),
            );
            let (pose, k) = made::pose_and_intrinsics(&truth, image);
            made::npz(&file("cam", "npz"), &[("intrinsics", &[3, 3], &k), ("pose", &[4, 4], &pose)]);
            let here = floats(&all.positions[image * n..(image + 1) * n]);
            made::npz(&file("traj", "npz"), &[("traj_3d_world", &[n as u64, 3], &here)]);
        }
        let opened = crate::sets::open(dir.path(), None).unwrap();
        assert_eq!((opened.set(), opened.videos().len()), (Set::DynamicReplica, 2));
        let sample = read(opened.as_ref(), &picks(opened.as_ref()), &ReadOptions::default()).unwrap();
        agrees(&sample, &truth, 0);
        assert_eq!(sample.moving(3), truth.moving(3));
        let Motion::Tracks(found) = sample.motion() else { panic!("no tracks") };
        assert_eq!(found.positions, all.positions);
        // By depth at the nearest pixel a few are taken wrongly at edges and on steep surfaces.
        let wrong = found.visible.iter().zip(&all.visible).filter(|(a, b)| a != b).count();
        assert!(wrong * 4 < all.visible.len(), "{wrong} of {}", all.visible.len());
        assert!(found.visible[..n].iter().all(|flag| *flag == Flag::Yes), "tracks of image 0 begin in its pixels");
        assert_eq!(sample.times()[3].moment, 1);
    }
}
