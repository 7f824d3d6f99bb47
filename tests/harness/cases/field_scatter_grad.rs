//! Cases of `field_scatter_grad`.

use omnix_kernels::field_scatter_grad::{DZ, FieldScatterGrad};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for FieldScatterGrad {
    fn kernel(&self) -> &'static str {
        "field_scatter_grad"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let mut rng = Rng::new(u64::from(self.k + self.cells));
        let dfield = rng.normal((self.times * self.sources * self.cells * self.c) as usize);
        let mut index = Vec::new();
        // Of each image the first k of shuffled cells, in order.
        for _ in 0..self.sources {
            let mut cells = rng.shuffled(self.cells);
            cells.truncate(self.k as usize);
            cells.sort_unstable();
            index.extend(cells);
        }
        let out = (self.sources * self.times * self.k * self.c) as usize;
        vec![Values::F32(dfield), Values::U32(index), Values::Out(out)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        vec![(DZ, Values::F32(cpu::field_scatter_grad(self, args[0].f32(), args[1].u32())))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        0.0
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// A specification.
#[must_use]
pub const fn spec(sources: u32, times: u32, k: u32, cells: u32, c: u32) -> FieldScatterGrad {
    FieldScatterGrad { sources, times, k, cells, c }
}

/// One cell; all chosen (K = L); one time; larger than a workgroup; other channel counts; then a level's field of 16 images.
#[must_use]
pub fn cases() -> Vec<Case> {
    let tests = [
        spec(1, 1, 1, 1, 9),
        spec(3, 3, 20, 20, 9),
        spec(4, 1, 3, 30, 9),
        spec(1, 5, 6, 30, 9),
        spec(5, 4, 144, 720, 9),
        spec(2, 3, 1, 65, 3),
    ];
    let benches = [(16, 144, 720), (16, 12, 60)].map(|(images, k, cells)| {
        Case::bench(format!("{images} images, {k} of {cells}"), spec(images, images, k, cells, 9))
    });
    tests.map(Case::test).into_iter().chain(benches).collect()
}
