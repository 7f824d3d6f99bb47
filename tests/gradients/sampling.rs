//! Fields and masks at sampling points: where pixels sample, with what weights, and what.

use omnix_graph::Value;
use omnix_graph::ops::{Gate, Motion, Sampling, Trajectory};
use omnix_kernels::Gpu;
use omnix_tests::{Rng, Trial, assert_close, family, interpret, trials};

use crate::case::{Case, keep};

pub(crate) fn trials() -> Vec<Trial> {
    trials!("deform_sample", tiers: [offsets_weights_field_and_mask], device: [weights_of_a_softmax, a_trajectory_is_what_its_parts_compute])
}

/// Offsets whose points lie away from the centres of cells, where the share of a cell has a kink, and from the grid's border, where a
/// point stops. Some lie beyond the border, where offsets have no gradient.
fn offsets(seed: u64, pixels: &[usize], taps: usize, [height, width]: [usize; 2], [hp, wp]: [usize; 2]) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let mut data = Vec::with_capacity(pixels.len() * taps * 2);
    for pixel in pixels {
        for axis in (0..taps).flat_map(|_| [(pixel % width, width, wp), (pixel / width, height, hp)]) {
            let (place, size, cells) = axis;
            let reference = place as f32 / (size.max(2) - 1) as f32 * cells as f32;
            let offset = loop {
                let offset = rng.normal(1)[0] * 1.5;
                let at = reference + offset - 0.5;
                let near_centre = (at - at.round()).abs() < 0.05;
                let near_border = (at + 0.5).abs() < 0.05 || (at + 0.5 - cells as f32).abs() < 0.05;
                if !near_centre && !near_border {
                    break offset;
                }
            };
            data.push(offset);
        }
    }
    data
}

/// Levels, times, points; image, grid; whether pixels are listed.
type Shape = ([usize; 3], [usize; 2], [usize; 2], bool);

/// An image's sampling points, all of which is differentiated by.
fn sampling(case: &mut Case, ([levels, times, points], image, grid, listed): Shape, softmax: bool) -> Sampling {
    let all = image[0] * image[1];
    let pixels: Vec<usize> = if listed { (0..all).filter(|i| i % 3 == 1).collect() } else { (0..all).collect() };
    let (n, taps, cells) = (pixels.len(), levels * points, grid[0] * grid[1]);
    let data = offsets(9, &pixels, taps, image, grid);
    let offsets = case.leaf_with("offsets", [n, taps * 2], data);
    let mut weights = case.leaf("weights", [n, taps]);
    if softmax {
        weights = case.graph.softmax(weights);
    }
    let field = case.leaf("field", [levels, times, cells, 9]);
    let mask = case.leaf("mask", [cells]);
    let list: Vec<u32> = pixels.iter().map(|i| *i as u32).collect();
    let pixels = listed.then(|| case.indices("pixels", [n], &list));
    Sampling { offsets, weights, field, mask, pixels, image, grid }
}

fn sampled(case: &mut Case, shape: Shape, softmax: bool) -> Value {
    let sampling = sampling(case, shape, softmax);
    case.graph.deform_sample(&sampling).expect("records")
}

fn offsets_weights_field_and_mask(gpu: &Gpu) {
    let shapes: [Shape; 5] = [
        ([1, 1, 1], [1, 1], [1, 1], false),
        ([1, 2, 4], [3, 4], [2, 3], false),
        ([2, 1, 2], [4, 3], [3, 2], true),
        ([3, 2, 1], [5, 2], [1, 4], false),
        ([2, 3, 4], [4, 6], [3, 3], true),
    ];
    for shape in shapes {
        let mut case = Case::new(format!("{shape:?}"));
        let tau = sampled(&mut case, shape, false);
        case.check(gpu, &[tau]);
    }
}

fn weights_of_a_softmax(gpu: &Gpu) {
    let mut case = Case::new("softmax");
    let tau = sampled(&mut case, ([2, 2, 3], [3, 3], [2, 2], false), true);
    case.check(gpu, &[tau]);
}

/// It has no gradient: training records its parts. Here the interpreter's is compared, of a range of times.
fn a_trajectory_is_what_its_parts_compute(gpu: &Gpu) {
    for listed in [false, true] {
        let mut case = Case::new(format!("trajectory, listed {listed}"));
        let sampling = sampling(&mut case, ([2, 4, 3], [3, 5], [2, 2], listed), true);
        let n = case.graph.shape(sampling.weights).rows();
        let points = case.leaf("points", [n, 3]);
        let when = case.indices("when", [2], &[3, 1]);
        let motion = Motion { relative: true, min_norm: 1e-3, gate: Gate::Hard(0.2) };
        let trajectory = Trajectory { sampling, points, when, times: 2, motion };
        let (moved, scores) = case.graph.trajectory(&trajectory).expect("records");
        let mut graph = case.graph.clone();
        keep(&mut graph, moved, "moved");
        keep(&mut graph, scores, "scores");
        let executable = case.run(gpu, &graph);
        let read = |name: &str| interpret::wide(&case.data[name]);
        let run = interpret::run_f64(&case.graph, &read, &read);
        for (name, value) in [("moved", moved), ("scores", scores)] {
            let what = format!("{}: {name} ({})", case.name, family(gpu));
            assert_close(&what, &executable.read(name).expect("reads"), &run.rounded(value), 1e-5);
        }
    }
}
