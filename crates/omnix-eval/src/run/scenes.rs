//! Scenes of data sets as sequences: each video is one, and each of its clips a sample at the network's size.

use std::path::{Path, PathBuf};

use omnix_data::{DataError, Pick, ReadOptions, Sample, Scene, Set, read, sets};
use omnix_io::Picture;

use super::network::{Clip, Network};
use crate::EvalError;
use crate::files::folder;

/// Scenes on the disk.
#[derive(Debug, Clone, Copy)]
pub struct SceneData<'a> {
    /// A scene of a data set, or a folder with scenes.
    pub folder: &'a Path,
    /// The data set; none: that of which a folder has the parts.
    pub set: Option<Set>,
}

/// A scene that was found.
pub(super) struct Found {
    pub(super) name: String,
    pub(super) scene: Result<Box<dyn Scene>, DataError>,
}

impl SceneData<'_> {
    /// The name of the set, as far as it is known before a scene is opened.
    pub(super) fn name(&self) -> String {
        let set = self.set.map_or_else(|| "scenes".to_owned(), |set| format!("scenes of {}", set.name()));
        format!("{set}: {}", folder::name(self.folder))
    }

    /// All scenes, opened.
    ///
    /// # Errors
    /// A folder without scenes.
    pub(super) fn scenes(&self) -> Result<Vec<Found>, EvalError> {
        let places: Vec<PathBuf> = sets::find(self.folder, self.set)?;
        let name = |place: &Path| {
            let inner = place.strip_prefix(self.folder).unwrap_or(place).to_string_lossy().into_owned();
            if inner.is_empty() { folder::name(place) } else { inner }
        };
        Ok(places.iter().map(|place| Found { name: name(place), scene: sets::open(place, self.set) }).collect())
    }

    /// The videos of all scenes in order: scene and index of the video. A scene that cannot be opened has one entry, which says why.
    pub(super) fn videos(scenes: &[Found]) -> Vec<(usize, usize)> {
        let of = |(k, found): (usize, &Found)| {
            let count = found.scene.as_ref().map_or(1, |scene| scene.videos().len());
            (0..count).map(move |video| (k, video))
        };
        scenes.iter().enumerate().flat_map(of).collect()
    }
}

/// Images of a scene with what is known about them, at the size that the network takes their pictures at.
pub(super) fn sample(
    scene: &dyn Scene,
    picks: &[Pick],
    network: &dyn Network,
    dense: bool,
) -> Result<Sample, DataError> {
    // The size follows from the first picture, as it lies on the disk.
    let first = read(scene, &picks[..picks.len().min(1)], &ReadOptions::default())?;
    let size = Some(network.size(first.size()));
    read(scene, picks, &ReadOptions { size, dense, ..ReadOptions::default() })
}

/// What a network sees of a sample.
#[must_use]
pub fn clip_of(sample: &Sample) -> Clip {
    let [width, height] = sample.size();
    let picture = |image: usize| Picture::new(width, height, sample.image(image).to_vec());
    Clip {
        size: sample.size(),
        pictures: (0..sample.count()).map(picture).collect(),
        times: sample.times().iter().map(|time| (time.video, time.frame)).collect(),
    }
}

/// The images of a clip of a video, which the network is told from 0 on.
pub(super) fn picks(video: usize, frames: &[usize]) -> Vec<Pick> {
    let pick = |(k, &frame): (u32, &usize)| Pick { video, frame, as_video: 0, as_frame: k };
    (0..).zip(frames).map(pick).collect()
}
