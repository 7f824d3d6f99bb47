//! Whether the numbers of the trajectory module go together, and with the encoder's.

use super::super::need::{Need, WIDEST, heads_fit};
use super::{MotionGate, SamplingConfig, TrajectoryConfig};
use crate::ModelError;

/// No published network comes near; larger numbers are slips of the pen.
const DEEPEST: usize = 1 << 8;
const MOST_POINTS: usize = 64;

/// Checks `config` beside features of `wide` channels.
pub(in crate::config) fn check(config: &TrajectoryConfig, wide: usize, need: Need<'_>) -> Result<(), ModelError> {
    let TrajectoryConfig { width, heads, blocks, mlp_ratio, .. } = *config;
    let allowed = |text: &str| text.to_owned();
    need((1..=WIDEST).contains(&width), "trajectory.width", &width, format!("it can be 1 to {WIDEST}"))?;
    need((1..=DEEPEST).contains(&blocks), "trajectory.blocks", &blocks, format!("it can be 1 to {DEEPEST}"))?;
    heads_fit(need, "trajectory.heads", width, heads, config.rope_base.is_some())?;
    let hidden = width.checked_mul(mlp_ratio).is_some_and(|hidden| (1..=WIDEST).contains(&hidden));
    need(hidden, "trajectory.mlp_ratio", &mlp_ratio, format!("times width it can be 1 to {WIDEST}"))?;
    for (label, base) in [("trajectory.rope_base", config.rope_base), ("trajectory.time_base", Some(config.time_base))]
    {
        let fits = base.is_none_or(|base| base > 1.0 && base.is_finite());
        need(fits, label, &base, allowed("a number above 1 is needed"))?;
    }
    for (label, small) in
        [("trajectory.norm_eps", config.norm_eps), ("trajectory.rotation_min_norm", config.rotation_min_norm)]
    {
        need(small > 0.0 && small < 1.0, label, &small, allowed("a number between 0 and 1 is needed"))?;
    }
    let share = config.top_fraction;
    need(share > 0.0 && share <= 1.0, "trajectory.top_fraction", &share, allowed("above 0 and at most 1 is needed"))?;
    if let MotionGate::Hard { infer, train } = config.gate {
        for (label, value) in [("trajectory.motion_gate.infer", infer), ("trajectory.motion_gate.train", train)] {
            need((0.0..=1.0).contains(&value), label, &value, allowed("it can be 0 to 1"))?;
        }
    }
    let rest = &config.field_rest;
    need(rest.iter().all(|v| v.is_finite()), "trajectory.field_rest", rest, allowed("finite numbers are needed"))?;
    lists(config, need)?;
    sampling(&config.head, config.levels(), wide, need)
}

/// Numbers of blocks: rising, and of blocks there are.
fn lists(config: &TrajectoryConfig, need: Need<'_>) -> Result<(), ModelError> {
    let blocks = config.blocks;
    for (label, list) in [
        ("trajectory.same_time_blocks", &config.same_time_blocks),
        ("trajectory.field_blocks", &config.field_blocks),
        ("trajectory.temporal_blocks", &config.temporal_blocks),
        ("trajectory.spatial_blocks", &config.spatial_blocks),
        ("trajectory.no_cross_blocks", &config.no_cross_blocks),
    ] {
        let fits = list.is_sorted_by(|a, b| a < b) && list.last().is_none_or(|last| *last < blocks);
        need(fits, label, list, format!("rising numbers of the {blocks} blocks are needed"))?;
    }
    let fields = &config.field_blocks;
    need(!fields.is_empty(), "trajectory.field_blocks", fields, "at least one block is needed".to_owned())
}

fn sampling(config: &SamplingConfig, levels: usize, wide: usize, need: Need<'_>) -> Result<(), ModelError> {
    let SamplingConfig { features, channels, hidden, points, logit_clamp, salient_max } = *config;
    let features_fit = (8..=WIDEST).contains(&features) && features.is_multiple_of(8);
    need(features_fit, "trajectory.head.features", &features, "a multiple of 8 is needed".to_owned())?;
    let fit = |c: &usize| (4..=WIDEST).contains(c) && c.is_multiple_of(4);
    need(channels.iter().all(fit), "trajectory.head.channels", &channels, "multiples of 4 are needed".to_owned())?;
    need((1..=WIDEST).contains(&hidden), "trajectory.head.hidden", &hidden, format!("it can be 1 to {WIDEST}"))?;
    need((1..=MOST_POINTS).contains(&points), "trajectory.head.points", &points, {
        format!("it can be 1 to {MOST_POINTS}")
    })?;
    let clamp_fits = logit_clamp.is_none_or(|clamp| clamp > 0.0 && clamp.is_finite());
    need(clamp_fits, "trajectory.head.logit_clamp", &logit_clamp, {
        "a number above 0, or null for none, is needed".to_owned()
    })?;
    need(!salient_max || wide.is_multiple_of(levels), "trajectory.field_blocks", &levels, {
        format!("their number must divide the features' {wide} channels")
    })
}
