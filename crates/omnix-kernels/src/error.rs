//! Why a kernel cannot be recorded or run.

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KernelError {
    /// No device to run on.
    #[error("no usable device: {reason}; install a driver, such as Mesa's lavapipe, which needs no GPU")]
    NoAdapter {
        /// What was found instead.
        reason: String,
    },
    /// A specification that the kernel does not compute, such as an odd head width.
    #[error("{kernel}: {reason}")]
    Unsupported {
        /// Kernel name.
        kernel: &'static str,
        /// What was asked and what is possible.
        reason: String,
    },
    /// One row is larger than the device lets a shader see, so splitting cannot help.
    #[error(
        "{kernel}: one row takes {bytes} bytes, but this device binds at most {limit}; use smaller images or another device"
    )]
    RowTooLarge {
        /// Kernel name.
        kernel: &'static str,
        /// Bytes of the smallest piece.
        bytes: u64,
        /// The device's limit.
        limit: u64,
    },
    /// The device lacks a feature the shader declares.
    #[error("the device lacks the feature `{feature}` that {kernel}/{variant} needs")]
    MissingFeature {
        /// Kernel name.
        kernel: &'static str,
        /// Variant name.
        variant: &'static str,
        /// As written in the shader's sidecar file.
        feature: &'static str,
    },
    /// The driver refused a shader that naga accepted.
    #[error("the driver rejected {kernel}/{variant}: {message}")]
    Pipeline {
        /// Kernel name.
        kernel: &'static str,
        /// Variant name.
        variant: &'static str,
        /// The driver's words.
        message: String,
    },
    /// The device is out of memory.
    #[error(
        "out of device memory while allocating {bytes} bytes for {what}; set a smaller memory budget, or use fewer or smaller images"
    )]
    OutOfMemory {
        /// What the buffer was for.
        what: String,
        /// Size asked for.
        bytes: u64,
    },
    /// The device went away while work was in flight.
    #[error("the device was lost: {message}; run again, or use another device")]
    DeviceLost {
        /// The driver's words.
        message: String,
    },
}
