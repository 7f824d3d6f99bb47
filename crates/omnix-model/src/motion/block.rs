//! A spatiotemporal block (`spec/omnix.md` section 6; self-attention: section 9):
//!
//! `z += ls2 · cross attention(norm2 z, F)`, `z += ls3 · fc2(gelu(fc1(norm3 z)))`, before both, where switched on, attention
//! of a token to itself at all target times and of all tokens of a target time to each other.
//!
//! Queries turn with their token's place on the grid, which is known on the device alone: the rows of the table are
//! gathered as the tokens were.

use omnix_graph::ops::{HeadNorm, Heads};
use omnix_graph::{Graph, GraphError, Value};
use omnix_weights::Scope;

use super::spec::{MotionSpec, root};
use super::tokens::Chosen;
use crate::config::TrajectoryConfig;
use crate::layers::{branch, gelu, layer_norm, linear, linear_rows};
use crate::rope;

/// Eps of the norm over a head's channels.
const HEAD_EPS: f32 = 1e-5;

/// What all blocks attend to.
pub(super) struct Memory {
    /// F `[T, L, d]`.
    tokens: Value,
    /// Rotary rows of the grid's cells `[L, head width]` and of the chosen tokens `[T · K, head width]`.
    rope: Option<(Value, Value)>,
    /// Chosen tokens of all images, T · K.
    chosen: usize,
}

impl Memory {
    /// F with the rotary rows of its tokens.
    pub(super) fn new(
        g: &mut Graph,
        config: &TrajectoryConfig,
        spec: &MotionSpec,
        tokens: Value,
        chosen: &Chosen,
    ) -> Result<Self, GraphError> {
        let count = spec.images * config.chosen(spec.patches());
        let rope = match config.rope_base {
            Some(base) => {
                let (rows, columns) = (spec.grid.0 as u32, spec.grid.1 as u32);
                let places: Vec<(u32, u32)> = (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))).collect();
                let cells = rope::table(g, "rope.grid", &places, config.head_dim(), base);
                let places = g.reshape(chosen.places, [count])?;
                Some((cells, g.gather(cells, places)?))
            }
            None => None,
        };
        Ok(Self { tokens, rope, chosen: count })
    }
}

/// One block and what its parts share.
struct Block<'a> {
    config: &'a TrajectoryConfig,
    at: Scope,
    times: usize,
    memory: &'a Memory,
}

/// Block `i` over `z [T · T · K, d]`.
pub(super) fn record(
    g: &mut Graph,
    config: &TrajectoryConfig,
    spec: &MotionSpec,
    i: usize,
    memory: &Memory,
    z: Value,
) -> Result<Value, GraphError> {
    let block = Block { config, at: root().pp("blocks").pp(i), times: spec.images, memory };
    let mut z = z;
    if config.temporal_blocks.contains(&i) {
        z = block.temporal(g, z)?;
    }
    if config.spatial_blocks.contains(&i) {
        let rope = memory.rope.map(|(_, chosen)| chosen);
        z = block.attend_to_each_other(g, z, "spatial", "sp", block.times, rope)?;
    }
    if !config.no_cross_blocks.contains(&i) {
        let groups = if config.same_time_blocks.contains(&i) { block.times } else { 1 };
        z = block.cross(g, z, groups)?;
    }
    block.feed_forward(g, z)
}

impl Block<'_> {
    fn norm(&self, g: &mut Graph, name: &str, x: Value) -> Result<Value, GraphError> {
        layer_norm(g, &self.at.pp(name), x, self.config.norm_eps)
    }

    /// `x + scale · part`.
    fn add(&self, g: &mut Graph, scale: &str, part: Value, x: Value) -> Result<Value, GraphError> {
        let scale = self.at.pp(scale);
        branch(g, self.config.layer_scale.then_some(&scale), part, x)
    }

    /// How queries (`q_norm`) or keys (`k_norm`) of an attention are split.
    fn heads(&self, g: &mut Graph, attention: &Scope, norm: &str, groups: usize, rope: Option<Value>) -> Heads {
        let head_dim = self.config.head_dim();
        let norm = self.config.qk_norm.then(|| {
            let at = attention.pp(norm);
            let weight = g.parameter(&at.name("weight"), [head_dim]);
            let bias = g.parameter(&at.name("bias"), [head_dim]);
            HeadNorm { weight, bias, eps: HEAD_EPS }
        });
        Heads { groups, heads: self.config.heads, head_dim, norm, rope }
    }

    /// To F: its image of the target time alone (`groups` target times) or all of it (one group).
    fn cross(&self, g: &mut Graph, z: Value, groups: usize) -> Result<Value, GraphError> {
        let (d, at) = (self.config.width, self.at.pp("attn_cross"));
        let (cells, chosen) = self.memory.rope.unzip();
        let tokens = self.memory.tokens;
        let rows = g.shape(tokens).rows();
        let tokens = g.reshape(tokens, [rows, d])?;
        let part =
            |g: &mut Graph, i: usize| linear_rows(g, &at.pp("kv"), tokens, 2 * d, i * d..(i + 1) * d, &[2 * d, d]);
        // Keys and values come first: queries, attention and all behind it are then one chain of row chunks.
        let k = part(g, 0)?;
        let heads = self.heads(g, &at, "k_norm", groups, cells);
        let k = g.key_heads(k, 0, &heads)?;
        let v = part(g, 1)?;
        let v = g.value_heads(v, 0, &heads)?;
        let normed = self.norm(g, "norm2", z)?;
        let q = linear(g, &at.pp("q"), normed, d)?;
        let heads = self.heads(g, &at, "q_norm", groups, chosen);
        let q = g.query_heads(q, 0, &heads)?;
        let mixed = g.attention(q, k, v)?;
        let out = linear(g, &at.pp("proj"), mixed, d)?;
        self.add(g, "ls2", out, z)
    }

    /// Each token to itself at all target times. It stays in its place on the grid, where queries and keys turn alike, so
    /// RoPE would change nothing.
    fn temporal(&self, g: &mut Graph, z: Value) -> Result<Value, GraphError> {
        let (times, tokens, d) = (self.times, self.memory.chosen, self.config.width);
        let turned = |g: &mut Graph, x: Value, [a, b]: [usize; 2]| {
            let x = g.reshape(x, [a, b, d])?;
            let x = g.permute(x, &[1, 0, 2])?;
            g.reshape(x, [a * b, d])
        };
        let z = turned(g, z, [times, tokens])?;
        let z = self.attend_to_each_other(g, z, "temporal", "tem", tokens, None)?;
        turned(g, z, [tokens, times])
    }

    /// Self-attention within each of `groups` runs of rows.
    fn attend_to_each_other(
        &self,
        g: &mut Graph,
        z: Value,
        kind: &str,
        suffix: &str,
        groups: usize,
        rope: Option<Value>,
    ) -> Result<Value, GraphError> {
        let (d, at) = (self.config.width, self.at.pp(format_args!("attn_{kind}")));
        let normed = self.norm(g, &format!("norm1_{suffix}"), z)?;
        let qkv = linear(g, &at.pp("qkv"), normed, 3 * d)?;
        let heads = self.heads(g, &at, "q_norm", groups, rope);
        let q = g.query_heads(qkv, 0, &heads)?;
        let heads = self.heads(g, &at, "k_norm", groups, rope);
        let k = g.key_heads(qkv, d, &heads)?;
        let v = g.value_heads(qkv, 2 * d, &heads)?;
        let mixed = g.attention(q, k, v)?;
        let out = linear(g, &at.pp("proj"), mixed, d)?;
        self.add(g, &format!("ls1_{suffix}"), out, z)
    }

    fn feed_forward(&self, g: &mut Graph, z: Value) -> Result<Value, GraphError> {
        let (d, at) = (self.config.width, self.at.pp("mlp"));
        let normed = self.norm(g, "norm3", z)?;
        let inner = linear(g, &at.pp("fc1"), normed, d * self.config.mlp_ratio)?;
        let inner = gelu(g, inner);
        let out = linear(g, &at.pp("fc2"), inner, d)?;
        self.add(g, "ls3", out, z)
    }
}
