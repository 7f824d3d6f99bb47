//! Rows by index, read or written; and what is chosen by them.

use omnix_graph::ops::{Binary, Expand, Unary};
use omnix_kernels::Gpu;
use omnix_tests::{Rng, Trial, trials};

use crate::case::Case;

pub(crate) fn trials() -> Vec<Trial> {
    trials!("indices", device: [rows_that_are_read, rows_that_are_written, chosen_rows])
}

fn rows_that_are_read(gpu: &Gpu) {
    for (n, m, row) in [(1, 1, vec![]), (9, 9, vec![3]), (9, 4, vec![]), (40, 17, vec![2, 5])] {
        let mut case = Case::new(format!("gather {m} of {n}, {row:?}"));
        let shape: Vec<usize> = std::iter::once(n).chain(row).collect();
        let x = case.leaf("x", shape.as_slice());
        let index = case.indices("index", [m], &Rng::new(3).shuffled(n as u32)[..m]);
        let y = case.graph.gather(x, index).expect("records");
        // Read once more as they are.
        case.check(gpu, &[y, x]);
    }
}

fn rows_that_are_written(gpu: &Gpu) {
    for (n, m, row) in [(1, 1, vec![]), (9, 9, vec![3]), (9, 4, vec![]), (40, 17, vec![2, 5])] {
        let mut case = Case::new(format!("scatter {m} of {n}, {row:?}"));
        let dims = |count: usize| std::iter::once(count).chain(row.clone()).collect::<Vec<usize>>();
        let (base, x) = (case.leaf("base", dims(n).as_slice()), case.leaf("x", dims(m).as_slice()));
        let index = case.indices("index", [m], &Rng::new(4).shuffled(n as u32)[..m]);
        let y = case.graph.scatter(base, x, index).expect("records");
        case.check(gpu, &[y]);
    }
}

/// Scores choose rows: no gradient passes the choice, one passes through the numbers of the chosen rows and of their scores.
fn chosen_rows(gpu: &Gpu) {
    let mut case = Case::new("chosen");
    let (images, tokens, k) = (2, 7, 3);
    let x = case.leaf("x", [images * tokens, 4]);
    let scores = case.leaf("scores", [images, tokens]);
    let (index, mask) = case.graph.top_k_flat(scores, k).expect("chooses");
    let index = case.graph.reshape(index, [images * k]).expect("flat");
    let chosen = case.graph.gather(x, index).expect("rows");
    let all = case.graph.map(Unary::Sigmoid, scores);
    let kept = case.graph.zip(Binary::Mul, all, mask).expect("chosen scores");
    let flat = case.graph.reshape(all, [images * tokens, 1]).expect("column");
    let gain = case.graph.gather(flat, index).expect("gains");
    let shift = case.leaf("shift", [3, 4]);
    let parts = Expand { kappa: Some(gain), ..Expand::default() };
    let y = case.graph.token_expand(chosen, shift, parts).expect("expands");
    case.check(gpu, &[y, kept]);
}
