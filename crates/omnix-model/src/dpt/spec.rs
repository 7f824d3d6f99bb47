//! What the head is asked for, and what it gives.

use omnix_graph::Value;

/// What the head is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeadSpec {
    /// Frames of this chunk.
    pub frames: usize,
    /// Patch rows and columns.
    pub grid: (usize, usize),
    /// Whether ray maps are wanted; they double the work.
    pub rays: bool,
    /// Whether world points and what tokens take from them are wanted (OmniX): for trajectories. They follow the rays, or
    /// the camera where the configuration says so.
    pub points: bool,
    /// Whether Gaussians are wanted; they take about as much work as depth.
    pub gaussians: bool,
}

/// The outputs of a recorded head; all are declared as outputs of the graph.
#[derive(Clone, Debug)]
pub struct HeadOutputs {
    /// The inputs `feat.0` to `feat.3`: `[frames, P, 2C]`, or `[frames, P, C]` where views do not see each other.
    pub features: [Value; 4],
    /// `depth`: `[frames, H, W]`, along the camera's axis.
    pub depth: Value,
    /// `depth_conf`: `[frames, H, W]`, at least 1; none of a head that makes sky.
    pub confidence: Option<Value>,
    /// `sky`: `[frames, H, W]`, at least 0; from 0.3 on a pixel's depth says nothing ([`omnix_geometry::fill_sky`]).
    pub sky: Option<Value>,
    /// `ray`: `[frames, 8gh, 8gw, 6]`, direction then origin; `ray_conf`: `[frames, 8gh, 8gw]`.
    pub rays: Option<(Value, Value)>,
    /// The input `camera_rays` `[frames, 2, 2, 6]` where points follow the camera: direction and origin at the four
    /// corners of the picture ([`omnix_geometry::corner_rays`]).
    pub camera_rays: Option<Value>,
    /// `points`: `[frames, H, W, 3]` in the world.
    pub points: Option<Value>,
    /// `traj.point_tokens`: `[frames, P, d]`, where tokens take points.
    pub point_tokens: Option<Value>,
    /// The input `pictures` `[frames, 3, H, W]`, as the backbone's, and `gaussians` `[frames, H, W, 38]`: the numbers of each pixel
    /// ([`omnix_geometry::GaussianMaps`]).
    pub gaussians: Option<(Value, Value)>,
}

impl HeadOutputs {
    /// Depth alone.
    pub(super) const fn of(features: [Value; 4], depth: Value) -> Self {
        Self {
            features,
            depth,
            confidence: None,
            sky: None,
            rays: None,
            camera_rays: None,
            points: None,
            point_tokens: None,
            gaussians: None,
        }
    }
}
