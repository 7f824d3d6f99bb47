//! Points by "dynamic-reserved-voxel-v1" (`omnix.md` section 12): the most dynamic first, the rest spread over space.
//!
//! 1. `round_half_even(reserve * n)` of the highest scores at or above the threshold; of equal scores the lower index.
//! 2. The rest from those left: the box of their positions is cut into `ceil((2 count)^(1/axes))` cells along each axis of extent
//!    above 1e-12, `cell = min(floor(cells * (p - min) / extent), cells - 1)` in f32; the first index of each occupied cell, in cell order (x slowest).
//!    Too many: those at the midpoints of equal intervals, `floor((j + 0.5) m / count)`. Too few: filled the same way from the
//!    indices still left.
//!
//! `n` is the budget, or the number of valid points if that is lower.

use super::options::VoxelOptions;

/// The chosen points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VoxelChoice {
    /// Indices, ascending.
    pub chosen: Vec<usize>,
    /// How many of them were chosen by score.
    pub dynamic: usize,
    /// The lowest score among these; `None` without any.
    pub cutoff: Option<f32>,
    /// Number of valid points that could have been chosen.
    pub valid: usize,
}

/// Chooses among n points with `scores`, `positions` at time 0 (three each) and `valid` (finite at all times, of a source image
/// that counts). Points with a score or position that is not finite are never chosen.
///
/// # Panics
/// If the lengths differ.
#[must_use]
pub fn choose_voxel(scores: &[f32], positions: &[f32], valid: &[bool], options: &VoxelOptions) -> VoxelChoice {
    assert!(positions.len() == 3 * scores.len() && valid.len() == scores.len(), "BUG: lengths of choose_voxel");
    let position = |i: usize| [positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]];
    let sound = |i: &usize| valid[*i] && scores[*i].is_finite() && position(*i).iter().all(|v| v.is_finite());
    let ids: Vec<usize> = (0..scores.len()).filter(sound).collect();
    let budget = options.budget.min(ids.len());
    let mut dynamic: Vec<usize> = ids.iter().copied().filter(|&i| scores[i] >= options.threshold as f32).collect();
    dynamic.sort_by(|&a, &b| scores[b].partial_cmp(&scores[a]).unwrap_or(std::cmp::Ordering::Equal));
    let reserved = (options.reserve.clamp(0.0, 1.0) * budget as f64).round_ties_even() as usize;
    dynamic.truncate(reserved.min(budget));
    let mut taken = vec![false; scores.len()];
    dynamic.iter().for_each(|&i| taken[i] = true);
    let rest: Vec<usize> = ids.iter().copied().filter(|&i| !taken[i]).collect();
    let mut chosen = spread_over_space(&rest, position, budget - dynamic.len());
    chosen.extend(&dynamic);
    chosen.sort_unstable();
    VoxelChoice { chosen, dynamic: dynamic.len(), cutoff: dynamic.last().map(|&i| scores[i]), valid: ids.len() }
}

/// Step 2: `count` of `rest`, in no particular order.
fn spread_over_space(rest: &[usize], position: impl Fn(usize) -> [f32; 3], count: usize) -> Vec<usize> {
    if count == 0 || rest.is_empty() {
        return Vec::new();
    }
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for &i in rest {
        let p = position(i);
        for a in 0..3 {
            low[a] = low[a].min(p[a]);
            high[a] = high[a].max(p[a]);
        }
    }
    let extent: [f32; 3] = std::array::from_fn(|a| high[a] - low[a]);
    let axes = extent.iter().filter(|&&e| e > 1e-12).count();
    let fine = (2.0 * count as f64).powf(1.0 / axes.max(1) as f64).ceil() as u64;
    let cells = extent.map(|e| if e > 1e-12 { fine } else { 1 });
    let cell = |p: [f32; 3], a: usize| -> u64 {
        if cells[a] == 1 {
            return 0;
        }
        ((cells[a] as f32 * (p[a] - low[a]) / extent[a]).floor() as u64).min(cells[a] - 1)
    };
    let mut keyed: Vec<(u64, usize)> = rest
        .iter()
        .map(|&i| {
            let p = position(i);
            ((cell(p, 0) * cells[1] + cell(p, 1)) * cells[2] + cell(p, 2), i)
        })
        .collect();
    keyed.sort_unstable();
    keyed.dedup_by_key(|(key, _)| *key);
    let firsts: Vec<usize> = keyed.into_iter().map(|(_, i)| i).collect();
    if firsts.len() >= count {
        return midpoints(&firsts, count);
    }
    let mut sorted = firsts.clone();
    sorted.sort_unstable();
    let left: Vec<usize> = rest.iter().copied().filter(|i| sorted.binary_search(i).is_err()).collect();
    let mut chosen = midpoints(&left, count - firsts.len());
    chosen.extend(firsts);
    chosen
}

/// `count` of the items, at the midpoints of as many equal intervals; all of them if there are no more.
pub(super) fn midpoints<T: Copy>(items: &[T], count: usize) -> Vec<T> {
    if items.len() <= count {
        return items.to_vec();
    }
    (0..count).map(|j| items[((j as f64 + 0.5) * items.len() as f64 / count as f64).floor() as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn highest_scores_then_space() {
        let scores = [0.1, 0.9, f32::NAN, 0.9, 0.2, 0.3];
        let positions: Vec<f32> = (0..6).flat_map(|i| [i as f32, 0.0, 0.0]).collect();
        let options = VoxelOptions { budget: 3, reserve: 0.5, threshold: 0.5 };
        let choice = choose_voxel(&scores, &positions, &[true; 6], &options);
        // Half of 3 is 1.5, rounded to the even 2.
        assert_eq!((choice.dynamic, choice.cutoff, choice.valid), (2, Some(0.9), 5));
        assert!(choice.chosen.contains(&1) && choice.chosen.contains(&3), "{:?}", choice.chosen);
        assert_eq!(choice.chosen.len(), 3);
    }

    #[test]
    fn budget_beyond_the_points_takes_all() {
        let choice = choose_voxel(&[0.5; 4], &[1.0; 12], &[true, false, true, true], &VoxelOptions::default());
        assert_eq!(choice.chosen, [0, 2, 3]);
        assert_eq!(choose_voxel(&[], &[], &[], &VoxelOptions::default()), VoxelChoice::default());
    }
}
