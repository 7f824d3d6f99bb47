//! OpenCV's area and cubic resampling of 8-bit RGB (`INTER_AREA`, `INTER_CUBIC`), to its rounding.
//!
//! Area: output pixel o covers the input interval `[o*s, (o+1)*s)`, `s = n_in/n_out`; separable overlap weights in f32, rounded
//! half to even; whole ratios sum in integers; a ratio of exactly 2 in both directions rounds halves up.
//! Cubic: half-pixel centres, Keys kernel with a = -0.75, borders replicated, rounded half to even; sums in f64, which differ from
//! OpenCV 4.10 and 5.0 by one level in about 1 of 100,000 samples.

use rayon::prelude::*;

use crate::Picture;

/// Shrinks a picture by area averaging; no side may grow.
#[must_use]
pub fn resize_area(picture: &Picture, width: u32, height: u32) -> Picture {
    assert!(width <= picture.width && height <= picture.height, "BUG: the area filter only shrinks");
    if picture.width.is_multiple_of(width) && picture.height.is_multiple_of(height) {
        return area_whole(picture, width, height);
    }
    let columns = area_taps(picture.width, width);
    let rows = area_taps(picture.height, height);
    let stride = picture.width as usize * 3;
    let mut data = vec![0u8; width as usize * height as usize * 3];
    data.par_chunks_mut(width as usize * 3).zip(&rows).for_each(|(out, taps)| {
        let mut sums = vec![0f32; out.len()];
        for &(row, row_weight) in taps {
            let line = &picture.data[row * stride..(row + 1) * stride];
            for (sum, taps) in sums.chunks_exact_mut(3).zip(&columns) {
                let mut pixel = [0f32; 3];
                for &(column, weight) in taps {
                    for (channel, value) in pixel.iter_mut().enumerate() {
                        *value += f32::from(line[column * 3 + channel]) * weight;
                    }
                }
                for (sum, value) in sum.iter_mut().zip(pixel) {
                    *sum += value * row_weight;
                }
            }
        }
        for (out, sum) in out.iter_mut().zip(sums) {
            *out = sum.round_ties_even() as u8;
        }
    });
    Picture::new(width, height, data)
}

/// Input positions and weights of every output position. Overlaps below a thousandth of a pixel are left out, as in OpenCV.
fn area_taps(size_in: u32, size_out: u32) -> Vec<Vec<(usize, f32)>> {
    const SLIVER: f64 = 1e-3;
    let scale = f64::from(size_in) / f64::from(size_out);
    let size_in = size_in as usize;
    (0..size_out)
        .map(|o| {
            let from = f64::from(o) * scale;
            let to = from + scale;
            let cell = scale.min(size_in as f64 - from);
            let last = (to.floor() as usize).min(size_in - 1);
            let first = (from.ceil() as usize).min(last);
            let mut taps = Vec::with_capacity(last - first + 2);
            if first as f64 - from > SLIVER {
                taps.push((first - 1, ((first as f64 - from) / cell) as f32));
            }
            taps.extend((first..last).map(|i| (i, (1.0 / cell) as f32)));
            if to - last as f64 > SLIVER {
                taps.push((last, ((to - last as f64).min(1.0).min(cell) / cell) as f32));
            }
            taps
        })
        .collect()
}

/// Area averaging for whole ratios: integer sums.
fn area_whole(picture: &Picture, width: u32, height: u32) -> Picture {
    let (nx, ny) = ((picture.width / width) as usize, (picture.height / height) as usize);
    let stride = picture.width as usize * 3;
    let scale = 1.0 / (nx * ny) as f32;
    let mut data = vec![0u8; width as usize * height as usize * 3];
    data.par_chunks_mut(width as usize * 3).enumerate().for_each(|(y, line)| {
        for (x, pixel) in line.chunks_exact_mut(3).enumerate() {
            for (channel, out) in pixel.iter_mut().enumerate() {
                let mut sum = 0u32;
                for row in y * ny..(y + 1) * ny {
                    let start = row * stride + x * nx * 3 + channel;
                    sum += (0..nx).map(|i| u32::from(picture.data[start + i * 3])).sum::<u32>();
                }
                *out = if (nx, ny) == (2, 2) {
                    ((sum + 2) >> 2) as u8
                } else {
                    (sum as f32 * scale).round_ties_even() as u8
                };
            }
        }
    });
    Picture::new(width, height, data)
}

/// Resamples a picture by cubic convolution; meant for growing, does not smooth when a side shrinks.
#[must_use]
pub fn resize_cubic(picture: &Picture, width: u32, height: u32) -> Picture {
    let columns = cubic_taps(picture.width, width);
    let rows = cubic_taps(picture.height, height);
    let stride = picture.width as usize * 3;
    let mut data = vec![0u8; width as usize * height as usize * 3];
    data.par_chunks_mut(width as usize * 3).zip(&rows).for_each(|(out, (row_at, row_weights))| {
        // Rows first: one line of sums, then its columns.
        let mut line = vec![0f64; stride];
        for (&row, &weight) in row_at.iter().zip(row_weights) {
            for (sum, &value) in line.iter_mut().zip(&picture.data[row * stride..(row + 1) * stride]) {
                *sum += f64::from(value) * weight;
            }
        }
        for (pixel, (column_at, weights)) in out.chunks_exact_mut(3).zip(&columns) {
            for (channel, out) in pixel.iter_mut().enumerate() {
                let sum: f64 = column_at.iter().zip(weights).map(|(&c, w)| line[c * 3 + channel] * w).sum();
                *out = sum.round_ties_even().clamp(0.0, 255.0) as u8;
            }
        }
    });
    Picture::new(width, height, data)
}

/// Four input positions and their weights for every output position.
fn cubic_taps(size_in: u32, size_out: u32) -> Vec<([usize; 4], [f64; 4])> {
    let scale = f64::from(size_in) / f64::from(size_out);
    (0..size_out)
        .map(|o| {
            let source = (f64::from(o) + 0.5) * scale - 0.5;
            let base = source.floor();
            let at = [-1i64, 0, 1, 2].map(|d| (base as i64 + d).clamp(0, i64::from(size_in) - 1) as usize);
            (at, keys(source - base))
        })
        .collect()
}

/// Keys kernel, a = -0.75, at distances 1+f, f, 1-f, 2-f; the last one makes the sum 1.
fn keys(f: f64) -> [f64; 4] {
    const A: f64 = -0.75;
    let outer = ((A * (f + 1.0) - 5.0 * A) * (f + 1.0) + 8.0 * A) * (f + 1.0) - 4.0 * A;
    let inner = |x: f64| ((A + 2.0) * x - (A + 3.0)) * x * x + 1.0;
    let (near, far) = (inner(f), inner(1.0 - f));
    [outer, near, far, 1.0 - outer - near - far]
}
