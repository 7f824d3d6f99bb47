//! `config.json` and the index of shards, read with limits: both come from strangers, and real ones are small.

use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::path::Path;

use omnix_tensors::{TensorError, read_text};
use serde::de::{Deserialize, DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};

use crate::WeightsError;

/// Bytes of a `config.json`; published ones have a few thousand.
const MAX_CONFIG: u64 = 1 << 20;
/// Bytes of an index: about a hundred for each tensor of the largest published models, many times over.
const MAX_INDEX: u64 = 32 << 20;

/// Reads and parses `config.json`, which must be a JSON object.
pub(crate) fn read_config(path: &Path) -> Result<Value, WeightsError> {
    match read_text(path, MAX_CONFIG) {
        Ok(text) => parse_config(&text, path),
        Err(TensorError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => {
            Err(WeightsError::ConfigMissing { path: path.to_owned() })
        }
        Err(TensorError::Io { source, .. }) if source.kind() == io::ErrorKind::InvalidData => {
            Err(WeightsError::ConfigInvalid { path: path.to_owned(), reason: source.to_string() })
        }
        Err(other) => Err(other.into()),
    }
}

/// Parses the text of a `config.json`.
pub(crate) fn parse_config(text: &str, path: &Path) -> Result<Value, WeightsError> {
    let invalid = |reason: String| WeightsError::ConfigInvalid { path: path.to_owned(), reason };
    let Once(config) = serde_json::from_str(text).map_err(|e| invalid(e.to_string()))?;
    if config.is_object() { Ok(config) } else { Err(invalid("it is no object".to_owned())) }
}

/// The file name of each tensor's shard, from an index file.
pub(crate) fn read_index(path: &Path) -> Result<BTreeMap<String, String>, WeightsError> {
    let bad = |reason: String| WeightsError::BadIndex { path: path.to_owned(), reason };
    let text = read_text(path, MAX_INDEX).map_err(|e| match e {
        TensorError::Io { source, .. } if source.kind() == io::ErrorKind::InvalidData => bad(source.to_string()),
        other => other.into(),
    })?;
    let index: Index = serde_json::from_str(&text).map_err(|e| bad(e.to_string()))?;
    index.weight_map.map(|map| map.0).ok_or_else(|| bad("it has no weight_map".to_owned()))
}

/// What is read of an index; fields beside it are passed over.
#[derive(serde::Deserialize)]
struct Index {
    weight_map: Option<Names>,
}

/// Strings by names that occur once.
struct Names(BTreeMap<String, String>);

impl<'de> Deserialize<'de> for Names {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read;

        impl<'de> Visitor<'de> for Read {
            type Value = Names;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a weight_map from names of tensors to names of files")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Names, A::Error> {
                let mut names = BTreeMap::new();
                while let Some((tensor, file)) = map.next_entry::<String, String>()? {
                    if let Some(file) = names.insert(tensor, file) {
                        return Err(A::Error::custom(format_args!("a tensor of {file} is there twice")));
                    }
                }
                Ok(Names(names))
            }
        }

        deserializer.deserialize_map(Read)
    }
}

/// A JSON value in which no object names a field twice. (serde_json's own keeps the last, so that a reader of the file and the
/// program may see different networks.)
struct Once(Value);

impl<'de> Deserialize<'de> for Once {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        ReadOnce.deserialize(deserializer).map(Self)
    }
}

struct ReadOnce;

impl<'de> DeserializeSeed<'de> for ReadOnce {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for ReadOnce {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_unit<E: Error>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = list.next_element_seed(ReadOnce)? {
            values.push(value);
        }
        Ok(values.into())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let mut fields = Map::new();
        while let Some(name) = map.next_key::<String>()? {
            if fields.contains_key(&name) {
                return Err(A::Error::custom(format_args!("`{}` is there twice", name.escape_debug())));
            }
            fields.insert(name, map.next_value_seed(ReadOnce)?);
        }
        Ok(fields.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_occur_once_at_every_depth() {
        let parse = |text: &str| parse_config(text, Path::new("config.json"));
        let text = r#"{"a": [1, -2, 1.5, null, true, "x", {"b": {}}], "c": {"a": 18446744073709551615}}"#;
        assert_eq!(parse(text).unwrap(), serde_json::from_str::<Value>(text).unwrap());
        for twice in [r#"{"a": 1, "a": 1}"#, r#"{"c": [{"d": {"a": 1, "a": 2}}]}"#] {
            let message = parse(twice).unwrap_err().to_string();
            assert!(message.contains("`a` is there twice") && message.contains("line 1"), "{message}");
        }
        assert!(parse("[]").unwrap_err().to_string().contains("no object"));
    }
}
