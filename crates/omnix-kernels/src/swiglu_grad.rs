//! The gradient of [`crate::swiglu`], `y = silu(a) · b` with `x = [a | b]`: `dx = [dy · b · silu'(a) | dy · silu(a)]`.

use omnix_shaders::swiglu_grad as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// What went into the operation, `[m, 2h]`.
pub const X: Arg = Arg(0);
/// Gradient of its result, `[m, h]`.
pub const DY: Arg = Arg(1);
/// Output `[m, 2h]`.
pub const DX: Arg = Arg(2);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SwiGluGrad {
    /// Rows.
    pub m: u32,
    /// Width of dy, half of x's.
    pub h: u32,
}

crate::layout::params! {
    /// `Params` of `shaders/swiglu_grad`.
    pub struct SwiGluGradParams {
        n: u32,
        h: u32,
        x_rest: u32,
        dy_rest: u32,
    }
}

impl SwiGluGrad {
    /// Bytes read and written.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        20 * u64::from(self.m) * u64::from(self.h)
    }

    /// The dispatches that compute this on a device with `caps`; none where dy is empty.
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
            return Err(KernelError::RowTooLarge { kernel: "swiglu_grad", bytes: h * 8, limit: caps.max_binding });
        }
        // Elements a workgroup owns: `LANES` times `STEPS` in the sidecar file.
        let (shader, unit, owned) = match caps.tier {
            Tier::Software if h.is_multiple_of(4) && h >= 32 => (&shaders::SOFTWARE, 4, 512),
            _ if h.is_multiple_of(4) => (&shaders::VEC4, 4, 64),
            _ => (&shaders::WORDS, 1, 64),
        };
        let mut out = Vec::new();
        for row in (0..m).step_by(rows as usize) {
            let count = rows.min(m - row);
            let (x, x_rest) = cover(X, row * 2 * h, count * 2 * h, caps);
            let (dx, _) = cover(DX, row * 2 * h, count * 2 * h, caps);
            let (dy, dy_rest) = cover(DY, row * h, count * h, caps);
            let n = count * h / u64::from(unit);
            let params =
                SwiGluGradParams { n: n as u32, h: self.h / unit, x_rest: x_rest / unit, dy_rest: dy_rest / unit };
            out.push(Dispatch::new(shader, &params, &[x, dy, dx], n.div_ceil(owned)));
        }
        Ok(out)
    }
}
