//! What masks do to results: of geometry, and of the field's parts before they are kept.

use omnix_graph::ops::{Gate, Motion};
use omnix_model::PATCH;

use crate::error::OmnixError;
use crate::event::FrameGeometry;
use crate::field::FieldShape;
use crate::masks::{Masks, PixelMark, cell_of};

/// Depth and confidence of an ignored pixel become 0: no depth, and no trust. `grid` are the image's rows and columns of patches.
pub(super) fn geometry(frame: &mut FrameGeometry, masks: Option<&Masks>, grid: (usize, usize)) {
    let Some(masks) = masks else { return };
    for (pixel, mark) in masks.image(frame.index).enumerate() {
        if mark == PixelMark::Ignored {
            let maps = [Some(&mut frame.depth), frame.confidence.as_mut(), frame.sky.as_mut()];
            maps.into_iter().flatten().for_each(|map| map[pixel] = 0.0);
        }
    }
    let Some((_, confidence)) = &mut frame.rays else { return };
    // A ray whose middle pixel is ignored weighs nothing in the camera that is found of rays.
    let marks: Vec<PixelMark> = masks.image(frame.index).collect();
    let (across, width) = (8 * grid.1, PATCH * grid.1);
    let middle = |at: usize| (2 * at + 1) * PATCH / 16;
    for (ray, confidence) in confidence.iter_mut().enumerate() {
        if marks[middle(ray / across) * width + middle(ray % across)] == PixelMark::Ignored {
            *confidence = 0.0;
        }
    }
}

/// The sky of ignored pixels becomes NaN, which is neither sky nor open: it counts for no other pixel.
pub(super) fn hide_sky(sky: &mut [Vec<f32>], masks: Option<&Masks>) {
    let Some(masks) = masks else { return };
    for (image, sky) in sky.iter_mut().enumerate() {
        let ignored = masks.image(image).zip(sky).filter(|(mark, _)| *mark == PixelMark::Ignored);
        ignored.for_each(|(_, sky)| *sky = f32::NAN);
    }
}

/// The two inputs of the module that force scores: where, and to what.
pub(super) fn forced_scores(masks: &Masks, shape: &FieldShape) -> [Vec<f32>; 2] {
    let cells = (0..shape.images).flat_map(|image| masks.cells(image, shape.grid));
    cells.map(|forced| (f32::from(u8::from(forced.is_some())), forced.unwrap_or(0.0))).unzip().into()
}

/// An image's parts of a field that masks change.
pub(super) struct PixelParts<'a> {
    /// `[height, width, levels, points, 2]`.
    pub(super) offsets: &'a mut [f32],
    /// `[height, width, levels, points]`.
    pub(super) weights: &'a mut [f32],
    /// `[height, width, 3]`.
    pub(super) points: &'a mut [f32],
    /// `[height, width]`.
    pub(super) confidence: &'a mut [f32],
}

/// Pixels that stand still, or are ignored, read nothing of the field, so their score is 0. Those that move read the middle of a cell that is
/// followed, where the score is what the field's `mask` says of it. Ignored ones have no point and no confidence.
///
/// # Errors
/// A pixel that is to move where no cell is followed.
pub(super) fn field(
    masks: &Masks,
    image: usize,
    shape: &FieldShape,
    mask: &[f32],
    parts: PixelParts<'_>,
) -> Result<(), OmnixError> {
    let samples = shape.levels * shape.points;
    let [rows, columns] = shape.grid;
    // The likeliest cells come first in every search; of equal ones the nearest is taken.
    let best = mask.iter().copied().fold(0.0, f32::max);
    let followed: Vec<usize> = (0..mask.len()).filter(|cell| mask[*cell] >= best && best > 0.0).collect();
    let nearest = |cell: usize| {
        let distance = |other: &usize| {
            let apart = |a: usize, b: usize| a.abs_diff(b).pow(2);
            apart(other / columns, cell / columns) + apart(other % columns, cell % columns)
        };
        if mask[cell] >= best { Some(cell) } else { followed.iter().copied().min_by_key(distance) }
    };
    let targets: Vec<Option<usize>> = (0..mask.len()).map(nearest).collect();
    for (pixel, mark) in masks.image(image).enumerate() {
        match mark {
            PixelMark::None => {}
            PixelMark::Still | PixelMark::Ignored => {
                parts.weights[pixel * samples..][..samples].fill(0.0);
                if mark == PixelMark::Ignored {
                    parts.points[3 * pixel..][..3].fill(f32::NAN);
                    parts.confidence[pixel] = 0.0;
                }
            }
            PixelMark::Moving => {
                let none = || OmnixError::Request {
                    reason: format!("the network follows no cell of image {image}, so none of its pixels can move"),
                };
                let cell = targets[cell_of(pixel, columns)].filter(|_| best > 0.0).ok_or_else(none)?;
                let place = |at: usize, side: usize, cell: usize, cells: usize| {
                    // Samples lie at the pixel's place in cells plus the offset (`spec/omnix.md` 8.2); cells have their middles at halves.
                    cell as f64 + 0.5 - at as f64 / (side.max(2) - 1) as f64 * cells as f64
                };
                let x = place(pixel % shape.width, shape.width, cell % columns, columns) as f32;
                let y = place(pixel / shape.width, shape.height, cell / columns, rows) as f32;
                let offsets = &mut parts.offsets[2 * pixel * samples..][..2 * samples];
                offsets.chunks_exact_mut(2).for_each(|offset| offset.copy_from_slice(&[x, y]));
            }
        }
    }
    Ok(())
}

/// Whether pixels can be held still under this gate.
///
/// # Errors
/// A gate that has no score, or that blends where a rotation of nothing is not finite.
pub(super) fn check(masks: &Masks, motion: Motion) -> Result<(), OmnixError> {
    let can = match motion.gate {
        Gate::None => false,
        Gate::Hard(_) => true,
        Gate::Blend => motion.min_norm > 0.0,
    };
    if can || !masks.any() {
        return Ok(());
    }
    let reason = "masks cannot decide what moves in this network: its motion has no gate that a score of 0 closes";
    Err(OmnixError::Request { reason: reason.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_move_read_the_nearest_cell_that_is_followed() {
        let shape = FieldShape { images: 1, height: 14, width: 42, grid: [1, 3], levels: 1, points: 2 };
        let mut masks = Masks::new();
        // A row of pixels each: the first still, the second ignored, those of the last cell moving.
        let mark = |pixel: usize| match (pixel / 42, pixel % 42) {
            (_, 28..) => PixelMark::Moving,
            (0, _) => PixelMark::Still,
            (1, _) => PixelMark::Ignored,
            _ => PixelMark::None,
        };
        masks.push((0..14 * 42).map(mark));
        let run = |mask: [f32; 3]| {
            let mut maps =
                [vec![0.25; 14 * 42 * 4], vec![0.5; 14 * 42 * 2], vec![1.0; 14 * 42 * 3], vec![2.0; 14 * 42]];
            let [offsets, weights, points, confidence] = &mut maps;
            let parts = PixelParts { offsets, weights, points, confidence };
            field(&masks, 0, &shape, &mask, parts).map(|()| maps)
        };
        let [offsets, weights, points, confidence] = run([0.0, 1.0, 0.0]).unwrap();
        assert_eq!((weights[0], weights[2 * 42], weights[2 * 2 * 42]), (0.0, 0.0, 0.5));
        assert!(points[3 * 42].is_nan() && points[0] == 1.0 && confidence[42] == 0.0 && confidence[0] == 2.0);
        // Column 41 is at 3 cells; the middle of the followed cell at 1.5.
        let last = &offsets[4 * 41..][..4];
        assert_eq!(last, [-1.5, 0.5, -1.5, 0.5]);
        assert_eq!(offsets[4 * 2 * 42], 0.25);
        // Its own cell, where that is followed.
        assert_eq!(run([1.0, 0.0, 1.0]).unwrap()[0][4 * 41], -0.5);
        assert!(run([0.0; 3]).is_err());
    }

    #[test]
    fn without_a_gate_nothing_can_be_forced() {
        let mut masks = Masks::new();
        masks.push([PixelMark::Still]);
        let motion = |gate, min_norm| Motion { relative: true, min_norm, gate };
        assert!(
            check(&masks, motion(Gate::Hard(0.3), 0.0)).is_ok() && check(&masks, motion(Gate::Blend, 1e-3)).is_ok()
        );
        assert!(check(&masks, motion(Gate::Blend, 0.0)).is_err() && check(&masks, motion(Gate::None, 1e-3)).is_err());
        assert!(check(&Masks::new(), motion(Gate::None, 1e-3)).is_ok());
    }
}
