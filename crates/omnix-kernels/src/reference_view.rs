//! The reference view among s views, from their class tokens `[s, c]`, and the order of views with it in front:
//! `order = [ref, 0, 1, …, ref − 1, ref + 1, …]`, `inverse[order[i]] = i`.
//!
//! The scores are those of Depth Anything 3 (see `shaders/reference_view/reference_view.wgsl`). Networks choose a
//! reference from three views on; with one or two any strategy but [`Strategy::Middle`] and [`Strategy::Forced`]
//! still gives a valid order, which they do not use.

use omnix_shaders::reference_view as shaders;

use crate::{Arg, Caps, Dispatch, KernelError};

/// Input `[s, c]`.
pub const X: Arg = Arg(0);
/// Output u32 `[s]`.
pub const ORDER: Arg = Arg(1);
/// Output u32 `[s]`.
pub const INVERSE: Arg = Arg(2);
/// Output u32 `[1]`.
pub const REF: Arg = Arg(3);

/// How the reference view is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Strategy {
    /// View 0.
    First,
    /// View `s / 2`.
    Middle,
    /// The view nearest to the middle in mean similarity, length and variance of its class token.
    #[default]
    SaddleBalanced,
    /// The view of the largest range of similarities. Usually the two most similar views tie but for rounding, so
    /// another implementation may choose the other.
    SaddleSimRange,
    /// This view.
    Forced(u32),
}

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ReferenceView {
    /// Views.
    pub s: u32,
    /// Width of a class token.
    pub c: u32,
    /// How to choose.
    pub strategy: Strategy,
}

crate::layout::params! {
    /// `Params` of `shaders/reference_view`.
    pub struct ReferenceViewParams {
        s: u32,
        c: u32,
        stage: u32,
        start: u32,
        forced: u32,
        first: u32,
        end: u32,
        pad0: u32,
    }
}

const MEAN_SIMILARITY: u32 = 0;
const LENGTH: u32 = 1;
const VARIANCE: u32 = 2;
const RANGE: u32 = 3;
const SCORE: u32 = 4;
const CHOOSE: u32 = 5;
const WRITE: u32 = 6;

impl ReferenceView {
    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When there are no views, the forced one does not exist, or the tokens exceed the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let (kernel, Self { s, c, strategy }) = ("reference_view", *self);
        if s == 0 || c == 0 {
            return Err(KernelError::Unsupported { kernel, reason: format!("{s} views with tokens of {c} channels") });
        }
        let bytes = u64::from(s) * u64::from(c) * 4;
        if bytes > caps.max_binding {
            return Err(KernelError::RowTooLarge { kernel, bytes, limit: caps.max_binding });
        }
        // (stage, start, forced)
        let force = |view: u32| vec![(CHOOSE, 1, view)];
        let mut stages = match strategy {
            Strategy::First => force(0),
            Strategy::Middle => force(s / 2),
            Strategy::Forced(view) if view >= s => {
                let reason = format!("view {view} as the reference of {s}; views count from 0");
                return Err(KernelError::Unsupported { kernel, reason });
            }
            Strategy::Forced(view) => force(view),
            Strategy::SaddleSimRange => vec![(RANGE, 0, 0), (CHOOSE, 0, 0)],
            Strategy::SaddleBalanced => vec![
                (MEAN_SIMILARITY, 0, 0),
                (SCORE, 1, 0),
                (LENGTH, 0, 0),
                (SCORE, 0, 0),
                (VARIANCE, 0, 0),
                (SCORE, 0, 0),
                (CHOOSE, 0, 0),
            ],
        };
        stages.push((WRITE, 0, 0));
        let windows = [X.window(0, bytes), ORDER.into(), INVERSE.into(), REF.into()];
        let mut out = Vec::new();
        for (stage, start, forced) in stages {
            // Operations of a view: products with all views, its own numbers, or a look at each view.
            let each = match stage {
                MEAN_SIMILARITY | RANGE => 4 * u64::from(s) * u64::from(c),
                LENGTH | VARIANCE => 8 * u64::from(c),
                _ => 4 * u64::from(s),
            };
            let views = (caps.max_operations() / each / 64 * 64).clamp(64, u64::from(s).next_multiple_of(64)) as u32;
            for first in (0..s).step_by(views as usize) {
                let count = views.min(s - first);
                let params = ReferenceViewParams { s, c, stage, start, forced, first, end: first + count, pad0: 0 };
                let count = u64::from(count);
                let dispatch = Dispatch::new(&shaders::BASELINE, &params, &windows, count.div_ceil(64));
                out.push(dispatch.of_operations(count * each));
            }
        }
        Ok(out)
    }
}
