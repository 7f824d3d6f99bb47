//! What can be wrong with ground truth. Messages name the thing and the cure, the path last.

use std::io;
use std::path::{Path, PathBuf};

use omnix_io::IoError;
use omnix_tensors::TensorError;

/// Errors of making samples and of reading data sets.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DataError {
    /// A sample without images, or with images without pixels.
    #[error("a sample of {images} images of {width} x {height} pixels: give at least one image of at least one pixel")]
    Empty {
        /// Number of images.
        images: usize,
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// A list of a sample that does not have the length which the number of images and their size ask for.
    #[error("{what} of a sample: {found} entries where its layout {layout} has {expected}")]
    Length {
        /// Which list.
        what: &'static str,
        /// Its axes.
        layout: &'static str,
        /// The length that the layout has.
        expected: usize,
        /// The length found.
        found: usize,
    },
    /// A number of a sample that breaks a convention.
    #[error("{what}[{index}] of a sample is {value}: {rule}")]
    Value {
        /// Which list.
        what: &'static str,
        /// Index of the entry, in the list's own order.
        index: usize,
        /// What it is.
        value: f64,
        /// What the convention is.
        rule: &'static str,
    },
    /// A camera that is not a pinhole camera.
    #[error("camera {image} of a sample is not valid: {reason}")]
    Camera {
        /// Index of the image.
        image: usize,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// Points too near or too far to be normalised.
    #[error("the points of a sample have the mean distance {mean} from its first camera: check the unit of its depth")]
    NoScale {
        /// Their mean distance.
        mean: f64,
    },
    /// Images that do not divide into the network's patches.
    #[error("images of {width} x {height} pixels do not divide into patches of 14 x 14: fit them to multiples of 14")]
    NotPatches {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// A picture that omnix-io does not read.
    #[error(transparent)]
    Picture(#[from] IoError),
    /// A file of named tensors that cannot be read or written.
    #[error(transparent)]
    Tensors(#[from] TensorError),
    /// A file or folder that a data set should have.
    #[error("part of the data set is not there: check that it is unpacked as a whole, or leave its scene out: {path}")]
    Missing {
        /// What is not there.
        path: PathBuf,
    },
    /// A folder or a pipe where a file should be.
    #[error("not a file: {path}")]
    NotAFile {
        /// What is there.
        path: PathBuf,
    },
    /// A failure of reading.
    #[error("cannot read: check the permissions and the disk: {path}")]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A failure of writing.
    #[error("cannot write: check the folder's permissions and the disk: {path}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// An archive of arrays that is damaged or none.
    #[error("not a readable npz archive ({reason}): copy it again from its source: {path}")]
    Archive {
        /// What was found.
        reason: String,
        /// The file.
        path: PathBuf,
    },
    /// An archive without an array that its data set should have.
    #[error("no array \"{array}\", the archive has: {found}; check which data set this is: {path}")]
    NoArray {
        /// The array's name.
        array: String,
        /// The names that are there.
        found: String,
        /// The file.
        path: PathBuf,
    },
    /// An array that cannot be used.
    #[error("array \"{array}\" {reason}: {path}")]
    Array {
        /// The array's name.
        array: String,
        /// What is wrong with it.
        reason: String,
        /// The file.
        path: PathBuf,
    },
    /// An array of another shape than its data set says.
    #[error("array \"{array}\" has the shape {found:?} where the layout has {expected}: {path}")]
    ArrayShape {
        /// The array's name.
        array: String,
        /// The shape that the layout has.
        expected: String,
        /// The shape found.
        found: Vec<usize>,
        /// The file.
        path: PathBuf,
    },
    /// A map in an OpenEXR file that cannot be used.
    #[error("not a usable depth map in OpenEXR ({reason}): {path}")]
    Exr {
        /// What is wrong with it.
        reason: String,
        /// The file.
        path: PathBuf,
    },
    /// A picture that should be a mask or a depth map.
    #[error("not a usable map of grey levels ({reason}): {path}")]
    Map {
        /// What is wrong with it.
        reason: String,
        /// The file.
        path: PathBuf,
    },
    /// A folder without pictures.
    #[error("no pictures (jpg, png, webp or bmp): check that the data set is unpacked as a whole: {path}")]
    NoPictures {
        /// The folder.
        path: PathBuf,
    },
    /// A text of JSON that cannot be used.
    #[error("not the JSON that is expected here ({reason}): {path}")]
    Json {
        /// What is wrong with it.
        reason: String,
        /// The file.
        path: PathBuf,
    },
    /// A folder that looks like no known data set.
    #[error(
        "not a scene of a known data set, found: {found}; name the set if it is one of these, or convert it: {known}: {path}"
    )]
    UnknownSet {
        /// What lies in the folder.
        found: String,
        /// The sets, and what each has.
        known: String,
        /// The folder.
        path: PathBuf,
    },
    /// Scenes of another data set than was asked for.
    #[error("no scene of {wanted}, but of {found}: name that data set, or leave it to be recognised: {path}")]
    OtherSet {
        /// The set that was asked for.
        wanted: &'static str,
        /// The sets that were found.
        found: String,
        /// The folder.
        path: PathBuf,
    },
    /// An image that the scene does not have.
    #[error("no image {frame} of video {video}: choose one that the scene has: {path}")]
    NoImage {
        /// Index of the video.
        video: usize,
        /// Index of the image.
        frame: usize,
        /// The scene.
        path: PathBuf,
    },
    /// A point that the sample does not have.
    #[error("no pixel {pixel} of image {image}: choose points inside the images")]
    NoPoint {
        /// Index of the image.
        image: usize,
        /// Index of the pixel.
        pixel: usize,
    },
    /// Pictures or maps of different sizes.
    #[error("{} x {} pixels where {} x {} are expected: {path}", found[0], found[1], expected[0], expected[1])]
    Sizes {
        /// Width and height expected.
        expected: [usize; 2],
        /// Width and height found.
        found: [usize; 2],
        /// The file or scene.
        path: PathBuf,
    },
    /// A principal point that leaves nothing to crop about it.
    #[error("the principal point {principal} lies outside of an image of {size} pixels: check the intrinsics")]
    PrincipalPoint {
        /// Where it is along this axis.
        principal: f64,
        /// Number of pixels along this axis.
        size: usize,
    },
    /// A sample that would take more memory than it may.
    #[error(
        "{images} images of {} x {} pixels take {} MiB as a sample, and {} MiB may be used: read fewer images, or at a smaller size",
        size[0], size[1], needed.div_ceil(1 << 20), most >> 20
    )]
    TooLarge {
        /// Number of images so far.
        images: usize,
        /// Width and height.
        size: [usize; 2],
        /// Bytes that they take.
        needed: u64,
        /// Bytes that they may take.
        most: u64,
    },
    /// A scene without enough images for a sample.
    #[error(
        "a sample of {wanted} images from a scene whose longest video has {longest}: ask for 1 to {longest}, or take another scene"
    )]
    TooFewFrames {
        /// Images asked for.
        wanted: usize,
        /// Images of the longest video.
        longest: usize,
    },
}

impl DataError {
    /// Wraps a failed read.
    pub(crate) fn read(path: &Path, source: io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::NotFound => Self::Missing { path: path.to_owned() },
            _ => Self::Read { path: path.to_owned(), source },
        }
    }
}
