//! `deform_sample`: the pixels of one image, the release's sampling points.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::deform_sample::DeformSample;
use omnix_kernels::run::HostArg;

/// Width, height, columns and rows of the grid, times.
pub(crate) const SHAPES: &[[u32; 5]] = &[[504, 280, 36, 20, 4], [140, 84, 10, 6, 16]];

/// Four levels of nine points at every pixel.
pub(crate) fn spec([width, height, wp, hp, times]: [u32; 5]) -> DeformSample {
    DeformSample { n: width * height, width, height, hp, wp, levels: 4, points: 9, times, listed: false }
}

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for &shape in SHAPES {
        let spec = spec(shape);
        let case = format!("{}x{}, {} cells, {} times", spec.width, spec.height, spec.cells(), spec.times);
        if !bench.wants("deform_sample", &case) {
            continue;
        }
        let (n, taps) = (spec.n as usize, spec.taps() as usize);
        let (offsets, field) = (numbers(n * taps * 2), numbers(spec.field_words() as usize));
        let args = [
            HostArg::F32(&offsets),
            HostArg::F32(&offsets[..n * taps]),
            HostArg::Out(1),
            HostArg::F32(&field),
            HostArg::F32(&field[..spec.cells() as usize]),
            HostArg::Out(n * (spec.times as usize * 9 + 1)),
        ];
        bench.case("deform_sample", &case, Work::Flops(spec.flops()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
