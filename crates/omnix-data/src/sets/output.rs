//! What `omnix reconstruct --export npz` writes: `exports/npz/results.npz` {image u8 `[S, H, W, 3]`, depth `[S, H, W]`, extrinsics `[S, 3, 4]` world to
//! camera, intrinsics `[S, 3, 3]`}, with (video, frame) and seconds of every image from `manifest.json` where it is there.
//!
//! Pixel positions are whole numbers there, so the principal point moves by half a pixel. Every image has a time of its own. Unit: the
//! network's, one of the scene's own.

use std::path::{Path, PathBuf};

use omnix_io::Picture;
use omnix_tensors::read_text;
use serde_json::Value;

use crate::files::Archive;
use crate::posed::{intrinsics_of, rows};
use crate::rigid::{Pinhole, Rigid};
use crate::scene::{Scene, Video, View};
use crate::set::Set;
use crate::{DataError, Unit};

pub(super) const SIGNATURE: &[&str] = &["exports/npz/results.npz"];

#[derive(Debug)]
struct Output {
    folder: PathBuf,
    size: [usize; 2],
    images: Vec<u8>,
    depth: Vec<f32>,
    cameras: Vec<Pinhole>,
    seconds: Vec<Option<f64>>,
    videos: Vec<Video>,
    /// Index of the first image of each video.
    first: Vec<usize>,
}

pub(super) fn open(folder: &Path) -> Result<Box<dyn Scene>, DataError> {
    let mut archive = Archive::open(&folder.join(SIGNATURE[0]))?;
    let images = archive.array("image")?.expect(&[0, 0, 0, 3])?;
    let &[count, height, width, _] = images.shape() else {
        return Err(images.wrong("has no images"));
    };
    if count == 0 || height == 0 || width == 0 {
        return Err(images.wrong("has no pixels"));
    }
    let depth = archive.array("depth")?.expect(&[count, height, width])?.to_f32();
    let poses = archive.array("extrinsics")?.expect(&[count, 3, 4])?;
    let intrinsics = archive.array("intrinsics")?.expect(&[count, 3, 3])?;
    let mut cameras = Vec::with_capacity(count);
    for (pose, k) in poses.to_f64().chunks_exact(12).zip(intrinsics.to_f64().chunks_exact(9)) {
        let camera = intrinsics_of(k, Rigid::from_rows(rows(pose)));
        let mut camera = camera.map_err(|reason| intrinsics.wrong(reason))?;
        camera.principal = camera.principal.map(|c| c + crate::PIXEL.offset());
        cameras.push(camera);
    }
    let (numbers, seconds) = times(folder, count)?;
    let (mut videos, mut first) = (Vec::<Video>::new(), Vec::new());
    for (image, number) in numbers.iter().enumerate() {
        if image > 0 && numbers[image - 1] == *number {
            if let Some(video) = videos.last_mut() {
                video.frames += 1;
            }
        } else {
            videos.push(Video { name: format!("video {number}"), frames: 1 });
            first.push(image);
        }
    }
    let images = images.to_f32().into_iter().map(|v| v as u8).collect();
    Ok(Box::new(Output {
        folder: folder.to_owned(),
        size: [width, height],
        images,
        depth,
        cameras,
        seconds,
        videos,
        first,
    }))
}

/// Video index and seconds of every image.
fn times(folder: &Path, count: usize) -> Result<(Vec<u64>, Vec<Option<f64>>), DataError> {
    let path = folder.join("manifest.json");
    if !path.exists() {
        return Ok((vec![0; count], vec![None; count]));
    }
    let refuse = |reason: String| DataError::Json { reason, path: path.clone() };
    let manifest: Value = serde_json::from_str(&read_text(&path, 64 << 20)?).map_err(|e| refuse(e.to_string()))?;
    let frames = manifest.get("images").and_then(Value::as_array);
    let frames = frames.ok_or_else(|| refuse("it has no list of images".to_owned()))?;
    let done: Vec<&Value> = frames.iter().take(count).collect();
    if done.len() != count {
        return Err(refuse(format!("it has {} images where results.npz has {count}", done.len())));
    }
    let video = |frame: &&Value| frame.get("video").and_then(Value::as_u64).unwrap_or(0);
    let seconds = |frame: &&Value| frame.get("time_s").and_then(Value::as_f64);
    Ok((done.iter().map(video).collect(), done.iter().map(seconds).collect()))
}

impl Scene for Output {
    fn set(&self) -> Set {
        Set::Output
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

    fn view(&self, video: usize, frame: usize) -> Result<View, DataError> {
        let image = self.first[video] + frame;
        let pixels = self.size[0] * self.size[1];
        let data = self.images[image * pixels * 3..(image + 1) * pixels * 3].to_vec();
        Ok(View {
            image: Picture::new(self.size[0] as u32, self.size[1] as u32, data),
            camera: self.cameras[image],
            depth: Some(self.depth[image * pixels..(image + 1) * pixels].to_vec()),
            moving: None,
            moment: image as u32,
            seconds: self.seconds[image],
        })
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
        let f64s = |values: Vec<f32>| values.into_iter().map(f64::from).collect::<Vec<_>>();
        let images: Vec<f64> = truth.parts().images.iter().map(|v| f64::from(*v)).collect();
        let poses = f64s(truth.cameras().iter().flat_map(|c| c.extrinsics.into_iter().flatten()).collect());
        let half = |mut k: [[f32; 3]; 3]| {
            (k[0][2], k[1][2]) = (k[0][2] - 0.5, k[1][2] - 0.5);
            k
        };
        let intrinsics = f64s(truth.cameras().iter().flat_map(|c| half(c.intrinsics).into_iter().flatten()).collect());
        let path = dir.path().join(SIGNATURE[0]);
        let depth = f64s(truth.parts().depth.clone().unwrap());
        let arrays: [(&str, &[u64], &[f64]); 4] = [
            ("image", &[3, 14, 28, 3], &images),
            ("depth", &[3, 14, 28], &depth),
            ("extrinsics", &[3, 3, 4], &poses),
            ("intrinsics", &[3, 3, 3], &intrinsics),
        ];
        made::npz(&path, &arrays);
        let manifest =
            "{\"images\": [{\"video\": 0, \"time_s\": 0.5}, {\"video\": 1}, {\"video\": 1, \"time_s\": null}]}";
        made::text(&dir.path().join("manifest.json"), manifest);
        let opened = crate::sets::open(dir.path(), None).unwrap();
        let frames: Vec<usize> = opened.videos().iter().map(|v| v.frames).collect();
        assert_eq!((opened.set(), frames), (Set::Output, vec![1, 2]));
        let sample = read(opened.as_ref(), &picks(opened.as_ref()), &Default::default()).unwrap();
        agrees(&sample, &truth, 0);
        assert_eq!((sample.times()[0].seconds, sample.times()[2].moment), (Some(0.5), 2));

        made::text(&dir.path().join("manifest.json"), "{\"images\": []}");
        let error = crate::sets::open(dir.path(), None).unwrap_err().to_string();
        assert!(error.contains("0 images where results.npz has 3"), "{error}");
        made::npz(&path, &arrays[..3]);
        assert!(matches!(crate::sets::open(dir.path(), None), Err(DataError::NoArray { .. })));
    }
}
