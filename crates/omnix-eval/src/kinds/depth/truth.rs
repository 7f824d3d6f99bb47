//! The truth of benchmarks of depth: where its files lie, how they are read, and which range counts.

use std::path::{Path, PathBuf};

use crate::EvalError;
use crate::depth::Range;
use crate::files::depth::{self as maps, DepthFrames, DepthMap, LAYOUTS};
use crate::files::folder;

/// Frames of a KITTI sequence that the benchmark uses.
const KITTI_FRAMES: usize = 110;

/// Whose layout the truth has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthSet {
    /// KITTI, annotated depth.
    Kitti,
    /// MPI Sintel.
    Sintel,
    /// Bonn RGB-D Dynamic.
    Bonn,
    /// Arrays, in the layouts of predictions.
    Plain,
}

impl DepthSet {
    pub(crate) fn range(self) -> Range {
        match self {
            Self::Kitti | Self::Plain => Range::KITTI,
            Self::Sintel => Range::SINTEL,
            Self::Bonn => Range::BONN,
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Kitti => "KITTI",
            Self::Sintel => "Sintel",
            Self::Bonn => "Bonn RGB-D Dynamic",
            Self::Plain => "depth arrays",
        }
    }

    pub(crate) fn read(self, path: &Path) -> Result<DepthMap, EvalError> {
        match self {
            Self::Kitti => maps::read_kitti(path),
            Self::Sintel => maps::read_sintel(path),
            Self::Bonn | Self::Plain => maps::read_tum(path),
        }
    }

    /// Name and files of each sequence of a benchmark.
    ///
    /// # Errors
    /// [`EvalError::NoSequences`]; [`EvalError::Parameter`] for arrays, which are of no pictures.
    pub(crate) fn files(self, truth: &Path) -> Result<Vec<(String, Vec<PathBuf>)>, EvalError> {
        let of = |(name, truth)| match truth {
            Truth::Files(files) => Some((name, files)),
            Truth::Frames(_) => None,
        };
        let files: Option<Vec<_>> = self.sequences(truth)?.into_iter().map(of).collect();
        let expected = "give kitti, sintel or bonn, whose pictures can be found";
        files.ok_or_else(|| EvalError::Parameter { name: "set", value: "plain".into(), expected })
    }

    /// Name and files of each sequence.
    pub(super) fn sequences(self, truth: &Path) -> Result<Vec<(String, Truth)>, EvalError> {
        let mut found = Vec::new();
        match self {
            Self::Plain => {
                for path in folder::entries(truth)? {
                    let name = if path.is_dir() { folder::name(&path) } else { folder::stem(&path) };
                    if let Ok(Some(frames)) = DepthFrames::find(truth, &name) {
                        found.push((name, Truth::Frames(frames)));
                    }
                }
            }
            Self::Kitti | Self::Sintel | Self::Bonn => {
                let extension = if self == Self::Sintel { "dpt" } else { "png" };
                for dir in std::iter::once(truth.to_owned()).chain(folder::folders(truth)?) {
                    let inner = match self {
                        Self::Kitti => [dir.join("proj_depth/groundtruth/image_02"), dir.clone()],
                        Self::Bonn => [dir.join("depth_110"), dir.join("depth")],
                        Self::Sintel | Self::Plain => [dir.clone(), dir.clone()],
                    };
                    let files = inner.iter().filter(|path| path.is_dir()).map(|path| folder::files(path, extension));
                    let mut files =
                        files.collect::<Result<Vec<_>, _>>()?.into_iter().find(|f| !f.is_empty()).unwrap_or_default();
                    if self == Self::Kitti {
                        files.truncate(KITTI_FRAMES);
                    }
                    if !files.is_empty() {
                        found.push((folder::name(&dir), Truth::Files(files)));
                    }
                }
            }
        }
        let layout = match self {
            Self::Kitti => "folders of 16-bit PNG, or DRIVE/proj_depth/groundtruth/image_02",
            Self::Sintel => "folders with frame_0001.dpt and so on",
            Self::Bonn => "folders NAME/depth_110 or NAME/depth with 16-bit PNG",
            Self::Plain => LAYOUTS,
        };
        if found.is_empty() { Err(EvalError::NoSequences { layout, path: truth.to_owned() }) } else { Ok(found) }
    }
}

/// The true depth of a sequence.
pub(super) enum Truth {
    Files(Vec<PathBuf>),
    Frames(DepthFrames),
}
