//! Attention, and columns that become heads: with and without norm, rotation and repeats of the table.

use omnix_graph::Value;
use omnix_graph::ops::{HeadNorm, Heads};
use omnix_kernels::Gpu;
use omnix_tests::{Trial, trials};

use crate::case::Case;

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "attention",
        tiers: [queries_keys_and_values, heads_of_64, heads_of_96],
        device: [norms_and_rotations, heads_that_only_some_columns_make, a_block],
    )
}

/// Heads without norm and rotation.
fn plain(groups: usize, heads: usize, head_dim: usize) -> Heads {
    Heads { groups, heads, head_dim, norm: None, rope: None }
}

/// Attention of the queries in the first columns of `x` to the keys and values in the two next thirds of `z`.
fn attend(case: &mut Case, (x, z): (Value, Value), offsets: [usize; 3], [q, k]: [Heads; 2]) -> Value {
    let q = case.graph.query_heads(x, offsets[0], &q).expect("queries");
    let v = case.graph.value_heads(z, offsets[2], &k).expect("values");
    let k = case.graph.key_heads(z, offsets[1], &k).expect("keys");
    case.graph.attention(q, k, v).expect("records")
}

/// Widths that take one and the same kernels of a tier. Wider heads take others, each in a test of its own: with an empty shader cache a
/// software driver compiles those of GPUs for minutes.
fn queries_keys_and_values(gpu: &Gpu) {
    each_shape(gpu, &[(1, 1, 1, 1, 4), (2, 5, 5, 2, 8), (1, 33, 40, 1, 16), (3, 7, 4, 3, 32), (1, 9, 65, 2, 24)]);
}

fn heads_of_64(gpu: &Gpu) {
    each_shape(gpu, &[(1, 6, 6, 1, 64)]);
}

fn heads_of_96(gpu: &Gpu) {
    each_shape(gpu, &[(1, 5, 4, 1, 96)]);
}

/// Groups, queries, keys, heads and their width.
fn each_shape(gpu: &Gpu, shapes: &[(usize, usize, usize, usize, usize)]) {
    for &(groups, queries, keys, heads, d) in shapes {
        let mut case = Case::new(format!("{groups} groups, {queries} x {keys}, {heads} heads of {d}"));
        let c = heads * d;
        let (x, z) = (case.leaf("x", [groups * queries, c]), case.leaf("z", [groups * keys, 2 * c]));
        let spec = plain(groups, heads, d);
        let y = attend(&mut case, (x, z), [0, 0, c], [spec, spec]);
        case.check(gpu, &[y]);
    }
}

fn norms_and_rotations(gpu: &Gpu) {
    for (groups, tokens, heads, d, normed, rows) in [
        (1, 6, 2, 8, true, None),
        (2, 6, 1, 16, false, Some(6)),
        (1, 12, 2, 16, true, Some(4)),
        (3, 5, 2, 32, true, Some(5)),
    ] {
        let mut case = Case::new(format!("{groups} x {tokens}, {heads} heads of {d}, norm {normed}, {rows:?} rows"));
        let c = heads * d;
        let x = case.leaf("x", [groups * tokens, 3 * c]);
        let rope = rows.map(|rows: usize| {
            let angles = case.numbers("angles", rows * d / 2);
            let row =
                |row: &[f32]| row.iter().map(|a| a.cos()).chain(row.iter().map(|a| a.sin())).collect::<Vec<f32>>();
            let table: Vec<f32> = angles.chunks_exact(d / 2).flat_map(row).collect();
            case.graph.constant("table", [rows, d], table)
        });
        let spec = |name: &str, case: &mut Case| {
            let norm = normed.then(|| HeadNorm {
                weight: case.parameter(&format!("{name}.weight"), [d]),
                bias: case.parameter(&format!("{name}.bias"), [d]),
                eps: 1e-6,
            });
            Heads { norm, rope, ..plain(groups, heads, d) }
        };
        // A number added to all keys changes no weight of a softmax: without rotation the bias of keys alone has no gradient, and
        // queries and keys share their norm here.
        let of_keys = if rows.is_some() { "k" } else { "q" };
        let specs = [spec("q", &mut case), spec(of_keys, &mut case)];
        let y = attend(&mut case, (x, x), [0, c, 2 * c], specs);
        case.check(gpu, &[y]);
    }
}

/// Columns between the heads, and what is left of them.
fn heads_that_only_some_columns_make(gpu: &Gpu) {
    let mut case = Case::new("columns between");
    let x = case.leaf("x", [2 * 3, 40]);
    let y = attend(&mut case, (x, x), [3, 14, 29], [plain(2, 2, 4); 2]);
    case.check(gpu, &[y]);
}

fn a_block(gpu: &Gpu) {
    let mut case = Case::new("block");
    let (groups, tokens, heads, d) = (2, 5, 2, 8);
    let c = heads * d;
    let x = case.leaf("x", [groups * tokens, c]);
    let (w1, b1) = (case.parameter("norm.weight", [c]), case.parameter("norm.bias", [c]));
    let normed = case.graph.layer_norm(x, Some(w1), Some(b1), 1e-6).expect("norm");
    let (qkv, bias) = (case.parameter("qkv.weight", [3 * c, c]), case.parameter("qkv.bias", [3 * c]));
    let columns = case.graph.linear(normed, qkv, Some(bias)).expect("qkv");
    let local = attend(&mut case, (columns, columns), [0, c, 2 * c], [plain(groups, heads, d); 2]);
    let proj = case.parameter("proj", [c, c]);
    let y = case.graph.linear(local, proj, None).expect("proj");
    let y = case.graph.add_values(x, y).expect("residual");
    // Then over all groups together.
    let columns = case.graph.linear(y, qkv, Some(bias)).expect("qkv");
    let global = attend(&mut case, (columns, columns), [0, c, 2 * c], [plain(1, heads, d); 2]);
    let y = case.graph.add_values(y, global).expect("residual");
    case.check(gpu, &[y]);
}
