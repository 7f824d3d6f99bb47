//! What a caller says of reading: which frames, how strict, and when to stop.

use std::{fmt, sync::Arc};

use super::choice::FrameChoice;
use crate::IoError;

/// How inputs are read.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct ReadOptions {
    /// Which frames of each video are used.
    pub choice: FrameChoice,
    /// Refuse damaged and cut-off videos instead of using what can be decoded.
    pub strict: bool,
    /// Asked again and again while a video is read.
    pub stop: Stop,
}

impl ReadOptions {
    /// These frames; damaged videos are used as far as they go, and nothing stops the reading.
    #[must_use]
    pub fn new(choice: FrameChoice) -> Self {
        Self { choice, ..Self::default() }
    }

    /// Sets [`Self::strict`].
    #[must_use]
    pub fn strict(mut self, strict: bool) -> Self {
        self.strict = strict;
        self
    }

    /// Sets [`Self::stop`].
    #[must_use]
    pub fn stop(mut self, stop: Stop) -> Self {
        self.stop = stop;
        self
    }
}

/// A question that is asked while a video is read: whether to stop. Reading then ends with [`IoError::Interrupted`].
#[derive(Clone, Default)]
pub struct Stop(Option<Arc<dyn Fn() -> bool + Send + Sync>>);

impl Stop {
    /// Stops as soon as `asked` says so. It is called about twenty times a second.
    pub fn when(asked: impl Fn() -> bool + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(asked)))
    }

    /// [`IoError::Interrupted`] once the caller wants to stop.
    pub(super) fn check(&self) -> Result<(), IoError> {
        match &self.0 {
            Some(asked) if asked() => Err(IoError::Interrupted),
            _ => Ok(()),
        }
    }
}

impl fmt::Debug for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Stop(asked)" } else { "Stop(never)" })
    }
}
