//! Motion blur: each pixel's light averaged along the way that its point goes in the picture while the shutter is open.
//!
//! The way is exact (half of it is where the point is half a shutter's time later), what is met along it is taken from the sharp
//! picture. Labels are those of the middle of the shutter's time.

use glam::{DVec2, Vec3};
use rayon::prelude::*;

use crate::cast::{Geometry, Hit};
use crate::view::View;

/// Longest half way, in parts of the picture's width.
const LONGEST: f64 = 0.06;
/// Half ways shorter than this, in pixels, count as standing still.
const SHORTEST: f64 = 0.3;

/// The state of things and camera half a shutter's time after the middle.
pub(crate) struct Later<'a> {
    pub(crate) geometry: &'a Geometry,
    pub(crate) view: View,
}

/// The blurred picture.
pub(crate) fn smear(light: &[Vec3], view: &View, hits: &[Option<Hit>], later: &Later) -> Vec<Vec3> {
    let [width, height] = view.size;
    let pixel = |index: usize| {
        let here = View::pixel(index % width, index / width);
        let there = match &hits[index] {
            Some(hit) => later.view.project(later.geometry.point(hit)),
            // The sky is far away: it moves with the camera's turn alone.
            None => later.view.project(later.view.centre + view.ray(here).direction * 1e6),
        };
        let half = there.map_or(DVec2::ZERO, |(at, _)| at - here).clamp_length_max(LONGEST * width as f64);
        if half.length() < SHORTEST {
            return light[index];
        }
        let steps = (half.length() * 1.5).ceil().min(12.0) as i32;
        let sum: Vec3 = (-steps..=steps)
            .map(|k| here + half * (f64::from(k) / f64::from(steps)))
            .map(|at| {
                let x = (at.x.max(0.0) as usize).min(width - 1);
                let y = (at.y.max(0.0) as usize).min(height - 1);
                light[y * width + x]
            })
            .sum();
        sum / (2 * steps + 1) as f32
    };
    (0..light.len()).into_par_iter().map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DAffine3, DVec3};

    use super::*;
    use crate::cast::{Placed, Solid};
    use crate::labels::hits;

    #[test]
    fn what_moves_is_blurred_and_what_stands_stays_sharp() {
        let wall = Arc::new(Solid::new(crate::shapes::cuboid(DVec3::new(20.0, 0.1, 20.0)).moved(DVec3::Y * 5.0)));
        let block = Arc::new(Solid::new(crate::shapes::cuboid(DVec3::ONE)));
        let state = |x: f64| {
            let pose = DAffine3::from_translation(DVec3::new(x, 2.0, 0.0));
            Geometry::new(Arc::clone(&wall), vec![Placed::new(Arc::clone(&block), pose)])
        };
        let middle = DVec2::new(32.0, 16.0);
        let view = View::looking(DVec3::NEG_Y, DVec3::ZERO, 0.0, 40.0, middle, [64, 32]);
        let (now, soon) = (state(0.0), state(0.2));
        let hits = hits(&view, &now);
        // Stripes of one pixel.
        let light: Vec<Vec3> = (0..64 * 32).map(|k| Vec3::splat((k % 2) as f32)).collect();
        let blurred = smear(&light, &view, &hits, &Later { geometry: &soon, view });
        for (k, hit) in hits.iter().enumerate() {
            match hit.map(|hit| hit.instance) {
                // Whole pixels are read, so that stripes leave a ripple.
                Some(1) => assert!((blurred[k].x - 0.5).abs() < 0.3, "{k}: {}", blurred[k].x),
                _ => assert_eq!(blurred[k], light[k], "{k}"),
            }
        }
        assert!(hits.iter().flatten().filter(|hit| hit.instance == 1).count() > 100);
    }
}
