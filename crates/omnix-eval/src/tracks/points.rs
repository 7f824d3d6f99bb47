//! What all track metrics share: thresholds and distances of points.

use serde::Serialize;

use crate::EvalError;

/// Pixels of the adaptive thresholds, and the names of the fixed ones.
pub const PIXELS: [u32; 5] = [1, 2, 4, 8, 16];

/// Length of the shorter side of a picture, in pixels, at which TAPVid-3D measures.
pub const METRIC_RESOLUTION: f64 = 256.0;

/// Distances within which a point counts, `d < threshold`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Thresholds {
    /// What 1, 2, 4, 8, 16 pixels are at the true depth: `k |z| / sqrt(fx fy)`.
    DepthAdaptive,
    /// Metres.
    Fixed([f64; 5]),
}

impl Thresholds {
    /// The fixed set of TAPVid-3D.
    pub const TAPVID3D_FIXED: Self = Self::Fixed([0.01, 0.04, 0.16, 0.64, 2.56]);

    /// The k-th threshold, squared, at depth z for a mean focal length in pixels.
    pub(super) fn squared(self, k: usize, z: f64, focal: f64) -> f64 {
        let threshold = match self {
            Self::DepthAdaptive => f64::from(PIXELS[k]) * (z / focal),
            Self::Fixed(metres) => metres[k],
        };
        threshold * threshold
    }

    /// The set in words.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::DepthAdaptive => "depth-adaptive, 1, 2, 4, 8, 16 pixels".into(),
            Self::Fixed(metres) => format!("fixed, {metres:?} m"),
        }
    }
}

/// The mean focal length `sqrt(fx fy)`.
///
/// # Errors
/// [`EvalError::Parameter`] unless both are positive and finite.
pub fn mean_focal([fx, fy]: [f64; 2]) -> Result<f64, EvalError> {
    let mean = (fx * fy).sqrt();
    if fx > 0.0 && fy > 0.0 && mean.is_finite() {
        return Ok(mean);
    }
    let value = format!("[{fx}, {fy}]");
    Err(EvalError::Parameter { name: "focal length", value, expected: "give two positive numbers of pixels" })
}

pub(super) fn square_distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

pub(super) fn norm(a: [f64; 3]) -> f64 {
    a.iter().map(|v| v * v).sum::<f64>().sqrt()
}

pub(super) fn scaled(a: [f64; 3], scale: f64) -> [f64; 3] {
    a.map(|v| v * scale)
}

pub(super) fn is_finite(a: [f64; 3]) -> bool {
    a.iter().all(|v| v.is_finite())
}
