//! A file of cameras to fly along: `{"keys": [{"position", "target", "up", "fov", "time"}, ..]}`.

use std::path::Path;

use omnix::geometry::{Camera, look_at};
use serde_json::Value;

use crate::error::CliError;

/// Bytes of such a file at most, and its keys.
const LONGEST: u64 = 16 << 20;
const MOST: usize = 10_000;
/// Field of view from top to bottom where a key says none, in degrees.
const FOV: f64 = 50.0;

/// A camera that the film passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Key {
    /// Its intrinsics are those of a picture one pixel high, with the middle at 0.
    pub(super) camera: Camera,
    /// When, if it says so.
    pub(super) time: Option<f64>,
}

/// Reads the file.
pub(super) fn read(path: &Path) -> Result<Vec<Key>, CliError> {
    let wrong = |reason: String| CliError::Usage(format!("{}: {reason}", path.display()));
    let failed = |source| omnix::io::IoError::Read { path: path.to_owned(), source };
    let length = std::fs::metadata(path).map_err(failed)?.len();
    if length > LONGEST {
        return Err(wrong(format!("a list of cameras of more than {} MiB", LONGEST >> 20)));
    }
    parse(&std::fs::read_to_string(path).map_err(failed)?).map_err(wrong)
}

fn parse(text: &str) -> Result<Vec<Key>, String> {
    let value: Value = serde_json::from_str(text).map_err(|e| format!("it is no JSON: {e}"))?;
    let keys = value.get("keys").and_then(Value::as_array).ok_or("it has no list \"keys\"")?;
    if keys.is_empty() || keys.len() > MOST {
        return Err(format!("{} keys: 1 to {MOST} are possible", keys.len()));
    }
    let keys: Vec<Key> = keys
        .iter()
        .enumerate()
        .map(|(k, key)| one(key).map_err(|e| format!("key {k}: {e}")))
        .collect::<Result<_, _>>()?;
    if keys.iter().any(|key| key.time.is_some()) && keys.iter().any(|key| key.time.is_none()) {
        return Err("some keys have a time and some have none".to_owned());
    }
    Ok(keys)
}

fn one(key: &Value) -> Result<Key, String> {
    let vector = |name: &str| -> Result<[f64; 3], String> {
        let numbers = key.get(name).and_then(Value::as_array).filter(|list| list.len() == 3);
        let numbers = numbers.and_then(|list| list.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>());
        match numbers.as_deref() {
            Some(&[x, y, z]) if [x, y, z].iter().all(|v| v.abs() < 1e9) => Ok([x, y, z]),
            _ => Err(format!("\"{name}\" is no list of three numbers")),
        }
    };
    let number = |name: &str| match key.get(name) {
        None => Ok(None),
        Some(value) => value.as_f64().map(Some).ok_or_else(|| format!("\"{name}\" is no number")),
    };
    // Down is positive y for the cameras of a run.
    let up = if key.get("up").is_some() { vector("up")? } else { [0.0, -1.0, 0.0] };
    let pose = look_at(vector("position")?, vector("target")?, up);
    let extrinsics =
        pose.ok_or("it looks in no direction: target and position are one, or \"up\" is the way it looks")?;
    let fov = number("fov")?.unwrap_or(FOV);
    if !(1.0..=170.0).contains(&fov) {
        return Err(format!("a field of view of {fov} degrees: 1 to 170 are possible"));
    }
    let focal = (0.5 / (fov.to_radians() / 2.0).tan()) as f32;
    let intrinsics = [[focal, 0.0, 0.0], [0.0, focal, 0.0], [0.0, 0.0, 1.0]];
    Ok(Key { camera: Camera { extrinsics, intrinsics }, time: number("time")? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_read() {
        let keys =
            parse(r#"{"keys": [{"position": [0, 0, -2], "target": [0, 0, 1], "fov": 90, "time": 1.5}]}"#).unwrap();
        assert_eq!(keys[0].time, Some(1.5));
        assert_eq!(keys[0].camera.extrinsics[2], [0.0, 0.0, 1.0, 2.0]);
        assert!((keys[0].camera.intrinsics[1][1] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, word) in [
            ("nothing", "no JSON"),
            ("{}", "keys"),
            (r#"{"keys": []}"#, "0 keys"),
            (r#"{"keys": [{"target": [0, 0, 1]}]}"#, "position"),
            (r#"{"keys": [{"position": [0, 0, 1e300], "target": [0, 0, 1]}]}"#, "position"),
            (r#"{"keys": [{"position": [0, 0, 1], "target": [0, 0, 1]}]}"#, "no direction"),
            (r#"{"keys": [{"position": [0, 0, 0], "target": [0, 0, 1], "fov": 0}]}"#, "field of view"),
            (r#"{"keys": [{"position": [0, 0, 0], "target": [0, 0, 1], "time": "x"}]}"#, "time"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
