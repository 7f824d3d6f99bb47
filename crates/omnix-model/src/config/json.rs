//! A configuration from its file, and the published ones.

use serde_json::Value;

use super::fields::Fields;
use super::{NetworkConfig, da3, omnix};
use crate::ModelError;

impl NetworkConfig {
    /// Reads a `config.json` of either format and checks every value.
    ///
    /// # Errors
    /// [`ModelError::FieldMissing`] and [`ModelError::BadField`] name the field.
    pub fn from_json(value: &Value) -> Result<Self, ModelError> {
        let root = Fields::root(value)?;
        let config = if root.get("format").is_some() { omnix::read(&root)? } else { da3::read(&root)? };
        config.check()?;
        Ok(config)
    }

    /// da3-small.
    #[must_use]
    pub fn small() -> Self {
        da3::published("da3-small", &da3::SMALL)
    }

    /// da3-base.
    #[must_use]
    pub fn base() -> Self {
        da3::published("da3-base", &da3::BASE)
    }

    /// da3-large.
    #[must_use]
    pub fn large() -> Self {
        da3::published("da3-large", &da3::LARGE)
    }

    /// da3metric-large; da3mono-large is the same with another unit.
    #[must_use]
    pub fn metric() -> Self {
        da3::published("da3metric-large", &da3::SINGLE)
    }

    /// da3nested-giant-large: giant, and the metric network beside it.
    #[must_use]
    pub fn nested() -> Self {
        da3::published_nested()
    }

    /// da3-giant.
    #[must_use]
    pub fn giant() -> Self {
        da3::published("da3-giant", &da3::GIANT)
    }
}
