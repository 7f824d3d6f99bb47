//! Where parameters come from.

use std::borrow::Cow;

/// Where parameters come from; several are read at a time.
pub trait ParameterSource: Sync {
    /// All numbers of the tensor `name`, row-major.
    ///
    /// # Errors
    /// Whatever keeps it from being read: missing, damaged, NaN or infinite.
    fn read(&self, name: &str) -> Result<Cow<'_, [f32]>, Box<dyn std::error::Error + Send + Sync>>;

    /// Called once the data returned by `read(name)` is no longer needed, so that a mapped source can drop its pages.
    fn release(&self, name: &str) {
        let _ = name;
    }
}
