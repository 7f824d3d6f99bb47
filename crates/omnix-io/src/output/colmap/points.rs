//! The points of a model: few, spread over each picture, and followed through the images that come later.

use glam::DVec3;

use super::model::Image;
use crate::output::camera::Camera;
use crate::output::frame::FrameResult;

/// Cells of a picture, about.
pub(super) const CELLS: usize = 2000;
/// Share of an image's pixels that are less sure than any that becomes a point.
const UNSURE: f64 = 0.4;
/// Depth of a point and of the pixel that it falls on may differ by this share.
const AGREE: f64 = 0.02;

/// A point in the making.
pub(super) struct Point {
    pub(super) position: DVec3,
    pub(super) colour: [u8; 3],
    /// Image, and the number of the observation in it.
    pub(super) track: Vec<(u32, u32)>,
}

/// All points so far.
#[derive(Default)]
pub(super) struct Cloud {
    points: Vec<Point>,
}

impl Cloud {
    /// Finds the points so far in an image, and adds those of the cells that show none. Where the image sees which points, in pixels of its
    /// maps.
    pub(super) fn add(
        &mut self,
        frame: &FrameResult<'_>,
        camera: &Camera,
        intrinsics: &[[f32; 3]; 3],
        number: u32,
    ) -> Vec<([f64; 2], u32)> {
        let (width, height) = (frame.width as usize, frame.height as usize);
        let side = ((width * height) as f64 / CELLS as f64).sqrt().ceil().max(1.0) as usize;
        let across = width.div_ceil(side);
        let cell = |u: usize, v: usize| v / side * across + u / side;
        let mut shown = vec![false; across * height.div_ceil(side)];
        let mut seen = Vec::new();
        for (k, point) in self.points.iter_mut().enumerate() {
            let at = camera.to_camera(point.position);
            let [u, v] = project(at, intrinsics);
            let (column, row) = (u.round(), v.round());
            if !(at.z > 0.0 && (0.0..width as f64).contains(&column) && (0.0..height as f64).contains(&row)) {
                continue;
            }
            let (column, row) = (column as usize, row as usize);
            let depth = depth(frame, row * width + column).map_or(f64::NAN, f64::from);
            if (depth - at.z).abs() <= AGREE * at.z {
                shown[cell(column, row)] = true;
                point.track.push((number, seen.len() as u32));
                seen.push(([u, v], k as u32));
            }
        }
        for pixel in surest(frame, side, &shown) {
            let (u, v) = (pixel % width, pixel / width);
            let Some(depth) = depth(frame, pixel) else { continue };
            let position = camera.to_world(camera.ray(u as f64, v as f64) * f64::from(depth));
            let colour = [0, 1, 2].map(|channel| frame.rgb[3 * pixel + channel]);
            let track = vec![(number, seen.len() as u32)];
            seen.push(([u as f64, v as f64], self.points.len() as u32));
            self.points.push(Point { position, colour, track });
        }
        seen
    }

    /// The points that at least two images agree on (all of a single image), numbered anew in the images that see them.
    pub(super) fn agreed(self, images: &mut [Image]) -> Vec<Point> {
        let least = images.len().min(2);
        let mut numbers = vec![None; self.points.len()];
        let mut kept = Vec::new();
        for (k, point) in self.points.into_iter().enumerate().filter(|(_, point)| point.track.len() >= least) {
            numbers[k] = Some(kept.len() as u32);
            kept.push(Point { track: Vec::with_capacity(point.track.len()), ..point });
        }
        for (image, number) in images.iter_mut().zip(0..) {
            image.seen.retain_mut(|(_, point)| numbers[*point as usize].map(|new| *point = new).is_some());
            for ((_, point), observation) in image.seen.iter().zip(0..) {
                kept[*point as usize].track.push((number, observation));
            }
        }
        kept
    }
}

/// The surest pixel of each cell that shows no point, where there is one that is sure enough.
fn surest(frame: &FrameResult<'_>, side: usize, shown: &[bool]) -> Vec<usize> {
    let (width, across) = (frame.width as usize, (frame.width as usize).div_ceil(side));
    let confidence = |pixel: usize| frame.confidence.map_or(1.0, |all| all[pixel]);
    let mut sorted: Vec<f32> = (0..frame.depth.len()).map(confidence).filter(|c| c.is_finite()).collect();
    let rank = ((sorted.len() as f64 * UNSURE) as usize).min(sorted.len().saturating_sub(1));
    let least = if sorted.is_empty() { 0.0 } else { *sorted.select_nth_unstable_by(rank, f32::total_cmp).1 };
    let mut best: Vec<Option<usize>> = vec![None; shown.len()];
    for pixel in (0..frame.depth.len()).filter(|&pixel| depth(frame, pixel).is_some() && confidence(pixel) >= least) {
        let cell = pixel / width / side * across + pixel % width / side;
        if !shown[cell] && best[cell].is_none_or(|known| confidence(pixel) > confidence(known)) {
            best[cell] = Some(pixel);
        }
    }
    best.into_iter().flatten().collect()
}

/// Depth of a pixel that is a point of the world.
fn depth(frame: &FrameResult<'_>, pixel: usize) -> Option<f32> {
    let depth = frame.depth[pixel];
    (depth.is_finite() && depth > 0.0 && !frame.sky.is_some_and(|sky| sky[pixel])).then_some(depth)
}

/// Pixel of a camera point.
fn project(at: DVec3, [[fx, _, cx], [_, fy, cy], _]: &[[f32; 3]; 3]) -> [f64; 2] {
    [f64::from(*fx) * at.x / at.z + f64::from(*cx), f64::from(*fy) * at.y / at.z + f64::from(*cy)]
}
