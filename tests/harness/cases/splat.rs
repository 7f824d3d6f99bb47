//! Cases of `splat`.

use omnix_kernels::splat::{Splat, VIEW_WORDS, Y, view};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// What the points of a case are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Places, radii and camera in powers of two and few bits, so that a device finds what f64 finds, at every edge.
    Exact,
    /// Any places, a camera that is turned, a background that is half there.
    Any,
    /// A wall of points a pixel apart, in the order of rows, as depth gives them.
    Wall,
}

/// A call for points of a kind.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// The specification.
    pub spec: Splat,
    /// Its points.
    pub look: Look,
}

impl Seen {
    /// World positions and radii.
    #[must_use]
    pub fn points(&self) -> (Vec<f32>, Vec<f32>) {
        let Splat { n, width, .. } = self.spec;
        let mut rng = Rng::new(u64::from(n + width));
        let (mut points, mut sizes) = (Vec::new(), Vec::new());
        for i in 0..n {
            let mut part = |of: u32| f64::from(rng.bits() as u32 % of) / f64::from(of);
            let (x, y, z, size) = match self.look {
                // Depths 1, 2, 4 and 8 a little beyond the picture; radii of 0.75 to 4 pixels, some of them of the picture.
                Look::Exact => {
                    let z = f64::from(1u32 << (4.0 * part(4)) as u32);
                    let (x, y) = ((1.25 * part(256) - 0.625) * z, (1.25 * part(256) - 0.625) * z);
                    let size = 0.75 + 3.25 * part(13);
                    (x, y, z, if part(8) == 0.0 { -size } else { size * z / 32.0 })
                }
                Look::Any => {
                    let z = 1.0 + 5.0 * part(9973);
                    let size = 0.6 + 3.0 * part(997);
                    (3.0 * part(9973) - 1.5, 3.0 * part(9973) - 1.5, z, size * z / 30.0)
                }
                Look::Wall => {
                    let columns = f64::from(n).sqrt().ceil();
                    let (x, y) = (f64::from(i) % columns / columns, (f64::from(i) / columns).floor() / columns);
                    (x - 0.5, y - 0.5, 1.0 + 0.2 * x + 0.001 * part(97), 0.6 / columns)
                }
            };
            points.extend([x, y, z].map(|v| v as f32));
            sizes.push(size as f32);
        }
        // Points that are nowhere, or behind the camera.
        if n > 8 {
            points[3] = f32::NAN;
            points[8] = f32::INFINITY;
            points[11] = -1.0;
            points[14] = 0.0;
        }
        (points, sizes)
    }

    /// The camera.
    #[must_use]
    pub fn view(&self) -> [f32; VIEW_WORDS] {
        let (width, height) = (self.spec.width as f32, self.spec.height as f32);
        let straight = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let (sin, cos) = 0.3f32.sin_cos();
        let turned = [[cos, 0.0, -sin, 0.25], [0.0, 1.0, 0.0, -0.1], [sin, 0.0, cos, 0.5]];
        match self.look {
            Look::Exact => view(&straight, [32.0, 0.0, width / 2.0, 32.0, height / 2.0], 0.5, 0.125, [0.0; 4]),
            Look::Any => view(&turned, [30.0, 1.5, width * 0.45, 34.0, height * 0.52], 0.1, 0.02, [0.1, 0.2, 0.3, 0.5]),
            Look::Wall => view(&straight, [width, 0.0, width / 2.0, width, height / 2.0], 0.1, 0.01, [1.0; 4]),
        }
    }
}

impl Call for Seen {
    fn kernel(&self) -> &'static str {
        "splat"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let (points, sizes) = self.points();
        let mut rng = Rng::new(7);
        let colours = (0..self.spec.n).map(|_| rng.bits() as u32 & 0x00ff_ffff).collect();
        let scratch = self.spec.scratch_words() as usize;
        vec![
            Values::F32(points),
            Values::F32(sizes),
            Values::U32(colours),
            Values::F32(self.view().to_vec()),
            Values::Out((self.spec.width * self.spec.height * 4) as usize),
            Values::Out(scratch),
            Values::Out(scratch),
        ]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let y = cpu::splat(&self.spec, args[0].f32(), args[1].f32(), args[2].u32(), args[3].f32());
        vec![(Y, Values::F32(y))]
    }

    /// Where rounding decides whether a sample is inside of a disc, a quarter of a pixel is at stake.
    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        if self.look == Look::Exact { 1e-3 } else { 1e-2 }
    }

    fn work(&self) -> Work {
        Work::Bytes(self.spec.bytes())
    }
}

/// One point and one pixel, none, odd sizes, above a workgroup, large discs; then a million points.
#[must_use]
pub fn cases() -> Vec<Case> {
    let shapes = [[0, 3, 2], [1, 1, 1], [9, 7, 5], [65, 33, 20], [700, 64, 36], [1500, 100, 3]];
    let mut cases = Vec::new();
    for look in [Look::Exact, Look::Any] {
        for [n, width, height] in shapes {
            for largest in [2, 8] {
                cases.push(Case::test(Seen { spec: Splat { n, width, height, largest }, look }));
            }
        }
    }
    cases.push(Case::test(Seen { spec: Splat { n: 2500, width: 60, height: 40, largest: 16 }, look: Look::Wall }));
    let spec = Splat { n: 1_000_000, width: 1280, height: 720, largest: 16 };
    cases.push(Case::bench("1000000 points at 1280x720", Seen { spec, look: Look::Wall }));
    cases
}
