//! A run's folder: held against other runs, with the checkpoint that the run goes on from.

use std::path::{Path, PathBuf};

use omnix_io::output::OutputFolder;
use omnix_model::{Parts, manifest};
use omnix_weights::Checkpoint;

use crate::TrainError;
use crate::checkpoint::Saved;
use crate::config::{Recipe, Start};
use crate::ended::Ended;
use crate::init::{Origin, SeedValues, StartValues};
use crate::peers::Peers;

/// A folder that this run alone writes to.
#[derive(Debug)]
pub struct Session {
    recipe: Recipe,
    out: PathBuf,
    saved: Option<Saved>,
    _folder: OutputFolder,
}

impl Session {
    /// Takes hold of the folder and opens the checkpoint in it, if there is one.
    ///
    /// # Errors
    /// A folder that cannot be written to or that another run holds; a checkpoint of another network, of a newer program, or a
    /// damaged one.
    pub fn open(recipe: Recipe, out: &Path) -> Result<Self, TrainError> {
        let folder = OutputFolder::open(out)?;
        let saved = Saved::open(out, &recipe.network_json)?;
        Ok(Self { recipe, out: out.to_owned(), saved, _folder: folder })
    }

    /// What is trained, and how.
    #[must_use]
    pub const fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// The folder.
    #[must_use]
    pub fn out(&self) -> &Path {
        &self.out
    }

    /// The checkpoint that the run goes on from.
    #[must_use]
    pub const fn saved(&self) -> Option<&Saved> {
        self.saved.as_ref()
    }

    /// Closes the checkpoint's files, which are not needed once a step has taken them.
    pub(crate) fn forget_saved(&mut self) {
        self.saved = None;
    }

    /// The values that the network's tensors have before the first step of this process: those of the checkpoint that it goes on
    /// from, else those that the configuration asks for. They keep the files open that they come from: give them up once the device
    /// has them.
    ///
    /// # Errors
    /// A checkpoint that cannot be opened, or that has nothing in common with the network.
    pub fn start_values(&self) -> Result<StartValues, TrainError> {
        let seed = SeedValues { seed: self.recipe.config.seed, layer_scale: self.recipe.config.layer_scale };
        let (path, borrow_head) = match (&self.saved, &self.recipe.config.start) {
            (Some(saved), _) => (saved.path(), false),
            (None, Start::Seed) => return Ok(StartValues::seeded(seed)),
            (None, Start::Checkpoint { path }) => (path.as_path(), false),
            (None, Start::DepthAnything3 { path }) => (path.as_path(), true),
        };
        let values = StartValues::from_checkpoint(Checkpoint::open(path)?, borrow_head, seed);
        let expected = manifest(&self.recipe.network, &Parts::default());
        let fits = expected.expected().iter().any(|t| values.origin(&t.name, &t.shape) != Origin::Seed);
        if fits { Ok(values) } else { Err(TrainError::NothingFits { path: path.to_owned() }) }
    }
}
