//! The dense head (DualDPT, `spec/da3.md` section 6): four features of a frame to depth, confidence and, when asked, rays.
//!
//! Frames do not see each other. Maps are `[frame, row, column, channel]`. The ray branch shares nothing with the main one
//! behind the pyramid; when rays are not wanted none of it is recorded, and of its four output levels only the finest is.

mod fusion;
mod outputs;
mod pyramid;
mod spec;
mod uv;

use omnix_graph::Graph;
use omnix_weights::Scope;

use crate::config::{HeadConfig, NetworkConfig};
use crate::{ModelError, PATCH};
pub use spec::{HeadOutputs, HeadSpec};

/// What all parts of the head need.
#[derive(Clone, Debug)]
struct Head<'a> {
    config: &'a HeadConfig,
    at: Scope,
    frames: usize,
    grid: (usize, usize),
}

impl Head<'_> {
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
    let HeadSpec { frames, grid, rays } = *spec;
    let head = Head { config: &config.head, at: Scope::root().pp("head"), frames, grid };
    let wide = config.backbone.feature_width();
    let features = std::array::from_fn(|k| g.input(&format!("feat.{k}"), [frames, grid.0 * grid.1, wide]));
    let levels = head.pyramid(g, features)?;
    let fused = head.fuse(g, levels, "")?;
    let (depth, confidence) = head.main(g, fused)?;
    let rays = if rays {
        let fused = head.fuse(g, levels, "_aux")?;
        Some(head.rays(g, fused)?)
    } else {
        None
    };
    Ok(HeadOutputs { features, depth, confidence, rays })
}
