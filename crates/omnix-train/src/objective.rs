//! The table `[loss]` of a configuration: a preset by name, and beside it the fields of [`LossConfig`] that differ from it.
//!
//! ```toml
//! [loss]
//! preset = "paper"                  # or "release", which is also what holds without the key
//! camera = { huber = { delta = 0.2 } }
//! weights = { displacement = 1.0 }  # the other weights stay those of the preset
//! ```

use serde::de::{Deserialize, Deserializer, Error};
use serde_json::{Map, Value};

use crate::loss::LossConfig;

const PRESETS: &[&str] = &["release", "paper"];

/// Reads the table.
pub(crate) fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<LossConfig, D::Error> {
    let mut fields = Map::<String, Value>::deserialize(deserializer)?;
    let preset = match fields.remove("preset") {
        None => LossConfig::release(),
        Some(name) => match name.as_str() {
            Some("release") => LossConfig::release(),
            Some("paper") => LossConfig::paper(),
            Some(other) => return Err(D::Error::unknown_variant(other, PRESETS)),
            None => {
                return Err(D::Error::custom(format_args!(
                    "loss.preset is {name}: it is one of {}",
                    PRESETS.join(", ")
                )));
            }
        },
    };
    let mut value = serde_json::to_value(preset).map_err(D::Error::custom)?;
    lay_over(&mut value, Value::Object(fields));
    serde_json::from_value(value).map_err(D::Error::custom)
}

/// Objects field by field; anything else takes the place of what was there, and so does another choice (an object of one field).
fn lay_over(base: &mut Value, over: Value) {
    match (base, over) {
        (Value::Object(base), Value::Object(over)) => {
            let other_choice = base.len() == 1 && over.keys().any(|name| !base.contains_key(name));
            if other_choice {
                base.clear();
            }
            for (name, value) in over {
                lay_over(base.entry(name).or_insert(Value::Null), value);
            }
        }
        (base, over) => *base = over,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loss::{CameraError, Norm, TermWeights, Trim};

    #[derive(Debug, serde::Deserialize)]
    struct File {
        #[serde(deserialize_with = "read")]
        loss: LossConfig,
    }

    fn parse(text: &str) -> Result<LossConfig, String> {
        toml::from_str::<File>(&format!("[loss]\n{text}")).map(|file| file.loss).map_err(|e| e.message().to_owned())
    }

    #[test]
    fn a_preset_and_what_differs() {
        assert_eq!(parse("").unwrap(), LossConfig::release());
        assert_eq!(parse("preset = \"paper\"").unwrap(), LossConfig::paper());
        let text = "preset = \"paper\"\ntrack_norm = \"l2\"\ncamera = { huber = { delta = 0.5 } }\nweights = { displacement = 1.0 }";
        let weights = TermWeights::default().displacement(1.0);
        let wanted =
            LossConfig::paper().track_norm(Norm::L2).camera(CameraError::Huber { delta: 0.5 }).weights(weights);
        assert_eq!(parse(text).unwrap(), wanted);
        let wanted = LossConfig::release().trim(Trim::None).camera(CameraError::Huber { delta: 0.25 });
        assert_eq!(parse("trim = \"none\"\ncamera = { huber = { delta = 0.25 } }").unwrap(), wanted);
        let Trim::Quantile { keep, .. } = parse("trim = { quantile = { keep = 0.5 } }").unwrap().trim else { panic!() };
        assert_eq!(keep, 0.5);
    }

    #[test]
    fn misspelt_words_are_named() {
        assert!(parse("lamda1 = 1.0").unwrap_err().contains("`lamda1`"));
        assert!(parse("weights = { dispalcement = 1.0 }").unwrap_err().contains("`dispalcement`"));
        assert!(parse("preset = \"papre\"").unwrap_err().contains("`papre`"));
        assert!(parse("preset = 3").unwrap_err().contains("one of release, paper"));
    }
}
