//! One step of AdamW with decoupled weight decay, in place, as `torch.optim.AdamW` does it: a weight and its two moments from
//! its gradient.
//!
//! What changes from step to step lies in small buffers ([`RATES`], made by [`AdamW::rates`], and [`CLIP`] of [`crate::grad_norm`]), so
//! that one recording serves all steps. Where the norm of all gradients is NaN or infinite nothing changes: what is saved then is the
//! last good state.

use omnix_shaders::adamw as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// The weights, `[n]`: read and written.
pub const WEIGHTS: Arg = Arg(0);
/// Mean of the gradients, `[n]`: read and written; 0 at first.
pub const FIRST: Arg = Arg(1);
/// Mean of their squares, `[n]`: read and written; 0 at first.
pub const SECOND: Arg = Arg(2);
/// Gradient, `[n]`.
pub const GRADIENT: Arg = Arg(3);
/// `[4]`, see [`AdamW::rates`].
pub const RATES: Arg = Arg(4);
/// Optional `[4]` of [`crate::grad_norm`]: the factor of all gradients, and whether their norm is NaN or infinite.
pub const CLIP: Arg = Arg(5);

/// Words of [`RATES`].
pub const RATES_WORDS: u32 = 4;

/// What to do at every step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdamW {
    /// Numbers.
    pub n: u64,
    /// Shares of the old means, β1 and β2; each from 0 to below 1.
    pub betas: [f64; 2],
    /// Added to the root of the second mean; above 0.
    pub eps: f32,
    /// What the gradient is multiplied by, where there is no [`CLIP`].
    pub scale: f32,
    /// Whether [`CLIP`] is there.
    pub clip: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/adamw`.
    pub struct AdamWParams {
        n: u32,
        flags: u32,
        rest: u32,
        scale: f32,
        to_m: f32,
        keep_v: f32,
        to_v: f32,
        eps: f32,
    }
}

const HAS_CLIP: u32 = 1;

impl AdamW {
    /// What [`RATES`] holds at a step (from 1) with a learning rate and a weight decay: what is kept of a weight, the learning
    /// rate by the correction of the first mean, the root of that of the second.
    #[must_use]
    pub fn rates(&self, step: u64, learning_rate: f64, decay: f64) -> [f32; RATES_WORDS as usize] {
        // 1 - beta^step: expm1 keeps the digits of small steps.
        let correction = |beta: f64| if beta > 0.0 { -(step as f64 * beta.ln()).exp_m1() } else { 1.0 };
        let [first, second] = self.betas.map(correction);
        [(1.0 - learning_rate * decay) as f32, (learning_rate / first) as f32, second.sqrt() as f32, 0.0]
    }

    /// Bytes read and written.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        28 * self.n
    }

    /// The dispatches that compute this on a device with `caps`; none where n is 0.
    ///
    /// # Errors
    /// When a β is not from 0 to below 1, eps is not above 0, the scale is NaN or infinite, or the device binds less than four
    /// numbers.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let kernel = "adamw";
        let [beta1, beta2] = self.betas;
        let fine = self.betas.iter().all(|beta| (0.0..1.0).contains(beta)) && self.eps > 0.0 && self.scale.is_finite();
        if !fine {
            let reason = format!(
                "betas {beta1} and {beta2}, eps {}, scale {}; betas are from 0 to below 1, eps above 0, the scale finite",
                self.eps, self.scale
            );
            return Err(KernelError::Unsupported { kernel, reason });
        }
        let room = room(caps) / 4 * 4;
        if room == 0 {
            return Err(KernelError::RowTooLarge { kernel, bytes: 16, limit: caps.max_binding });
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
            let (weights, rest) = cover(WEIGHTS, first, len, caps);
            let [m, v, gradient] = [FIRST, SECOND, GRADIENT].map(|arg| cover(arg, first, len, caps).0);
            let elements = len / unit;
            let params = AdamWParams {
                n: elements as u32,
                flags: if self.clip { HAS_CLIP } else { 0 },
                rest: rest / unit as u32,
                scale: self.scale,
                to_m: (1.0 - beta1) as f32,
                keep_v: beta2 as f32,
                to_v: (1.0 - beta2) as f32,
                eps: self.eps,
            };
            let windows = [gradient, RATES.into(), CLIP.when(self.clip).into(), weights, m, v];
            out.push(Dispatch::new(shader, &params, &windows, elements.div_ceil(owned)));
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::AdamW;

    #[test]
    fn rates_are_those_of_the_definition() {
        let spec = AdamW { n: 1, betas: [0.9, 0.999], eps: 1e-8, scale: 1.0, clip: false };
        for step in [1u64, 2, 10, 1000, 1_000_000] {
            let [keep, rate, root, _] = spec.rates(step, 2e-4, 0.05);
            let power = |beta: f64| 1.0 - beta.powf(step as f64);
            assert!((keep - (1.0 - 1e-5)).abs() < 1e-7);
            assert!((f64::from(rate) / (2e-4 / power(0.9)) - 1.0).abs() < 1e-7, "step {step}");
            assert!((f64::from(root) / power(0.999).sqrt() - 1.0).abs() < 1e-7, "step {step}");
        }
        assert_eq!(AdamW { betas: [0.0, 0.0], ..spec }.rates(3, 1.0, 0.0), [1.0, 1.0, 1.0, 0.0]);
    }
}
