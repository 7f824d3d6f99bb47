//! Which sequences of a data set are run, into which clips each is cut, and what a report says of both.

use crate::EvalError;
use crate::clips::ClipRule;

/// Told how many sequences are done, and of how many.
pub type Progress<'a> = dyn FnMut(u64, u64) + 'a;

/// The clips of a sequence, at least one.
pub(super) fn clips(rule: ClipRule, frames: usize) -> Result<Vec<Vec<usize>>, EvalError> {
    let clips = rule.cut(frames)?.clips;
    if clips.is_empty() {
        let reason = format!("its {frames} frames fill no clip ({})", rule.name());
        return Err(EvalError::Nothing { reason });
    }
    Ok(clips)
}

/// At most `most` of `count`, evenly spread from the first on.
pub(super) fn spread(count: usize, most: Option<usize>) -> impl Iterator<Item = usize> {
    let kept = count.min(most.unwrap_or(count));
    (0..kept).map(move |k| k * count / kept)
}

/// What a report says where not all sequences were evaluated.
pub(super) fn chosen(evaluated: usize, count: usize) -> Option<String> {
    (evaluated < count)
        .then(|| format!("{evaluated} of {count} sequences were run, evenly spread; the others were not looked at"))
}

/// The network of a report, and how it saw the pictures.
pub(super) fn network_note(name: &str) -> String {
    format!("predictions: the network {name}, run over one clip at a time")
}
