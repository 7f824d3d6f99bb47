//! `y[i] = x[i] / (1 − p)`, left out (0) with probability p by a hash of (seed, step, stream, i): no mask is stored, and what is
//! computed again has the same bits. The step is read from a buffer, so that one recording serves all steps. The gradient is the
//! same over dy.

use omnix_shaders::dropout as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// Input `[n]`.
pub const X: Arg = Arg(0);
/// u32 `[1]` or longer: the first is the step.
pub const STEP: Arg = Arg(1);
/// Output `[n]`.
pub const Y: Arg = Arg(2);

/// What to leave out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropout {
    /// Numbers.
    pub n: u32,
    /// Probability with which a number is left out; below 1.
    pub p: f32,
    /// Of the whole training.
    pub seed: u64,
    /// Tells apart what draws at the same step.
    pub stream: u32,
}

crate::layout::params! {
    /// `Params` of `shaders/dropout`.
    pub struct DropoutParams {
        n: u32,
        first: u32,
        low: u32,
        high: u32,
        stream: u32,
        threshold: u32,
        scale: f32,
        rest: u32,
    }
}

impl Dropout {
    /// Bytes read and written.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        8 * u64::from(self.n)
    }

    /// Hashes below this leave their number out.
    #[must_use]
    pub fn threshold(&self) -> u32 {
        // The product is below 2^32: p is at most 1 - 2^-24.
        (f64::from(self.p) * 4_294_967_296.0) as u32
    }

    /// What the others are multiplied by.
    #[must_use]
    pub fn scale(&self) -> f32 {
        (1.0 / (1.0 - f64::from(self.p))) as f32
    }

    /// The dispatches that compute this on a device with `caps`; none where n is 0.
    ///
    /// # Errors
    /// When p is not from 0 to below 1, or the device binds less than four numbers.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let kernel = "dropout";
        if !(0.0..1.0).contains(&self.p) {
            let reason = format!("probability {}; it is from 0 to below 1", self.p);
            return Err(KernelError::Unsupported { kernel, reason });
        }
        let n = u64::from(self.n);
        let room = room(caps) / 4 * 4;
        if room == 0 {
            return Err(KernelError::RowTooLarge { kernel, bytes: 16, limit: caps.max_binding });
        }
        // Elements a workgroup owns: `LANES` times `STEPS` in the sidecar file.
        let (shader, unit, owned) = match caps.tier {
            Tier::Software if n.is_multiple_of(4) => (&shaders::SOFTWARE, 4, 512),
            _ if n.is_multiple_of(4) => (&shaders::VEC4, 4, 64),
            _ => (&shaders::WORDS, 1, 64),
        };
        let mut out = Vec::new();
        for first in (0..n).step_by(room as usize) {
            let len = room.min(n - first);
            let (x, rest) = cover(X, first, len, caps);
            let (y, _) = cover(Y, first, len, caps);
            let elements = len / unit;
            let params = DropoutParams {
                n: elements as u32,
                first: first as u32,
                low: self.seed as u32,
                high: (self.seed >> 32) as u32,
                stream: self.stream,
                threshold: self.threshold(),
                scale: self.scale(),
                rest: rest / unit as u32,
            };
            let dispatch = Dispatch::new(shader, &params, &[x, STEP.into(), y], elements.div_ceil(owned));
            // A hash takes ten.
            out.push(dispatch.of_operations(len * 12));
        }
        Ok(out)
    }
}
