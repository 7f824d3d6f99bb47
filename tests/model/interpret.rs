//! Runs a graph on the processor, node by node, to show that what is recorded is the network and that fusion keeps it.
//!
//! Written from the operations' definitions; shares nothing with the kernels. f32 sums, plain loops. Head-major tensors are
//! `[group, head, token, channel]` whatever layout the kernels use; u32 values are kept as bits.

mod motion;

use std::collections::BTreeMap;

use omnix_graph::graph::{Source, WeightForm};
use omnix_graph::ops::{
    Attention, Binary, Conv2d, Copies, Corners, Filter, Gather, LayerNorm, Linear, Map, Op, Operand, ReferenceView,
    Resize, SplitHeads, Strategy, SwiGlu, Unary, Zip,
};
use omnix_graph::{Graph, Operation as _, Value};
use omnix_kernels::Activation;

/// Values by the index of their root.
pub(crate) struct Run<'a> {
    graph: &'a Graph,
    values: BTreeMap<Value, Vec<f32>>,
}

/// Runs `graph` with these inputs; `parameter` gives a tensor of the checkpoint.
pub(crate) fn run<'a>(graph: &'a Graph, inputs: &[(&str, &[f32])], parameter: &dyn Fn(&str) -> Vec<f32>) -> Run<'a> {
    let mut run = Run { graph, values: BTreeMap::new() };
    for (value, info) in graph.values() {
        let data = match &info.source {
            Source::Input => {
                let found = inputs.iter().find(|(name, _)| *name == info.name);
                found.unwrap_or_else(|| panic!("no input {}", info.name)).1.to_vec()
            }
            Source::Constant(data) => data.to_vec(),
            Source::Parameter(p) => {
                let all = parameter(&p.name);
                assert_eq!(all.len(), p.full.elements(), "{}", p.name);
                let row = p.full.elements() / p.full[0];
                let columns = p.columns.clone().unwrap_or(0..row);
                let rows = all[p.rows.start * row..p.rows.end * row].chunks_exact(row);
                rows.flat_map(|r| &r[columns.clone()]).copied().collect()
            }
            Source::Node(_) | Source::Reshape(_) => continue,
        };
        assert_eq!(data.len(), info.shape.elements(), "{}", info.name);
        run.values.insert(value, data);
    }
    for node in graph.nodes() {
        let results = run.node(&node.op, node.outputs[0]);
        for (value, data) in node.outputs.iter().zip(results) {
            assert_eq!(data.len(), graph.shape(*value).elements(), "{}", graph.value_name(*value));
            run.values.insert(*value, data);
        }
    }
    run
}

impl Run<'_> {
    /// The numbers of `value`.
    pub(crate) fn get(&self, value: Value) -> &[f32] {
        &self.values[&self.graph.root(value)]
    }

    /// The numbers of the value of this name, if it has been computed.
    pub(crate) fn find(&self, name: &str) -> Option<&[f32]> {
        self.values.get(&self.graph.root(self.graph.find(name)?)).map(Vec::as_slice)
    }

    fn dims(&self, value: Value) -> Vec<usize> {
        self.graph.shape(value).to_vec()
    }

    fn node(&self, op: &Op, y: Value) -> Vec<Vec<f32>> {
        match op {
            Op::Linear(l) => vec![self.linear(l)],
            Op::LayerNorm(LayerNorm { x, weight, bias, eps, act }) => {
                let get = |v: &Option<Value>| v.map(|v| self.get(v));
                let mut y = layer_norm(self.get(*x), self.graph.shape(*x).width(), get(weight), get(bias), *eps);
                y.iter_mut().for_each(|v| *v = activate(*act, *v));
                vec![y]
            }
            Op::SplitHeads(s) => vec![self.split_heads(s)],
            Op::Attention(a) => {
                let state = vec![0.0; a.groups * a.heads * a.queries.next_multiple_of(32) * 2];
                vec![self.attention(a), state]
            }
            Op::Conv2d(c) => vec![self.conv2d(c)],
            Op::Resize(Resize { x, filter, corners, code }) => vec![self.resize(*x, y, (*filter, *corners), *code)],
            Op::Copies(Copies { pieces }) => vec![self.copy(pieces)],
            Op::Map(Map { op, x }) => vec![self.get(*x).iter().map(|v| unary(*op, *v)).collect()],
            Op::Zip(Zip { op, a, b }) => vec![self.binary(*op, *a, *b)],
            Op::SwiGlu(SwiGlu { x }) => {
                let width = self.graph.shape(*x).width();
                let rows = self.get(*x).chunks_exact(width);
                let gated = |row: &[f32]| {
                    let (a, b) = row.split_at(width / 2);
                    a.iter().zip(b).map(|(a, b)| activate(Activation::Silu, *a) * b).collect::<Vec<_>>()
                };
                vec![rows.flat_map(gated).collect()]
            }
            Op::Gather(Gather { x, index }) => {
                let row = self.get(*x).len() / self.graph.shape(*x)[0];
                let rows = self.get(*index).iter().map(|i| &self.get(*x)[i.to_bits() as usize * row..][..row]);
                vec![rows.flatten().copied().collect()]
            }
            Op::ReferenceView(ReferenceView { x, strategy }) => {
                reference_view(self.get(*x), self.graph.shape(*x)[0], *strategy)
            }
            other => self.motion(other).unwrap_or_else(|| panic!("{} is not interpreted", other.name())),
        }
    }

    fn linear(&self, l: &Linear) -> Vec<f32> {
        let (x, w, k) = (self.get(l.x), self.get(l.w), self.graph.shape(l.x).width());
        // As [k][n], so that the inner loop runs over neighbours.
        let (n, table): (usize, Vec<f32>) = match l.form {
            WeightForm::Linear => {
                let n = w.len() / k;
                (n, (0..k).flat_map(|k0| (0..n).map(move |n0| w[n0 * k + k0])).collect())
            }
            WeightForm::ConvTranspose => {
                let [_, out, side, _] = self.dims(l.w)[..] else { panic!("a kernel") };
                let taps = side * side;
                let row = |c: usize| (0..taps).flat_map(move |t| (0..out).map(move |o| w[(c * out + o) * taps + t]));
                (out * taps, (0..k).flat_map(row).collect())
            }
            WeightForm::Conv | WeightForm::Winograd => panic!("a convolution's weights"),
        };
        let mut y = product(x, &table, k, n);
        let bias = l.bias.map(|b| self.get(b));
        let gamma = l.gamma.map(|v| self.get(v));
        let residual = l.residual.map(|v| self.get(v));
        for (i, v) in y.iter_mut().enumerate() {
            let column = i % n;
            let sum = *v + bias.map_or(0.0, |b| b[column % b.len()]);
            *v = activate(l.act, sum) * gamma.map_or(1.0, |g| g[column]) + residual.map_or(0.0, |r| r[i]);
        }
        y
    }

    fn split_heads(&self, s: &SplitHeads) -> Vec<f32> {
        let (x, width, d) = (self.get(s.x), self.graph.shape(s.x).width(), s.head_dim);
        let mut y = Vec::with_capacity(s.groups * s.heads * s.tokens * d);
        for group in 0..s.groups {
            for head in 0..s.heads {
                for token in 0..s.tokens {
                    let start = (group * s.tokens + token) * width + s.offset + head * d;
                    let mut row = x[start..start + d].to_vec();
                    if let Some((w, b, eps)) = s.norm {
                        row = layer_norm(&row, d, Some(self.get(w)), Some(self.get(b)), eps);
                    }
                    if let Some(table) = s.rope {
                        let rows = self.graph.shape(table)[0];
                        rotate(&mut row, &self.get(table)[token % rows * d..][..d]);
                    }
                    y.extend(row.iter().map(|v| v * s.scale));
                }
            }
        }
        y
    }

    fn attention(&self, a: &Attention) -> Vec<f32> {
        let (q, k, v, d) = (self.get(a.q), self.get(a.k), self.get(a.v), a.head_dim);
        let mut y = vec![0.0; a.groups * a.queries * a.heads * d];
        for group in 0..a.groups {
            for head in 0..a.heads {
                let start = |tokens: usize| (group * a.heads + head) * tokens * d;
                let keys = &k[start(a.keys)..][..a.keys * d];
                let values = &v[start(a.keys)..][..a.keys * d];
                for query in 0..a.queries {
                    let row = &q[start(a.queries) + query * d..][..d];
                    let dot = |key: &[f32]| row.iter().zip(key).map(|(a, b)| a * b).sum::<f32>();
                    let scores: Vec<f32> = keys.chunks_exact(d).map(dot).collect();
                    let most = scores.iter().copied().fold(f32::MIN, f32::max);
                    let weights: Vec<f32> = scores.iter().map(|s| (s - most).exp()).collect();
                    let total: f32 = weights.iter().sum();
                    let out = &mut y[((group * a.queries + query) * a.heads + head) * d..][..d];
                    for (weight, value) in weights.iter().zip(values.chunks_exact(d)) {
                        out.iter_mut().zip(value).for_each(|(o, v)| *o += weight / total * v);
                    }
                }
            }
        }
        y
    }

    fn conv2d(&self, c: &Conv2d) -> Vec<f32> {
        let (x, w) = (self.get(c.x), self.get(c.w));
        let [frames, h, width, ci] = self.dims(c.x)[..] else { panic!("a map") };
        let [co, _, kh, kw] = self.dims(c.w)[..] else { panic!("a kernel") };
        let side = |n: usize, k: usize| (n + 2 * c.padding - k) / c.stride + 1;
        let (ho, wo) = (side(h, kh), side(width, kw));
        let taps = kh * kw;
        let table: Vec<f32> = (0..taps)
            .flat_map(|t| (0..ci).flat_map(move |i| (0..co).map(move |o| w[(o * ci + i) * taps + t])))
            .collect();
        let mut y = vec![0.0f32; frames * ho * wo * co];
        for (pixel, out) in y.chunks_exact_mut(co).enumerate() {
            let (frame, oy, ox) = (pixel / (ho * wo), pixel / wo % ho, pixel % wo);
            for t in 0..taps {
                let (iy, ix) = (oy * c.stride + t / kw, ox * c.stride + t % kw);
                if iy < c.padding || ix < c.padding || iy - c.padding >= h || ix - c.padding >= width {
                    continue;
                }
                let from = &x[((frame * h + iy - c.padding) * width + ix - c.padding) * ci..][..ci];
                for (i, v) in from.iter().enumerate() {
                    let v = if c.relu_input { v.max(0.0) } else { *v };
                    let row = &table[(t * ci + i) * co..][..co];
                    out.iter_mut().zip(row).for_each(|(o, w)| *o += v * w);
                }
            }
        }
        let bias = c.bias.map(|b| self.get(b));
        let residuals: Vec<&[f32]> = c.residuals.iter().flatten().map(|r| self.get(*r)).collect();
        for (i, v) in y.iter_mut().enumerate() {
            let sum = *v + bias.map_or(0.0, |b| b[i % co]);
            *v = activate(c.act, sum) + residuals.iter().map(|r| r[i]).sum::<f32>();
        }
        y
    }

    fn resize(&self, x: Value, y: Value, (filter, corners): (Filter, Corners), code: Option<Value>) -> Vec<f32> {
        let [frames, h, w, c] = self.dims(x)[..] else { panic!("a map") };
        let [_, ho, wo, _] = self.dims(y)[..] else { panic!("a map") };
        let rows: Vec<_> = (0..ho).map(|o| taps(o, h, ho, filter, corners, true)).collect();
        let columns: Vec<_> = (0..wo).map(|o| taps(o, w, wo, filter, corners, false)).collect();
        let (data, mut y) = (self.get(x), vec![0.0f32; frames * ho * wo * c]);
        for (pixel, out) in y.chunks_exact_mut(c).enumerate() {
            let (frame, oy, ox) = (pixel / (ho * wo), pixel / wo % ho, pixel % wo);
            for (iy, wy) in &rows[oy] {
                for (ix, wx) in &columns[ox] {
                    let from = &data[((frame * h + iy) * w + ix) * c..][..c];
                    out.iter_mut().zip(from).for_each(|(o, v)| *o += (wy * wx) as f32 * v);
                }
            }
            if let Some(code) = code {
                let (table, half) = (self.get(code), c / 2);
                let [column, row] = [ox, wo + oy].map(|line| &table[line * half..][..half]);
                out.iter_mut().zip(column.iter().chain(row)).for_each(|(o, v)| *o += v);
            }
        }
        y
    }

    fn copy(&self, pieces: &[(Value, omnix_graph::ops::StridedCopy)]) -> Vec<f32> {
        let size = pieces.iter().map(|(_, p)| p.shape.iter().product::<u32>() as usize).sum();
        let mut y = vec![f32::NAN; size];
        for (value, piece) in pieces {
            let x = self.get(*value);
            for i in 0..piece.shape.iter().product::<u32>() {
                let (mut rest, mut from, mut to) = (i, piece.src.offset, piece.dst.offset);
                for axis in (0..6).rev() {
                    let at = rest % piece.shape[axis];
                    rest /= piece.shape[axis];
                    from += u64::from(at * piece.src.strides[axis]);
                    to += u64::from(at * piece.dst.strides[axis]);
                }
                assert!(y[to as usize].is_nan() || x[from as usize].is_nan(), "written twice");
                y[to as usize] = x[from as usize];
            }
        }
        y
    }

    fn binary(&self, op: Binary, a: Value, b: Operand) -> Vec<f32> {
        let other = self.get(b.value);
        let pairs = self.get(a).iter().enumerate().map(|(i, a)| (*a, other[i / b.div % b.len]));
        match op {
            Binary::Add => pairs.map(|(a, b)| a + b).collect(),
            Binary::Mul => pairs.map(|(a, b)| a * b).collect(),
            Binary::Max => pairs.map(|(a, b)| a.max(b)).collect(),
            other => panic!("{other:?} is not interpreted"),
        }
    }
}

/// `x [m, k]` times `[k][n]`.
fn product(x: &[f32], table: &[f32], k: usize, n: usize) -> Vec<f32> {
    let mut y = vec![0.0f32; x.len() / k * n];
    for (row, out) in x.chunks_exact(k).zip(y.chunks_exact_mut(n)) {
        for (v, weights) in row.iter().zip(table.chunks_exact(n)) {
            out.iter_mut().zip(weights).for_each(|(o, w)| *o += v * w);
        }
    }
    y
}

fn layer_norm(x: &[f32], c: usize, weight: Option<&[f32]>, bias: Option<&[f32]>, eps: f32) -> Vec<f32> {
    let mut y = Vec::with_capacity(x.len());
    for row in x.chunks_exact(c) {
        let mean = row.iter().map(|v| f64::from(*v)).sum::<f64>() / c as f64;
        let variance = row.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / c as f64;
        let scale = 1.0 / (variance + f64::from(eps)).sqrt();
        y.extend(row.iter().enumerate().map(|(i, v)| {
            let normed = ((f64::from(*v) - mean) * scale) as f32;
            normed * weight.map_or(1.0, |w| w[i]) + bias.map_or(0.0, |b| b[i])
        }));
    }
    y
}

/// RoPE by a row of cosines then sines, each of half the width.
fn rotate(row: &mut [f32], table: &[f32]) {
    let (d, q) = (row.len(), row.len() / 4);
    for angle in 0..d / 2 {
        let (cos, sin) = (table[angle], table[d / 2 + angle]);
        let first = angle / q * (d / 2) + angle % q;
        let (a, b) = (row[first], row[first + q]);
        (row[first], row[first + q]) = (a * cos - b * sin, b * cos + a * sin);
    }
}

fn activate(act: Activation, v: f32) -> f32 {
    act.apply(f64::from(v)) as f32
}

fn unary(op: Unary, v: f32) -> f32 {
    match op {
        Unary::Relu => v.max(0.0),
        Unary::Gelu => activate(Activation::Gelu, v),
        Unary::Silu => activate(Activation::Silu, v),
        Unary::Sigmoid => 1.0 / (1.0 + (-v).exp()),
        Unary::Softplus => {
            if v > 20.0 {
                v
            } else {
                v.exp().ln_1p()
            }
        }
        Unary::Exp => v.exp(),
        Unary::ExpClamped { low, high } => v.clamp(low, high).exp(),
        Unary::ScaleShift { s, t } => v * s + t,
        other => panic!("{other:?} is not interpreted"),
    }
}

/// Indices and weights of the source cells of output `o`.
fn taps(o: usize, from: usize, to: usize, filter: Filter, corners: Corners, rows: bool) -> Vec<(usize, f64)> {
    let o = o as f64;
    let src = match corners {
        Corners::Align if to == 1 => 0.0,
        Corners::Align => o * (from - 1) as f64 / (to - 1) as f64,
        Corners::HalfPixel => (o + 0.5) * from as f64 / to as f64 - 0.5,
        Corners::HalfPixelScaled { rows: r, columns: c } => {
            let scale = if rows { r } else { c };
            (o + 0.5) * f64::from(scale.num) / f64::from(scale.den) - 0.5
        }
    };
    let cell = |i: f64| i.clamp(0.0, (from - 1) as f64) as usize;
    let (floor, f) = (src.floor(), src - src.floor());
    match filter {
        Filter::Bilinear => vec![(cell(floor), 1.0 - f), (cell(floor + 1.0), f)],
        Filter::Bicubic => {
            const A: f64 = -0.75;
            let near = |x: f64| (A + 2.0) * x.powi(3) - (A + 3.0) * x.powi(2) + 1.0;
            let far = |x: f64| A * x.powi(3) - 5.0 * A * x.powi(2) + 8.0 * A * x - 4.0 * A;
            let weights = [far(1.0 + f), near(f), near(1.0 - f), far(2.0 - f)];
            weights.into_iter().enumerate().map(|(i, w)| (cell(floor + i as f64 - 1.0), w)).collect()
        }
    }
}

/// `spec/da3.md` section 5: order, inverse, reference.
fn reference_view(x: &[f32], s: usize, strategy: Strategy) -> Vec<Vec<f32>> {
    let c = x.len() / s;
    let length = |row: &[f32]| row.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
    let lengths: Vec<f64> = x.chunks_exact(c).map(length).collect();
    let unit: Vec<Vec<f64>> =
        x.chunks_exact(c).zip(&lengths).map(|(row, l)| row.iter().map(|v| f64::from(*v) / l).collect()).collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let sim = |i: usize, j: usize| dot(&unit[i], &unit[j]) - if i == j { 1.0 } else { 0.0 };
    let scores: Vec<f64> = match strategy {
        Strategy::SaddleBalanced => {
            let means = (0..s).map(|i| (0..s).map(|j| sim(i, j)).sum::<f64>() / (s - 1) as f64).collect();
            let variance = |u: &Vec<f64>| {
                let mean = u.iter().sum::<f64>() / c as f64;
                u.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (c - 1) as f64
            };
            let scaled = |values: Vec<f64>| {
                let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
                values.into_iter().map(move |v| ((v - low) / (high - low + 1e-8) - 0.5).abs()).collect::<Vec<_>>()
            };
            let parts = [scaled(means), scaled(lengths), scaled(unit.iter().map(variance).collect())];
            (0..s).map(|i| parts.iter().map(|p| p[i]).sum()).collect()
        }
        other => panic!("{other:?} is not interpreted"),
    };
    let best = (0..s).min_by(|a, b| scores[*a].total_cmp(&scores[*b])).unwrap();
    let order: Vec<usize> = std::iter::once(best).chain((0..s).filter(|i| *i != best)).collect();
    let inverse = (0..s).map(|i| order.iter().position(|o| *o == i).unwrap());
    let bits = |items: Vec<usize>| items.into_iter().map(|i| f32::from_bits(i as u32)).collect();
    vec![bits(order.clone()), bits(inverse.collect()), bits(vec![best])]
}
