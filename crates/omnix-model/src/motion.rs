//! The spatiotemporal module (`spec/omnix.md` sections 5 to 7): features of all images to a sparse field of motion.
//!
//! One graph over the whole collection. Tokens F `[T, L, d]` are made once; the K of each image that are likeliest to move
//! are followed to every target time. Their stream is `z [target time, source image, token, d]`: target time first, so that
//! queries that see one image alone are neighbours and nothing is ever turned round until the finished field is written
//! source first, as pixels read it. The goldens' `traj.z0` and so on have source and target the other way.
//!
//! Memory: z is the largest value, T·T·K·d, and exists twice. Queries of a block, their feed-forward rows and the field's
//! hidden rows go in chunks of whole target times ([`MotionSpec::parts`]); keys and values of a block depend on F alone.

mod block;
mod field;
mod spec;
mod tokens;

use omnix_graph::Graph;

use spec::LeaveOut;
pub use spec::{DRAW, Dropout, FORCED, MotionOutputs, MotionSpec};

use crate::ModelError;
use crate::config::{SampledScore, TrajectoryConfig};

/// Records everything up to the field; with `dropout` as in training.
pub(crate) fn record(
    g: &mut Graph,
    config: &TrajectoryConfig,
    wide: usize,
    spec: &MotionSpec,
    dropout: Option<Dropout>,
) -> Result<MotionOutputs, ModelError> {
    let made = tokens::record(g, config, wide, spec)?;
    let leave_out = dropout.map(|dropout| LeaveOut::new(g, dropout));
    let score = tokens::score(g, config, spec, made.tokens, leave_out)?;
    let chosen = tokens::choose(g, config, spec, score)?;
    let codes = tokens::codes(g, config, spec)?;
    let mut z = tokens::expand(g, config, spec, (made.tokens, &chosen), codes, leave_out)?;
    let memory = block::Memory::new(g, config, spec, made.tokens, &chosen)?;
    let mut levels = Vec::with_capacity(config.levels());
    for i in 0..config.blocks {
        z = block::record(g, config, spec, i, &memory, z)?;
        g.name(z, &format!("traj.z{}", i + 1));
        if config.field_blocks.contains(&i) {
            levels.push(field::level(g, config, levels.len(), z)?);
        }
    }
    let field = field::record(g, config, spec, &levels, chosen.places)?;
    let mask = match config.sampled_score {
        SampledScore::Mask => chosen.mask,
        // Another name for the same numbers.
        SampledScore::Score => g.reshape(score, [spec.images, spec.patches()])?,
    };
    g.output(field, "field");
    g.output(mask, "mask");
    g.output(score, "traj.score");
    Ok(MotionOutputs { features: made.features, point_tokens: made.point_tokens, field, mask, score })
}
