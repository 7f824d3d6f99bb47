//! Stereo4D: the left camera of stereo videos, its poses alone. Its trajectories are not read: training does not use them.
//!
//! `cam_left/image/NAME.jpg`, `cam_left/camera/NAME.npz` {intrinsic 3 x 3, camera_pose 4 x 4 camera to world}, `cam_left/trajectory/`. Unit: metres.

use std::path::{Path, PathBuf};

use crate::posed::Stream;
use crate::scene::{Scene, Video, View};
use crate::set::Set;
use crate::{DataError, Unit};

pub(super) const SIGNATURE: &[&str] = &["cam_left"];

#[derive(Debug)]
struct Stereo4d {
    folder: PathBuf,
    stream: Stream,
    videos: [Video; 1],
}

pub(super) fn open(folder: &Path) -> Result<Box<dyn Scene>, DataError> {
    let left = folder.join("cam_left");
    let stream = Stream::new("cam_left", left.join("image"), left.join("camera"))?;
    let videos = [stream.video()];
    Ok(Box::new(Stereo4d { folder: folder.to_owned(), stream, videos }))
}

impl Scene for Stereo4d {
    fn set(&self) -> Set {
        Set::Stereo4d
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
        self.stream.view(frame, &["intrinsic"], &["camera_pose"])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;
    use crate::read::read;
    use crate::sets::tests_support::{agrees, picks};

    #[test]
    fn a_written_scene_is_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let truth = made::video([28, 14], 2);
        for image in 0..2 {
            let file = |kind: &str, extension: &str| dir.path().join(format!("cam_left/{kind}/{image:05}.{extension}"));
            made::picture(&file("image", "png"), &truth, image);
            let (pose, k) = made::pose_and_intrinsics(&truth, image);
            made::npz(&file("camera", "npz"), &[("intrinsic", &[3, 3], &k), ("camera_pose", &[3, 4], &pose[..12])]);
        }
        let opened = crate::sets::open(dir.path(), None).unwrap();
        assert_eq!(opened.set(), Set::Stereo4d);
        let sample = read(opened.as_ref(), &picks(opened.as_ref()), &Default::default()).unwrap();
        assert!(sample.depth(0).is_none() && sample.moving(0).is_none());
        agrees(&sample, &truth, usize::MAX);
        made::npz(&dir.path().join("cam_left/camera/00001.npz"), &[("camera_pose", &[3, 4], &[0.0; 12])]);
        assert!(matches!(opened.view(0, 1), Err(DataError::NoArray { .. })));
    }
}
