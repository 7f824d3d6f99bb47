//! `y[m, j] = silu(x[m, j]) · x[m, h + j]`: the gate of a SwiGLU feed-forward layer, both halves from one product.

use omnix_shaders::swiglu as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// Input `[m, 2h]`.
pub const X: Arg = Arg(0);
/// Output `[m, h]`.
pub const Y: Arg = Arg(1);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SwiGlu {
    /// Rows.
    pub m: u32,
    /// Width of y, half of x's.
    pub h: u32,
}

crate::layout::params! {
    /// `Params` of `shaders/swiglu`.
    pub struct SwiGluParams {
        n: u32,
        h: u32,
        x_rest: u32,
        y_rest: u32,
    }
}

impl SwiGlu {
    /// Bytes read and written.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        12 * u64::from(self.m) * u64::from(self.h)
    }

    /// The dispatches that compute this on a device with `caps`; none where y is empty.
    ///
    /// # Errors
    /// When one row of x is larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let (m, h) = (u64::from(self.m), u64::from(self.h));
        if m * h == 0 {
            return Ok(Vec::new());
        }
        let rows = room(caps) / (2 * h);
        if rows == 0 {
            return Err(KernelError::RowTooLarge { kernel: "swiglu", bytes: h * 8, limit: caps.max_binding });
        }
        // Elements a workgroup owns: `LANES` times `STEPS` in the sidecar file.
        let (shader, unit, owned) = match caps.tier {
            Tier::Software if h.is_multiple_of(4) && h >= 32 => (&shaders::SOFTWARE, 4, 512),
            _ if h.is_multiple_of(4) => (&shaders::VEC4, 4, 64),
            _ => (&shaders::WORDS, 1, 64),
        };
        let mut out = Vec::new();
        let mut row = 0;
        while row < m {
            let count = rows.min(m - row);
            let (x, x_rest) = cover(X, row * 2 * h, count * 2 * h, caps);
            let (y, y_rest) = cover(Y, row * h, count * h, caps);
            let n = count * h / u64::from(unit);
            let params = SwiGluParams { n: n as u32, h: self.h / unit, x_rest: x_rest / unit, y_rest: y_rest / unit };
            out.push(Dispatch::new(shader, &params, &[x, y], n.div_ceil(owned)));
            row += count;
        }
        Ok(out)
    }
}
