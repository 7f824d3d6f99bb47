//! Names of tensors: scopes, the prefix of a file, and tensors stored once under several names.
//!
//! A logical name such as `backbone.pretrained.blocks.3.norm1.weight` is stored as `prefix + name`. Published Depth
//! Anything 3 files use `model.` (nested ones `model.da3.`), OmniX files `net.`, bare states none.

use std::collections::BTreeMap;
use std::fmt::{self, Display};

/// The prefixes under which networks are stored, the likeliest first.
pub const PREFIXES: [&str; 4] = ["model.", "net.", "", "model.da3."];

/// How the names of the metric network inside a nested one begin: its tensors lie beside those of the any-view network, not below them
/// (`model.da3_metric.` beside `model.da3.`).
pub const METRIC: &str = "da3_metric";

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

/// The prefix under which most of [`PROBES`] are among the `stored` names; none if not one is there.
///
/// On ties the configured one, then those of [`PREFIXES`], then one that ends with one of those (training programs wrap networks
/// and save `module.net.…`), then the shortest.
#[must_use]
pub fn detect_prefix<'a>(configured: Option<&'a str>, stored: &[&'a str]) -> Option<&'a str> {
    let ends_as = |full: &'a str, probe: &str| {
        // A whole name: `x.cls_token` is not behind the prefix `x`.
        full.strip_suffix(probe).filter(|prefix| prefix.is_empty() || prefix.ends_with('.'))
    };
    let mut hits: BTreeMap<&str, usize> = BTreeMap::new();
    for prefix in stored.iter().flat_map(|full| PROBES.iter().filter_map(|probe| ends_as(full, probe))) {
        *hits.entry(prefix).or_default() += 1;
    }
    let known = |fits: &dyn Fn(&str) -> bool| PREFIXES.iter().position(|p| fits(p)).unwrap_or(PREFIXES.len());
    let rank = |prefix: &str| {
        let wrapped = |p: &str| !p.is_empty() && prefix.ends_with(p);
        (configured != Some(prefix), known(&|p| p == prefix), known(&wrapped), prefix.len())
    };
    // The last of equals is taken: `BTreeMap` goes through names in order, which makes the choice one of names alone.
    hits.into_iter().max_by_key(|(prefix, hits)| (*hits, std::cmp::Reverse(rank(prefix)))).map(|(prefix, _)| prefix)
}

/// The full name of a tensor of the metric network in a nested file with this prefix (that of its any-view network).
#[must_use]
pub fn beside(prefix: &str, name: &str) -> Option<String> {
    let rest = name.strip_prefix(METRIC).filter(|rest| rest.starts_with('.'))?;
    Some(format!("{}{METRIC}{rest}", prefix.strip_suffix("da3.")?))
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
        let named =
            |prefix: &str, probes: usize| PROBES[..probes].iter().map(|p| format!("{prefix}{p}")).collect::<Vec<_>>();
        let detect = |configured: Option<&'static str>, parts: &[(&str, usize)]| {
            let stored: Vec<String> = parts.iter().flat_map(|(prefix, probes)| named(prefix, *probes)).collect();
            let stored: Vec<&str> = stored.iter().map(String::as_str).collect();
            detect_prefix(configured, &stored).map(str::to_owned)
        };
        assert_eq!(detect(None, &[("net.", 2), ("", 1)]).as_deref(), Some("net."));
        assert_eq!(detect(None, &[("other.", 0)]), None);
        for wrapped in ["module.", "module.net.", "_orig_mod.model.", "anything."] {
            assert_eq!(detect(None, &[(wrapped, 4)]).as_deref(), Some(wrapped));
        }
        // A copy of averaged weights beside the network, and the two networks of a nested one.
        assert_eq!(detect(None, &[("ema.net.", 4), ("net.", 4)]).as_deref(), Some("net."));
        assert_eq!(detect(None, &[("model.da3.", 4), ("model.da3_metric.", 4)]).as_deref(), Some("model.da3."));
        let nested = [("module.model.da3.", 4), ("module.model.da3_metric.", 4)];
        assert_eq!(detect(None, &nested).as_deref(), Some("module.model.da3."));
        // The configuration decides between equals, and not against the file.
        assert_eq!(detect(Some("b."), &[("net.", 4), ("b.", 4)]).as_deref(), Some("b."));
        assert_eq!(detect(Some("net."), &[("model.", 4)]).as_deref(), Some("model."));
        assert_eq!(detect_prefix(None, &["xbackbone.pretrained.cls_token"]), None);
    }

    #[test]
    fn the_metric_network_lies_beside_the_other() {
        let found = beside("model.da3.", "da3_metric.head.norm.bias");
        assert_eq!(found.as_deref(), Some("model.da3_metric.head.norm.bias"));
        assert_eq!(beside("da3.", "da3_metric.x").as_deref(), Some("da3_metric.x"));
        for (prefix, name) in [("model.", "da3_metric.x"), ("model.da3.", "da3_metrics.x"), ("model.da3.", "x")] {
            assert_eq!(beside(prefix, name), None, "{prefix} {name}");
        }
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
