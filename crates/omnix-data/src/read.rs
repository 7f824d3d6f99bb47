//! Chosen images of a scene as one [`Sample`].

use crate::dense::rasterise;
use crate::fit::fit;
use crate::rigid::Rigid;
use crate::scene::{Pick, Scene, View};
use crate::{DataError, Flag, Sample, SampleParts, Time};

/// How images become a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadOptions {
    /// Width and height that images are fitted to, multiples of 14; none keeps them as they are.
    pub size: Option<[u32; 2]>,
    /// Makes dense paths of tracks: each track belongs to the pixel that it falls on in each image that shows it.
    pub dense: bool,
    /// Bytes that a sample may take.
    pub most: u64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { size: None, dense: false, most: 4 << 30 }
    }
}

/// Reads the chosen images of a scene as one sample.
///
/// # Errors
/// Images that do not exist or have different sizes, a sample that would take more memory than allowed, and whatever can be wrong
/// with the files.
pub fn read(scene: &dyn Scene, picks: &[Pick], options: &ReadOptions) -> Result<Sample, DataError> {
    let mut views = Vec::with_capacity(picks.len());
    let origin = scene.origin()?;
    for pick in picks {
        let known = scene.videos().get(pick.video).is_some_and(|video| pick.frame < video.frames);
        if !known {
            return Err(DataError::NoImage { video: pick.video, frame: pick.frame, path: scene.path().to_owned() });
        }
        let mut view = scene.view(pick.video, pick.frame)?;
        if let Some(size) = options.size {
            view = fit(view, size)?;
        }
        // The centre moves: x' = x - origin, so t' = t + R origin.
        view.camera.w2c = view.camera.w2c.after(Rigid { rotation: glam::DMat3::IDENTITY, translation: origin });
        views.push(view);
        check_size(&views, options, scene)?;
    }
    let motion = scene.motion(picks, &views)?;
    let size = views.first().map_or([0, 0], |view| [view.image.width, view.image.height]);
    let all = |part: fn(&View) -> Option<usize>| views.iter().any(|view| part(view).is_some());
    let has_depth = all(|view| view.depth.as_ref().map(Vec::len));
    let has_moving = all(|view| view.moving.as_ref().map(Vec::len));
    let pixels = size[0] as usize * size[1] as usize;
    let mut parts = SampleParts {
        size,
        images: Vec::with_capacity(views.len() * pixels * 3),
        times: Vec::new(),
        cameras: Vec::new(),
        depth: has_depth.then(Vec::new),
        moving: has_moving.then(Vec::new),
        motion,
        unit: scene.unit(),
    };
    for (view, pick) in views.into_iter().zip(picks) {
        let View { image, camera, depth, moving, moment, seconds } = view;
        parts.images.extend(image.data);
        parts.times.push(Time { video: pick.as_video, frame: pick.as_frame, moment, seconds });
        parts.cameras.push(camera.to_camera());
        if let Some(all) = &mut parts.depth {
            let known = |z: f32| if z.is_finite() && z > 0.0 { z } else { f32::NAN };
            all.extend(depth.unwrap_or_else(|| vec![f32::NAN; pixels]).into_iter().map(known));
        }
        if let Some(all) = &mut parts.moving {
            all.extend(moving.unwrap_or_else(|| vec![Flag::Unknown; pixels]));
        }
    }
    let sample = Sample::new(parts)?;
    if options.dense { rasterise(sample) } else { Ok(sample) }
}

/// All images have one size, and together, with dense paths where there may be any, they fit the memory.
fn check_size(views: &[View], options: &ReadOptions, scene: &dyn Scene) -> Result<(), DataError> {
    let (Some(first), Some(last)) = (views.first(), views.last()) else {
        return Ok(());
    };
    if first.size() != last.size() {
        let (expected, found) = (first.size(), last.size());
        return Err(DataError::Sizes { expected, found, path: scene.path().to_owned() });
    }
    let count = views.len() as u64;
    let pixels = (first.size()[0] * first.size()[1]) as u64;
    let paths = if options.dense || scene.set().has_dense_paths() { count * count * 13 } else { 0 };
    let needed = pixels.saturating_mul(paths + count * 8);
    if needed > options.most {
        return Err(DataError::TooLarge { images: views.len(), size: first.size(), needed, most: options.most });
    }
    Ok(())
}
