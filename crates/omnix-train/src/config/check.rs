//! Every setting alone, and all of them beside each other.

use omnix_data::Set;
use omnix_model::PATCH;

use super::{Config, DataConfig, Made, Optimiser, SampleConfig, Validation};
use crate::TrainError;

fn need(holds: bool, key: &str, cure: &str) -> Result<(), TrainError> {
    if holds { Ok(()) } else { Err(TrainError::contradiction(key, cure)) }
}

impl Config {
    /// Bytes of the memory budget.
    ///
    /// # Errors
    /// A text that is no size.
    pub fn budget_bytes(&self) -> Result<Option<u64>, TrainError> {
        let bad = || TrainError::contradiction("memory_budget", "write a number with MiB or GiB, such as 4GiB");
        let Some(text) = &self.memory_budget else { return Ok(None) };
        let (number, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len()));
        let unit = match unit.to_ascii_lowercase().as_str() {
            "gib" => 1u64 << 30,
            "mib" => 1 << 20,
            _ => return Err(bad()),
        };
        let number: f64 = number.trim().parse().map_err(|_| bad())?;
        let bytes = number * unit as f64;
        if (1.0..1e18).contains(&bytes) { Ok(Some(bytes as u64)) } else { Err(bad()) }
    }

    /// Checks every number, and the keys against each other.
    ///
    /// # Errors
    /// The first that cannot be, with its cure.
    pub fn check(&self) -> Result<(), TrainError> {
        let Optimiser { betas, eps, decay, clip, accumulate, average } = &self.optimiser;
        let share = |v: f64| (0.0..1.0).contains(&v);
        let size = |v: f64| v.is_finite() && v >= 0.0;
        need(self.steps > 0, "steps", "train at least one step")?;
        need(!self.data.is_empty(), "data", "there is no data: add a table [[data]]")?;
        let held_out = self.validation.iter().flat_map(|validation| &validation.data);
        self.data.iter().chain(held_out).try_for_each(DataConfig::check)?;
        need(self.sample.images > 0, "sample.images", "a sample has at least one image")?;
        let SampleConfig { images, scenes, .. } = self.sample;
        let shares = scenes > 0 && images.is_multiple_of(scenes);
        need(shares, "sample.scenes", "the images of a sample are shared equally by its scenes")?;
        let patches = self.sample.size.iter().all(|side| *side > 0 && side.is_multiple_of(PATCH as u32));
        need(patches, "sample.size", "width and height are multiples of 14")?;
        need(betas.iter().all(|beta| share(*beta)), "optimiser.betas", "both are from 0 to below 1")?;
        need(eps.is_finite() && *eps > 0.0, "optimiser.eps", "it is above 0")?;
        need(size(*decay) && size(*clip), "optimiser.decay and optimiser.clip", "they are 0 or more")?;
        need((1..=1 << 16).contains(accumulate), "optimiser.accumulate", "it is 1 to 65536 samples")?;
        need(share(*average), "optimiser.average", "it is from 0 to below 1")?;
        need(self.layer_scale.is_finite() && self.layer_scale > 0.0, "layer_scale", "it is a number above 0")?;
        need((0.0..1.0).contains(&self.dropout), "dropout", "it is from 0 to below 1")?;
        self.check_groups()?;
        self.loss.check()?;
        need((0.0..=1.0).contains(&self.schedule.last), "schedule.last", "it is from 0 to 1")?;
        let length = self.schedule.length.unwrap_or(self.steps);
        let fits = self.schedule.warm_up < length || self.schedule.warm_up == 0;
        need(fits, "schedule.warm_up", "the warm-up is shorter than the schedule: lower it, or raise steps")?;
        if let Some(Validation { every, samples, data }) = &self.validation {
            need(*every > 0, "validation.every", "it is at least 1 step; leave [validation] out for none")?;
            need(
                *samples > 0,
                "validation.samples",
                "validate on at least one sample; leave [validation] out for none",
            )?;
            let held_out = !data.is_empty() || self.data.iter().all(|data| data.made.is_some());
            need(held_out, "validation.data", "name data that is not trained on, as [[validation.data]]")?;
        }
        let minutes = self.checkpoint.every_minutes;
        need(minutes.is_finite() && minutes >= 0.0, "checkpoint.every_minutes", "it is 0 or more")?;
        let figure = self.validation.is_some() || self.checkpoint.best != Some(true);
        need(figure, "checkpoint.best", "the best is chosen by validation: add [validation], or leave this out")?;
        self.budget_bytes().map(|_| ())
    }

    fn check_groups(&self) -> Result<(), TrainError> {
        if self.group.is_empty() {
            return Err(TrainError::contradiction(
                "group",
                "add a group with a rate, or leave the key out for the release's",
            ));
        }
        for (index, group) in self.group.iter().enumerate() {
            let key = |what: &str| format!("{what} of group \"{}\"", group.name);
            let usable = |v: f64| v.is_finite() && v >= 0.0;
            match (group.rate, group.frozen) {
                (Some(_), true) => {
                    return Err(TrainError::contradiction(
                        &key("rate"),
                        "a frozen group has no rate: leave one of them out",
                    ));
                }
                (None, false) => {
                    return Err(TrainError::contradiction(
                        &key("rate"),
                        "give it a rate, or freeze it (frozen = true)",
                    ));
                }
                (Some(rate), false) if !usable(rate) => {
                    return Err(TrainError::contradiction(&key("rate"), "it is 0 or more"));
                }
                _ => {}
            }
            if group.decay.is_some_and(|decay| !usable(decay)) {
                return Err(TrainError::contradiction(&key("decay"), "it is 0 or more"));
            }
            // Whatever contains a name also contains each part of it.
            if let Some(first) = self.group[..index].iter().find(|first| group.name.contains(&first.name)) {
                let cure = format!("group \"{}\" before it takes all its tensors: move it up", first.name);
                return Err(TrainError::contradiction(&format!("group \"{}\"", group.name), &cure));
            }
        }
        Ok(())
    }
}

impl DataConfig {
    fn check(&self) -> Result<(), TrainError> {
        let Self { made, recipe, photos, path, set, shares, step, weight } = self;
        let one = made.is_some() != path.is_some();
        need(one, "data", "each table [[data]] has either made or path")?;
        let of_scenes = recipe.is_some() || photos.is_some();
        need(
            *made == Some(Made::Scenes) || !of_scenes,
            "data.recipe and data.photos",
            "they go with made = \"scenes\"",
        )?;
        let of_files = set.is_some() || shares.is_some() || step.is_some();
        need(path.is_some() || !of_files, "data.set, data.shares and data.step", "they go with path, not with made")?;
        if let Some(set) = set {
            let known = Set::ALL.map(Set::name).join(", ");
            need(Set::of_name(set).is_some(), "data.set", &format!("`{set}` is not one of {known}"))?;
        }
        if let Some(shares) = shares {
            let sum: f64 = shares.iter().sum();
            let fits = shares.iter().all(|share| *share >= 0.0) && (sum - 1.0).abs() < 1e-6;
            need(fits, "data.shares", "three numbers that are 0 or more, with the sum 1")?;
        }
        need(*step != Some(0), "data.step", "it is at least 1 frame")?;
        need(weight.is_finite() && *weight > 0.0, "data.weight", "weights are above 0; leave the data out")
    }
}
