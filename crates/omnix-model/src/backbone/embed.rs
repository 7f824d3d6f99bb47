//! Pictures to tokens: patch embedding, class token, position rows (`spec/da3.md` 4.1, 4.2).

use omnix_graph::ops::Piece;
use omnix_graph::ops::{Corners, Filter, Ratio};
use omnix_graph::{Graph, GraphError, Value};
use omnix_weights::Scope;

use super::spec::BackboneSpec;
use crate::PATCH;
use crate::config::BackboneConfig;
use crate::layers::precise_linear;

/// `[S, 3, H, W]` to `[S·T, C]`.
pub(super) fn record(
    g: &mut Graph,
    at: &Scope,
    config: &BackboneConfig,
    spec: &BackboneSpec,
    images: Value,
) -> Result<Value, GraphError> {
    let (s, (rows, columns), p, c) = (spec.images, spec.grid, spec.patches(), config.width);
    // A patch as one row (channel, row, column), which is the order of the kernel's weights.
    let split = g.reshape(images, [s, 3, rows, PATCH, columns, PATCH])?;
    let patches = g.permute(split, &[0, 2, 4, 1, 3, 5])?;
    let patches = g.reshape(patches, [s * p, 3 * PATCH * PATCH])?;
    let patches = precise_linear(g, &at.pp("patch_embed.proj"), patches, &[c, 3, PATCH, PATCH])?;
    g.name(patches, "tok.patch_embed");

    let class = g.parameter(&at.name("cls_token"), [1, 1, c]);
    let pieces = [
        Piece { value: class, dims: vec![s, 1, c], start: 0, strides: vec![0, 0, 1], at: vec![0, 0, 0] },
        Piece { value: patches, dims: vec![s, p, c], start: 0, strides: vec![p * c, c, 1], at: vec![0, 1, 0] },
    ];
    let tokens = g.assemble([s, p + 1, c], &pieces)?;
    let positions = positions(g, at, config, spec.grid)?;
    let tokens = g.add_values(tokens, positions)?;
    g.name(tokens, "tok.embedded");
    g.reshape(tokens, [s * (p + 1), c])
}

/// Position rows `[T, C]`: the class token's row, then the stored grid resampled. Only a picture of exactly the stored
/// grid takes it as it is.
fn positions(
    g: &mut Graph,
    at: &Scope,
    config: &BackboneConfig,
    (rows, columns): (usize, usize),
) -> Result<Value, GraphError> {
    let (grid, c, p) = (config.position_grid, config.width, rows * columns);
    let stored = g.parameter(&at.name("pos_embed"), [1, 1 + grid * grid, c]);
    if (rows, columns) == (grid, grid) {
        return g.reshape(stored, [1 + p, c]);
    }
    let places = g.slice(stored, 1, 1, grid * grid)?;
    let places = g.reshape(places, [1, grid, grid, c])?;
    // The published scale is grid / (n + 0.1).
    let scale = |n: usize| Ratio { num: 10 * grid as u32, den: 10 * n as u32 + 1 };
    let corners = Corners::HalfPixelScaled { rows: scale(rows), columns: scale(columns) };
    let places = g.resize(places, rows, columns, Filter::Bicubic, corners)?;
    let pieces = [
        Piece { value: stored, dims: vec![1, c], start: 0, strides: vec![c, 1], at: vec![0, 0] },
        Piece { value: places, dims: vec![p, c], start: 0, strides: vec![c, 1], at: vec![1, 0] },
    ];
    let table = g.assemble([1 + p, c], &pieces)?;
    Ok(g.name(table, "tok.pos_embed"))
}
