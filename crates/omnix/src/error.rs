//! Everything that can go wrong in a reconstruction.

/// Errors of the library.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OmnixError {
    /// The device, a kernel or memory.
    #[error(transparent)]
    Kernel(#[from] omnix_kernels::KernelError),
    /// Planning or running a graph.
    #[error(transparent)]
    Graph(omnix_graph::GraphError),
    /// The network and its configuration.
    #[error(transparent)]
    Model(#[from] omnix_model::ModelError),
    /// The checkpoint's files.
    #[error(transparent)]
    Weights(#[from] omnix_weights::WeightsError),
    /// The name of an embedded checkpoint, in a library that was built without it.
    #[error("the weights `{name}` are not part of this build: give the path of a checkpoint")]
    NotBuiltIn {
        /// The name.
        name: &'static str,
    },
    /// Cameras.
    #[error(transparent)]
    Geometry(#[from] omnix_geometry::GeometryError),
    /// Files in or out.
    #[cfg(feature = "io")]
    #[error(transparent)]
    Io(#[from] omnix_io::IoError),
    /// The file of a finished window of a film.
    #[cfg(feature = "io")]
    #[error(transparent)]
    Window(omnix_tensors::TensorError),
    /// A weight that is no number.
    #[error("weight `{name}` has {value} at element {index}: the checkpoint is damaged; fetch it again")]
    NonFinite {
        /// The tensor.
        name: String,
        /// First such element.
        index: usize,
        /// What it is.
        value: f32,
    },
    /// An image size or count that the network cannot take.
    #[error("{reason}")]
    Request {
        /// What is wrong and what would do.
        reason: String,
    },
    /// Trajectories of a network that has none.
    #[error("{network} has no trajectories: leave out what needs motion, or use an OmniX checkpoint")]
    NoMotion {
        /// The network.
        network: String,
    },
    /// An image, pixel or time that a field does not have.
    #[error("{reason}")]
    Query {
        /// What is wrong and what would do.
        reason: String,
    },
    /// The memory budget is below the least that works.
    #[error("a memory budget of {} MiB is too small: this run needs at least {} MiB ({hint})", mib_down(*.budget), mib_up(*.least))]
    Budget {
        /// Bytes allowed.
        budget: u64,
        /// The least that works, in bytes.
        least: u64,
        /// What would lower it.
        hint: &'static str,
    },
    /// The caller asked to stop.
    #[error("interrupted")]
    Interrupted,
}

fn mib_up(bytes: u64) -> u64 {
    bytes.div_ceil(1 << 20)
}

fn mib_down(bytes: u64) -> u64 {
    bytes >> 20
}

impl From<omnix_graph::GraphError> for OmnixError {
    fn from(error: omnix_graph::GraphError) -> Self {
        use omnix_graph::GraphError;
        match error {
            GraphError::Interrupted => Self::Interrupted,
            GraphError::Kernel(kernel) => Self::Kernel(kernel),
            // The source of a parameter is this crate's own: unwrap it, so that it is reported once.
            GraphError::Parameter { name, source } => match source.downcast::<OmnixError>() {
                Ok(own) => *own,
                Err(source) => Self::Graph(GraphError::Parameter { name, source }),
            },
            other => Self::Graph(other),
        }
    }
}
