//! What scenes are drawn from: a small table of ranges and weights, read from TOML and checked.
//!
//! ```toml
//! movers = [1, 5]                 # things that move, least and most
//! still = 0.08                    # part of the scenes in which nothing moves
//! least_motion = 0.01             # part of the pixels of all others that show something that moves
//! speed = [0.05, 0.8]             # widths of the scene a second
//! frames = 16                     # of a scene
//! frames_per_second = [8.0, 30.0]
//! field_of_view = [38.0, 85.0]    # across, degrees
//! noise = [0.0, 0.03]
//! models = [4, 16]                # imported models that stand still, least and most, where there are some
//! model_movers = 0.35             # part of the things that move that are imported models
//! inputs = "drawn"                # the kind of input of each sample; or "in-turn", each in its turn by the sample's index
//! [places]                        # weights
//! room = 4.0
//! ```

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::ScenesError;

/// A recipe is shorter than this.
const LONGEST: u64 = 1 << 20;

/// A recipe. What a file leaves out is as in [`Recipe::default`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Recipe {
    /// Weights of the kinds of places.
    pub places: Places,
    /// Number of things that move, least and most.
    pub movers: [usize; 2],
    /// Part of the scenes in which nothing moves.
    pub still: f64,
    /// Least part of a sample's pixels that show something that moves, but in scenes in which nothing does.
    pub least_motion: f64,
    /// Part of the cameras that look at something that moves.
    pub aimed: f64,
    /// Speed of things in widths of the scene a second, slowest and fastest.
    pub speed: [f64; 2],
    /// Frames that a scene's time holds.
    pub frames: usize,
    /// Pictures a second, least and most.
    pub frames_per_second: [f64; 2],
    /// Field of view across the picture in degrees, least and most.
    pub field_of_view: [f64; 2],
    /// Weights of how cameras move.
    pub cameras: Cameras,
    /// Distance of the principal point from the middle, in parts of the width, at most.
    pub principal: f64,
    /// Sensor noise, in parts of white, least and most.
    pub noise: [f64; 2],
    /// Part of the cameras whose pictures have been JPEGs.
    pub jpeg: f64,
    /// Part of the scenes whose pictures are blurred by motion.
    pub motion_blur: f64,
    /// Small things a square metre of table or shelf.
    pub clutter: f64,
    /// Imported models that stand still in a scene, least and most; fewer where there is no place for them. Without models, none.
    pub models: [usize; 2],
    /// Part of the things that move that are imported models, where some fit.
    pub model_movers: f64,
    /// How the kind of input of a sample is chosen; scenes that are written to files do not depend on it.
    pub inputs: Inputs,
    /// Draws of a scene or camera before it is given up.
    pub tries: usize,
}

/// How the kind of input of a sample is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Inputs {
    /// One camera 7 times of 10, several videos and photographs with a video 3 times of 20 each.
    Drawn,
    /// One camera, several videos, photographs with a video, by the sample's index modulo 3.
    InTurn,
}

/// Weights of the kinds of places.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Places {
    /// A furnished room.
    pub room: f64,
    /// A table in a room, from near.
    pub desk: f64,
    /// A street with houses.
    pub street: f64,
    /// Hills, trees and rocks.
    pub field: f64,
    /// Shapes of all kinds before a backdrop.
    pub studio: f64,
}

/// Weights of how cameras move.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Cameras {
    /// On a tripod.
    pub still: f64,
    /// Around the middle of the scene.
    pub orbit: f64,
    /// Straight on, back or to the side.
    pub dolly: f64,
    /// Along a curve.
    pub spline: f64,
    /// Held in the hand.
    pub hand: f64,
    /// Turned on the spot.
    pub pan: f64,
    /// With a changing focal length.
    pub zoom: f64,
}

impl Default for Places {
    fn default() -> Self {
        Self { room: 4.0, desk: 2.5, street: 1.5, field: 1.0, studio: 1.5 }
    }
}

impl Default for Cameras {
    fn default() -> Self {
        Self { still: 1.5, orbit: 2.0, dolly: 2.0, spline: 2.0, hand: 2.0, pan: 1.0, zoom: 0.5 }
    }
}

impl Default for Recipe {
    fn default() -> Self {
        Self {
            places: Places::default(),
            movers: [1, 5],
            still: 0.08,
            least_motion: 0.01,
            aimed: 0.5,
            speed: [0.05, 0.8],
            frames: 16,
            frames_per_second: [8.0, 30.0],
            field_of_view: [38.0, 85.0],
            cameras: Cameras::default(),
            principal: 0.03,
            noise: [0.0, 0.03],
            jpeg: 0.5,
            motion_blur: 0.3,
            clutter: 14.0,
            models: [4, 16],
            model_movers: 0.35,
            inputs: Inputs::Drawn,
            tries: 40,
        }
    }
}

impl Recipe {
    /// Reads a recipe from TOML.
    ///
    /// # Errors
    /// Text that is no recipe, and values outside of what they can be.
    pub fn parse(text: &str) -> Result<Self, ScenesError> {
        let recipe: Self = toml::from_str(text)?;
        recipe.check()?;
        Ok(recipe)
    }

    /// Reads a recipe from a file.
    ///
    /// # Errors
    /// A file that cannot be read, and those of [`Self::parse`].
    pub fn read(path: &Path) -> Result<Self, ScenesError> {
        let text = omnix_tensors::read_text(path, LONGEST)
            .map_err(|error| ScenesError::Read { path: path.to_owned(), source: std::io::Error::other(error) })?;
        Self::parse(&text)
    }

    /// The first value that is outside of what it can be.
    ///
    /// # Errors
    /// [`ScenesError::Recipe`] names it.
    pub fn check(&self) -> Result<(), ScenesError> {
        let Places { room, desk, street, field, studio } = self.places;
        weights("places", &[room, desk, street, field, studio])?;
        weights("cameras", &self.cameras.weights())?;
        range("speed", self.speed, 1e-4, 20.0, "two numbers from 0.0001 to 20, the smaller first")?;
        range(
            "frames_per_second",
            self.frames_per_second,
            0.1,
            1000.0,
            "two numbers from 0.1 to 1000, the smaller first",
        )?;
        range(
            "field_of_view",
            self.field_of_view,
            5.0,
            150.0,
            "two numbers of degrees from 5 to 150, the smaller first",
        )?;
        range("noise", self.noise, 0.0, 0.5, "two numbers from 0 to 0.5, the smaller first")?;
        range("still", [self.still; 2], 0.0, 1.0, "a number from 0 to 1")?;
        range("least_motion", [self.least_motion; 2], 0.0, 0.5, "a number from 0 to 0.5")?;
        range("aimed", [self.aimed; 2], 0.0, 1.0, "a number from 0 to 1")?;
        range("jpeg", [self.jpeg; 2], 0.0, 1.0, "a number from 0 to 1")?;
        range("motion_blur", [self.motion_blur; 2], 0.0, 1.0, "a number from 0 to 1")?;
        range("principal", [self.principal; 2], 0.0, 0.4, "a number from 0 to 0.4")?;
        range("clutter", [self.clutter; 2], 0.0, 200.0, "a number from 0 to 200")?;
        range("model_movers", [self.model_movers; 2], 0.0, 1.0, "a number from 0 to 1")?;
        let [least, most] = self.models;
        if least > most || most > 200 {
            return Err(wrong(
                "models",
                format!("{:?}", self.models),
                "two whole numbers up to 200, the smaller first",
            ));
        }
        let [least, most] = self.movers;
        if least > most || most > 40 {
            return Err(wrong("movers", format!("{:?}", self.movers), "two whole numbers up to 40, the smaller first"));
        }
        if self.frames == 0 || self.frames > 1000 {
            return Err(wrong("frames", self.frames.to_string(), "a whole number from 1 to 1000"));
        }
        if self.tries == 0 || self.tries > 10_000 {
            return Err(wrong("tries", self.tries.to_string(), "a whole number from 1 to 10000"));
        }
        Ok(())
    }
}

impl Cameras {
    pub(crate) fn weights(&self) -> [f64; 7] {
        [self.still, self.orbit, self.dolly, self.spline, self.hand, self.pan, self.zoom]
    }
}

fn wrong(field: &'static str, value: String, expected: &'static str) -> ScenesError {
    ScenesError::Recipe { field, value, expected }
}

fn range(
    field: &'static str,
    [low, high]: [f64; 2],
    least: f64,
    most: f64,
    expected: &'static str,
) -> Result<(), ScenesError> {
    // A NaN is in no range.
    let good = low >= least && low <= high && high <= most;
    if good { Ok(()) } else { Err(wrong(field, format!("[{low}, {high}]"), expected)) }
}

fn weights(field: &'static str, weights: &[f64]) -> Result<(), ScenesError> {
    let good = weights.iter().all(|w| (0.0..=1e6).contains(w)) && weights.iter().any(|&w| w > 0.0);
    if good {
        Ok(())
    } else {
        Err(wrong(field, format!("{weights:?}"), "weights from 0 to 1000000, one of them above 0"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recipe_is_read_and_checked() {
        let recipe = Recipe::parse("movers = [0, 2]\n[places]\nroom = 0.0\n").unwrap();
        assert_eq!((recipe.movers, recipe.places.room, recipe.places.desk), ([0, 2], 0.0, Places::default().desk));
        assert_eq!(Recipe::parse("").unwrap(), Recipe::default());
        for (text, name) in [
            ("movers = [3, 2]", "movers"),
            ("models = [3, 2]", "models"),
            ("inputs = \"some\"", "inputs"),
            ("model_movers = nan", "model_movers"),
            ("speed = [0.0, 1.0]", "speed"),
            ("field_of_view = [60.0, 50.0]", "field_of_view"),
            ("frames_per_second = [nan, 1.0]", "frames_per_second"),
            ("still = 2.0", "still"),
            ("tries = 0", "tries"),
            ("frames = 0", "frames"),
            ("colour = 1", "colour"),
            ("[places]\nroom = -1.0", "places"),
            ("[cameras]\nstill=0.0\norbit=0.0\ndolly=0.0\nspline=0.0\nhand=0.0\npan=0.0\nzoom=0.0", "cameras"),
        ] {
            let error = Recipe::parse(text).unwrap_err().to_string();
            assert!(error.contains(name), "{text}: {error}");
        }
    }
}
