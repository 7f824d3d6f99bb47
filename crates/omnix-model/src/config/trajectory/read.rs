//! `trajectory` of an `omnix-1` configuration.

use super::super::fields::Fields;
use super::{FieldKind, MotionGate, Rounding, SampledScore, SamplingConfig, TimeGain, TokenFeatures, TrajectoryConfig};
use crate::ModelError;

const FIELDS: [&str; 29] = [
    "width",
    "heads",
    "blocks",
    "mlp_ratio",
    "qk_norm",
    "rope_base",
    "layer_scale",
    "norm_eps",
    "token_features",
    "token_points",
    "time_base",
    "time_gain",
    "top_fraction",
    "top_rounding",
    "same_time_blocks",
    "field_blocks",
    "field_rest",
    "rotation_min_norm",
    "relative_to_own_time",
    "sampled_score",
    "motion_gate",
    "head",
    "temporal_blocks",
    "spatial_blocks",
    "no_cross_blocks",
    "field",
    "fine_queries",
    "fixed_offsets",
    "neighbour_damping",
];
const HEAD_FIELDS: [&str; 7] =
    ["features", "channels", "points", "offset_levels", "hidden", "salient_max", "logit_clamp"];

/// Switches of the release's code that nothing public describes to the end, and what is missing.
const REFUSED: [(&str, &str); 3] = [
    (
        "fine_queries",
        "it can be false: a query grid twice as fine is described without its tensors' names, whether tokens are chosen \
         before or after it is refined, and the finer tokens' places in RoPE and in the field",
    ),
    ("fixed_offsets", "it can be false: the operator that samples at fixed 3 x 3 offsets was never released"),
    (
        "neighbour_damping",
        "it can be false: damping of the score by likeness to the 8 neighbours is described without its formula",
    ),
];

/// Reads the part and checks what concerns one field.
pub(in crate::config) fn read(part: &Fields<'_>) -> Result<TrajectoryConfig, ModelError> {
    part.only(&FIELDS)?;
    for (name, why) in REFUSED {
        if part.flag(name, false)? {
            return Err(part.bad(name, why));
        }
    }
    let config = TrajectoryConfig {
        width: part.whole("width")?,
        heads: part.whole("heads")?,
        blocks: part.whole("blocks")?,
        mlp_ratio: part.whole("mlp_ratio")?,
        qk_norm: part.truth("qk_norm")?,
        rope_base: part.get("rope_base").map(|_| part.number("rope_base")).transpose()?,
        layer_scale: part.truth("layer_scale")?,
        norm_eps: part.number("norm_eps")? as f32,
        token_features: [TokenFeatures::All, TokenFeatures::Last][part.one_of("token_features", &["all", "last"])?],
        token_points: part.truth("token_points")?,
        time_base: part.number("time_base")?,
        time_gain: [TimeGain::PerToken, TimeGain::None, TimeGain::AdaLn, TimeGain::TokenAdaLn]
            [part.one_of("time_gain", &["per_token", "none", "adaln", "token_adaln"])?],
        top_fraction: part.number("top_fraction")?,
        top_rounding: [Rounding::Floor, Rounding::Nearest, Rounding::Ceil]
            [part.one_of("top_rounding", &["floor", "nearest", "ceil"])?],
        same_time_blocks: part.wholes("same_time_blocks")?,
        field_blocks: part.wholes("field_blocks")?,
        field_rest: part.numbers("field_rest")?,
        field: match part.get("field") {
            None => FieldKind::Rigid,
            Some(_) => [FieldKind::Rigid, FieldKind::Translation][part.one_of("field", &["rigid", "translation"])?],
        },
        rotation_min_norm: part.number("rotation_min_norm")? as f32,
        relative_to_own_time: part.truth("relative_to_own_time")?,
        sampled_score: [SampledScore::Mask, SampledScore::Score][part.one_of("sampled_score", &["mask", "score"])?],
        gate: gate(&part.object("motion_gate")?)?,
        head: head(&part.object("head")?)?,
        temporal_blocks: part.wholes_or_none("temporal_blocks")?,
        spatial_blocks: part.wholes_or_none("spatial_blocks")?,
        no_cross_blocks: part.wholes_or_none("no_cross_blocks")?,
    };
    // Offsets are learnt for the levels there are.
    let head = part.object("head")?;
    if head.whole("offset_levels")? != config.levels() {
        return Err(head.bad("offset_levels", format!("it can be {}, one for each of field_blocks", config.levels())));
    }
    Ok(config)
}

fn gate(part: &Fields<'_>) -> Result<MotionGate, ModelError> {
    part.only(&["kind", "infer", "train"])?;
    if part.one_of("kind", &["hard", "blend"])? == 1 {
        return Ok(MotionGate::Blend);
    }
    Ok(MotionGate::Hard { infer: part.number("infer")? as f32, train: part.number("train")? as f32 })
}

fn head(part: &Fields<'_>) -> Result<SamplingConfig, ModelError> {
    part.only(&HEAD_FIELDS)?;
    Ok(SamplingConfig {
        features: part.whole("features")?,
        channels: part.four("channels")?,
        hidden: part.whole("hidden")?,
        points: part.whole("points")?,
        salient_max: part.truth("salient_max")?,
        logit_clamp: part.get("logit_clamp").map(|_| part.number("logit_clamp")).transpose()?.map(|v| v as f32),
    })
}
