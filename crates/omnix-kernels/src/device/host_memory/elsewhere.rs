//! Systems other than Linux, where no device imports memory.

use super::memory::HostMemory;

type Opened = Result<(wgpu::Device, wgpu::Queue), wgpu::RequestDeviceError>;

/// Never opens: the adapter is opened by wgpu.
pub(crate) fn open(_: &wgpu::Adapter, _: &wgpu::DeviceDescriptor<'_>) -> Option<Opened> {
    None
}

/// Never.
pub(crate) fn imports(_: &wgpu::Device) -> bool {
    false
}

/// Hands the memory back.
pub(crate) fn import(
    _: &wgpu::Device,
    _: &str,
    memory: HostMemory,
    _: wgpu::BufferUsages,
) -> Result<wgpu::Buffer, HostMemory> {
    Err(memory)
}
