//! The Gaussian head's numbers, and the Gaussians of the world, against what was recorded.

use omnix::geometry::{Camera, GAUSSIAN_NUMBERS, Gaussian, GaussianMaps};
use omnix::graph::Executable;

use crate::case::Case;
use crate::ready::Report;

fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

pub(crate) fn compare(case: &Case, head: &Executable, size: [usize; 2], report: Report<'_>) -> Result<(), String> {
    let read = |name: &str| head.read(name).map_err(|e| format!("{name}: {e}"));
    let (numbers, depth) = (read("gaussians")?, read("depth")?);
    let all = |name: &str| case.get(name).map(|t| &t.data[..]).ok_or_else(|| format!("{name} is missing"));
    let pixels = || numbers.chunks_exact(GAUSSIAN_NUMBERS);
    let raw: Vec<f32> = pixels().flat_map(|pixel| &pixel[..GAUSSIAN_NUMBERS - 1]).copied().collect();
    report("headout.raw_gs", &raw, all("headout.raw_gs")?);
    let confidence: Vec<f32> = pixels().map(|pixel| sigmoid(pixel[GAUSSIAN_NUMBERS - 1])).collect();
    report("headout.raw_gs_conf", &confidence, all("headout.raw_gs_conf")?);

    // With the recorded cameras: those of the network are compared by themselves.
    let (extrinsics, intrinsics) = (all("out.extrinsics")?, all("out.intrinsics")?);
    let of_image = size[0] * size[1];
    let mut found: Vec<Gaussian> = Vec::new();
    let views = numbers.chunks(of_image * GAUSSIAN_NUMBERS).zip(depth.chunks(of_image)).enumerate();
    for (view, (numbers, depth)) in views {
        let camera = Camera {
            extrinsics: std::array::from_fn(|r| std::array::from_fn(|c| extrinsics[12 * view + 4 * r + c])),
            intrinsics: std::array::from_fn(|r| std::array::from_fn(|c| intrinsics[9 * view + 3 * r + c])),
        };
        found.extend(GaussianMaps { numbers, depth, size, camera }.world().map_err(|e| e.to_string())?);
    }
    let flat = |of: &dyn Fn(&Gaussian) -> Vec<f32>| found.iter().flat_map(of).collect::<Vec<f32>>();
    for (name, got) in [
        ("out.gaussians.means", flat(&|g| g.mean.to_vec())),
        ("out.gaussians.scales", flat(&|g| g.scale.to_vec())),
        ("out.gaussians.rotations", flat(&|g| g.rotation.to_vec())),
        ("out.gaussians.harmonics", flat(&|g| g.harmonics.concat())),
        ("out.gaussians.opacities", flat(&|g| vec![sigmoid(g.density)])),
    ] {
        report(name, &got, all(name)?);
    }
    Ok(())
}
