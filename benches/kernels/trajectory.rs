//! `trajectory`: the pixels of one image, straight from the field.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::run::HostArg;
use omnix_kernels::trajectory::{Trajectory, packed_words};

use crate::deform_sample::{SHAPES, spec};
use crate::traj_apply::MOTION;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for &shape in SHAPES {
        let sample = spec(shape);
        let case = format!("{}x{}, {} cells, {} times", sample.width, sample.height, sample.cells(), sample.times);
        if !bench.wants("trajectory", &case) {
            continue;
        }
        let spec = Trajectory { sample, nt: sample.times, motion: MOTION };
        let (n, taps) = (sample.n as usize, sample.taps() as usize);
        let (offsets, field) = (numbers(n * taps * 2), numbers(sample.field_words() as usize));
        let packed = packed_words(u64::from(sample.levels), u64::from(spec.nt), sample.cells());
        let args = [
            HostArg::F32(&offsets),
            HostArg::F32(&offsets[..n * taps]),
            HostArg::Out(1),
            HostArg::F32(&field),
            HostArg::F32(&field[..sample.cells() as usize]),
            HostArg::F32(&offsets[..n * 3]),
            HostArg::U32(&[0, 0]),
            HostArg::Out(spec.nt as usize * n * 3),
            HostArg::Out(n),
            HostArg::Out(spec.anchor_words() as usize),
            HostArg::Out(packed as usize),
        ];
        bench.case("trajectory", &case, Work::Flops(spec.flops()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
