//! Samples of made scenes (`omnix-scenes`), straight from a seed: nothing lies on a disk.

use std::path::Path;

use omnix_data::Sample;
use omnix_scenes::{Assets, Recipe, Samples};

use crate::TrainError;
use crate::source::Source;

/// Scenes of a recipe.
#[derive(Debug)]
pub struct Scenes {
    samples: Samples,
}

impl Scenes {
    /// Samples of this number of images of this width and height. `recipe` is what scenes are drawn from, the standard one where it is
    /// not given; `photos` a folder with photographs for textures, and models; models that cannot be used are left out.
    ///
    /// # Errors
    /// A recipe or photographs that cannot be used.
    pub fn new(recipe: Option<&Path>, photos: Option<&Path>, images: u32, size: [u32; 2]) -> Result<Self, TrainError> {
        let recipe = recipe.map_or_else(|| Ok(Recipe::default()), Recipe::read)?;
        let assets = photos.map_or_else(|| Ok(Assets::default()), Assets::read)?;
        let (size, images) = (size.map(|side| side as usize), images as usize);
        // No term of the objective asks what is visible.
        Ok(Self { samples: Samples { recipe, assets, size, images, visibility: false, seed: 0 } })
    }
}

impl Source for Scenes {
    fn label(&self) -> String {
        "made scenes".to_owned()
    }

    fn sample(&self, seed: u64, number: u64) -> Result<Sample, TrainError> {
        // Assets are shared, the rest is a few numbers.
        Ok(Samples { seed, ..self.samples.clone() }.get(number)?)
    }
}

#[cfg(test)]
mod tests {
    use omnix_data::Motion;

    use super::*;

    #[test]
    fn a_function_of_seed_and_number_with_paths() {
        let scenes = Scenes::new(None, None, 2, [56, 42]).unwrap();
        let sample = scenes.sample(3, 5).unwrap();
        assert_eq!((sample.count(), sample.size()), (2, [56, 42]));
        assert!(matches!(sample.motion(), Motion::Dense(dense) if dense.positions.len() == 4 * 56 * 42));
        assert_eq!(sample.parts().images, scenes.sample(3, 5).unwrap().parts().images);
        assert_ne!(sample.parts().images, scenes.sample(4, 5).unwrap().parts().images);
    }

    #[test]
    fn recipes_and_sizes_that_cannot_be_are_refused() {
        let none = Path::new("no such file");
        assert!(matches!(Scenes::new(Some(none), None, 2, [56, 42]), Err(TrainError::Scenes(_))));
        assert!(matches!(Scenes::new(None, Some(none), 2, [56, 42]), Err(TrainError::Scenes(_))));
        let many = Scenes::new(None, None, 1000, [56, 42]).unwrap();
        assert!(matches!(many.sample(1, 1), Err(TrainError::Scenes(_))));
    }
}
