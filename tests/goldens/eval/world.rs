//! Tracks in the world: sparse as St4RTrack scores them, dense for each source image.

use std::path::Path;

use omnix_eval::Rigid;
use omnix_eval::tracks::dense::{self, DenseScale, DenseScore, Frame, SourceImage, VideoScale};
use omnix_eval::tracks::mean_focal;
use omnix_eval::tracks::world::{WorldAlignment, WorldScore, moving, score};
use serde_json::Value;

use super::numbers::{Arrays, Lines, Within, hold, hold_all, hold_true, json, list, numbers, text};
use crate::case::Comparison;

const WITHIN: Within = Within::Absolute(1e-6);

pub(crate) fn cases(folder: &Path) -> Result<Lines, String> {
    let file = json(&folder.join("world_tracks.json"))?;
    let mut arrays = Arrays::open(&folder.join("world_tracks.npz"))?;
    let mut lines = Vec::new();
    for case in list(&file, "cases")? {
        lines.push((text(case, "name")?.to_owned(), sparse(case, &mut arrays)));
    }
    lines.push(("dense".into(), dense(&file["dense"]["expected"], &mut arrays)));
    Ok(lines)
}

fn sparse(case: &Value, arrays: &mut Arrays) -> Result<Comparison, String> {
    let name = text(case, "name")?;
    let (truth, predicted) = (arrays.points(&format!("{name}/gt"))?, arrays.points(&format!("{name}/pred"))?);
    let tracks = arrays.shape(&format!("{name}/gt"))?[1];
    let dynamic = arrays.bools(&format!("{name}/dynamic"))?;
    let mut total = Comparison::default();
    hold_true(&mut total, "what moves", moving(&truth, tracks) == dynamic);
    let mut global = f64::NAN;
    for (subset, kept) in [("all", vec![true; tracks]), ("dynamic", dynamic)] {
        let pick = |points: &[[f64; 3]]| -> Vec<[f64; 3]> {
            points.iter().enumerate().filter(|(k, _)| kept[k % tracks]).map(|(_, p)| *p).collect()
        };
        let (truth, predicted) = (pick(&truth), pick(&predicted));
        let count = kept.iter().filter(|k| **k).count();
        let expected = &case["expected"][subset];
        let modes = [
            ("global", WorldAlignment::Global),
            ("per_traj", WorldAlignment::PerTrack),
            ("sim3_closed", WorldAlignment::Similarity),
        ];
        for (mode, alignment) in modes {
            let found = score(&truth, &predicted, count, alignment).map_err(|e| e.to_string())?;
            compare(&mut total, &format!("{subset} {mode}"), &found, &expected[mode]);
            if (subset, mode) == ("all", "global") {
                global = found.alignment.scale;
            }
        }
        let kept = score(&truth, &predicted, count, WorldAlignment::Given(global)).map_err(|e| e.to_string())?;
        let want = &expected["global_scale_from_all_points"];
        hold(&mut total, &format!("{subset} scale of all, apd"), kept.apd, &want["apd"], WITHIN);
        hold(&mut total, &format!("{subset} scale of all, epe"), kept.epe, &want["epe"], WITHIN);
    }
    Ok(total)
}

fn compare(total: &mut Comparison, what: &str, found: &WorldScore, want: &Value) {
    hold(total, &format!("{what} apd"), found.apd, &want["apd"], WITHIN);
    hold(total, &format!("{what} epe"), found.epe, &want["epe"], WITHIN);
    for (k, metres) in ["0.1", "0.3", "0.5", "1.0"].into_iter().enumerate() {
        hold(total, &format!("{what} within {metres} m"), found.within[k], &want["fraction_within_m"][metres], WITHIN);
    }
    let alignment = &found.alignment;
    hold(total, &format!("{what} scale"), alignment.scale, &want["scale"], WITHIN);
    let rotation = alignment.rotation.as_flattened();
    hold_all(total, &format!("{what} rotation"), rotation, &numbers(&want["rotation_row_major"]), WITHIN);
    hold_all(total, &format!("{what} translation"), &alignment.translation, &numbers(&want["translation"]), WITHIN);
}

fn dense(expected: &Value, arrays: &mut Arrays) -> Result<Comparison, String> {
    let shape = arrays.shape("dense/gt_world")?;
    let (images, times, pixels) = (shape[0], shape[1], shape[2] * shape[3]);
    let (truth, predicted) = (arrays.points("dense/gt_world")?, arrays.points("dense/pred_world")?);
    let (foreground, valid) = (arrays.bools("dense/foreground")?, arrays.bools("dense/valid")?);
    let intrinsics = arrays.f64s("dense/intrinsics_fx_fy_cx_cy")?;
    let focal = mean_focal([intrinsics[0], intrinsics[1]]).map_err(|e| e.to_string())?;
    let poses = arrays.f64s("dense/camera_to_world")?;
    let masks = |foreground_only: bool| -> Vec<Vec<bool>> {
        let of = |image: usize| {
            let own = image * pixels..(image + 1) * pixels;
            own.map(|k| valid[k] && (foreground[k] || !foreground_only)).collect()
        };
        (0..images).map(of).collect()
    };
    let (fg, all) = (masks(true), masks(false));
    let mut total = Comparison::default();
    let view = |image: usize, foreground_only: bool| -> Result<SourceImage<'_>, String> {
        let own = image * times * pixels..(image + 1) * times * pixels;
        let matrix = &poses[16 * image..16 * (image + 1)];
        let rows = std::array::from_fn(|i| std::array::from_fn(|j| matrix[4 * i + j]));
        let pose = Rigid::from_rows(&rows).ok_or("a pose is not finite")?.inverse();
        Ok(SourceImage {
            truth: &truth[own.clone()],
            predicted: &predicted[own],
            mask: if foreground_only { &fg[image] } else { &all[image] },
            world_to_camera: pose,
            predicted_world_to_camera: pose,
            focal,
        })
    };
    let run = |image: usize, fg: bool, frame: Frame, scale: DenseScale| -> Result<DenseScore, String> {
        dense::score(&view(image, fg)?, frame, scale)
            .map_err(|e| e.to_string())?
            .ok_or_else(|| "nothing was scored".into())
    };
    for want in list(expected, "per_source_image")? {
        let image = want["source_image"].as_u64().ok_or("no source_image")? as usize;
        let (points, frame) = (text(want, "points")?, text(want, "frame")?);
        let in_world = frame == "world";
        let frame = if in_world { Frame::WorldWithItsDepth } else { Frame::SourceCamera };
        let found = run(image, points == "fg", frame, DenseScale::PerImage)?;
        let what = format!("image {image} {points} {frame:?}");
        hold(&mut total, &format!("{what} apd"), found.apd, &want["apd_depth_adaptive"], WITHIN);
        for (k, share) in found.within.iter().enumerate() {
            let name = format!("pts_within_{}", 1 << k);
            hold(&mut total, &format!("{what} {name}"), *share, &want[&name], WITHIN);
        }
        if in_world {
            hold(&mut total, &format!("{what} epe"), found.epe, &want["epe_global_median_scale"], WITHIN);
            hold(&mut total, &format!("{what} fixed"), found.apd_fixed, &want["apd_fixed_thresholds"], WITHIN);
            hold(&mut total, &format!("{what} scale"), found.scale, &want["scale"], WITHIN);
        }
    }
    let mut video = VideoScale::default();
    for image in 0..images {
        video.add(&view(image, false)?).map_err(|e| e.to_string())?;
    }
    let scale = video.scale().ok_or("no scale")?;
    for (name, fg) in [("scene_scale_fg", true), ("scene_scale_all", false)] {
        let of = |image| run(image, fg, Frame::World, DenseScale::Given(scale));
        let found = dense::pooled(&(0..images).map(of).collect::<Result<Vec<_>, _>>()?).ok_or("nothing was scored")?;
        let want = &expected[name];
        hold(&mut total, &format!("{name} scale"), found.scale, &want["scale"], WITHIN);
        hold(&mut total, &format!("{name} apd"), found.apd_fixed, &want["apd_fixed_thresholds"], WITHIN);
        hold(&mut total, &format!("{name} epe"), found.epe, &want["epe"], WITHIN);
        hold(
            &mut total,
            &format!("{name} points"),
            found.points as f64,
            &want["points_times_frames"],
            Within::Absolute(0.0),
        );
    }
    Ok(total)
}
