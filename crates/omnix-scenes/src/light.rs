//! Lights: lamps with a size, the sky, ambient light, fog. Linear RGB; a white surface under radiance 1 from all sides has colour 1.

use glam::{DVec3, Vec3};

use crate::noise::fractal;

/// A source of light with a size, for shadows with soft edges.
#[derive(Debug, Clone)]
pub(crate) enum Lamp {
    /// Far away: direction towards it, tangent of its angular radius, irradiance of a surface that faces it.
    Sun { towards: DVec3, spread: f64, colour: Vec3 },
    /// A parallelogram that shines from the side of `edges[0] x edges[1]`: a window, a panel. Radiance.
    Panel { corner: DVec3, edges: [DVec3; 2], colour: Vec3 },
    /// A ball: radiant intensity.
    Bulb { centre: DVec3, radius: f64, colour: Vec3 },
}

/// Light that reaches a point from one place of a lamp, if nothing is in the way.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) direction: DVec3,
    /// Along `direction`, up to the lamp's surface.
    pub(crate) distance: f64,
    /// Irradiance of a surface that faces `direction`.
    pub(crate) colour: Vec3,
}

impl Lamp {
    /// Light from the place `(u, v)` in [0, 1)^2 of the lamp.
    pub(crate) fn sample(&self, point: DVec3, [u, v]: [f64; 2]) -> Option<Sample> {
        match self {
            Self::Sun { towards, spread, colour } => {
                let (side, other) = towards.any_orthonormal_pair();
                let direction = *towards + (side * (2.0 * u - 1.0) + other * (2.0 * v - 1.0)) * *spread;
                Some(Sample { direction: direction.normalize(), distance: 1e4, colour: *colour })
            }
            Self::Panel { corner, edges: [a, b], colour } => {
                let to = *corner + *a * u + *b * v - point;
                let squared = to.length_squared();
                let direction = to / squared.sqrt();
                let normal = a.cross(*b);
                // The normal's length is the panel's area.
                let facing = -normal.dot(direction);
                let weight = (facing / squared.max(0.05)) as f32 / std::f32::consts::PI;
                (facing > 0.0).then(|| Sample { direction, distance: squared.sqrt() * 0.999, colour: *colour * weight })
            }
            Self::Bulb { centre, radius, colour } => {
                let z = 2.0 * u - 1.0;
                let (sin, cos) = (v * std::f64::consts::TAU).sin_cos();
                let ring = (1.0 - z * z).sqrt();
                let to = *centre + DVec3::new(ring * cos, ring * sin, z) * *radius * 0.7 - point;
                let squared = to.length_squared();
                let distance = (squared.sqrt() - radius * 1.8).max(0.0);
                let colour = *colour / (squared.max(0.02) as f32);
                Some(Sample { direction: to / squared.sqrt(), distance, colour })
            }
        }
    }
}

/// What rays see that meet nothing.
#[derive(Debug, Clone)]
pub(crate) struct Sky {
    pub(crate) zenith: Vec3,
    pub(crate) horizon: Vec3,
    pub(crate) ground: Vec3,
    pub(crate) sun: Vec3,
    pub(crate) sun_colour: Vec3,
    /// Part of the sky under clouds, 0 to 1.
    pub(crate) clouds: f32,
    pub(crate) seed: u32,
}

impl Sky {
    /// One colour all over.
    pub(crate) fn even(colour: Vec3) -> Self {
        Self {
            zenith: colour,
            horizon: colour,
            ground: colour,
            sun: Vec3::Z,
            sun_colour: Vec3::ZERO,
            clouds: 0.0,
            seed: 0,
        }
    }

    /// As it is seen; with clouds and sun.
    pub(crate) fn seen(&self, direction: Vec3, footprint: f32) -> Vec3 {
        let mut colour = self.smooth(direction);
        if self.clouds > 0.0 && direction.z > 0.0 {
            let plane = direction / (direction.z + 0.12);
            let cover = fractal(plane * 1.3, 5, footprint * 4.0, self.seed) - (1.0 - self.clouds) * 0.8;
            let white = (self.zenith + self.horizon).max_element() * 0.75;
            let shade = 0.75 + 0.5 * fractal(plane * 2.0 + Vec3::splat(7.0), 3, footprint * 6.0, self.seed ^ 1);
            colour =
                colour.lerp(Vec3::splat(white * shade), (cover * 4.0).clamp(0.0, 0.95) * (direction.z * 5.0).min(1.0));
        }
        let near = direction.dot(self.sun).max(0.0);
        colour + self.sun_colour * (near.powi(900) * 3.0 + near.powi(30) * 0.06)
    }

    /// For light on surfaces: without what is small and bright.
    pub(crate) fn smooth(&self, direction: Vec3) -> Vec3 {
        if direction.z < 0.0 {
            return self.horizon.lerp(self.ground, (-direction.z * 6.0).min(1.0));
        }
        self.horizon.lerp(self.zenith, direction.z.sqrt())
    }
}

/// All light of a scene.
#[derive(Debug, Clone)]
pub(crate) struct Light {
    pub(crate) lamps: Vec<Lamp>,
    pub(crate) sky: Sky,
    /// Radiance that stands for all light after its first reflection.
    pub(crate) fill: Vec3,
    /// A box from whose inside rays that meet nothing bring no light: the windows of a room are lamps already.
    pub(crate) closed: Option<[DVec3; 2]>,
    /// Colour, and density in parts a metre.
    pub(crate) fog: Option<(Vec3, f32)>,
}

impl Light {
    /// Whether a random ray from a point that meets nothing brings light.
    pub(crate) fn is_open(&self, point: DVec3) -> bool {
        self.closed.is_none_or(|[low, high]| point.cmplt(low).any() || point.cmpgt(high).any())
    }
}
