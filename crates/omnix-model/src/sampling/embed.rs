//! A field as an embedding of its cells, merged into the features (`spec/omnix.md` 8.1, steps 1 to 4):
//!
//! `S = motion_proj [means | spreads over time]`, `A = max over time of motion_proj_mp field`, `U = merge [S | A]`,
//! `D = dynamic_mask_proj mask`, `G_k = feature_merge [feature_k | U | D]`.
//!
//! Nothing is put side by side that a layer can read apart: what U and D add to G is the same for the four features and is
//! computed once, half of the work of merging.

use omnix_graph::ops::Piece;
use omnix_graph::ops::{Binary, ReduceOp};
use omnix_graph::{Graph, GraphError, Value};

use super::spec::root;
use crate::config::{FieldKind, RIGID, TrajectoryConfig};
use crate::layers::{linear, linear_columns};

/// Embedded moments of all times would be the largest value of the head; this much of them exists at a time.
const MOMENTS: usize = 64 << 20;

/// The merged features `head.merged0` to `head.merged3` `[frames, L, C]`.
pub(super) fn merge(
    g: &mut Graph,
    config: &TrajectoryConfig,
    features: [Value; 4],
    field: Value,
    mask: Value,
) -> Result<[Value; 4], GraphError> {
    let shape = g.shape(features[0]).clone();
    let (frames, cells, c) = (shape[0], shape[1], shape[2]);
    let field = match config.field {
        FieldKind::Rigid => field,
        FieldKind::Translation => {
            let channels = config.field.channels();
            g.slice(field, 4, RIGID - channels, channels)?
        }
    };
    let motion = motion(g, config, field, c)?;
    let mask = g.reshape(mask, [frames, cells, 1])?;
    let chosen = linear(g, &root().pp("dynamic_mask_proj"), mask, c)?;
    g.name(chosen, "head.mask_embedding");

    let (at, full) = (root().pp("feature_merge"), [c, 3 * c]);
    let of_mask = linear_columns(g, &at, chosen, full, 2 * c..3 * c, true)?;
    let of_motion = linear_columns(g, &at, motion, full, c..2 * c, false)?;
    let shared = g.add_values(of_motion, of_mask)?;
    let mut merged = features;
    for (k, feature) in merged.iter_mut().enumerate() {
        let own = linear_columns(g, &at, *feature, full, 0..c, false)?;
        let sum = g.add_values(own, shared)?;
        *feature = g.name(sum, &format!("head.merged{k}"));
    }
    Ok(merged)
}

/// U `[frames, L, C]`, `head.field_embedding`, of a field `[frames, M, T, L, channels]`.
fn motion(g: &mut Graph, config: &TrajectoryConfig, field: Value, c: usize) -> Result<Value, GraphError> {
    let statistics = statistics(g, field)?;
    let mut motion = linear(g, &root().pp("motion_proj"), statistics, c)?;
    g.name(motion, "head.statistics");
    if config.head.salient_max {
        let strongest = strongest(g, field, c)?;
        let (at, full) = (root().pp("motion_proj_mp_merge"), [c, 2 * c]);
        let of_strongest = linear_columns(g, &at, strongest, full, c..2 * c, true)?;
        let of_statistics = linear_columns(g, &at, motion, full, 0..c, false)?;
        motion = g.add_values(of_statistics, of_strongest)?;
    }
    Ok(g.name(motion, "head.field_embedding"))
}

/// Means of all levels, then spreads of all levels: `[frames, L, 2 M channels]`.
fn statistics(g: &mut Graph, field: Value) -> Result<Value, GraphError> {
    let shape = g.shape(field).clone();
    let (frames, levels, cells, channels) = (shape[0], shape[1], shape[3], shape[4]);
    let means = g.reduce(field, ReduceOp::Mean, 2)?;
    let spreads = g.reduce(field, ReduceOp::Std, 2)?;
    // Cells first: levels become channels.
    let piece = |value: Value, at: usize| Piece {
        value,
        dims: vec![frames, cells, levels, channels],
        start: 0,
        strides: vec![levels * cells * channels, channels, cells * channels, 1],
        at: vec![0, 0, at, 0],
    };
    let both = g.assemble([frames, cells, 2 * levels, channels], &[piece(means, 0), piece(spreads, levels)])?;
    g.reshape(both, [frames, cells, 2 * levels * channels])
}

/// A `[frames, L, C]`: each level through one layer shared by all, at every time; the largest over time.
fn strongest(g: &mut Graph, field: Value, c: usize) -> Result<Value, GraphError> {
    let shape = g.shape(field).clone();
    let (frames, levels, times, cells, channels) = (shape[0], shape[1], shape[2], shape[3], shape[4]);
    let (at, part) = (root().pp("motion_proj_mp"), c / levels);
    let together = (MOMENTS / (frames * cells * part * size_of::<f32>())).clamp(1, times);
    let mut parts = Vec::with_capacity(levels);
    for level in 0..levels {
        let mut largest: Option<Value> = None;
        for first in (0..times).step_by(together) {
            let count = together.min(times - first);
            let some = Piece {
                value: field,
                dims: vec![frames, count, cells, channels],
                start: (level * times + first) * cells * channels,
                strides: vec![levels * times * cells * channels, cells * channels, channels, 1],
                at: vec![0; 4],
            };
            let some = g.assemble([frames, count, cells, channels], &[some])?;
            let embedded = linear(g, &at, some, part)?;
            let most = g.reduce(embedded, ReduceOp::Max, 1)?;
            largest = Some(match largest {
                Some(before) => g.zip(Binary::Max, before, most)?,
                None => most,
            });
        }
        parts.extend(largest);
    }
    g.concat(&parts, 2)
}
