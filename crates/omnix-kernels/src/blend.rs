//! `y = shares[0] · y + shares[1] · x`, in place: sums of gradients over samples, averages of weights over steps.
//!
//! The shares lie in a small buffer, so that one recording serves all steps. What a share of 0 would multiply leaves no trace, even NaN.

use omnix_shaders::blend as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// `[n]`: read and written.
pub const Y: Arg = Arg(0);
/// `[n]`.
pub const X: Arg = Arg(1);
/// `[2]`.
pub const SHARES: Arg = Arg(2);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Blend {
    /// Numbers.
    pub n: u64,
}

crate::layout::params! {
    /// `Params` of `shaders/blend`.
    pub struct BlendParams {
        n: u32,
        rest: u32,
        pad0: u32,
        pad1: u32,
    }
}

impl Blend {
    /// Bytes read and written.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        12 * self.n
    }

    /// The dispatches that compute this on a device with `caps`; none where n is 0.
    ///
    /// # Errors
    /// When the device binds less than four numbers.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let room = room(caps) / 4 * 4;
        if room == 0 {
            return Err(KernelError::RowTooLarge { kernel: "blend", bytes: 16, limit: caps.max_binding });
        }
        // Elements a workgroup owns: `LANES` times `STEPS` in the sidecar file.
        let (shader, unit, owned) = match caps.tier {
            Tier::Software if self.n.is_multiple_of(4) => (&shaders::SOFTWARE, 4, 512),
            _ if self.n.is_multiple_of(4) => (&shaders::VEC4, 4, 64),
            _ => (&shaders::WORDS, 1, 64),
        };
        let mut out = Vec::new();
        for first in (0..self.n).step_by(room as usize) {
            let len = room.min(self.n - first);
            let ((y, rest), (x, _)) = (cover(Y, first, len, caps), cover(X, first, len, caps));
            let elements = len / unit;
            let params = BlendParams { n: elements as u32, rest: rest / unit as u32, pad0: 0, pad1: 0 };
            out.push(Dispatch::new(shader, &params, &[x, SHARES.into(), y], elements.div_ceil(owned)));
        }
        Ok(out)
    }
}
