//! From the stream to the field (`spec/omnix.md` section 7): a few numbers per token, time and level, put back on the grid.

use omnix_graph::ops::Piece;
use omnix_graph::{Graph, GraphError, Value};

use super::spec::{MotionSpec, root};
use crate::config::{FieldKind, RIGID, TrajectoryConfig};
use crate::layers::{linear, relu};

/// The 6D rotation of a field that only shifts: no turn.
const NO_TURN: [f32; 6] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// Level `l` read off the stream `z [T · T · K, d]`: `[T · T · K, channels]`.
pub(super) fn level(g: &mut Graph, config: &TrajectoryConfig, l: usize, z: Value) -> Result<Value, GraphError> {
    let at = root().pp("motion_proj_list").pp(l);
    let x = linear(g, &at.pp(0), z, config.width / 2)?;
    let x = relu(g, x);
    linear(g, &at.pp(2), x, config.field.channels())
}

/// `[T source, M, T target, L, 9]` of the levels' values and the chosen cells `places` (u32 `[T, K]`): all levels in one
/// pass, which also brings the source to the front.
pub(super) fn record(
    g: &mut Graph,
    config: &TrajectoryConfig,
    spec: &MotionSpec,
    levels: &[Value],
    places: Value,
) -> Result<Value, GraphError> {
    let (t, l, m, k) = (spec.images, spec.patches(), levels.len(), g.shape(places)[1]);
    let mut rest = config.field_rest;
    let values = match config.field {
        FieldKind::Rigid => g.concat(levels, 0)?,
        FieldKind::Translation => {
            rest[..NO_TURN.len()].copy_from_slice(&NO_TURN);
            unturned(g, levels)?
        }
    };
    let values = g.reshape(values, [m * t, t, k, RIGID])?;
    let rest = g.constant("field.rest", [RIGID], rest.to_vec());
    let field = g.field_scatter(values, places, rest, l)?;
    let field = g.reshape(field, [t, m, t, l, RIGID])?;
    for i in 0..m {
        let level = g.slice(field, 1, i, 1)?;
        let level = g.reshape(level, [t, t, l, RIGID])?;
        g.name(level, &format!("traj.field{i}"));
    }
    Ok(field)
}

/// Levels of three numbers `[rows, 3]` below each other, each row behind a rotation by nothing.
fn unturned(g: &mut Graph, levels: &[Value]) -> Result<Value, GraphError> {
    let (rows, channels) = (g.shape(levels[0]).rows(), g.shape(levels[0]).width());
    let turn = g.constant("field.turn", [NO_TURN.len()], NO_TURN.to_vec());
    let all = levels.len() * rows;
    let mut pieces =
        vec![Piece { value: turn, dims: vec![all, NO_TURN.len()], start: 0, strides: vec![0, 1], at: vec![0, 0] }];
    pieces.extend(levels.iter().enumerate().map(|(i, level)| Piece {
        value: *level,
        dims: vec![rows, channels],
        start: 0,
        strides: vec![channels, 1],
        at: vec![i * rows, NO_TURN.len()],
    }));
    g.assemble([all, RIGID], &pieces)
}
