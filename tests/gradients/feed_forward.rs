//! The gate of a feed-forward layer, and dropout.

use omnix_kernels::Gpu;
use omnix_tests::{Trial, trials};

use crate::case::Case;

pub(crate) fn trials() -> Vec<Trial> {
    trials!("feed_forward", device: [gates, what_is_left_out_has_no_gradient])
}

fn gates(gpu: &Gpu) {
    for (rows, hidden) in [(1, 1), (3, 5), (2, 32), (7, 50)] {
        let mut case = Case::new(format!("swiglu {rows} x {hidden}"));
        let x = case.leaf("x", [rows, 2 * hidden]);
        let y = case.graph.swiglu(x).expect("records");
        case.check(gpu, &[y]);
    }
}

fn what_is_left_out_has_no_gradient(gpu: &Gpu) {
    for (p, step, stream) in [(0.0, 0, 0), (0.1, 3, 0), (0.1, 4, 1), (0.7, 900, 2)] {
        let mut case = Case::new(format!("dropout {p}, {step}, {stream}"));
        let x = case.leaf("x", [6, 7]);
        let step = case.indices("step", [1], &[step]);
        let y = case.graph.dropout(x, step, p, (0x1234_5678_9abc_def0, stream)).expect("records");
        case.check(gpu, &[y]);
    }
}
