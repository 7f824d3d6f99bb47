//! The dense heads: four features of a frame to depth, confidence and, when asked, rays and world points (DualDPT, `spec/da3.md`
//! section 6), or to depth and sky (DPT, section 7). The pyramid, the fusion chain and what leads to the picture's size serve the
//! sampling head of the trajectory module too ([`crate::sampling`]): other tensors, another last layer.
//!
//! Frames do not see each other. Maps are `[frame, row, column, channel]`. The ray branch shares nothing with the main one
//! behind the pyramid; when rays are not wanted none of it is recorded, and of its four output levels only the finest is.

mod fusion;
mod gaussians;
mod outputs;
mod points;
mod pyramid;
mod spec;
mod uv;

use omnix_graph::Graph;
use omnix_weights::Scope;

use crate::config::{HeadKind, NetworkConfig, PointsFrom};
use crate::{ModelError, PATCH};
pub use spec::{HeadOutputs, HeadSpec};

/// What all parts of a head need.
#[derive(Clone, Debug)]
pub(crate) struct Head {
    pub(crate) at: Scope,
    /// What its values' names begin with.
    pub(crate) label: &'static str,
    /// Whether features are normalised first.
    pub(crate) norm: bool,
    /// Whether places in the picture are coded into the maps.
    pub(crate) coded: bool,
    /// Channels of the fusion chain.
    pub(crate) features: usize,
    /// Channels of the four projections.
    pub(crate) channels: [usize; 4],
    /// Exponents are clamped to plus and minus this.
    pub(crate) clamp: Option<f32>,
    pub(crate) frames: usize,
    pub(crate) grid: (usize, usize),
}

impl Head {
    /// Height and width of the picture.
    fn picture(&self) -> [usize; 2] {
        [self.grid.0 * PATCH, self.grid.1 * PATCH]
    }

    /// Height and width of the finest fused map and of the rays.
    fn fine(&self) -> (usize, usize) {
        (8 * self.grid.0, 8 * self.grid.1)
    }
}

/// Records the head of a chunk of frames.
pub(crate) fn record(g: &mut Graph, config: &NetworkConfig, spec: &HeadSpec) -> Result<HeadOutputs, ModelError> {
    let HeadSpec { frames, grid, rays, points, gaussians } = *spec;
    let dense = &config.head;
    let dual = config.makes_cameras();
    let head = Head {
        at: config.at.pp("head"),
        label: "head",
        norm: dual,
        coded: dual,
        features: dense.features,
        channels: dense.channels,
        clamp: dense.logit_clamp,
        frames,
        grid,
    };
    let wide = config.backbone.feature_width();
    let features = std::array::from_fn(|k| g.input(&format!("feat.{k}"), [frames, grid.0 * grid.1, wide]));
    let levels = head.pyramid(g, features)?;
    let fused = head.fuse(g, levels, "")?;
    let HeadKind::Dual { aux_convs } = dense.kind else {
        let (depth, sky) = head.depth_and_sky(g, fused)?;
        return Ok(HeadOutputs { sky: Some(sky), ..HeadOutputs::of(features, depth) });
    };
    let (depth, confidence) = head.main(g, fused)?;
    let along_rays = points && config.points == PointsFrom::Rays;
    let ray_maps = if rays || along_rays {
        let fused = head.fuse(g, levels, "_aux")?;
        Some(head.rays(g, fused, aux_convs)?)
    } else {
        None
    };
    if let (true, Some((ray, confidence))) = (rays, ray_maps) {
        g.output(ray, "ray");
        g.output(confidence, "ray_conf");
    }
    let mut outputs = HeadOutputs {
        confidence: Some(confidence),
        rays: ray_maps.filter(|_| rays),
        ..HeadOutputs::of(features, depth)
    };
    if let Some(config) = config.gaussians.as_ref().filter(|_| gaussians) {
        outputs.gaussians = Some(head.gaussians(g, config, features)?);
    }
    if points {
        let along = match ray_maps.filter(|_| along_rays) {
            Some((ray, _)) => head.along_rays(g, ray)?,
            None => {
                let corners = g.input("camera_rays", [frames, 2, 2, 6]);
                outputs.camera_rays = Some(corners);
                head.along_corners(g, corners)?
            }
        };
        let points = head.points(g, along, depth)?;
        outputs.points = Some(points);
        if let Some(trajectory) = config.trajectory.as_ref().filter(|t| t.token_points) {
            outputs.point_tokens = Some(head.point_tokens(g, points, trajectory.width)?);
        }
    }
    Ok(outputs)
}
