//! Which entries of the trajectory term count, where moving ones are few: all that move, and a share of those that stand still.
//!
//! With f moving entries, floor(f · (1 − share)/share) still ones are drawn, so that `share` of what counts moves (the release: 0.7, for
//! one of its data sets). With at most 100 moving entries all still ones count and the moving ones do not.

use crate::TrainError;

/// Share of moving entries that the release aims at.
pub const SHARE: f64 = 0.7;
/// Up to as many moving entries are too few to learn from.
const FEW: usize = 100;

/// 1 for each entry that counts and 0 for the others, from which entries move and which are valid (nonzero). `draw(wanted, left)`
/// decides of each valid still entry, in order, whether it is taken: `wanted` are still to be taken out of the `left` remaining ones,
/// this one included. A draw with probability `wanted / left` makes every choice equally likely; `wanted` is never more than `left`, and where
/// they are equal or nothing is wanted there is no choice and `draw` is not asked.
///
/// # Errors
/// [`TrainError::Length`] when the two have different lengths, [`TrainError::BadLoss`] when the share is not above 0 and at most 1.
pub fn drawn(
    moving: &[f32],
    valid: &[f32],
    share: f64,
    draw: &mut dyn FnMut(usize, usize) -> bool,
) -> Result<Vec<f32>, TrainError> {
    if moving.len() != valid.len() {
        return Err(TrainError::Length { what: "valid entries", expected: moving.len(), got: valid.len() });
    }
    if share.is_nan() || share <= 0.0 || share > 1.0 {
        let allowed = "the share of moving entries, above 0 and at most 1";
        return Err(TrainError::BadLoss { field: "still.share", value: share.to_string(), allowed });
    }
    let of = |moves: bool| moving.iter().zip(valid).filter(|(m, v)| **v != 0.0 && (**m != 0.0) == moves).count();
    let (moves, mut left) = (of(true), of(false));
    let few = moves <= FEW;
    // 0.3 and 0.7 are no exact numbers: what is a whole number but for rounding counts as one.
    let wanted = (moves as f64 * (1.0 - share) / share + 1e-9).floor() as usize;
    let mut wanted = if few { left } else { wanted.min(left) };
    let mut choose = |(moving, valid): (&f32, &f32)| {
        if *valid == 0.0 {
            return 0.0;
        }
        if *moving != 0.0 {
            return if few { 0.0 } else { 1.0 };
        }
        let taken = wanted > 0 && (wanted == left || draw(wanted, left));
        wanted -= usize::from(taken);
        left -= 1;
        f32::from(u8::from(taken))
    };
    Ok(moving.iter().zip(valid).map(&mut choose).collect())
}

#[cfg(test)]
mod tests {
    use super::{SHARE, drawn};
    use crate::TrainError;

    /// 140 moving entries, 400 still ones, every tenth of either not valid.
    fn entries() -> (Vec<f32>, Vec<f32>) {
        let moving = (0..540).map(|i| f32::from(u8::from(i < 140))).collect();
        let valid = (0..540).map(|i| f32::from(u8::from(i % 10 != 0))).collect();
        (moving, valid)
    }

    #[test]
    fn the_share_is_met_and_moving_entries_all_count() {
        let (moving, valid) = entries();
        let drawn = drawn(&moving, &valid, SHARE, &mut |_, left| left.is_multiple_of(3)).unwrap();
        let count =
            |moves: bool| drawn.iter().zip(&moving).filter(|(d, m)| **d == 1.0 && (**m == 1.0) == moves).count();
        // 126 · 3/7 = 54.
        assert_eq!((count(true), count(false)), (126, 54));
        assert!(drawn.iter().zip(&valid).all(|(d, v)| *v == 1.0 || *d == 0.0));
        // The first still ones are not all it takes.
        assert_eq!(drawn[141..150].iter().filter(|d| **d == 1.0).count(), 3);
    }

    #[test]
    fn what_must_be_taken_is_taken() {
        let (moving, valid) = entries();
        // The draw refuses until there is no choice left.
        let last = drawn(&moving, &valid, SHARE, &mut |_, _| false).unwrap();
        assert_eq!(last[480..].iter().sum::<f32>(), 54.0);
        assert_eq!(last[140..480].iter().sum::<f32>(), 0.0);
    }

    #[test]
    fn few_moving_entries_leave_the_still_ones() {
        let moving: Vec<f32> = (0..300).map(|i| f32::from(u8::from(i < 100))).collect();
        let drawn = drawn(&moving, &[1.0; 300], SHARE, &mut |_, _| false).unwrap();
        assert_eq!(drawn[..100].iter().sum::<f32>(), 0.0);
        assert_eq!(drawn[100..].iter().sum::<f32>(), 200.0);
    }

    #[test]
    fn wrong_arguments_are_named() {
        let error = drawn(&[0.0; 3], &[0.0; 2], SHARE, &mut |_, _| true).unwrap_err();
        assert!(matches!(error, TrainError::Length { expected: 3, got: 2, .. }), "{error}");
        let error = drawn(&[0.0; 3], &[0.0; 3], 0.0, &mut |_, _| true).unwrap_err();
        assert!(error.to_string().contains("still.share is 0"), "{error}");
    }
}
