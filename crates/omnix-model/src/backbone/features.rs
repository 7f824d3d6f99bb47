//! What leaves the encoder: features, camera tokens, exported layers (`spec/da3.md` 4.7).

use omnix_graph::ops::Piece;
use omnix_graph::{Graph, GraphError, Value};

use super::reference::Order;
use super::spec::{BackboneSpec, root};
use crate::layers::layer_norm;

/// Eps of the final norm, which all taken layers share.
const FINAL_EPS: f32 = 1e-5;

/// Feature `k` `[S, P, 2C]` = the patches of `[local | LN(x)]` and the camera token `[S, 2C]` = token 0 of `[local | x]`,
/// both with the views in their original order.
pub(super) fn take(
    g: &mut Graph,
    spec: &BackboneSpec,
    order: &Order,
    k: usize,
    local: Value,
    x: Value,
) -> Result<(Value, Value), GraphError> {
    let (s, t, c) = (spec.images, spec.tokens(), g.shape(x).width());
    let normed = layer_norm(g, &root().pp("norm"), x, FINAL_EPS)?;
    // Each half alone: the joined feature is the largest value, and one more of it would set the peak of memory.
    let (own, beside) = (order.undo(g, normed)?, order.undo(g, local)?);
    let patches = |value: Value, column: usize| Piece {
        value,
        dims: vec![s, t - 1, c],
        start: c,
        strides: vec![t * c, c, 1],
        at: vec![0, 0, column],
    };
    let feature = g.assemble([s, t - 1, 2 * c], &[patches(beside, 0), patches(own, c)])?;
    g.output(feature, &format!("feat.{k}"));

    let token = |value: Value, column: usize| Piece {
        value,
        dims: vec![s, c],
        start: 0,
        strides: vec![t * c, 1],
        at: vec![0, column],
    };
    let camera = g.assemble([s, 2 * c], &[token(local, 0), token(x, c)])?;
    let camera = order.undo(g, camera)?;
    g.name(camera, &format!("feat.{k}.cam"));
    Ok((feature, camera))
}

/// The normalised patch tokens `[S, gh, gw, C]` of block `i`, views in the order inside the network.
pub(super) fn export(g: &mut Graph, spec: &BackboneSpec, x: Value, i: usize) -> Result<Value, GraphError> {
    let (s, t, c) = (spec.images, spec.tokens(), g.shape(x).width());
    let normed = layer_norm(g, &root().pp("norm"), x, FINAL_EPS)?;
    let tokens = g.reshape(normed, [s, t, c])?;
    let patches = g.slice(tokens, 1, 1, t - 1)?;
    let map = g.reshape(patches, [s, spec.grid.0, spec.grid.1, c])?;
    g.output(map, &format!("out.aux.feat_layer_{i}"));
    Ok(map)
}
