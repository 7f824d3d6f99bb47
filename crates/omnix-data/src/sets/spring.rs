//! Spring in CUT3R's preparation: one moving camera, nothing known about motion.
//!
//! `rgb/NAME.png`, `depth/NAME.npy` (z-depth, `[H, W]`; not finite or not above 0: unknown), `cam/NAME.npz` {intrinsics 3 x 3, pose 4 x 4 camera
//! to world}. Unit: that of the files; Spring publishes metres.

use std::path::{Path, PathBuf};

use crate::posed::{Stream, npy_depth};
use crate::scene::{Scene, Video, View};
use crate::set::Set;
use crate::{DataError, Unit};

pub(super) const SIGNATURE: &[&str] = &["rgb", "depth", "cam"];

#[derive(Debug)]
struct Spring {
    folder: PathBuf,
    stream: Stream,
    videos: [Video; 1],
}

pub(super) fn open(folder: &Path) -> Result<Box<dyn Scene>, DataError> {
    let stream = Stream::new("rgb", folder.join("rgb"), folder.join("cam"))?;
    let videos = [stream.video()];
    Ok(Box::new(Spring { folder: folder.to_owned(), stream, videos }))
}

impl Scene for Spring {
    fn set(&self) -> Set {
        Set::Spring
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
        let mut view = self.stream.view(frame, &["intrinsics", "intrinsic"], &["pose"])?;
        let depth = self.stream.beside(frame, &self.folder.join("depth"), "npy");
        view.depth = Some(npy_depth(&depth, view.size())?);
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
        let truth = made::video([28, 14], 3);
        for image in 0..3 {
            let name = format!("{:04}", image + 1);
            made::picture(&dir.path().join(format!("rgb/{name}.png")), &truth, image);
            made::npy(&dir.path().join(format!("depth/{name}.npy")), &[14, 28], truth.depth(image).unwrap());
            let (pose, k) = made::pose_and_intrinsics(&truth, image);
            made::npz(
                &dir.path().join(format!("cam/{name}.npz")),
                &[("intrinsics", &[3, 3], &k), ("pose", &[4, 4], &pose)],
            );
        }
        let opened = crate::sets::open(dir.path(), None).unwrap();
        assert_eq!((opened.set(), opened.videos()[0].frames), (Set::Spring, 3));
        let sample = read(opened.as_ref(), &picks(opened.as_ref()), &Default::default()).unwrap();
        agrees(&sample, &truth, 0);

        std::fs::remove_file(dir.path().join("cam/0002.npz")).unwrap();
        let error = read(opened.as_ref(), &picks(opened.as_ref()), &Default::default()).unwrap_err();
        assert!(matches!(&error, DataError::Missing { path } if path.ends_with("cam/0002.npz")), "{error}");
        made::npy(&dir.path().join("depth/0001.npy"), &[28, 14], truth.depth(0).unwrap());
        let error = opened.view(0, 0).unwrap_err();
        assert!(matches!(error, DataError::ArrayShape { .. }), "{error}");
    }
}
