//! A guess, from names and shapes alone, of what network a checkpoint holds; for messages and `weights info`.

use crate::{Checkpoint, names::METRIC};

/// Published networks by width and number of blocks (`spec/da3.md` section 1).
const SIZES: [(usize, usize, &str); 4] =
    [(384, 12, "small"), (768, 12, "base"), (1024, 24, "large"), (1536, 40, "giant")];

/// Says what a checkpoint seems to be, such as `Depth Anything 3, any-view, width 384, 12 blocks (small)`.
#[must_use]
pub fn describe(checkpoint: &Checkpoint) -> String {
    let has = |part: &str| has_part(checkpoint, part);
    let Some(width) = width(checkpoint) else {
        return unknown(checkpoint);
    };
    let blocks = count_blocks(checkpoint);
    let family = if has("st_mod.") {
        "OmniX"
    } else if is_nested(checkpoint) {
        "a nested Depth Anything 3 (with a metric network beside it)"
    } else if checkpoint.key_prefix().ends_with("da3.") {
        "the any-view part of a nested Depth Anything 3"
    } else {
        "Depth Anything 3"
    };
    let kind = if has("head.scratch.sky_output_conv2.") {
        ", monocular or metric"
    } else if has("cam_dec.") {
        ", any-view"
    } else {
        ""
    };
    let size = published_size(checkpoint).map(|name| format!(" ({name})"));
    let gaussian = if has("gs_head.") { ", with a Gaussian head" } else { "" };
    format!("{family}{kind}, width {width}, {blocks} blocks{}{gaussian}", size.unwrap_or_default())
}

/// The size of the published network that has this width and number of blocks, if one has.
pub(crate) fn published_size(checkpoint: &Checkpoint) -> Option<&'static str> {
    let found = (width(checkpoint)?, count_blocks(checkpoint));
    SIZES.iter().find(|(width, blocks, _)| (*width, *blocks) == found).map(|(.., name)| *name)
}

/// Whether a metric network lies beside the any-view one.
pub(crate) fn is_nested(checkpoint: &Checkpoint) -> bool {
    checkpoint.info(&format!("{METRIC}.backbone.pretrained.cls_token")).is_some()
}

/// Whether there are tensors whose logical names begin like this.
pub(crate) fn has_part(checkpoint: &Checkpoint, part: &str) -> bool {
    let start = format!("{}{part}", checkpoint.key_prefix());
    checkpoint.tensors().any(|(name, _)| name.starts_with(&start))
}

fn width(checkpoint: &Checkpoint) -> Option<usize> {
    checkpoint.info("backbone.pretrained.cls_token")?.shape.last().copied()
}

fn count_blocks(checkpoint: &Checkpoint) -> usize {
    let start = format!("{}backbone.pretrained.blocks.", checkpoint.key_prefix());
    let numbers = checkpoint.tensors().filter_map(|(name, _)| {
        let (number, _) = name.strip_prefix(&start)?.split_once('.')?;
        number.parse::<usize>().ok()
    });
    numbers.max().map_or(0, |last| last.saturating_add(1))
}

fn unknown(checkpoint: &Checkpoint) -> String {
    let first: Vec<&str> = checkpoint.tensors().map(|(name, _)| name).take(3).collect();
    if first.is_empty() {
        "empty".to_owned()
    } else {
        format!("neither Depth Anything 3 nor OmniX (its tensors begin with {})", first.join(", "))
    }
}
