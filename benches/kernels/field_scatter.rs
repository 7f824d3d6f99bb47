//! `field_scatter`: a level's field of 16 images.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::field_scatter::FieldScatter;
use omnix_kernels::run::HostArg;

/// Images (and times), chosen tokens, cells.
const SHAPES: &[(u32, u32, u32)] = &[(16, 144, 720), (16, 12, 60)];

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for &(images, k, cells) in SHAPES {
        let case = format!("{images} images, {k} of {cells}");
        if !bench.wants("field_scatter", &case) {
            continue;
        }
        let spec = FieldScatter { sources: images, times: images, k, cells, c: 9 };
        let z = numbers((images * images * k * 9) as usize);
        let index: Vec<u32> = (0..images * k).map(|i| i % k * (cells / k)).collect();
        let out = HostArg::Out((images * images * cells * 9) as usize);
        let args = [HostArg::F32(&z), HostArg::U32(&index), HostArg::F32(&z[..9]), out];
        bench.case("field_scatter", &case, Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
