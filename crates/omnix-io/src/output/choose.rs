//! Which pixels to follow when not all are wanted (`--points N`): the moving ones first, the rest spread evenly.
//!
//! 1. Motion: of the pixels with θ above the threshold those of highest θ, at most `moving_share` of the budget; of equal θ the lower id
//!    (image · pixels + pixel).
//! 2. The rest, in equal shares for the images (an image with too few pixels leaves its share to the others): a grid over the image with
//!    about as many cells as points are wanted, in each cell the pixel of lowest seeded hash; where some cells are full or
//!    empty, the pixels of lowest hash among those left.
//!
//! Pixels with a θ that is not finite are never chosen. The choice depends on scores, sizes and seed alone.

use super::sample::key;
use crate::setters::settings;

settings! {
    /// How many points, and how they are shared out.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct PointOptions {
        /// Number of points wanted.
        pub budget: usize,
        /// θ above which a pixel moves (0.3, the gate of inference).
        pub threshold: f32,
        /// Largest share of the budget for moving pixels, 0 to 1.
        pub moving_share: f64,
        /// Seed of the choice of the others.
        pub seed: u64,
    }
}

impl PointOptions {
    /// `budget` points with the usual threshold 0.3, share 0.8 and seed.
    #[must_use]
    pub fn new(budget: usize) -> Self {
        Self { budget, threshold: 0.3, moving_share: 0.8, seed: 42 }
    }
}

/// Chooses pixels: for each image the ascending indices (row · width + column) of its chosen pixels. `scores` holds every image's θ,
/// row by row, all of one size and `width` pixels wide.
///
/// # Panics
/// If the images differ in size or are no multiple of the width.
#[must_use]
pub fn choose_points(scores: &[&[f32]], width: usize, options: &PointOptions) -> Vec<Vec<usize>> {
    let pixels = scores.first().map_or(0, |s| s.len());
    assert!(
        scores.iter().all(|s| s.len() == pixels) && (pixels == 0 || (width > 0 && pixels.is_multiple_of(width))),
        "BUG: images of choose_points differ in size"
    );
    let mut taken: Vec<Vec<bool>> = scores.iter().map(|_| vec![false; pixels]).collect();
    let cap = (options.moving_share.clamp(0.0, 1.0) * options.budget as f64).floor() as usize;
    let mut chosen = 0;
    for (image, pixel) in most_moving(scores, options.threshold, cap) {
        taken[image][pixel] = true;
        chosen += 1;
    }
    let mut free: Vec<usize> =
        scores.iter().zip(&taken).map(|(s, t)| (0..pixels).filter(|&i| is_free(s, t, i)).count()).collect();
    let quotas = share_out(options.budget.saturating_sub(chosen), &mut free);
    for (image, (&quota, taken)) in quotas.iter().zip(&mut taken).enumerate() {
        let hash = |pixel: usize| key(options.seed, (image * pixels + pixel) as u64);
        spread(scores[image], taken, width, quota, hash);
    }
    taken.iter().map(|t| (0..pixels).filter(|&i| t[i]).collect()).collect()
}

fn is_free(scores: &[f32], taken: &[bool], pixel: usize) -> bool {
    scores[pixel].is_finite() && !taken[pixel]
}

/// Step 1: (image, pixel) of the highest scores.
fn most_moving(scores: &[&[f32]], threshold: f32, cap: usize) -> Vec<(usize, usize)> {
    let mut moving: Vec<(f32, usize, usize)> = Vec::new();
    for (image, scores) in scores.iter().enumerate() {
        let above = scores.iter().enumerate().filter(|(_, s)| s.is_finite() && **s > threshold);
        moving.extend(above.map(|(pixel, &score)| (score, image, pixel)));
    }
    moving.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    moving.truncate(cap);
    moving.into_iter().map(|(_, image, pixel)| (image, pixel)).collect()
}

/// Equal shares of `count`, none larger than what is free; earlier images get the remainder.
fn share_out(count: usize, free: &mut [usize]) -> Vec<usize> {
    let mut shares = vec![0; free.len()];
    let mut left = count.min(free.iter().sum());
    while left > 0 {
        let open = free.iter().filter(|&&f| f > 0).count();
        let (each, more) = (left / open, left % open);
        let still_open = shares.iter_mut().zip(free.iter_mut()).filter(|(_, f)| **f > 0);
        for (position, (share, free)) in still_open.enumerate() {
            let give = (each + usize::from(position < more)).min(*free);
            *share += give;
            *free -= give;
            left -= give;
        }
    }
    shares
}

/// Step 2 for one image: marks `quota` more pixels as taken.
fn spread(scores: &[f32], taken: &mut [bool], width: usize, quota: usize, hash: impl Fn(usize) -> u64) {
    if quota == 0 {
        return;
    }
    let height = scores.len() / width;
    let aspect = width as f64 / height as f64;
    let columns = ((quota as f64 * aspect).sqrt().ceil() as usize).clamp(1, width);
    let rows = quota.div_ceil(columns).clamp(1, height);
    let mut best: Vec<Option<(u64, usize)>> = vec![None; columns * rows];
    for pixel in (0..scores.len()).filter(|&i| is_free(scores, taken, i)) {
        let cell = (pixel / width * rows / height) * columns + pixel % width * columns / width;
        let offer = (hash(pixel), pixel);
        if best[cell].is_none_or(|b| offer < b) {
            best[cell] = Some(offer);
        }
    }
    let offers: Vec<usize> = best.into_iter().flatten().map(|(_, pixel)| pixel).collect();
    let mut open = quota;
    for pixel in super::voxel::midpoints(&offers, quota) {
        taken[pixel] = true;
        open -= 1;
    }
    if open > 0 {
        let mut left: Vec<usize> = (0..scores.len()).filter(|&i| is_free(scores, taken, i)).collect();
        left.sort_unstable_by_key(|&pixel| hash(pixel));
        left.iter().take(open).for_each(|&pixel| taken[pixel] = true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_first_then_evenly() {
        let mut scores = vec![vec![0.1f32; 40 * 20]; 3];
        scores[1][100..140].fill(0.9);
        scores[1][7] = 0.95;
        scores[2][0] = f32::NAN;
        let images: Vec<&[f32]> = scores.iter().map(Vec::as_slice).collect();
        let chosen = choose_points(&images, 40, &PointOptions::new(40));
        assert_eq!(chosen.iter().map(Vec::len).sum::<usize>(), 40);
        // 32 of 40 for motion: the highest and then the lower ids.
        assert!(chosen[1].contains(&7) && (100..131).all(|p| chosen[1].contains(&p)), "{:?}", chosen[1]);
        // The other 8: 3, 3 and 2.
        assert_eq!((chosen[0].len(), chosen[2].len()), (3, 2));
        assert_eq!(chosen, choose_points(&images, 40, &PointOptions::new(40)));
        let other = choose_points(&images, 40, &PointOptions { seed: 1, ..PointOptions::new(40) });
        assert_ne!(chosen[0], other[0]);
    }

    #[test]
    fn every_quarter_gets_its_part() {
        let scores = vec![0.0f32; 100 * 60];
        let chosen = choose_points(&[&scores], 100, &PointOptions::new(240));
        let quarters = chosen[0].iter().fold([0; 4], |mut n, p| {
            n[usize::from(p % 100 >= 50) + 2 * usize::from(p / 100 >= 30)] += 1;
            n
        });
        assert!(quarters.iter().all(|n| (50..=70).contains(n)), "{quarters:?}");
    }

    #[test]
    fn large_budgets_take_every_finite_pixel() {
        let scores = [0.5, f32::NAN, 0.1, 0.9];
        assert_eq!(choose_points(&[&scores, &[f32::NAN; 4]], 2, &PointOptions::new(100)), [vec![0, 2, 3], vec![]]);
        assert!(choose_points(&[], 2, &PointOptions::new(10)).is_empty());
    }
}
