//! What files of models have in common once they are read: corners, faces, looks.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};

use super::flaw::Flaw;
use crate::material::{Material, Pattern};
use crate::mesh::Mesh;
use crate::photo::Photo;

/// A model has no more triangles than this.
pub(crate) const MOST_TRIANGLES: usize = 1_000_000;

/// How a part of a model looks.
#[derive(Debug, Clone)]
pub(crate) struct Look {
    /// Linear RGB; the texture is multiplied by it.
    pub(crate) colour: Vec3,
    pub(crate) texture: Option<Arc<Photo>>,
    /// Reflectance of the highlight, and its width.
    pub(crate) gloss: f32,
    pub(crate) rough: f32,
    /// Lengths of the model to one unit of texture coordinates.
    pub(crate) unit: f32,
}

impl Look {
    pub(crate) fn plain(colour: Vec3) -> Self {
        Self { colour, texture: None, gloss: 0.04, rough: 0.6, unit: 1.0 }
    }

    /// The material of a model that is scaled by a factor.
    pub(crate) fn material(&self, factor: f32) -> Material {
        let plain = Material { gloss: self.gloss, rough: self.rough, ..Material::plain(self.colour) };
        match &self.texture {
            None => plain,
            Some(photo) => {
                Material { pattern: Pattern::Wrapped(Arc::clone(photo)), scale: self.unit * factor, ..plain }
            }
        }
    }
}

/// A triangle of a file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Face {
    /// Indices of positions.
    pub(crate) corners: [u32; 3],
    /// Indices of texture coordinates.
    pub(crate) places: Option<[u32; 3]>,
    /// Index of a look.
    pub(crate) look: u16,
}

/// A model as its file has it: y up in most of them, any unit.
#[derive(Debug, Clone, Default)]
pub(crate) struct Raw {
    pub(crate) positions: Vec<DVec3>,
    /// Texture coordinates: (0, 0) is the lower left corner of a picture.
    pub(crate) places: Vec<Vec2>,
    pub(crate) faces: Vec<Face>,
    pub(crate) looks: Vec<Look>,
}

/// A vertex with the normal of the first face that it was made for.
type Known = (DVec3, u32);

impl Raw {
    /// Leaves out what has no area, and refuses what leads nowhere, is no number, or is nothing.
    pub(crate) fn checked(mut self) -> Result<Self, Flaw> {
        let [positions, places] = [self.positions.len(), self.places.len()];
        let leads = |face: &Face| {
            face.corners.iter().all(|&k| (k as usize) < positions)
                && face.places.is_none_or(|all| all.iter().all(|&k| (k as usize) < places))
                && usize::from(face.look) < self.looks.len()
        };
        if !self.faces.iter().all(leads) {
            return Err(Flaw::Index("a corner of a face"));
        }
        let all = &self.positions;
        // Positions that no face uses may be anything.
        if self.faces.iter().flat_map(|face| face.corners).any(|k| !is_usable(all[k as usize])) {
            return Err(Flaw::NotFinite("a position"));
        }
        for place in &mut self.places {
            if !(place.is_finite() && place.abs().max_element() < 1e6) {
                *place = Vec2::ZERO;
            }
        }
        let has_area = |face: &Face| {
            let [a, b, c] = face.corners.map(|k| all[k as usize]);
            (b - a).cross(c - a).length_squared() > 0.0
        };
        self.faces.retain(has_area);
        if self.faces.len() > MOST_TRIANGLES {
            return Err(Flaw::Triangles { count: self.faces.len(), most: MOST_TRIANGLES });
        }
        if self.faces.is_empty() { Err(Flaw::Empty) } else { Ok(self) }
    }

    /// Sets what one unit of texture coordinates is in lengths of the model, for every look: by the areas of its faces.
    pub(crate) fn measured(mut self) -> Self {
        let mut areas = vec![[0.0_f64; 2]; self.looks.len()];
        for face in &self.faces {
            let Some(places) = face.places else { continue };
            let [a, b, c] = face.corners.map(|k| self.positions[k as usize]);
            let [p, q, r] = places.map(|k| self.places[k as usize]);
            let area = &mut areas[usize::from(face.look)];
            area[0] += (b - a).cross(c - a).length();
            area[1] += f64::from((q - p).perp_dot(r - p).abs());
        }
        for (look, [world, texture]) in self.looks.iter_mut().zip(areas) {
            let unit = (world / texture).sqrt() as f32;
            // Where there are no coordinates to speak of, one colour of the texture is seen.
            look.unit = if unit.is_finite() && unit > 0.0 { unit } else { 1.0 };
        }
        self
    }

    /// The mesh, and for each of its vertices the position that it was made of. Slots are indices of looks. Faces at a common
    /// position share a vertex where their normals are nearer to each other than the crease, given by its cosine.
    pub(crate) fn mesh(&self, crease: f64) -> (Mesh, Vec<u32>) {
        // Textured faces may share a vertex where they share a place; positions are the pattern of the others.
        let mut vertices: HashMap<(u32, Option<u32>), Vec<Known>> = HashMap::new();
        let (mut mesh, mut sources) = (Mesh::default(), Vec::new());
        for face in &self.faces {
            let look = &self.looks[usize::from(face.look)];
            let places = face.places.filter(|_| look.texture.is_some());
            let [a, b, c] = face.corners.map(|k| self.positions[k as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let mut corner = |k: usize| {
                let (source, place) = (face.corners[k], places.map(|places| places[k]));
                let known = vertices.entry((source, place)).or_default();
                if let Some((_, vertex)) = known.iter().find(|(other, _)| other.dot(normal) >= crease) {
                    return *vertex;
                }
                let vertex = mesh.vertex(self.positions[source as usize]);
                if let Some(place) = place {
                    let place = self.places[place as usize] * look.unit;
                    mesh.rest[vertex as usize] = place.extend(0.0);
                }
                sources.push(source);
                known.push((normal, vertex));
                vertex
            };
            let corners = [0, 1, 2].map(&mut corner);
            mesh.triangles.push(corners);
            mesh.slots.push(face.look);
        }
        (mesh, sources)
    }
}

fn is_usable(position: DVec3) -> bool {
    position.is_finite() && position.abs().max_element() < 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(look: Look) -> Raw {
        Raw {
            positions: vec![DVec3::ZERO, DVec3::X * 2.0, DVec3::new(2.0, 2.0, 0.0), DVec3::Y * 2.0, DVec3::Z],
            places: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y],
            faces: vec![
                Face { corners: [0, 1, 2], places: Some([0, 1, 2]), look: 0 },
                Face { corners: [0, 2, 3], places: Some([0, 2, 3]), look: 0 },
                Face { corners: [0, 3, 4], places: None, look: 0 },
            ],
            looks: vec![look],
        }
    }

    #[test]
    fn edges_are_sharp_beyond_the_crease() {
        let raw = square(Look::plain(Vec3::ONE)).checked().unwrap().measured();
        assert!((raw.looks[0].unit - 2.0).abs() < 1e-6);
        let (mesh, sources) = raw.mesh(0.7);
        // Four corners of the square and three of the face at a right angle to it.
        assert_eq!((mesh.positions.len(), mesh.triangles.len(), sources.len()), (7, 3, 7));
        assert_eq!(raw.mesh(-1.0).0.positions.len(), 5);
        assert!(sources.iter().zip(&mesh.positions).all(|(&k, p)| raw.positions[k as usize] == *p));
    }

    #[test]
    fn what_cannot_be_drawn_is_refused() {
        let with = |change: fn(&mut Raw)| {
            let mut raw = square(Look::plain(Vec3::ONE));
            change(&mut raw);
            raw.checked().map(|raw| raw.faces.len())
        };
        assert_eq!(with(|_| ()), Ok(3));
        assert_eq!(with(|raw| raw.faces[0].corners[1] = 5), Err(Flaw::Index("a corner of a face")));
        assert_eq!(with(|raw| raw.faces[0].places = Some([0, 1, 4])), Err(Flaw::Index("a corner of a face")));
        assert_eq!(with(|raw| raw.positions[4].x = f64::NAN), Err(Flaw::NotFinite("a position")));
        assert_eq!(with(|raw| raw.positions.push(DVec3::NAN)), Ok(3));
        assert_eq!(with(|raw| raw.faces[0].corners[1] = 0), Ok(2));
        assert_eq!(with(|raw| raw.faces.clear()), Err(Flaw::Empty));
    }
}
