//! The list of export formats. A new one is a file that states its [`Format`], and a line here.

use std::fmt;
use std::path::Path;
use std::str::FromStr;
use std::sync::LazyLock;

use super::format::{FileKind, Format, NUMBER, PLAIN, RunSize};
use super::frame::Sink;
use super::options::SinkOptions;
use super::{
    colmap, csv, depth, exr, features, glb, gs_ply, html, masks, npz, omx4d, ply, ply_seq, preview, saved_field,
    st4rtrack, tracks, transforms, tum, usda,
};
use crate::IoError;

/// Makes the list: `Variant = its format`.
macro_rules! exports {
    ($($variant:ident = $format:path,)*) => {
        /// An export format.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[non_exhaustive]
        pub enum Export {
            $(#[doc = concat!("As `output/", stringify!($format), "` states it.")] $variant,)*
        }

        impl Export {
            /// Every format, in the order in which help lists them.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// What its file states.
            pub(super) fn format(self) -> &'static Format {
                match self { $(Self::$variant => &$format,)* }
            }
        }
    };
}

exports! {
    Npz = npz::FULL,
    MiniNpz = npz::MINI,
    Depth = depth::FORMAT,
    Exr = exr::FORMAT,
    Preview = preview::FORMAT,
    Ply = ply::FORMAT,
    Glb = glb::FORMAT,
    GsPly = gs_ply::FORMAT,
    Tum = tum::FORMAT,
    Colmap = colmap::FORMAT,
    Transforms = transforms::FORMAT,
    Features = features::FORMAT,
    Tracks = tracks::FORMAT,
    Csv = csv::FORMAT,
    PlySeq = ply_seq::FORMAT,
    Usda = usda::FORMAT,
    St4rtrack = st4rtrack::FORMAT,
    Omx4d = omx4d::FORMAT,
    Masks = masks::FORMAT,
    Html = html::FORMAT,
    Field = saved_field::FORMAT,
}

/// What an export of motion is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionInput {
    /// Chosen points of all images at all times: [`super::write_motion`].
    Points,
    /// One source image after another with all its pixels: [`super::MotionStream`].
    Images,
}

impl Export {
    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.format().name
    }

    /// Whether it needs extrinsics and intrinsics, so that a network without cameras can be refused before the run.
    #[must_use]
    pub fn needs_cameras(self) -> bool {
        self.format().needs_cameras
    }

    /// Whether it states lenses of the source pictures, so that known lenses with distortion can be refused before the run.
    #[must_use]
    pub fn states_source_lenses(self) -> bool {
        self.format().states_source_lenses
    }

    /// Whether it needs a network with trajectories, so that others can be refused before the run. `glb` does without.
    #[must_use]
    pub fn needs_motion(self) -> bool {
        self.format().needs_motion
    }

    /// Whether it needs a network with a Gaussian head, so that others can be refused before the run.
    #[must_use]
    pub fn needs_gaussians(self) -> bool {
        self.format().needs_gaussians
    }

    /// Whether it needs features of the encoder, which a run makes when blocks are named.
    #[must_use]
    pub fn needs_features(self) -> bool {
        self.format().needs_features
    }

    /// Whether it can say that a point is lost, as points of films in windows may be.
    #[must_use]
    pub fn loses_points(self) -> bool {
        self.format().loses_points
    }

    /// Whether a run writes it that names no exports.
    #[must_use]
    pub fn by_default(self) -> bool {
        self.format().by_default
    }

    /// Whether it is made of the results of single images: [`open_sinks`].
    #[must_use]
    pub fn takes_frames(self) -> bool {
        self.format().frames.is_some()
    }

    /// What it takes of a run with motion; `None` if it has no use for it, or is written by the engine (`field`). `glb` is written
    /// from points when there is motion, in place of its sink's still scene.
    #[must_use]
    pub fn motion_input(self) -> Option<MotionInput> {
        self.motion_input_of(false)
    }

    /// The same; exports that can follow every pixel do so if `all_pixels`.
    #[must_use]
    pub fn motion_input_of(self, all_pixels: bool) -> Option<MotionInput> {
        let format = self.format();
        match (format.points.is_some(), format.images.is_some()) {
            (true, true) if all_pixels => Some(MotionInput::Images),
            (true, _) => Some(MotionInput::Points),
            (false, true) => Some(MotionInput::Images),
            (false, false) => None,
        }
    }

    /// Bytes it takes on disk, roughly and rather too many.
    #[must_use]
    pub fn disk_bytes(self, size: &RunSize) -> u64 {
        (self.format().disk)(size)
    }

    /// Bytes of host memory it takes at most while its file is put together, beside the pictures.
    #[must_use]
    pub fn memory_bytes(self, size: &RunSize) -> u64 {
        (self.format().memory)(size)
    }

    /// Names of all files that it may leave, from the output folder.
    #[must_use]
    pub fn files(self, size: &RunSize) -> Vec<String> {
        let kinds = self.format().files.iter();
        kinds.flat_map(|kind| (0..kind.count(size)).map(|number| kind.numbered(number))).collect()
    }

    /// The same for people: a kind of file of which there are several is "first to last".
    #[must_use]
    pub fn files_in_short(self, size: &RunSize) -> Vec<String> {
        let short = |kind: &FileKind| match kind.count(size) {
            0 => None,
            1 => Some(kind.numbered(0)),
            count => Some(format!("{} to {}", kind.numbered(0), kind.numbered(count - 1))),
        };
        self.format().files.iter().filter_map(short).collect()
    }

    /// Folders, from the output folder, in which it leaves files; the output folder itself is "".
    pub(super) fn folders(self) -> impl Iterator<Item = &'static Path> {
        self.format().files.iter().filter_map(|kind| Path::new(kind.name).parent())
    }

    /// Folders that hold many files of one kind, such as "depth".
    #[must_use]
    pub fn folders_of_many() -> Vec<&'static Path> {
        let several = |kind: &&FileKind| kind.name.contains(NUMBER) || kind.name.contains(PLAIN);
        let kinds = Self::ALL.iter().flat_map(|export| export.format().files).filter(several);
        kinds.filter_map(|kind| Path::new(kind.name).parent()).filter(|folder| *folder != Path::new("")).collect()
    }

    /// The kind of a file by its name from the output folder or from a part's in it (with forward slashes); of one that is written with and without
    /// motion the kind of that.
    pub(super) fn kind_of(name: &str, moving: bool) -> Option<&'static FileKind> {
        use super::format::Each;
        let name = within_part(name);
        let other = if moving { Each::StillRun } else { Each::MovingRun };
        let kinds = Self::ALL.iter().flat_map(|export| export.format().files);
        kinds.filter(|kind| kind.matches(name)).find(|kind| kind.each != other)
    }

    /// Whether a file of this name (from the output folder, with forward slashes) is one that some export leaves.
    #[must_use]
    pub fn leaves(name: &str) -> bool {
        Self::kind_of(name, false).or_else(|| Self::kind_of(name, true)).is_some()
    }

    /// A list such as "npz,glb" (or "npz-glb", as the reference writes it), in its order, repeats dropped.
    ///
    /// # Errors
    /// An unknown name.
    pub fn parse_list(list: &str) -> Result<Vec<Self>, IoError> {
        let mut exports = Vec::new();
        for name in list.split([',', '-']).map(str::trim).filter(|n| !n.is_empty()) {
            let export = name.parse()?;
            if !exports.contains(&export) {
                exports.push(export);
            }
        }
        Ok(exports)
    }
}

/// The folder of a part of a film, from the output folder.
#[must_use]
pub fn part_folder(part: usize) -> String {
    format!("{PART}{part:03}")
}

/// How it begins.
const PART: &str = "part_";

/// Whether this is the name of a part's folder.
pub(super) fn is_part_folder(name: &str) -> bool {
    name.strip_prefix(PART).is_some_and(|number| number.len() >= 3 && number.bytes().all(|b| b.is_ascii_digit()))
}

/// A file's name from its part's folder, if it lies in one.
fn within_part(name: &str) -> &str {
    name.split_once('/').filter(|(folder, _)| is_part_folder(folder)).map_or(name, |(_, inside)| inside)
}

impl FromStr for Export {
    type Err = IoError;

    fn from_str(name: &str) -> Result<Self, IoError> {
        static KNOWN: LazyLock<String> =
            LazyLock::new(|| Export::ALL.iter().map(|e| e.name()).collect::<Vec<_>>().join(", "));
        let found = Self::ALL.iter().copied().find(|e| e.name() == name);
        found.ok_or_else(|| IoError::UnknownName { what: "export", name: name.to_owned(), known: &KNOWN })
    }
}

impl fmt::Display for Export {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Makes the output folder, proves that it can be written to, and opens one sink for each export that is made of single images' results;
/// those that need motion are written by [`super::write_motion`] and [`super::MotionStream`].
///
/// # Errors
/// A folder that cannot be made or written to: found here, before any work.
pub fn open_sinks(exports: &[Export], dir: &Path, options: &SinkOptions) -> Result<Vec<Box<dyn Sink>>, IoError> {
    super::atomic::check_output_folder(dir)?;
    exports.iter().filter_map(|export| export.format().frames).map(|open| open(dir, options)).collect()
}
