//! HOI4D: one hand-held camera, measured depth, nothing known about motion.
//!
//! `image/NAME.jpg`, `depth/NAME.png` (16 bits, millimetres as HOI4D publishes it, 0: unknown), `camera/NAME.npz` {intrinsic 3 x 3, camera_pose 4 x 4 camera
//! to world}. Unit: metres.

use std::path::{Path, PathBuf};

use crate::posed::{Stream, deep_depth};
use crate::scene::{Scene, Video, View};
use crate::set::Set;
use crate::{DataError, Unit};

pub(super) const SIGNATURE: &[&str] = &["image", "depth", "camera"];

#[derive(Debug)]
struct Hoi4d {
    folder: PathBuf,
    stream: Stream,
    videos: [Video; 1],
}

pub(super) fn open(folder: &Path) -> Result<Box<dyn Scene>, DataError> {
    let stream = Stream::new("image", folder.join("image"), folder.join("camera"))?;
    let videos = [stream.video()];
    Ok(Box::new(Hoi4d { folder: folder.to_owned(), stream, videos }))
}

impl Scene for Hoi4d {
    fn set(&self) -> Set {
        Set::Hoi4d
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
        let mut view = self.stream.view(frame, &["intrinsic"], &["camera_pose"])?;
        let depth = self.stream.beside(frame, &self.folder.join("depth"), "png");
        view.depth = Some(deep_depth(&depth, view.size(), |level| f32::from(level) / 1000.0)?);
        Ok(view)
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
            let file = |kind: &str, extension: &str| dir.path().join(format!("{kind}/{image:05}.{extension}"));
            made::picture(&file("image", "png"), &truth, image);
            let levels = truth.depth(image).unwrap().iter().map(|z| (z * 1000.0).round() as u16);
            made::deep(&file("depth", "png"), [28, 14], levels.collect());
            let (pose, k) = made::pose_and_intrinsics(&truth, image);
            made::npz(&file("camera", "npz"), &[("intrinsic", &[3, 3], &k), ("camera_pose", &[4, 4], &pose)]);
        }
        let opened = crate::sets::open(dir.path(), None).unwrap();
        assert_eq!(opened.set(), Set::Hoi4d);
        let sample = read(opened.as_ref(), &picks(opened.as_ref()), &Default::default()).unwrap();
        let rounded = sample.depth(1).unwrap().iter().zip(truth.depth(1).unwrap());
        assert!(rounded.clone().all(|(a, b)| (a - b).abs() <= 0.000_51));
        agrees(&sample, &truth, usize::MAX);
        // Depth of 8 bits is no depth.
        made::mask(&dir.path().join("depth/00000.png"), [28, 14], vec![true; 28 * 14]);
        let error = opened.view(0, 0).unwrap_err().to_string();
        assert!(error.contains("8 bits"), "{error}");
    }
}
