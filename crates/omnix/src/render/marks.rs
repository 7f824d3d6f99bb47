//! What is drawn beside the points: trails of what moves, and the frusta of cameras.

use omnix_geometry::{Camera, invert_pose};

use super::lines::Line;
use super::{Source, Stage};
use crate::error::OmnixError;

/// Width of a trail at its point, and at its end in the past, in pixels of a picture 720 pixels high.
const TRAIL: [f32; 2] = [2.6, 0.8];
/// Width of the lines of a frustum, and of that of the picture's own time.
const FRUSTUM: [f32; 2] = [1.6, 3.2];
/// Height of a frustum, as a share of the distance of what is seen.
const REACH: f32 = 0.05;
/// The edges of a frustum between its centre and its corners.
const EDGES: [[usize; 2]; 8] = [[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1]];
/// A path shorter than this share of the distance of what is seen has no trail.
const SHORTEST: f32 = 0.02;

/// Paths of some points that move, and frusta.
#[derive(Clone, Debug, Default)]
pub struct Marks {
    /// `[trail][time]`, with a colour for each.
    trails: Vec<(Vec<[f32; 3]>, [u8; 3])>,
    /// The corners of each camera's frustum, after its centre.
    frusta: Vec<[[f32; 3]; 5]>,
}

impl Marks {
    /// Trails of about `trails` of the points that move, and a frustum for each camera if `frusta`.
    ///
    /// # Errors
    /// Failures of the source.
    pub fn new(stage: &Stage, source: &dyn Source, trails: usize, frusta: bool) -> Result<Self, OmnixError> {
        let mut marks = Self::default();
        let times = stage.cameras().len();
        for (image, pixels) in
            stage.some_moving(trails).into_iter().filter(|(_, pixels)| trails > 0 && !pixels.is_empty())
        {
            let mut paths = vec![Vec::with_capacity(times); pixels.len()];
            for time in 0..times {
                let positions = source.positions(image, &pixels, time)?;
                paths.iter_mut().zip(positions).for_each(|(path, position)| path.push(position));
            }
            let far = |path: &[[f32; 3]]| length(path) >= SHORTEST * stage.distance();
            let width = stage.size()[0] as f32;
            let hue = |pixel: u32| hue((pixel as usize % stage.size()[0]) as f32 / width);
            marks.trails.extend(
                paths.into_iter().zip(&pixels).filter(|(path, _)| far(path)).map(|(path, pixel)| (path, hue(*pixel))),
            );
        }
        if frusta {
            marks.frusta =
                stage.cameras().iter().map(|camera| frustum(camera, stage.size(), REACH * stage.distance())).collect();
        }
        Ok(marks)
    }

    /// Number of trails.
    #[must_use]
    pub fn trails(&self) -> usize {
        self.trails.len()
    }

    /// Lines at a time: trails from `past` times ago, fading into `background`, and frusta, with the one of that time in front. `scale` is
    /// the picture's height over 720.
    #[must_use]
    pub fn lines(&self, time: f64, past: f64, background: [u8; 3], scale: f32) -> Vec<Line> {
        let mut lines = Vec::new();
        for (path, colour) in &self.trails {
            trail(path, *colour, (time, past), background, scale, &mut lines);
        }
        let count = self.frusta.len();
        for (index, corners) in self.frusta.iter().enumerate() {
            let own = (time - index as f64).abs() <= 0.5;
            let (colour, width) = if own {
                ([255, 140, 0], FRUSTUM[1])
            } else {
                (hue(0.55 + 0.35 * index as f32 / count.max(2) as f32), FRUSTUM[0])
            };
            let edge = |[a, b]: [usize; 2]| Line {
                ends: [corners[a], corners[b]],
                colours: [colour; 2],
                widths: [width * scale; 2],
            };
            lines.extend(EDGES.map(edge));
        }
        lines
    }
}

/// The pieces of a path between `past` times ago and a time.
fn trail(
    path: &[[f32; 3]],
    colour: [u8; 3],
    (time, past): (f64, f64),
    background: [u8; 3],
    scale: f32,
    lines: &mut Vec<Line>,
) {
    let start = (time - past).max(0.0);
    let at = |time: f64| {
        let low = (time.floor() as usize).min(path.len() - 1);
        let (a, b) = (path[low], path[(low + 1).min(path.len() - 1)]);
        std::array::from_fn(|c| a[c] + (b[c] - a[c]) * (time - low as f64) as f32)
    };
    let look = |at: f64| {
        let age = if past > 0.0 { ((time - at) / past) as f32 } else { 0.0 };
        let fade = |c: usize| f32::from(colour[c]) + (f32::from(background[c]) - f32::from(colour[c])) * 0.7 * age;
        ([0, 1, 2].map(|c| fade(c).round() as u8), (TRAIL[0] * (1.0 - age) + TRAIL[1] * age) * scale)
    };
    let mut from = start;
    while from < time {
        let to = (from.floor() + 1.0).min(time);
        let [(a, wide), (b, wider)] = [from, to].map(look);
        lines.push(Line { ends: [from, to].map(at), colours: [a, b], widths: [wide, wider] });
        from = to;
    }
}

fn length(path: &[[f32; 3]]) -> f32 {
    let step = |pair: &[[f32; 3]]| (0..3).map(|c| (pair[1][c] - pair[0][c]).powi(2)).sum::<f32>().sqrt();
    path.windows(2).map(step).filter(|step| step.is_finite()).sum()
}

/// Centre and the four corners of a camera's picture at a depth.
fn frustum(camera: &Camera, [width, height]: [usize; 2], depth: f32) -> [[f32; 3]; 5] {
    let [[fx, _, cx], [_, fy, cy], _] = camera.intrinsics;
    let c2w = invert_pose(&camera.extrinsics);
    let world = |[x, y, z]: [f32; 3]| c2w.map(|row| row[0] * x + row[1] * y + row[2] * z + row[3]);
    let corner = |x: usize, y: usize| world([(x as f32 - cx) / fx * depth, (y as f32 - cy) / fy * depth, depth]);
    [world([0.0; 3]), corner(0, 0), corner(width, 0), corner(width, height), corner(0, height)]
}

/// A bright colour of the wheel, 0 and 1 red.
fn hue(turn: f32) -> [u8; 3] {
    let sector = |n: f32| {
        let k = (n + turn * 6.0).rem_euclid(6.0);
        1.0 - 0.85 * k.min(4.0 - k).clamp(0.0, 1.0)
    };
    [5.0, 3.0, 1.0].map(|n| (sector(n) * 255.0).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trails_end_at_their_time_and_fade() {
        let path: Vec<[f32; 3]> = (0..5).map(|k| [k as f32, 0.0, 1.0]).collect();
        let marks = Marks { trails: vec![(path, [200, 0, 0])], frusta: Vec::new() };
        let lines = marks.lines(3.5, 2.0, [255; 3], 1.0);
        assert_eq!((lines[0].ends[0], lines[2].ends[1]), ([1.5, 0.0, 1.0], [3.5, 0.0, 1.0]));
        assert_eq!(lines.len(), 3);
        assert_eq!((lines[2].colours[1], lines[2].widths[1]), ([200, 0, 0], TRAIL[0]));
        assert_eq!((lines[0].colours[0], lines[0].widths[0]), ([239, 179, 179], TRAIL[1]));
        assert!(marks.lines(0.0, 2.0, [255; 3], 1.0).is_empty());
        assert_eq!(marks.lines(4.0, 100.0, [255; 3], 1.0).len(), 4);
    }

    #[test]
    fn a_frustum_has_the_picture_s_shape() {
        let intrinsics = [[50.0, 0.0, 50.0], [0.0, 50.0, 25.0], [0.0, 0.0, 1.0]];
        let camera = Camera { extrinsics: omnix_geometry::IDENTITY_POSE, intrinsics };
        assert_eq!(
            frustum(&camera, [100, 50], 2.0)[1..],
            [[-2.0, -1.0, 2.0], [2.0, -1.0, 2.0], [2.0, 1.0, 2.0], [-2.0, 1.0, 2.0]]
        );
    }
}
