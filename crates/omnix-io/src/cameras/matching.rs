//! Which camera belongs to which frame.

use std::collections::HashMap;
use std::path::Path;

use super::given::{GivenCamera, GivenCameras, PictureKey};
use super::lens::Lens;
use crate::IoError;
use crate::input::{InputPlan, PlannedFrame, SourceKind};

/// A frame's camera.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchedCamera {
    /// Its lens, in pixels of the frame's own picture.
    pub lens: Lens,
    /// World-to-camera `[R|t]`, OpenCV axes.
    pub world_to_camera: [[f32; 4]; 3],
}

/// Seconds between a frame and the camera that it is given at most: half of a frame at 25 frames a second.
const NEAR: f64 = 0.02;
/// Share by which the shapes of two sizes of one picture may differ, where sides were rounded.
const SHAPE: f64 = 0.01;

/// The camera of every frame: by the name of its picture, with as many of its folders as both have, or by its time.
///
/// # Errors
/// [`IoError::BadCameras`]: frames without a camera, or with two that fit alike; cameras for pictures of another shape.
pub fn match_cameras(given: &GivenCameras, plan: &InputPlan) -> Result<Vec<MatchedCamera>, IoError> {
    let bad = |reason: String| IoError::BadCameras { reason, path: given.path.clone() };
    let index = Index::new(&given.cameras);
    if given.cameras.is_empty() {
        return Err(bad("it has no cameras".to_owned()));
    }
    let (mut matched, mut without) = (Vec::with_capacity(plan.frames.len()), Vec::new());
    let mut taken: HashMap<*const GivenCamera, &PlannedFrame> = HashMap::new();
    for frame in &plan.frames {
        let video = plan.sources.iter().any(|s| s.video == frame.video && matches!(s.kind, SourceKind::Video(_)));
        match index.find(frame, video).map_err(&bad)? {
            Some(camera) => {
                let before = taken.insert(camera, frame);
                if let (Some(before), PictureKey::Name(name)) = (before, &camera.picture) {
                    let (a, b) = (before.path.display(), frame.path.display());
                    return Err(bad(format!("{a} and {b} would both have its camera {name}: leave one of them out")));
                }
                matched.push(fitted(camera, frame).map_err(&bad)?);
            }
            None => without.push(frame),
        }
    }
    let Some(first) = without.first() else { return Ok(matched) };
    let (missing, all, name) = (without.len(), plan.frames.len(), first.path.display());
    let cure = if index.by_name.is_empty() {
        "a picture's name is its time in seconds there, as in 1305031102.175304.png, or the frames are those of a video with times"
    } else {
        "name the pictures as that file does, or leave out those that it has not; frames of videos have no names"
    };
    Err(bad(format!("{missing} of {all} image(s) have no camera in it (the first: {name}): {cure}")))
}

/// The camera for the frame's own size.
fn fitted(camera: &GivenCamera, frame: &PlannedFrame) -> Result<MatchedCamera, String> {
    let own = [frame.width, frame.height];
    let of = camera.size.unwrap_or(own);
    let [a, b] = [of, own].map(|[w, h]| f64::from(w) / f64::from(h));
    if of.contains(&0) || (a / b - 1.0).abs() > SHAPE {
        return Err(format!(
            "its camera for {} is of pictures of {}x{} and this one has {}x{}: it was cropped or turned since",
            frame.path.display(),
            of[0],
            of[1],
            own[0],
            own[1]
        ));
    }
    Ok(MatchedCamera { lens: camera.lens.resized(of, own), world_to_camera: camera.world_to_camera })
}

/// Cameras by what they can be found by.
struct Index<'a> {
    /// By the picture's name without folders and ending.
    by_name: HashMap<&'a str, Vec<(&'a Path, &'a GivenCamera)>>,
    /// In order of time.
    by_time: Vec<(f64, &'a GivenCamera)>,
}

impl<'a> Index<'a> {
    fn new(cameras: &'a [GivenCamera]) -> Self {
        let (mut by_name, mut by_time): (HashMap<_, Vec<_>>, Vec<_>) = (HashMap::new(), Vec::new());
        for camera in cameras {
            match &camera.picture {
                PictureKey::Name(name) => {
                    let path = Path::new(name);
                    by_name.entry(stem(path)).or_default().push((path, camera));
                }
                PictureKey::Time(time) => by_time.push((*time, camera)),
            }
        }
        by_time.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { by_name, by_time }
    }

    fn find(&self, frame: &PlannedFrame, video: bool) -> Result<Option<&'a GivenCamera>, String> {
        let time = frame.time_s.or_else(|| stem(&frame.path).parse().ok()).filter(|_| !self.by_time.is_empty());
        if let Some(time) = time {
            return Ok(self.at(time));
        }
        if video {
            return Ok(None);
        }
        // Whole names before those that differ in their endings, then those with most folders in common.
        let closeness = |path: &Path| (path.file_name() == frame.path.file_name(), common_folders(path, &frame.path));
        let named = self.by_name.get(stem(&frame.path)).into_iter().flatten();
        let mut fitting: Vec<_> = named.map(|(path, camera)| (closeness(path), *path, *camera)).collect();
        fitting.sort_by_key(|found| std::cmp::Reverse(found.0));
        match *fitting {
            [(first, a, _), (second, b, _), ..] if first == second => {
                Err(format!("its cameras {} and {} fit {} alike", a.display(), b.display(), frame.path.display()))
            }
            [(_, _, camera), ..] => Ok(Some(camera)),
            [] => Ok(None),
        }
    }

    /// The camera nearest to a time.
    fn at(&self, time: f64) -> Option<&'a GivenCamera> {
        let after = self.by_time.partition_point(|(t, _)| *t < time);
        let near = self.by_time[after.saturating_sub(1)..].iter().take(2);
        let nearest = near.min_by(|a, b| (a.0 - time).abs().total_cmp(&(b.0 - time).abs()))?;
        ((nearest.0 - time).abs() <= NEAR).then_some(nearest.1)
    }
}

/// A name without folders and ending. (What follows the last dot of a time is no ending of it, but of the picture it is.)
pub(crate) fn stem(path: &Path) -> &str {
    path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default()
}

/// Number of folders in front of the name that two paths have in common.
pub(crate) fn common_folders(a: &Path, b: &Path) -> usize {
    let folders =
        |path: &'_ Path| path.components().rev().skip(1).map(|part| part.as_os_str().to_owned()).collect::<Vec<_>>();
    folders(a).into_iter().zip(folders(b)).take_while(|(a, b)| a == b).count()
}
