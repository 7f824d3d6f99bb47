//! Which pixels and tokens move, from true trajectories (in normalised units, NaN where unknown).
//!
//! A pixel moves if its largest step between consecutive known times is above 0.001; steps to or from an unknown time do not
//! count. A pixel without any known step has the foreground mask's label where there is one, else none. A token is a square patch of pixels:
//! it moves if a pixel in it does, and has a label if a pixel in it has one.

use crate::TrainError;

/// The longest step of a still point.
pub const STILL: f32 = 1e-3;

/// Labels and where they are known, both 0 or 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Labels {
    /// 1 what moves.
    pub label: Vec<f32>,
    /// 1 where the label is known; the label is 0 elsewhere.
    pub labelled: Vec<f32>,
}

/// Labels of the pixels of one image from `paths` `[times, pixels, 3]`; `foreground` (nonzero: moves) where a data set has such masks
/// of pixels without a known step.
///
/// # Errors
/// [`TrainError::Length`] when a slice does not have the length that the others ask for.
pub fn of_pixels(paths: &[f32], pixels: usize, foreground: Option<&[f32]>) -> Result<Labels, TrainError> {
    let times = paths.len() / (3 * pixels).max(1);
    if paths.len() != times * pixels * 3 {
        let expected = times * pixels * 3;
        return Err(TrainError::Length { what: "trajectories", expected, got: paths.len() });
    }
    if let Some(mask) = foreground.filter(|mask| mask.len() != pixels) {
        return Err(TrainError::Length { what: "foreground mask", expected: pixels, got: mask.len() });
    }
    let point = |time: usize, pixel: usize| &paths[(time * pixels + pixel) * 3..][..3];
    let step = |time: usize, pixel: usize| {
        let squares = point(time + 1, pixel).iter().zip(point(time, pixel)).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f32>().sqrt()
    };
    let mut labels = Labels { label: vec![0.0; pixels], labelled: vec![0.0; pixels] };
    for pixel in 0..pixels {
        let known = (0..times.saturating_sub(1)).map(|time| step(time, pixel)).filter(|step| step.is_finite());
        let moves = match (known.reduce(f32::max), foreground) {
            (Some(longest), _) => longest > STILL,
            (None, Some(mask)) => mask[pixel] != 0.0,
            (None, None) => continue,
        };
        labels.label[pixel] = f32::from(u8::from(moves));
        labels.labelled[pixel] = 1.0;
    }
    Ok(labels)
}

/// Labels of the tokens of one image, row by row, from those of its pixels.
///
/// # Errors
/// [`TrainError::Length`] when the labels are not those of `rows` × `columns` pixels, or the patches do not fill the image.
pub fn of_tokens(pixels: &Labels, [rows, columns]: [usize; 2], patch: usize) -> Result<Labels, TrainError> {
    let (down, across) = (rows / patch.max(1), columns / patch.max(1));
    let expected = down * across * patch * patch;
    for got in [pixels.label.len(), pixels.labelled.len(), rows * columns] {
        if got != expected {
            return Err(TrainError::Length { what: "labels of whole patches", expected, got });
        }
    }
    let mut labels = Labels { label: vec![0.0; down * across], labelled: vec![0.0; down * across] };
    for pixel in 0..rows * columns {
        let token = pixel / columns / patch * across + pixel % columns / patch;
        labels.label[token] = labels.label[token].max(pixels.label[pixel]);
        labels.labelled[token] = labels.labelled[token].max(pixels.labelled[pixel]);
    }
    Ok(labels)
}

#[cfg(test)]
mod tests {
    use super::{Labels, of_pixels, of_tokens};

    #[test]
    fn unknown_times_are_no_steps() {
        let nan = f32::NAN;
        // Pixels: still, moving, moving only across an unknown time, never known.
        let x = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.002], [0.0, nan, 1.0], [nan, nan, nan]];
        let paths: Vec<f32> = (0..3).flat_map(|t| x.map(|pixel| [pixel[t], 0.0, 0.0])).flatten().collect();
        let labels = of_pixels(&paths, 4, None).unwrap();
        assert_eq!(labels, Labels { label: vec![0.0, 1.0, 0.0, 0.0], labelled: vec![1.0, 1.0, 0.0, 0.0] });
        let labels = of_pixels(&paths, 4, Some(&[1.0, 0.0, 0.0, 1.0])).unwrap();
        assert_eq!(labels, Labels { label: vec![0.0, 1.0, 0.0, 1.0], labelled: vec![1.0; 4] });
    }

    #[test]
    fn a_patch_moves_with_any_of_its_pixels() {
        let label = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        let labelled = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0];
        let tokens = of_tokens(&Labels { label, labelled }, [2, 4], 2).unwrap();
        assert_eq!(tokens, Labels { label: vec![0.0, 1.0], labelled: vec![0.0, 1.0] });
    }

    #[test]
    fn lengths_that_do_not_fit_are_named() {
        let error = of_pixels(&[0.0; 13], 2, None).unwrap_err().to_string();
        assert_eq!(error, "trajectories: 13 numbers, expected 12");
        assert!(of_pixels(&[0.0; 12], 2, Some(&[0.0])).unwrap_err().to_string().contains("foreground mask"));
        let pixels = Labels { label: vec![0.0; 6], labelled: vec![0.0; 6] };
        assert!(of_tokens(&pixels, [2, 3], 2).unwrap_err().to_string().contains("whole patches"));
        assert!(of_tokens(&pixels, [2, 3], 0).is_err());
    }
}
