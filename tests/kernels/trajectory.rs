//! `trajectory` against its oracle, and against the two kernels it joins.

use omnix_kernels::traj_apply::{self, TrajApply};
use omnix_kernels::trajectory::{THETA, Trajectory, Y};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::deform_sample::{Inputs, spec as sampled};
use omnix_tests::cases::traj_apply::{self as apply, RELEASE as MOTION, motions};
use omnix_tests::cases::trajectory::{Seen, args, cases, points, samples};
use omnix_tests::cases::{Values, check_all, results};
use omnix_tests::{Trial, trials, with_max_binding};

use crate::deform_sample::compute as sample;

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "trajectory",
        tiers: [matches_the_oracle, gives_the_bits_of_the_two_kernels, neither_the_range_of_times_nor_the_split_changes_a_bit, a_list_gives_the_bits_of_the_whole_image, bad_numbers_end_and_times_past_the_end_count_as_the_last],
        once: [impossible_ranges_are_errors],
    )
}

/// Points and scores of the range from the second of `when`.
fn compute(gpu: &Gpu, spec: &Trajectory, inputs: &Inputs, when: [u32; 2]) -> (Vec<f32>, Vec<f32>) {
    let got = results(gpu, &Seen { spec: *spec, when }, &args(spec, inputs, when), &[Y, THETA]);
    (bytemuck::pod_collect_to_vec(&got[0]), bytemuck::pod_collect_to_vec(&got[1]))
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn gives_the_bits_of_the_two_kernels(gpu: &Gpu) {
    for sample_spec in samples() {
        let inputs = Inputs::new(&sample_spec);
        let tau = sample(gpu, &sample_spec, &inputs);
        for motion in motions() {
            let spec = Trajectory { sample: sample_spec, nt: sample_spec.times, motion };
            let own = sample_spec.times / 2;
            let (y, theta) = compute(gpu, &spec, &inputs, [own, 0]);
            let two = apply::Seen { spec: TrajApply { n: sample_spec.n, times: sample_spec.times, motion }, own };
            let args = [
                Values::F32(tau.clone()),
                Values::F32(points(&sample_spec)),
                Values::U32(vec![own]),
                Values::Out(y.len()),
                Values::Out(theta.len()),
            ];
            let got = results(gpu, &two, &args, &[traj_apply::Y, traj_apply::THETA]);
            let [two, two_theta]: [Vec<f32>; 2] = [0, 1].map(|i| bytemuck::pod_collect_to_vec(&got[i]));
            assert!(theta == two_theta, "{} {spec:?}: scores", gpu.caps.tier);
            assert!(y == two, "{} {spec:?}: points", gpu.caps.tier);
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
