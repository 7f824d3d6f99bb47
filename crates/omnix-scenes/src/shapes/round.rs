//! Round shapes: surfaces of revolution, tubes along a path, superquadrics, rocks. Smooth but where a profile has a point twice.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use crate::mesh::Mesh;
use crate::noise::fractal;

/// A profile of (radius, z) turned about the z axis, from below to above for an outside away from the axis. A point that is
/// listed twice is a hard edge; a radius of 0 is a pole.
pub(crate) fn lathe(profile: &[DVec2], around: usize) -> Mesh {
    let mut mesh = Mesh::default();
    let ring = |mesh: &mut Mesh, p: DVec2| -> Vec<u32> {
        let steps = if p.x == 0.0 { 1 } else { around };
        let at = |k: usize| {
            let (sin, cos) = (k as f64 / around as f64 * TAU).sin_cos();
            DVec3::new(p.x * cos, p.x * sin, p.y)
        };
        (0..steps).map(|k| mesh.vertex(at(k))).collect()
    };
    let Some(&first) = profile.first() else {
        return mesh;
    };
    let mut below = ring(&mut mesh, first);
    for pair in profile.windows(2) {
        let above = ring(&mut mesh, pair[1]);
        if pair[0] != pair[1] {
            for k in 0..around {
                let next = (k + 1) % around;
                match (below.len(), above.len()) {
                    (1, 1) => {}
                    (1, _) => mesh.triangle([below[0], above[next], above[k]]),
                    (_, 1) => mesh.triangle([below[k], below[next], above[0]]),
                    _ => mesh.quad([below[k], below[next], above[next], above[k]]),
                }
            }
        }
        below = above;
    }
    mesh
}

/// A sphere centred at the origin.
pub(crate) fn sphere(radius: f64, around: usize, rings: usize) -> Mesh {
    let at = |k: usize| {
        let (sin, cos) = (k as f64 / rings as f64 * PI).sin_cos();
        // The sine of pi is not 0 in f64, and a pole has to be.
        DVec2::new(if k == 0 || k == rings { 0.0 } else { radius * sin }, -radius * cos)
    };
    lathe(&(0..=rings).map(at).collect::<Vec<_>>(), around)
}

/// A cylinder from z = 0 to `height` with hard edges.
pub(crate) fn cylinder(radius: f64, height: f64, around: usize) -> Mesh {
    cone(radius, radius, height, around)
}

/// A truncated cone from z = 0 to `height`; a radius of 0 is a tip.
pub(crate) fn cone(low: f64, high: f64, height: f64, around: usize) -> Mesh {
    let p = |r: f64, z: f64| DVec2::new(r, z);
    lathe(&[p(0.0, 0.0), p(low, 0.0), p(low, 0.0), p(high, height), p(high, height), p(0.0, height)], around)
}

/// A cylinder with half spheres at its ends, between two points.
pub(crate) fn capsule(from: DVec3, to: DVec3, low: f64, high: f64, around: usize) -> Mesh {
    let axis = to - from;
    let length = axis.length();
    let quarter = |k: usize| (k as f64 / 3.0 * PI / 2.0).sin_cos();
    let mut profile = vec![DVec2::new(0.0, -low)];
    profile.extend((1..=3).map(|k| DVec2::new(low * quarter(k).0, -low * quarter(k).1)));
    profile.extend((0..3).map(|k| DVec2::new(high * quarter(k).1, length + high * quarter(k).0)));
    profile.push(DVec2::new(0.0, length + high));
    let turn = glam::DQuat::from_rotation_arc(DVec3::Z, axis.normalize_or(DVec3::Z));
    lathe(&profile, around).rotated(turn).moved(from).settled()
}

/// A ring about the z axis.
pub(crate) fn torus(radius: f64, thickness: f64, around: usize, section: usize) -> Mesh {
    let path: Vec<DVec3> = (0..around)
        .map(|k| {
            let (sin, cos) = (k as f64 / around as f64 * TAU).sin_cos();
            DVec3::new(radius * cos, radius * sin, 0.0)
        })
        .collect();
    along(&path, &vec![thickness; around], section, true)
}

/// A tube along a path with a radius at each point and rounded-off ends.
pub(crate) fn tube(path: &[DVec3], radii: &[f64], section: usize) -> Mesh {
    along(path, radii, section, false)
}

fn along(path: &[DVec3], radii: &[f64], section: usize, closed: bool) -> Mesh {
    let mut mesh = Mesh::default();
    let n = path.len();
    if n < 2 {
        return mesh;
    }
    let tangent = |k: usize| {
        let (before, after) = if closed {
            (path[(k + n - 1) % n], path[(k + 1) % n])
        } else {
            (path[k.saturating_sub(1)], path[(k + 1).min(n - 1)])
        };
        (after - before).normalize_or(DVec3::Z)
    };
    let mut side = tangent(0).any_orthonormal_vector();
    let mut rings: Vec<Vec<u32>> = Vec::with_capacity(n);
    for k in 0..n {
        let t = tangent(k);
        // The frame is carried along the path without turning about it.
        side = (side - t * side.dot(t)).normalize_or(t.any_orthonormal_vector());
        let other = t.cross(side);
        let at = |j: usize| {
            let (sin, cos) = (j as f64 / section as f64 * TAU).sin_cos();
            path[k] + (side * cos + other * sin) * radii[k]
        };
        rings.push((0..section).map(|j| mesh.vertex(at(j))).collect());
    }
    let joints = if closed { n } else { n - 1 };
    for k in 0..joints {
        let (below, above) = (&rings[k], &rings[(k + 1) % n]);
        for j in 0..section {
            let next = (j + 1) % section;
            mesh.quad([below[j], below[next], above[next], above[j]]);
        }
    }
    if !closed {
        let first = mesh.vertex(path[0] - tangent(0) * radii[0] * 0.3);
        let last = mesh.vertex(path[n - 1] + tangent(n - 1) * radii[n - 1] * 0.3);
        for j in 0..section {
            let next = (j + 1) % section;
            mesh.triangle([rings[0][next], rings[0][j], first]);
            mesh.triangle([rings[n - 1][j], rings[n - 1][next], last]);
        }
    }
    mesh
}

/// A superquadric of half axes `size`: exponents near 0 are boxes, 1 is an ellipsoid, 2 an octahedron.
pub(crate) fn superquadric(size: DVec3, [ring, profile]: [f64; 2], around: usize, rings: usize) -> Mesh {
    let power = |v: f64, e: f64| v.abs().powf(e).copysign(v);
    let mut mesh = sphere(1.0, around, rings);
    for (position, rest) in mesh.positions.iter_mut().zip(&mut mesh.rest) {
        let radius = position.truncate().length();
        let (sin, cos) = position.y.atan2(position.x).sin_cos();
        let r = power(radius, profile);
        *position = DVec3::new(r * power(cos, ring), r * power(sin, ring), power(position.z, profile)) * size;
        *rest = position.as_vec3();
    }
    mesh
}

/// A sphere with dents and bumps, of about this radius; `rough` is how deep they are in parts of the radius.
pub(crate) fn rock(radius: f64, rough: f64, detail: usize, seed: u32) -> Mesh {
    let mut mesh = sphere(radius, detail * 2, detail);
    for (position, rest) in mesh.positions.iter_mut().zip(&mut mesh.rest) {
        let p = (*position / radius).as_vec3();
        let bump = f64::from(fractal(p * 1.3, 4, 0.0, seed)) - 0.5;
        *position *= 1.0 + 2.0 * rough * bump;
        *rest = position.as_vec3();
    }
    mesh
}
