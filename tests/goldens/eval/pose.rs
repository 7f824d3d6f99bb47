//! Pose errors against evo's.

use std::path::Path;

use omnix_eval::files::camera::read_tum;
use omnix_eval::pose::{Alignment, TOLERANCE_S, Trajectory, absolute, associate, relative, video_pose};
use omnix_eval::{EvalError, Rigid, Statistics};
use serde_json::Value;

use super::numbers::{Lines, Within, hold, hold_all, hold_true, json, list, numbers, object, text};
use crate::case::Comparison;

const MODES: [(&str, Alignment); 4] = [
    ("none", Alignment::None),
    ("se3", Alignment::Se3),
    ("sim3", Alignment::Sim3),
    ("scale_only", Alignment::ScaleOnly),
];
const RELATIVE: Within = Within::Relative(1e-8);
const DEGREES: Within = Within::Absolute(1e-6);

pub(crate) fn cases(folder: &Path) -> Result<Lines, String> {
    let file = json(&folder.join("pose.json"))?;
    list(&file, "cases")?.iter().map(|case| Ok((text(case, "name")?.to_owned(), one(case)))).collect()
}

fn one(case: &Value) -> Result<Comparison, String> {
    let (reference, estimate) = (trajectory(&case["reference"])?, trajectory(&case["estimate"])?);
    let mut total = Comparison::default();
    let expected = &case["expected"];
    let (reference, estimate) = associate(&reference, &estimate, TOLERANCE_S).map_err(|e| e.to_string())?;
    hold(&mut total, "associated pairs", reference.len() as f64, &expected["associated_pairs"], Within::Absolute(0.0));
    modes(&mut total, &reference, &estimate, &expected["modes"], RELATIVE)?;
    let protocol = &expected["protocol"];
    match video_pose(&reference, &estimate) {
        Ok(found) => {
            hold(&mut total, "protocol ate", found.ate, &protocol["ate"], RELATIVE);
            hold(&mut total, "protocol rpe_trans", found.rpe_translation, &protocol["rpe_trans"], RELATIVE);
            hold(&mut total, "protocol rpe_rot", found.rpe_rotation, &protocol["rpe_rot_deg"], DEGREES);
        }
        Err(error) => hold_true(&mut total, "protocol is degenerate", is_degenerate(&error, protocol)),
    }
    Ok(total)
}

/// Two trajectories of real files, when they lie where the folder's README says.
pub(crate) fn real(folder: &Path) -> Result<Lines, String> {
    let files = folder.join("../../data/tum_trajectory");
    if !files.is_dir() {
        return Err("its trajectories, ../../data/tum_trajectory, are not there".into());
    }
    let read = |name: &str| read_tum(&files.join(name)).map_err(|e| e.to_string());
    let (reference, estimate) = (read("freiburg1_xyz-groundtruth.txt")?, read("freiburg1_xyz-rgbdslam.txt")?);
    let expected = json(&folder.join("pose_tum_fr1_xyz.json"))?;
    let mut total = Comparison::default();
    hold(&mut total, "reference poses", reference.len() as f64, &expected["reference_poses"], Within::Absolute(0.0));
    hold(&mut total, "estimate poses", estimate.len() as f64, &expected["estimate_poses"], Within::Absolute(0.0));
    let (reference, estimate) = associate(&reference, &estimate, TOLERANCE_S).map_err(|e| e.to_string())?;
    hold(&mut total, "associated pairs", reference.len() as f64, &expected["associated_pairs"], Within::Absolute(0.0));
    modes(&mut total, &reference, &estimate, &expected, Within::Relative(1e-7))?;
    Ok(vec![("files".into(), Ok(total))])
}

fn trajectory(rows: &Value) -> Result<Trajectory, String> {
    let mut found = Trajectory::default();
    for row in rows.as_array().into_iter().flatten().map(numbers) {
        let [stamp, x, y, z, qx, qy, qz, qw] = row[..] else { return Err("a row has not 8 numbers".into()) };
        found.stamps.push(stamp);
        found.poses.push(Rigid::from_quaternion([x, y, z], [qx, qy, qz, qw]).ok_or("a row is no pose")?);
    }
    Ok(found)
}

fn modes(
    total: &mut Comparison,
    reference: &Trajectory,
    estimate: &Trajectory,
    expected: &Value,
    within: Within,
) -> Result<(), String> {
    let (mut known, error) = (0, |e: EvalError| e.to_string());
    for (name, alignment) in MODES {
        let want = &expected[name];
        if want.is_null() {
            continue;
        }
        known += 1;
        let (errors, aligned) = match absolute(reference, estimate, alignment) {
            Ok(found) => found,
            Err(error) => {
                hold_true(total, &format!("{name} is degenerate"), is_degenerate(&error, want));
                continue;
            }
        };
        // Recorded beside the statistics, or under a name of their own.
        let recorded = if want["alignment"].is_null() { want } else { &want["alignment"] };
        if recorded["scale"].is_number() {
            let found = errors.alignment;
            hold(total, &format!("{name} scale"), found.scale, &recorded["scale"], within);
            let rotation = numbers(&recorded["rotation_row_major"]);
            hold_all(
                total,
                &format!("{name} rotation"),
                found.rotation.as_flattened(),
                &rotation,
                Within::Absolute(1e-8),
            );
            let translation = numbers(&recorded["translation"]);
            hold_all(total, &format!("{name} translation"), &found.translation, &translation, Within::Absolute(1e-8));
        }
        statistics(total, &format!("{name} ate"), &errors.translation, &want["ate_translation"], within);
        statistics(total, &format!("{name} rotation"), &errors.rotation, &want["ape_rotation_deg"], DEGREES);
        for (key, recorded) in object(want) {
            if let Some(delta) = key.strip_prefix("rpe_trans_delta") {
                let steps = relative(reference, &aligned, delta.parse().map_err(|_| key.clone())?).map_err(error)?;
                statistics(total, &format!("{name} {key}"), &steps.translation, recorded, within);
                let degrees = &want[&format!("rpe_rot_deg_delta{delta}")];
                statistics(total, &format!("{name} rpe_rot {delta}"), &steps.rotation, degrees, DEGREES);
            }
        }
    }
    if known == 0 { Err("no alignment is recorded".into()) } else { Ok(()) }
}

fn is_degenerate(error: &EvalError, recorded: &Value) -> bool {
    matches!(error, EvalError::Degenerate { .. }) && recorded["error"] == "GeometryException"
}

fn statistics(total: &mut Comparison, what: &str, errors: &[f64], want: &Value, within: Within) {
    if want.is_null() {
        return;
    }
    let Some(found) = Statistics::of(errors) else {
        total.failures.push(format!("{what}: no error at all"));
        return;
    };
    let named = [
        ("rmse", found.rmse),
        ("mean", found.mean),
        ("median", found.median),
        ("std", found.std),
        ("min", found.min),
        ("max", found.max),
        ("sse", found.sse),
    ];
    for (name, value) in named {
        hold(total, &format!("{what} {name}"), value, &want[name], within);
    }
}
