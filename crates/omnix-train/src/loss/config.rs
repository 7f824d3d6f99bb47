//! What the objective is made of: every choice in which the paper and its released program differ, and the weights of all terms.
//!
//! [`LossConfig::release`] computes what the release does (`spec/omnix.md` section 11.2), [`LossConfig::paper`] what the paper's section
//! 3.3 says (`spec/eval.md` section 8). Every field can be set on its own, in code or in a configuration file.

use serde::{Deserialize, Serialize};

use crate::TrainError;

/// The objective's choices. Made by [`LossConfig::release`] or [`LossConfig::paper`] and changed by the methods of its fields' names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct LossConfig {
    /// Weights of the terms in the total.
    pub weights: TermWeights,
    /// λ1: factor of error times confidence.
    pub lambda1: f32,
    /// λ2: factor of the logarithm of the confidence, which is subtracted.
    pub lambda2: f32,
    /// Which entries of a regression term are left out.
    pub trim: Trim,
    /// What the sum over valid entries is divided by.
    pub divide_by: DivideBy,
    /// The error of a point of a trajectory.
    pub track_norm: Norm,
    /// α: weight of the slope term inside the depth term.
    pub slope_weight: f32,
    /// Scales of the slope term: every pixel, every second, every fourth and so on.
    pub slope_scales: u32,
    /// The error of a number of a camera.
    pub camera: CameraError,
    /// Weights of translation, rotation and field of view inside the camera term.
    pub camera_weights: [f32; 3],
    /// Whether the scores of tokens are kept away from 0 and 1 as those of pixels are.
    pub clamp_token_score: bool,
    /// A term with fewer valid entries than this is zero.
    pub least_entries: u32,
    /// Share of moving entries among those of the trajectory term that count: still ones are drawn anew in each step
    /// ([`super::still`]). All known entries count where it is not given; the release has 0.7 for one of its data sets.
    pub moving_share: Option<f64>,
}

/// Weights of the terms in the total. A term of weight 0 is still computed and reported.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct TermWeights {
    /// β: cameras.
    pub camera: f32,
    /// Depth, with its slope term.
    pub depth: f32,
    /// Rays.
    pub ray: f32,
    /// Trajectories behind the gate.
    pub trajectory: f32,
    /// κ: scores of pixels and tokens.
    pub score: f32,
    /// Displacement of moving pixels without the gate: for training from nothing.
    pub displacement: f32,
}

/// Which entries of a regression term are left out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Trim {
    /// None.
    None,
    /// Those that are not below a quantile.
    Quantile {
        /// The quantile, above 0 and at most 1; four decimals count.
        keep: f64,
        /// Nothing is left out unless more entries than this remain.
        above: u32,
        /// All values are clamped to between minus this and this.
        largest: f32,
    },
}

/// What the sum over valid entries is divided by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum DivideBy {
    /// The number of all entries, valid or not.
    AllEntries,
    /// The number of valid entries.
    ValidEntries,
}

/// How a vector's error becomes one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Norm {
    /// The sum of the absolute values.
    L1,
    /// The Euclidean length.
    L2,
}

/// The error of a number of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum CameraError {
    /// Its absolute value.
    L1,
    /// Half the square below `delta`, linear beyond.
    Huber {
        /// Where it becomes linear.
        delta: f32,
    },
}

impl Default for LossConfig {
    fn default() -> Self {
        Self::release()
    }
}

impl Default for TermWeights {
    fn default() -> Self {
        Self { camera: 1.0, depth: 1.0, ray: 1.0, trajectory: 1.0, score: 0.01, displacement: 0.0 }
    }
}

/// One method for each field, named after it.
macro_rules! setters {
    ($($(#[$doc:meta])* $field:ident: $kind:ty,)*) => {
        $($(#[$doc])*
        #[must_use]
        pub fn $field(mut self, $field: $kind) -> Self {
            self.$field = $field;
            self
        })*
    };
}

impl TermWeights {
    setters! {
        /// β: cameras.
        camera: f32,
        /// Depth, with its slope term.
        depth: f32,
        /// Rays.
        ray: f32,
        /// Trajectories behind the gate.
        trajectory: f32,
        /// κ: scores of pixels and tokens.
        score: f32,
        /// Displacement of moving pixels without the gate.
        displacement: f32,
    }
}

impl LossConfig {
    /// What the release computes.
    #[must_use]
    pub fn release() -> Self {
        Self {
            weights: TermWeights::default(),
            lambda1: 1.0,
            lambda2: 0.2,
            trim: Trim::Quantile { keep: 0.98, above: 1000, largest: 100.0 },
            divide_by: DivideBy::AllEntries,
            track_norm: Norm::L2,
            slope_weight: 1.0,
            slope_scales: 4,
            camera: CameraError::L1,
            camera_weights: [1.0, 1.0, 0.5],
            clamp_token_score: false,
            least_entries: 100,
            moving_share: None,
        }
    }

    /// What the paper says: L1 throughout, Huber for cameras, means over valid entries, one scale of slopes, nothing left out.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            trim: Trim::None,
            divide_by: DivideBy::ValidEntries,
            track_norm: Norm::L1,
            slope_scales: 1,
            camera: CameraError::Huber { delta: 0.1 },
            clamp_token_score: true,
            ..Self::release()
        }
    }

    setters! {
        /// Weights of the terms in the total.
        weights: TermWeights,
        /// λ1: factor of error times confidence.
        lambda1: f32,
        /// λ2: factor of the logarithm of the confidence.
        lambda2: f32,
        /// Which entries of a regression term are left out.
        trim: Trim,
        /// What the sum over valid entries is divided by.
        divide_by: DivideBy,
        /// The error of a point of a trajectory.
        track_norm: Norm,
        /// α: weight of the slope term inside the depth term.
        slope_weight: f32,
        /// Scales of the slope term.
        slope_scales: u32,
        /// The error of a number of a camera.
        camera: CameraError,
        /// Weights of translation, rotation and field of view.
        camera_weights: [f32; 3],
        /// Whether the scores of tokens are kept away from 0 and 1.
        clamp_token_score: bool,
        /// A term with fewer valid entries than this is zero.
        least_entries: u32,
        /// Share of moving entries among those of the trajectory term that count.
        moving_share: Option<f64>,
    }

    /// Whether every number is one that the terms can work with.
    ///
    /// # Errors
    /// [`TrainError::BadLoss`] names the first field that is not, and what may be there.
    pub fn check(&self) -> Result<(), TrainError> {
        let TermWeights { camera, depth, ray, trajectory, score, displacement } = self.weights;
        let [translation, rotation, view] = self.camera_weights;
        let factors = [
            ("weights.camera", camera),
            ("weights.depth", depth),
            ("weights.ray", ray),
            ("weights.trajectory", trajectory),
            ("weights.score", score),
            ("weights.displacement", displacement),
            ("lambda1", self.lambda1),
            ("lambda2", self.lambda2),
            ("slope_weight", self.slope_weight),
            ("camera_weights[0]", translation),
            ("camera_weights[1]", rotation),
            ("camera_weights[2]", view),
        ];
        for (field, factor) in factors {
            need(factor.is_finite() && factor >= 0.0, field, &factor, "a number that is 0 or more")?;
        }
        if let Trim::Quantile { keep, above, largest } = self.trim {
            need(above <= MOST_COUNTED, "trim.quantile.above", &above, "at most 1048576")?;
            need(keep > 0.0 && keep <= 1.0, "trim.quantile.keep", &keep, "above 0, at most 1")?;
            need(largest.is_finite() && largest > 0.0, "trim.quantile.largest", &largest, "a number above 0")?;
        }
        if let CameraError::Huber { delta } = self.camera {
            need(delta.is_finite() && delta > 0.0, "camera.huber.delta", &delta, "a number above 0")?;
        }
        if let Some(share) = self.moving_share {
            need(share > 0.0 && share <= 1.0, "moving_share", &share, "above 0, at most 1")?;
        }
        let scales = self.slope_scales;
        need((1..=MOST_SCALES).contains(&scales), "slope_scales", &scales, "from 1 to 8")?;
        need(self.least_entries <= MOST_COUNTED, "least_entries", &self.least_entries, "at most 1048576")
    }
}

/// At the last, one pixel of 128 counts.
const MOST_SCALES: u32 = 8;
/// Counts are f32 on the device, and halves between them are exact up to here.
const MOST_COUNTED: u32 = 1 << 20;

fn need(holds: bool, field: &'static str, value: &dyn ToString, allowed: &'static str) -> Result<(), TrainError> {
    if holds { Ok(()) } else { Err(TrainError::BadLoss { field, value: value.to_string(), allowed }) }
}

#[cfg(test)]
mod tests {
    use super::{CameraError, LossConfig, Norm, TermWeights, Trim};

    #[test]
    fn a_file_may_name_a_few_fields_and_no_others() {
        let text = r#"{"camera": {"huber": {"delta": 0.5}}, "trim": "none", "weights": {"score": 0.3}}"#;
        let read: LossConfig = serde_json::from_str(text).unwrap();
        let weights = TermWeights::default().score(0.3);
        let want = LossConfig::release().camera(CameraError::Huber { delta: 0.5 }).trim(Trim::None).weights(weights);
        assert_eq!(read, want);
        let error = serde_json::from_str::<LossConfig>(r#"{"lambda_1": 1}"#).unwrap_err().to_string();
        assert!(error.contains("lambda_1") && error.contains("`lambda1`"), "{error}");
    }

    #[test]
    fn presets_are_written_and_read_back() {
        for preset in [LossConfig::release(), LossConfig::paper()] {
            preset.check().unwrap();
            let text = serde_json::to_string(&preset).unwrap();
            assert_eq!(serde_json::from_str::<LossConfig>(&text).unwrap(), preset, "{text}");
        }
        assert_ne!(LossConfig::release().track_norm, LossConfig::paper().track_norm);
        assert_eq!(LossConfig::default().track_norm, Norm::L2);
    }

    #[test]
    fn numbers_that_cannot_be_are_named() {
        let trim = |keep, largest| LossConfig::release().trim(Trim::Quantile { keep, above: 0, largest });
        let many = Trim::Quantile { keep: 0.5, above: u32::MAX, largest: 1.0 };
        let cases = [
            (LossConfig::release().lambda2(f32::NAN), "loss.lambda2 is NaN"),
            (LossConfig::release().weights(TermWeights::default().ray(-1.0)), "loss.weights.ray is -1"),
            (trim(0.0, 100.0), "loss.trim.quantile.keep is 0"),
            (trim(0.5, f32::INFINITY), "loss.trim.quantile.largest is inf"),
            (LossConfig::release().trim(many), "loss.trim.quantile.above is 4294967295"),
            (LossConfig::paper().camera(CameraError::Huber { delta: 0.0 }), "loss.camera.huber.delta is 0"),
            (LossConfig::paper().moving_share(Some(0.0)), "loss.moving_share is 0: above 0, at most 1"),
            (LossConfig::paper().slope_scales(0), "loss.slope_scales is 0: from 1 to 8"),
            (LossConfig::paper().least_entries(u32::MAX), "loss.least_entries"),
            (LossConfig::paper().camera_weights([1.0, f32::INFINITY, 1.0]), "loss.camera_weights[1] is inf"),
        ];
        for (config, want) in cases {
            let error = config.check().unwrap_err().to_string();
            assert!(error.starts_with(want), "{error}; {want}");
        }
    }
}
