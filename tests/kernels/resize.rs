//! `resize` against its oracle.

use omnix_kernels::resize::{Corners, Filter, Ratio, Resize, Y};
use omnix_kernels::run::{HostArg, run};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::{Rng, Trial, assert_close, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "resize",
        once: [bad_specifications_are_errors],
        tiers: [long_sides_lose_no_precision, splitting_over_frames_and_bands_changes_no_bit, every_variant_matches_the_oracle],
    )
}

fn case(gpu: &Gpu, spec: &Resize) -> (Vec<f32>, Vec<f32>) {
    let mut rng = Rng::new(u64::from(spec.hi * 7 + spec.c));
    let x = rng.normal((spec.frames * spec.hi * spec.wi * spec.c) as usize);
    let code = rng.normal(((spec.ho + spec.wo) * (spec.c / 2)) as usize);
    let out = spec.frames * spec.ho * spec.wo * spec.c;
    let args = [HostArg::F32(&x), HostArg::F32(&code), HostArg::Out(out as usize)];
    let got = run(gpu, &spec.record(&gpu.caps).expect("records"), &args, usize::from(Y.0)).expect("runs");
    (got, cpu::resize(spec, &x, &code))
}

fn corners() -> [Corners; 3] {
    let ratio = |value: f64| Ratio::approximate(value).expect("in range");
    [Corners::Align, Corners::HalfPixel, Corners::HalfPixelScaled { rows: ratio(37.0 / 20.1), columns: ratio(0.4321) }]
}

fn every_variant_matches_the_oracle(gpu: &Gpu) {
    // hi, wi, ho, wo, c: one, up, down, one output, wide, a tenth.
    let shapes = [
        [1, 1, 3, 2, 1],
        [4, 5, 8, 10, 4],
        [5, 4, 1, 1, 3],
        [9, 13, 4, 31, 36],
        [20, 36, 40, 71, 64],
        [3, 2, 70, 33, 8],
        [6, 7, 9, 30, 6],
        [6, 7, 9, 5, 20],
        [37, 37, 20, 36, 12],
        [6, 5, 9, 12, 13],
        [5, 4, 7, 9, 128],
        [2, 300, 2, 517, 4],
        [7, 9, 11, 13, 16],
        [5, 6, 9, 70, 32],
        [3, 50, 2, 5, 16],
    ];
    for [hi, wi, ho, wo, c] in shapes {
        for filter in [Filter::Bilinear, Filter::Bicubic] {
            for (frames, corners, code) in
                [(2, corners()[0], true), (1, corners()[0], false), (2, corners()[1], false), (1, corners()[2], true)]
            {
                let code = code && c % 2 == 0;
                let spec = Resize { frames, hi, wi, ho, wo, c, filter, corners, code };
                let (got, want) = case(gpu, &spec);
                assert_close(&format!("{} {spec:?}", gpu.caps.tier), &got, &want, 1e-6);
            }
        }
    }
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
        let args = [HostArg::F32(&x), HostArg::F32(&[0.0]), HostArg::Out(n_out as usize)];
        let got = run(gpu, &spec.record(&gpu.caps).expect("records"), &args, usize::from(Y.0)).expect("runs");
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
            let (whole, _) = case(gpu, &spec);
            let small = with_max_binding(gpu, 3072);
            assert!(spec.record(&small.caps).expect("records").len() > 2);
            assert_eq!(whole, case(&small, &spec).0, "{} {spec:?}", gpu.caps.tier);
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
