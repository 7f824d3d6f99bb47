//! Cameras, poses, rays, alignment and the fixed codes of the networks. No device.
//!
//! Conventions: OpenCV camera axes (x right, y down, z forward). Column vectors. A pose is a 3x4 matrix `[R|t]` as three
//! rows; `w2c` maps world to camera, `c2w` camera to world. Quaternions are x, y, z, w. Intrinsics are 3x3 in pixels of
//! the picture they are used with. Lengths are in the unit of the poses given. Public signatures hold plain arrays; sums
//! are f64 inside. Source of the equations: `spec/da3.md` sections 4, 6, 8 and 9, `spec/omnix.md` sections 3 and 4.

mod align;
mod camera;
pub mod codes;
mod error;
mod pose;
mod random;
mod rays;
mod unproject;

pub use align::{Agreement, AlignTo, Alignment, Similarity, agreement, align_cameras, fit_cameras, umeyama};
pub use camera::{Camera, decode_pose_code, encode_pose_code, normalise_extrinsics};
pub use error::GeometryError;
pub use pose::{
    IDENTITY_POSE, Matrix3, Pose, camera_centre, compose_poses, invert_pose, pose_to_4x4, quaternion_from_rotation,
    rotation_from_quaternion, tum_from_c2w,
};
pub use rays::{RayCamera, RayMaps, cameras_from_rays, sample_table};
pub use unproject::{PixelCentre, corner_rays, points_from_depth, points_from_rays, project, resize_intrinsics};

/// Unit of length of depth and positions where a network does not know the metre, as every file says it.
pub const NETWORK_UNIT: &str = "network scale (not metric)";
