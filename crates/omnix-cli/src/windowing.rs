//! Windows of a long film, as a user asks for them or the memory budget does.

use omnix::io::Export;
use omnix::model::config::NetworkConfig;
use omnix::windows::Layout;
use omnix::{OmnixError, ReferenceChoice};

use crate::args::{Cameras, RunArgs};
use crate::error::CliError;

/// Images of a window, and how many of them the next one has too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct WindowSize {
    pub(crate) images: usize,
    pub(crate) overlap: usize,
}

/// Fewer images than this in a window would hardly show the same things: nobody gets such windows who did not ask for them.
const LEAST: usize = 8;

impl WindowSize {
    /// The windows that were asked for.
    pub(crate) fn asked(args: &RunArgs) -> Result<Option<Self>, CliError> {
        let Some(images) = args.window else { return Ok(None) };
        let size = Self { images, overlap: args.overlap.unwrap_or(usual_overlap(images)) };
        size.checked().map(Some)
    }

    /// Windows for a film of which `most` images fit, unless those are too few.
    pub(crate) fn fitting(most: usize, args: &RunArgs) -> Result<Option<Self>, CliError> {
        if most < LEAST {
            return Ok(None);
        }
        let size = Self { images: most, overlap: args.overlap.unwrap_or(usual_overlap(most)) };
        size.checked().map(Some)
    }

    fn checked(self) -> Result<Self, CliError> {
        match Layout::check(self.images, self.overlap) {
            Err(OmnixError::Request { reason }) => {
                Err(CliError::Usage(format!("--window {} --overlap {}: {reason}", self.images, self.overlap)))
            }
            other => other.map(|()| self).map_err(CliError::from),
        }
    }

    /// How many windows a film without cuts has.
    pub(crate) fn count(self, images: usize) -> Result<usize, CliError> {
        Ok(Layout::new(images, self.images, self.overlap, &[])?.windows().len())
    }
}

/// A quarter of a window.
fn usual_overlap(images: usize) -> usize {
    (images / 4).max(1)
}

/// What does not go together with windows, in words; none if all does.
pub(crate) fn obstacle(args: &RunArgs, network: &NetworkConfig) -> Option<&'static str> {
    if network.makes_sky() || !network.makes_cameras() {
        return Some("this network's depth depends on the sky of all images together");
    }
    if matches!(args.cameras, Cameras::Known(_)) {
        return Some("known cameras (--cameras PATH) bring all images into their own world at once");
    }
    if args.scale.is_some() {
        return Some("a known distance (--scale) is measured in one world of all images");
    }
    if matches!(args.reference, Some(ReferenceChoice::Forced(_))) {
        return Some("--reference by number names one image, and every window has a reference view of its own");
    }
    if args.all_tracks {
        return Some("--all-tracks follows every pixel, and points of windows are chosen");
    }
    None
}

/// The exports that windows make of those asked for, and those that are left out.
///
/// # Errors
/// Exports that were named and need all images at once.
pub(crate) fn possible(asked: &[Export], named: bool) -> Result<(Vec<Export>, Vec<Export>), CliError> {
    let (single, all) = split(asked);
    if named && !all.is_empty() {
        let all = names(&all);
        return Err(CliError::Usage(format!("--export {all} needs all images at once and cannot be made in windows")));
    }
    Ok((single, all))
}

/// The exports among `asked` that are made of single images, of points that may be lost or of the windows' fields, and those that are not, or of which windows keep
/// nothing (Gaussians, features).
pub(crate) fn split(asked: &[Export]) -> (Vec<Export>, Vec<Export>) {
    let made = |export: &Export| {
        let joined = export.takes_frames() || export.loses_points() || *export == Export::Field;
        joined && !export.needs_gaussians() && !export.needs_features()
    };
    asked.iter().copied().partition(made)
}

/// The exports of points among these.
pub(crate) fn of_points(exports: &[Export]) -> Vec<Export> {
    exports.iter().copied().filter(|export| export.loses_points()).collect()
}

/// Whether the windows' fields are kept for any of these.
pub(crate) fn need_fields(exports: &[Export]) -> bool {
    exports.iter().any(|export| export.loses_points() || *export == Export::Field)
}

/// Their names.
pub(crate) fn names(exports: &[Export]) -> String {
    exports.iter().map(|export| export.name()).collect::<Vec<_>>().join(", ")
}
