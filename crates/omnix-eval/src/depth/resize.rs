//! Cubic resizing of a depth map as OpenCV's `INTER_CUBIC` does it: half-pixel centres, Keys' kernel with a = -0.75, borders replicated.
//! Sums are f64 (OpenCV's are f32, which differs in the seventh digit).

use crate::EvalError;

const A: f64 = -0.75;

/// Resizes a row-major map of `width` x `height` to `to = [width, height]`.
///
/// # Errors
/// [`EvalError::Counts`] if the map is not of its size, [`EvalError::Parameter`] for a size of 0.
pub fn resize_cubic(map: &[f32], size: [usize; 2], to: [usize; 2]) -> Result<Vec<f32>, EvalError> {
    resize_part(map, size, Part { whole: size, start: [0, 0] }, to)
}

/// Which part of a whole picture a map is of: it begins at `start` of a map of the size `whole`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// Width and height of a map of the whole picture.
    pub whole: [usize; 2],
    /// Left and top of the part.
    pub start: [usize; 2],
}

/// Resizes a map of a part of a picture to a map of the whole picture of the size `to`, NaN where the part does not reach.
///
/// # Errors
/// As [`resize_cubic`].
pub fn resize_part(
    map: &[f32],
    [width, height]: [usize; 2],
    part: Part,
    to: [usize; 2],
) -> Result<Vec<f32>, EvalError> {
    EvalError::expect("pixels of a depth map", map.len(), width.saturating_mul(height))?;
    if map.is_empty() || to.contains(&0) || part.whole.contains(&0) {
        let value = format!("{width} x {height} to {} x {}", to[0], to[1]);
        return Err(EvalError::Parameter { name: "size of a depth map", value, expected: "no side may be 0" });
    }
    if to == [width, height] && part.whole == to {
        return Ok(map.to_vec());
    }
    let columns = taps(width, part.whole[0], part.start[0], to[0]);
    let rows = taps(height, part.whole[1], part.start[1], to[1]);
    // Rows first: each row of the input is widened once.
    let wide: Vec<f64> = map
        .chunks_exact(width)
        .flat_map(|row| {
            columns.iter().map(|taps| taps.iter().map(|&(at, weight)| f64::from(row[at]) * weight).sum::<f64>())
        })
        .collect();
    let mut out = Vec::with_capacity(to[0] * to[1]);
    for taps in &rows {
        out.extend(
            (0..to[0]).map(|x| taps.iter().map(|&(at, weight)| wide[at * to[0] + x] * weight).sum::<f64>() as f32),
        );
    }
    Ok(out)
}

/// Place and weight of the four inputs of each output; weights are NaN outside of the part.
fn taps(from: usize, whole: usize, start: usize, to: usize) -> Vec<[(usize, f64); 4]> {
    let ratio = whole as f64 / to as f64;
    (0..to)
        .map(|o| {
            let place = (o as f64 + 0.5) * ratio - start as f64;
            let outside = place < 0.0 || place > from as f64;
            let centre = place - 0.5;
            let base = centre.floor();
            let t = centre - base;
            let near = |x: f64| ((A + 2.0) * x - (A + 3.0)) * x * x + 1.0;
            let far = |x: f64| ((A * x - 5.0 * A) * x + 8.0 * A) * x - 4.0 * A;
            let weights = [far(t + 1.0), near(t), near(1.0 - t), far(2.0 - t)];
            std::array::from_fn(|k| {
                let at = (base as i64 + k as i64 - 1).clamp(0, from as i64 - 1);
                (at as usize, if outside { f64::NAN } else { weights[k] })
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_stays_and_a_slope_is_kept_inside() {
        assert!(resize_cubic(&[2.5; 12], [4, 3], [9, 5]).unwrap().iter().all(|v| (v - 2.5).abs() < 1e-6));
        let slope: Vec<f32> = (0..16).map(|x| x as f32).collect();
        let wide = resize_cubic(&slope, [16, 1], [32, 1]).unwrap();
        // Keys' kernel reproduces lines only with a = -0.5: with -0.75 the middle of a cell is still exact.
        assert!((wide[15] + wide[16] - 15.0).abs() < 1e-5, "{wide:?}");
    }

    #[test]
    fn a_part_lies_where_it_was_cut_out() {
        let whole: Vec<f32> = (0..12).map(|x| x as f32).collect();
        let part = Part { whole: [12, 1], start: [4, 0] };
        let found = resize_part(&whole[4..10], [6, 1], part, [12, 1]).unwrap();
        assert!(found[..4].iter().chain(&found[10..]).all(|v| v.is_nan()), "{found:?}");
        assert!((4..10).all(|x| (found[x] - whole[x]).abs() < 1e-6), "{found:?}");
        // At half the size the fourth and the fifth pixel of the picture lie in the middle of two of the part's.
        let half = resize_part(&whole[4..10], [6, 1], part, [6, 1]).unwrap();
        assert!(half[1].is_nan() && (half[3] - 6.5).abs() < 1e-6 && half[5].is_nan(), "{half:?}");
    }

    #[test]
    fn sizes_are_checked() {
        assert!(resize_cubic(&[1.0; 5], [2, 3], [4, 4]).is_err());
        assert!(resize_cubic(&[1.0; 6], [2, 3], [0, 4]).is_err());
        assert_eq!(resize_cubic(&[1.0, 2.0], [2, 1], [2, 1]).unwrap(), [1.0, 2.0]);
    }
}
