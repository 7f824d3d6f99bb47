//! Why a model cannot be used.

/// What is wrong with a model's files.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Flaw {
    /// It cannot be read, or is not what its name says.
    #[error("it cannot be read: {0}")]
    Broken(String),

    /// A file of it is too large.
    #[error("a file of it has more than {most} bytes")]
    Bytes {
        /// The limit.
        most: u64,
    },

    /// It has too many triangles.
    #[error("it has {count} triangles, more than {most}: reduce them in a program for models")]
    Triangles {
        /// How many there are.
        count: usize,
        /// The limit.
        most: usize,
    },

    /// There is no surface in it.
    #[error("it has no triangles")]
    Empty,

    /// A position, weight or matrix that is no number.
    #[error("{0} has values that are NaN or infinite")]
    NotFinite(&'static str),

    /// An index that leads nowhere.
    #[error("{0} leads to nothing: the file is damaged")]
    Index(&'static str),

    /// A skin that no joint moves.
    #[error("its skin has no joints")]
    NoJoints,

    /// A texture with holes: surfaces are solid here.
    #[error("parts of its textures are transparent, which surfaces cannot be here")]
    SeeThrough,

    /// A feature of the format that is not read.
    #[error("it needs {0}, which is not read")]
    Unsupported(String),

    /// A catalogue without what is needed of an entry.
    #[error("its catalogue lacks a size or a model that exists")]
    Catalogue,
}
