//! What a network expects of a checkpoint, and the comparison of the two.

use std::collections::BTreeSet;
use std::fmt;

use crate::view::Dtype;
use crate::{Checkpoint, WeightsError, describe};

/// Names shown of each kind of difference before "and N more".
const SHOWN: usize = 10;

/// Whether a tensor must be there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Requirement {
    /// The network cannot run without it.
    Required,
    /// Checked when there, not missed when not.
    Optional,
}

/// One expected tensor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Expected {
    /// Logical name.
    pub name: String,
    /// Sizes, outermost first.
    pub shape: Vec<usize>,
    /// Whether it must be there.
    pub requirement: Requirement,
}

/// The tensors that a network expects, and the parts of a file that it knows and leaves out.
#[derive(Debug, Clone, Default)]
pub struct Manifest {
    expected: Vec<Expected>,
    ignored: Vec<String>,
}

impl Manifest {
    /// An empty manifest.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a tensor that must be there.
    pub fn require(&mut self, name: impl Into<String>, shape: &[usize]) -> &mut Self {
        self.push(name.into(), shape, Requirement::Required)
    }

    /// Adds a tensor that may be there.
    pub fn optional(&mut self, name: impl Into<String>, shape: &[usize]) -> &mut Self {
        self.push(name.into(), shape, Requirement::Optional)
    }

    /// Adds the beginning of logical names that are known and left out, such as `gs_head.`.
    pub fn ignore(&mut self, beginning: impl Into<String>) -> &mut Self {
        self.ignored.push(beginning.into());
        self
    }

    /// The expected tensors, in the order they were added.
    #[must_use]
    pub fn expected(&self) -> &[Expected] {
        &self.expected
    }

    fn push(&mut self, name: String, shape: &[usize], requirement: Requirement) -> &mut Self {
        self.expected.push(Expected { name, shape: shape.to_vec(), requirement });
        self
    }
}

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

/// Compares names, shapes and types; reads no data.
#[must_use]
pub fn check(checkpoint: &Checkpoint, manifest: &Manifest) -> CheckReport {
    let mut report = CheckReport {
        seems: describe(checkpoint),
        path: checkpoint.path().display().to_string(),
        ..CheckReport::default()
    };
    let mut used = BTreeSet::new();
    for Expected { name, shape, requirement } in manifest.expected() {
        let full = checkpoint.resolve(name);
        let Some((full, info)) = full.and_then(|full| Some((full, checkpoint.info(name)?))) else {
            if *requirement == Requirement::Required {
                report.missing.push(name.clone());
            }
            continue;
        };
        used.insert(full);
        if info.shape != *shape {
            report.wrong_shape.push(WrongShape {
                name: name.clone(),
                expected: shape.clone(),
                found: info.shape.clone(),
            });
        } else if Dtype::parse(&info.dtype).is_none() {
            report.unsupported.push((name.clone(), info.dtype.clone()));
        }
    }
    for (full, _) in checkpoint.tensors().filter(|(full, _)| !used.contains(*full)) {
        match full.strip_prefix(checkpoint.key_prefix()) {
            None => report.ignored.push(full.to_owned()),
            Some(name) if manifest.ignored.iter().any(|start| name.starts_with(start.as_str())) => {
                report.ignored.push(name.to_owned());
            }
            Some(name) => report.surplus.push(name.to_owned()),
        }
    }
    report
}

impl CheckReport {
    /// Whether the network can be loaded. Surplus tensors do not prevent that.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.missing.is_empty() && self.wrong_shape.is_empty() && self.unsupported.is_empty()
    }

    /// The report itself when the network can be loaded, so that surplus tensors can be told.
    ///
    /// # Errors
    /// [`WeightsError::Mismatch`] naming the first differences of each kind, their number, and what the file seems to be.
    pub fn into_result(self) -> Result<Self, WeightsError> {
        if self.is_usable() { Ok(self) } else { Err(WeightsError::Mismatch { report: Box::new(self) }) }
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
