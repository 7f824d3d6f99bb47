//! The files that data sets are made of, read without trust: arrays, pictures, depth maps, lists of frames.

mod exr;
mod list;
mod npy;
mod npz;
mod picture;

pub(crate) use self::exr::read_exr;
pub(crate) use list::{expect_folder, files_with, folders, stem};
pub(crate) use npy::Array;
pub(crate) use npz::{Archive, read_npy};
pub(crate) use picture::{read_grey, read_rgb};

/// A file, or an array in one, may not take more memory than this.
pub(crate) const MOST: u64 = 4 << 30;
