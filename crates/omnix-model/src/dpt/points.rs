//! World points `origin + depth · direction`, and what tokens take from them (`spec/omnix.md` 4.4, 5.1).
//!
//! Along rays: the network's ray maps, resized with pixel areas on pixel areas. By the camera: rays of the four corner
//! pixels, which the host computes; direction is linear in the pixel, so bilinear interpolation between them is exact.

use omnix_graph::ops::{Binary, Corners, Filter};
use omnix_graph::{Graph, GraphError, Value};
use omnix_weights::Scope;

use super::Head;
use super::outputs::RAY;
use crate::PATCH;
use crate::layers::linear;

/// Coordinates of a point.
const XYZ: usize = 3;

/// Direction and origin of every pixel, `[frames, H, W, 3]` each.
pub(super) struct Along {
    direction: Value,
    origin: Value,
}

impl Head {
    /// Ray maps `[frames, 8gh, 8gw, 6]` at the picture's size.
    pub(super) fn along_rays(&self, g: &mut Graph, ray: Value) -> Result<Along, GraphError> {
        self.along(g, ray, Corners::HalfPixel)
    }

    /// Corner rays `[frames, 2, 2, 6]` over the whole picture.
    pub(super) fn along_corners(&self, g: &mut Graph, corners: Value) -> Result<Along, GraphError> {
        self.along(g, corners, Corners::Align)
    }

    fn along(&self, g: &mut Graph, rays: Value, corners: Corners) -> Result<Along, GraphError> {
        let [height, width] = self.picture();
        // Cut before they grow: the maps are a third of the picture at most.
        let mut part = |start: usize| {
            let half = g.slice(rays, 3, start, XYZ)?;
            g.resize(half, height, width, Filter::Bilinear, corners)
        };
        Ok(Along { direction: part(0)?, origin: part(RAY - XYZ)? })
    }

    /// The output `points` `[frames, H, W, 3]`.
    pub(super) fn points(&self, g: &mut Graph, along: Along, depth: Value) -> Result<Value, GraphError> {
        let reach = g.zip_rows(Binary::Mul, along.direction, depth)?;
        let points = g.add_values(reach, along.origin)?;
        g.output(points, "points");
        Ok(points)
    }

    /// The output `traj.point_tokens` `[frames, P, d]`: the points of each patch, row by row, through one layer. They are constants to
    /// its gradient (`spec/omnix.md` 5.1).
    pub(super) fn point_tokens(&self, g: &mut Graph, points: Value, d: usize) -> Result<Value, GraphError> {
        let (frames, (rows, columns)) = (self.frames, self.grid);
        let points = g.detach(points);
        let split = g.reshape(points, [frames * rows, PATCH, columns, PATCH * XYZ])?;
        let cells = g.permute(split, &[0, 2, 1, 3])?;
        let cells = g.reshape(cells, [frames, rows * columns, PATCH * PATCH * XYZ])?;
        let tokens = linear(g, &Scope::root().pp("st_mod.pts3d_proj"), cells, d)?;
        g.output(tokens, "traj.point_tokens");
        Ok(tokens)
    }
}
