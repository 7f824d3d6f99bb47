//! `trajectory` against its oracle, and against the two kernels it joins.

use omnix_kernels::deform_sample::DeformSample;
use omnix_kernels::readback::read;
use omnix_kernels::run::{HostArg, execute, upload};
use omnix_kernels::traj_apply::{self, Gate, Motion, TrajApply};
use omnix_kernels::trajectory::{THETA, Trajectory, Y, packed_words};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::{Rng, Trial, assert_close, trials, with_max_binding};

use crate::deform_sample::{Inputs, compute as sample, spec as sampled};
use crate::traj_apply::motions;

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "trajectory",
        tiers: [matches_the_oracle_and_the_two_kernels_bit_for_bit, neither_the_range_of_times_nor_the_split_changes_a_bit, a_list_gives_the_bits_of_the_whole_image, bad_numbers_end_and_times_past_the_end_count_as_the_last],
        once: [impossible_ranges_are_errors],
    )
}

const MOTION: Motion = Motion { relative: true, min_norm: 1e-3, gate: Gate::Hard(0.3) };

/// A point for every pixel.
fn points(spec: &DeformSample) -> Vec<f32> {
    Rng::new(u64::from(spec.n)).normal(spec.n as usize * 3)
}

/// Points and scores of the range from `t0`.
fn compute(gpu: &Gpu, spec: &Trajectory, inputs: &Inputs, when: [u32; 2]) -> (Vec<f32>, Vec<f32>) {
    let x = points(&spec.sample);
    let n = spec.sample.n as usize;
    let mut args = vec![HostArg::Out(1); 11];
    args[0] = HostArg::F32(&inputs.offsets);
    args[1] = HostArg::F32(&inputs.weights);
    if spec.sample.listed {
        args[2] = HostArg::U32(&inputs.pixels);
    }
    args[3] = HostArg::F32(&inputs.field);
    args[4] = HostArg::F32(&inputs.mask);
    args[5] = HostArg::F32(&x);
    args[6] = HostArg::U32(&when);
    args[7] = HostArg::Out(spec.nt as usize * n * 3);
    args[8] = HostArg::Out(n);
    args[9] = HostArg::Out(spec.anchor_words() as usize);
    let sample = &spec.sample;
    args[10] = HostArg::Out(packed_words(u64::from(sample.levels), u64::from(spec.nt), sample.cells()) as usize);
    let slices = upload(gpu, &args).expect("uploads");
    execute(gpu, &spec.record(&gpu.caps).expect("records"), &slices).expect("runs");
    (read(gpu, &slices[usize::from(Y.0)]).expect("reads"), read(gpu, &slices[usize::from(THETA.0)]).expect("reads"))
}

fn cases() -> Vec<DeformSample> {
    let mut release = sampled([20, 9], [5, 3], 3, None);
    (release.levels, release.points) = (4, 9);
    // More levels than the software variant has windows.
    let mut deep = sampled([14, 9], [5, 3], 2, None);
    deep.levels = 6;
    vec![
        sampled([1, 1], [1, 1], 1, None),
        sampled([33, 1], [7, 1], 2, None),
        sampled([33, 14], [4, 2], 5, None),
        sampled([33, 28], [6, 5], 3, Some(131)),
        // Two and one times in a window of the software variant; a grid too large for it.
        sampled([33, 14], [30, 15], 5, None),
        sampled([33, 14], [36, 20], 3, None),
        sampled([33, 14], [60, 24], 2, None),
        release,
        deep,
    ]
}

fn matches_the_oracle_and_the_two_kernels_bit_for_bit(gpu: &Gpu) {
    for sample_spec in cases() {
        let inputs = Inputs::new(&sample_spec);
        let tau = sample(gpu, &sample_spec, &inputs);
        for motion in motions() {
            let spec = Trajectory { sample: sample_spec, nt: sample_spec.times, motion };
            let own = sample_spec.times / 2;
            let (y, theta) = compute(gpu, &spec, &inputs, [own, 0]);
            let x = points(&sample_spec);
            let apply = TrajApply { n: sample_spec.n, times: sample_spec.times, motion };
            let args = [
                HostArg::F32(&tau),
                HostArg::F32(&x),
                HostArg::U32(&[own]),
                HostArg::Out(y.len()),
                HostArg::Out(theta.len()),
            ];
            let slices = upload(gpu, &args).expect("uploads");
            execute(gpu, &apply.record(&gpu.caps).expect("records"), &slices).expect("runs");
            let two: Vec<f32> = read(gpu, &slices[usize::from(traj_apply::Y.0)]).expect("reads");
            let two_theta: Vec<f32> = read(gpu, &slices[usize::from(traj_apply::THETA.0)]).expect("reads");
            assert!(theta == two_theta, "{} {spec:?}: scores", gpu.caps.tier);
            assert!(y == two, "{} {spec:?}: points", gpu.caps.tier);
            if motion.gate == Gate::None {
                let want = cpu::trajectory(&spec, &inputs.sampled(), &x, (own as usize, 0));
                assert_close(&format!("{} {spec:?}", gpu.caps.tier), &y, &want.0, 1e-5);
                assert_close(&format!("{} {spec:?}: scores", gpu.caps.tier), &theta, &want.1, 1e-6);
            }
        }
    }
}

fn neither_the_range_of_times_nor_the_split_changes_a_bit(gpu: &Gpu) {
    for all in [
        sampled([33, 14], [4, 3], 7, None),
        sampled([33, 28], [4, 3], 7, Some(300)),
        sampled([33, 14], [36, 20], 7, None),
    ] {
        let inputs = Inputs::new(&all);
        let whole = Trajectory { sample: all, nt: 7, motion: MOTION };
        let (y, theta) = compute(gpu, &whole, &inputs, [2, 0]);
        let row = all.n as usize * 3;
        for (t0, nt) in [(0, 1), (3, 2), (2, 5), (6, 1)] {
            let part = compute(gpu, &Trajectory { nt, ..whole }, &inputs, [2, t0]);
            assert!(part.0 == y[t0 as usize * row..(t0 + nt) as usize * row], "{}: {t0} {nt}", gpu.caps.tier);
            assert!(part.1 == theta);
        }
        // The field is bound whole, whatever the limit.
        let small = with_max_binding(gpu, 8192.max(all.field_words() * 4 + 256));
        assert!(whole.record(&small.caps).expect("records").len() > 1);
        assert!(compute(&small, &whole, &inputs, [2, 0]) == (y, theta), "{}: split", gpu.caps.tier);
    }
}

fn a_list_gives_the_bits_of_the_whole_image(gpu: &Gpu) {
    let all = Trajectory { sample: sampled([28, 14], [4, 3], 3, None), nt: 3, motion: MOTION };
    let inputs = Inputs::new(&all.sample);
    let mut listed = all;
    listed.sample.listed = true;
    // Every pixel in order, as a list.
    let same = Inputs { pixels: (0..28 * 14).collect(), ..inputs.clone() };
    assert!(compute(gpu, &listed, &same, [1, 0]) == compute(gpu, &all, &inputs, [1, 0]));
}

fn bad_numbers_end_and_times_past_the_end_count_as_the_last(gpu: &Gpu) {
    let spec = Trajectory { sample: sampled([28, 14], [4, 3], 3, None), nt: 2, motion: MOTION };
    let mut inputs = Inputs::new(&spec.sample);
    let (y, _) = compute(gpu, &spec, &inputs, [0, 77]);
    let (last, _) = compute(gpu, &Trajectory { nt: 1, ..spec }, &inputs, [0, 2]);
    let row = 28 * 14 * 3;
    assert!(y[..row] == last && y[row..] == last);
    inputs.offsets.fill(f32::NAN);
    inputs.weights[3] = f32::INFINITY;
    assert_eq!(compute(gpu, &spec, &inputs, [0, 0]).0.len(), 2 * row);
}

fn impossible_ranges_are_errors() {
    let caps = Caps::baseline();
    let spec = Trajectory { sample: sampled([28, 14], [4, 3], 3, None), nt: 3, motion: MOTION };
    assert!(spec.record(&caps).is_ok());
    for bad in [Trajectory { nt: 0, ..spec }, Trajectory { nt: 4, ..spec }] {
        assert!(bad.record(&caps).is_err());
    }
    let tiny = Caps { max_binding: 1024, ..caps };
    assert!(spec.record(&tiny).expect_err("field").to_string().contains("binds at most 1024"));
}
