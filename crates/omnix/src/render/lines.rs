//! Lines as rows of small discs: hidden by what is in front of them and smoothed as all discs are.

use omnix_geometry::{Camera, camera_centre};

use super::renderer::Shot;

/// A straight line in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Its two ends.
    pub ends: [[f32; 3]; 2],
    /// Their colours.
    pub colours: [[u8; 3]; 2],
    /// How wide it is there, in pixels.
    pub widths: [f32; 2],
}

/// Discs, as [`super::Renderer`] takes them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dots {
    /// World positions.
    pub positions: Vec<[f32; 3]>,
    /// Radii in pixels, negative.
    pub sizes: Vec<f32>,
    /// Red + 256 green + 65536 blue.
    pub colours: Vec<u32>,
}

/// Distance of two discs of a line, in pixels.
const STEP: f64 = 0.4;
/// How much nearer to the camera a disc is than its line, as a share of the distance: what lies on a surface shows.
const LIFT: f64 = 0.03;

/// A line as a camera sees it.
struct Seen {
    line: usize,
    /// The part of the line that is in the picture, from 0 at the first end to 1, along the picture.
    part: [f64; 2],
    /// Depths of its two ends, where it is cut off near the camera if need be, and the part of the line that this is.
    depths: [f64; 2],
    cut: [f64; 2],
    pixels: f64,
}

/// The discs of the lines in a picture of `[width, height]`: `most` at most, farther apart if that is too few.
#[must_use]
pub fn dots(lines: &[Line], shot: &Shot, size: [u32; 2], most: usize) -> Dots {
    let seen: Vec<Seen> = lines.iter().enumerate().filter_map(|(i, line)| look(i, line, shot, size)).collect();
    let length: f64 = seen.iter().map(|line| line.pixels).sum();
    let room = most.saturating_sub(2 * seen.len()).max(1) as f64;
    let step = STEP.max(length / room);
    let centre = camera_centre(&shot.camera.extrinsics).map(f64::from);
    let mut dots = Dots::default();
    for seen in seen {
        let line = &lines[seen.line];
        let count = (seen.pixels / step).ceil() as usize;
        for k in 0..=count {
            if dots.sizes.len() == most {
                return dots;
            }
            let along = k as f64 / count.max(1) as f64;
            let s = seen.part[0] + (seen.part[1] - seen.part[0]) * along;
            // Equal steps in the picture are not equal in the world.
            let [near, far] = seen.depths;
            let t = s * near / (far + s * (near - far));
            let t = seen.cut[0] + (seen.cut[1] - seen.cut[0]) * t;
            let mix = |[a, b]: [f64; 2]| a + (b - a) * t;
            dots.positions.push(std::array::from_fn(|c| {
                let place = mix(line.ends.map(|end| f64::from(end[c])));
                (place + (centre[c] - place) * LIFT) as f32
            }));
            dots.sizes.push((-0.5 * mix(line.widths.map(f64::from))) as f32);
            let channel = |c: usize| mix(line.colours.map(|colour| f64::from(colour[c]))).round() as u32;
            dots.colours.push(channel(0) | channel(1) << 8 | channel(2) << 16);
        }
    }
    dots
}

/// The part of a line that is before the camera and in the picture.
fn look(index: usize, line: &Line, shot: &Shot, size: [u32; 2]) -> Option<Seen> {
    let Camera { extrinsics, intrinsics } = &shot.camera;
    let camera = |point: [f32; 3]| -> [f64; 3] {
        std::array::from_fn(|r| {
            let row = extrinsics[r].map(f64::from);
            (0..3).map(|c| row[c] * f64::from(point[c])).sum::<f64>() + row[3]
        })
    };
    let ends = line.ends.map(camera);
    // A little beyond the nearest depth: discs are lifted towards the camera.
    let near = f64::from(shot.near) * 1.1;
    let (z0, z1) = (ends[0][2], ends[1][2]);
    if ends.as_flattened().iter().any(|v| !v.is_finite()) || z0.max(z1) <= near {
        return None;
    }
    let crossing = (near - z0) / (z1 - z0);
    let cut = [if z0 < near { crossing } else { 0.0 }, if z1 < near { crossing } else { 1.0 }];
    let at = |t: f64| -> [f64; 3] { std::array::from_fn(|c| ends[0][c] + (ends[1][c] - ends[0][c]) * t) };
    let ends = cut.map(at);
    let k = intrinsics.map(|row| row.map(f64::from));
    let pixel = |[x, y, z]: [f64; 3]| {
        let (u, v) = (x / z, y / z);
        [k[0][0] * u + k[0][1] * v + k[0][2], k[1][1] * v + k[1][2]]
    };
    let [a, b] = ends.map(pixel);
    let part = clip(a, b, size)?;
    let pixels = (b[0] - a[0]).hypot(b[1] - a[1]) * (part[1] - part[0]);
    Some(Seen { line: index, part, depths: [ends[0][2], ends[1][2]], cut, pixels })
}

/// The part of the way from `a` to `b` that is in the picture or near it (Liang and Barsky).
fn clip(a: [f64; 2], b: [f64; 2], size: [u32; 2]) -> Option<[f64; 2]> {
    const MARGIN: f64 = 8.0;
    let mut part = [0.0f64, 1.0];
    for axis in 0..2 {
        let (low, high) = (-MARGIN, f64::from(size[axis]) + MARGIN);
        let step = b[axis] - a[axis];
        if step == 0.0 {
            if !(low..=high).contains(&a[axis]) {
                return None;
            }
            continue;
        }
        let [first, last] = [(low - a[axis]) / step, (high - a[axis]) / step];
        part = [part[0].max(first.min(last)), part[1].min(first.max(last))];
    }
    (part[0] < part[1]).then_some(part)
}

#[cfg(test)]
mod tests {
    use omnix_geometry::IDENTITY_POSE;

    use super::*;

    fn shot() -> Shot {
        let intrinsics = [[100.0, 0.0, 50.0], [0.0, 100.0, 40.0], [0.0, 0.0, 1.0]];
        let camera = Camera { extrinsics: IDENTITY_POSE, intrinsics };
        Shot { camera, near: 0.1, layer: 0.01, background: [0.0; 4] }
    }

    fn line(from: [f32; 3], to: [f32; 3]) -> Line {
        Line { ends: [from, to], colours: [[255, 0, 0], [0, 0, 255]], widths: [2.0, 4.0] }
    }

    #[test]
    fn discs_are_even_in_the_picture() {
        let dots = dots(&[line([-1.0, 0.0, 2.0], [1.0, 0.5, 8.0])], &shot(), [100, 80], 10_000);
        let pixels: Vec<[f32; 2]> =
            dots.positions.iter().map(|[x, y, z]| [100.0 * x / z + 50.0, 100.0 * y / z + 40.0]).collect();
        assert!((pixels[0][0] - 0.0).abs() < 0.01 && (pixels[pixels.len() - 1][0] - 62.5).abs() < 0.01);
        for pair in pixels.windows(2) {
            let step = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            assert!((0.3..=0.41).contains(&step), "{step}");
        }
        assert_eq!((dots.colours[0], dots.sizes[0]), (255, -1.0));
        assert_eq!((dots.colours.last(), dots.sizes.last()), (Some(&(255 << 16)), Some(&-2.0)));
        // Nearer than the line itself.
        assert!((dots.positions[0][2] - 2.0 * 0.97).abs() < 1e-5);
    }

    #[test]
    fn what_is_not_seen_has_no_discs() {
        for unseen in [
            line([0.0, 0.0, -1.0], [1.0, 0.0, -5.0]),
            line([50.0, 0.0, 1.0], [60.0, 0.0, 1.0]),
            line([f32::NAN, 0.0, 1.0], [0.0, 0.0, 1.0]),
        ] {
            assert_eq!(dots(&[unseen], &shot(), [100, 80], 1000), Dots::default(), "{unseen:?}");
        }
        // From behind the camera to before it: only the part before.
        let through = dots(&[line([0.0, 0.01, -2.0], [0.0, 0.01, 2.0])], &shot(), [100, 80], 1000);
        assert!(!through.sizes.is_empty() && through.positions.iter().all(|p| p[2] > 0.1));
    }

    #[test]
    fn no_more_discs_than_there_is_room_for() {
        let lines: Vec<Line> = (0..50).map(|k| line([-1.0, k as f32 / 100.0, 2.0], [1.0, 0.0, 2.0])).collect();
        let dots = dots(&lines, &shot(), [100, 80], 700);
        assert!((500..=700).contains(&dots.sizes.len()), "{}", dots.sizes.len());
    }
}
