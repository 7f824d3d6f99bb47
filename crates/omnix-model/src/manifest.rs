//! Every tensor a network's checkpoint should hold, with its shape (`spec/da3.md` section 12, `spec/omnix.md` 1.3).
//!
//! Required is what the parts asked for read; the rest of the network is optional: checked when there. Levels 0 to 2 of
//! the ray branch's outputs are in every published file and are never read. The layer norm that the four levels
//! share is read under level 0's name, the only one published files hold; files that hold all four have copies.

mod list;
mod trajectory;

use omnix_geometry::GAUSSIAN_NUMBERS;
use omnix_weights::{Manifest, Requirement, Scope};

use crate::PATCH;
use crate::config::{
    BackboneConfig, CameraEncoderConfig, FeedForward, GaussianConfig, HeadConfig, HeadKind, NetworkConfig, PointsFrom,
};
use list::{List, fusion, main_branch, when};

/// What will be asked of the network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    /// Ray maps.
    pub rays: bool,
    /// Cameras that the caller gives.
    pub given_cameras: bool,
    /// Trajectories.
    pub motion: bool,
    /// Gaussians.
    pub gaussians: bool,
}

/// The tensors of the network `config`, by logical name.
#[must_use]
pub fn manifest(config: &NetworkConfig, parts: &Parts) -> Manifest {
    let mut list = List { manifest: Manifest::new(), requirement: Requirement::Required };
    for network in [config].into_iter().chain(config.metric.as_deref()) {
        list.requirement = Requirement::Required;
        backbone(&mut list, &network.at, &network.backbone);
        // Points follow the rays, and trajectories start at points.
        let rays = parts.rays || parts.motion && network.points == PointsFrom::Rays;
        dense_head(&mut list, &network.at, &network.head, network.backbone.feature_width(), rays);
    }
    let wide = config.backbone.feature_width();
    list.requirement = Requirement::Required;
    if config.makes_cameras() {
        camera_decoder(&mut list, wide);
    }
    if let Some(trajectory) = &config.trajectory {
        list.requirement = when(parts.motion);
        trajectory::module(&mut list, trajectory, wide);
        trajectory::sampling_head(&mut list, trajectory, wide);
    }
    if let Some(encoder) = &config.camera_encoder {
        list.requirement = when(parts.given_cameras);
        camera_encoder(&mut list, encoder, config.backbone.width);
    }
    if let Some(gaussians) = &config.gaussians {
        list.requirement = when(parts.gaussians);
        gaussian_head(&mut list, gaussians, wide);
    }
    let mut manifest = list.manifest;
    for level in 1..4 {
        manifest.ignore(format!("head.scratch.output_conv2_aux.{level}.2."));
    }
    manifest
}

fn backbone(list: &mut List, at: &Scope, config: &BackboneConfig) {
    let BackboneConfig { width: c, position_grid: grid, .. } = *config;
    let at = at.pp("backbone.pretrained");
    list.add(at.name("cls_token"), &[1, 1, c]);
    if config.alternate_from.is_some() {
        list.add(at.name("camera_token"), &[1, 2, c]);
    }
    list.add(at.name("pos_embed"), &[1, 1 + grid * grid, c]);
    list.layer(&at.pp("patch_embed.proj"), &[c, 3, PATCH, PATCH]);
    for i in 0..config.blocks {
        let block = at.pp("blocks").pp(i);
        transformer_block(list, &block, c, config.ffn);
        if config.qk_norm_from.is_some_and(|from| i >= from) {
            list.layer(&block.pp("attn.q_norm"), &[config.head_dim()]);
            list.layer(&block.pp("attn.k_norm"), &[config.head_dim()]);
        }
    }
    list.layer(&at.pp("norm"), &[c]);
    if config.time.is_some() {
        list.layer(&at.pp("video_idx_embed.proj"), &[c, c]);
        list.layer(&at.pp("local_time_idx_embed.proj"), &[c, c]);
    }
}

fn transformer_block(list: &mut List, at: &Scope, c: usize, ffn: FeedForward) {
    list.layer(&at.pp("norm1"), &[c]);
    list.layer(&at.pp("attn.qkv"), &[3 * c, c]);
    list.layer(&at.pp("attn.proj"), &[c, c]);
    list.add(at.name("ls1.gamma"), &[c]);
    list.layer(&at.pp("norm2"), &[c]);
    let (into, out, hidden, columns) = match ffn {
        FeedForward::Mlp { hidden } => ("mlp.fc1", "mlp.fc2", hidden, hidden),
        FeedForward::SwiGlu { hidden } => ("mlp.w12", "mlp.w3", hidden, 2 * hidden),
    };
    list.layer(&at.pp(into), &[columns, c]);
    list.layer(&at.pp(out), &[c, hidden]);
    list.add(at.name("ls2.gamma"), &[c]);
}

fn dense_head(list: &mut List, at: &Scope, config: &HeadConfig, wide: usize, rays: bool) {
    let HeadConfig { kind, features: f, channels, .. } = *config;
    let head = at.pp("head");
    let at = head.pp("scratch");
    let HeadKind::Dual { aux_convs } = kind else {
        main_branch(list, &head, wide, f, channels, [32, 1]);
        list.layer(&at.pp("sky_output_conv2.0"), &[32, f / 2, 3, 3]);
        list.layer(&at.pp("sky_output_conv2.2"), &[1, 32, 1, 1]);
        return;
    };
    list.layer(&head.pp("norm"), &[wide]);
    main_branch(list, &head, wide, f, channels, [32, 2]);

    list.requirement = when(rays);
    fusion(list, &at, "_aux", f);
    list.layer(&at.pp("output_conv2_aux.0.2"), &[32]);
    for level in 0..4 {
        list.requirement = when(rays && level == 3);
        for i in 0..aux_convs {
            let shape = if i % 2 == 0 { [f / 2, f, 3, 3] } else { [f, f / 2, 3, 3] };
            list.layer(&at.pp("output_conv1_aux").pp(level).pp(i), &shape);
        }
        list.layer(&at.pp("output_conv2_aux").pp(level).pp(0), &[32, f / 2, 3, 3]);
        list.layer(&at.pp("output_conv2_aux").pp(level).pp(5), &[7, 32, 1, 1]);
    }
}

fn gaussian_head(list: &mut List, config: &GaussianConfig, wide: usize) {
    let (GaussianConfig { features: f, channels }, at) = (*config, Scope::root().pp("gs_head"));
    main_branch(list, &at, wide, f, channels, [32, GAUSSIAN_NUMBERS]);
    for (layer, [into, out]) in [[3, f / 8], [f / 8, f / 4], [f / 4, f / 2]].into_iter().enumerate() {
        list.layer(&at.pp("images_merger").pp(2 * layer), &[out, into, 3, 3]);
    }
}

fn camera_decoder(list: &mut List, wide: usize) {
    let at = Scope::root().pp("cam_dec");
    list.layer(&at.pp("backbone.0"), &[wide, wide]);
    list.layer(&at.pp("backbone.2"), &[wide, wide]);
    list.layer(&at.pp("fc_t"), &[3, wide]);
    list.layer(&at.pp("fc_qvec"), &[4, wide]);
    list.layer(&at.pp("fc_fov.0"), &[2, wide]);
}

fn camera_encoder(list: &mut List, config: &CameraEncoderConfig, c: usize) {
    let at = Scope::root().pp("cam_enc");
    list.layer(&at.pp("pose_branch.fc1"), &[c / 2, 9]);
    list.layer(&at.pp("pose_branch.fc2"), &[c, c / 2]);
    list.layer(&at.pp("token_norm"), &[c]);
    for i in 0..config.blocks {
        transformer_block(list, &at.pp("trunk").pp(i), c, FeedForward::Mlp { hidden: config.mlp_ratio * c });
    }
    list.layer(&at.pp("trunk_norm"), &[c]);
}
