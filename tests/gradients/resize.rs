//! Maps at another height and width.

use omnix_graph::ops::{Corners, Filter, Ratio};
use omnix_kernels::Gpu;
use omnix_tests::{Trial, trials};

use crate::case::Case;

pub(crate) fn trials() -> Vec<Trial> {
    trials!("resize", tiers: [filters_and_corners], device: [a_code_has_no_gradient])
}

fn filters_and_corners(gpu: &Gpu) {
    let scaled = Corners::HalfPixelScaled { rows: Ratio { num: 5, den: 7 }, columns: Ratio { num: 3, den: 4 } };
    let sizes = [
        ([1, 1], [1, 1], 1),
        ([3, 4], [3, 4], 2),
        ([3, 4], [7, 5], 3),
        ([6, 9], [4, 4], 1),
        ([1, 5], [3, 1], 4),
        ([2, 3], [8, 12], 8),
    ];
    for filter in [Filter::Bilinear, Filter::Bicubic] {
        for corners in [Corners::Align, Corners::HalfPixel, scaled] {
            for ([h, w], [rows, columns], c) in sizes {
                let mut case = Case::new(format!("{filter:?} {corners:?} {h} x {w} to {rows} x {columns}, {c}"));
                let x = case.leaf("x", [2, h, w, c]);
                let y = case.graph.resize(x, rows, columns, filter, corners).expect("records");
                case.check(gpu, &[y]);
            }
        }
    }
}

fn a_code_has_no_gradient(gpu: &Gpu) {
    let mut case = Case::new("coded");
    let x = case.leaf("x", [2, 3, 4, 6]);
    let code = case.numbers("code", (5 + 7) * 3);
    let code = case.given("code", [5 + 7, 3], code);
    let y = case.graph.resize_coded(x, [7, 5], Filter::Bilinear, Corners::Align, Some(code)).expect("records");
    case.check(gpu, &[y]);
}
