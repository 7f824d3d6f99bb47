//! The sampling head (`spec/omnix.md` 8.1): where each pixel of an image reads the field, how much of it, how sure it is.
//!
//! Images do not see each other: a graph over a few of them, as the dense head. The field of an image becomes an embedding of
//! its cells ([`embed`]), which is merged into the four features; the pyramid, fusion chain and neck are those of the dense
//! head with other tensors. The three last layers are rows of one matrix: their results are wanted apart, and apart they
//! need no copy.

mod embed;
mod spec;

use omnix_graph::{Graph, Value};

pub use spec::{SamplingOutputs, SamplingSpec};

use crate::ModelError;
use crate::config::{RIGID, TrajectoryConfig};
use crate::dpt::Head;
use crate::layers::linear_rows;
use spec::root;

/// Records the head of a chunk of images.
pub(crate) fn record(
    g: &mut Graph,
    config: &TrajectoryConfig,
    wide: usize,
    spec: &SamplingSpec,
) -> Result<SamplingOutputs, ModelError> {
    let SamplingSpec { frames, times, grid } = *spec;
    let cells = grid.0 * grid.1;
    let features: [Value; 4] = std::array::from_fn(|k| g.input(&format!("feat.{k}"), [frames, cells, wide]));
    let field = g.input("field", [frames, config.levels(), times, cells, RIGID]);
    let mask = g.input("mask", [frames, cells]);
    let merged = embed::merge(g, config, features, field, mask)?;

    let sampling = &config.head;
    let head = Head {
        at: root(),
        label: "head",
        norm: true,
        coded: true,
        features: sampling.features,
        channels: sampling.channels,
        clamp: sampling.logit_clamp,
        frames,
        grid,
    };
    let levels = head.pyramid(g, merged)?;
    let fused = head.fuse(g, levels, "")?;
    let x = head.at_picture_size(g, fused, sampling.hidden)?;
    let points = config.samples();
    let at = root().pp("scratch.output_conv2.2");
    let full = [3 * points + 1, sampling.hidden, 1, 1];
    let offsets = linear_rows(g, &at, x, full[0], 0..2 * points, &full)?;
    g.output(offsets, "offsets");
    let weights = linear_rows(g, &at, x, full[0], 2 * points..3 * points, &full)?;
    let weights = g.softmax(weights);
    g.output(weights, "weights");
    let confidence = linear_rows(g, &at, x, full[0], 3 * points..full[0], &full)?;
    let confidence = head.confidence(g, confidence, 0)?;
    g.output(confidence, "traj_conf");
    Ok(SamplingOutputs { features, field, mask, offsets, weights, confidence })
}
