//! What is put into the tokens between blocks: camera tokens (`spec/da3.md` 4.6) and time codes (`spec/omnix.md` 3.6).

use omnix_geometry::codes::time_codes;
use omnix_graph::ops::Piece;
use omnix_graph::{Graph, GraphError, Value};
use omnix_weights::Scope;

use super::spec::BackboneSpec;
use crate::config::TimeConfig;
use crate::layers::linear;

/// Token 0 of view 0 becomes the reference's learnt token, of every other view the sources'.
pub(super) fn learnt_cameras(g: &mut Graph, at: &Scope, spec: &BackboneSpec, x: Value) -> Result<Value, GraphError> {
    let (s, c) = (spec.images, g.shape(x).width());
    let learnt = g.parameter(&at.name("camera_token"), [1, 2, c]);
    let row = |start: usize, views: usize, first: usize| Piece {
        value: learnt,
        dims: vec![views, 1, c],
        start,
        strides: vec![0, 0, 1],
        at: vec![first, 0, 0],
    };
    replaced(g, spec, x, vec![row(0, 1, 0), row(c, s - 1, 1)])
}

/// Token 0 of every view becomes that view's row of `given` `[S, C]`.
pub(super) fn given_cameras(g: &mut Graph, spec: &BackboneSpec, x: Value, given: Value) -> Result<Value, GraphError> {
    let (s, c) = (spec.images, g.shape(x).width());
    let rows = Piece { value: given, dims: vec![s, 1, c], start: 0, strides: vec![c, 0, 1], at: vec![0, 0, 0] };
    replaced(g, spec, x, vec![rows])
}

/// `x` with `rows` in place of token 0 of every view.
fn replaced(g: &mut Graph, spec: &BackboneSpec, x: Value, mut rows: Vec<Piece>) -> Result<Value, GraphError> {
    let (s, t, c) = (spec.images, spec.tokens(), g.shape(x).width());
    rows.push(Piece { value: x, dims: vec![s, t - 1, c], start: c, strides: vec![t * c, c, 1], at: vec![0, 1, 0] });
    let tokens = g.assemble([s, t, c], &rows)?;
    g.reshape(tokens, [s * t, c])
}

/// Every token of image s, token 0 included, gets `P_v code(video) + P_f code(frame)`.
pub(super) fn add_times(
    g: &mut Graph,
    at: &Scope,
    config: TimeConfig,
    spec: &BackboneSpec,
    x: Value,
) -> Result<Value, GraphError> {
    let (s, tokens, c) = (spec.images, spec.tokens(), g.shape(x).width());
    let mut projected = |name: &str, layer: &str, places: Vec<f64>| {
        let code = g.constant(&format!("{name}.code"), [s, c], time_codes(&places, c, config.base));
        let value = linear(g, &at.pp(layer), code, c)?;
        Ok::<_, GraphError>(g.name(value, name))
    };
    let videos = spec.times.iter().map(|t| f64::from(t.0)).collect();
    let videos = projected("backbone.time.video", "video_idx_embed.proj", videos)?;
    let frames = spec.times.iter().map(|t| f64::from(t.1)).collect();
    let frames = projected("backbone.time.frame", "local_time_idx_embed.proj", frames)?;
    let code = g.add_values(frames, videos)?;
    let rows = Piece { value: code, dims: vec![s, tokens, c], start: 0, strides: vec![c, 0, 1], at: vec![0, 0, 0] };
    let rows = g.assemble([s, tokens, c], &[rows])?;
    let rows = g.reshape(rows, [s * tokens, c])?;
    g.add_values(x, rows)
}
