//! The choice of points over many sizes.

use omnix_io::output::{PointOptions, VoxelOptions, choose_points, choose_voxel};
use proptest::prelude::*;

proptest! {
    #[test]
    fn budgets_are_met(budget in 0usize..400, images in 1usize..5, width in 1usize..12, height in 1usize..12, seed: u64) {
        let pixels = width * height;
        let score = |i: usize| ((i * 7919 + seed as usize % 97) % 101) as f32 / 100.0;
        let scores: Vec<Vec<f32>> = (0..images).map(|s| (0..pixels).map(|p| score(s * pixels + p)).collect()).collect();
        let images: Vec<&[f32]> = scores.iter().map(Vec::as_slice).collect();
        let chosen = choose_points(&images, width, &PointOptions::new(budget).seed(seed));
        let total: usize = chosen.iter().map(Vec::len).sum();
        prop_assert_eq!(total, budget.min(images.len() * pixels));
        prop_assert!(chosen.iter().all(|c| c.windows(2).all(|w| w[0] < w[1])));
    }

    #[test]
    fn voxels_meet_the_budget(budget in 0usize..300, count in 0usize..200, reserve in 0.0f64..1.0) {
        let scores: Vec<f32> = (0..count).map(|i| (i * 37 % 100) as f32 / 100.0).collect();
        let positions: Vec<f32> = (0..3 * count).map(|i| (i * i % 51) as f32).collect();
        let options = VoxelOptions::default().budget(budget).reserve(reserve).threshold(0.4);
        let choice = choose_voxel(&scores, &positions, &vec![true; count], &options);
        prop_assert_eq!(choice.chosen.len(), budget.min(count));
        prop_assert!(choice.chosen.windows(2).all(|w| w[0] < w[1]));
        prop_assert!(choice.cutoff.is_none_or(|c| c >= 0.4));
    }
}

#[test]
fn equal_scores_and_one_place() {
    let choice = choose_voxel(&[0.5; 10], &[1.0; 30], &[true; 10], &VoxelOptions::default().budget(4));
    // Three by score, the lower index first; one cell holds all the others.
    assert_eq!((choice.dynamic, choice.chosen), (3, vec![0, 1, 2, 3]));
}
