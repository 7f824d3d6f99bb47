//! Exports of motion by name: from chosen points in one call, or one source image at a time.
//!
//! A run with motion calls [`write_motion`] with the chosen points for the exports whose [`Export::motion_input`] is
//! [`MotionInput::Points`], and feeds a [`MotionStream`] for those with [`MotionInput::Images`]. `tracks` goes either way: through
//! the stream when all pixels are wanted.

use std::path::{Path, PathBuf};

use super::{
    Export,
    glb_motion::{GlbMotionOptions, write_glb_motion},
    html::{HtmlOptions, write_html},
    masks,
    motion::{MotionView, MovingPoints, SourceMotion, check_views},
    omx4d::{Omx4dOptions, write_omx4d},
    st4rtrack, tracks,
};
use crate::IoError;

/// What an export of motion is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionInput {
    /// Chosen points of all images at all times: [`write_motion`].
    Points,
    /// One source image after another with all its pixels: [`MotionStream`].
    Images,
}

/// Settings of the exports of motion.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionOptions {
    /// Name of the scene in files that have one.
    pub name: String,
    /// Images a second in files that play.
    pub fps: f64,
    /// `glb`.
    pub glb: GlbMotionOptions,
    /// `omx4d`.
    pub omx4d: Omx4dOptions,
    /// `html`.
    pub html: HtmlOptions,
}

impl Default for MotionOptions {
    fn default() -> Self {
        Self {
            name: "scene".into(),
            fps: 12.0,
            glb: GlbMotionOptions::default(),
            omx4d: Omx4dOptions::default(),
            html: HtmlOptions::default(),
        }
    }
}

impl Export {
    /// Whether it needs a network with trajectories, so that others can be refused before the run. `glb` does without.
    #[must_use]
    pub fn needs_motion(self) -> bool {
        self == Self::Field || (self != Self::Glb && self.motion_input().is_some())
    }

    /// What it takes of a run with motion; none if it has no use for it, or is written by the engine (`field`). `glb` is written from points when there is motion, in place
    /// of its sink's still scene.
    #[must_use]
    pub fn motion_input(self) -> Option<MotionInput> {
        match self {
            Self::Glb | Self::Tracks | Self::Omx4d | Self::Html => Some(MotionInput::Points),
            Self::St4rtrack | Self::Masks => Some(MotionInput::Images),
            _ => None,
        }
    }
}

/// Writes those of `exports` that are made of chosen points (`tracks`, `omx4d`, `glb`, `html`) into `dir` and returns the files'
/// paths. Others are passed over.
///
/// # Errors
/// Points that contradict each other or the images; cameras that cannot be inverted; a failure of writing.
pub fn write_motion(
    exports: &[Export],
    points: &MovingPoints,
    dir: &Path,
    options: &MotionOptions,
) -> Result<Vec<PathBuf>, IoError> {
    let mut written = Vec::new();
    for &export in exports {
        match export {
            Export::Tracks => {
                points.check(export)?;
                written.extend(tracks::write_points(dir, points)?);
            }
            Export::Omx4d => {
                let path = dir.join("scene.omx4d");
                written.push(write_omx4d(&path, &options.name, options.fps, points, &options.omx4d)?);
            }
            Export::Glb => {
                written.extend(write_glb_motion(&dir.join("scene.glb"), options.fps, points, &options.glb)?);
            }
            Export::Html => written.push(write_html(points, &options.html, &dir.join("scene.html"))?),
            _ => {}
        }
    }
    Ok(written)
}

/// Writes `masks`, `st4rtrack` and `tracks` from one source image at a time, in any order. Each file is whole when its image returns.
pub struct MotionStream {
    exports: Vec<Export>,
    views: Vec<MotionView>,
    dir: PathBuf,
    written: Vec<PathBuf>,
}

impl MotionStream {
    /// Starts the exports of the list that are written image by image; `tracks` counts among them, so leave it out of
    /// [`write_motion`]'s list then. `views` are all images.
    ///
    /// # Errors
    /// Pictures of different sizes; an output folder that cannot be written to.
    pub fn open(exports: &[Export], views: Vec<MotionView>, dir: &Path) -> Result<Self, IoError> {
        let kept = |e: &Export| matches!(e, Export::Tracks | Export::St4rtrack | Export::Masks);
        let exports: Vec<Export> = exports.iter().copied().filter(kept).collect();
        if let Some(&export) = exports.first() {
            super::check_output_folder(dir)?;
            check_views(&views, export)?;
        }
        Ok(Self { exports, views, dir: dir.to_owned(), written: Vec::new() })
    }

    /// Whether there is nothing to write.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.exports.is_empty()
    }

    /// Whether image `index` must come with the paths of its points: for `tracks` every image, for `st4rtrack` the first.
    #[must_use]
    pub fn wants_trajectory(&self, index: usize) -> bool {
        self.exports.contains(&Export::Tracks) || (index == 0 && self.exports.contains(&Export::St4rtrack))
    }

    /// Writes the files of one image.
    ///
    /// # Errors
    /// Buffers of a wrong length, paths or pixels missing where an export needs them; a failure of writing.
    pub fn image(&mut self, image: &SourceMotion<'_>) -> Result<(), IoError> {
        for export in &self.exports {
            match export {
                Export::Tracks => self.written.push(tracks::write(&self.dir, &self.views, image)?),
                Export::St4rtrack => self.written.extend(st4rtrack::write(&self.dir, &self.views, image)?),
                _ => self.written.extend(masks::write(&self.dir, &self.views, image)?),
            }
        }
        Ok(())
    }

    /// Paths of all files written.
    #[must_use]
    pub fn finish(self) -> Vec<PathBuf> {
        self.written
    }
}
