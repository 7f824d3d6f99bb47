//! `attention` against its oracle.

use omnix_kernels::attention::{Attention, OUT};
use omnix_kernels::run::{HostArg, run};
use omnix_kernels::split_heads::padded;
use omnix_kernels::{Caps, Gpu, KernelError, cpu};
use omnix_tests::{Rng, as_f16, assert_close, families, family, relative_error, rounds, with_max_binding};

const fn spec(groups: u32, heads: u32, head_dim: u32, nq: u32, nk: u32) -> Attention {
    Attention { groups, heads, head_dim, nq, nk }
}

/// `[heads][n][D]` → padded rows, or padded key blocks.
fn pad(x: &[f32], heads: usize, n: usize, d: usize, key_blocks: bool) -> Vec<f32> {
    let (n_pad, dp) = (padded(n as u32) as usize, padded(d as u32) as usize);
    let mut out = vec![0.0; heads * n_pad * dp];
    for head in 0..heads {
        for i in 0..n {
            for c in 0..d {
                let at = if key_blocks { (i / 32 * dp + c) * 32 + i % 32 } else { i * dp + c };
                out[head * n_pad * dp + at] = x[(head * n + i) * d + c];
            }
        }
    }
    out
}

struct Inputs {
    q: Vec<f32>,
    k: Vec<f32>,
    v: Vec<f32>,
}

fn inputs(spec: &Attention, spread: f32) -> Inputs {
    let mut rng = Rng::new(u64::from(spec.nq * 31 + spec.nk * 7 + spec.head_dim));
    let (heads, d) = ((spec.groups * spec.heads) as usize, spec.head_dim as usize);
    let scale = spread / (spec.head_dim as f32).sqrt();
    let q = rng.normal(heads * spec.nq as usize * d).iter().map(|v| v * scale).collect();
    Inputs { q, k: rng.normal(heads * spec.nk as usize * d), v: rng.normal(heads * spec.nk as usize * d) }
}

fn compute(gpu: &Gpu, spec: &Attention, inputs: &Inputs) -> Vec<f32> {
    let (heads, d) = ((spec.groups * spec.heads) as usize, spec.head_dim as usize);
    let q = pad(&inputs.q, heads, spec.nq as usize, d, false);
    let k = pad(&inputs.k, heads, spec.nk as usize, d, true);
    let v = pad(&inputs.v, heads, spec.nk as usize, d, false);
    assert_eq!((q.len() as u64, k.len() as u64), (spec.q_words(), spec.kv_words()));
    let state = (spec.state_bytes(&gpu.caps) / 4) as usize;
    let args = [
        HostArg::F32(&q),
        HostArg::F32(&k),
        HostArg::F32(&v),
        HostArg::Out(spec.out_words() as usize),
        HostArg::Out(state),
    ];
    run(gpu, &spec.record(&gpu.caps).expect("records"), &args, usize::from(OUT.0)).expect("runs")
}

fn case(gpu: &Gpu, spec: &Attention, spread: f32) {
    let mut inputs = inputs(spec, spread);
    if rounds(gpu) {
        (inputs.k, inputs.v) = (as_f16(&inputs.k), as_f16(&inputs.v));
    }
    let got = compute(gpu, spec, &inputs);
    let want = cpu::attention(spec, &inputs.q, &inputs.k, &inputs.v);
    assert_close(&format!("{} {spec:?} spread {spread}", family(gpu)), &got, &want, 3e-6);
}

#[test]
fn every_head_width_matches_the_oracle() {
    for gpu in families() {
        for head_dim in [8, 24, 32, 48, 64, 96, 128] {
            case(&gpu, &spec(2, 3, head_dim, 37, 70), 1.0);
        }
    }
}

#[test]
fn f16_keys_and_values_cost_their_rounding() {
    for gpu in families().iter().filter(|gpu| rounds(gpu)) {
        let spec = spec(1, 2, 64, 70, 257);
        let inputs = inputs(&spec, 1.0);
        let want = cpu::attention(&spec, &inputs.q, &inputs.k, &inputs.v);
        let error = relative_error(&compute(gpu, &spec, &inputs), &want);
        assert!((1e-5..1e-3).contains(&error), "{error:.1e}");
    }
}

#[test]
fn every_length_matches_the_oracle() {
    for gpu in families() {
        // One; around a vec4, a block of keys, a tile of queries; one and several uniform windows; many small heads.
        let lengths = [(1, 1), (1, 300), (9, 3), (33, 31), (64, 32), (65, 33), (40, 256), (70, 257), (130, 600)];
        for (nq, nk) in lengths {
            case(&gpu, &spec(1, 2, 64, nq, nk), 1.0);
        }
        case(&gpu, &spec(9, 5, 24, 5, 40), 1.0);
        // Sharp distributions: the running maximum moves, weights underflow.
        case(&gpu, &spec(1, 2, 64, 20, 300), 40.0);
    }
}

#[test]
fn splitting_at_the_binding_limit_changes_no_bit() {
    for gpu in families() {
        let mut split = 0;
        // Groups apart, heads apart, queries apart, and keys in windows (baseline and GPU variants).
        for spec in [spec(4, 3, 48, 37, 70), spec(1, 2, 64, 200, 300), spec(3, 2, 24, 65, 64), spec(1, 2, 128, 70, 33)]
        {
            let inputs = inputs(&spec, 3.0);
            let whole = compute(&gpu, &spec, &inputs);
            for limit in [32_768, 49_152, 65_536] {
                let small = with_max_binding(&gpu, limit);
                let pieces = |gpu: &Gpu| spec.record(&gpu.caps).expect("records").len();
                split += usize::from(pieces(&small) > pieces(&gpu));
                assert_eq!(whole, compute(&small, &spec, &inputs), "{} {limit} {spec:?}", family(&gpu));
            }
        }
        assert!(split >= 6, "{}: only {split} of 12 cases were split", family(&gpu));
    }
}

#[test]
fn padding_of_keys_has_no_weight() {
    for gpu in families() {
        // All scores far below 0: a padded key (score 0) would take all the weight.
        let spec = spec(1, 1, 32, 3, 5);
        let inputs = Inputs { q: vec![-4.0; 3 * 32], k: vec![4.0; 5 * 32], v: vec![1.0; 5 * 32] };
        let got = compute(&gpu, &spec, &inputs);
        assert_close(&family(&gpu), &got, &[1.0; 96], 1e-6);
    }
}

#[test]
fn a_query_that_is_not_finite_stays_alone() {
    for gpu in families() {
        let spec = spec(1, 2, 32, 20, 40);
        let mut inputs = inputs(&spec, 1.0);
        let clean = compute(&gpu, &spec, &inputs);
        // Query 9 of head 1.
        inputs.q[(20 + 9) * 32 + 5] = f32::NAN;
        let got = compute(&gpu, &spec, &inputs);
        for (at, (got, clean)) in got.iter().zip(&clean).enumerate() {
            if at / 64 == 9 && at % 64 >= 32 {
                assert!(got.is_nan(), "{} {at}", family(&gpu));
            } else {
                assert_eq!(got, clean, "{} {at}", family(&gpu));
            }
        }
    }
}

#[test]
fn no_dispatch_is_too_long_and_the_last_key_counts() {
    for caps in [Caps::baseline(), Caps::lavapipe(), Caps::baseline().with_tier(omnix_kernels::Tier::Gpu)] {
        let spec = spec(1, 16, 64, 100_000, 100_000);
        let dispatches = spec.record(&caps).expect("records");
        let least = spec.flops() / 20_000_000_000;
        assert!(dispatches.len() as u64 > least, "{} dispatches, at least {least}", dispatches.len());
        for dispatch in &dispatches {
            for window in &dispatch.windows {
                assert_eq!(window.offset % caps.align, 0);
                assert!(window.size.is_none_or(|size| size <= caps.max_binding));
            }
        }
    }
}

#[test]
fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    for spec in [
        spec(0, 1, 32, 1, 1),
        spec(1, 0, 32, 1, 1),
        spec(1, 1, 32, 0, 1),
        spec(1, 1, 32, 1, 0),
        spec(1, 1, 30, 1, 1),
        spec(1, 1, 136, 1, 1),
    ] {
        let error = spec.record(&caps).expect_err("unsupported");
        assert!(matches!(error, KernelError::Unsupported { .. }), "{error}");
    }
    let error = spec(1, 16, 64, 64, 64).record(&caps).expect_err("32 rows of 4 KiB");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
}
