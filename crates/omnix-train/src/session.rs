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
    /// As [`Session::open`], in every process; processes that train another configuration, are of another version, or do not see the same
    /// checkpoint.
    pub fn join(recipe: Recipe, out: &Path, peers: &dyn Peers) -> Result<Self, TrainError> {
        let leads = peers.rank() == 0;
        let opened = leads.then(|| Self::open(recipe.clone(), out));
        // A folder that cannot be used is the failure of all.
        told(peers, opened.as_ref().and_then(|opened| opened.as_ref().err()))?;
        if let Some(Err(error)) = opened {
            return Err(error);
        }
        let session = match opened {
            Some(opened) => opened,
            None => Saved::look(out, &recipe.network_json).map(|saved| Self {
                recipe: recipe.clone(),
                out: out.to_owned(),
                saved,
                folder: None,
            }),
        };
        told(peers, session.as_ref().err())?;
        let session = session?;
        let step = session.saved.as_ref().map_or(0, |saved| saved.progress().step);
        let mine = serde_json::to_vec(&(step, fingerprint(&session.recipe))).unwrap_or_default();
        let all = peers.gather(&mine)?;
        let all = all.iter().map(|text| serde_json::from_slice::<(u64, String)>(text).unwrap_or_default());
        let all: Vec<(u64, String)> = all.collect();
        let Some((expected, recipe)) = all.first().cloned() else { return Ok(session) };
        for (rank, (found, other)) in (0..).zip(all) {
            if other != recipe {
                return Err(TrainError::PeerRecipe { rank });
            }
            if found != expected {
                return Err(TrainError::PeerState { rank, found, expected });
            }
        }
        Ok(session)
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

/// Tells all processes of this one's failure, and is an error where any has failed: this one's own, or that of the first that did.
fn told(peers: &dyn Peers, mine: Option<&TrainError>) -> Result<(), TrainError> {
    let texts = peers.gather(&serde_json::to_vec(&mine.map(Ended::failed)).unwrap_or_default())?;
    if mine.is_some() {
        // The caller has it, and says more than what the others are told of it.
        return Ok(());
    }
    for (rank, text) in (0..).zip(texts) {
        if let Ok(Some(Ended::Failed { host, reason })) = serde_json::from_slice::<Option<Ended>>(&text) {
            return Err(TrainError::Peer { rank, host, reason });
        }
    }
    Ok(())
}

/// What has to be the same in all processes: the program's version, the network and the settings, but for where files lie.
fn fingerprint(recipe: &Recipe) -> String {
    let mut settings = recipe.config.settings();
    if let Some(settings) = settings.as_object_mut() {
        ["data", "start", "network", "validation"].iter().for_each(|key| _ = settings.remove(*key));
    }
    let all = serde_json::json!([env!("CARGO_PKG_VERSION"), settings, recipe.network_json]);
    blake3::hash(all.to_string().as_bytes()).to_hex().to_string()
}
