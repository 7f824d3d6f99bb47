//! Poses of files to world-to-camera matrices, checked.

use glam::{DMat3, DQuat, DVec3};

/// World-to-camera rows `[R|t]` of a rotation (a quaternion of any length) and a translation.
pub(super) fn from_quaternion([w, x, y, z]: [f64; 4], t: [f64; 3]) -> Result<[[f32; 4]; 3], &'static str> {
    let q = DQuat::from_xyzw(x, y, z, w);
    let length = q.length();
    // Files round to a few digits; a length far from one is another thing's number.
    if !(0.9..=1.1).contains(&length) {
        return Err("the quaternion's length is not 1");
    }
    rows(DMat3::from_quat(q / length), DVec3::from_array(t))
}

/// World-to-camera rows of a camera-to-world rotation and centre.
pub(super) fn from_camera_to_world(rotation: DMat3, centre: DVec3) -> Result<[[f32; 4]; 3], &'static str> {
    let turned = checked(rotation)?.transpose();
    rows(turned, -(turned * centre))
}

/// A rotation, made exact where its numbers are rounded.
fn checked(rotation: DMat3) -> Result<DMat3, &'static str> {
    if !rotation.is_finite() {
        return Err("a number of its pose is not finite");
    }
    let off = (rotation * rotation.transpose() - DMat3::IDENTITY)
        .to_cols_array()
        .into_iter()
        .fold(0.0, |m: f64, v| m.max(v.abs()));
    if off > 0.02 {
        return Err("the matrix of its pose is no rotation (its columns are not of length 1 at right angles)");
    }
    if rotation.determinant() < 0.0 {
        return Err("the matrix of its pose mirrors (its determinant is -1)");
    }
    Ok(DMat3::from_quat(DQuat::from_mat3(&rotation).normalize()))
}

fn rows(rotation: DMat3, t: DVec3) -> Result<[[f32; 4]; 3], &'static str> {
    let rows: [[f32; 4]; 3] = std::array::from_fn(|i| {
        let row = rotation.row(i);
        [row.x as f32, row.y as f32, row.z as f32, t[i] as f32]
    });
    if rows.as_flattened().iter().all(|v| v.is_finite()) { Ok(rows) } else { Err("a number of its pose is not finite") }
}
