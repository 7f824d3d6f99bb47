//! The readers of data sets against arrays read by others.

use std::path::Path;

use omnix_eval::files::camera::{read_sintel, read_sintel_sequence, read_tum, read_tum_list, read_tum_sequence};
use omnix_eval::files::depth::{self, DepthMap};
use omnix_eval::pose::associate_greedily;
use omnix_eval::{EvalError, Rigid};

use super::numbers::{Arrays, Lines, Within, hold_all, json, list, numbers};
use crate::case::Comparison;

pub(crate) fn cases(folder: &Path) -> Result<Lines, String> {
    let files = folder.join("files");
    let mut arrays = Arrays::open(&folder.join("depth.npz"))?;
    Ok(vec![
        ("depth".into(), maps(&files, &mut arrays)),
        ("sintel_cam".into(), sintel(&files, &mut arrays)),
        ("association".into(), association(&files)),
    ])
}

/// Reads a depth map of a data set.
type Reader = fn(&Path) -> Result<DepthMap, EvalError>;

fn maps(files: &Path, arrays: &mut Arrays) -> Result<Comparison, String> {
    let mut total = Comparison::default();
    let readers: [(&str, &str, Reader); 3] = [
        ("kitti_depth.png", "kitti_depth", depth::read_kitti),
        ("rgbd_depth_5000.png", "rgbd_depth_5000", depth::read_tum),
        ("sintel.dpt", "sintel_dpt", depth::read_sintel),
    ];
    for (file, name, read) in readers {
        let found = read(&files.join(file)).map_err(|e| e.to_string())?;
        let shape = arrays.shape(&format!("files/{name}"))?;
        if shape != [found.size[1], found.size[0]] {
            return Err(format!("{name} is {:?}, recorded {shape:?}", found.size));
        }
        total.compare(name, &found.depth, &arrays.f32s(&format!("files/{name}"))?, 1e-7, true);
    }
    Ok(total)
}

fn sintel(files: &Path, arrays: &mut Arrays) -> Result<Comparison, String> {
    let mut total = Comparison::default();
    let exact = Within::Absolute(0.0);
    let camera = read_sintel(&files.join("sintel_cam/frame_0003.cam")).map_err(|e| e.to_string())?;
    let want = arrays.f64s("files/sintel_cam_3_intrinsics")?;
    hold_all(&mut total, "intrinsics", camera.intrinsics.as_flattened(), &want, exact);
    let want = arrays.f64s("files/sintel_cam_3_world_to_camera")?;
    hold_all(&mut total, "world to camera", camera.world_to_camera.as_flattened(), &want, exact);
    let found = read_sintel_sequence(&files.join("sintel_cam")).map_err(|e| e.to_string())?;
    hold_all(&mut total, "times", &found.stamps, &arrays.f64s("files/sintel_traj_time")?, exact);
    let want = arrays.f64s("files/sintel_traj_xyz_wxyz")?;
    for (row, pose) in want.chunks_exact(7).zip(&found.poses) {
        hold_all(&mut total, "position", &pose.translation(), &row[..3], Within::Absolute(1e-9));
        let other = Rigid::from_quaternion([0.0; 3], [row[4], row[5], row[6], row[3]]).ok_or("no rotation")?;
        hold_all(
            &mut total,
            "rotation",
            pose.rotation_rows().as_flattened(),
            other.rotation_rows().as_flattened(),
            Within::Absolute(1e-7),
        );
    }
    Ok(total)
}

fn association(files: &Path) -> Result<Comparison, String> {
    let mut total = Comparison::default();
    let expected = json(&files.join("association_expected.json"))?;
    let tolerance = expected["max_difference_s"].as_f64().ok_or("no max_difference_s")?;
    let pictures = read_tum_list(&files.join("rgb.txt")).map_err(|e| e.to_string())?;
    let stamps: Vec<f64> = pictures.iter().map(|(stamp, _)| *stamp).collect();
    let truth = read_tum(&files.join("groundtruth.txt")).map_err(|e| e.to_string())?;
    let pairs = associate_greedily(&stamps, &truth.stamps, tolerance);
    let found: Vec<f64> = pairs.iter().flat_map(|&(i, k)| [stamps[i], truth.stamps[k]]).collect();
    let flat =
        |name: &str| -> Result<Vec<f64>, String> { Ok(list(&expected, name)?.iter().flat_map(numbers).collect()) };
    hold_all(&mut total, "matches", &found, &flat("matches")?, Within::Absolute(0.0));
    let sequence = read_tum_sequence(files).map_err(|e| e.to_string())?;
    let kept = flat("after_stride_3_first_90")?;
    let want: Vec<f64> = kept.iter().copied().step_by(2).collect();
    hold_all(&mut total, "every third", &sequence.stamps, &want, Within::Absolute(0.0));
    Ok(total)
}
