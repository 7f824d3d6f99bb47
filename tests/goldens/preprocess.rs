//! Pictures through both preparations: at most one level off, as `spec/da3.md` section 3 allows; OmniX's is exact.

use omnix::io::input::Picture;
use omnix::io::preprocess::{Da3Preprocess, OmnixPreprocess, ResizeMethod};

use crate::case::{Case, Comparison, Tensor};
use crate::collect::Folder;

pub(crate) fn run(folder: &Folder, total: &mut Comparison) -> Result<(), String> {
    if let Some(path) = folder.file("preprocess.safetensors") {
        depth_anything(&Case::open(&path)?, total)?;
    }
    if let Some(path) = folder.file("resize.safetensors") {
        omnix(&Case::open(&path)?, total)?;
    }
    Ok(())
}

fn picture(tensor: &Tensor) -> Picture {
    let [.., height, width, _] = tensor.shape[..] else { return Picture::new(0, 0, Vec::new()) };
    Picture::new(width as u32, height as u32, tensor.data.iter().map(|v| *v as u8).collect())
}

/// Enters the largest difference in levels; more than `levels` fails.
fn levels(total: &mut Comparison, what: &str, got: &Picture, want: &Picture, levels: u8) {
    if (got.width, got.height) != (want.width, want.height) {
        total.failures.push(format!("{what}: {}x{}, recorded {}x{}", got.width, got.height, want.width, want.height));
        return;
    }
    let worst = got.data.iter().zip(&want.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
    total.tensors += 1;
    if worst > levels {
        total.failures.push(format!("{what}: {worst} levels off, {levels} allowed"));
    }
}

fn depth_anything(case: &Case, total: &mut Comparison) -> Result<(), String> {
    for (name, input) in case.tensors.iter().filter(|(n, _)| n.ends_with(".in_rgb")) {
        let stem = name.trim_end_matches(".in_rgb");
        let mut parts = stem.split('.').skip(1);
        let method: ResizeMethod = parts.next().ok_or("no method")?.parse().map_err(|_| format!("{name}: method"))?;
        let process_res = parts.next().and_then(|p| p.parse().ok()).ok_or_else(|| format!("{name}: resolution"))?;
        let want = case.get(&format!("{stem}.out_rgb")).ok_or_else(|| format!("{stem}.out_rgb is missing"))?;
        let got = Da3Preprocess { process_res, method }.apply(&picture(input), None).map_err(|e| e.to_string())?;
        levels(total, stem, &got.picture, &picture(want), 1);
    }
    Ok(())
}

fn omnix(case: &Case, total: &mut Comparison) -> Result<(), String> {
    for (name, input) in case.tensors.iter().filter(|(n, _)| n.ends_with(".input")) {
        let stem = name.trim_end_matches(".input");
        let want = picture(case.get(&format!("{stem}.output")).ok_or_else(|| format!("{stem}.output is missing"))?);
        let settings = OmnixPreprocess { width: want.width, height: want.height };
        let got = settings.apply(&picture(input)).map_err(|e| e.to_string())?;
        levels(total, stem, &got, &want, 0);
    }
    Ok(())
}
