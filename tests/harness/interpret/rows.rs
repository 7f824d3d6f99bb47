//! What looks at the numbers of a row together: softmax, sums and extremes, ranks, choices.

use omnix_graph::ops::{Rank, Reduce, ReduceOp, ReferenceView, Softmax, Strategy, TopK, Which};

use super::{Run, kept};

impl Run<'_> {
    pub(super) fn softmax(&self, op: &Softmax) -> Vec<f64> {
        let row = |row: &[f64]| {
            let most = row.iter().copied().fold(f64::MIN, f64::max);
            let powers: Vec<f64> = row.iter().map(|v| (v - most).exp()).collect();
            let sum: f64 = powers.iter().sum();
            powers.into_iter().map(move |p| p / sum).collect::<Vec<_>>()
        };
        self.get(op.x).chunks_exact(self.width(op.x)).flat_map(row).collect()
    }

    pub(super) fn reduce(&self, op: &Reduce) -> Vec<f64> {
        let (x, [outer, n, inner]) = (self.get(op.x), op.dims);
        let one = |at: usize| {
            let values = || (0..n).map(move |j| x[(at / inner * n + j) * inner + at % inner]);
            let mean = values().sum::<f64>() / n as f64;
            match op.op {
                ReduceOp::Sum => values().sum(),
                ReduceOp::Mean => mean,
                ReduceOp::Max => values().fold(f64::NEG_INFINITY, f64::max),
                ReduceOp::Min => values().fold(f64::INFINITY, f64::min),
                ReduceOp::Std if n == 1 => 0.0,
                ReduceOp::Std => (values().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1) as f64).sqrt(),
            }
        };
        (0..outer * inner).map(one).collect()
    }

    /// Of a row's numbers that are not NaN, in ascending order, the one of the wanted rank.
    pub(super) fn rank(&self, op: &Rank) -> Vec<f64> {
        let of_row = |row: &[f64]| {
            let mut numbers: Vec<f64> = row.iter().copied().filter(|v| !v.is_nan()).collect();
            numbers.sort_by(f64::total_cmp);
            let at = match op.which {
                Which::At(rank) => rank as usize,
                Which::Quantile { numerator, denominator } => {
                    let last = numbers.len().saturating_sub(1) as f64;
                    (last * f64::from(numerator) / f64::from(denominator)).round_ties_even() as usize
                }
            };
            numbers.get(at).copied().unwrap_or(f64::NAN)
        };
        self.get(op.x).chunks_exact(self.width(op.x)).map(of_row).collect()
    }

    /// Ascending indices and the mask; of equal values the lower index.
    pub(super) fn top_k(&self, op: &TopK) -> Vec<Vec<f64>> {
        let (x, width) = (self.get(op.x), self.width(op.x));
        let (mut index, mut mask) = (Vec::new(), vec![0.0; x.len()]);
        for (row, values) in x.chunks_exact(width).enumerate() {
            let before = |i: usize, j: usize| values[j] > values[i] || (values[j] == values[i] && j < i);
            for i in (0..width).filter(|i| (0..width).filter(|j| before(*i, *j)).count() < op.k) {
                mask[row * width + i] = 1.0;
                index.push(kept(if op.flat { row * width + i } else { i }));
            }
        }
        vec![index, mask]
    }

    /// `spec/da3.md` section 5: order, inverse, reference.
    pub(super) fn reference_view(&self, op: &ReferenceView) -> Vec<Vec<f64>> {
        let views = self.dims(op.x)[0];
        let best = match op.strategy {
            Strategy::First => 0,
            Strategy::Middle => views / 2,
            Strategy::Forced(view) => view as usize,
            Strategy::SaddleBalanced | Strategy::SaddleSimRange => {
                let scores = scores(self.get(op.x), views, op.strategy == Strategy::SaddleBalanced);
                (1..views).fold(0, |best, view| if scores[view] < scores[best] { view } else { best })
            }
        };
        let order: Vec<usize> = std::iter::once(best).chain((0..views).filter(|i| *i != best)).collect();
        let place = |view: usize| order.iter().position(|o| *o == view).unwrap_or_else(|| panic!("view {view}"));
        let inverse = (0..views).map(|view| kept(place(view))).collect();
        vec![order.iter().map(|i| kept(*i)).collect(), inverse, vec![kept(best)]]
    }
}

/// A score for each view; the least wins.
fn scores(x: &[f64], views: usize, balanced: bool) -> Vec<f64> {
    let c = x.len() / views;
    let length = |row: &[f64]| row.iter().map(|v| v * v).sum::<f64>().sqrt();
    let lengths: Vec<f64> = x.chunks_exact(c).map(length).collect();
    let scaled = |(row, l): (&[f64], &f64)| row.iter().map(|v| v / l).collect::<Vec<f64>>();
    let unit: Vec<Vec<f64>> = x.chunks_exact(c).zip(&lengths).map(scaled).collect();
    let similarity = |i: usize, j: usize| {
        let dot = unit[i].iter().zip(&unit[j]).map(|(a, b)| a * b).sum::<f64>();
        if i == j { 0.0 } else { dot }
    };
    if !balanced {
        let range = |i: usize| {
            let all = || (0..views).map(|j| similarity(i, j));
            all().fold(f64::INFINITY, f64::min) - all().fold(f64::NEG_INFINITY, f64::max)
        };
        return (0..views).map(range).collect();
    }
    let mean = |i: usize| (0..views).map(|j| similarity(i, j)).sum::<f64>() / (views.max(2) - 1) as f64;
    let variance = |u: &Vec<f64>| {
        let mean = u.iter().sum::<f64>() / c as f64;
        u.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (c.max(2) - 1) as f64
    };
    let from_middle = |values: Vec<f64>| {
        let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
        values.into_iter().map(move |v| ((v - low) / (high - low + 1e-8) - 0.5).abs()).collect::<Vec<_>>()
    };
    let means = (0..views).map(mean).collect();
    let parts = [means, lengths, unit.iter().map(variance).collect()].map(from_middle);
    (0..views).map(|i| parts.iter().map(|part| part[i]).sum()).collect()
}
