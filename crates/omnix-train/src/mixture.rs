//! Where samples come from: sources by weight, of which sample n is a function of (seed, n) alone.
//!
//! So the whole state of the data is the number of the next sample. Which source it comes from is drawn in proportion to the weights.
//! Samples leave normalised (`spec/omnix.md` 11.1), those of training with their colours changed where that is asked for (11.3). Where a
//! sample is of several scenes, part k of sample n is what sample n · scenes + k would be with the images of one part, and the parts are
//! joined, each normalised for itself.

use omnix_data::augment::{colour, draw_colours};
use omnix_data::{Sample, Set, join, normalise};

use crate::TrainError;
use crate::config::{Config, Made, SampleConfig};
use crate::folder::Folder;
use crate::random::Random;
use crate::scenes::Scenes;
use crate::shapes::Shapes;
use crate::source::Source;

/// A sample, and what it is called.
#[derive(Debug)]
pub struct Drawn {
    /// Its number in the run.
    pub number: u64,
    /// Its source.
    pub label: String,
    /// The sample, normalised.
    pub sample: Sample,
}

/// Sources by weight.
pub struct Mixture {
    seed: u64,
    augment: bool,
    /// Scenes of a sample.
    scenes: u32,
    /// Each with the sum of the weights up to it, of a sum of 1.
    sources: Vec<(f64, Box<dyn Source>)>,
}

impl Mixture {
    /// These sources, by weight (above 0).
    #[must_use]
    pub fn new(seed: u64, weighted: Vec<(f64, Box<dyn Source>)>) -> Self {
        let all: f64 = weighted.iter().map(|(weight, _)| weight).sum();
        let mut sum = 0.0;
        let sources = weighted.into_iter().map(|(weight, source)| {
            sum += weight;
            (sum / all, source)
        });
        Self { seed, augment: false, scenes: 1, sources: sources.collect() }
    }

    /// The sources of a configuration. Where validation has none of its own, it draws from those of training with another seed.
    ///
    /// # Errors
    /// A source that cannot be opened.
    pub fn of(config: &Config, validation: bool) -> Result<Self, TrainError> {
        let purpose = if validation { "validation data" } else { "training data" };
        let own = config.validation.iter().filter(|_| validation).flat_map(|v| &v.data);
        let own: Vec<_> = own.collect();
        let SampleConfig { images, scenes, size } = config.sample;
        let images = images / scenes.max(1);
        let mut weighted = Vec::new();
        for data in if own.is_empty() { config.data.iter().collect() } else { own } {
            let source: Box<dyn Source> = match (data.made, &data.path) {
                (Some(Made::Shapes), _) => Box::new(Shapes::new(images, size)?),
                (Some(Made::Scenes), _) => {
                    Box::new(Scenes::new(data.recipe.as_deref(), data.photos.as_deref(), images, size)?)
                }
                (None, Some(path)) => {
                    let folder = Folder::open(path, data.set.as_deref().and_then(Set::of_name), images, size)?;
                    Box::new(folder.drawn(data.shares, data.step.map(|step| step as usize)))
                }
                (None, None) => {
                    return Err(TrainError::contradiction("data", "each table [[data]] has either made or path"));
                }
            };
            weighted.push((data.weight, source));
        }
        let seed = Random::new(config.seed, purpose, 0).bits();
        Ok(Self { augment: config.augment && !validation, scenes, ..Self::new(seed, weighted) })
    }

    /// Sample `number`.
    ///
    /// # Errors
    /// What keeps it from being read or made, with its number and source.
    pub fn draw(&self, number: u64) -> Result<Drawn, TrainError> {
        if self.scenes <= 1 {
            return self.part(number);
        }
        let scenes = u64::from(self.scenes);
        let parts: Vec<Drawn> = (0..scenes).map(|k| self.part(number * scenes + k)).collect::<Result<_, _>>().map_err(
            |error| match error {
                TrainError::Sample { label, source, .. } => TrainError::Sample { number, label, source },
                error => error,
            },
        )?;
        let label = parts.first().map_or_else(String::new, |part| part.label.clone());
        match join(parts.into_iter().map(|part| part.sample).collect()) {
            Ok(sample) => Ok(Drawn { number, label, sample }),
            Err(error) => Err(TrainError::Sample { number, label, source: Box::new(error.into()) }),
        }
    }

    /// A sample of one scene.
    fn part(&self, number: u64) -> Result<Drawn, TrainError> {
        let place = Random::new(self.seed, "source", number).uniform();
        let index = self.sources.partition_point(|(end, _)| *end <= place).min(self.sources.len().saturating_sub(1));
        let Some((_, source)) = self.sources.get(index) else {
            return Err(TrainError::contradiction("data", "there is no data: add a table [[data]]"));
        };
        let label = source.label();
        let prepared = |sample| {
            let sample = if self.augment { colour(sample, &draw_colours(self.seed, number))? } else { sample };
            Ok(normalise(sample)?.sample)
        };
        let sample = source.sample(self.seed, number).and_then(prepared);
        match sample {
            Ok(sample) => Ok(Drawn { number, label, sample }),
            Err(error) => Err(TrainError::Sample { number, label, source: Box::new(error) }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Named(&'static str);

    impl Source for Named {
        fn label(&self) -> String {
            self.0.to_owned()
        }

        fn sample(&self, seed: u64, number: u64) -> Result<Sample, TrainError> {
            Shapes::new(1, [14, 14])?.sample(seed, number)
        }
    }

    fn mixture() -> Mixture {
        Mixture::new(5, vec![(3.0, Box::new(Named("a"))), (1.0, Box::new(Named("b")))])
    }

    #[test]
    fn sources_are_drawn_by_weight_and_number() {
        let labels: Vec<String> = (0..400).map(|n| mixture().draw(n).unwrap().label).collect();
        let share = labels.iter().filter(|label| *label == "a").count();
        assert!((270..330).contains(&share), "{share}");
        // In another order, the same.
        assert!((0..400).rev().step_by(37).all(|n| mixture().draw(n as u64).unwrap().label == labels[n]));
        assert_eq!(mixture().draw(7).unwrap().sample, mixture().draw(7).unwrap().sample);
    }

    #[test]
    fn a_sample_of_several_scenes_joins_their_parts() {
        let joined = Mixture { scenes: 3, ..mixture() };
        let drawn = joined.draw(2).unwrap();
        assert_eq!((drawn.number, drawn.sample.count()), (2, 3));
        for (k, number) in (6..9).enumerate() {
            let part = mixture().draw(number).unwrap().sample;
            assert_eq!((drawn.sample.image(k), drawn.sample.cameras()[k]), (part.image(0), part.cameras()[0]));
            assert_eq!(drawn.sample.depth(k), part.depth(0));
        }
    }
}
