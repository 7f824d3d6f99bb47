//! What checks of a configuration have in common.

use omnix_graph::ops::WIDEST_HEAD;

use crate::ModelError;

/// No published width comes near; larger ones are slips of the pen.
pub(super) const WIDEST: usize = 1 << 16;

/// Complains unless the first holds: field, its value, what is allowed.
pub(super) type Need<'a> = &'a dyn Fn(bool, &'static str, &dyn std::fmt::Debug, String) -> Result<(), ModelError>;

/// Whether `width` channels split into `heads` that attention takes. Where they are `turned` (RoPE), half of a head turns by its
/// row and half by its column, each in pairs of channels.
pub(super) fn heads_fit(
    need: Need<'_>,
    field: &'static str,
    width: usize,
    heads: usize,
    turned: bool,
) -> Result<(), ModelError> {
    let step = if turned { 4 } else { 2 };
    let whole = heads > 0 && width.is_multiple_of(heads);
    let fits = whole && width / heads <= WIDEST_HEAD && (width / heads).is_multiple_of(step);
    need(fits, field, &heads, {
        format!("the width {width} must split into heads of {step}, {}, .. {WIDEST_HEAD} channels", 2 * step)
    })
}
