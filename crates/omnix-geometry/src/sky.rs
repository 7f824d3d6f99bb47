//! Sky and metres: what the maps of monocular, metric and nested networks become for all views together (`spec/da3.md` 7.1 and 10).
//!
//! Maps are one list of pixels a view. Upstream draws 100,000 pixels at random where there are more; here quantiles are exact.

use crate::GeometryError;

/// Below this a pixel is open: its depth counts. From it on its depth is filled in.
pub const OPEN_SKY: f32 = 0.3;
/// From this on a pixel is sky in results.
pub const SKY: f32 = 0.5;
/// The focal length in pixels at which metric networks measure: metres are `depth · f / 300`.
pub const CANONICAL_FOCAL: f64 = 300.0;
/// No sky of a nested network is farther, in metres.
pub const FARTHEST_SKY: f32 = 200.0;

/// With fewer open pixels, or fewer of the sky, nothing is filled.
const FEWEST: usize = 11;
/// Of the depth of open pixels, this quantile becomes the sky's.
const FAR: f64 = 0.99;
/// Depths that a metric scale is found from are above these: the metric network's, and the other's.
const NEAREST: [f64; 2] = [0.01, 0.001];

/// Gives the pixels of the sky the depth of the farthest ones that are not: the 99 % quantile over all views. Returns it, or none where
/// there is too little of either kind and nothing was done.
pub fn fill_sky(depth: &mut [Vec<f32>], sky: &[Vec<f32>]) -> Option<f32> {
    let open = open_values(depth, sky);
    let pixels: usize = sky.iter().map(Vec::len).sum();
    if open.len() < FEWEST || pixels - open.len() < FEWEST {
        return None;
    }
    let far = quantile(open, FAR)?;
    fill(depth, sky, far);
    Some(far)
}

/// What both networks of a nested one say of one view.
#[derive(Clone, Copy, Debug)]
pub struct MetricView<'a> {
    /// The metric network's depth, its own sky filled.
    pub metric: &'a [f32],
    /// The any-view network's depth.
    pub depth: &'a [f32],
    /// The any-view network's confidence.
    pub confidence: &'a [f32],
    /// The metric network's sky.
    pub sky: &'a [f32],
    /// Mean of fx and fy in pixels of the maps.
    pub focal: f64,
}

/// Metres in a unit of the any-view network's depth: the factor that brings it closest to the metric network's in the least-squares
/// sense, over open pixels of at least median confidence.
///
/// # Errors
/// [`GeometryError::NoScale`] where ten open pixels or fewer are left.
pub fn metric_scale(views: &[MetricView<'_>]) -> Result<f64, GeometryError> {
    let confident = |view: &MetricView<'_>| -> Vec<f32> {
        view.confidence.iter().zip(view.sky).filter(|(_, sky)| **sky < OPEN_SKY).map(|(c, _)| *c).collect()
    };
    let confidences: Vec<f32> = views.iter().flat_map(confident).collect();
    let open = confidences.len();
    let median = if open < FEWEST { None } else { quantile(confidences, 0.5) };
    let median = median.ok_or(GeometryError::NoScale { open })?;
    let (mut both, mut own) = (0.0f64, 0.0f64);
    for view in views {
        let metres = view.focal / CANONICAL_FOCAL;
        for (((metric, depth), confidence), sky) in
            view.metric.iter().zip(view.depth).zip(view.confidence).zip(view.sky)
        {
            let (metric, depth) = (f64::from(*metric) * metres, f64::from(*depth));
            if *sky < OPEN_SKY && *confidence >= median && metric > NEAREST[0] && depth > NEAREST[1] {
                both += metric * depth;
                own += depth * depth;
            }
        }
    }
    Ok(both / own.max(1e-12))
}

/// The depth of the sky of a nested network, of depth in metres: as [`fill_sky`], at most [`FARTHEST_SKY`]. Confidence there becomes 1, the
/// lowest there is.
pub fn fill_metric_sky(depth: &mut [Vec<f32>], confidence: &mut [Vec<f32>], sky: &[Vec<f32>]) {
    let Some(far) = quantile(open_values(depth, sky), FAR) else { return };
    fill(depth, sky, far.min(FARTHEST_SKY));
    fill(confidence, sky, 1.0);
}

/// The values of open pixels.
fn open_values(maps: &[Vec<f32>], sky: &[Vec<f32>]) -> Vec<f32> {
    let pixels = maps.iter().flatten().zip(sky.iter().flatten());
    pixels.filter(|(_, sky)| **sky < OPEN_SKY).map(|(value, _)| *value).collect()
}

/// Gives every pixel that is not open this value. A sky that is no number is no sky to speak of, and not open either.
fn fill(maps: &mut [Vec<f32>], sky: &[Vec<f32>], value: f32) {
    let pixels = maps.iter_mut().flatten().zip(sky.iter().flatten());
    pixels.filter(|(_, sky)| **sky >= OPEN_SKY || sky.is_nan()).for_each(|(pixel, _)| *pixel = value);
}

/// Linear between neighbours, as numpy's and torch's default; none of no values.
fn quantile(mut values: Vec<f32>, share: f64) -> Option<f32> {
    let at = share * values.len().checked_sub(1)? as f64;
    let (below, part) = (at.floor() as usize, at.fract());
    let (_, low, rest) = values.select_nth_unstable_by(below, f32::total_cmp);
    let low = f64::from(*low);
    let high = rest.iter().copied().min_by(f32::total_cmp).map_or(low, f64::from);
    Some((low + (high - low) * part) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_between_neighbours() {
        assert_eq!(quantile(vec![4.0, 1.0, 3.0, 2.0], 0.5), Some(2.5));
        assert_eq!(quantile(vec![7.0], 0.99), Some(7.0));
        assert_eq!(quantile((0..=100).rev().map(|v| v as f32).collect(), 0.99), Some(99.0));
        assert_eq!(quantile(Vec::new(), 0.5), None);
    }

    #[test]
    fn sky_is_as_far_as_the_farthest_of_all_views() {
        // 101 open pixels of depth 0 to 100 in two views, and 12 of the sky in the second.
        let mut depth = vec![(0..50).map(|v| v as f32).collect::<Vec<_>>(), (50..113).map(|v| v as f32).collect()];
        let mut sky = vec![vec![0.0; 50], vec![0.29; 63]];
        sky[1][51..].fill(0.3);
        assert_eq!(fill_sky(&mut depth, &sky), Some(99.0));
        assert_eq!(depth[0][49], 49.0);
        assert!(depth[1][50] == 100.0 && depth[1][51..].iter().all(|d| *d == 99.0));
        // Ten pixels of the sky are left alone.
        let (before, few) = (vec![vec![5.0f32; 40]], [vec![0.0f32; 30], vec![1.0; 10]].concat());
        let mut depth = before.clone();
        assert_eq!(fill_sky(&mut depth, &[few]), None);
        assert_eq!(depth, before);
    }

    #[test]
    fn the_scale_is_that_of_confident_open_pixels() {
        let pixels = 40;
        let depth: Vec<f32> = (0..pixels).map(|i| 1.0 + i as f32).collect();
        // At this focal length a metre of the metric network's is two.
        let mut metric: Vec<f32> = depth.iter().map(|d| 1.5 * d).collect();
        let mut confidence = vec![2.0; pixels];
        let mut sky = vec![0.0; pixels];
        // What is unsure, sky, or too near says nothing.
        (metric[3], confidence[3]) = (1e6, 1.0);
        (metric[4], sky[4]) = (1e6, 0.4);
        metric[5] = -1e6;
        let view = |sky| MetricView { metric: &metric, depth: &depth, confidence: &confidence, sky, focal: 600.0 };
        let found = metric_scale(&[view(&sky)]).unwrap();
        assert!((found - 3.0).abs() < 1e-9, "{found}");
        let all = vec![1.0; pixels];
        assert_eq!(metric_scale(&[view(&all)]), Err(GeometryError::NoScale { open: 0 }));
    }

    #[test]
    fn metric_sky_has_an_end_and_no_confidence() {
        let (mut depth, mut confidence) = (vec![vec![500.0; 30]], vec![vec![3.0; 30]]);
        let mut sky = vec![vec![0.0; 30]];
        sky[0][0] = 1.0;
        fill_metric_sky(&mut depth, &mut confidence, &sky);
        assert_eq!((depth[0][0], confidence[0][0], depth[0][1], confidence[0][1]), (200.0, 1.0, 500.0, 3.0));
    }
}
