//! `resize`: the up-samplings of the dense heads and of the position table.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::resize::{Corners, Filter, Resize};
use omnix_kernels::run::HostArg;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    let spec = |[hi, wi, ho, wo, c]: [u32; 5], filter, corners, code| Resize {
        frames: 2,
        hi,
        wi,
        ho,
        wo,
        c,
        filter,
        corners,
        code,
    };
    let cases = [
        ("bilinear 2x 140x252x64", spec([140, 252, 280, 504, 64], Filter::Bilinear, Corners::Align, false)),
        ("bilinear + code 160x288x32", spec([160, 288, 280, 504, 32], Filter::Bilinear, Corners::Align, true)),
        ("bilinear 160x288x6", spec([160, 288, 280, 504, 6], Filter::Bilinear, Corners::HalfPixel, false)),
        ("bilinear 160x288x3", spec([160, 288, 280, 504, 3], Filter::Bilinear, Corners::HalfPixel, false)),
        ("bicubic 37x37x384", spec([37, 37, 20, 36, 384], Filter::Bicubic, Corners::HalfPixel, false)),
    ];
    for (case, spec) in cases {
        if bench.wants("resize", case) {
            let x = numbers((spec.frames * spec.hi * spec.wi * spec.c) as usize);
            let code = numbers(((spec.ho + spec.wo) * (spec.c / 2)) as usize);
            let out = spec.frames * spec.ho * spec.wo * spec.c;
            let args = [HostArg::F32(&x), HostArg::F32(&code), HostArg::Out(out as usize)];
            bench.case("resize", case, Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
        }
    }
    Ok(())
}
