//! Cameras, poses, rays, alignment and the fixed codes of the networks. No device.
//!
//! Conventions: OpenCV camera axes (x right, y down, z forward). Column vectors. A pose is a 3x4 matrix `[R|t]` as three
//! rows; `w2c` maps world to camera, `c2w` camera to world. Quaternions are x, y, z, w. Intrinsics are 3x3 in pixels of
//! the picture they are used with. Lengths are in the unit of the poses given. Public signatures hold plain arrays; sums
//! are f64 inside. Source of the equations: `spec/da3.md` sections 4, 6 to 11, `spec/omnix.md` sections 3 and 4.

mod align;
mod camera;
pub mod codes;
mod error;
mod fade;
mod gaussians;
mod join;
mod path;
mod pose;
mod random;
mod rays;
mod sky;
mod unproject;

pub use align::{Agreement, AlignTo, Alignment, Similarity, agreement, align_cameras, fit_cameras, umeyama};
pub use camera::{Camera, decode_pose_code, encode_pose_code, normalise_extrinsics};
pub use error::GeometryError;
pub use fade::fade_cameras;
pub use gaussians::{GAUSSIAN_DEPTH_SHIFT, GAUSSIAN_NUMBERS, Gaussian, GaussianMaps, HARMONICS};
pub use join::{Join, JoinError, Seen, Shared};
pub use path::{Curve, camera_on_curve, look_at, orbit_camera};
pub use pose::{
    IDENTITY_POSE, Matrix3, Pose, camera_centre, compose_poses, invert_pose, pose_to_4x4, quaternion_from_rotation,
    rotation_from_quaternion, tum_from_c2w,
};
pub use rays::{RayCamera, RayMaps, cameras_from_rays, sample_table};
pub use sky::{CANONICAL_FOCAL, FARTHEST_SKY, MetricView, OPEN_SKY, SKY, fill_metric_sky, fill_sky, metric_scale};
pub use unproject::{PixelCentre, corner_rays, points_from_depth, points_from_rays, project, resize_intrinsics};

/// Unit of length of depth and positions where a network does not know the metre, as every file says it.
pub const NETWORK_UNIT: &str = "network scale (not metric)";

/// Unit of length where depth was brought to known cameras.
pub const CAMERAS_UNIT: &str = "that of the known cameras";

/// Unit of length of nested networks, and of metric ones with known focal lengths.
pub const METRES: &str = "metres";

/// Unit of length of a metric network that was not told the focal lengths.
pub const CANONICAL_UNIT: &str =
    "metres at a focal length of 300 pixels: metres = depth * f / 300, f the mean of fx and fy in pixels of these maps";
