//! The truth of a scene, from a folder of archives of tracks or from a sample.

use std::path::{Path, PathBuf};

use omnix_data::{Flag, Motion, Sample};

use crate::files::tracks::{self, PixelSet, SourceTracks};
use crate::{EvalError, Rigid};

/// Where a run lies, for messages.
pub(super) const LAYOUT: &str = "a folder NAME of an omnix run with --export tracks, or with its archives NNNNNN.npz";

/// The truth of a scene, given a source image at a time.
pub trait SceneTruth {
    /// Images, which are also the times.
    fn images(&self) -> usize;

    /// Width and height.
    fn size(&self) -> [usize; 2];

    /// World-to-camera of each image.
    ///
    /// # Errors
    /// As its files have them.
    fn poses(&self) -> Result<Vec<Rigid>, EvalError>;

    /// fx and fy of an image, pixels.
    ///
    /// # Errors
    /// As its files have them.
    fn focal(&self, image: usize) -> Result<[f64; 2], EvalError>;

    /// Where each pixel of an image is at each time, `[T][P]`, not finite where unknown; and which pixels move.
    ///
    /// # Errors
    /// As its files have them.
    fn source(&self, image: usize) -> Result<(Vec<[f64; 3]>, Vec<bool>), EvalError>;
}

/// A folder of archives of tracks of all pixels, one for each image.
#[derive(Debug)]
pub struct TruthFolder {
    archives: Vec<PathBuf>,
    first: SourceTracks,
    size: [usize; 2],
}

impl TruthFolder {
    /// Opens a folder.
    ///
    /// # Errors
    /// [`EvalError::Counts`] unless there is an archive for each image, [`EvalError::Format`] for archives of chosen pixels.
    pub fn open(dir: &Path) -> Result<Self, EvalError> {
        let archives = tracks::archives(dir)?;
        let Some(path) = archives.first() else {
            return Err(EvalError::NoSequences { layout: LAYOUT, path: dir.to_owned() });
        };
        let first = tracks::read(path)?;
        let PixelSet::All(size) = first.pixels else {
            return Err(EvalError::format("truth", "it has chosen pixels; truth needs all (--all-tracks)", path));
        };
        for (index, path) in archives.iter().enumerate() {
            if tracks::source_index(path)? != index {
                return Err(EvalError::format("truth", format!("the archive of image {index} is missing"), path));
            }
        }
        if archives.len() != first.times {
            let reason = format!("{} archives of {} images", archives.len(), first.times);
            return Err(EvalError::format("truth", reason, dir));
        }
        Ok(Self { archives, first, size })
    }
}

impl SceneTruth for TruthFolder {
    fn images(&self) -> usize {
        self.archives.len()
    }

    fn size(&self) -> [usize; 2] {
        self.size
    }

    fn poses(&self) -> Result<Vec<Rigid>, EvalError> {
        Ok(self.first.extrinsics.clone())
    }

    fn focal(&self, image: usize) -> Result<[f64; 2], EvalError> {
        Ok(self.first.focal[image])
    }

    fn source(&self, image: usize) -> Result<(Vec<[f64; 3]>, Vec<bool>), EvalError> {
        let found = tracks::read(&self.archives[image])?;
        if found.times != self.images() || found.pixels != PixelSet::All(self.size) {
            let reason = "it differs in size or times from the first image's";
            return Err(EvalError::format("truth", reason, &self.archives[image]));
        }
        let missing = || EvalError::format("truth", "it does not say what moves (`moving`)", &self.archives[image]);
        Ok((found.points, found.moving.ok_or_else(missing)?))
    }
}

/// A sample of ground truth with dense paths.
#[derive(Debug)]
pub struct TruthSample<'a>(pub &'a Sample);

impl SceneTruth for TruthSample<'_> {
    fn images(&self) -> usize {
        self.0.count()
    }

    fn size(&self) -> [usize; 2] {
        self.0.size().map(|side| side as usize)
    }

    fn poses(&self) -> Result<Vec<Rigid>, EvalError> {
        let pose = |camera: &omnix_geometry::Camera| Rigid::from_rows(&camera.extrinsics.map(|row| row.map(f64::from)));
        let poses: Option<Vec<Rigid>> = self.0.cameras().iter().map(pose).collect();
        poses.ok_or(EvalError::Nothing { reason: "a camera of the truth is not finite".into() })
    }

    fn focal(&self, image: usize) -> Result<[f64; 2], EvalError> {
        let k = self.0.cameras()[image].intrinsics;
        Ok([f64::from(k[0][0]), f64::from(k[1][1])])
    }

    fn source(&self, image: usize) -> Result<(Vec<[f64; 3]>, Vec<bool>), EvalError> {
        let parts = self.0.parts();
        let (Motion::Dense(dense), Some(moving)) = (&parts.motion, &parts.moving) else {
            let reason = "the truth has no paths of all pixels, or does not say what moves".to_owned();
            return Err(EvalError::Nothing { reason });
        };
        let (pixels, points) = (self.0.pixels(), self.0.pixels() * self.0.count());
        let own = &dense.positions[image * points..(image + 1) * points];
        let moves = moving[image * pixels..(image + 1) * pixels].iter().map(|flag| *flag == Flag::Yes);
        Ok((own.iter().map(|p| p.map(f64::from)).collect(), moves.collect()))
    }
}
