//! Depth metrics under every alignment, their mean, and cubic resizing.

use std::path::Path;

use omnix_eval::depth::{Alignment, DepthMetrics, Pixels, Range, mean, resize_cubic, score};
use serde_json::Value;

use super::numbers::{Arrays, Lines, Within, hold, json, list, numbers, object, text};
use crate::case::Comparison;

pub(crate) fn cases(folder: &Path) -> Result<Lines, String> {
    let file = json(&folder.join("depth.json"))?;
    let mut arrays = Arrays::open(&folder.join("depth.npz"))?;
    let mut lines = Vec::new();
    let mut kitti = Vec::new();
    for sequence in list(&file, "sequences")? {
        let (name, data_set) = (text(sequence, "name")?, text(sequence, "dataset")?);
        let range = range(&file["protocols"][data_set]);
        let pixels = pixels(&mut arrays, name, range)?;
        let mut total = Comparison::default();
        for (alignment, want) in object(&sequence["expected"]) {
            let found = score(&pixels, by_name(alignment)?, range).metrics;
            compare(&mut total, alignment, &found, want)?;
            if data_set == "kitti" {
                kitti.push((alignment.clone(), found));
            }
        }
        lines.push((name.to_owned(), Ok(total)));
    }
    let mut total = Comparison::default();
    for (alignment, want) in object(&file["aggregate"]) {
        let of: Vec<DepthMetrics> = kitti.iter().filter(|(name, _)| name == alignment).map(|(_, m)| *m).collect();
        compare(&mut total, alignment, &mean(&of), want)?;
    }
    lines.push(("aggregate".into(), Ok(total)));
    lines.push(("shift_case".into(), shifted(&file["shift_case"], &mut arrays)));
    lines.push(("corners".into(), corners(&file)));
    lines.push(("cubic_resize".into(), resized(&file, &mut arrays)));
    Ok(lines)
}

fn range(protocol: &Value) -> Range {
    Range { max_depth: protocol["max_depth"].as_f64(), clip: protocol["post_clip_max"].as_f64() }
}

fn pixels(arrays: &mut Arrays, name: &str, range: Range) -> Result<Pixels, String> {
    let (predicted, truth) = (arrays.f32s(&format!("{name}/pred"))?, arrays.f32s(&format!("{name}/gt"))?);
    let frames = arrays.shape(&format!("{name}/gt"))?[0];
    let mut pixels = Pixels::default();
    let size = truth.len() / frames;
    for (p, g) in predicted.chunks_exact(size).zip(truth.chunks_exact(size)) {
        pixels.add(p, g, range).map_err(|e| e.to_string())?;
    }
    Ok(pixels)
}

fn by_name(name: &str) -> Result<Alignment, String> {
    Alignment::ALL.into_iter().find(|a| a.name() == name).ok_or_else(|| format!("unknown alignment {name}"))
}

/// The recorded numbers were computed in f32.
fn compare(total: &mut Comparison, alignment: &str, found: &DepthMetrics, want: &Value) -> Result<(), String> {
    let limit = if matches!(alignment, "scale" | "scale_and_shift_adam") { 1e-4 } else { 1e-6 };
    for (name, want) in object(want) {
        let got = match name.as_str() {
            "Abs Rel" => found.abs_rel,
            "Sq Rel" => found.sq_rel,
            "RMSE" => found.rmse,
            "Log RMSE" => found.log_rmse,
            // No ratio of the larger to the smaller is below 1.
            "delta < 1." => 0.0,
            "delta < 1.25" => found.delta[0],
            "delta < 1.25^2" => found.delta[1],
            "delta < 1.25^3" => found.delta[2],
            "valid_pixels" => found.valid_pixels as f64,
            other => return Err(format!("unknown metric {other}")),
        };
        hold(total, &format!("{alignment} {name}"), got, want, Within::Absolute(limit));
    }
    Ok(())
}

fn shifted(expected: &Value, arrays: &mut Arrays) -> Result<Comparison, String> {
    let pixels = pixels(arrays, "shift_case", Range::KITTI)?;
    let mut total = Comparison::default();
    for (alignment, want) in object(expected) {
        compare(&mut total, alignment, &score(&pixels, by_name(alignment)?, Range::KITTI).metrics, want)?;
    }
    Ok(total)
}

/// Nothing valid, and the median of an even count.
fn corners(file: &Value) -> Result<Comparison, String> {
    let mut total = Comparison::default();
    let nothing = &file["no_valid_pixel"];
    let alignment = by_name(text(nothing, "alignment")?)?;
    compare(
        &mut total,
        "no valid pixel",
        &score(&Pixels::default(), alignment, Range::KITTI).metrics,
        &nothing["expected"],
    )?;
    let even = &file["even_count_median"];
    let values = |name: &str| -> Vec<f32> { numbers(&even[name]).into_iter().map(|v| v as f32).collect() };
    let mut pixels = Pixels::default();
    pixels.add(&values("pred"), &values("gt"), Range::KITTI).map_err(|e| e.to_string())?;
    compare(&mut total, "median", &score(&pixels, Alignment::Median, Range::KITTI).metrics, &even["expected"])?;
    Ok(total)
}

fn resized(file: &Value, arrays: &mut Arrays) -> Result<Comparison, String> {
    let mut total = Comparison::default();
    for case in list(file, "cubic_resize")? {
        let name = text(case, "name")?;
        let size = |key: &str| -> Result<[usize; 2], String> {
            match numbers(&case[key])[..] {
                [height, width] => Ok([width as usize, height as usize]),
                _ => Err(format!("{name} has no {key}")),
            }
        };
        let input = arrays.f32s(&format!("{name}/input"))?;
        let found = resize_cubic(&input, size("input_hw")?, size("output_hw")?).map_err(|e| e.to_string())?;
        let want = arrays.f32s(&format!("{name}/output"))?;
        total.compare(name, &found, &want, 1e-4, true);
    }
    Ok(total)
}
