//! Cameras, poses, rays, alignment and the fixed codes of the networks. No device.
//!
//! Conventions: OpenCV camera axes (x right, y down, z forward). Column vectors. A pose is a 3x4 matrix `[R|t]` as three
//! rows; `w2c` maps world to camera, `c2w` camera to world. Quaternions are x, y, z, w. Intrinsics are 3x3 in pixels of
//! the picture they are used with. Lengths are in the unit of the poses given. Public signatures hold plain arrays; sums
//! are f64 inside.

pub mod codes;
