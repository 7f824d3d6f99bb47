//! A checkpoint: configuration and weights, with logical tensor names.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use omnix_tensors::{Dtype, Findings, TensorFile, TensorInfo, TensorView};
use serde_json::Value;

use crate::verify::{Verification, Verified};
use crate::{WeightsError, config, names};

/// A network's configuration and its weights, in one file or in shards.
#[derive(Debug)]
pub struct Checkpoint {
    config: Value,
    files: Vec<TensorFile>,
    /// Which file holds a tensor, by full name.
    index: BTreeMap<String, usize>,
    metadata: BTreeMap<String, String>,
    prefix: String,
    name: String,
    path: PathBuf,
    /// What it was taken for without a configuration.
    taken_for: Option<&'static str>,
    verification: Verification,
}

impl Checkpoint {
    /// Takes a configuration and a whole safetensors file from memory, for a default embedded in a program. `name` is
    /// what messages and [`Checkpoint::name`] say, unless the configuration has a `model_name`.
    ///
    /// # Errors
    /// As [`Checkpoint::open`].
    pub fn from_bytes(name: &str, config: &str, weights: Cow<'static, [u8]>) -> Result<Self, WeightsError> {
        let path = Path::new(name);
        let config = config::parse_config(config, path)?;
        let file = TensorFile::from_bytes(weights, name)?;
        let index = file.tensors().map(|(name, _)| (name.to_owned(), 0)).collect();
        Ok(Self::assemble(config, vec![file], index, name.to_owned(), path.to_owned()))
    }

    pub(crate) fn assemble(
        config: Value,
        files: Vec<TensorFile>,
        index: BTreeMap<String, usize>,
        name: String,
        path: PathBuf,
    ) -> Self {
        let mut metadata = BTreeMap::new();
        for file in &files {
            metadata.extend(file.metadata().iter().map(|(k, v)| (k.clone(), v.clone())));
        }
        let configured = config.get("key_prefix").and_then(Value::as_str);
        let stored: Vec<&str> = index.keys().map(String::as_str).collect();
        let prefix = names::detect_prefix(configured, &stored).or(configured).unwrap_or("").to_owned();
        let name = config.get("model_name").and_then(Value::as_str).map_or(name, str::to_owned);
        Self {
            config,
            files,
            index,
            metadata,
            prefix,
            name,
            path,
            taken_for: None,
            verification: Verification::default(),
        }
    }

    /// The same, taken for a published network of this configuration and name.
    pub(crate) fn taken(mut self, config: Value, name: &'static str) -> Self {
        if let Some(own) = config.get("model_name").or(config.get("name")).and_then(Value::as_str) {
            own.clone_into(&mut self.name);
        }
        (self.config, self.taken_for) = (config, Some(name));
        self
    }

    /// The published network that it was taken for by its tensors, where no configuration was beside it.
    #[must_use]
    pub const fn taken_for(&self) -> Option<&'static str> {
        self.taken_for
    }

    /// The parsed `config.json`, always an object.
    #[must_use]
    pub fn config_json(&self) -> &Value {
        &self.config
    }

    /// The `__metadata__` of all files together.
    #[must_use]
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    /// The configuration's `model_name`, else the name of the folder or file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What was opened, or the label of an embedded checkpoint.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The weight files, in the order of their names.
    #[must_use]
    pub fn files(&self) -> &[TensorFile] {
        &self.files
    }

    /// Reads all files once, on all processors: their digest, and every number looked at. Done once and remembered; several may
    /// ask at a time. None if `progress`, which is told bytes done and in all, broke off.
    pub fn verify(&self, progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>) -> Option<&Verified> {
        self.verification.run(&self.files, progress)
    }

    /// What [`Checkpoint::verify`] found, if it has been called.
    #[must_use]
    pub fn verified(&self) -> Option<&Verified> {
        self.verification.get()
    }

    /// What `verified`, of this checkpoint, found in a tensor, by logical name.
    #[must_use]
    pub fn findings(&self, verified: &Verified, name: &str) -> Findings {
        let full = self.resolve(name);
        let found = full.and_then(|full| Some(verified.of(*self.index.get(&full)?, &full)));
        found.unwrap_or_default()
    }

    /// BLAKE3 of the weight files' bytes, one after the other in the order of their names, as lower-case hexadecimal: that of
    /// [`Checkpoint::verify`].
    pub fn digest(&self) -> &str {
        self.verify(&mut |_, _| ControlFlow::Continue(())).map_or("", Verified::digest)
    }

    /// The prefix of the stored names: the configuration's `key_prefix` where the file has such names, else what stands in front
    /// of the names that every network has ([`names::detect_prefix`]).
    #[must_use]
    pub fn key_prefix(&self) -> &str {
        &self.prefix
    }

    /// The full name under which a logical name is stored: behind the prefix, or beside it where it is the metric network's of a nested
    /// one ([`names::METRIC`]); by way of an alias where the file dropped a shared tensor.
    #[must_use]
    pub fn resolve(&self, name: &str) -> Option<String> {
        let full = names::beside(&self.prefix, name).unwrap_or_else(|| format!("{}{name}", self.prefix));
        if self.index.contains_key(&full) {
            return Some(full);
        }
        names::alias(&full, &self.metadata).filter(|kept| self.index.contains_key(kept))
    }

    /// What the header says of a tensor, by logical name.
    #[must_use]
    pub fn info(&self, name: &str) -> Option<&TensorInfo> {
        self.info_stored(&self.resolve(name)?)
    }

    /// A tensor by logical name.
    ///
    /// # Errors
    /// When there is no such tensor, or its elements are not F32, F16, BF16 or F64.
    pub fn tensor(&self, name: &str) -> Result<TensorView<'_>, WeightsError> {
        let full = self.resolve(name).unwrap_or_else(|| format!("{}{name}", self.prefix));
        match self.index.get(&full) {
            Some(&file) => Ok(self.files[file].tensor(&full)?),
            None => Err(WeightsError::TensorMissing { tensor: full, path: self.path.clone() }),
        }
    }

    /// Gives back the memory that reading a tensor (by logical name) took, where the files are mapped: a checkpoint that is
    /// uploaded tensor by tensor never lies in memory whole.
    pub fn release(&self, name: &str) {
        if let Some(full) = self.resolve(name)
            && let Some(&file) = self.index.get(&full)
        {
            self.files[file].release(&full);
        }
    }

    /// All stored tensors by full name, in the order of their names.
    pub fn tensors(&self) -> impl Iterator<Item = (&str, &TensorInfo)> {
        self.index.keys().filter_map(|full| Some((full.as_str(), self.info_stored(full)?)))
    }

    /// The file, the bytes and the type of a tensor of a known type, by its full name or an alias of it.
    pub(crate) fn stored(&self, full: &str) -> Option<(&TensorFile, &[u8], Dtype)> {
        let full = if self.index.contains_key(full) { full } else { self.metadata.get(full)? };
        let file = &self.files[*self.index.get(full)?];
        Some((file, file.tensor_bytes(full)?, file.info(full)?.known()?))
    }

    /// The network's own tensors by full name, in the order of their names. A tensor that is stored under a name outside of the network has the
    /// name that leads there.
    pub(crate) fn network_tensors(&self) -> impl Iterator<Item = (&str, &TensorInfo)> {
        let metric = names::beside(&self.prefix, &format!("{}.", names::METRIC));
        let own =
            move |name: &str| name.starts_with(&self.prefix) || metric.as_ref().is_some_and(|m| name.starts_with(m));
        let aliases = self.metadata.iter().filter(|(alias, kept)| own(alias) && !own(kept));
        let led = aliases.filter_map(|(alias, kept)| Some((alias.as_str(), self.info_stored(kept)?)));
        let all: BTreeMap<&str, &TensorInfo> = self.tensors().filter(|(name, _)| own(name)).chain(led).collect();
        all.into_iter()
    }

    fn info_stored(&self, full: &str) -> Option<&TensorInfo> {
        self.files[*self.index.get(full)?].info(full)
    }
}
