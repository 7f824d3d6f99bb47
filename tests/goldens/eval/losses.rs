//! The harness's f64 losses against the published loss code.

use std::path::Path;

use omnix_tests::losses::{
    Norm, below_quantile, cross_entropy, gradient, gradient_over_scales, huber, l1, moving_pixels, moving_tokens,
    robust,
};
use serde_json::Value;

use super::numbers::{Arrays, Lines, Within, hold, hold_all, json};
use crate::case::Comparison;

const EXACT: Within = Within::Relative(1e-9);
const WEIGHTS: [f64; 2] = [1.0, 0.2];

pub(crate) fn cases(folder: &Path) -> Result<Lines, String> {
    let file = json(&folder.join("losses.json"))?;
    let mut arrays = Arrays::open(&folder.join("losses.npz"))?;
    let cases = &file["cases"];
    let mut lines: Lines = ["depth", "ray", "trajectory"]
        .into_iter()
        .map(|name| (name.to_owned(), regression(name, &cases[name], &mut arrays)))
        .collect();
    type Check = fn(&Value, &mut Arrays) -> Result<Comparison, String>;
    let others: [(&str, Check); 5] =
        [("gradient", slopes), ("camera", camera), ("dynamic", dynamic), ("bce", entropy), ("quantile", quantile)];
    lines.extend(others.into_iter().map(|(name, check)| (name.to_owned(), check(&cases[name], &mut arrays))));
    Ok(lines)
}

fn regression(name: &str, case: &Value, arrays: &mut Arrays) -> Result<Comparison, String> {
    let mut total = Comparison::default();
    let (predicted, truth) = (arrays.f64s(&format!("{name}/pred"))?, arrays.f64s(&format!("{name}/gt"))?);
    let (confidence, valid) = (arrays.f64s(&format!("{name}/confidence"))?, arrays.bools(&format!("{name}/valid"))?);
    for (key, norm) in [("l1", Norm::L1), ("l2", Norm::L2)] {
        let found = robust(&predicted, &truth, &confidence, &valid, norm, WEIGHTS);
        let want = &case["expected"][key];
        hold(
            &mut total,
            &format!("{key} weighted"),
            found.weighted_minus_log_sum,
            &want["weighted_minus_log_sum"],
            EXACT,
        );
        hold(&mut total, &format!("{key} plain"), found.plain_sum, &want["plain_sum"], EXACT);
        hold(&mut total, &format!("{key} mean"), found.mean_over_valid(), &want["total_mean_over_valid"], EXACT);
        hold(
            &mut total,
            &format!("{key} mean of all"),
            found.mean_over_all(),
            &want["total_mean_over_all_pixels"],
            EXACT,
        );
        hold(&mut total, "valid", found.valid as f64, &case["valid"], EXACT);
        hold(&mut total, "pixels", found.pixels as f64, &case["pixels"], EXACT);
        for (what, got) in [("pred", &found.by_prediction), ("confidence", &found.by_confidence)] {
            let want = arrays.f64s(&format!("{name}/grad_{what}_{key}_mean_over_valid"))?;
            hold_all(&mut total, &format!("{key} by {what}"), got, &want, Within::Absolute(1e-9));
        }
    }
    Ok(total)
}

fn slopes(case: &Value, arrays: &mut Arrays) -> Result<Comparison, String> {
    let mut total = Comparison::default();
    let (predicted, truth) = (arrays.f64s("gradient/pred")?, arrays.f64s("gradient/gt")?);
    let valid = arrays.bools("gradient/valid")?;
    let shape = arrays.shape("gradient/valid")?;
    let size = [shape[2], shape[1]];
    hold(&mut total, "one scale", gradient(&predicted, &truth, &valid, size, 1), &case["single_scale"], EXACT);
    let found = gradient_over_scales(&predicted, &truth, &valid, size);
    hold(&mut total, "four scales", found, &case["four_scales_mean"], EXACT);
    let all = vec![true; valid.len()];
    hold(&mut total, "all valid", gradient(&predicted, &truth, &all, size, 1), &case["single_scale_all_valid"], EXACT);
    Ok(total)
}

fn camera(case: &Value, arrays: &mut Arrays) -> Result<Comparison, String> {
    let mut total = Comparison::default();
    let (predicted, truth) = (arrays.f64s("camera/pred_t3_q4_f2")?, arrays.f64s("camera/gt_t3_q4_f2")?);
    let mut weighted = 0.0;
    for (name, columns, weight) in [("translation", 0..3, 1.0), ("quaternion", 3..7, 1.0), ("fov", 7..9, 0.5)] {
        let pick =
            |rows: &[f64]| -> Vec<f64> { rows.chunks_exact(9).flat_map(|row| row[columns.clone()].to_vec()).collect() };
        let (predicted, truth) = (pick(&predicted), pick(&truth));
        let found = l1(&predicted, &truth);
        weighted += weight * found;
        hold(&mut total, &format!("{name} l1"), found, &case["l1_means"][name], EXACT);
        for (key, delta) in [("huber_delta_0.1", 0.1), ("huber_delta_1.0", 1.0)] {
            let found = huber(&predicted, &truth, delta);
            hold(&mut total, &format!("{name} {key}"), found, &case[key][name], EXACT);
            let sum = found * predicted.len() as f64;
            hold(
                &mut total,
                &format!("{name} {key} sum"),
                sum,
                &case[&format!("{key}_summed_components")][name],
                EXACT,
            );
        }
    }
    hold(&mut total, "weighted", weighted, &case["l1_weighted_1_1_0.5"], EXACT);
    Ok(total)
}

fn dynamic(case: &Value, arrays: &mut Arrays) -> Result<Comparison, String> {
    let mut total = Comparison::default();
    let shape = arrays.shape("dynamic/trajectory")?;
    let (times, height, width) = (shape[2], shape[3], shape[4]);
    let positions = arrays.points("dynamic/trajectory")?;
    let threshold = case["movement_threshold"].as_f64().ok_or("no movement_threshold")?;
    let patch = case["patch"].as_u64().ok_or("no patch")? as usize;
    let pixels = moving_pixels(&positions, times, height * width, threshold);
    let tokens = moving_tokens(&pixels, [width, height], patch);
    let (of_pixels, of_tokens) = (
        cross_entropy(&arrays.f64s("dynamic/pixel_score")?, &pixels, 1e-6),
        cross_entropy(&arrays.f64s("dynamic/token_score")?, &tokens, 0.0),
    );
    let want = &case["expected"];
    let within = Within::Relative(1e-6);
    hold(&mut total, "pixels", of_pixels, &want["loss_pts3d_dynamic_score"], within);
    hold(&mut total, "tokens", of_tokens, &want["loss_token_dynamic_score"], within);
    hold(&mut total, "both", of_pixels + of_tokens, &want["loss_dynamic_score"], within);
    let known = pixels.iter().flatten().count() as f64;
    let moving = pixels.iter().flatten().filter(|moves| **moves).count() as f64;
    hold(&mut total, "share that moves", moving / known, &want["dynamic_ratio"], within);
    hold(&mut total, "share that is known", known / pixels.len() as f64, &want["valid_supervision_ratio"], within);
    Ok(total)
}

fn entropy(case: &Value, arrays: &mut Arrays) -> Result<Comparison, String> {
    let mut total = Comparison::default();
    let target: Vec<Option<bool>> = arrays.f64s("bce/target")?.iter().map(|v| Some(*v > 0.5)).collect();
    let probability = arrays.f64s("bce/prob")?;
    hold(
        &mut total,
        "logarithms",
        cross_entropy(&probability, &target, 0.0),
        &case["mean_log_clamped_at_minus_100"],
        EXACT,
    );
    hold(
        &mut total,
        "probabilities",
        cross_entropy(&probability, &target, 1e-6),
        &case["mean_prob_clamped_1e-6"],
        EXACT,
    );
    Ok(total)
}

fn quantile(case: &Value, arrays: &mut Arrays) -> Result<Comparison, String> {
    let mut total = Comparison::default();
    let kept = below_quantile(&arrays.f64s("quantile/values")?, case["quantile"].as_f64().ok_or("no quantile")?);
    hold(&mut total, "kept", kept.len() as f64, &case["kept"], EXACT);
    hold(&mut total, "sum", kept.iter().sum(), &case["kept_sum"], EXACT);
    Ok(total)
}
