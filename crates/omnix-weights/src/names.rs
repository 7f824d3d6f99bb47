//! Names of tensors: scopes, the prefix of a file, and tensors stored once under several names.
//!
//! A logical name such as `backbone.pretrained.blocks.3.norm1.weight` is stored as `prefix + name`. Published Depth
//! Anything 3 files use `model.` (nested ones `model.da3.`), OmniX files `net.`, bare states none.

use std::collections::BTreeMap;
use std::fmt::{self, Display};

/// The prefixes under which networks are stored, the likeliest first.
pub const PREFIXES: [&str; 4] = ["model.", "net.", "", "model.da3."];

/// Names that every supported network has; enough to tell the prefix of a file before its network is known.
pub const PROBES: [&str; 4] = [
    "backbone.pretrained.cls_token",
    "backbone.pretrained.pos_embed",
    "backbone.pretrained.patch_embed.proj.weight",
    "backbone.pretrained.norm.weight",
];

/// A place in the tree of names, joined by dots.
///
/// ```
/// let block = omnix_weights::Scope::root().pp("blocks").pp(3);
/// assert_eq!(block.name("norm1.weight"), "blocks.3.norm1.weight");
/// ```
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Scope {
    path: String,
}

impl Scope {
    /// The scope of unprefixed names.
    #[must_use]
    pub fn root() -> Self {
        Self::default()
    }

    /// The scope `part` (a name or a number, which may contain dots) below this one.
    #[must_use]
    pub fn pp(&self, part: impl Display) -> Self {
        Self { path: self.name(part) }
    }

    /// The full name of `leaf` in this scope.
    #[must_use]
    pub fn name(&self, leaf: impl Display) -> String {
        if self.path.is_empty() { leaf.to_string() } else { format!("{}.{leaf}", self.path) }
    }

    /// The scope's own path, without a dot at its end; empty for the root.
    #[must_use]
    pub fn path(&self) -> &str {
        &self.path
    }
}

impl Display for Scope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.path)
    }
}

/// The one of `candidates` under which most of the `expected` logical names are stored, by `contains(full name)`; the
/// first on ties. None when no candidate gives a hit.
pub fn detect_prefix<'a>(
    candidates: impl IntoIterator<Item = &'a str>,
    expected: &[&str],
    contains: impl Fn(&str) -> bool,
) -> Option<&'a str> {
    let mut best = None;
    let mut most = 0;
    for prefix in candidates {
        let hits = expected.iter().filter(|name| contains(&format!("{prefix}{name}"))).count();
        if hits > most {
            (best, most) = (Some(prefix), hits);
        }
    }
    best
}

/// Where a tensor that a file left out is stored instead.
///
/// The layer norm of the auxiliary head is one instance shared by four levels; published files keep level 0 only and map
/// the dropped full names to the kept one in `__metadata__` (`spec/da3.md` section 12). Where a conversion lost that
/// entry, the known names are mapped all the same. `full` and the result carry the prefix.
#[must_use]
pub fn alias(full: &str, metadata: &BTreeMap<String, String>) -> Option<String> {
    if let Some(kept) = metadata.get(full) {
        return Some(kept.clone());
    }
    const SHARED: &str = "head.scratch.output_conv2_aux.";
    let (before, after) = full.split_once(SHARED)?;
    let leaf = ["1.2.", "2.2.", "3.2."].iter().find_map(|level| after.strip_prefix(level))?;
    Some(format!("{before}{SHARED}0.2.{leaf}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scopes_join_with_dots() {
        let scope = Scope::root().pp("a.b").pp(12);
        assert_eq!(scope.path(), "a.b.12");
        assert_eq!(scope.name("weight"), "a.b.12.weight");
        assert_eq!(Scope::root().name("x"), "x");
    }

    #[test]
    fn the_prefix_with_most_hits_wins() {
        let stored = ["net.a", "net.b", "a"];
        let found = detect_prefix(PREFIXES, &["a", "b"], |n| stored.contains(&n));
        assert_eq!(found, Some("net."));
        assert_eq!(detect_prefix(PREFIXES, &["c"], |n| stored.contains(&n)), None);
    }

    #[test]
    fn dropped_names_lead_to_level_zero() {
        let none = BTreeMap::new();
        let full = "model.head.scratch.output_conv2_aux.3.2.bias";
        assert_eq!(alias(full, &none).as_deref(), Some("model.head.scratch.output_conv2_aux.0.2.bias"));
        assert_eq!(alias("model.head.scratch.output_conv2_aux.3.0.bias", &none), None);
        assert_eq!(alias("model.head.scratch.output_conv2_aux.0.2.bias", &none), None);
        let metadata = BTreeMap::from([("x".to_owned(), "y".to_owned())]);
        assert_eq!(alias("x", &metadata).as_deref(), Some("y"));
    }
}
