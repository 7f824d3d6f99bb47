//! What can be wrong with cameras and rays.

/// An error of a fit or a conversion.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GeometryError {
    /// Fewer cameras than an alignment needs.
    #[error(
        "aligning cameras needs at least 3 views with centres not on one line, got {views}; leave the cameras out or add views"
    )]
    TooFewViews {
        /// Views given.
        views: usize,
    },

    /// Camera centres on one line or at one point.
    #[error(
        "the {which} camera centres lie on one line or at one point, so no similarity is determined; add views from elsewhere"
    )]
    CollinearCentres {
        /// `given` or `predicted`.
        which: &'static str,
    },

    /// Two lists that belong together differ in length.
    #[error("{what}: expected {expected} numbers or entries, got {found}")]
    LengthMismatch {
        /// Which list.
        what: &'static str,
        /// The expected length.
        expected: usize,
        /// The length found.
        found: usize,
    },

    /// The rays of a view determine no camera.
    #[error("the ray map of view {view} determines no camera ({reason}); use the camera decoder's cameras instead")]
    DegenerateRays {
        /// Index of the view.
        view: usize,
        /// What is wrong.
        reason: &'static str,
    },

    /// Too little of the pictures is not sky for a metric scale.
    #[error(
        "only {open} pixels of all images are not sky: they give no metric scale; leave out images of sky alone, or use an any-view network"
    )]
    NoScale {
        /// Pixels that are not sky.
        open: usize,
    },

    /// A NaN or infinity, or a matrix without inverse, where a camera is needed.
    #[error("camera {view} is not valid: {reason}")]
    InvalidCamera {
        /// Index of the view.
        view: usize,
        /// What is wrong.
        reason: &'static str,
    },
}
