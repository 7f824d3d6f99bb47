//! Triangle meshes and how they are put together.
//!
//! Lengths are metres, z is up. A vertex has a position and a texture position, which stays that of the undeformed, unplaced object:
//! patterns are solid functions of it, so they move, bend and scale with the object and need no unwrapping. Faces count
//! counter-clockwise from outside. Hard edges have their vertices twice: normals are averages over shared vertices.

use glam::{DAffine3, DQuat, DVec3, Vec3};

/// Triangles with a material slot each.
#[derive(Debug, Clone, Default)]
pub(crate) struct Mesh {
    pub(crate) positions: Vec<DVec3>,
    /// Texture positions, one for each vertex.
    pub(crate) rest: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Index into the scene's materials, one for each triangle.
    pub(crate) slots: Vec<u16>,
}

impl Mesh {
    /// Adds a vertex whose texture position is its position.
    pub(crate) fn vertex(&mut self, position: DVec3) -> u32 {
        self.positions.push(position);
        self.rest.push(position.as_vec3());
        (self.positions.len() - 1) as u32
    }

    pub(crate) fn triangle(&mut self, corners: [u32; 3]) {
        self.triangles.push(corners);
        self.slots.push(0);
    }

    /// Two triangles; corners counter-clockwise from outside.
    pub(crate) fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangle([a, b, c]);
        self.triangle([a, c, d]);
    }

    /// A flat quad with vertices of its own.
    pub(crate) fn face(&mut self, corners: [DVec3; 4]) {
        let corners = corners.map(|corner| self.vertex(corner));
        self.quad(corners);
    }

    /// All triangles get one material.
    pub(crate) fn with(mut self, slot: u16) -> Self {
        self.slots.fill(slot);
        self
    }

    /// Moves vertices; textures stay with them.
    pub(crate) fn placed(mut self, pose: DAffine3) -> Self {
        for position in &mut self.positions {
            *position = pose.transform_point3(*position);
        }
        if pose.matrix3.determinant() < 0.0 {
            for corners in &mut self.triangles {
                corners.swap(1, 2);
            }
        }
        self
    }

    pub(crate) fn moved(self, offset: DVec3) -> Self {
        self.placed(DAffine3::from_translation(offset))
    }

    /// Turns about the vertical axis.
    pub(crate) fn turned(self, angle: f64) -> Self {
        self.placed(DAffine3::from_rotation_z(angle))
    }

    pub(crate) fn rotated(self, rotation: DQuat) -> Self {
        self.placed(DAffine3::from_quat(rotation))
    }

    /// Texture positions are set to the positions: what follows moves the pattern too.
    pub(crate) fn settled(mut self) -> Self {
        for (rest, position) in self.rest.iter_mut().zip(&self.positions) {
            *rest = position.as_vec3();
        }
        self
    }

    /// Takes another mesh in.
    pub(crate) fn add(&mut self, other: &Mesh) {
        let first = self.positions.len() as u32;
        self.positions.extend_from_slice(&other.positions);
        self.rest.extend_from_slice(&other.rest);
        self.triangles.extend(other.triangles.iter().map(|corners| corners.map(|corner| corner + first)));
        self.slots.extend_from_slice(&other.slots);
    }

    pub(crate) fn joined(meshes: &[Mesh]) -> Self {
        let mut all = Self::default();
        for mesh in meshes {
            all.add(mesh);
        }
        all
    }

    /// Least and greatest coordinates; both infinite, the wrong way round, for an empty mesh.
    pub(crate) fn bounds(&self) -> [DVec3; 2] {
        bounds(&self.positions)
    }

    /// Moves the mesh so that its lowest point is at z = 0.
    pub(crate) fn grounded(self) -> Self {
        let [low, _] = self.bounds();
        if low.z.is_finite() { self.moved(DVec3::new(0.0, 0.0, -low.z)) } else { self }
    }
}

/// Least and greatest coordinates of points.
pub(crate) fn bounds(points: &[DVec3]) -> [DVec3; 2] {
    let empty = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    points.iter().fold(empty, |[low, high], &point| [low.min(point), high.max(point)])
}

/// Normals of vertices: the sum of the normals of the faces that share one, weighted by area; unit length or zero.
pub(crate) fn vertex_normals(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![DVec3::ZERO; positions.len()];
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| positions[corner as usize]);
        let normal = (b - a).cross(c - a);
        for &corner in corners {
            normals[corner as usize] += normal;
        }
    }
    normals.into_iter().map(|normal| normal.normalize_or_zero().as_vec3()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirrored_mesh_keeps_its_outside() {
        let mut mesh = Mesh::default();
        mesh.face([DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y]);
        let mirrored = mesh.clone().placed(DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
        for mesh in [mesh, mirrored] {
            let normals = vertex_normals(&mesh.positions, &mesh.triangles);
            assert!(normals.iter().all(|&normal| normal == Vec3::Z), "{normals:?}");
        }
    }
}
