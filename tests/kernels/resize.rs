//! `resize` against its oracle.

use omnix_kernels::resize::{Corners, Filter, Resize, Y};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::cases::resize::{cases, corners};
use omnix_tests::cases::{Values, check_all, computed, computed_from};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "resize",
        once: [bad_specifications_are_errors],
        tiers: [long_sides_lose_no_precision, splitting_over_frames_and_bands_changes_no_bit, every_variant_matches_the_oracle],
    )
}

fn every_variant_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn long_sides_lose_no_precision(gpu: &Gpu) {
    for corners in corners() {
        // A ramp: the result shows the source coordinate itself.
        let (n_in, n_out) = (1000, 9001);
        let x: Vec<f32> = (0..n_in).map(|i| (i % 2) as f32).collect();
        let spec = Resize {
            frames: 1,
            hi: 1,
            wi: n_in,
            ho: 1,
            wo: n_out,
            c: 1,
            filter: Filter::Bilinear,
            corners,
            code: false,
        };
        let args = [Values::F32(x.clone()), Values::F32(vec![0.0]), Values::Out(n_out as usize)];
        let got = computed_from(gpu, &spec, &args, Y);
        let want = cpu::resize(&spec, &x, &[]);
        let worst = got.iter().zip(&want).map(|(g, w)| (g - w).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-6, "{} {corners:?}: {worst}", gpu.caps.tier);
    }
}

fn splitting_over_frames_and_bands_changes_no_bit(gpu: &Gpu) {
    for ([hi, wi, ho, wo, c], corners) in [
        ([5, 6, 9, 11, 8], corners()[0]),
        ([31, 9, 70, 14, 4], corners()[1]),
        ([7, 2, 12, 3, 64], corners()[1]),
        ([60, 11, 22, 5, 3], corners()[2]),
    ] {
        for filter in [Filter::Bilinear, Filter::Bicubic] {
            let spec = Resize { frames: 3, hi, wi, ho, wo, c, filter, corners, code: c % 2 == 0 };
            let small = with_max_binding(gpu, 3072);
            assert!(spec.record(&small.caps).expect("records").len() > 2);
            assert_eq!(computed(gpu, &spec, Y), computed(&small, &spec, Y), "{} {spec:?}", gpu.caps.tier);
        }
    }
}

fn bad_specifications_are_errors() {
    let spec = Resize {
        frames: 1,
        hi: 4,
        wi: 400,
        ho: 8,
        wo: 400,
        c: 4,
        filter: Filter::Bilinear,
        corners: Corners::Align,
        code: false,
    };
    let caps = Caps { max_binding: 4096, ..Caps::baseline() };
    assert!(spec.record(&caps).expect_err("wide").to_string().contains("binds at most 4096"));
    assert!(Resize { ho: 0, ..spec }.record(&caps).is_err());
    assert!(Resize { c: 3, code: true, ..spec }.record(&caps).expect_err("odd").to_string().contains("odd number"));
    let tall = Resize { wi: 1, ho: 400, wo: 1, code: true, c: 64, ..spec };
    assert!(tall.record(&caps).expect_err("tall").to_string().contains("binds at most 4096"));
    let long = Resize { wi: 100_000, wo: 100_000, ..spec };
    assert!(long.record(&caps).expect_err("long").to_string().contains("sides too long"));
}
