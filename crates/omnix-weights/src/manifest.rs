//! What a network expects of a checkpoint, and the comparison of the two.

use std::collections::BTreeSet;

use omnix_tensors::Dtype;

use crate::report::{CheckReport, WrongShape};
use crate::{Checkpoint, describe};

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
        } else if info.known().and_then(Dtype::float).is_none() {
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
