//! The walls of rooms: where they are, what is put against them, their openings.

use glam::DVec3;

use crate::mesh::Mesh;

/// A room's measures.
pub(super) struct Room {
    pub(super) width: f64,
    pub(super) depth: f64,
    pub(super) height: f64,
}

/// A wall: where it begins, along which direction, how long. The room is on its left.
#[derive(Clone, Copy)]
pub(super) struct Wall {
    pub(super) from: DVec3,
    pub(super) along: DVec3,
    pub(super) length: f64,
}

impl Wall {
    /// Into the room.
    pub(super) fn inward(&self) -> DVec3 {
        DVec3::Z.cross(self.along)
    }

    /// Turns a thing whose back is towards +y with its back to the wall, its middle at a place along it.
    pub(super) fn against(&self, mesh: Mesh, place: f64, away: f64, z: f64) -> Mesh {
        let angle = self.along.y.atan2(self.along.x) + std::f64::consts::PI;
        mesh.turned(angle).moved(self.from + self.along * place + self.inward() * away + DVec3::Z * z)
    }
}

impl Room {
    pub(super) fn walls(&self) -> [Wall; 4] {
        let (w, d) = (self.width, self.depth);
        let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        [
            Wall { from: corner(0.0, 0.0), along: DVec3::X, length: w },
            Wall { from: corner(w, 0.0), along: DVec3::Y, length: d },
            Wall { from: corner(w, d), along: DVec3::NEG_X, length: w },
            Wall { from: corner(0.0, d), along: DVec3::NEG_Y, length: d },
        ]
    }

    pub(super) fn area(&self) -> f64 {
        2.0 * (self.width * self.depth + (self.width + self.depth) * self.height)
    }
}

/// A wall of single faces about its openings, with reveals.
pub(super) fn panelled(wall: &Wall, holes: &[[f64; 4]], height: f64) -> Mesh {
    let mut mesh = Mesh::default();
    let point = |x: f64, z: f64, back: f64| wall.from + wall.along * x + DVec3::Z * z - wall.inward() * back;
    let mut piece = |a: f64, b: f64, low: f64, high: f64| {
        if b > a && high > low {
            // From inside the room, the wall's direction goes to the left.
            mesh.face([point(b, low, 0.0), point(a, low, 0.0), point(a, high, 0.0), point(b, high, 0.0)]);
        }
    };
    let mut x = 0.0;
    for &[a, b, low, high] in holes {
        piece(x, a, 0.0, height);
        piece(a, b, 0.0, low);
        piece(a, b, high, height);
        x = b;
    }
    piece(x, wall.length, 0.0, height);
    for &[a, b, low, high] in holes {
        for [p, q] in [[(a, low), (a, high)], [(a, high), (b, high)], [(b, high), (b, low)], [(b, low), (a, low)]] {
            mesh.face([point(p.0, p.1, 0.0), point(q.0, q.1, 0.0), point(q.0, q.1, 0.16), point(p.0, p.1, 0.16)]);
        }
    }
    mesh
}
