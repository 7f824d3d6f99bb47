//! What a ray meets: instance, triangle and barycentric coordinates, in f64.
//!
//! `x = origin + t * direction` with t > 0; the direction is not normalised, so that t is z-depth for rays through pixels. A hit's
//! point is `(1 - u - v) a + u b + v c`. Triangles have two sides. Of two hits at equal t the one with the smaller triangle
//! counts, so that the order of visits does not matter. Everything still is one mesh in world coordinates, instance 0; what moves
//! rigidly keeps its own coordinates and hierarchy and has a pose for each time.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::bvh::{Bounds, Bvh, Slabs};
use crate::mesh::{Mesh, vertex_normals};

/// How far outside a triangle, in barycentric coordinates, still counts: shared edges have no gaps.
const EDGE: f64 = 1e-12;

/// Steps of the grid on which vertices and places lie (a micrometre), and axes of poses. Sines and powers differ in their last bit
/// between machines; here that bit is dropped, and what follows is made of sums, products, quotients and roots, which are the same
/// everywhere. So are labels, then.
const VERTEX: f64 = 1.0 / (1 << 20) as f64;
const AXIS: f64 = 1.0 / (1 << 26) as f64;

fn on_grid(v: DVec3, step: f64) -> DVec3 {
    (v / step).round() * step
}

/// A half line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
}

impl Ray {
    pub(crate) fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    fn slabs(&self) -> Slabs {
        Slabs::new(self.origin, self.direction)
    }
}

/// What a ray meets first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hit {
    pub(crate) instance: u32,
    pub(crate) triangle: u32,
    pub(crate) u: f64,
    pub(crate) v: f64,
    pub(crate) t: f64,
}

/// A corner and two edges, ready for the test.
#[derive(Debug, Clone, Copy)]
struct Face {
    corner: DVec3,
    edges: [DVec3; 2],
}

/// A mesh with its hierarchy.
#[derive(Debug, Clone)]
pub(crate) struct Solid {
    pub(crate) mesh: Mesh,
    pub(crate) normals: Vec<Vec3>,
    bvh: Bvh,
    /// In the order of the hierarchy's leaves.
    faces: Vec<Face>,
}

impl Solid {
    /// Of a mesh whose vertices are moved to the grid.
    pub(crate) fn new(mut mesh: Mesh) -> Self {
        mesh.positions.iter_mut().for_each(|position| *position = on_grid(*position, VERTEX));
        let corners = |corners: &[u32; 3]| corners.map(|corner| mesh.positions[corner as usize]);
        let boxes: Vec<Bounds> = mesh.triangles.iter().map(|triangle| Bounds::of(&corners(triangle))).collect();
        let bvh = Bvh::new(&boxes);
        let face = |&index: &u32| {
            let [corner, b, c] = corners(&mesh.triangles[index as usize]);
            Face { corner, edges: [b - corner, c - corner] }
        };
        let faces = bvh.order().iter().map(face).collect();
        let normals = vertex_normals(&mesh.positions, &mesh.triangles);
        Self { mesh, normals, bvh, faces }
    }

    /// The nearest hit with t in (`least`, `most`), where it is nearer than the one given. `slabs` are those of the ray.
    fn nearest(&self, instance: u32, (ray, slabs): (&Ray, &Slabs), least: f64, best: &mut Option<Hit>, most: &mut f64) {
        self.bvh.visit(slabs, most, |places, most| {
            for place in places {
                let Some((t, u, v)) = meet(&self.faces[place], ray) else {
                    continue;
                };
                if t <= least || t > *most {
                    continue;
                }
                let triangle = self.bvh.order()[place];
                if best.is_none_or(|hit| (t, instance, triangle) < (hit.t, hit.instance, hit.triangle)) {
                    *most = t;
                    *best = Some(Hit { instance, triangle, u, v, t });
                }
            }
        });
    }

    fn blocks(&self, ray: &Ray, slabs: &Slabs, least: f64, most: f64) -> bool {
        self.bvh.any(slabs, most, |places| {
            let mut hits = places.filter_map(|place| meet(&self.faces[place], ray));
            hits.any(|(t, ..)| t > least && t < most)
        })
    }
}

/// Möller and Trumbore: t, u and v where the ray's line meets the triangle.
#[inline]
fn meet(face: &Face, ray: &Ray) -> Option<(f64, f64, f64)> {
    let [b, c] = face.edges;
    let p = ray.direction.cross(c);
    let determinant = b.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let inverse = 1.0 / determinant;
    let from = ray.origin - face.corner;
    let u = from.dot(p) * inverse;
    // A NaN, from a degenerate triangle, is in no range.
    if !(-EDGE..=1.0 + EDGE).contains(&u) {
        return None;
    }
    let q = from.cross(b);
    let v = ray.direction.dot(q) * inverse;
    (v >= -EDGE && u + v <= 1.0 + EDGE).then(|| (c.dot(q) * inverse, u, v))
}

/// A solid at a pose.
#[derive(Debug, Clone)]
pub(crate) struct Placed {
    pub(crate) solid: Arc<Solid>,
    pub(crate) pose: DAffine3,
    inverse: DAffine3,
}

impl Placed {
    /// At a pose whose numbers are moved to the grid.
    pub(crate) fn new(solid: Arc<Solid>, pose: DAffine3) -> Self {
        let DMat3 { x_axis, y_axis, z_axis } = pose.matrix3;
        let axes = [x_axis, y_axis, z_axis].map(|axis| on_grid(axis, AXIS));
        let matrix3 = DMat3::from_cols(axes[0], axes[1], axes[2]);
        let pose = DAffine3 { matrix3, translation: on_grid(pose.translation, VERTEX) };
        Self { solid, pose, inverse: pose.inverse() }
    }

    fn bounds(&self) -> Bounds {
        let [low, high] = self.solid.mesh.bounds();
        let corner = |k: usize| {
            let pick = |axis: usize| if k >> axis & 1 == 0 { low[axis] } else { high[axis] };
            self.pose.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
        };
        // The pose's rounding is far below this.
        let margin = DVec3::splat(1e-9 * (1.0 + self.pose.translation.abs().max_element()));
        let corners: Vec<DVec3> = (0..8).flat_map(|k| [corner(k) - margin, corner(k) + margin]).collect();
        Bounds::of(&corners)
    }

    fn inward(&self, ray: &Ray) -> Ray {
        Ray {
            origin: self.inverse.transform_point3(ray.origin),
            direction: self.inverse.transform_vector3(ray.direction),
        }
    }
}

/// All geometry at one time. Instance 0 is what stands still, the others are `movers` in their order, from 1.
#[derive(Debug, Clone)]
pub(crate) struct Geometry {
    still: Arc<Solid>,
    movers: Vec<Placed>,
    top: Bvh,
}

impl Geometry {
    pub(crate) fn new(still: Arc<Solid>, movers: Vec<Placed>) -> Self {
        let boxes: Vec<Bounds> = movers.iter().map(Placed::bounds).collect();
        Self { still, movers, top: Bvh::new(&boxes) }
    }

    /// A solid and its pose by instance.
    pub(crate) fn instance(&self, instance: u32) -> (&Solid, Option<&DAffine3>) {
        match instance.checked_sub(1) {
            None => (&self.still, None),
            Some(mover) => {
                let mover = &self.movers[mover as usize];
                (&mover.solid, Some(&mover.pose))
            }
        }
    }

    /// The first hit with t in (`least`, `most`].
    pub(crate) fn cast(&self, ray: &Ray, least: f64, most: f64) -> Option<Hit> {
        let (mut best, mut most) = (None, most);
        let slabs = ray.slabs();
        self.still.nearest(0, (ray, &slabs), least, &mut best, &mut most);
        self.top.visit(&slabs, &mut most, |places, most| {
            for place in places {
                let index = self.top.order()[place];
                let mover = &self.movers[index as usize];
                let ray = mover.inward(ray);
                mover.solid.nearest(index + 1, (&ray, &ray.slabs()), least, &mut best, most);
            }
        });
        best
    }

    /// Whether anything lies between t = `least` and t = `most`.
    pub(crate) fn blocked(&self, ray: &Ray, least: f64, most: f64) -> bool {
        let slabs = ray.slabs();
        self.still.blocks(ray, &slabs, least, most)
            || self.top.any(&slabs, most, |mut places| {
                places.any(|place| {
                    let mover = &self.movers[self.top.order()[place] as usize];
                    let ray = mover.inward(ray);
                    mover.solid.blocks(&ray, &ray.slabs(), least, most)
                })
            })
    }

    /// The world point of a hit's surface point, at this geometry's time.
    pub(crate) fn point(&self, hit: &Hit) -> DVec3 {
        let (solid, pose) = self.instance(hit.instance);
        let [a, b, c] = self.corners(solid, hit.triangle);
        let local = a + (b - a) * hit.u + (c - a) * hit.v;
        pose.map_or(local, |pose| pose.transform_point3(local))
    }

    /// The unit normal of a hit's triangle, on its outside, in the world.
    pub(crate) fn face_normal(&self, hit: &Hit) -> DVec3 {
        let (solid, pose) = self.instance(hit.instance);
        let [a, b, c] = self.corners(solid, hit.triangle);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        pose.map_or(normal, |pose| pose.transform_vector3(normal))
    }

    fn corners(&self, solid: &Solid, triangle: u32) -> [DVec3; 3] {
        solid.mesh.triangles[triangle as usize].map(|corner| solid.mesh.positions[corner as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// A cloud of triangles of all sizes, some of them degenerate.
    fn cloud(random: &mut Random, count: usize) -> Mesh {
        let mut mesh = Mesh::default();
        for k in 0..count {
            let size = random.log_range(0.01, 3.0);
            let centre = random.direction() * random.range(0.0, 5.0);
            let corners = [(); 3].map(|()| mesh.vertex(centre + random.direction() * size));
            mesh.triangle(if k % 50 == 0 { [corners[0]; 3] } else { corners });
        }
        mesh
    }

    /// Every triangle of every instance, moved into the world and tested one after the other.
    fn brute_force(geometry: &Geometry, count: u32, ray: &Ray) -> Option<f64> {
        let mut nearest: Option<f64> = None;
        for instance in 0..count {
            let (solid, pose) = geometry.instance(instance);
            for corners in &solid.mesh.triangles {
                let [a, b, c] = corners.map(|corner| {
                    let local = solid.mesh.positions[corner as usize];
                    pose.map_or(local, |pose| pose.transform_point3(local))
                });
                // The plane's equation, then the side of each edge: not the way of `meet`.
                let normal = (b - a).cross(c - a);
                let t = normal.dot(a - ray.origin) / normal.dot(ray.direction);
                let x = ray.at(t);
                let inside = [(a, b), (b, c), (c, a)].iter().all(|(p, q)| (*q - *p).cross(x - *p).dot(normal) >= 0.0);
                if t > 0.0 && inside && nearest.is_none_or(|least| t < least) {
                    nearest = Some(t);
                }
            }
        }
        nearest
    }

    #[test]
    fn the_hierarchy_finds_what_brute_force_finds() {
        let mut random = Random::new(3, 0, "cast");
        let still = Arc::new(Solid::new(cloud(&mut random, 600)));
        let movers: Vec<Placed> = (0..9)
            .map(|_| {
                let pose = DAffine3::from_rotation_translation(random.rotation(), random.direction() * 4.0);
                Placed::new(Arc::new(Solid::new(cloud(&mut random, 40))), pose)
            })
            .collect();
        let geometry = Geometry::new(still, movers);
        let (mut hits, mut misses) = (0, 0);
        for k in 0..3000 {
            let mut direction = random.direction();
            if k % 10 == 0 {
                direction = [DVec3::X, DVec3::NEG_Y, DVec3::Z][k / 10 % 3];
            }
            let ray = Ray { origin: random.direction() * random.log_range(0.1, 1e3), direction: direction * 3.0 };
            let found = geometry.cast(&ray, 0.0, f64::INFINITY);
            match (brute_force(&geometry, 10, &ray), found) {
                (Some(t), Some(hit)) => {
                    assert!((t - hit.t).abs() <= 1e-6 * t, "ray {k}: {t} by brute force, {hit:?}");
                    assert!(geometry.point(&hit).distance(ray.at(hit.t)) < 1e-8 * (1.0 + ray.origin.length()), "{k}");
                    assert!(geometry.blocked(&ray, 0.0, hit.t * 1.001) && !geometry.blocked(&ray, 0.0, hit.t * 0.999));
                    hits += 1;
                }
                (None, None) => misses += 1,
                (t, hit) => panic!("ray {k}: {t:?} by brute force, {hit:?}"),
            }
        }
        assert!(hits > 500 && misses > 100, "{hits} hits, {misses} misses: not a test of both");
    }

    #[test]
    fn the_last_bits_of_vertices_and_poses_change_no_hit() {
        let mut random = Random::new(6, 0, "grid");
        // A third of a micrometre away from where rounding turns.
        let step = |random: &mut Random| VERTEX * (random.below(4_000_000) as f64 + 0.2);
        let mut mesh = Mesh::default();
        for _ in 0..40 {
            let corners = [(); 3].map(|()| {
                let corner = DVec3::new(step(&mut random), step(&mut random), step(&mut random));
                mesh.vertex(corner)
            });
            mesh.triangle(corners);
        }
        let pose = DAffine3::from_rotation_translation(random.rotation(), DVec3::splat(step(&mut random)));
        let of = |mesh: Mesh, pose: DAffine3| {
            Geometry::new(Arc::new(Solid::new(Mesh::default())), vec![Placed::new(Arc::new(Solid::new(mesh)), pose)])
        };
        let off = 1.0 + 3.0 * f64::EPSILON;
        let mut other = mesh.clone();
        other.positions.iter_mut().for_each(|position| *position *= off);
        let moved = DAffine3 { matrix3: pose.matrix3 * off, translation: pose.translation * off };
        let (one, two) = (of(mesh, pose), of(other, moved));
        let mut hits = 0;
        for _ in 0..3000 {
            let ray = Ray { origin: random.direction() * 9.0, direction: random.direction() };
            let hit = one.cast(&ray, 0.0, f64::INFINITY);
            assert_eq!(hit, two.cast(&ray, 0.0, f64::INFINITY));
            hits += usize::from(hit.is_some());
        }
        assert!(hits > 20, "{hits}");
    }

    #[test]
    fn a_closed_surface_has_no_gaps() {
        let still = Arc::new(Solid::new(crate::shapes::sphere(1.0, 24, 12)));
        let geometry = Geometry::new(still, Vec::new());
        let mut random = Random::new(4, 0, "gaps");
        for _ in 0..5000 {
            // Through vertices and edges as well: directions of the vertices themselves, exactly.
            let (solid, _) = geometry.instance(0);
            let target = *random.pick(&solid.mesh.positions);
            let direction = if random.chance(0.5) { target } else { random.direction() };
            let hit = geometry.cast(&Ray { origin: DVec3::ZERO, direction }, 0.0, f64::INFINITY);
            assert!(hit.is_some(), "{direction}");
        }
    }
}
