//! What can be wrong with a configuration or a request.

use omnix_graph::GraphError;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A field of `config.json` that is absent.
    #[error("config.json has no `{field}`: {allowed}")]
    FieldMissing {
        /// The field with the path to it.
        field: String,
        /// What belongs there.
        allowed: String,
    },
    /// A field of `config.json` with a value that cannot be.
    #[error("config.json: `{field}` is {value}: {allowed}")]
    BadField {
        /// The field with the path to it.
        field: String,
        /// What is there, shortened.
        value: String,
        /// What may be there.
        allowed: String,
    },
    /// Something asked of a network that it cannot do.
    #[error("{what}: {cure}")]
    Request {
        /// What was asked.
        what: String,
        /// What can be asked instead.
        cure: String,
    },
    /// Recording failed.
    #[error(transparent)]
    Graph(#[from] GraphError),
}
