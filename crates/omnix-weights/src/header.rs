//! The header of a safetensors file, read without trust.
//!
//! Layout: 8 bytes little-endian N, then N bytes of JSON `{name: {dtype, shape, data_offsets: [begin, end]},
//! "__metadata__": {string: string}}`, then the data, which the tensors cover without gap or overlap. The format's own
//! crate is not used for reading: it says of a short file only that it is incomplete, refuses the whole file for one
//! tensor of an unknown type, and adds up offsets unchecked.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use serde_json::{Map, Value};

use crate::{TensorInfo, WeightsError};

/// The format's own limit on the header, in bytes.
const MAX_HEADER: u64 = 100_000_000;

/// A parsed header; byte ranges of the tensors count from the start of the file.
#[derive(Debug)]
pub(crate) struct Header {
    pub(crate) tensors: BTreeMap<String, TensorInfo>,
    pub(crate) metadata: BTreeMap<String, String>,
}

/// Parses and checks a header against the length of `bytes`, the whole file.
pub(crate) fn parse(bytes: &[u8], path: &Path) -> Result<Header, WeightsError> {
    let not = |reason: String| WeightsError::NotSafetensors { path: path.to_owned(), reason };
    recognise_others(bytes, path)?;
    let Some((length, rest)) = bytes.split_first_chunk::<8>() else {
        return Err(not(format!("it has only {} bytes", bytes.len())));
    };
    let length = u64::from_le_bytes(*length);
    if length > MAX_HEADER || rest.first().is_some_and(|&b| b != b'{') {
        return Err(not("its first bytes are no header".to_owned()));
    }
    if length > rest.len() as u64 {
        return Err(WeightsError::WrongLength {
            path: path.to_owned(),
            expected: length + 8,
            found: bytes.len() as u64,
        });
    }
    // `length` fits: it is at most the length of a slice.
    let (json, data) = rest.split_at(length as usize);
    let json: Map<String, Value> =
        serde_json::from_slice(json).map_err(|e| not(format!("its header is not JSON: {e}")))?;

    let mut header = Header { tensors: BTreeMap::new(), metadata: BTreeMap::new() };
    for (name, entry) in json {
        if name == "__metadata__" {
            let Value::Object(entries) = entry else {
                return Err(not("its metadata is no JSON object".to_owned()));
            };
            for (key, value) in entries {
                if let Value::String(value) = value {
                    header.metadata.insert(key, value);
                }
            }
        } else {
            let info = tensor_entry(&entry).map_err(|reason| WeightsError::BadHeader {
                path: path.to_owned(),
                tensor: name.clone(),
                reason,
            })?;
            header.tensors.insert(name, info);
        }
    }
    check_cover(&mut header, length + 8, data.len() as u64, path)?;
    Ok(header)
}

/// Tells the common wrong files apart, so that the message can name the cure.
fn recognise_others(bytes: &[u8], path: &Path) -> Result<(), WeightsError> {
    // The same bytes may begin a valid length, but then the header follows.
    if bytes.get(8) == Some(&b'{') {
        return Ok(());
    }
    // A zip archive (torch.save since 1.6) or a bare pickle of protocol 2 (before).
    if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"\x80\x02") {
        return Err(WeightsError::PyTorch { path: path.to_owned() });
    }
    let reason = if bytes.is_empty() {
        "it is empty"
    } else if bytes.starts_with(b"version https://git-lfs") {
        "it is a git-lfs pointer: run git lfs pull"
    } else if bytes.starts_with(b"<!") || bytes.starts_with(b"<html") {
        "it is a web page: the download went wrong"
    } else {
        return Ok(());
    };
    Err(WeightsError::NotSafetensors { path: path.to_owned(), reason: reason.to_owned() })
}

/// One entry; its range still counts from the start of the data.
fn tensor_entry(entry: &Value) -> Result<TensorInfo, String> {
    let dtype = entry.get("dtype").and_then(Value::as_str).ok_or("it has no dtype")?;
    let shape = numbers(entry.get("shape")).ok_or("its shape is no list of sizes")?;
    let offsets = numbers(entry.get("data_offsets")).ok_or("its data_offsets are no list of numbers")?;
    let [begin, end] = offsets[..] else {
        return Err("its data_offsets are not two numbers".to_owned());
    };
    if begin > end {
        return Err(format!("its data ends at {end}, before it begins at {begin}"));
    }
    let elements = shape
        .iter()
        .try_fold(1usize, |product, &n| product.checked_mul(n))
        .ok_or_else(|| format!("its shape {shape:?} overflows"))?;
    if let Some(size) = element_size(dtype)
        && elements.checked_mul(size) != Some(end - begin)
    {
        return Err(format!("{dtype} of shape {shape:?} does not fill its {} bytes", end - begin));
    }
    Ok(TensorInfo { dtype: dtype.to_owned(), shape, range: begin..end })
}

fn numbers(value: Option<&Value>) -> Option<Vec<usize>> {
    let list = value?.as_array()?;
    list.iter().map(|n| n.as_u64().and_then(|n| usize::try_from(n).ok())).collect()
}

/// Bytes of an element of the types whose size is a whole number of bytes; none for types unknown here.
fn element_size(dtype: &str) -> Option<usize> {
    Some(match dtype {
        "F64" | "I64" | "U64" | "C64" => 8,
        "F32" | "I32" | "U32" => 4,
        "F16" | "BF16" | "I16" | "U16" => 2,
        "I8" | "U8" | "BOOL" | "F8_E4M3" | "F8_E5M2" => 1,
        _ => return None,
    })
}

/// Checks that the tensors cover the data exactly, and moves their ranges by `start`, where the data begins.
fn check_cover(header: &mut Header, start: u64, found: u64, path: &Path) -> Result<(), WeightsError> {
    let bad = |tensor: &str, reason: String| WeightsError::BadHeader {
        path: path.to_owned(),
        tensor: tensor.to_owned(),
        reason,
    };
    let mut ranges: Vec<(Range<usize>, &str)> =
        header.tensors.iter().map(|(name, info)| (info.range.clone(), name.as_str())).collect();
    ranges.sort_by_key(|(range, _)| (range.start, range.end));
    let mut covered = 0;
    for (range, name) in &ranges {
        if range.start != covered {
            return Err(bad(name, format!("its data begins at {} instead of {covered}", range.start)));
        }
        covered = range.end;
    }
    let end = covered as u64;
    if end != found {
        // Saturating: a hostile header may name any offset; the numbers only go into the message.
        let (expected, found) = (start.saturating_add(end), start + found);
        return Err(WeightsError::WrongLength { path: path.to_owned(), expected, found });
    }
    // No overflow: every range ends within the file, and `start` is below its length.
    let start = start as usize;
    for info in header.tensors.values_mut() {
        info.range = info.range.start + start..info.range.end + start;
    }
    Ok(())
}
