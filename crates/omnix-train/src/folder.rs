//! Samples of data sets on disk: a scene by lot, images of it as `spec/omnix.md` 11.4 draws them, read and fitted to one size.

use std::path::{Path, PathBuf};

use omnix_data::{DataError, ReadOptions, Rule, Sample, Set, draw, read, sets};

use crate::TrainError;
use crate::random::Random;
use crate::source::Source;

/// Scenes that are tried before a sample is given up: one that is too short for a sample is left out.
const TRIES: u64 = 16;

/// A folder with scenes of one data set.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    scenes: Vec<PathBuf>,
    set: Option<Set>,
    images: u32,
    size: [u32; 2],
    shares: Option<[f64; 3]>,
    step: Option<usize>,
}

impl Folder {
    /// The scenes at or below a folder, of a set or of whichever they look like; samples have this number of images of this size.
    ///
    /// # Errors
    /// A folder that is not there or has no scene in it.
    pub fn open(path: &Path, set: Option<Set>, images: u32, size: [u32; 2]) -> Result<Self, TrainError> {
        let scenes = sets::find(path, set)?;
        Ok(Self { path: path.to_owned(), scenes, set, images, size, shares: None, step: None })
    }

    /// Other shares of one camera, several videos, photographs and a video than the data set's own; another largest step between frames.
    #[must_use]
    pub fn drawn(self, shares: Option<[f64; 3]>, step: Option<usize>) -> Self {
        Self { shares, step, ..self }
    }

    fn of_scene(&self, path: &Path, seed: u64, number: u64) -> Result<Sample, DataError> {
        let scene = sets::open(path, self.set)?;
        let mut rule = Rule::of(scene.set());
        rule.shares = self.shares.unwrap_or(rule.shares);
        rule.step = self.step.unwrap_or(rule.step);
        let picks = draw(scene.videos(), &rule, self.images as usize, seed, number)?;
        read(scene.as_ref(), &picks, &ReadOptions { size: Some(self.size), dense: true, ..ReadOptions::default() })
    }
}

impl Source for Folder {
    fn label(&self) -> String {
        self.path.display().to_string()
    }

    fn sample(&self, seed: u64, number: u64) -> Result<Sample, TrainError> {
        let mut scenes = Random::new(seed, "scene", number);
        let mut tries = 0;
        loop {
            let index = scenes.below(u32::try_from(self.scenes.len()).unwrap_or(u32::MAX));
            tries += 1;
            match self.of_scene(&self.scenes[index as usize], seed, number) {
                Err(DataError::TooFewFrames { .. }) if tries < TRIES => {}
                sample => return Ok(sample?),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use omnix_data::sets::shared;

    use super::*;
    use crate::shapes::Shapes;

    fn scenes(counts: &[u32]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        for (index, count) in (0..).zip(counts) {
            let sample = Shapes::new(*count, [42, 28]).unwrap().sample(1, index).unwrap();
            let points: Vec<(usize, usize)> = (0..40).map(|k| (k % *count as usize, 29 * k)).collect();
            shared::write(&sample, &dir.path().join(format!("scene{index}")), &points).unwrap();
        }
        dir
    }

    #[test]
    fn samples_are_functions_of_seed_and_number() {
        let dir = scenes(&[4, 5]);
        let open = || Folder::open(dir.path(), None, 3, [28, 14]).unwrap().drawn(Some([1.0, 0.0, 0.0]), Some(1));
        let (a, b) = (open().sample(3, 8).unwrap(), open().sample(3, 8).unwrap());
        assert_eq!((a.count(), a.size()), (3, [28, 14]));
        // NaN is unknown and differs from itself.
        assert_eq!(format!("{a:?}"), format!("{b:?}"));
        assert!((0..8).any(|number| open().sample(3, number).unwrap().image(0) != a.image(0)));
    }

    #[test]
    fn scenes_that_are_too_short_are_passed_over() {
        let dir = scenes(&[1, 4, 1]);
        let folder = Folder::open(dir.path(), None, 3, [28, 14]).unwrap();
        assert!((0..6).all(|number| folder.sample(1, number).unwrap().count() == 3));
        let short = Folder::open(dir.path(), None, 9, [28, 14]).unwrap();
        assert!(matches!(short.sample(1, 0), Err(TrainError::Data(DataError::TooFewFrames { wanted: 9, .. }))));
    }

    #[test]
    fn a_folder_that_vanishes_is_named() {
        let dir = scenes(&[4]);
        let folder = Folder::open(dir.path(), None, 2, [28, 14]).unwrap();
        std::fs::remove_dir_all(dir.path().join("scene0")).unwrap();
        assert!(folder.sample(1, 0).unwrap_err().to_string().contains("scene0"));
        assert!(Folder::open(&dir.path().join("none"), None, 2, [28, 14]).is_err());
    }
}
