//! Depth of one view, moved into another by the cameras, beside the depth there.

use glam::DVec3;
use serde::Serialize;

use super::grid::{At, at, chosen, quantile};
use crate::rigid::{Pinhole, centre};
use crate::{Flag, Sample};

/// A point further behind the surface than this share of its depth is hidden by it; further in front, it contradicts it.
const HIDDEN: f64 = 0.03;
/// Points that move by less than this many pixels between the views say nothing about the cameras.
const PARALLAX: f64 = 1.0;
/// Pairs of images that are compared, at most.
const PAIRS: usize = 24;

/// A search looks at one of this number of points.
const SOME: usize = 3;

/// How well the depths of views agree.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WarpErrors {
    /// Pairs of images, each in both directions.
    pub pairs: usize,
    /// Points compared.
    pub compared: usize,
    /// Median of the relative error of depth, of points that are not hidden.
    pub median: f64,
    /// 95th percentile of the same.
    pub percentile_95: f64,
    /// Share of the compared points that lie behind the surface: hidden there, in a right scene.
    pub hidden: f64,
    /// Share of the compared points that lie in front of the surface, and should have been seen there.
    pub in_front: f64,
    /// Share of points that fall into the other image.
    pub overlap: f64,
    /// Whether the views differ enough to tell anything about the cameras.
    pub told: bool,
}

/// Pairs of images that are compared: neighbours in a video, and images of one moment.
pub(super) fn pairs(sample: &Sample) -> Vec<[usize; 2]> {
    if sample.parts().depth.is_none() {
        return Vec::new();
    }
    let times = sample.times();
    let mut pairs = Vec::new();
    for gap in 1..times.len() {
        for a in 0..times.len() - gap {
            let b = a + gap;
            let near = times[a].video == times[b].video && gap <= 2;
            if near || times[a].moment == times[b].moment {
                pairs.push([a, b]);
            }
        }
    }
    pairs.truncate(PAIRS);
    pairs
}

/// One point of a view in another.
enum Seen {
    /// Behind the camera or outside of the image.
    Outside,
    /// Depth over the depth there, less 1, and how far it moved in pixels.
    Off(f64, f64),
}

/// Calls `tell` with one of `every` points of these pairs that can be compared, in both directions.
fn each(sample: &Sample, cameras: &[Pinhole], pairs: &[[usize; 2]], every: usize, mut tell: impl FnMut(Seen)) {
    let size = sample.size().map(|side| side as usize);
    let both = pairs.iter().flat_map(|[a, b]| [[*a, *b], [*b, *a]]);
    for [from, to] in both {
        let (Some(depth), Some(other)) = (sample.depth(from), sample.depth(to)) else {
            continue;
        };
        let one_moment = sample.times()[from].moment == sample.times()[to].moment;
        let moving = sample.moving(from);
        let move_to = cameras[to].w2c.after(cameras[from].w2c.inverse());
        for pixel in chosen(sample).step_by(every) {
            let z = f64::from(depth[pixel]);
            let moves = moving.is_some_and(|moving| moving[pixel] == Flag::Yes);
            if z.is_nan() || (moves && !one_moment) {
                continue;
            }
            let [u, v] = centre(pixel, size[0]);
            let seen: DVec3 = move_to.apply(cameras[from].unproject(u, v, z));
            let place = cameras[to].project(seen);
            match if seen.z > 0.0 { at(other, size, place) } else { At::Outside } {
                At::Outside => tell(Seen::Outside),
                At::Unclear => {}
                At::Inverse(inverse) => {
                    tell(Seen::Off(seen.z * inverse - 1.0, (place[0] - u).hypot(place[1] - v)));
                }
            }
        }
    }
}

/// Measures the pairs; none where nothing can be compared.
pub(super) fn measure(sample: &Sample, cameras: &[Pinhole], pairs: &[[usize; 2]]) -> Option<WarpErrors> {
    let (mut errors, mut moved) = (Vec::new(), Vec::new());
    let (mut compared, mut outside, mut hidden, mut in_front) = (0usize, 0usize, 0usize, 0usize);
    each(sample, cameras, pairs, 1, |seen| match seen {
        Seen::Outside => outside += 1,
        Seen::Off(off, by) => {
            compared += 1;
            moved.push(by);
            if off > HIDDEN {
                hidden += 1;
            } else {
                in_front += usize::from(off < -HIDDEN);
                errors.push(off.abs());
            }
        }
    });
    let all = compared + outside;
    let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
    (all > 0).then(|| WarpErrors {
        pairs: pairs.len(),
        compared,
        median: quantile(&mut errors, 0.5),
        percentile_95: quantile(&mut errors, 0.95),
        hidden: share(hidden, compared),
        in_front: share(in_front, compared),
        overlap: share(compared, all),
        told: quantile(&mut moved, 0.5) > PARALLAX || compared == 0,
    })
}

/// What wrong cameras cost: the mean over some points of the error over `scale`, at most 1, and 1 for points outside; and the share of those
/// that cost 1. None where nothing can be compared.
pub(super) fn cost(sample: &Sample, cameras: &[Pinhole], pairs: &[[usize; 2]], scale: f64) -> Option<[f64; 2]> {
    let (mut sum, mut whole, mut count) = (0.0, 0.0, 0usize);
    each(sample, cameras, pairs, SOME, |seen| {
        let cost = match seen {
            Seen::Outside => 1.0,
            Seen::Off(off, _) => (off.abs() / scale).min(1.0),
        };
        count += 1;
        sum += cost;
        whole += f64::from(u8::from(cost == 1.0));
    });
    (count > 0).then(|| [sum, whole].map(|v| v / count as f64))
}
