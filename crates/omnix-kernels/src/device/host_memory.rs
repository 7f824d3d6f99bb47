//! Memory of the program as buffers of a software device.
//!
//! A software Vulkan device works in the program's own memory. What its driver allocates is a shared file of 4 KiB pages, each
//! made and cleared at its first use, and wgpu writes zeros to what it maps before anyone else writes to it. Here a buffer is anonymous
//! memory, in huge pages where the system has them, that the program fills through plain slices and the driver then imports
//! (`VK_EXT_external_memory_host`). On Linux; elsewhere no device imports.

mod memory;

#[cfg(not(target_os = "linux"))]
mod elsewhere;
#[cfg(target_os = "linux")]
mod vulkan;

#[cfg(not(target_os = "linux"))]
pub(crate) use elsewhere::{import, imports, open};
pub use memory::HostMemory;
#[cfg(target_os = "linux")]
pub(crate) use vulkan::{import, imports, open};
