//! Cases of `grad_norm`: squares of several gradients, their sum, the factor.

use omnix_kernels::grad_norm::{self, Clip, Squares, blocks};
use omnix_kernels::reduce::{self, Reduce, ReduceOp};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// The result.
pub const CLIP: Arg = Arg(0);
const PARTS: Arg = Arg(1);
const SUM: Arg = Arg(2);
const SCRATCH: Arg = Arg(3);
const MORE: Arg = Arg(4);
/// The first gradient; the others follow.
const FIRST: u8 = 5;

/// All calls of the clipping of gradients of these sizes.
#[derive(Clone, Debug)]
pub struct Clipped {
    /// Numbers of each gradient.
    pub sizes: Vec<u64>,
    /// What numbers near 1 are multiplied by.
    pub size: f32,
    /// Bound and scale.
    pub clip: Clip,
}

impl Clipped {
    fn parts(&self) -> u64 {
        self.sizes.iter().map(|n| blocks(*n)).sum()
    }

    /// How the parts are added.
    fn sum(&self) -> Reduce {
        Reduce { outer: 1, n: self.parts() as u32, inner: 1, op: ReduceOp::Sum }
    }
}

/// The same dispatches over other numbers of arguments.
fn over(dispatches: Vec<Dispatch>, args: &[(Arg, Arg)]) -> impl Iterator<Item = Dispatch> + '_ {
    dispatches.into_iter().map(|mut dispatch| {
        for window in &mut dispatch.windows {
            window.arg = args.iter().find(|(of, _)| *of == window.arg).map_or(window.arg, |(_, to)| *to);
        }
        dispatch
    })
}

impl Call for Clipped {
    fn kernel(&self) -> &'static str {
        "grad_norm"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let mut out = Vec::new();
        let mut first = 0;
        for (i, n) in self.sizes.iter().enumerate() {
            let squares = Squares { n: *n, first, scale: self.clip.scale };
            let args = [(grad_norm::X, Arg(FIRST + i as u8)), (grad_norm::PARTS, PARTS)];
            out.extend(over(squares.record(caps)?, &args));
            first += blocks(*n);
        }
        let args = [(reduce::X, PARTS), (reduce::Y, SUM), (reduce::PARTS, SCRATCH), (reduce::MORE, MORE)];
        out.extend(over(self.sum().record(caps)?, &args));
        out.extend(over(self.clip.record()?, &[(grad_norm::SUM, SUM), (grad_norm::CLIP, CLIP)]));
        Ok(out)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let mut rng = Rng::new(self.sizes.iter().sum());
        let [scratch, more] = self.sum().scratch();
        let others = [4, self.parts(), 1, scratch, more].map(|words| Values::Out(words as usize));
        let gradients =
            self.sizes.iter().map(|n| Values::F32(rng.normal(*n as usize).iter().map(|v| v * self.size).collect()));
        others.into_iter().chain(gradients).collect()
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let gradients: Vec<&[f32]> = args[usize::from(FIRST)..].iter().map(Values::f32).collect();
        vec![(CLIP, Values::F32(cpu::grad_norm(&self.clip, &gradients).to_vec()))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        2e-6
    }

    fn work(&self) -> Work {
        Work::Bytes(4 * self.sizes.iter().sum::<u64>())
    }
}

/// One number; several gradients around a block; more parts than are added at once; norms on both sides of the bound, of 0 and above
/// what squares hold; then the layers of a network.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for sizes in [vec![1], vec![1024, 1, 1025, 7, 3000], vec![100; 90], vec![1_100_000, 5]] {
        for (size, max_norm, scale) in [
            (1.0, 1.0, 1.0),
            (1.0, 1e9, 0.25),
            (1e-6, 1.0, 1.0),
            (0.0, 1.0, 1.0),
            (1e30, 1.0, 1.0),
            (1.0, f32::INFINITY, 1.0),
        ] {
            let sizes = sizes.clone();
            cases.push(Case::test(Clipped { sizes, size, clip: Clip { max_norm, scale } }));
        }
    }
    let sizes = [1536 * 4608, 1536 * 1536, 1536 * 8192, 4096 * 1536, 1536, 1536].to_vec();
    let clip = Clip { max_norm: 1.0, scale: 1.0 };
    cases.push(Case::bench("a block of the giant network", Clipped { sizes, size: 1.0, clip }));
    cases
}
