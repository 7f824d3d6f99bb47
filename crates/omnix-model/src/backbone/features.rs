//! What leaves the encoder: features, camera tokens, exported layers (`spec/da3.md` 4.7).

use omnix_graph::ops::Piece;
use omnix_graph::{Graph, GraphError, Value};
use omnix_weights::Scope;

use super::reference::Order;
use super::spec::BackboneSpec;
use crate::layers::layer_norm;

/// Eps of the final norm, which all taken layers share.
const FINAL_EPS: f32 = 1e-5;

/// Feature `k` `[S, P, 2C]` = the patches of `[local | LN(x)]` and the camera token `[S, 2C]` = token 0 of `[local | x]`,
/// both with the views in their original order. Without `local` both are `x`'s half alone, of C channels.
pub(super) fn take(
    g: &mut Graph,
    at: &Scope,
    spec: &BackboneSpec,
    order: &Order,
    k: usize,
    (local, x): (Option<Value>, Value),
) -> Result<(Value, Value), GraphError> {
    let (s, t, c) = (spec.images, spec.tokens(), g.shape(x).width());
    let normed = layer_norm(g, &at.pp("norm"), x, FINAL_EPS)?;
    // Each half alone: the joined feature is the largest value, and one more of it would set the peak of memory.
    let own = order.undo(g, normed)?;
    let beside = local.map(|local| order.undo(g, local)).transpose()?;
    let first = if local.is_some() { c } else { 0 };
    let patches = |value: Value, column: usize| Piece {
        value,
        dims: vec![s, t - 1, c],
        start: c,
        strides: vec![t * c, c, 1],
        at: vec![0, 0, column],
    };
    let halves: Vec<Piece> = beside.map(|beside| patches(beside, 0)).into_iter().chain([patches(own, first)]).collect();
    let feature = g.assemble([s, t - 1, first + c], &halves)?;
    g.output(feature, &format!("feat.{k}"));

    let token = |value: Value, column: usize| Piece {
        value,
        dims: vec![s, c],
        start: 0,
        strides: vec![t * c, 1],
        at: vec![0, column],
    };
    let halves: Vec<Piece> = local.map(|local| token(local, 0)).into_iter().chain([token(x, first)]).collect();
    let camera = g.assemble([s, first + c], &halves)?;
    let camera = order.undo(g, camera)?;
    g.name(camera, &format!("feat.{k}.cam"));
    Ok((feature, camera))
}

/// The normalised patch tokens `[S, gh, gw, C]` of block `i`, views in the order inside the network.
pub(super) fn export(g: &mut Graph, at: &Scope, spec: &BackboneSpec, x: Value, i: usize) -> Result<Value, GraphError> {
    let (s, t, c) = (spec.images, spec.tokens(), g.shape(x).width());
    let normed = layer_norm(g, &at.pp("norm"), x, FINAL_EPS)?;
    let tokens = g.reshape(normed, [s, t, c])?;
    let patches = g.slice(tokens, 1, 1, t - 1)?;
    let map = g.reshape(patches, [s, spec.grid.0, spec.grid.1, c])?;
    g.output(map, &format!("out.aux.feat_layer_{i}"));
    Ok(map)
}
