//! The tensors of the trajectory module (`spec/omnix.md` 1.3; of the ablation switches: section 9).

use omnix_weights::Scope;

use super::list::{List, main_branch};
use crate::PATCH;
use crate::config::{SamplingConfig, TimeGain, TokenFeatures, TrajectoryConfig};

/// `st_mod.`: tokens, score, codes, blocks, field.
pub(super) fn module(list: &mut List, config: &TrajectoryConfig, wide: usize) {
    let (d, at) = (config.width, Scope::root().pp("st_mod"));
    let features = match config.token_features {
        TokenFeatures::All => 4,
        TokenFeatures::Last => 1,
    };
    list.layer(&at.pp("feature_proj"), &[d, features * wide]);
    if config.token_points {
        list.layer(&at.pp("pts3d_proj"), &[d, PATCH * PATCH * 3]);
    }
    let [first, second] = config.scalar_widths();
    list.layer(&at.pp("dynamic_pred.0"), &[first, d, 1, 1]);
    list.layer(&at.pp("dynamic_pred.3"), &[second, first, 1, 1]);
    list.layer(&at.pp("dynamic_pred_last_layer"), &[1, second, 1, 1]);
    list.layer(&at.pp("video_idx_embed.proj"), &[d, d]);
    list.layer(&at.pp("local_time_idx_embed.proj"), &[d, d]);
    match config.time_gain {
        TimeGain::None => {}
        TimeGain::PerToken => {
            let gain = at.pp("time_embed_scaling_mlp");
            list.layer(&gain.pp(0), &[first, d]);
            list.layer(&gain.pp(3), &[second, first]);
            list.layer(&gain.pp(6), &[1, second]);
        }
        TimeGain::AdaLn | TimeGain::TokenAdaLn => {
            list.layer(&at.pp("sp_adaln.t_proj.1"), &[2 * d, d]);
            if config.time_gain == TimeGain::TokenAdaLn {
                list.layer(&at.pp("sp_adaln.dy_proj.1"), &[2, d]);
            }
        }
    }
    for i in 0..config.blocks {
        block(list, config, i, &at.pp("blocks").pp(i));
    }
    for level in 0..config.levels() {
        let layers = at.pp("motion_proj_list").pp(level);
        list.layer(&layers.pp(0), &[d / 2, d]);
        list.layer(&layers.pp(2), &[config.field.channels(), d / 2]);
    }
}

fn block(list: &mut List, config: &TrajectoryConfig, i: usize, at: &Scope) {
    let d = config.width;
    for (on, attention, suffix) in [
        (config.temporal_blocks.contains(&i), "attn_temporal", "tem"),
        (config.spatial_blocks.contains(&i), "attn_spatial", "sp"),
    ] {
        if on {
            list.layer(&at.pp(format_args!("norm1_{suffix}")), &[d]);
            list.layer(&at.pp(attention).pp("qkv"), &[3 * d, d]);
            attention_rest(list, config, &at.pp(attention));
            scale(list, config, &at.pp(format_args!("ls1_{suffix}")));
        }
    }
    if !config.no_cross_blocks.contains(&i) {
        list.layer(&at.pp("norm2"), &[d]);
        list.layer(&at.pp("attn_cross.q"), &[d, d]);
        list.layer(&at.pp("attn_cross.kv"), &[2 * d, d]);
        attention_rest(list, config, &at.pp("attn_cross"));
        scale(list, config, &at.pp("ls2"));
    }
    list.layer(&at.pp("norm3"), &[d]);
    list.layer(&at.pp("mlp.fc1"), &[config.mlp_ratio * d, d]);
    list.layer(&at.pp("mlp.fc2"), &[d, config.mlp_ratio * d]);
    scale(list, config, &at.pp("ls3"));
}

/// What every attention has behind its queries, keys and values.
fn attention_rest(list: &mut List, config: &TrajectoryConfig, at: &Scope) {
    if config.qk_norm {
        list.layer(&at.pp("q_norm"), &[config.head_dim()]);
        list.layer(&at.pp("k_norm"), &[config.head_dim()]);
    }
    list.layer(&at.pp("proj"), &[config.width, config.width]);
}

fn scale(list: &mut List, config: &TrajectoryConfig, at: &Scope) {
    if config.layer_scale {
        list.add(at.name("gamma"), &[config.width]);
    }
}

/// `offset_head.`: the field's embedding and the head behind it.
pub(super) fn sampling_head(list: &mut List, config: &TrajectoryConfig, wide: usize) {
    let SamplingConfig { features, channels, hidden, salient_max, .. } = config.head;
    let (at, levels, numbers) = (Scope::root().pp("offset_head"), config.levels(), config.field.channels());
    list.layer(&at.pp("norm"), &[wide]);
    main_branch(list, &at, wide, features, channels, [hidden, 3 * config.samples() + 1]);
    list.layer(&at.pp("motion_proj"), &[wide, 2 * levels * numbers]);
    if salient_max {
        list.layer(&at.pp("motion_proj_mp"), &[wide / levels, numbers]);
        list.layer(&at.pp("motion_proj_mp_merge"), &[wide, 2 * wide]);
    }
    list.layer(&at.pp("dynamic_mask_proj"), &[wide, 1]);
    list.layer(&at.pp("feature_merge"), &[wide, 3 * wide]);
}
