//! The operations of the trajectory module and its sampling head, from their definitions (`omnix_graph::ops`).

use omnix_graph::Value;
use omnix_graph::ops::{FieldScatter, Op, Reduce, ReduceOp, Softmax, TokenExpand, TopK};

use super::Run;

impl Run<'_> {
    /// The results of `op`, if it is one of these.
    pub(super) fn motion(&self, op: &Op) -> Option<Vec<Vec<f32>>> {
        Some(match op {
            Op::Softmax(Softmax { x }) => vec![softmax(self.get(*x), self.graph.shape(*x).width())],
            Op::Reduce(Reduce { x, op, dims }) => vec![reduce(self.get(*x), *op, *dims)],
            Op::TopK(TopK { x, k, flat }) => {
                let (index, mask) = top_k(self.get(*x), self.graph.shape(*x).width(), *k, *flat);
                vec![index, mask]
            }
            Op::TokenExpand(TokenExpand { q, scale, shift, alpha, kappa }) => {
                vec![self.token_expand(*q, *shift, [*scale, *alpha, *kappa])]
            }
            Op::FieldScatter(FieldScatter { z, index, rest }) => vec![self.field_scatter(*z, *index, *rest)],
            _ => return None,
        })
    }

    fn token_expand(&self, q: Value, shift: Value, [scale, alpha, kappa]: [Option<Value>; 3]) -> Vec<f32> {
        let d = self.graph.shape(q).width();
        let (q, shift) = (self.get(q), self.get(shift));
        let or = |value: Option<Value>, i: usize, absent: f32| value.map_or(absent, |v| self.get(v)[i]);
        let mut z = Vec::with_capacity(shift.len() / d * q.len());
        for time in 0..shift.len() / d {
            for (i, q) in q.iter().enumerate() {
                let (row, at) = (i / d, time * d + i % d);
                z.push(q * (1.0 + or(alpha, row, 1.0) * or(scale, at, 0.0)) + or(kappa, row, 1.0) * shift[at]);
            }
        }
        z
    }

    fn field_scatter(&self, z: Value, index: Value, rest: Value) -> Vec<f32> {
        let [times, sources, k, c] = self.dims(z)[..] else { panic!("a stream") };
        let (z, index, rest) = (self.get(z), self.get(index), self.get(rest));
        // The field's own shape says how many cells there are.
        let made = self.graph.nodes().iter().find(|n| matches!(n.op, Op::FieldScatter(_))).unwrap();
        let cells = self.graph.shape(made.outputs[0])[2];
        let mut field = rest.repeat(sources * times * cells);
        for s in 0..sources {
            for t in 0..times {
                for i in 0..k {
                    let cell = index[s * k + i].to_bits() as usize;
                    field[((s * times + t) * cells + cell) * c..][..c]
                        .copy_from_slice(&z[((t * sources + s) * k + i) * c..][..c]);
                }
            }
        }
        field
    }
}

fn softmax(x: &[f32], width: usize) -> Vec<f32> {
    let row = |row: &[f32]| {
        let most = row.iter().copied().fold(f32::MIN, f32::max);
        let powers: Vec<f32> = row.iter().map(|v| (v - most).exp()).collect();
        let sum: f32 = powers.iter().sum();
        powers.into_iter().map(move |p| p / sum).collect::<Vec<_>>()
    };
    x.chunks_exact(width).flat_map(row).collect()
}

fn reduce(x: &[f32], op: ReduceOp, [outer, n, inner]: [usize; 3]) -> Vec<f32> {
    let one = |at: usize| {
        let values = || (0..n).map(move |j| x[(at / inner * n + j) * inner + at % inner]);
        let mean = values().sum::<f32>() / n as f32;
        match op {
            ReduceOp::Sum => values().sum(),
            ReduceOp::Mean => mean,
            ReduceOp::Max => values().fold(f32::MIN, f32::max),
            ReduceOp::Min => values().fold(f32::MAX, f32::min),
            ReduceOp::Std if n == 1 => 0.0,
            ReduceOp::Std => (values().map(|v| (v - mean) * (v - mean)).sum::<f32>() / (n - 1) as f32).sqrt(),
        }
    };
    (0..outer * inner).map(one).collect()
}

/// Ascending indices, as bits, and the mask; of equal values the lower index.
fn top_k(x: &[f32], width: usize, k: usize, flat: bool) -> (Vec<f32>, Vec<f32>) {
    let (mut index, mut mask) = (Vec::new(), vec![0.0; x.len()]);
    for (row, values) in x.chunks_exact(width).enumerate() {
        let rank =
            |i: usize| (0..width).filter(|&j| values[j] > values[i] || (values[j] == values[i] && j < i)).count();
        for i in (0..width).filter(|&i| rank(i) < k) {
            mask[row * width + i] = 1.0;
            index.push(f32::from_bits((if flat { row * width + i } else { i }) as u32));
        }
    }
    (index, mask)
}
