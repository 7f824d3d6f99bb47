//! Points bound to the faces of a moving mesh (`spec/omnix.md` 11.5): how the paper's own set says where a pixel's point goes.
//!
//! A point is bound to the closest plane among the faces at its nearest vertex which contain its projection, or, where none does, to the
//! closest of these faces. It follows the face by the rigid motion that best maps the face's three vertices, with the weights 1/d^2, d the
//! distance of the vertex from the point (singular value decomposition, a reflection repaired).

use glam::DVec3;
use nalgebra::{Matrix3, Vector3};
use rstar::RTree;
use rstar::primitives::GeomWithData;

/// A point this near to a vertex has the weight of one at this distance, as a share of its face's size squared.
const NEAR: f64 = 1e-12;

/// The faces at each vertex.
#[derive(Debug)]
pub(super) struct Faces {
    corners: Vec<[u32; 3]>,
    /// Where the faces of each vertex start in `at`, and the end of the last.
    start: Vec<u32>,
    at: Vec<u32>,
}

impl Faces {
    /// Faces of vertices below `vertices`; none if a corner is not.
    pub(super) fn new(corners: Vec<[u32; 3]>, vertices: usize) -> Option<Self> {
        let mut start = vec![0u32; vertices + 1];
        for corner in corners.iter().flatten() {
            *start.get_mut(*corner as usize + 1).filter(|_| (*corner as usize) < vertices)? += 1;
        }
        for vertex in 0..vertices {
            start[vertex + 1] += start[vertex];
        }
        let mut next = start.clone();
        let mut at = vec![0; corners.len() * 3];
        for (face, corner) in corners.iter().enumerate().flat_map(|(face, three)| three.map(|corner| (face, corner))) {
            at[next[corner as usize] as usize] = face as u32;
            next[corner as usize] += 1;
        }
        Some(Self { corners, start, at })
    }

    fn of(&self, vertex: u32) -> &[u32] {
        &self.at[self.start[vertex as usize] as usize..self.start[vertex as usize + 1] as usize]
    }
}

/// A mesh at one moment, ready to be searched.
pub(super) struct Posed<'a> {
    faces: &'a Faces,
    vertices: &'a [DVec3],
    tree: RTree<GeomWithData<[f64; 3], u32>>,
}

impl<'a> Posed<'a> {
    pub(super) fn new(faces: &'a Faces, vertices: &'a [DVec3]) -> Self {
        // Vertices without a face bind nothing.
        let used = vertices.iter().enumerate().filter(|(k, v)| v.is_finite() && !faces.of(*k as u32).is_empty());
        let points = used.map(|(k, v)| GeomWithData::new(v.to_array(), k as u32)).collect();
        Self { faces, vertices, tree: RTree::bulk_load(points) }
    }

    /// The face that a point belongs to; none of a mesh without faces.
    pub(super) fn bind(&self, point: DVec3) -> Option<u32> {
        let mut nearest = self.tree.nearest_neighbor_iter_with_distance_2(&point.to_array());
        let (first, least) = nearest.next()?;
        // Vertices at one place, as along seams of a texture, count as one.
        let mut candidates: Vec<u32> = self.faces.of(first.data).to_vec();
        for (vertex, _) in nearest.take_while(|(_, distance)| *distance <= least) {
            candidates.extend(self.faces.of(vertex.data));
        }
        candidates.sort_unstable();
        candidates.dedup();
        let distance = |face: u32| {
            let [a, b, c] = self.corners(face);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let height = (point - a).dot(normal);
            let foot = point - normal * height;
            let edges = [(a, b), (b, c), (c, a)];
            let inside = edges
                .iter()
                .all(|(from, to)| (to - from).cross(foot - from).dot(normal) >= -1e-9 * (b - a).length_squared());
            let away = edges.iter().map(|(from, to)| to_segment(point, *from, *to)).fold(f64::INFINITY, f64::min);
            // Those that contain the projection come before all others.
            (!inside, if inside { height.abs() } else { away })
        };
        let better = |a: &(bool, f64), b: &(bool, f64)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
        candidates
            .into_iter()
            .map(|face| (face, distance(face)))
            .min_by(|a, b| better(&a.1, &b.1))
            .map(|(face, _)| face)
    }

    fn corners(&self, face: u32) -> [DVec3; 3] {
        self.faces.corners[face as usize].map(|corner| self.vertices[corner as usize])
    }

    /// Where a point that belongs to a face is when the vertices are these; none where they are not finite.
    pub(super) fn follow(&self, point: DVec3, face: u32, vertices: &[DVec3]) -> Option<DVec3> {
        let before = self.corners(face);
        let after = self.faces.corners[face as usize].map(|corner| vertices[corner as usize]);
        if !after.iter().all(|v| v.is_finite()) {
            return None;
        }
        let least = NEAR * (before[1] - before[0]).length_squared().max(f64::MIN_POSITIVE);
        let weights = before.map(|v| 1.0 / (point - v).length_squared().max(least));
        let total: f64 = weights.iter().sum();
        let mean = |points: &[DVec3; 3]| (0..3).map(|k| points[k] * weights[k]).sum::<DVec3>() / total;
        let (from, to) = (mean(&before), mean(&after));
        let mut covariance = Matrix3::<f64>::zeros();
        for k in 0..3 {
            let vector = |v: DVec3| Vector3::new(v.x, v.y, v.z);
            covariance += vector(after[k] - to) * vector(before[k] - from).transpose() * (weights[k] / total);
        }
        let svd = covariance.svd(true, true);
        let (u, v_t) = (svd.u?, svd.v_t?);
        let mut repair = Matrix3::identity();
        if (u * v_t).determinant() < 0.0 {
            // The smallest singular value is the last.
            repair[(2, 2)] = -1.0;
        }
        let rotation = u * repair * v_t;
        let offset = point - from;
        let turned = rotation * Vector3::new(offset.x, offset.y, offset.z);
        Some(DVec3::new(turned.x, turned.y, turned.z) + to)
    }
}

/// Distance of a point from a segment.
fn to_segment(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let along = to - from;
    let t = ((point - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    point.distance(from + along * t)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    /// A cube of side 2 about the origin, two faces a side, corners shared.
    fn cube() -> (Faces, Vec<DVec3>) {
        let vertices =
            (0..8).map(|k| DVec3::from([k & 1, k >> 1 & 1, k >> 2].map(|bit| f64::from(bit) * 2.0 - 1.0))).collect();
        let quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        let corners = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        (Faces::new(corners, 8).unwrap(), vertices)
    }

    #[test]
    fn points_follow_a_rigid_motion_exactly() {
        let (faces, vertices) = cube();
        let posed = Posed::new(&faces, &vertices);
        let turn = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(-0.4);
        let moved: Vec<DVec3> = vertices.iter().map(|v| turn * *v + DVec3::new(3.0, -1.0, 2.0)).collect();
        for point in [DVec3::new(0.3, -0.2, 1.0), DVec3::new(1.0, 0.9, -0.8), DVec3::new(-0.5, 1.02, 0.1), vertices[5]]
        {
            let face = posed.bind(point).unwrap();
            let found = posed.follow(point, face, &moved).unwrap();
            assert!(found.distance(turn * point + DVec3::new(3.0, -1.0, 2.0)) < 1e-9, "{point}: {found}");
        }
    }

    #[test]
    fn the_plane_that_contains_the_projection_wins() {
        let (faces, vertices) = cube();
        let posed = Posed::new(&faces, &vertices);
        // A little above the top (z = 1), near the corner (1, 1, 1): the sides are near, but do not contain it.
        let face = posed.bind(DVec3::new(0.97, 0.9, 1.01)).unwrap() as usize;
        assert!([2, 3].contains(&face), "{face}");
    }

    #[test]
    fn odd_meshes_bind_nothing() {
        assert!(Faces::new(vec![[0, 1, 3]], 3).is_none());
        let faces = Faces::new(Vec::new(), 2).unwrap();
        assert_eq!(Posed::new(&faces, &[DVec3::ZERO, DVec3::ONE]).bind(DVec3::ZERO), None);
        let (faces, vertices) = cube();
        let posed = Posed::new(&faces, &vertices);
        assert_eq!(posed.follow(DVec3::ZERO, 0, &[DVec3::NAN; 8]), None);
        // A face without an area: no panic, a point that is finite.
        let flat = vec![DVec3::ONE; 8];
        assert!(posed.follow(DVec3::new(0.1, 0.2, 1.0), 2, &flat).is_some_and(DVec3::is_finite));
    }
}
