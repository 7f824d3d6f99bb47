//! A run's folder: held against other runs, with the checkpoint that the run goes on from.
//!
//! Of several processes that train together the first holds the folder; the others look at the checkpoint in it and write nothing.

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

/// A folder that this run alone writes to, or that another process of this run writes to.
#[derive(Debug)]
pub struct Session {
    recipe: Recipe,
    out: PathBuf,
    saved: Option<Saved>,
    /// None where another process leads.
    folder: Option<OutputFolder>,
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
        Ok(Self { recipe, out: out.to_owned(), saved, folder: Some(folder) })
    }

    /// The session of one of several processes: the first opens the folder, then the others look at it.
    ///
    /// # Errors
    /// As [`Session::open`], in every process; processes that do not see the same checkpoint.
    pub fn join(recipe: Recipe, out: &Path, peers: &dyn Peers) -> Result<Self, TrainError> {
        let leads = peers.rank() == 0;
        let first = leads.then(|| Self::open(recipe.clone(), out));
        // A folder that cannot be used is the failure of all.
        let reason = first.as_ref().and_then(|opened| opened.as_ref().err()).map(Ended::failed);
        let told = peers.gather(&serde_json::to_vec(&reason).unwrap_or_default())?;
        let session = match first {
            Some(opened) => opened?,
            None => {
                let failed = told.first().and_then(|text| serde_json::from_slice::<Option<Ended>>(text).ok()).flatten();
                if let Some(Ended::Failed { host, reason }) = failed {
                    return Err(TrainError::Peer { rank: 0, host, reason });
                }
                let saved = Saved::look(out, &recipe.network_json)?;
                Self { recipe, out: out.to_owned(), saved, folder: None }
            }
        };
        let step = session.saved.as_ref().map_or(0, |saved| saved.progress().step);
        let steps = peers.gather(&step.to_le_bytes())?;
        let steps = steps.iter().map(|bytes| bytes.as_slice().try_into().map_or(u64::MAX, u64::from_le_bytes));
        let steps: Vec<u64> = steps.collect();
        let expected = steps.first().copied().unwrap_or(step);
        match steps.iter().position(|found| *found != expected) {
            None => Ok(session),
            Some(rank) => Err(TrainError::PeerState { rank: rank as u32, found: steps[rank], expected }),
        }
    }

    /// Whether this process validates and writes.
    #[must_use]
    pub const fn leads(&self) -> bool {
        self.folder.is_some()
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
