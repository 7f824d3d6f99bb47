//! The differences between a checkpoint and what a network expects of it, as data and as one message.

use std::fmt;

/// Names shown of each kind of difference before "and N more".
const SHOWN: usize = 10;

/// A tensor whose stored shape is not the expected one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WrongShape {
    /// Logical name.
    pub name: String,
    /// The shape that the network expects.
    pub expected: Vec<usize>,
    /// The shape in the file.
    pub found: Vec<usize>,
}

/// The differences between a checkpoint and a manifest; names are logical, lists in the order of the manifest or, for
/// `surplus` and `ignored`, of the names.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct CheckReport {
    /// Required tensors that are absent.
    pub missing: Vec<String>,
    /// Tensors of another shape.
    pub wrong_shape: Vec<WrongShape>,
    /// Expected tensors of an element type that cannot be converted: name and type.
    pub unsupported: Vec<(String, String)>,
    /// Tensors that nobody expects.
    pub surplus: Vec<String>,
    /// Tensors left out on purpose: ignored by the manifest, or (full names) outside the file's prefix.
    pub ignored: Vec<String>,
    /// What the file seems to be, by its names and shapes.
    pub seems: String,
    /// The checkpoint's path.
    pub path: String,
}

impl CheckReport {
    /// Whether the network can be loaded. Surplus tensors do not prevent that.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.missing.is_empty() && self.wrong_shape.is_empty() && self.unsupported.is_empty()
    }
}

impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shapes = self.wrong_shape.iter().map(|w| format!("{} {:?} instead of {:?}", w.name, w.found, w.expected));
        let types = self.unsupported.iter().map(|(name, dtype)| format!("{name} {dtype}"));
        let parts = [
            list("missing", self.missing.iter().cloned()),
            list("of another shape", shapes),
            list("of a type that cannot be used", types),
            list("surplus", self.surplus.iter().cloned()),
        ];
        for part in parts.iter().flatten() {
            write!(f, "{part}; ")?;
        }
        write!(f, "the file seems to be {}: {}", self.seems, self.path)
    }
}

/// `3 missing (a, b, c)`, or nothing for no items.
fn list(kind: &str, items: impl ExactSizeIterator<Item = String>) -> Option<String> {
    let count = items.len();
    if count == 0 {
        return None;
    }
    let mut shown = items.take(SHOWN).collect::<Vec<_>>().join(", ");
    if count > SHOWN {
        shown.push_str(&format!(", and {} more", count - SHOWN));
    }
    Some(format!("{count} {kind} ({shown})"))
}
