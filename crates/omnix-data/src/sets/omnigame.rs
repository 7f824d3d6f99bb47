//! OmniGame: one camera in a game, depth from its z-buffer, masks of what may move.
//!
//! `image/NAME.jpg`, `camera/NAME.npz` {intrinsic 3 x 3, camera_pose 4 x 4 camera to world}, `foreground_mask/NAME.png`, `depth/NAME.png` (16 bits, level x): with
//! d = x/65535, depth = d/(1000 - 999 d)/0.004; unknown where d < 0.0015 or d > 65500/65535. Unit: one of the scene's own.

use std::path::{Path, PathBuf};

use crate::posed::{Stream, deep_depth, moving};
use crate::scene::{Scene, Video, View};
use crate::set::Set;
use crate::{DataError, Unit};

pub(super) const SIGNATURE: &[&str] = &["image", "foreground_mask", "depth", "camera"];

#[derive(Debug)]
struct OmniGame {
    folder: PathBuf,
    stream: Stream,
    videos: [Video; 1],
}

pub(super) fn open(folder: &Path) -> Result<Box<dyn Scene>, DataError> {
    let stream = Stream::new("image", folder.join("image"), folder.join("camera"))?;
    let videos = [stream.video()];
    Ok(Box::new(OmniGame { folder: folder.to_owned(), stream, videos }))
}

impl Scene for OmniGame {
    fn set(&self) -> Set {
        Set::OmniGame
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
        let mut view = self.stream.view(frame, &["intrinsic"], &["camera_pose"])?;
        let file = |kind: &str| self.stream.beside(frame, &self.folder.join(kind), "png");
        view.depth = Some(deep_depth(&file("depth"), view.size(), depth_of)?);
        view.moving = Some(moving(&file("foreground_mask"), view.size())?);
        Ok(view)
    }
}

/// Depth of a level of the map.
fn depth_of(level: u16) -> f32 {
    let d = f64::from(level) / 65535.0;
    if d < 0.0015 || level > 65500 { f32::NAN } else { (d / (1000.0 - 999.0 * d) / 0.004) as f32 }
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
            // The inverse of the layout's formula.
            let level = |z: &f32| (65535.0 * 4.0 * z / (1.0 + 3.996 * z)).round() as u16;
            made::deep(&file("depth", "png"), [28, 14], truth.depth(image).unwrap().iter().map(level).collect());
            let moves = truth.moving(image).unwrap().iter().map(|flag| *flag == crate::Flag::Yes);
            made::mask(&file("foreground_mask", "png"), [28, 14], moves);
            let (pose, k) = made::pose_and_intrinsics(&truth, image);
            made::npz(&file("camera", "npz"), &[("intrinsic", &[3, 3], &k), ("camera_pose", &[4, 4], &pose)]);
        }
        let opened = crate::sets::open(dir.path(), None).unwrap();
        assert_eq!(opened.set(), Set::OmniGame);
        let sample = read(opened.as_ref(), &picks(opened.as_ref()), &Default::default()).unwrap();
        let rounded = sample.depth(1).unwrap().iter().zip(truth.depth(1).unwrap());
        assert!(
            rounded.clone().all(|(a, b)| (a / b - 1.0).abs() <= 0.002),
            "{:?}",
            rounded.take(3).collect::<Vec<_>>()
        );
        assert_eq!(sample.moving(1), truth.moving(1));
        agrees(&sample, &truth, usize::MAX);
    }

    #[test]
    fn levels_at_the_ends_are_unknown() {
        assert!(depth_of(98).is_nan() && depth_of(65501).is_nan());
        assert!((depth_of(99) - 0.000_378).abs() < 1e-6 && depth_of(65500) > 100.0);
    }
}
