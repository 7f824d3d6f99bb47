//! The calls that wait for the device, for programs with a thread to spare: each blocks where its `_async` namesake is a future. A web
//! page has no such thread; there only the futures exist.

use pollster::block_on;

use crate::engine::Engine;
use crate::error::OmnixError;
use crate::event::Listener;
use crate::field::{Field, PathPiece, Paths, Query, ResidentPaths};
use crate::plan::RunPlan;
use crate::render::{Rendered, Renderer, Shot};
use crate::session::Session;
use crate::weights::Weights;

impl Engine {
    /// As [`Engine::open_async`].
    ///
    /// # Errors
    /// As there.
    pub fn open(wanted: Option<&str>) -> Result<Self, OmnixError> {
        block_on(Self::open_async(wanted))
    }

    /// As [`Engine::open_experimental_async`].
    ///
    /// # Errors
    /// As there.
    #[cfg(feature = "experimental")]
    pub fn open_experimental(wanted: Option<&str>) -> Result<Self, OmnixError> {
        block_on(Self::open_experimental_async(wanted))
    }
}

impl Session {
    /// As [`Session::new_async`].
    ///
    /// # Errors
    /// As there.
    pub fn new(engine: &Engine, weights: &Weights, plan: RunPlan, listener: Listener<'_>) -> Result<Self, OmnixError> {
        block_on(Self::new_async(engine, weights, plan, listener))
    }

    /// As [`Session::set_image_async`].
    ///
    /// # Errors
    /// As there.
    pub fn set_image(&mut self, index: usize, pixels: &[f32]) -> Result<(), OmnixError> {
        block_on(self.set_image_async(index, pixels))
    }

    /// As [`Session::run_async`].
    ///
    /// # Errors
    /// As there.
    pub fn run(&mut self, listener: Listener<'_>) -> Result<(), OmnixError> {
        block_on(self.run_async(listener))
    }

    /// As [`Session::run_resident_async`].
    ///
    /// # Errors
    /// As there.
    pub fn run_resident(&mut self, listener: Listener<'_>) -> Result<(), OmnixError> {
        block_on(self.run_resident_async(listener))
    }
}

impl Renderer {
    /// As [`Renderer::picture_async`].
    ///
    /// # Errors
    /// As there.
    pub fn picture(&self, shot: &Shot) -> Result<Rendered, OmnixError> {
        block_on(self.picture_async(shot))
    }
}

impl Field {
    /// As [`Field::points_async`].
    ///
    /// # Errors
    /// As there.
    pub fn points(&self, image: usize) -> Result<Vec<f32>, OmnixError> {
        block_on(self.points_async(image))
    }

    /// As [`Field::paths_async`].
    ///
    /// # Errors
    /// As there.
    pub fn paths(&self, query: &Query) -> Result<Paths, OmnixError> {
        block_on(self.paths_async(query))
    }

    /// As [`Field::stream_async`].
    ///
    /// # Errors
    /// As there.
    pub fn stream(
        &self,
        query: &Query,
        each: &mut dyn FnMut(&PathPiece<'_>) -> Result<(), OmnixError>,
    ) -> Result<(), OmnixError> {
        block_on(self.stream_async(query, each))
    }

    /// As [`Field::resident_paths_async`].
    ///
    /// # Errors
    /// As there.
    pub fn resident_paths(&self, query: &Query) -> Result<ResidentPaths, OmnixError> {
        block_on(self.resident_paths_async(query))
    }
}
