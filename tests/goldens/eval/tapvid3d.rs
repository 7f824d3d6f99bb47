//! TAPVid-3D: metrics of recorded clips, and whole folders of files.

use std::path::Path;

use omnix_eval::files::tapvid3d::{ClipTruth, read_prediction, read_truth};
use omnix_eval::kinds::tapvid3d::{Options, evaluate};
use omnix_eval::tracks::Thresholds;
use omnix_eval::tracks::tapvid3d::{Clip, NEIGHBOURHOOD, Scaling, TrackMetrics, score, score_tracks};
use omnix_eval::tracks::world::{relative_to_first, to_first_camera};
use serde_json::Value;

use super::numbers::{Arrays, Lines, Within, hold, hold_all, hold_true, json, list, numbers, object, text};
use crate::case::Comparison;

pub(crate) fn cases(folder: &Path) -> Result<Lines, String> {
    let file = json(&folder.join("tapvid3d_metrics.json"))?;
    let mut arrays = Arrays::open(&folder.join("tapvid3d_metrics.npz"))?;
    let one = |case| Ok((text(case, "name")?.to_owned(), self::case(case, &mut arrays)));
    list(&file, "cases")?.iter().map(one).collect()
}

fn case(case: &Value, arrays: &mut Arrays) -> Result<Comparison, String> {
    let name = text(case, "name")?;
    let shape = arrays.shape(&format!("{name}/tracks_XYZ"))?;
    let query_frames: Vec<usize> =
        arrays.points(&format!("{name}/queries_xyt"))?.iter().map(|q| q[2].round_ties_even() as usize).collect();
    let (truth, predicted) =
        (arrays.points(&format!("{name}/tracks_XYZ"))?, arrays.points(&format!("{name}/pred_tracks_XYZ"))?);
    let (visible, predicted_visible) =
        (arrays.bools(&format!("{name}/visibility"))?, arrays.bools(&format!("{name}/pred_visibility"))?);
    let intrinsics = arrays.f64s(&format!("{name}/fx_fy_cx_cy"))?;
    let clip = Clip {
        frames: shape[0],
        truth: &truth,
        visible: &visible,
        predicted: &predicted,
        predicted_visible: &predicted_visible,
        query_frames: &query_frames,
        focal: [intrinsics[0], intrinsics[1]],
    };
    let mut total = Comparison::default();
    for expected in list(case, "expected")? {
        let scaling = scaling(text(expected, "scaling")?)?;
        let fixed = expected["fixed_metric_thresholds"] == true;
        let thresholds = if fixed { Thresholds::TAPVID3D_FIXED } else { Thresholds::DepthAdaptive };
        let found = if expected["per_track"] == true {
            score_tracks(&clip, scaling, thresholds)
        } else {
            score(&clip, scaling, thresholds).map(|one| vec![one])
        };
        let found = found.map_err(|e| e.to_string())?;
        for (metric, want) in object(&expected["values"]) {
            let got: Vec<f64> = found.iter().map(|m| value(m, metric)).collect::<Result<_, _>>()?;
            let what = format!("{} {metric}", scaling.name());
            hold_all(&mut total, &what, &got, &numbers(want), Within::Absolute(1e-9));
        }
    }
    Ok(total)
}

fn scaling(name: &str) -> Result<Scaling, String> {
    let all = Scaling::OF_CLIPS.into_iter().chain([Scaling::LocalNeighbourhood(NEIGHBOURHOOD)]);
    all.into_iter().find(|s| s.name() == name).ok_or_else(|| format!("unknown scaling {name}"))
}

/// A metric by its published name.
fn value(metrics: &TrackMetrics, name: &str) -> Result<f64, String> {
    let at = |prefix: &str| {
        let pixels: u32 = name.strip_prefix(prefix)?.parse().ok()?;
        (0..5).find(|k| 1 << k == pixels)
    };
    Ok(match name {
        "occlusion_accuracy" => metrics.occlusion_accuracy,
        "average_jaccard" => metrics.average_jaccard,
        "average_pts_within_thresh" => metrics.average_pts_within,
        _ => match (at("pts_within_"), at("jaccard_")) {
            (Some(k), _) => metrics.pts_within[k],
            (_, Some(k)) => metrics.jaccard[k],
            _ => return Err(format!("unknown metric {name}")),
        },
    })
}

/// Each source's folder through the whole evaluation, and its clips moved into the frame of the first camera.
pub(crate) fn folders(folder: &Path) -> Result<Lines, String> {
    let root = folder.join("tapvid3d_files");
    let expected = json(&root.join("expected.json"))?;
    Ok(object(&expected["sources"])
        .map(|(source, want)| (source.clone(), source_of(&root.join(source), want)))
        .collect())
}

fn source_of(folder: &Path, want: &Value) -> Result<Comparison, String> {
    let mut total = Comparison::default();
    let (truth, prediction) = (folder.join("gt"), folder.join("pred"));
    let error = |e: omnix_eval::EvalError| e.to_string();
    let scalings: Vec<Scaling> =
        object(&want["mean_over_files"]).map(|(name, _)| scaling(name)).collect::<Result<_, _>>()?;
    for file in list(want, "per_file")?.iter().flat_map(object) {
        let (name, metrics) = file;
        let clip = read_truth(&truth.join(name)).map_err(error)?;
        let predicted = read_prediction(&prediction.join(name), clip.frames, clip.tracks).map_err(error)?;
        for scaling in &scalings {
            let clip = Clip {
                frames: clip.frames,
                truth: &clip.points,
                visible: &clip.visible,
                predicted: &predicted.points,
                predicted_visible: &predicted.visible,
                query_frames: &clip.query_frames().map_err(error)?,
                focal: clip.focal(),
            };
            let found = score(&clip, *scaling, Thresholds::DepthAdaptive).map_err(error)?;
            for (metric, want) in object(&metrics[scaling.name()]) {
                hold(
                    &mut total,
                    &format!("{name} {} {metric}", scaling.name()),
                    value(&found, metric)?,
                    want,
                    Within::Absolute(1e-6),
                );
            }
        }
    }
    let report = evaluate(&prediction, &truth, &Options { scalings, ..Options::default() }).map_err(error)?;
    for (name, metrics) in object(&want["mean_over_files"]) {
        let row = report.rows.iter().find(|row| row.name.ends_with(&format!("whole sequences, {name}")));
        let row = row.ok_or_else(|| format!("the report has no row of {name}"))?;
        for (column, metric) in
            [("APD3D", "average_pts_within_thresh"), ("AJ", "average_jaccard"), ("OA", "occlusion_accuracy")]
        {
            let at = report.columns.iter().position(|c| c.name == column).ok_or("a column is missing")?;
            hold(
                &mut total,
                &format!("mean {name} {metric}"),
                row.values[at],
                &metrics[metric],
                Within::Absolute(1e-6),
            );
        }
    }
    world(folder, &mut total)?;
    Ok(total)
}

/// The first 16 frames of each clip in the frame of the first camera.
fn world(folder: &Path, total: &mut Comparison) -> Result<(), String> {
    const FRAMES: usize = 16;
    let path = folder.join("expected_world_16_frames.npz");
    if !path.is_file() {
        return Ok(());
    }
    let mut arrays = Arrays::open(&path)?;
    for name in ["clip_0", "clip_1", "clip_2"] {
        let clip: ClipTruth = read_truth(&folder.join(format!("gt/{name}.npz"))).map_err(|e| e.to_string())?;
        let count = FRAMES.min(clip.frames) * clip.tracks;
        let poses = clip.extrinsics.clone().unwrap_or_else(|| vec![omnix_eval::Rigid::IDENTITY; clip.frames]);
        let poses = &poses[..FRAMES.min(clip.frames)];
        let moved = to_first_camera(&clip.points[..count], clip.tracks, poses).map_err(|e| e.to_string())?;
        let within = Within::Absolute(1e-6);
        hold_all(
            total,
            &format!("{name} world"),
            moved.as_flattened(),
            &arrays.f64s(&format!("{name}/tracks_world"))?,
            within,
        );
        // Recorded through f32, so measured in widths of the picture.
        let width = f64::from(clip.size[0]);
        let of_width = |values: &[f64]| -> Vec<f64> { values.iter().map(|v| v / width).collect() };
        let (pixels, want) = (clip.pixels(), arrays.f64s(&format!("{name}/tracks_uv"))?);
        let found = of_width(pixels[..count].as_flattened());
        hold_all(total, &format!("{name} pixels"), &found, &of_width(&want), within);
        let relative: Vec<f64> = relative_to_first(poses)
            .iter()
            .flat_map(|pose| pose.rows().concat().into_iter().chain([0.0, 0.0, 0.0, 1.0]))
            .collect();
        hold_all(total, &format!("{name} poses"), &relative, &arrays.f64s(&format!("{name}/w2c_first_frame"))?, within);
        let picture = image::load_from_memory(&clip.first_picture).map_err(|e| e.to_string())?.into_rgb8();
        let want = arrays.f64s(&format!("{name}/frame0_rgb"))?;
        let off: Vec<f64> = picture.as_raw().iter().zip(&want).map(|(a, b)| (f64::from(*a) - b).abs()).collect();
        let (mean, most) = (off.iter().sum::<f64>() / off.len() as f64, off.iter().copied().fold(0.0, f64::max));
        // The picture is the same; decoders round chroma apart on its way to full size, and blue is 1.77 times chroma.
        hold_true(total, &format!("{name} picture"), off.len() == want.len() && mean < 0.5 && most <= 4.0);
    }
    Ok(())
}
