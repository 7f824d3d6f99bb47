//! `traj_apply`: the pixels of one image.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::run::HostArg;
use omnix_kernels::traj_apply::{Gate, Motion, TrajApply};

/// As the release moves points.
pub(crate) const MOTION: Motion = Motion { relative: true, min_norm: 1e-3, gate: Gate::Hard(0.3) };

/// Pixels and times.
const SHAPES: &[(u32, u32)] = &[(504 * 280, 16), (140 * 84, 16)];

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for &(n, times) in SHAPES {
        let case = format!("{n} pixels, {times} times");
        if !bench.wants("traj_apply", &case) {
            continue;
        }
        let spec = TrajApply { n, times, motion: MOTION };
        let (pixels, all) = (n as usize, times as usize);
        let (tau, points) = (numbers(pixels * (all * 9 + 1)), numbers(pixels * 3));
        let outputs = [HostArg::Out(all * pixels * 3), HostArg::Out(pixels)];
        let args = [HostArg::F32(&tau), HostArg::F32(&points), HostArg::U32(&[0]), outputs[0], outputs[1]];
        bench.case("traj_apply", &case, Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
