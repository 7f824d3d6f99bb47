//! A transformer block (`spec/da3.md` 4.3):
//!
//! `x += ls1 · attention(norm1 x)`, `x += ls2 · ffn(norm2 x)`.
//!
//! Everything is recorded as separate rows-in, rows-out operations, so that fusion and chunks of rows find them. Where
//! one sequence holds all tokens, keys and values are made first, each from its own norm and its own rows of the
//! matrix: then nothing wider than a token stays in memory, and queries, attention and the feed-forward layer run as one
//! chain of row chunks. The norm repeated costs one pass; the product's sums are the same.

use omnix_graph::ops::Unary;
use omnix_graph::ops::{HeadNorm, Heads, Piece};
use omnix_graph::{Graph, GraphError, Value};
use omnix_weights::Scope;

use crate::config::FeedForward;
use crate::layers::{gelu, layer_norm, linear, linear_rows, scaled_residual};

/// Eps of the norm over a head's channels.
const HEAD_EPS: f32 = 1e-5;
/// Narrow heads are padded to a multiple of this.
const HEAD_STEP: usize = 8;

/// Which tokens see each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Span {
    /// This many sequences of equal length, one after the other.
    Groups(usize),
    /// All.
    All,
}

/// One block's place and shape.
pub(crate) struct Block {
    pub(crate) at: Scope,
    pub(crate) heads: usize,
    pub(crate) ffn: FeedForward,
    /// Of both norms.
    pub(crate) eps: f32,
    /// Whether queries and keys are normalised head by head.
    pub(crate) qk_norm: bool,
    /// RoPE table `[rows, head width]`.
    pub(crate) rope: Option<Value>,
    pub(crate) span: Span,
}

impl Block {
    /// `x [rows, C]` to the same shape.
    pub(crate) fn record(&self, g: &mut Graph, x: Value) -> Result<Value, GraphError> {
        let head_dim = g.shape(x).width() / self.heads;
        let mixed = match self.span {
            _ if !head_dim.is_multiple_of(HEAD_STEP) && !self.qk_norm && self.rope.is_none() => {
                self.narrow(g, x, head_dim)?
            }
            Span::Groups(groups) => self.grouped(g, x, groups, head_dim)?,
            Span::All => self.all(g, x, head_dim)?,
        };
        let out = linear(g, &self.at.pp("attn.proj"), mixed, self.heads * head_dim)?;
        let x = scaled_residual(g, &self.at.pp("ls1"), out, x)?;
        let out = self.feed_forward(g, x)?;
        scaled_residual(g, &self.at.pp("ls2"), out, x)
    }

    fn norm1(&self, g: &mut Graph, x: Value) -> Result<Value, GraphError> {
        layer_norm(g, &self.at.pp("norm1"), x, self.eps)
    }

    /// Attention within each group: queries, keys and values are columns of one product.
    fn grouped(&self, g: &mut Graph, x: Value, groups: usize, head_dim: usize) -> Result<Value, GraphError> {
        let c = self.heads * head_dim;
        let normed = self.norm1(g, x)?;
        let qkv = linear(g, &self.at.pp("attn.qkv"), normed, 3 * c)?;
        let q = self.layout(g, "q_norm", groups, head_dim);
        let q = g.query_heads(qkv, 0, &q)?;
        let k = self.layout(g, "k_norm", groups, head_dim);
        let k = g.key_heads(qkv, c, &k)?;
        let v = g.value_heads(qkv, 2 * c, &self.plain(groups, head_dim))?;
        g.attention(q, k, v)
    }

    /// Attention over all rows: keys, values, then the chain that starts with the queries.
    fn all(&self, g: &mut Graph, x: Value, head_dim: usize) -> Result<Value, GraphError> {
        let c = self.heads * head_dim;
        let part = |g: &mut Graph, i: usize| {
            let normed = self.norm1(g, x)?;
            linear_rows(g, &self.at.pp("attn.qkv"), normed, 3 * c, i * c..(i + 1) * c, &[3 * c, c])
        };
        let k = part(g, 1)?;
        let heads = self.layout(g, "k_norm", 1, head_dim);
        let k = g.key_heads(k, 0, &heads)?;
        let v = part(g, 2)?;
        let v = g.value_heads(v, 0, &self.plain(1, head_dim))?;
        let q = part(g, 0)?;
        let heads = self.layout(g, "q_norm", 1, head_dim);
        let q = g.query_heads(q, 0, &heads)?;
        g.attention(q, k, v)
    }

    /// Heads of any width, odd ones too (the camera encoder has 16 heads whatever the width), in one group: channels are padded
    /// with zeros, which change no product, and the scale is corrected. Neither norm nor RoPE.
    fn narrow(&self, g: &mut Graph, x: Value, head_dim: usize) -> Result<Value, GraphError> {
        let (rows, heads, wide) = (g.shape(x).rows(), self.heads, head_dim.next_multiple_of(HEAD_STEP));
        let c = heads * head_dim;
        let normed = self.norm1(g, x)?;
        let zero = g.constant("zero", [1], vec![0.0]);
        let part = |g: &mut Graph, i: usize| {
            let qkv = self.at.pp("attn.qkv");
            linear_rows(g, &qkv, normed, 3 * c, i * c..(i + 1) * c, &[3 * c, c])
        };
        let pad = |g: &mut Graph, value: Value| {
            let pieces = [
                Piece {
                    value,
                    dims: vec![rows, heads, head_dim],
                    start: 0,
                    strides: vec![c, head_dim, 1],
                    at: vec![0, 0, 0],
                },
                Piece {
                    value: zero,
                    dims: vec![rows, heads, wide - head_dim],
                    start: 0,
                    strides: vec![0; 3],
                    at: vec![0, 0, head_dim],
                },
            ];
            let padded = g.assemble([rows, heads, wide], &pieces)?;
            g.reshape(padded, [rows, heads * wide])
        };
        let layout = self.plain(1, wide);
        let q = part(g, 0)?;
        let q = g.map(Unary::ScaleShift { s: (wide as f32 / head_dim as f32).sqrt(), t: 0.0 }, q);
        let q = pad(g, q)?;
        let q = g.query_heads(q, 0, &layout)?;
        let k = part(g, 1)?;
        let k = pad(g, k)?;
        let k = g.key_heads(k, 0, &layout)?;
        let v = part(g, 2)?;
        let v = pad(g, v)?;
        let v = g.value_heads(v, 0, &layout)?;
        let mixed = g.attention(q, k, v)?;
        let mixed = g.reshape(mixed, [rows, heads, wide])?;
        let mixed = g.slice(mixed, 2, 0, head_dim)?;
        g.reshape(mixed, [rows, c])
    }

    /// How queries or keys are split: with the norm of this name and RoPE, where the block has them.
    fn layout(&self, g: &mut Graph, norm: &str, groups: usize, head_dim: usize) -> Heads {
        let norm = self.qk_norm.then(|| {
            let at = self.at.pp("attn").pp(norm);
            let weight = g.parameter(&at.name("weight"), [head_dim]);
            let bias = g.parameter(&at.name("bias"), [head_dim]);
            HeadNorm { weight, bias, eps: HEAD_EPS }
        });
        Heads { norm, rope: self.rope, ..self.plain(groups, head_dim) }
    }

    fn plain(&self, groups: usize, head_dim: usize) -> Heads {
        Heads { groups, heads: self.heads, head_dim, norm: None, rope: None }
    }

    fn feed_forward(&self, g: &mut Graph, x: Value) -> Result<Value, GraphError> {
        let (c, at) = (g.shape(x).width(), self.at.pp("mlp"));
        let normed = layer_norm(g, &self.at.pp("norm2"), x, self.eps)?;
        match self.ffn {
            FeedForward::Mlp { hidden } => {
                let inner = linear(g, &at.pp("fc1"), normed, hidden)?;
                let inner = gelu(g, inner);
                linear(g, &at.pp("fc2"), inner, c)
            }
            FeedForward::SwiGlu { hidden } => {
                let inner = linear(g, &at.pp("w12"), normed, 2 * hidden)?;
                let inner = g.swiglu(inner)?;
                linear(g, &at.pp("w3"), inner, c)
            }
        }
    }
}
