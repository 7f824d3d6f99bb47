//! The host's tables and cameras: `geometry`, `posembed`, `raypose`.

use omnix::Camera;
use omnix::geometry::{
    RayMaps, cameras_from_rays, codes::position_rows, decode_pose_code, encode_pose_code, normalise_extrinsics,
    rotation_from_quaternion, umeyama,
};

use crate::case::{Case, Comparison};
use crate::collect::Folder;

const LIMIT: f64 = 1e-4;
/// The reference's own ray solve in f32 is this far from exact (`spec/da3.md` section 19).
const RAY_LIMIT: f64 = 1e-3;

pub(crate) fn run(folder: &Folder, total: &mut Comparison) -> Result<(), String> {
    for (name, check) in [
        ("geometry.safetensors", cameras as fn(&Case, &mut Comparison) -> Result<(), String>),
        ("posembed.safetensors", positions),
        ("raypose.safetensors", rays),
    ] {
        if let Some(path) = folder.file(name) {
            check(&Case::open(&path)?, total)?;
        }
    }
    Ok(())
}

fn data<'a>(case: &'a Case, name: &str) -> Result<&'a [f32], String> {
    Ok(&case.get(name).ok_or_else(|| format!("{name} is missing"))?.data)
}

/// Poses stored as 3x4 or 4x4 matrices.
fn poses(case: &Case, name: &str) -> Result<Vec<[[f32; 4]; 3]>, String> {
    let tensor = case.get(name).ok_or_else(|| format!("{name} is missing"))?;
    let rows = tensor.shape[tensor.shape.len() - 2];
    let one = |m: &[f32]| std::array::from_fn(|r| std::array::from_fn(|c| m[4 * r + c]));
    Ok(tensor.data.chunks_exact(rows * 4).map(one).collect())
}

fn matrices(case: &Case, name: &str) -> Result<Vec<[[f32; 3]; 3]>, String> {
    let one = |m: &[f32]| std::array::from_fn(|r| std::array::from_fn(|c| m[3 * r + c]));
    Ok(data(case, name)?.chunks_exact(9).map(one).collect())
}

fn cameras(case: &Case, total: &mut Comparison) -> Result<(), String> {
    let quaternions = data(case, "quat.in_xyzw")?;
    let turned: Vec<f32> =
        quaternions.as_chunks().0.iter().flat_map(|q| rotation_from_quaternion(*q).concat()).collect();
    total.compare("quat.matrix", &turned, data(case, "quat.matrix")?, LIMIT, true);

    let size = data(case, "enc.hw")?;
    let (height, width) = (size[0] as u32, size[1] as u32);
    let (w2c, k) = (poses(case, "enc.w2c")?, matrices(case, "enc.intrinsics")?);
    let given =
        w2c.iter().zip(&k).map(|(extrinsics, intrinsics)| Camera { extrinsics: *extrinsics, intrinsics: *intrinsics });
    let codes: Vec<f32> = given.flat_map(|c| encode_pose_code(&c, height, width)).collect();
    total.compare("enc.pose", &codes, data(case, "enc.pose")?, LIMIT, true);
    let decoded: Vec<Camera> =
        data(case, "enc.pose")?.as_chunks::<9>().0.iter().map(|code| decode_pose_code(*code, height, width)).collect();
    let flat = |all: &[[[f32; 4]; 3]]| all.as_flattened().as_flattened().to_vec();
    let found: Vec<_> = decoded.iter().map(|c| c.extrinsics).collect();
    total.compare("dec.w2c", &flat(&found), &flat(&poses(case, "dec.w2c")?), LIMIT, true);
    let normalised = normalise_extrinsics(&w2c).map_err(|e| e.to_string())?;
    total.compare("norm.w2c", &flat(&normalised), &flat(&poses(case, "norm.w2c")?), LIMIT, true);

    let centres = |name: &str| -> Result<Vec<[f64; 3]>, String> {
        Ok(poses(case, name)?.iter().map(|p| omnix::geometry::camera_centre(p).map(f64::from)).collect())
    };
    let found = umeyama(&centres("umeyama.est_w2c")?, &centres("umeyama.ref_w2c")?).map_err(|e| e.to_string())?;
    let aligned: Vec<_> = poses(case, "umeyama.est_w2c")?.iter().map(|p| found.apply_to_w2c(p)).collect();
    total.compare("umeyama.aligned_w2c", &flat(&aligned), &flat(&poses(case, "umeyama.aligned_w2c")?), LIMIT, true);
    total.compare("umeyama.scale", &[found.scale as f32], data(case, "umeyama.scale")?, LIMIT, true);
    Ok(())
}

fn positions(case: &Case, total: &mut Comparison) -> Result<(), String> {
    let Some(table) = case.get("posembed.37x37") else { return Ok(()) };
    let channels = *table.shape.last().ok_or("posembed.37x37 has no shape")?;
    for (name, rows) in &case.tensors {
        let grid = name.strip_prefix("posembed.").and_then(|g| g.split_once('x')).ok_or("a name without a grid")?;
        let side = |s: &str| s.parse::<usize>().map_err(|e| e.to_string());
        let found = position_rows(&table.data, 37, channels, side(grid.0)?, side(grid.1)?);
        total.compare(name, &found, &rows.data, LIMIT, true);
    }
    Ok(())
}

fn rays(case: &Case, total: &mut Comparison) -> Result<(), String> {
    let ray = case.get("in.ray").ok_or("in.ray is missing")?;
    let image = data(case, "in.image_hw")?;
    let ranks: Vec<u32> = data(case, "in.sample_table")?.iter().map(|r| *r as u32).collect();
    let maps = RayMaps { rays: &ray.data, confidence: data(case, "in.ray_conf")?, size: [ray.shape[2], ray.shape[3]] };
    let found = cameras_from_rays(&maps, [image[0] as u32, image[1] as u32], Some(ranks.as_chunks().0))
        .map_err(|e| e.to_string())?;
    let extrinsics: Vec<f32> = found.iter().flat_map(|c| c.camera.extrinsics.concat()).collect();
    let intrinsics: Vec<f32> = found.iter().flat_map(|c| c.camera.intrinsics.concat()).collect();
    // Rays come from an f32 solve: they pass at their own limit and stay out of the headline.
    total.compare("raypose extrinsics", &extrinsics, data(case, "out.extrinsics")?, RAY_LIMIT, false);
    total.compare("raypose intrinsics", &intrinsics, data(case, "out.intrinsics")?, RAY_LIMIT, false);
    Ok(())
}
