//! Recorded numbers and arrays, and how ours are held to them.

use std::path::Path;

use omnix_eval::files::npz::Archive;
use serde_json::Value;

use crate::case::Comparison;

/// What became of each case, by name.
pub(crate) type Lines = Vec<(String, Result<Comparison, String>)>;

/// Reads a JSON file.
pub(crate) fn json(path: &Path) -> Result<Value, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}

/// The list under `name`.
pub(crate) fn list<'a>(value: &'a Value, name: &str) -> Result<&'a Vec<Value>, String> {
    value[name].as_array().ok_or_else(|| format!("there is no list {name}"))
}

/// The entries of an object.
pub(crate) fn object(value: &Value) -> impl Iterator<Item = (&String, &Value)> {
    value.as_object().into_iter().flatten()
}

/// The text under `name`.
pub(crate) fn text<'a>(value: &'a Value, name: &str) -> Result<&'a str, String> {
    value[name].as_str().ok_or_else(|| format!("there is no text {name}"))
}

/// A list of numbers; null is NaN.
pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect()
}

/// How an error is measured.
#[derive(Clone, Copy)]
pub(crate) enum Within {
    /// Relative to the recorded number, absolute where that is 0.
    Relative(f64),
    /// Relative above 1, absolute below: for shares and angles.
    Absolute(f64),
}

/// Holds a number to a recorded one; null is NaN.
pub(crate) fn hold(total: &mut Comparison, what: &str, got: f64, want: &Value, within: Within) {
    if !(want.is_number() || want.is_null()) {
        total.failures.push(format!("{what}: nothing is recorded"));
        return;
    }
    hold_f64(total, what, got, want.as_f64().unwrap_or(f64::NAN), within);
}

/// Holds a number to a recorded one.
pub(crate) fn hold_f64(total: &mut Comparison, what: &str, got: f64, want: f64, within: Within) {
    let (unit, limit) = match within {
        Within::Relative(limit) => (if want == 0.0 { 1.0 } else { want.abs() }, limit),
        Within::Absolute(limit) => (want.abs().max(1.0), limit),
    };
    let error = match (got.is_nan(), want.is_nan()) {
        (true, true) => 0.0,
        (false, false) => (got - want).abs() / unit,
        _ => f64::INFINITY,
    };
    total.note(what, error, limit, true);
    if error > limit {
        total.failures.push(format!("    got {got}, recorded {want}"));
    }
}

/// Holds a list of numbers to a recorded one, element by element.
pub(crate) fn hold_all(total: &mut Comparison, what: &str, got: &[f64], want: &[f64], within: Within) {
    if got.len() != want.len() {
        total.failures.push(format!("{what}: {} numbers, recorded {}", got.len(), want.len()));
        return;
    }
    let mut one = Comparison::default();
    for (got, want) in got.iter().zip(want) {
        hold_f64(&mut one, what, *got, *want, within);
    }
    let limit = match within {
        Within::Relative(limit) | Within::Absolute(limit) => limit,
    };
    total.note(what, one.worst, limit, true);
}

/// Holds that something is so.
pub(crate) fn hold_true(total: &mut Comparison, what: &str, so: bool) {
    total.note(what, if so { 0.0 } else { f64::INFINITY }, 0.0, true);
}

/// An archive of recorded arrays.
pub(crate) struct Arrays(Archive);

impl Arrays {
    pub(crate) fn open(path: &Path) -> Result<Self, String> {
        Archive::open(path).map(Self).map_err(|e| e.to_string())
    }

    pub(crate) fn f64s(&mut self, name: &str) -> Result<Vec<f64>, String> {
        self.0.array(name).and_then(|a| a.f64s()).map_err(|e| e.to_string())
    }

    pub(crate) fn f32s(&mut self, name: &str) -> Result<Vec<f32>, String> {
        self.0.array(name).and_then(|a| a.f32s()).map_err(|e| e.to_string())
    }

    pub(crate) fn points(&mut self, name: &str) -> Result<Vec<[f64; 3]>, String> {
        self.0.array(name).and_then(|a| a.points()).map_err(|e| e.to_string())
    }

    pub(crate) fn bools(&mut self, name: &str) -> Result<Vec<bool>, String> {
        self.0.array(name).and_then(|a| a.bools()).map_err(|e| e.to_string())
    }

    pub(crate) fn shape(&mut self, name: &str) -> Result<Vec<usize>, String> {
        Ok(self.0.array(name).map_err(|e| e.to_string())?.shape().to_vec())
    }
}
