//! Shapes with flat faces: boxes, boxes with rounded edges, prisms, frames.

use glam::{DVec2, DVec3};

use crate::mesh::Mesh;

/// A box centred at the origin.
pub(crate) fn cuboid(size: DVec3) -> Mesh {
    let h = size / 2.0;
    let at = |x: f64, y: f64, z: f64| DVec3::new(x * h.x, y * h.y, z * h.z);
    let mut mesh = Mesh::default();
    for s in [-1.0, 1.0] {
        // Counter-clockwise from outside on the positive side; the other way round on the negative one.
        let faces = [
            [at(s, -1.0, -1.0), at(s, 1.0, -1.0), at(s, 1.0, 1.0), at(s, -1.0, 1.0)],
            [at(1.0, s, -1.0), at(-1.0, s, -1.0), at(-1.0, s, 1.0), at(1.0, s, 1.0)],
            [at(-1.0, -1.0, s), at(1.0, -1.0, s), at(1.0, 1.0, s), at(-1.0, 1.0, s)],
        ];
        for mut face in faces {
            if s < 0.0 {
                face.reverse();
            }
            mesh.face(face);
        }
    }
    mesh
}

/// A box from corner to corner.
pub(crate) fn block(low: DVec3, high: DVec3) -> Mesh {
    cuboid(high - low).moved((low + high) / 2.0).settled()
}

/// A box centred at the origin whose edges are rounded; smooth.
///
/// The surface of a lattice of `n + 1` points an axis, with vertices shared between faces: the large faces have most of the weight
/// in the normals of their edges, so they look flat.
pub(crate) fn rounded(size: DVec3, radius: f64) -> Mesh {
    let h = size / 2.0;
    let radius = radius.min(h.min_element() * 0.999);
    let inner = h - DVec3::splat(radius);
    // Places along an axis: the ends, one within the rounding on either side, where it begins.
    const STEPS: usize = 6;
    let place = |k: usize, axis: usize| match k {
        0 => -h[axis],
        1 => -inner[axis] - radius * 0.5,
        2 => -inner[axis],
        3 => inner[axis],
        4 => inner[axis] + radius * 0.5,
        _ => h[axis],
    };
    let mut mesh = Mesh::default();
    let mut index = [[[u32::MAX; STEPS]; STEPS]; STEPS];
    let mut vertex = |mesh: &mut Mesh, k: [usize; 3]| {
        let entry = &mut index[k[0]][k[1]][k[2]];
        if *entry == u32::MAX {
            let p = DVec3::new(place(k[0], 0), place(k[1], 1), place(k[2], 2));
            let core = p.clamp(-inner, inner);
            *entry = mesh.vertex(core + (p - core).normalize_or_zero() * radius);
        }
        *entry
    };
    for axis in 0..3 {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        for end in [0, STEPS - 1] {
            for i in 0..STEPS - 1 {
                for j in 0..STEPS - 1 {
                    let mut corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|[i, j]| {
                        let mut k = [0; 3];
                        (k[axis], k[b], k[c]) = (end, i, j);
                        vertex(&mut mesh, k)
                    });
                    if end == 0 {
                        corners.reverse();
                    }
                    mesh.quad(corners);
                }
            }
        }
    }
    mesh
}

/// An outline in the plane, star-shaped about the origin and counter-clockwise, drawn up from z = 0 to `height`.
pub(crate) fn prism(outline: &[DVec2], height: f64) -> Mesh {
    let mut mesh = Mesh::default();
    let low = |p: &DVec2| p.extend(0.0);
    let high = |p: &DVec2| p.extend(height);
    for (k, p) in outline.iter().enumerate() {
        let q = &outline[(k + 1) % outline.len()];
        mesh.face([low(p), low(q), high(q), high(p)]);
        for (corners, z) in [([q, p], 0.0), ([p, q], height)] {
            let centre = mesh.vertex(DVec3::new(0.0, 0.0, z));
            let [a, b] = corners.map(|corner| mesh.vertex(corner.extend(z)));
            mesh.triangle([centre, a, b]);
        }
    }
    mesh
}

/// A rectangular frame in the xz plane, centred at the origin: outer width and height, width of the bars, thickness along y.
pub(crate) fn frame(width: f64, height: f64, bar: f64, thickness: f64) -> Mesh {
    let upright = DVec3::new(bar, thickness, height);
    let across = DVec3::new(width - 2.0 * bar, thickness, bar);
    let (x, z) = ((width - bar) / 2.0, (height - bar) / 2.0);
    Mesh::joined(&[
        cuboid(upright).moved(DVec3::new(-x, 0.0, 0.0)).settled(),
        cuboid(upright).moved(DVec3::new(x, 0.0, 0.0)).settled(),
        cuboid(across).moved(DVec3::new(0.0, 0.0, -z)).settled(),
        cuboid(across).moved(DVec3::new(0.0, 0.0, z)).settled(),
    ])
}
