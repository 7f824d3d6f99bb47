//! Sheets: height fields, cloths, leaves.

use glam::{DVec2, DVec3};

use crate::mesh::Mesh;

/// A grid over [-w/2, w/2] x [-d/2, d/2], moved by a function of the place; its upper side is the outside. Smooth.
pub(crate) fn sheet(size: DVec2, [columns, rows]: [usize; 2], shape: impl Fn(DVec2) -> DVec3) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..=rows {
        for j in 0..=columns {
            let part = DVec2::new(j as f64 / columns as f64 - 0.5, i as f64 / rows as f64 - 0.5);
            mesh.vertex(shape(part * size));
        }
    }
    let at = |i: usize, j: usize| (i * (columns + 1) + j) as u32;
    for i in 0..rows {
        for j in 0..columns {
            mesh.quad([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
    mesh
}

/// A leaf or blade of grass: from the origin along `tip`, bent down by `droop` of its length, pointed at both ends.
pub(crate) fn blade(tip: DVec3, width: f64, droop: f64, steps: usize) -> Mesh {
    let length = tip.length();
    let along = tip.normalize_or(DVec3::Z);
    let side = along.cross(DVec3::Z).normalize_or(DVec3::X);
    let mut mesh = Mesh::default();
    let mut before: Option<[u32; 2]> = None;
    for k in 0..=steps {
        let s = k as f64 / steps as f64;
        let centre = along * length * s - DVec3::Z * droop * length * s * s;
        let half = side * width * 0.5 * (s * (1.0 - s) * 4.0).sqrt().max(0.04);
        let pair = [centre - half, centre + half].map(|p| mesh.vertex(p));
        if let Some([a, b]) = before {
            mesh.quad([a, b, pair[1], pair[0]]);
        }
        before = Some(pair);
    }
    mesh
}
