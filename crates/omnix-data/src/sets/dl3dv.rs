//! DL3DV in CUT3R's preparation: photographs of a scene in which nothing moves.
//!
//! `dense/rgb/NAME.png`, `dense/cam/NAME.npz` {intrinsic 3 x 3, pose 4 x 4 camera to world}, `dense/depth/NAME.npy` (z-depth, `[H, W]`; not finite or not
//! above 0: unknown), `dense/sky_mask/NAME.png` and `dense/outlier_mask/NAME.png` (above the middle: depth unknown). All images are of one moment.
//! Unit: one of the scene's own.

use std::path::{Path, PathBuf};

use crate::posed::{Stream, mask, npy_depth};
use crate::scene::{Scene, Video, View};
use crate::set::Set;
use crate::{DataError, Unit};

pub(super) const SIGNATURE: &[&str] = &["dense/rgb"];

#[derive(Debug)]
struct Dl3dv {
    folder: PathBuf,
    stream: Stream,
    videos: [Video; 1],
}

pub(super) fn open(folder: &Path) -> Result<Box<dyn Scene>, DataError> {
    let dense = folder.join("dense");
    let stream = Stream::new("rgb", dense.join("rgb"), dense.join("cam"))?;
    let videos = [stream.video()];
    Ok(Box::new(Dl3dv { folder: folder.to_owned(), stream, videos }))
}

impl Scene for Dl3dv {
    fn set(&self) -> Set {
        Set::Dl3dv
    }

    fn path(&self) -> &Path {
        &self.folder
    }

    fn videos(&self) -> &[Video] {
        &self.videos
    }

    fn unit(&self) -> Unit {
        Unit::Scene
    }

    fn view(&self, _: usize, frame: usize) -> Result<View, DataError> {
        let mut view = self.stream.view(frame, &["intrinsic", "intrinsics"], &["pose"])?;
        let dense = self.folder.join("dense");
        let file = |kind: &str, extension| self.stream.beside(frame, &dense.join(kind), extension);
        let mut depth = npy_depth(&file("depth", "npy"), view.size())?;
        for kind in ["sky_mask", "outlier_mask"] {
            for (z, out) in depth.iter_mut().zip(mask(&file(kind, "png"), view.size())?) {
                if out {
                    *z = f32::NAN;
                }
            }
        }
        view.depth = Some(depth);
        view.moment = 0;
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
        let views: Vec<_> = (0..2).map(|f| (made::time(0, 0), made::path([28, 14], 0, f))).collect();
        let truth = made::sample([28, 14], &views);
        for image in 0..2 {
            let file =
                |kind: &str, extension: &str| dir.path().join(format!("dense/{kind}/frame_{image:05}.{extension}"));
            made::picture(&file("rgb", "png"), &truth, image);
            made::npy(&file("depth", "npy"), &[14, 28], truth.depth(image).unwrap());
            let (pose, k) = made::pose_and_intrinsics(&truth, image);
            made::npz(&file("cam", "npz"), &[("intrinsic", &[3, 3], &k), ("pose", &[4, 4], &pose)]);
            made::mask(&file("sky_mask", "png"), [28, 14], (0..28 * 14).map(|p| p == 3));
            made::mask(&file("outlier_mask", "png"), [28, 14], (0..28 * 14).map(|p| p == 5));
        }
        let opened = crate::sets::open(dir.path(), None).unwrap();
        assert_eq!(opened.set(), Set::Dl3dv);
        let sample = read(opened.as_ref(), &picks(opened.as_ref()), &Default::default()).unwrap();
        agrees(&sample, &truth, 2);
        assert!(!sample.valid(0, 3) && !sample.valid(1, 5) && sample.valid(0, 4));
        assert!(sample.times().iter().all(|time| time.moment == 0));
        std::fs::remove_dir_all(dir.path().join("dense/sky_mask")).unwrap();
        assert!(matches!(opened.view(0, 0), Err(DataError::Missing { .. })));
    }
}
