//! The catalogue of a furniture library, as Sweet Home 3D writes it: a properties file with numbered keys, lengths in centimetres.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};

/// The file's name in a library.
pub(crate) const CATALOGUE: &str = "PluginFurnitureCatalog.properties";

/// One piece of furniture.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Entry {
    /// The model's file, from the root of the library.
    pub(crate) model: String,
    /// Width, depth and height in metres.
    pub(crate) size: DVec3,
    /// Turns the model, in its own axes, before it is scaled to the size.
    pub(crate) rotation: DMat3,
    /// Of its foot above the floor, in metres.
    pub(crate) elevation: f64,
    /// Height in metres, from its foot, at which things can stand on it; nothing where none can.
    pub(crate) top: Option<f64>,
    /// A door, a window or stairs: nothing that can stand anywhere.
    pub(crate) built_in: bool,
    /// Whether it gives light.
    pub(crate) light: bool,
}

/// The entries of a catalogue in the order of their numbers, and how many lack a size or a model.
pub(crate) fn entries(text: &str) -> (Vec<Entry>, usize) {
    let mut all: BTreeMap<u32, BTreeMap<&str, String>> = BTreeMap::new();
    for line in text.lines().map(str::trim).filter(|line| !line.starts_with(['#', '!'])) {
        let Some((key, value)) = line.split_once('=') else { continue };
        let Some((key, number)) = key.trim().split_once('#') else { continue };
        if let Ok(number) = number.parse() {
            all.entry(number).or_default().insert(key, plain(value.trim()));
        }
    }
    let count = all.len();
    let entries: Vec<Entry> = all.values().filter_map(entry).collect();
    let bad = count - entries.len();
    (entries, bad)
}

fn entry(values: &BTreeMap<&str, String>) -> Option<Entry> {
    let number = |key: &str| values.get(key)?.parse::<f64>().ok().filter(|v| v.is_finite());
    let length = |key| number(key).filter(|v| (0.1..=10_000.0).contains(v)).map(|v| v / 100.0);
    let size = DVec3::new(length("width")?, length("depth")?, length("height")?);
    let is = |key: &str| values.get(key).is_some_and(|value| value == "true");
    let rotation = values.get("modelRotation").and_then(|text| {
        let all: Vec<f64> = text.split_whitespace().filter_map(|v| v.parse().ok()).collect();
        // By rows.
        <[f64; 9]>::try_from(all).ok().map(|all| DMat3::from_cols_array(&all).transpose())
    });
    // What it is without the key is the top of the box, of figures and plants as well.
    let top = number("dropOnTopElevation").filter(|top| *top > 0.0).map(|top| top / 100.0);
    let stairs =
        values.get("category").is_some_and(|category| category == "Staircases" || category == "Doors and windows");
    Some(Entry {
        model: values.get("model")?.clone(),
        size,
        rotation: rotation.filter(|m| m.is_finite() && m.determinant() > 0.1).unwrap_or(DMat3::IDENTITY),
        elevation: number("elevation").unwrap_or(0.0).clamp(0.0, 500.0) / 100.0,
        top,
        built_in: is("doorOrWindow") || stairs || values.contains_key("staircaseCutOutShape"),
        light: values.contains_key("lightSourceX"),
    })
}

/// A value without the escapes of properties files.
fn plain(value: &str) -> String {
    let (mut out, mut rest) = (String::new(), value);
    while let Some((before, after)) = rest.split_once('\\') {
        out.push_str(before);
        let code = after.strip_prefix('u').and_then(|hex| {
            char::from_u32(u32::from_str_radix(hex.get(..4)?, 16).ok()?).map(|letter| (letter, &hex[4..]))
        });
        if let Some((letter, after)) = code {
            out.push(letter);
            rest = after;
        } else {
            let mut letters = after.chars();
            out.extend(letters.next());
            rest = letters.as_str();
        }
    }
    out + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_read_and_bad_ones_counted() {
        let text = "id=Sweet#Home\nname#2=B\n# comment#1=x\nname#1=Ch\\u00e4ir\nmodel#1=/a/ch\\u00e4ir.obj\nwidth#1=59.4\ndepth#1=62\n\
            height#1=105\ndropOnTopElevation#1=42\nelevation#1=10\nmodelRotation#1=1 0 0 0 0 1 0 -1 0\nmodel#3=c.obj\nwidth#3=1e9\n\
            depth#3=2\nheight#3=3\nmodel#4=d.obj\nwidth#4=10\ndepth#4=20\nheight#4=30\ndoorOrWindow#4=true\ndropOnTopElevation#4=-1\n";
        let (all, bad) = entries(text);
        assert_eq!((all.len(), bad), (2, 2));
        assert_eq!(all[0].model, "/a/ch\u{e4}ir.obj");
        assert_eq!((all[0].size, all[0].elevation, all[0].top), (DVec3::new(0.594, 0.62, 1.05), 0.1, Some(0.42)));
        // Rows: y becomes what z was.
        assert_eq!(all[0].rotation * DVec3::Z, DVec3::Y);
        assert!(!all[0].built_in && all[1].built_in && all[1].top.is_none());
    }
}
