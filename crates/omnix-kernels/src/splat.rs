//! Coloured points as discs that close holes, seen by a pinhole camera: a picture `[height, width, 4]`.
//!
//! The nearest disc at four samples of every pixel, then the discs of that surface mixed, then pixels (`shaders/splat/`). Minima and
//! sums are of integers, so the order of the points changes no bit. The camera is data ([`VIEW`]), not part of the recording: one
//! recording serves every picture of a film. A large picture goes in bands of rows, each with its own passes over the points.

use omnix_shaders::splat as shaders;

use crate::cover::{cover, room};
use crate::layout::params;
use crate::{Arg, Caps, Dispatch, KernelError};

/// World positions `[n, 3]`. A point with a coordinate that is no finite number is not drawn.
pub const POINTS: Arg = Arg(0);
/// `[n]`: radius of the disc in units of the world; a negative number is a radius in pixels.
pub const SIZES: Arg = Arg(1);
/// u32 `[n]`: red + 256 green + 65536 blue.
pub const COLOURS: Arg = Arg(2);
/// [`VIEW_WORDS`] numbers, see [`view`].
pub const VIEW: Arg = Arg(3);
/// Output `[height, width, 4]`: red, green, blue, each times cover, and cover, from 0 to 1.
pub const Y: Arg = Arg(4);
/// Scratch of [`Splat::scratch_words`]: bits of the nearest depth.
pub const DEPTH: Arg = Arg(5);
/// Scratch of [`Splat::scratch_words`]: colours times shares, and shares.
pub const SUMS: Arg = Arg(6);

/// Numbers of [`VIEW`].
pub const VIEW_WORDS: usize = 24;

/// Pixels of a band at most, unless a row has more: what a picture of 1920 x 1080 has.
const BAND: u64 = 1920 * 1080;
/// Samples of a pixel.
const SAMPLES: u64 = 4;
/// Operations on a sample of a disc, about.
const SAMPLE_OPERATIONS: u64 = 8;

params! {
    /// `Params` of the shaders; they explain the members.
    pub struct SplatParams {
        n: u32,
        first: u32,
        width: u32,
        row: u32,
        rows: u32,
        points_rest: u32,
        sizes_rest: u32,
        colours_rest: u32,
        y_rest: u32,
        largest: f32,
        pad0: u32,
        pad1: u32,
    }
}

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Splat {
    /// Points.
    pub n: u32,
    /// Columns of the picture.
    pub width: u32,
    /// Rows of the picture.
    pub height: u32,
    /// The largest radius of a disc in pixels, 1 to [`Splat::LARGEST`]; larger discs are cut to it.
    pub largest: u32,
}

/// A camera and what lies behind the points, as [`VIEW`] holds them: world-to-camera `[R|t]`; fx, skew, cx, fy, cy in pixels, the pixel of
/// column x with its centre at x + 0.5; the depth below which nothing is drawn (above 0); how far behind the nearest disc, as a share of
/// its depth, another still belongs to the same surface; the background's red, green, blue times cover, and cover.
#[must_use]
pub fn view(
    pose: &[[f32; 4]; 3],
    [fx, skew, cx, fy, cy]: [f32; 5],
    near: f32,
    layer: f32,
    background: [f32; 4],
) -> [f32; VIEW_WORDS] {
    let mut view = [0.0; VIEW_WORDS];
    view[..12].copy_from_slice(pose.as_flattened());
    view[12..19].copy_from_slice(&[fx, skew, cx, fy, cy, near, layer]);
    view[20..].copy_from_slice(&background);
    view
}

impl Splat {
    /// The largest radius that can be asked for: what bounds the loops of a point.
    pub const LARGEST: u32 = 64;
    /// Most columns and rows of a picture.
    pub const LARGEST_SIDE: u32 = 16_384;

    /// Rows of a band at most.
    const fn band(&self) -> u64 {
        let rows = BAND / self.width as u64;
        let rows = if rows == 0 { 1 } else { rows };
        if rows < self.height as u64 { rows } else { self.height as u64 }
    }

    /// 32-bit words of [`DEPTH`], and of [`SUMS`].
    #[must_use]
    pub const fn scratch_words(&self) -> u64 {
        self.band() * self.width as u64 * SAMPLES
    }

    /// Operations of a point at most.
    const fn operations(&self) -> u64 {
        let side = 2 * self.largest as u64 + 2;
        side * side * SAMPLES * SAMPLE_OPERATIONS
    }

    /// Bytes read and written where no disc is larger than a pixel: points in both passes, scratch and picture.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        let pixels = self.width as u64 * self.height as u64;
        self.n as u64 * 36 + pixels * (16 * 4 + 16)
    }

    /// Whether sizes are possible.
    ///
    /// # Errors
    /// A picture without pixels or with too large a side, a radius out of range.
    pub fn check(&self) -> Result<(), KernelError> {
        let wrong = |reason: String| Err(KernelError::Unsupported { kernel: "splat", reason });
        let Self { width, height, largest, .. } = *self;
        if [width, height].iter().any(|side| !(1..=Self::LARGEST_SIDE).contains(side)) {
            return wrong(format!("a picture of {width}x{height}; sides of 1 to {} are possible", Self::LARGEST_SIDE));
        }
        if !(1..=Self::LARGEST).contains(&largest) {
            return wrong(format!("radii up to {largest} pixels; 1 to {} are possible", Self::LARGEST));
        }
        Ok(())
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// As [`Splat::check`], or a row larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.check()?;
        let kernel = "splat";
        let (width, height) = (u64::from(self.width), u64::from(self.height));
        let band = self.band().min(room(caps) / (width * SAMPLES));
        if band == 0 {
            return Err(KernelError::RowTooLarge { kernel, bytes: width * SAMPLES * 4, limit: caps.max_binding });
        }
        // Points of a dispatch: what a window holds, and what does not last too long.
        let most = (room(caps) / 3).min(crate::dispatch::MAX_OPERATIONS / self.operations()).max(1);
        let mut out = Vec::new();
        for row in (0..height).step_by(band as usize) {
            let rows = band.min(height - row);
            let pixels = rows * width;
            let [depth, sums] = [DEPTH, SUMS].map(|arg| arg.window(0, pixels * SAMPLES * 4));
            let mut params = SplatParams {
                n: 0,
                first: 0,
                width: self.width,
                row: row as u32,
                rows: rows as u32,
                points_rest: 0,
                sizes_rest: 0,
                colours_rest: 0,
                y_rest: 0,
                largest: self.largest as f32,
                pad0: 0,
                pad1: 0,
            };
            out.push(Dispatch::new(&shaders::CLEAR, &params, &[depth, sums], pixels.div_ceil(64)));
            let (mut front, mut mixed) = (Vec::new(), Vec::new());
            for first in (0..u64::from(self.n)).step_by(most as usize) {
                let n = most.min(u64::from(self.n) - first);
                let (points, points_rest) = cover(POINTS, first * 3, n * 3, caps);
                let (sizes, sizes_rest) = cover(SIZES, first, n, caps);
                let (colours, colours_rest) = cover(COLOURS, first, n, caps);
                (params.n, params.first) = (n as u32, first as u32);
                (params.points_rest, params.sizes_rest, params.colours_rest) = (points_rest, sizes_rest, colours_rest);
                let (view, groups, operations) = (VIEW.into(), n.div_ceil(64), n * self.operations());
                let dispatch = Dispatch::new(&shaders::DEPTH, &params, &[points, sizes, view, depth], groups);
                front.push(dispatch.of_operations(operations));
                let windows = [points, sizes, view, colours, depth, sums];
                mixed.push(Dispatch::new(&shaders::BLEND, &params, &windows, groups).of_operations(operations));
            }
            // All points before any is mixed: only then the front is known.
            out.append(&mut front);
            out.append(&mut mixed);
            let (y, y_rest) = cover(Y, row * width * 4, pixels * 4, caps);
            params.y_rest = y_rest;
            out.push(Dispatch::new(&shaders::RESOLVE, &params, &[VIEW.into(), depth, sums, y], pixels.div_ceil(64)));
        }
        Ok(out)
    }
}
