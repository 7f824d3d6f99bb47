//! The film, image after image: each once, in the world of its part, without seams.

use std::path::{Path, PathBuf};

use omnix_geometry::{Camera, Similarity, fade_cameras};

use super::chain::Chain;
use super::layout::{Layout, Source};
use super::stored::{StoredWindow, WindowImage, window_path};
use crate::error::OmnixError;

/// What is known of one image of a film.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmImage {
    /// Depth along the camera's z axis, `[height, width]`, in the scale of the image's part.
    pub depth: Vec<f32>,
    /// Confidence of each depth.
    pub confidence: Vec<f32>,
    /// Motion score of each pixel, of networks that have one.
    pub theta: Option<Vec<f32>>,
    /// World-to-camera pose in the world of the image's part, and intrinsics.
    pub camera: Camera,
}

/// A film whose windows are finished and in their places.
#[derive(Debug)]
pub struct Film<'a> {
    layout: &'a Layout,
    chain: &'a Chain,
    folder: PathBuf,
    size: [usize; 2],
    /// Windows that are open, with their numbers: those of the last image.
    open: Vec<(usize, StoredWindow)>,
}

impl<'a> Film<'a> {
    /// The film of the windows in `folder`, of images of `[height, width]`.
    #[must_use]
    pub fn new(layout: &'a Layout, chain: &'a Chain, folder: &Path, size: [usize; 2]) -> Self {
        Self { layout, chain, folder: folder.to_owned(), size, open: Vec::new() }
    }

    /// Image `image` of the film.
    ///
    /// # Errors
    /// A window that cannot be read.
    pub fn image(&mut self, image: usize) -> Result<FilmImage, OmnixError> {
        match self.layout.source(image) {
            Source::One(k) => self.of_window(k, image),
            Source::Two(k, part) if self.chain.seams()[k].outcome.is_ok() => {
                let (earlier, later) = (self.of_window(k, image)?, self.of_window(k + 1, image)?);
                Ok(fade(&earlier, &later, part))
            }
            Source::Two(k, _) => {
                let border = self.chain.parts()[self.chain.placements()[k].part].end;
                self.of_window(if image < border { k } else { k + 1 }, image)
            }
        }
    }

    /// The image as window `k` has it, in the world of its part.
    fn of_window(&mut self, k: usize, image: usize) -> Result<FilmImage, OmnixError> {
        self.open.retain(|(open, _)| open + 1 >= k && *open <= k + 1);
        let at = match self.open.iter().position(|(open, _)| *open == k) {
            Some(at) => at,
            None => {
                let window = StoredWindow::open(&window_path(&self.folder, k), self.size)?;
                self.open.push((k, window));
                self.open.len() - 1
            }
        };
        let stored = self.open[at].1.image(image - self.layout.windows()[k].images.start)?;
        Ok(placed(stored, &self.chain.placements()[k].to_part))
    }
}

/// An image of a window in the world of its part.
fn placed(image: WindowImage, to_part: &Similarity) -> FilmImage {
    let WindowImage { mut depth, confidence, theta, camera } = image;
    // The first window of a part stays as it is, bit for bit.
    if *to_part == Similarity::IDENTITY {
        return FilmImage { depth, confidence, theta, camera };
    }
    for z in &mut depth {
        *z = (f64::from(*z) * to_part.scale) as f32;
    }
    let camera = Camera { extrinsics: to_part.apply_to_w2c(&camera.extrinsics), ..camera };
    FilmImage { depth, confidence, theta, camera }
}

/// What lies `part` of the way between two windows' views of one image. Where one of them has no depth, the other's counts.
fn fade(earlier: &FilmImage, later: &FilmImage, part: f64) -> FilmImage {
    let between = |a: f32, b: f32| (f64::from(a) + (f64::from(b) - f64::from(a)) * part) as f32;
    let all = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| between(*a, *b)).collect::<Vec<f32>>();
    let sound = |z: f32| z.is_finite() && z > 0.0;
    let depth = earlier.depth.iter().zip(&later.depth).map(|(&a, &b)| match (sound(a), sound(b)) {
        (true, false) => a,
        (false, true) => b,
        _ => between(a, b),
    });
    FilmImage {
        depth: depth.collect(),
        confidence: all(&earlier.confidence, &later.confidence),
        theta: earlier.theta.as_ref().zip(later.theta.as_ref()).map(|(a, b)| all(a, b)),
        camera: fade_cameras(&earlier.camera, &later.camera, part),
    }
}

#[cfg(test)]
mod tests {
    use omnix_geometry::{PixelCentre, invert_pose, points_from_depth};

    use super::*;
    use crate::windows::stored::{made, store};

    const SIZE: [usize; 2] = [12, 16];
    const PIXELS: usize = SIZE[0] * SIZE[1];
    const INTRINSICS: [[f32; 3]; 3] = [[15.0, 0.0, 8.0], [0.0, 15.0, 6.0], [0.0, 0.0, 1.0]];

    /// What image `image` of the film truly shows.
    fn truth(image: usize) -> (Camera, impl Fn(usize) -> f32) {
        let along = image as f32 * 0.05;
        let extrinsics = [[1.0, 0.0, 0.0, -along], [0.0, 1.0, 0.0, 0.1 * along], [0.0, 0.0, 1.0, 0.3 * along]];
        let depth = move |p: usize| 3.0 + along + (p % SIZE[1]) as f32 * 0.1 + ((p / SIZE[1]) as f32 * 0.8).sin();
        (Camera { extrinsics, intrinsics: INTRINSICS }, depth)
    }

    /// Window `k`'s own world, from the film's.
    fn world(k: usize) -> Similarity {
        let (sin, cos) = (0.4 * k as f64).sin_cos();
        let rotation = [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]];
        if k == 0 {
            Similarity::IDENTITY
        } else {
            Similarity { scale: 1.0 / (1.0 + k as f64), rotation, translation: [k as f64, -2.0, 0.5] }
        }
    }

    /// Stores the windows of a film; `spoil` may change what one of them says of an image.
    fn film(layout: &Layout, folder: &Path, spoil: &dyn Fn(usize, usize, &mut WindowImage)) {
        for (k, window) in layout.windows().iter().enumerate() {
            let own = world(k);
            let images: Vec<WindowImage> = window
                .images
                .clone()
                .map(|image| {
                    let (camera, depth) = truth(image);
                    let extrinsics = own.apply_to_w2c(&camera.extrinsics);
                    let scaled = |p: usize| (f64::from(depth(p)) * own.scale) as f32;
                    let mut said = made(PIXELS, scaled, Some(0.1), Camera { extrinsics, ..camera });
                    spoil(k, image, &mut said);
                    said
                })
                .collect();
            store(&window_path(folder, k), "key", SIZE, &images).unwrap();
        }
    }

    fn chain(layout: &Layout, folder: &Path) -> Chain {
        Chain::new(layout, folder, SIZE, Some(0.5), &mut |_| Ok(())).unwrap()
    }

    /// The largest distance of a point of an image from where it truly is.
    fn off(found: &FilmImage, image: usize) -> f32 {
        let (camera, depth) = truth(image);
        let depth: Vec<f32> = (0..PIXELS).map(depth).collect();
        let points = |camera: &Camera, depth: &[f32]| {
            points_from_depth(depth, SIZE, &camera.intrinsics, &invert_pose(&camera.extrinsics), PixelCentre::Whole)
        };
        let (a, b) = (points(&camera, &depth).unwrap(), points(&found.camera, &found.depth).unwrap());
        let apart = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f32::max);
        a.iter().zip(&b).map(apart).fold(0.0, f32::max)
    }

    #[test]
    fn windows_in_other_worlds_become_one_film() {
        let dir = tempfile::tempdir().unwrap();
        let layout = Layout::new(31, 8, 3, &[]).unwrap();
        film(&layout, dir.path(), &|_, _, _| {});
        let chain = chain(&layout, dir.path());
        assert_eq!(chain.parts(), std::slice::from_ref(&(0..31)));
        let mut film = Film::new(&layout, &chain, dir.path(), SIZE);
        for image in 0..31 {
            let found = film.image(image).unwrap();
            assert!(off(&found, image) < 1e-3, "image {image}: {}", off(&found, image));
        }
        for seam in chain.seams() {
            let join = seam.outcome.as_ref().unwrap();
            assert!(join.residual[1] < 1e-4, "{seam:?}");
        }
    }

    #[test]
    fn there_is_no_step_where_windows_disagree_a_little() {
        let dir = tempfile::tempdir().unwrap();
        let layout = Layout::new(20, 12, 4, &[]).unwrap();
        // The later window sees a slant that the earlier does not: by up to 4 % of the depth.
        film(&layout, dir.path(), &|k, _, said| {
            if k == 1 {
                said.depth.iter_mut().enumerate().for_each(|(p, z)| *z *= 1.0 + 0.04 * (p % SIZE[1]) as f32 / 16.0);
            }
        });
        let chain = chain(&layout, dir.path());
        assert_eq!(chain.parts().len(), 1);
        let mut film = Film::new(&layout, &chain, dir.path(), SIZE);
        let depths: Vec<f32> = (0..20).map(|image| film.image(image).unwrap().depth[15] / truth(image).1(15)).collect();
        let steps: Vec<f32> = depths.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        let (whole, largest) = ((depths[19] - depths[0]).abs(), steps.iter().copied().fold(0.0, f32::max));
        assert!(whole > 0.01 && largest < 0.35 * whole, "{depths:?}");
    }

    #[test]
    fn windows_that_do_not_fit_are_kept_apart() {
        let dir = tempfile::tempdir().unwrap();
        let layout = Layout::new(26, 8, 2, &[20]).unwrap();
        let ends: Vec<usize> = layout.windows().iter().map(|window| window.images.end).collect();
        assert_eq!(ends, [8, 14, 20, 26]);
        // In the second window everything moves; the third begins behind it, and the fourth behind a cut.
        film(&layout, dir.path(), &|k, _, said| {
            if k == 1 {
                said.theta = Some(vec![0.9; PIXELS]);
            }
        });
        let chain = chain(&layout, dir.path());
        let why: Vec<String> =
            chain.seams().iter().map(|seam| seam.outcome.as_ref().unwrap_err().to_string()).collect();
        assert!(why[0].contains("stand still") && why[1].contains("stand still") && why[2].contains("cut"), "{why:?}");
        assert_eq!(chain.parts(), [0..7, 7..13, 13..20, 20..26]);
        // Each image once, as its window says.
        let mut film = Film::new(&layout, &chain, dir.path(), SIZE);
        for (image, k) in [(6, 0), (7, 1), (12, 1), (13, 2), (20, 3)] {
            let expected = (f64::from(truth(image).1(0)) * world(k).scale) as f32;
            assert_eq!(film.image(image).unwrap().depth[0], expected, "image {image}");
        }
    }

    #[test]
    fn depth_that_contradicts_is_not_joined() {
        let dir = tempfile::tempdir().unwrap();
        let layout = Layout::new(14, 8, 2, &[]).unwrap();
        film(&layout, dir.path(), &|k, _, said| {
            if k == 1 {
                said.depth.iter_mut().enumerate().for_each(|(p, z)| *z *= 0.2 + ((p * 7919) % 97) as f32 / 20.0);
            }
        });
        let chain = chain(&layout, dir.path());
        let why = chain.seams()[0].outcome.as_ref().unwrap_err().to_string();
        assert!(why.contains("% of the depth apart"), "{why}");
        assert_eq!(chain.parts(), [0..7, 7..14]);
    }

    #[test]
    fn a_missing_depth_is_the_other_windows() {
        let camera = truth(0).0;
        let image = |z: f32| FilmImage { depth: vec![z], confidence: vec![1.0], theta: None, camera };
        assert_eq!(fade(&image(f32::NAN), &image(2.0), 0.1).depth, [2.0]);
        assert_eq!(fade(&image(3.0), &image(0.0), 0.9).depth, [3.0]);
        assert_eq!(fade(&image(1.0), &image(3.0), 0.25).depth, [1.5]);
    }
}
