//! Colours of pixels: what light their surfaces send to the camera. Positions f64, light f32.
//!
//! Every pixel's hit is lit by one random place of at most two lamps (a shadow ray each) and by one random ray over the hemisphere
//! (sky, or the mean colour of what it meets under fill light and one lamp). The random places of a block of 4 x 4 pixels are spread
//! evenly over lamp and hemisphere, and irradiance is then averaged over 4 x 4 neighbours on the same surface (that of the hemisphere
//! over more of them): soft shadows and light from walls at three to five rays a pixel. Textures are applied after that, so they stay sharp. Where neighbours differ, four
//! further rays smooth the edge. Random numbers are a hash of pixel and seed: same scene, same bits.

use glam::{DVec2, DVec3, Vec3, Vec3A};
use rayon::prelude::*;

use crate::cast::{Geometry, Hit, Ray};
use crate::light::{Lamp, Light, Sample};
use crate::material::Material;
use crate::random::mix;
use crate::view::View;

/// How far rays start from the surface they leave, in metres.
const LIFT: f64 = 1e-5;
/// Most light of a lamp on what a random ray meets, by which few such rays would stand out.
const BOUNCE: f32 = 1.5;
/// Lamps that a pixel samples beside the sun.
const LAMPS: usize = 2;

/// What is needed to shade at one time.
#[derive(Clone, Copy)]
pub(crate) struct Shading<'a> {
    pub(crate) geometry: &'a Geometry,
    pub(crate) materials: &'a [Material],
    pub(crate) light: &'a Light,
    pub(crate) seed: u64,
}

/// A hit's surface.
#[derive(Clone, Copy)]
struct Surface<'a> {
    point: DVec3,
    /// On the side of the viewer.
    face: DVec3,
    /// With the mesh's curvature and the material's bumps.
    normal: DVec3,
    towards_viewer: DVec3,
    colour: Vec3,
    material: &'a Material,
    /// Instance and material: pixels of equal keys may share light.
    key: u64,
    depth: f64,
}

/// Light on a surface: diffuse irradiance over pi, of lamps and by the random ray, and highlights as they are seen.
#[derive(Clone, Copy, Default)]
struct Lit {
    lamps: Vec3A,
    around: Vec3A,
    shine: Vec3A,
}

impl Lit {
    /// Part by part, of this and another light.
    #[inline]
    fn with(self, other: Self, of: impl Fn(Vec3A, Vec3A) -> Vec3A) -> Self {
        Self {
            lamps: of(self.lamps, other.lamps),
            around: of(self.around, other.around),
            shine: of(self.shine, other.shine),
        }
    }

    #[inline]
    fn map(self, of: impl Fn(Vec3A) -> Vec3A) -> Self {
        Self { lamps: of(self.lamps), around: of(self.around), shine: of(self.shine) }
    }
}

/// Light towards the camera for every pixel, given their hits, row by row.
pub(crate) fn shade(shading: Shading, view: &View, hits: &[Option<Hit>]) -> Vec<Vec3> {
    let [width, height] = view.size;
    // Indexed, so that results are written where they stay.
    let pixels = || (0..width * height).into_par_iter();
    let first = |index: usize| {
        let (column, row) = (index % width, index / width);
        let surface = shading.surface(view, View::pixel(column, row), hits[index].as_ref()?);
        Some((surface, shading.lit(&surface, Places::new(shading.seed, column, row))))
    };
    let surfaces: Vec<Option<(Surface, Lit)>> = pixels().map(first).collect();
    let smooth: Vec<Lit> = pixels().map(|index| smoothed(&surfaces, width, index)).collect();
    // Two rounds on large pictures, whose blocks of 4 x 4 pixels are small on a surface.
    let smooth = [3, 9]
        .into_iter()
        .take(if width > 200 { 2 } else { 1 })
        .fold(smooth, |smooth, step| pixels().map(|index| spread(&surfaces, &smooth, width, step, index)).collect());
    let pixel = |index: usize| {
        let (column, row) = (index % width, index / width);
        if is_edge(&surfaces, width, index) {
            const OFFSETS: [DVec2; 4] = [
                DVec2::new(-0.125, -0.375),
                DVec2::new(0.375, -0.125),
                DVec2::new(0.125, 0.375),
                DVec2::new(-0.375, 0.125),
            ];
            let sum: Vec3 = OFFSETS
                .iter()
                .map(|&offset| shading.between(view, View::pixel(column, row) + offset, &surfaces, &smooth, index))
                .sum();
            return sum * 0.25;
        }
        match &surfaces[index] {
            Some((surface, _)) => shading.seen(surface, smooth[index]),
            None => shading.sky(view, View::pixel(column, row)),
        }
    };
    pixels().map(pixel).collect()
}

impl<'a> Shading<'a> {
    fn surface(&self, view: &View, at: DVec2, hit: &Hit) -> Surface<'a> {
        let ray = view.ray(at);
        let (solid, pose) = self.geometry.instance(hit.instance);
        let corners = solid.mesh.triangles[hit.triangle as usize].map(|corner| corner as usize);
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v].map(|w| w as f32);
        let blend = |values: &[Vec3]| (0..3).map(|k| values[corners[k]] * weights[k]).sum::<Vec3>();
        let rest = blend(&solid.mesh.rest);
        let [a, b, c] = corners.map(|corner| solid.mesh.rest[corner]);
        let rest_normal = (b - a).cross(c - a).normalize_or(Vec3::Z);
        let slot = solid.mesh.slots[hit.triangle as usize];
        let material = &self.materials[slot as usize];
        let towards_viewer = -ray.direction.normalize();
        let mut face = self.geometry.face_normal(hit);
        let outside = face.dot(towards_viewer) >= 0.0;
        if !outside {
            face = -face;
        }
        let cosine = face.dot(towards_viewer).max(0.15);
        let footprint = (hit.t / view.focal.x / cosine.sqrt()) as f32;
        let curved = (blend(&solid.normals) + material.slope(rest, footprint)).as_dvec3();
        let curved = pose.map_or(curved, |pose| pose.transform_vector3(curved)) * if outside { 1.0 } else { -1.0 };
        // A curved normal that faces away from the viewer is bent back to the silhouette.
        let curved = curved.normalize_or(face);
        let away = curved.dot(towards_viewer).min(0.0);
        let normal = (curved - towards_viewer * (away * 1.01)).normalize_or(face);
        Surface {
            point: ray.at(hit.t),
            face,
            normal,
            towards_viewer,
            colour: material.colour(rest, rest_normal, footprint),
            material,
            key: u64::from(hit.instance) << 16 | u64::from(slot),
            depth: hit.t,
        }
    }

    /// Lamps and hemisphere, at the pixel's own random places.
    fn lit(&self, surface: &Surface, mut places: Places) -> Lit {
        let origin = surface.point + surface.face * LIFT;
        let mut lit = self.lamps(surface, origin, &mut places);
        let direction = hemisphere(surface.normal, places.next());
        // Below the face the curved normal's hemisphere sees the thing itself.
        if direction.dot(surface.face) > 0.0 {
            lit.around = self.incoming(&Ray { origin, direction }, self.light.is_open(origin), &mut places).into();
        } else {
            lit.around = self.light.fill.into();
        }
        let material = surface.material;
        if material.rough < 0.4 && material.gloss > 0.0 {
            let mirror = surface.towards_viewer.reject_from(surface.normal) * -2.0 + surface.towards_viewer;
            let [u, v] = places.next();
            let (side, other) = mirror.any_orthonormal_pair();
            let spread = f64::from(material.rough) * 0.6;
            let direction = mirror + (side * (u - 0.5) + other * (v - 0.5)) * spread;
            if direction.dot(surface.face) > 0.0 {
                let fresnel = fresnel(material.gloss, surface.normal.dot(surface.towards_viewer));
                lit.shine += Vec3A::from(self.incoming(&Ray { origin, direction }, true, &mut places) * fresnel);
            }
        }
        lit
    }

    /// The sun by a ray of its own; of the other lamps at most two.
    fn lamps(&self, surface: &Surface, origin: DVec3, places: &mut Places) -> Lit {
        let mut lit = Lit::default();
        let mut others: [Option<&Lamp>; 16] = [None; 16];
        let mut count = 0;
        for lamp in &self.light.lamps {
            if matches!(lamp, Lamp::Sun { .. }) {
                self.lamp(lamp, surface, origin, places.next(), 1.0, &mut lit);
            } else if count < others.len() {
                others[count] = Some(lamp);
                count += 1;
            }
        }
        if count <= LAMPS {
            for lamp in others.into_iter().flatten() {
                self.lamp(lamp, surface, origin, places.next(), 1.0, &mut lit);
            }
            return lit;
        }
        let mut sums: [f32; 16] = [0.0; 16];
        let mut sum = 0.0;
        for (lamp, upto) in others.iter().flatten().zip(&mut sums) {
            // Drawn by their light from the middle, if nothing were in the way; none is left out for being behind something.
            let middle = lamp.sample(surface.point, [0.5; 2]);
            let facing = |s: Sample| s.colour.element_sum() * s.direction.dot(surface.normal).max(0.1) as f32;
            sum += middle.map_or(0.0, facing) + 1e-3;
            *upto = sum;
        }
        for _ in 0..LAMPS {
            let [choice, _] = places.next();
            let place = sums[..count].partition_point(|&s| s <= choice as f32 * sum).min(count - 1);
            let before = if place == 0 { 0.0 } else { sums[place - 1] };
            let weight = sum / (sums[place] - before) / LAMPS as f32;
            if let Some(lamp) = others[place] {
                self.lamp(lamp, surface, origin, places.next(), weight, &mut lit);
            }
        }
        lit
    }

    fn lamp(&self, lamp: &Lamp, surface: &Surface, origin: DVec3, place: [f64; 2], weight: f32, lit: &mut Lit) {
        let Some(sample) = lamp.sample(surface.point, place) else {
            return;
        };
        let cosine = sample.direction.dot(surface.normal);
        if cosine <= 0.0 || sample.direction.dot(surface.face) <= 0.0 {
            return;
        }
        if self.geometry.blocked(&Ray { origin, direction: sample.direction }, 0.0, sample.distance) {
            return;
        }
        let light = Vec3A::from(sample.colour * (cosine as f32 * weight));
        lit.lamps += light;
        let material = surface.material;
        // Where reflected rays are cast, they show panels; small lamps they would miss.
        let small = !matches!(lamp, Lamp::Panel { .. });
        if material.gloss > 0.0 && material.rough < 0.9 && (small || material.rough >= 0.4) {
            let half = (sample.direction + surface.towards_viewer).normalize_or_zero();
            let power = 2.0 / (material.rough * material.rough).max(1e-3);
            let lobe = (half.dot(surface.normal).max(0.0) as f32).powf(power) * (power + 8.0) / 8.0;
            lit.shine += light * lobe.min(15.0) * fresnel(material.gloss, half.dot(surface.towards_viewer));
        }
    }

    /// Light along a ray from a surface: the sky, or a guess of what the thing it meets sends back.
    fn incoming(&self, ray: &Ray, open: bool, places: &mut Places) -> Vec3 {
        let Some(hit) = self.geometry.cast(ray, 0.0, 1e3) else {
            return if open { self.light.sky.smooth(ray.direction.normalize().as_vec3()) } else { Vec3::ZERO };
        };
        let (solid, _) = self.geometry.instance(hit.instance);
        let material = &self.materials[solid.mesh.slots[hit.triangle as usize] as usize];
        let mut face = self.geometry.face_normal(&hit);
        if face.dot(ray.direction) > 0.0 {
            face = -face;
        }
        let mut light = self.light.fill;
        let lamps = &self.light.lamps;
        if !lamps.is_empty() {
            let [choice, _] = places.next();
            let lamp = &lamps[((choice * lamps.len() as f64) as usize).min(lamps.len() - 1)];
            let point = ray.at(hit.t) + face * LIFT;
            if let Some(sample) = lamp.sample(point, places.next()) {
                let cosine = sample.direction.dot(face) as f32;
                let to = Ray { origin: point, direction: sample.direction };
                if cosine > 0.0 && !self.geometry.blocked(&to, 0.0, sample.distance) {
                    light += (sample.colour * cosine * lamps.len() as f32).min(Vec3::splat(BOUNCE));
                }
            }
        }
        let mean = material.mean();
        mean * light + mean * material.glow
    }

    /// Light from a surface to the camera.
    fn seen(&self, surface: &Surface, lit: Lit) -> Vec3 {
        let (light, shine) = (Vec3::from(lit.lamps + lit.around), Vec3::from(lit.shine));
        let colour = surface.colour * light + shine + surface.colour * surface.material.glow;
        match self.light.fog {
            None => colour,
            Some((fog, density)) => fog + (colour - fog) * (-density * surface.depth as f32).exp(),
        }
    }

    fn sky(&self, view: &View, at: DVec2) -> Vec3 {
        let direction = view.ray(at).direction.normalize().as_vec3();
        let colour = self.light.sky.seen(direction, (1.0 / view.focal.x) as f32);
        match self.light.fog {
            Some((fog, density)) => colour.lerp(fog, (density * 60.0).min(0.9) * (1.0 - direction.z.max(0.0))),
            None => colour,
        }
    }

    /// Light at a point between pixels, with the irradiance of the pixel around that is most like it.
    fn between(
        &self,
        view: &View,
        at: DVec2,
        surfaces: &[Option<(Surface, Lit)>],
        smooth: &[Lit],
        index: usize,
    ) -> Vec3 {
        let Some(hit) = self.geometry.cast(&view.ray(at), 0.0, f64::INFINITY) else {
            return self.sky(view, at);
        };
        let surface = self.surface(view, at, &hit);
        let [width, height] = view.size;
        let (column, row) = (index % width, index / width);
        let mut best: Option<(f64, usize)> = None;
        for y in row.saturating_sub(1)..(row + 2).min(height) {
            for x in column.saturating_sub(1)..(column + 2).min(width) {
                let near = y * width + x;
                let Some((other, _)) = &surfaces[near] else {
                    continue;
                };
                let alike = other.normal.dot(surface.normal) - other.point.distance(surface.point) / surface.depth;
                if other.key == surface.key && alike > 0.7 && best.is_none_or(|(most, _)| alike > most) {
                    best = Some((alike, near));
                }
            }
        }
        let lit = match best {
            Some((_, near)) => smooth[near],
            None => self.lit(&surface, Places::new(self.seed ^ 0x5eed, column, row)),
        };
        self.seen(&surface, lit)
    }
}

/// Whether two pixels lie on the same surface, so that they may share light.
fn is_alike(own: &Surface, other: &Surface) -> bool {
    let away = (other.point - own.point).dot(own.face).abs();
    other.key == own.key && other.normal.dot(own.normal) > 0.9 && away < 0.02 * own.depth
}

/// The mean over 4 x 4 neighbours on the same surface, of which none counts for more than thrice the mean.
fn smoothed(surfaces: &[Option<(Surface, Lit)>], width: usize, index: usize) -> Lit {
    let Some((own, lit)) = &surfaces[index] else {
        return Lit::default();
    };
    let (column, row, height) = (index % width, index / width, surfaces.len() / width);
    let (mut alike, mut count) = ([lit; 16], 0);
    for y in row.saturating_sub(2)..(row + 2).min(height) {
        for x in column.saturating_sub(2)..(column + 2).min(width) {
            if let Some((other, lit)) = &surfaces[y * width + x]
                && is_alike(own, other)
            {
                alike[count] = lit;
                count += 1;
            }
        }
    }
    // A pixel of a curved silhouette may be unlike itself by rounding.
    if count == 0 {
        return *lit;
    }
    let mean = |sum: Lit| sum.map(|sum| sum / count as f32);
    let alike = &alike[..count];
    let plain = mean(alike.iter().fold(Lit::default(), |sum, &&lit| sum.with(lit, |sum, v| sum + v)));
    let most = plain.map(|plain| plain * 3.0);
    let limited = alike.iter().map(|lit| lit.with(most, Vec3A::min));
    let mean = mean(limited.fold(Lit::default(), |sum, lit| sum.with(lit, |sum, v| sum + v)));
    // Sharp reflections would be smeared.
    if own.material.rough < 0.1 { Lit { shine: lit.shine, ..mean } } else { mean }
}

/// Averages light from around once more, over pixels `step` apart: it has no sharp shadows.
fn spread(surfaces: &[Option<(Surface, Lit)>], smooth: &[Lit], width: usize, step: usize, index: usize) -> Lit {
    let Some((own, _)) = &surfaces[index] else {
        return Lit::default();
    };
    let (column, row, height) = (index % width, index / width, surfaces.len() / width);
    let (mut sum, mut count) = (smooth[index].around, 1.0);
    for dy in -1..=1_isize {
        for dx in -1..=1_isize {
            let place = |v: usize, d: isize| v.checked_add_signed(d * step as isize);
            let (Some(x), Some(y)) = (place(column, dx), place(row, dy)) else {
                continue;
            };
            if x >= width || y >= height || (dx, dy) == (0, 0) {
                continue;
            }
            if let Some((other, _)) = &surfaces[y * width + x]
                && is_alike(own, other)
            {
                sum += smooth[y * width + x].around;
                count += 1.0;
            }
        }
    }
    Lit { around: sum / count, ..smooth[index] }
}

fn is_edge(surfaces: &[Option<(Surface, Lit)>], width: usize, index: usize) -> bool {
    let (column, row, height) = (index % width, index / width, surfaces.len() / width);
    let differs = |other: usize| match (&surfaces[index], &surfaces[other]) {
        (None, None) => false,
        (Some((a, _)), Some((b, _))) => {
            let away = (b.point - a.point).dot(a.face).abs();
            a.key != b.key || a.normal.dot(b.normal) < 0.85 || away > 0.05 * a.depth
        }
        _ => true,
    };
    (column > 0 && differs(index - 1))
        || (column + 1 < width && differs(index + 1))
        || (row > 0 && differs(index - width))
        || (row + 1 < height && differs(index + width))
}

fn fresnel(gloss: f32, cosine: f64) -> f32 {
    gloss + (1.0 - gloss) * (1.0 - cosine.clamp(0.0, 1.0) as f32).powi(5)
}

/// A direction with probability proportional to its cosine with the normal.
fn hemisphere(normal: DVec3, [u, v]: [f64; 2]) -> DVec3 {
    let (side, other) = normal.any_orthonormal_pair();
    let (sin, cos) = (u * std::f64::consts::TAU).sin_cos();
    let radius = v.sqrt();
    side * (radius * cos) + other * (radius * sin) + normal * (1.0 - v).sqrt()
}

/// Pairs of random numbers of a pixel; the k-th pairs of a block of 4 x 4 pixels lie one in each cell of a 4 x 4 grid.
struct Places {
    key: u64,
    cell: u64,
    drawn: u64,
}

impl Places {
    fn new(seed: u64, column: usize, row: usize) -> Self {
        let cell = ((row & 3) << 2 | column & 3) as u64;
        Self { key: mix(seed ^ mix((row as u64) << 32 | column as u64)), cell, drawn: 0 }
    }

    fn next(&mut self) -> [f64; 2] {
        self.drawn += 1;
        let bits = mix(self.key.wrapping_add(self.drawn.wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        // An odd multiple and a shift make another order of the cells for every draw.
        let cell = self.cell * (2 * self.drawn + 1) + 5 * self.drawn * self.drawn;
        let unit = |bits: u64| (bits & 0xffff_ffff) as f64 / 4_294_967_296.0;
        [((cell & 3) as f64 + unit(bits)) / 4.0, ((cell >> 2 & 3) as f64 + unit(bits >> 32)) / 4.0]
    }
}
