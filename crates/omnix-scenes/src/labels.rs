//! What is known about the pixels of a picture, from what their rays meet. f64 throughout.

use glam::DVec3;
use rayon::prelude::*;

use crate::cast::{Geometry, Hit, Ray};
use crate::view::View;

/// Of the way from a camera to a point, what is free where the point is seen: the rest is rounding.
const FREE: f64 = 1.0 - 1e-7;

/// What moves less than this, in parts of its distance, does not move.
const MOVES: f64 = 5e-4;

/// Whether what each pixel shows is elsewhere in any of the given states than in its own.
pub(crate) fn moves<'a, S>(hits: &[Option<Hit>], own: &Geometry, states: S) -> Vec<bool>
where
    S: IntoIterator<Item = &'a Geometry> + Clone + Sync,
{
    let pixel = |hit: &Option<Hit>| match hit {
        Some(hit) if hit.instance > 0 => {
            let point = own.point(hit);
            states.clone().into_iter().any(|state| state.point(hit).distance(point) > MOVES * hit.t)
        }
        // Instance 0 stands still.
        _ => false,
    };
    hits.par_iter().map(pixel).collect()
}

/// The hits of all pixels, row by row.
pub(crate) fn hits(view: &View, geometry: &Geometry) -> Vec<Option<Hit>> {
    let [width, height] = view.size;
    let cast = |index: usize| geometry.cast(&view.ray(View::pixel(index % width, index / width)), 0.0, f64::INFINITY);
    (0..width * height).into_par_iter().map(cast).collect()
}

/// Whether a camera sees the point of a hit, at another time than the hit's or at its own: it lies in the picture, nothing is before
/// it, and the side of the surface that was hit is towards the camera.
pub(crate) fn is_seen(view: &View, geometry: &Geometry, hit: &Hit, outside: bool) -> bool {
    let point = geometry.point(hit);
    let Some((at, _)) = view.project(point) else {
        return false;
    };
    let direction = point - view.centre;
    view.pixel_of(at).is_some()
        && (geometry.face_normal(hit).dot(direction) < 0.0) == outside
        && !geometry.blocked(&Ray { origin: view.centre, direction }, 0.0, FREE)
}

/// Whether a view meets the outside of a hit's surface.
pub(crate) fn is_outside(view: &View, geometry: &Geometry, hit: &Hit) -> bool {
    geometry.face_normal(hit).dot(geometry.point(hit) - view.centre) < 0.0
}

/// Where the points of a picture's pixels are at the time of another state of the scene; nothing where there is only sky. Points of
/// what stands still are where they are.
pub(crate) fn points(hits: &[Option<Hit>], geometry: &Geometry) -> Vec<Option<DVec3>> {
    hits.par_iter().map(|hit| hit.as_ref().map(|hit| geometry.point(hit))).collect()
}

/// The unit normals of what the pixels show, on the side towards the camera and in its axes; NaN where there is only sky.
pub(crate) fn normals(view: &View, geometry: &Geometry, hits: &[Option<Hit>]) -> Vec<[f32; 3]> {
    let to_camera = view.rotation.inverse();
    let normal = |hit: &Option<Hit>| {
        let Some(hit) = hit else { return [f32::NAN; 3] };
        let side = if is_outside(view, geometry, hit) { 1.0 } else { -1.0 };
        (to_camera * (geometry.face_normal(hit) * side)).normalize_or_zero().as_vec3().to_array()
    };
    hits.par_iter().map(normal).collect()
}

/// How far, in pixels to the right and down, the points that the pixels of `view` show are in another picture, at the time of whose state
/// they are looked for; NaN where there is only sky and where a point is not in front of that camera. Points that are hidden there, or
/// beyond its edge, have their place all the same.
pub(crate) fn flow(view: &View, (later, then): (&View, &Geometry), hits: &[Option<Hit>]) -> Vec<[f32; 2]> {
    let width = view.size[0];
    let moved = |(pixel, hit): (usize, &Option<Hit>)| {
        let place = hit.as_ref().and_then(|hit| later.project(then.point(hit)));
        let from = View::pixel(pixel % width, pixel / width);
        place.map_or([f32::NAN; 2], |(to, _)| (to - from).as_vec2().to_array())
    };
    hits.par_iter().enumerate().map(moved).collect()
}
