//! The JSON of a header, parsed as a stream: no tree of values, nothing kept but what the header's types hold.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

use crate::info::{Header, TensorInfo};
use crate::{Dtype, TensorError};

/// Tensors of one file; the largest published models have some thousands.
const MAX_TENSORS: usize = 1 << 18;
/// Strings of the metadata.
const MAX_METADATA: usize = 1 << 16;
/// Dimensions of a tensor, as PyTorch has them at most.
const MAX_RANK: usize = 64;
/// Bytes of a tensor's name.
const MAX_NAME: usize = 4096;
/// Bytes of a type's name.
const MAX_TYPE: usize = 32;

/// Parses all entries; their byte ranges count from the start of the data.
pub(crate) fn read(json: &[u8], path: &Path) -> Result<Header, TensorError> {
    let mut header = Header::default();
    let mut current = None;
    let mut parser = serde_json::Deserializer::from_slice(json);
    let entries = Entries { header: &mut header, current: &mut current };
    let Err(error) = parser.deserialize_map(entries).and_then(|()| parser.end()) else { return Ok(header) };
    let path = path.to_owned();
    Err(match current {
        // JSON, but not what belongs there.
        Some(tensor) if error.is_data() => TensorError::BadHeader { path, tensor, reason: error.to_string() },
        _ if error.is_data() => TensorError::NotSafetensors { path, reason: format!("its header: {error}") },
        _ => TensorError::NotSafetensors { path, reason: format!("its header is not JSON: {error}") },
    })
}

/// The outermost object.
struct Entries<'a> {
    header: &'a mut Header,
    /// The tensor whose entry is read, for messages.
    current: &'a mut Option<String>,
}

impl<'de> Visitor<'de> for Entries<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object of tensors")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut has_metadata = false;
        while let Some(name) = map.next_key_seed(Text { limit: MAX_NAME, what: "a tensor's name" })? {
            if name == "__metadata__" {
                if std::mem::replace(&mut has_metadata, true) {
                    return Err(A::Error::custom("__metadata__ is there twice"));
                }
                self.header.metadata = map.next_value_seed(Metadata)?;
                continue;
            }
            if self.header.tensors.len() == MAX_TENSORS {
                return Err(A::Error::custom(format_args!("more than {MAX_TENSORS} tensors")));
            }
            *self.current = Some(name.clone());
            if self.header.tensors.contains_key(&name) {
                return Err(A::Error::custom("its name is there twice"));
            }
            let info = map.next_value_seed(Entry)?;
            self.header.tensors.insert(name, info);
            *self.current = None;
        }
        Ok(())
    }
}

/// The entry of one tensor; its range still counts from the start of the data.
struct Entry;

impl<'de> DeserializeSeed<'de> for Entry {
    type Value = TensorInfo;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<TensorInfo, D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for Entry {
    type Value = TensorInfo;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object with dtype, shape and data_offsets")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<TensorInfo, A::Error> {
        let (mut dtype, mut shape, mut offsets) = (None, None, None);
        while let Some(key) = map.next_key_seed(Text { limit: MAX_NAME, what: "a field's name" })? {
            let again = match key.as_str() {
                "dtype" => dtype.replace(map.next_value_seed(Text { limit: MAX_TYPE, what: "its dtype" })?).is_some(),
                "shape" => shape.replace(map.next_value_seed(Sizes { most: MAX_RANK, what: "sizes" })?).is_some(),
                "data_offsets" => offsets.replace(map.next_value_seed(Sizes { most: 2, what: "offsets" })?).is_some(),
                _ => {
                    map.next_value::<IgnoredAny>()?;
                    false
                }
            };
            if again {
                return Err(A::Error::custom(format_args!("its {key} is there twice")));
            }
        }
        let dtype = dtype.ok_or_else(|| A::Error::custom("it has no dtype"))?;
        let shape = shape.ok_or_else(|| A::Error::custom("it has no shape"))?;
        let Some([begin, end]) = offsets.as_deref() else {
            return Err(A::Error::custom("its data_offsets are not two numbers"));
        };
        tensor(dtype, shape, *begin..*end).map_err(A::Error::custom)
    }
}

/// Checks that the sizes fill the bytes.
fn tensor(dtype: String, shape: Vec<usize>, range: std::ops::Range<usize>) -> Result<TensorInfo, String> {
    if range.start > range.end {
        return Err(format!("its data ends at {}, before it begins at {}", range.end, range.start));
    }
    let elements = shape
        .iter()
        .try_fold(1usize, |product, &n| product.checked_mul(n))
        .ok_or_else(|| format!("its shape {shape:?} overflows"))?;
    if let Some(known) = Dtype::parse(&dtype)
        && elements.checked_mul(known.size()) != Some(range.len())
    {
        return Err(format!("{dtype} of shape {shape:?} does not fill its {} bytes", range.len()));
    }
    Ok(TensorInfo { dtype, shape, range })
}

/// The strings of `__metadata__`.
struct Metadata;

impl<'de> DeserializeSeed<'de> for Metadata {
    type Value = BTreeMap<String, String>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for Metadata {
    type Value = BTreeMap<String, String>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("metadata that is an object of strings")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let text = |what| Text { limit: usize::MAX, what };
        let mut found = BTreeMap::new();
        while let Some(key) = map.next_key_seed(text("a name of the metadata"))? {
            if found.len() == MAX_METADATA {
                return Err(A::Error::custom(format_args!("more than {MAX_METADATA} strings of metadata")));
            }
            let value = map.next_value_seed(text("a string of the metadata"))?;
            if found.insert(key, value).is_some() {
                return Err(A::Error::custom("a name of the metadata is there twice"));
            }
        }
        Ok(found)
    }
}

/// A string of at most `limit` bytes.
struct Text {
    limit: usize,
    what: &'static str,
}

impl<'de> DeserializeSeed<'de> for Text {
    type Value = String;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<String, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl Visitor<'_> for Text {
    type Value = String;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} that is a string", self.what)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<String, E> {
        if text.len() > self.limit {
            return Err(E::custom(format_args!(
                "{} of {} bytes; at most {} are read",
                self.what,
                text.len(),
                self.limit
            )));
        }
        Ok(text.to_owned())
    }
}

/// A list of at most `most` whole numbers.
struct Sizes {
    most: usize,
    what: &'static str,
}

impl<'de> DeserializeSeed<'de> for Sizes {
    type Value = Vec<usize>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Vec<usize>, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Sizes {
    type Value = Vec<usize>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a list of {} that are whole numbers", self.what)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<usize>, A::Error> {
        let mut sizes = Vec::new();
        while let Some(size) = list.next_element()? {
            if sizes.len() == self.most {
                return Err(A::Error::custom(format_args!("more than {} {}", self.most, self.what)));
            }
            sizes.push(size);
        }
        Ok(sizes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(json: &str) -> String {
        read(json.as_bytes(), Path::new("f")).unwrap_err().to_string()
    }

    #[test]
    fn names_occur_once() {
        let entry = r#"{"dtype":"U8","shape":[1],"data_offsets":[0,1]}"#;
        let message = error(&format!(r#"{{"a":{entry},"b":{entry},"a":{entry}}}"#));
        assert!(message.contains("tensor a") && message.contains("twice"), "{message}");
        assert!(error(r#"{"__metadata__":{},"__metadata__":{}}"#).contains("__metadata__ is there twice"));
        assert!(error(r#"{"__metadata__":{"k":"1","k":"2"}}"#).contains("metadata is there twice"));
        let message = error(r#"{"a":{"dtype":"U8","dtype":"I8","shape":[1],"data_offsets":[0,1]}}"#);
        assert!(message.contains("tensor a") && message.contains("dtype is there twice"), "{message}");
    }

    #[test]
    fn what_could_be_repeated_has_a_limit() {
        let many = |n: usize, item: &dyn Fn(usize) -> String| (0..n).map(item).collect::<Vec<_>>().join(",");
        let shape = many(MAX_RANK + 1, &|_| "1".to_owned());
        let message = error(&format!(r#"{{"a":{{"dtype":"U8","shape":[{shape}],"data_offsets":[0,1]}}}}"#));
        assert!(message.contains("tensor a") && message.contains("more than 64 sizes"), "{message}");
        let metadata = many(MAX_METADATA + 1, &|i| format!(r#""{i}":"""#));
        assert!(error(&format!(r#"{{"__metadata__":{{{metadata}}}}}"#)).contains("more than 65536 strings"));
        let tensors = many(MAX_TENSORS + 1, &|i| format!(r#""{i}":{{"dtype":"U8","shape":[0],"data_offsets":[0,0]}}"#));
        assert!(error(&format!("{{{tensors}}}")).contains("more than 262144 tensors"));
        let name = "n".repeat(MAX_NAME + 1);
        assert!(error(&format!(r#"{{"{name}":7}}"#)).contains("a tensor's name of 4097 bytes"));
        let message = error(&format!(r#"{{"a":{{"dtype":"{}"}}}}"#, "X".repeat(33)));
        assert!(message.contains("its dtype of 33 bytes"), "{message}");
    }

    #[test]
    fn other_json_names_the_tensor() {
        for (entry, words) in [
            ("7", "an object with dtype"),
            (r#"{"dtype":7}"#, "its dtype that is a string"),
            (r#"{"dtype":"U8","shape":1}"#, "a list of sizes"),
            (r#"{"dtype":"U8","shape":[1.5]}"#, "usize"),
            (r#"{"dtype":"U8","shape":[-1]}"#, "usize"),
            (r#"{"dtype":"U8","shape":[1],"data_offsets":[0]}"#, "two numbers"),
            (r#"{"dtype":"U8","shape":[1],"data_offsets":[0,1,2]}"#, "more than 2 offsets"),
            (r#"{"dtype":"U8","shape":[2],"data_offsets":[0,1]}"#, "does not fill its 1 bytes"),
        ] {
            let message = error(&format!(r#"{{"a":{entry}}}"#));
            assert!(message.contains("tensor a") && message.contains(words), "{entry}: {message}");
        }
        assert!(error("{").contains("not JSON") && error("[]").contains("an object of tensors"));
        assert!(error("{} {}").contains("not JSON"));
        assert!(error(r#"{"__metadata__":{"k":7}}"#).contains("a string of the metadata"));
        // Fields of other readers are passed over, however deep.
        let deep = format!(
            r#"{{"a":{{"dtype":"U8","shape":[0],"data_offsets":[0,0],"x":{}{}}}}}"#,
            "[".repeat(100),
            "]".repeat(100)
        );
        assert!(read(deep.as_bytes(), Path::new("f")).unwrap().tensors.contains_key("a"));
    }
}
