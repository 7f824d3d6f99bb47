//! `y[first + i] = value` for n words: one constant, any pattern of 32 bits, into a tensor or a part of it. The words before and
//! behind keep their value.

use omnix_shaders::fill as shaders;

use crate::cover::{cover, room, unit};
use crate::{Arg, Caps, Dispatch, KernelError};

/// What is written.
pub const Y: Arg = Arg(0);

/// What to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Fill {
    /// The first word.
    pub first: u64,
    /// Number of words.
    pub n: u64,
    /// The bits of each.
    pub value: u32,
}

crate::layout::params! {
    /// `Params` of `shaders/fill`.
    pub struct FillParams {
        n: u32,
        value: u32,
        y_rest: u32,
        pad0: u32,
    }
}

impl Fill {
    /// All n words of a tensor become `value`.
    #[must_use]
    pub fn whole(n: u64, value: f32) -> Self {
        Self { first: 0, n, value: value.to_bits() }
    }

    /// Bytes written.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        4 * self.n
    }

    /// The dispatches that compute this on a device with `caps`; none where n is 0.
    ///
    /// # Errors
    /// When not even one word can be bound.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let fours = self.first.is_multiple_of(4) && self.n.is_multiple_of(4);
        let (shader, unit) = unit(caps, fours, [&shaders::WORDS, &shaders::VEC4, &shaders::SOFTWARE]);
        // A multiple of four, so that every piece starts at one.
        let room = room(caps) / 4 * 4;
        if room == 0 {
            return Err(KernelError::RowTooLarge { kernel: "fill", bytes: 16, limit: caps.max_binding });
        }
        // Items that a workgroup owns: `LANES` times `STEPS` in the sidecar file; only lavapipe's variant has its own numbers,
        // of the same product.
        const OWNED: u64 = 512;
        let mut out = Vec::new();
        for from in (0..self.n).step_by(room as usize) {
            let words = room.min(self.n - from);
            let (y, rest) = cover(Y, self.first + from, words, caps);
            let n = words / u64::from(unit);
            let params = FillParams { n: n as u32, value: self.value, y_rest: rest / unit, pad0: 0 };
            out.push(Dispatch::new(shader, &params, &[y], n.div_ceil(OWNED)));
        }
        Ok(out)
    }
}
