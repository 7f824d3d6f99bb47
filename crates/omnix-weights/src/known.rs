//! Configurations of published networks, for files that come without one: a `.ckpt` has no `config.json` beside it.
//!
//! A network is recognised by names and shapes alone, and every tensor is compared with the configuration afterwards, as with any other.

use serde_json::{Value, json};

use crate::{Checkpoint, describe};

/// The network of OmniX's release (`spec/omnix.md` 1.1).
const OMNIX_RELEASE: &str = include_str!("known/omnix-release.json");

/// The configuration of the published network that a checkpoint seems to hold, and the network's name.
pub(crate) fn configuration(checkpoint: &Checkpoint) -> Option<(Value, &'static str)> {
    let size = describe::published_size(checkpoint)?;
    let has = |part: &str| describe::has_part(checkpoint, part);
    if has("st_mod.") {
        let config = serde_json::from_str(OMNIX_RELEASE).ok().filter(|_| size == "giant")?;
        return Some((config, "the network of OmniX's release"));
    }
    // The monocular and the metric network have the same tensors: only their configurations tell which is which.
    if !has("cam_dec.") {
        return None;
    }
    let name = match size {
        "small" => "da3-small",
        "base" => "da3-base",
        "large" => "da3-large",
        "giant" if describe::is_nested(checkpoint) => "da3nested-giant-large",
        _ => "da3-giant",
    };
    Some((json!({ "model_name": name }), name))
}
