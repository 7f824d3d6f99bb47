//! Which side of its surface a track lies on, as far as images tell that see it.
//!
//! A sheet without thickness hides a point on its front from what looks at its back, although the point lies where the image shows
//! the sheet. An image that sees the point tells which way the surface looks there: it looks towards that image's camera.

use glam::DVec3;

use super::grid::{At, at};
use crate::rigid::Pinhole;
use crate::{Flag, Sample, Tracks};

/// Places nearer to each other than this share of their distance from the camera are one.
const SAME: f64 = 1e-5;

/// Where a track is seen, and which way its surface looks there.
pub(super) struct Fronts(Vec<(DVec3, DVec3)>);

impl Fronts {
    /// Of a track, from all images that see it.
    pub(super) fn of(sample: &Sample, cameras: &[Pinhole], tracks: &Tracks, track: usize) -> Self {
        let front = |image: usize| {
            let index = image * tracks.count + track;
            let place = DVec3::from(tracks.positions[index].map(f64::from));
            let seen = tracks.visible[index] == Flag::Yes && place.is_finite();
            seen.then(|| Some((place, normal(sample, &cameras[image], image, place)?))).flatten()
        };
        Self((0..sample.count()).filter_map(front).collect())
    }

    /// Whether a camera at `from` looks at the front of the surface at this place; nothing where no image sees the point there.
    pub(super) fn shows(&self, place: DVec3, from: DVec3) -> Option<bool> {
        let near = SAME * place.distance(from);
        let mut there = self.0.iter().filter(|(seen, _)| seen.distance(place) <= near).peekable();
        there.peek()?;
        Some(there.any(|(_, normal)| normal.dot(from - place) > 0.0))
    }
}

/// The normal, towards the camera, of the surface that an image shows at a place: of the four pixels about it.
fn normal(sample: &Sample, camera: &Pinhole, image: usize, place: DVec3) -> Option<DVec3> {
    let size = sample.size().map(|side| side as usize);
    let [u, v] = camera.project(camera.w2c.apply(place));
    let depth = sample.depth(image)?;
    let At::Inverse(_) = at(depth, size, [u, v]) else {
        return None;
    };
    let low = |x: f64, side: usize| ((x - crate::PIXEL.offset()).max(0.0) as usize).min(side.saturating_sub(2));
    let (left, top) = (low(u, size[0]), low(v, size[1]));
    let pixel = top * size[0] + left;
    let point = |pixel: usize| {
        let [u, v] = crate::rigid::centre(pixel, size[0]);
        camera.unproject(u, v, f64::from(depth[pixel]))
    };
    let here = point(pixel);
    // x right and y down make z forward: away from the camera.
    let away = (point(pixel + 1) - here).cross(point(pixel + size[0]) - here);
    Some(camera.w2c.inverse().rotation * -away)
}
